"""The pieces of the checker of certificates, against values of the same things by other means."""

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from numpy.polynomial import chebyshev, hermite_e

from tests.oracles import certificate_series as cs
from tests.oracles import certificate_statement as statement
from tests.proofs.by_definition import EXACT, PLAIN, REDUCED, applied, element, trial

WHOLE = {"kind": "whole"}
CORE = {"kind": "core", "centre": 0.21, "scale": 0.3, "gauge": 0.7}
UNTILTED = {**CORE, "gauge": 0.0}
CASES = [(EXACT, WHOLE, 1.5), (EXACT, CORE, -2.5), (REDUCED, CORE, 1.5), (PLAIN, CORE, 2.0)]
CASES += [(EXACT, WHOLE, None), (EXACT, UNTILTED, None), (PLAIN, UNTILTED, None)]


def drawn(stated, basis, p, rng, harmonics=3, degrees=5):
    """A certificate with random coefficients."""
    return {
        "p": p,
        "stated": stated,
        "mu": 0.37,
        "basis": basis,
        "cosine": rng.normal(size=(harmonics, degrees)).tolist(),
        "sine": rng.normal(size=(harmonics, degrees)).tolist(),
    }


def summed(basis, a, phi, z):
    """The interval of a series of intervals at a point."""
    phi, x = mpmath.mpf(phi), (mpmath.mpf(z) - float(basis.centre)) / float(basis.scale)
    n = a.shape[-1]
    if isinstance(basis, cs.Hermite):
        table = [element({"kind": "core", "centre": 0.0, "scale": 1.0}, m, x) for m in range(n)]
    else:
        table = [mpmath.cos(m * mpmath.acos(x)) for m in range(n)]
    waves = [[f(2 * k * phi) for k in range(a.shape[1])] for f in (mpmath.cos, mpmath.sin)]
    middle = np.vectorize(lambda c: mpmath.mpf(c.mid._mpi_[0]), otypes=[object])(a)
    return sum(middle[i, k, m] * waves[i][k] * table[m] for i, k, m in np.ndindex(a.shape))


@pytest.mark.parametrize(("stated", "basis", "p"), CASES)
def test_coefficients_of_the_residual_are_those_of_the_generator(stated, basis, p, rng):
    """Against numerical derivatives of T itself, with 40 digits."""
    certificate = drawn(stated, basis, p, rng)
    model = statement.model_of(certificate)
    found = statement.read_trial(model, certificate)
    with mpmath.workdps(40):
        for phi, z in ((0.3, 0.125), (1.9, -0.375), (2.7, 0.5)):
            factor = 1 - z**2 if model.bounded and basis["kind"] == "core" else 1
            value = factor * applied(certificate, mpmath.mpf(phi), mpmath.mpf(z))
            assert abs(summed(found.basis, found.residual, phi, z) - value) < 1e-30
            u = trial(certificate, phi, mpmath.mpf(z))
            assert abs(summed(found.basis, found.function, phi, z) - u) < 1e-35
            steep = mpmath.diff(lambda y, phi=phi: trial(certificate, phi, y), z)
            assert abs(summed(found.basis, found.steep, phi, z) - steep) < 1e-30
    widths = [v.delta for v in found.residual.flat]
    assert max(float(w.b) for w in widths) < 1e-45


def at_phase(a, phi):
    """Σ_k a[0, k] cos 2kφ + a[1, k] sin 2kφ."""
    k = range(a.shape[-1])
    return sum(mpmath.mpf(a[0, i]) * mpmath.cos(2 * i * phi) + mpmath.mpf(a[1, i]) * mpmath.sin(2 * i * phi) for i in k)


