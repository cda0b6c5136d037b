"""What is bounded lies within the bounds: functions, mismatches and roundings, against evaluations of their own."""

import math
from fractions import Fraction

import numpy as np
import pytest
from numpy.polynomial import chebyshev, hermite_e

from fpsolve.proofs.balls import above, ball, below, precision, rounded
from fpsolve.proofs.basis import Core, Whole
from fpsolve.proofs.bounds import LOWER, UPPER, Bounder, Trial
from fpsolve.proofs.cells import Cells, Phases
from fpsolve.proofs.statement import cylinder
from tests.proofs.by_definition import EXACT

REDUCED = EXACT | {"noise.treatment": "ou-reduction"}
CASES = {
    "core, bounded": (EXACT, Core(0.1, 0.2, 0.7)),
    "core, unbounded": (REDUCED, Core(0.3, 1.0, 0.15)),
    "whole": (EXACT, Whole()),
}
P = 1.7


def trial(name, seed=1, p=P):
    """A positive function with coefficients that fall off."""
    stated, basis = CASES[name]
    rng = np.random.default_rng(seed)
    size = np.exp(-0.9 * np.arange(4))[:, None] * np.exp(-0.7 * np.arange(6))
    cosine, sine = (0.2 * size * rng.normal(size=(4, 6)) for _ in range(2))
    cosine[0, 0] = 1.0
    basis = Core(basis.centre, basis.scale, 0.0) if p is None and isinstance(basis, Core) else basis
    return Trial(cylinder(stated), None if p is None else ball(str(p)), 0.2, basis, cosine, sine)


def polynomials(basis, z):
    """B_m and its first two derivatives by numpy's polynomials, shape (3, degrees, *z.shape)."""
    found = []
    for m in range(6):
        if isinstance(basis, Core):
            series = hermite_e.HermiteE(np.eye(6)[m])
            y, scale = (z - basis.centre) / basis.scale, math.sqrt(math.factorial(m))
            found.append([series.deriv(i)(y) / scale / basis.scale**i if i else series(y) / scale for i in range(3)])
        elif m == 0:
            found.append([1 + 0 * z, 0 * z, 0 * z])
        else:
            slope = chebyshev.Chebyshev(chebyshev.chebmul(np.eye(m)[m - 1], [0.5, 0, -0.5]))
            integral = slope.integ()
            integral.coef[0] = 0.0
            found.append([integral(z), slope(z), slope.deriv()(z)])
    return np.moveaxis(np.array(found), 0, 1)


def sampled(of, phi, z):
    """u, u_φ, u_z, u_zz at points of one shape, from the definition."""
    table = polynomials(of.basis, z)
    k = np.arange(4)[:, None]
    waves = np.cos(2 * k * phi), np.sin(2 * k * phi)
    slopes = -2 * k * waves[1], 2 * k * waves[0]

    def total(waves, i):
        return sum(np.einsum("km,kn,mn->n", c, w, table[i]) for c, w in zip((of.cosine, of.sine), waves, strict=True))

    return total(waves, 0), total(slopes, 0), total(waves, 1), total(waves, 2)


def points(name, seed=2):
    rng = np.random.default_rng(seed)
    low, high = {"core, bounded": (-0.6, 0.7), "core, unbounded": (-4, 4), "whole": (-0.94, 0.94)}[name]
    return rng.uniform(0, math.pi, 200), rng.uniform(low, high, 200)


def expected_mismatch(of, phi, z, p):
    """Lu/u − μ, or what is left of the drift, from Eqs. (17)-(19) in floats."""
    noise = of.noise
    u, u_phi, u_z, u_zz = sampled(of, phi, z)
    omega, r, c1, epsilon = 1.3, 0.75, -0.1, 0.5
    kappa, unit, nu = math.log(1 - epsilon**2 * (1 - r)) / math.pi, float(noise.unit), float(noise.nu)
    term = epsilon * unit * z + epsilon**2 * c1
    h1, q1 = 0.5 * np.sin(2 * phi), 0.5 * (1 - np.cos(2 * phi))
    speed = omega + term * h1
    b = float(noise.slope) * z / (1 - z * z if noise.is_bounded else 1)
    beta = of.basis.gauge
    diffused = nu * (0.5 * u_zz + (beta - b) * u_z + (0.5 * beta**2 - b * beta) * u)
    if p is None:
        return diffused + speed * u_phi + term * q1 + kappa * speed - of.mu
    return (diffused + speed * u_phi + p * (term * q1 + kappa * speed) * u) / u - of.mu


