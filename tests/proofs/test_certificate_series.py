"""The pieces of the checker of certificates, against values of the same things by other means."""

import math
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from numpy.polynomial import chebyshev, hermite_e

from tests.oracles import certificate_series as cs
from tests.oracles import certificate_statement as statement
from tests.proofs.by_definition import applied, element, trial

WHOLE = {"kind": "whole"}
CORE = {"kind": "core", "centre": 0.21, "scale": 0.3, "gauge": 0.7}
UNTILTED = {**CORE, "gauge": 0.0}
OSCILLATOR = {
    "oscillator.omega": "1.3",
    "oscillator.restitution": "0.75",
    "oscillator.c1": "-0.1",
    "oscillator.epsilon": "0.5",
    "oscillator.impact": "restitution",
}
EXACT = {**OSCILLATOR, "noise.D0": "0.4", "noise.tau0": "0.6", "noise.r0": "0.7", "noise.treatment": "exact"}
REDUCED = {**EXACT, "noise.treatment": "ou-reduction", "oscillator.impact": "delta"}
PLAIN = {**OSCILLATOR, "noise.alpha": "1.7", "noise.sigma": "0.9"}
CASES = [(EXACT, WHOLE, "1.5"), (EXACT, CORE, "-2.5"), (REDUCED, CORE, "1.5"), (PLAIN, CORE, "2.0")]
CASES += [(EXACT, WHOLE, None), (EXACT, UNTILTED, None), (PLAIN, UNTILTED, None)]


def stated(parameters, basis, p, rng, harmonics=3, degrees=5):
    """A certificate with random coefficients."""
    whole = basis["kind"] == "whole"
    return {
        "quantity": "moment" if p else "lyapunov_exponent",
        "p": p,
        "parameters": parameters,
        "mu": 0.37,
        "delta": 0.5,
        "basis": basis,
        "cosine": rng.normal(size=(harmonics, degrees)).tolist(),
        "sine": rng.normal(size=(harmonics, degrees)).tolist(),
        "nodes": [-1.0, 1.0] if whole else [-0.5, 0.5],
        "values": [-1.0, 1.0],
        "tails": None if whole else [-0.5, 0.5],
        "phases": 64,
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


@pytest.mark.parametrize(("parameters", "basis", "p"), CASES)
def test_coefficients_of_the_residual_are_those_of_the_generator(parameters, basis, p, rng):
    """Against numerical derivatives of T itself, with 40 digits."""
    certificate = stated(parameters, basis, p, rng)
    model = statement.model_of(certificate)
    found = statement.read_trial(model, certificate)[0]
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


@pytest.mark.parametrize("basis", [cs.Hermite(0.3, 0.7), cs.Chebyshev()])
def test_series_lie_in_their_boxes(basis, rng):
    """At random points of boxes of several widths, for coefficients over many orders of magnitude."""
    room = rng.normal(size=(2, 4, 9)) * 10.0 ** rng.integers(-9, 3, size=(2, 4, 9))
    a = cs.intervals(room, 4, 9)
    centre, scale = float(basis.centre), float(basis.scale)
    for width in (1e-7, 1e-3, 0.1):
        left = centre + scale * rng.uniform(-1, 1 - width, size=5)
        right = left + scale * width
        grid = cs.Phases(24, 4)
        place = cs.cells(basis, left, right)
        boxes = grid.boxes(cs.expansion(basis, cs.series(a), place))
        for cell, i in zip(rng.integers(0, 5, size=12), rng.integers(0, 24, size=12), strict=True):
            s, z = rng.choice([-1.0, 1.0, rng.uniform(-1, 1)]), rng.choice([left[cell], right[cell]])
            with mpmath.workdps(40):
                phi = (int(i) + mpmath.mpf(s) / 2) * mpmath.pi / 24
                x = (mpmath.mpf(z) - centre) / scale
                t = (x - mpmath.mpf(int(place.middles[cell])) / 2**32) / place.half_widths[cell]
                linear = boxes.value[cell, i] + s * mpmath.mpf(boxes.along_phase[cell, i])
                linear += t * boxes.along_noise[cell, i]
                assert abs(summed(basis, a, phi, z) - linear) <= boxes.rest[cell, 0]


def test_a_small_box_is_enclosed_to_rounding(rng):
    """Without a width in the noise and with 4096 phases little but ½h²P″ remains."""
    basis, room = cs.Hermite(0.0, 1.0), rng.normal(size=(2, 3, 6))
    place = cs.cells(basis, np.array([0.5]), np.array([0.5]))
    boxes = cs.Phases(4096, 3).boxes(cs.expansion(basis, cs.series(cs.intervals(room, 3, 6)), place))
    h = math.pi / 8192
    assert boxes.rest[0, 0] < 0.5 * h**2 * 16 * 6 * 2 * np.abs(room).max() * 10
    assert np.abs(boxes.along_noise).max() < 1e-190


@pytest.mark.parametrize("basis", [cs.Hermite(0.0, 1.0), cs.Chebyshev()])
def test_values_and_derivatives_of_the_bases(basis):
    middles = np.array([-(1 << 31), 0, 3 << 29], dtype=object)
    x, degrees = middles.astype(float) / 2.0**32, 12
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


def test_quotients_lie_in_their_bounds(rng):
    """P/Q of random boxes with Q > 0, anywhere in them."""
    for _ in range(200):
        top = cs.Boxes(*rng.normal(size=(4, 1, 1)))
        bottom = cs.Boxes(*(rng.uniform(0.01, 0.3, size=(4, 1, 1)) * rng.choice([-1, 1], size=(4, 1, 1))))
        top = top._replace(rest=np.abs(top.rest))
        bottom = bottom._replace(value=np.full((1, 1), 1.0), rest=np.abs(bottom.rest))
        found = cs.ratio(top, bottom)
        assert found.positive.all()
        for s, t, r, q in rng.choice([-1.0, -0.3, 0.9, 1.0], size=(20, 4)):
            p = top.value + s * top.along_phase + t * top.along_noise + r * top.rest
            d = bottom.value + s * bottom.along_phase + t * bottom.along_noise + q * bottom.rest
            assert abs(p / d - found.middle) <= found.spread


def test_a_divisor_that_may_vanish_is_not_positive():
    one = np.ones((1, 1))
    found = cs.ratio(cs.Boxes(one, 0 * one, 0 * one, 0 * one), cs.Boxes(one, 0.5 * one, 0.3 * one, 0.25 * one))
    assert not found.positive.any()
    assert np.isinf(found.spread).all()


def test_cells_are_covered():
    """The half width reaches from the rounded middle to both ends."""
    basis = cs.Hermite(0.1, 0.3)
    place = cs.cells(basis, np.array([0.1, 0.4]), np.array([0.2, 0.4000001]))
    for low, high, middle, half in zip((0.1, 0.4), (0.2, 0.4000001), *place, strict=True):
        for z in (low, high):
            x = (Fraction(z) - basis.centre) / basis.scale
            assert abs(x - Fraction(middle, 2**32)) <= Fraction(half)
        assert half < (high - low) / 0.3