@pytest.mark.parametrize("basis", [cs.Hermite(0.3, 0.7), cs.Chebyshev()])
def test_series_are_their_taylor_polynomials(basis, rng):
    """At random points of cells of several widths, for coefficients over many orders of magnitude."""
    room = rng.normal(size=(2, 4, 9)) * 10.0 ** rng.integers(-9, 3, size=(2, 4, 9))
    a = cs.intervals(room, 4, 9)
    centre, scale = float(basis.centre), float(basis.scale)
    for width in (1e-7, 1e-3, 0.1):
        left = centre + scale * rng.uniform(-1, 1 - width, size=5)
        right = left + scale * width
        place = cs.cells(basis, left, right)
        found = cs.expansion(basis, cs.series(a), place)
        for cell in rng.integers(0, 5, size=6):
            z = rng.choice([left[cell], right[cell], (left[cell] + right[cell]) / 2])
            with mpmath.workdps(40):
                phi, x = mpmath.mpf(rng.uniform(0, math.pi)), (mpmath.mpf(z) - centre) / scale
                t = (x - mpmath.mpf(int(place.middles[cell])) / 2**cs.BITS) / place.half_widths[cell]
                kept = sum(t**j * at_phase(found.coefficients[j, :, cell], phi) for j in range(cs.ORDERS))
                loose = found.gamma * cs.ORDERS * found.sizes[:, cell].sum()
                assert abs(t) <= 1
                assert abs(summed(basis, a, phi, z) - kept) <= found.rest[cell] + loose
        assert (found.rest < 1e4 * np.abs(room).max() * width**cs.ORDERS + 1e-14).all()


@pytest.mark.parametrize("degree", [1, 4, 8])
def test_the_form_of_bernstein(degree, rng):
    """The same polynomial, with its values at both ends."""
    powers, t = rng.normal(size=degree + 1), rng.uniform(-1, 1)
    form = cs.bernstein(degree) @ powers
    x = (1 + t) / 2
    value = sum(c * math.comb(degree, i) * x**i * (1 - x) ** (degree - i) for i, c in enumerate(form))
    assert value == pytest.approx(np.polynomial.polynomial.polyval(t, powers), abs=1e-13)
    assert form[[0, -1]] == pytest.approx(np.polynomial.polynomial.polyval(np.array([-1, 1]), powers), abs=1e-13)
    assert np.abs(cs.bernstein(degree)).max() <= 1


def test_waves_are_not_below_their_bounds(rng):
    """Anywhere in cells of the phase; and the bounds are next to the least value where it is in a middle."""
    coefficients, grid = rng.normal(size=(2, 3, 4)), cs.Phases(24, 4)
    sizes = np.abs(coefficients).sum(axis=0)
    bounds, values = grid.bounds(cs.Waves(coefficients, sizes, np.array([0.0, 0.5, 0.0]), 1e-15))
    for n, i in np.ndindex(3, 24):
        for s in (-1, rng.uniform(-1, 1), 1):
            phi = (i + mpmath.mpf(s) / 2) * mpmath.pi / 24
            assert bounds[n, i] <= at_phase(coefficients[:, n], phi) - (0.5 if n == 1 else 0)
        middle = at_phase(coefficients[:, n], i * mpmath.pi / 24) + (0.5 if n == 1 else 0)
        assert middle <= values[n, i] <= middle + 1e-12
    wave = cs.waves(cs.intervals(np.array([[[2.0], [-1.0]], [[0.0], [0.0]]]), 2, 1)[..., 0])
    bounds, values = cs.Phases(4096, 2).bounds(wave)
    assert bounds.min() == pytest.approx(1, abs=1e-6)
    assert values.min() == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("basis", [cs.Hermite(0.0, 1.0), cs.Chebyshev()])
def test_values_and_derivatives_of_the_bases(basis):
    x, degrees = np.array([-0.5, 0.0, 0.375]), 12
    middles = np.array([int(v * 2**cs.BITS) for v in x], dtype=object)
    table, derivative = basis.table(middles, degrees), basis.derivative(degrees)
    for m in range(degrees):
        unit = np.eye(degrees)[m]
        if isinstance(basis, cs.Hermite):
            norm = math.sqrt(math.factorial(m))
            value, slope = (hermite_e.hermeval(x, c) / norm for c in (unit, hermite_e.hermeder(unit)))
        else:
            value, slope = (chebyshev.chebval(x, c) for c in (unit, chebyshev.chebder(unit)))
        np.testing.assert_allclose(table[:, m], value, rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(table @ (unit @ derivative), slope, rtol=1e-12, atol=1e-13)


def test_cells_are_covered():
    """The half width reaches from the rounded middle to both ends."""
    basis = cs.Hermite(0.1, 0.3)
    place = cs.cells(basis, np.array([0.1, 0.4]), np.array([0.2, 0.4000001]))
    for low, high, middle, half in zip((0.1, 0.4), (0.2, 0.4000001), *place, strict=True):
        for z in (low, high):
            x = (Fraction(z) - basis.centre) / basis.scale
            assert abs(x - Fraction(middle, 2**cs.BITS)) <= Fraction(half)
        assert half < (high - low) / 0.3