@pytest.mark.parametrize("p", [P, None])
@pytest.mark.parametrize("name", CASES)
def test_the_mismatch_is_within_its_bounds_and_these_are_close(name, p):
    phi, z = points(name)
    with precision():
        of = trial(name, p=p)
        expected = expected_mismatch(of, phi, z, p)
        found = Bounder(of, 256).bounds(np.nextafter(z, -9) - 1e-4, z + 1e-4)
    low, high = found.mismatch
    assert np.all(low - 1e-12 <= expected)
    assert np.all(expected <= high + 1e-12)
    circle = np.linspace(0, math.pi, 400)
    around = np.array([expected_mismatch(of, circle, np.full(400, each), p) for each in z[:20]])
    size = np.abs(around).max(axis=1)
    assert np.all(np.abs(low[:20] - around.min(axis=1)) < 0.05 * size)
    assert np.all(np.abs(high[:20] - around.max(axis=1)) < 0.05 * size)


@pytest.mark.parametrize("name", CASES)
def test_the_drift_inward_is_within_its_bounds(name):
    phi, z = points(name)
    with precision():
        of = trial(name)
        u, _, u_z, _ = sampled(of, phi, z)
        drift = float(of.noise.slope) * z / (1 - z * z if of.noise.is_bounded else 1) - of.basis.gauge - u_z / u
        found = Bounder(of, 256).bounds(z - 1e-4, z + 1e-4)
    assert np.all(found.inward[0] <= drift + 1e-12)
    assert np.all(drift <= found.inward[1] + 1e-12)


@pytest.mark.parametrize("width", [0.0, 1e-3, 0.05])
@pytest.mark.parametrize("name", CASES)
def test_functions_are_within_their_bounds_on_wide_cells_too(name, width):
    phi, z = points(name, seed=3)
    with precision():
        of = trial(name)
        bounds = Phases(24, 4).bounds(Cells(of.basis, z - width, z + width).modes(of.values))
    cell = np.floor(phi / math.pi * 24).astype(int)
    low, high = (each[cell, np.arange(len(z))] for each in bounds)
    for share in (-1.0, -0.4, 0.3, 1.0):
        value = sampled(of, phi, z + share * width)[0]
        assert np.all(low <= value + 1e-13)
        assert np.all(value <= high + 1e-13)


def test_where_u_is_not_positive_nothing_is_bounded():
    with precision():
        of = trial("whole")
        of.cosine[0, 0] = 0.05
        found = Bounder(of, 64).bounds(np.array([-0.5, 0.2]), np.array([-0.4, 0.3]))
    assert not np.any(found.is_positive)


@pytest.mark.parametrize("name", ["core, bounded", "core, unbounded"])
@pytest.mark.parametrize("sign", [-1, 1])
def test_what_is_left_where_u_is_held(name, sign):
    """n(φ, z) of `factor` from its definition, and its growth with z by differences."""
    z, phi = sign * 0.5, np.linspace(0, math.pi, 721)
    with precision():
        of = trial(name)
        (held,) = Bounder(of, 512).held(np.array([z]), sign)
    noise, (u, u_phi, u_z, _) = of.noise, sampled(of, phi, np.full_like(phi, z))
    beta, nu = of.basis.gauge, float(noise.nu)

    def left(z):
        term = 0.5 * float(noise.unit) * z + 0.25 * -0.1
        h1, q1 = 0.5 * np.sin(2 * phi), 0.5 * (1 - np.cos(2 * phi))
        kappa, speed = math.log(1 - 0.25 * 0.25) / math.pi, 1.3 + term * h1
        rest = speed * u_phi / u + P * (term * q1 + kappa * speed)
        return rest + nu * (beta**2 / 2 - beta * float(noise.drift(ball(z)))) - of.mu

    growth = sign * (left(z + 1e-5) - left(z - 1e-5)) / 2e-5
    for (low, high), expected in zip(
        (held.steep, held.mismatch, held.growth), (sign * u_z / u, left(z), growth), strict=True
    ):
        near = pytest.approx((expected.min(), expected.max()), abs=0.02 * np.abs(expected).max())
        assert (low, high) == near
        assert low <= expected.min() <= expected.max() <= high + 1e-9
    assert held.drift == pytest.approx(sign * float(noise.drift(ball(z))))
    assert held.slope == pytest.approx(float(noise.drift(ball(z + 1e-6)) - noise.drift(ball(z - 1e-6))) / 2e-6)
    assert held.above(UPPER) == (-held.steep[0], held.mismatch[1], held.growth[1])
    assert held.above(LOWER) == (held.steep[1], -held.mismatch[0], -held.growth[0])


def test_floats_beside_balls():
    with precision():
        third = ball(Fraction(1, 3))
        low, high = below(third), above(third)
        assert Fraction(low) < Fraction(1, 3) < Fraction(high)
        assert high - low <= 2 * math.ulp(low)
        near, off = rounded(np.array([third, ball(2.0), third.sqrt()], dtype=object))
        assert abs(Fraction(near[0]) - Fraction(1, 3)) <= Fraction(off[0])
        assert np.all(off < 1e-15)
        assert below(ball("0.1")) < above(ball("0.1"))
        assert below(ball(0.25)) == above(ball(0.25)) == 0.25
