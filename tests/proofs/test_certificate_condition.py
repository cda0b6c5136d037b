"""The condition of the checker of certificates in cells, against its definition."""

import mpmath
import numpy as np
import pytest

from tests.oracles import certificate_condition as condition
from tests.oracles import certificate_series as cs
from tests.oracles import certificate_statement as statement
from tests.proofs.by_definition import EXACT, applied, trial
from tests.proofs.test_certificate_series import CASES, WHOLE, at_phase, drawn


def proof(basis, sign):
    """A side with a steep W."""
    whole = basis["kind"] == "whole"
    nodes, values = (np.array(x) for x in ([-1.0, -0.375, 0.5, 1.0], [-0.7, 0.4, -0.9, 0.25]))
    return statement.Side("upper", sign, 0.6, nodes, values, None if whole else np.zeros(2))


def pieces_of(trial_function):
    """u, u_z and the residual in floats."""
    return [cs.series(a) for a in (trial_function.divisor, trial_function.steep, trial_function.residual)]


def by_definition(certificate, model, side, part, phi, z):
    """u times what (*) asks to be ≥ 0, from derivatives of T itself."""
    w = part.value + part.slope * (z - mpmath.mpf(part.foot))
    moment = certificate["p"] is not None
    value = applied(certificate, phi, z, extra=lambda y: side.sign * (w * (y - z) + part.slope * (y - z) ** 2 / 2))
    nu = mpmath.mpf(model.nu.numerator) / model.nu.denominator
    return (side.delta * (trial(certificate, phi, z) if moment else 1) - side.sign * value) / nu


def summed(waves, degree, cell, phi, t):
    """A sum in Bernstein's form at a point, and how far off it may be."""
    rows = range(cell * (degree + 1), (cell + 1) * (degree + 1))
    x = (1 + t) / 2
    shares = [mpmath.binomial(degree, i) * x**i * (1 - x) ** (degree - i) for i in range(degree + 1)]
    value = sum(c * at_phase(waves.coefficients[:, row], phi) for c, row in zip(shares, rows, strict=True))
    return value, waves.rest[rows[0]] + waves.gamma * waves.sizes[rows[0]].sum()


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("stated", "basis", "p"), CASES)
def test_the_condition_in_cells(stated, basis, p, sign, rng):
    """At random phases, at the ends of parts of cells and within them."""
    certificate = drawn(stated, basis, p, rng)
    model = statement.model_of(certificate)
    found, side = statement.read_trial(model, certificate), proof(basis, sign)
    parts = condition.divided(side.nodes, side.values, np.array([1]), 16)
    place = cs.cells(found.basis, parts.left, parts.right)
    expansions = [cs.expansion(found.basis, s, place) for s in pieces_of(found)]
    waves = condition._sum(condition.weights(model, found, side, parts, place), expansions)
    degree = len(waves.sizes) // 16 - 1
    for cell, t in ((0, -1), (9, 1), (15, rng.uniform(-1, 1))):
        with mpmath.workdps(40):
            phi, t = mpmath.mpf(rng.uniform(0, 3)), mpmath.mpf(t)
            x = mpmath.mpf(int(place.middles[cell])) / 2**cs.BITS + t * place.half_widths[cell]
            z = float(found.basis.centre) + x * float(found.basis.scale)
            part = condition.Parts(*(a[cell] for a in parts))
            value = by_definition(certificate, model, side, part, phi, z) * (1 - z**2 if model.bounded else 1)
            other, loose = summed(waves, degree, cell, phi, t)
            assert abs(value - other) <= loose
            assert loose < 1e-4


@pytest.mark.parametrize("p", [1.5, None])
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("cell", [0, 2])
def test_the_ends_of_the_whole_interval(p, sign, cell, rng):
    """Near ±1 the condition is bounded from below; by itself at the inner end of the cell."""
    certificate = drawn(EXACT, WHOLE, p, rng)
    certificate["cosine"][0][0] = 30.0  # u > 0
    model = statement.model_of(certificate)
    found, side = statement.read_trial(model, certificate), proof(WHOLE, sign)
    parts = condition.Parts(
        *(a[[-1 if cell else 0]] for a in condition.divided(side.nodes, side.values, np.array([cell]), 8))
    )
    place = cs.cells(found.basis, parts.left, parts.right)
    expansions = [cs.expansion(found.basis, s, place) for s in pieces_of(found)]
    waves = condition._sum(condition.weights(model, found, side, parts, place, flat=True), expansions)
    part, outward = condition.Parts(*(a[0] for a in parts)), 1 if cell else -1
    for t in (-outward, 0, 0.9 * outward, outward * (1 - 1e-9)):
        with mpmath.workdps(40):
            phi, x = mpmath.mpf(rng.uniform(0, 3)), mpmath.mpf(int(place.middles[0])) / 2**cs.BITS
            z = x + t * mpmath.mpf(place.half_widths[0])
            value = by_definition(certificate, model, side, part, phi, z) * (1 + outward * z)
            other, loose = summed(waves, len(waves.sizes) - 1, 0, phi, mpmath.mpf(t))
            assert other <= value + loose
            assert t != -outward or abs(other - value) <= loose


def test_parts_of_cells():
    """They cover the cell and keep its W."""
    nodes, values = np.array([0.1, 0.7, 0.9]), np.array([-0.3, 1e5, 1e5 + 1])
    parts = condition.divided(nodes, values, np.array([0, 1]), 4)
    assert parts.left[0] == 0.1
    assert parts.right[3] == parts.left[4] == 0.7
    np.testing.assert_array_equal(parts.right[:3], parts.left[1:4])
    np.testing.assert_array_equal(parts.foot, np.repeat(nodes[:-1], 4))
    np.testing.assert_array_equal(parts.value, np.repeat(values[:-1], 4))
    np.testing.assert_allclose(parts.slope, np.repeat(np.diff(values) / np.diff(nodes), 4))
