"""What is bounded lies within the bounds: functions, mismatches and roundings, against evaluations of their own."""

import math
from fractions import Fraction

import numpy as np
import pytest

from fpsolve.proofs.balls import above, ball, below, precision, rounded
from fpsolve.proofs.bounds import LOWER, UPPER, Bounder, Cells, Phases, Trial
from fpsolve.proofs.certificate import BasisRecord
from fpsolve.proofs.statement import Statement, cylinder
from tests.proofs.by_definition import EXACT, REDUCED
from tests.proofs.mutations import powers, samples

CASES = {
    "core, bounded": (EXACT, {"kind": "core", "centre": 0.1, "scale": 0.2, "gauge": 0.7}, (-0.6, 0.7)),
    "core, unbounded": (REDUCED, {"kind": "core", "centre": 0.3, "scale": 1.0, "gauge": 0.15}, (-4, 4)),
    "whole": (EXACT, {"kind": "whole", "gauge": 0.0}, (-0.94, 0.94)),
}
P = 1.7


def trial(name, p=P, seed=2):
    """A positive function with coefficients that fall off, as of a certificate and as a trial; and random points."""
    stated, basis, ends = CASES[name]
    rng, others = np.random.default_rng(1), np.random.default_rng(seed)
    size = np.exp(-0.9 * np.arange(4))[:, None] * np.exp(-0.7 * np.arange(6))
    cosine, sine = (0.2 * size * rng.normal(size=(4, 6)) for _ in range(2))
    cosine[0, 0] = 1.0
    basis = basis if p else basis | {"gauge": 0.0}
    of = Trial(cylinder(Statement(**stated)), p and ball(p), 0.2, BasisRecord(**basis).basis, cosine, sine)
    about = {"p": p, "stated": stated, "mu": 0.2, "basis": basis, "cosine": cosine, "sine": sine}
    points = others.uniform(0, math.pi, 200), others.uniform(*ends, 200)
    return of, about, *points


def sampled(about, phi, z):
    """u, u_z, Lu/u − μ, or what is left of the drift, and b, at points."""
    u, u_z, mismatch, b = samples(about, z, phi)
    return *map(np.diagonal, (u, u_z, mismatch / u if about["p"] else mismatch)), b


@pytest.mark.parametrize("p", [P, None])
@pytest.mark.parametrize("name", CASES)
def test_the_mismatch_is_within_its_bounds_and_these_are_close(name, p):
    with precision():
        of, about, phi, z = trial(name, p)
        found = Bounder(of, 256).bounds(np.nextafter(z, -9) - 1e-4, z + 1e-4)
    expected, (low, high) = sampled(about, phi, z)[2], found.mismatch
    assert np.all(low - 1e-12 <= expected)
    assert np.all(expected <= high + 1e-12)
    u, _, around, _ = samples(about, z[:20], np.linspace(0, math.pi, 400))
    around = around / u if p else around
    size = np.abs(around).max(axis=0)
    assert np.all(np.abs(low[:20] - around.min(axis=0)) < 0.05 * size)
    assert np.all(np.abs(high[:20] - around.max(axis=0)) < 0.05 * size)


@pytest.mark.parametrize("name", CASES)
def test_the_drift_inward_is_within_its_bounds(name):
    with precision():
        of, about, phi, z = trial(name)
        found = Bounder(of, 256).bounds(z - 1e-4, z + 1e-4)
    u, u_z, _, b = sampled(about, phi, z)
    drift = b - of.basis.gauge - u_z / u
    assert np.all(found.inward[0] <= drift + 1e-12)
    assert np.all(drift <= found.inward[1] + 1e-12)


@pytest.mark.parametrize("width", [0.0, 1e-3, 0.05])
@pytest.mark.parametrize("name", CASES)
def test_functions_are_within_their_bounds_on_wide_cells_too(name, width):
    with precision():
        of, about, phi, z = trial(name, seed=3)
        bounds = Phases(24, 4).bounds(Cells(of.basis, z - width, z + width).modes(of.values))
    cell = np.floor(phi / math.pi * 24).astype(int)
    low, high = (each[cell, np.arange(len(z))] for each in bounds)
    for share in (-1.0, -0.4, 0.3, 1.0):
        value = sampled(about, phi, z + share * width)[0]
        assert np.all(low <= value + 1e-13)
        assert np.all(value <= high + 1e-13)


def test_where_u_is_not_positive_nothing_is_bounded():
    with precision():
        of, *_ = trial("whole")
        of.cosine[0, 0] = 0.05
        found = Bounder(of, 64).bounds(np.array([-0.5, 0.2]), np.array([-0.4, 0.3]))
    assert not np.any(found.is_positive)


@pytest.mark.parametrize("name", ["core, bounded", "core, unbounded"])
@pytest.mark.parametrize("sign", [-1, 1])
def test_what_is_left_where_u_is_held(name, sign):
    """n(φ, z) of `verify` is that of a function of φ alone, the one at which u is held; its growth by differences."""
    z, phi = sign * 0.5, np.linspace(0, math.pi, 721)
    with precision():
        of, about, *_ = trial(name)
        (held,) = Bounder(of, 512).held(np.array([z]), sign)
    u, u_z, _, _ = samples(about, np.array([z]), phi)
    column = powers(about["basis"], 6, np.array([z]))[0, :, 0]
    flat = about | {wave: (about[wave] @ column)[:, None] for wave in ("cosine", "sine")}
    before, left, after = (samples(flat, z + np.array([-1e-5, 0.0, 1e-5]), phi)[2] / u).T
    growth = sign * (after - before) / 2e-5
    for (low, high), expected in zip(
        (held.steep, held.mismatch, held.growth), (sign * u_z / u, left, growth), strict=True
    ):
        near = pytest.approx((expected.min(), expected.max()), abs=0.02 * np.abs(expected).max())
        assert (low, high) == near
        assert low <= expected.min() <= expected.max() <= high + 1e-9
    noise = of.noise
    assert held.drift == pytest.approx(sign * float(noise.drift(ball(z))))
    assert held.slope == pytest.approx(float(noise.drift(ball(z + 1e-6)) - noise.drift(ball(z - 1e-6))) / 2e-6)
    assert held.above(UPPER) == (-held.steep[0], held.mismatch[1], held.growth[1])
    assert held.above(LOWER) == (held.steep[1], -held.mismatch[0], -held.growth[0])


def test_floats_beside_balls():
    with precision():
        third = ball(1) / 3
        low, high = below(third), above(third)
        assert Fraction(low) < Fraction(1, 3) < Fraction(high)
        assert high - low <= 2 * math.ulp(low)
        near, off = rounded(np.array([third, ball(2.0), third.sqrt()], dtype=object))
        assert abs(Fraction(near[0]) - Fraction(1, 3)) <= Fraction(off[0])
        assert np.all(off < 1e-15)
        assert below(ball(0.25)) == above(ball(0.25)) == 0.25
