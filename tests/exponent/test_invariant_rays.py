"""Systems whose phase never leaves a ray: Λ(p) follows from two scalar problems, known in closed form."""

import math

import numpy as np
import pytest

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, moment_lyapunov, sensitivities
from fpsolve.arrays import identity
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent.root import nonzero_root
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, White

NOISES = {
    "OU": OrnsteinUhlenbeck(alpha=1.0, sigma=0.7),
    "white": White(0.7),
    "telegraph": MarkovChain.telegraph(0.5, 1.0),
}


def scalar(noise, p, growth, strength):
    """Λ(p) of ȧ = (growth + strength ξ) a: from the Gaussian ∫ξ dt, or the two states."""
    if noise is NOISES["telegraph"]:
        return p * growth - 1 + math.sqrt(1 + (0.5 * p * strength) ** 2)
    return p * growth + 0.5 * (p * strength) ** 2 * noise.spectral_density(0.0)


def system(free, driven, jumps=()):
    return PlaneSystem([CoefficientMatrix(0, free), CoefficientMatrix(1, driven, identity)], jumps)


SYSTEMS = {
    "triangular": (system(((-0.3, 0.0), (0.5, -1.0)), ((0.4, 0.0), (0.2, -1.0))), [(-0.3, 0.4), (-1.0, -1.0)]),
    "the other way": (system(((-1.0, 0.0), (0.5, -0.3)), ((-0.2, 0.0), (0.2, 0.4))), [(-1.0, -0.2), (-0.3, 0.4)]),
    "diagonal": (system(((-0.3, 0.0), (0.0, -0.1)), ((0.4, 0.0), (0.0, 1.0))), [(-0.3, 0.4), (-0.1, 1.0)]),
}


def turned(own, angle):
    """The same system in rotated coordinates."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s], [s, c]])
    return PlaneSystem(
        [CoefficientMatrix(each.order, (turn @ np.array(each.matrix) @ turn.T).tolist(), each.g) for each in own.terms]
    )


@pytest.mark.parametrize("name", SYSTEMS)
@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_moments_are_the_larger_of_two(name, noise):
    own, blocks = SYSTEMS[name]
    p = np.array([0.5, 1.0, 2.0, 3.5])
    expected = np.max([[scalar(noise, each, *block) for each in p] for block in blocks], axis=0)
    for problem in (Problem(own, noise), Problem(turned(own, 0.7), noise)):
        assert problem.invariant_rays
        solver = ExponentSolver(problem)
        found = solver.moments(p)
        assert np.all(np.abs(found.value - expected) <= found.error_estimate + 1e-14)
        assert found.error_estimate.max() < 1e-8
        exponent = solver.lyapunov_exponent()
        assert abs(exponent.value - max(growth for growth, _ in blocks)) <= exponent.error_estimate + 1e-14 < 1e-8


def test_index():
    """Of −0.3p + 0.08·0.49p² and −0.1p + 0.5·0.49p² the latter is 0 at p = 0.1/0.245 first, where the other is < 0."""
    index = nonzero_root(ExponentSolver(Problem(SYSTEMS["diagonal"][0], NOISES["white"])))
    assert index.value == pytest.approx(0.1 / 0.245, rel=1e-8)


def test_one_number_for_all_rays():
    """ẋ = (−0.1 + ξ) x has no phase to speak of, and Λ(p) for negative p too."""
    both = system(((-0.1, 0.0), (0.0, -0.1)), ((1.0, 0.0), (0.0, 1.0)))
    found = moment_lyapunov(Problem(both, NOISES["OU"]), [-2.0, 2.0])
    np.testing.assert_allclose(found.value, [scalar(NOISES["OU"], p, -0.1, 1.0) for p in (-2.0, 2.0)], atol=1e-9)


def test_classes_have_names():
    own, blocks = SYSTEMS["triangular"]
    p = np.array([-0.5, 2.0])
    across, along = blocks  # (0, 1) spans what is invariant
    found = ExponentSolver(Problem(own, NOISES["OU"])).by_class(p)
    assert [each.is_along for each in found] == [True, False]
    for each, block in zip(found, (along, across), strict=True):
        assert each.phase == pytest.approx(math.pi / 2)
        assert each.lyapunov_exponent.value == pytest.approx(block[0], abs=1e-9)
        np.testing.assert_allclose(each.value, [scalar(NOISES["OU"], one, *block) for one in p], atol=1e-9)
    assert (
        moment_lyapunov(
            Problem(system(((0.0, 1.0), (-1.0, 0.0)), ((0.0, 0.0), (-1.0, 0.0))), NOISES["OU"]), 1.0
        ).classes
        == ()
    )
    both = ExponentSolver(Problem(SYSTEMS["diagonal"][0], NOISES["OU"])).by_class([])
    assert [(each.phase, each.is_along) for each in both] == [(0.0, True), (pytest.approx(math.pi / 2), True)]


def test_one_rate_has_no_variance():
    """ln ‖x‖ ≈ |W| for diag(ξ, −ξ): Λ″(0) is s² from the right, 0 from the left."""
    solver = ExponentSolver(Problem(system(((0.1, 0.0), (0.0, 0.1)), ((1.0, 0.0), (0.0, -1.0))), NOISES["white"]))
    with pytest.raises(NoSuchExponent, match=r"Λ″\(p\) jumps"):
        solver.variance_rate()
    assert not nonzero_root(solver)


def test_derivatives_are_those_of_the_larger_rate():
    """Λ(p) = max(−ap + ½p²s²0.16, −bp + ½p²s²), which changes at p = 2(b − a)/0.84s² from the first to the second."""
    rates = "-a*x + 0.4*xi*x + c*y", "0.5*x - b*y - xi*y"
    system = PlaneSystem.of_equations(("x", "y"), rates, {"a": 0.3, "b": 1.0, "c": 0.0})
    found = sensitivities(Problem(system, White(s=0.7)), [1.0, 4.0])
    assert [str(note) for note in found.notes if "system.c" in note]  # both drive each other for any other c
    expected = [
        {"system.a": -1.0, "system.b": 0.0, "noise.s": 0.16 * 0.7},
        {"system.a": 0.0, "system.b": -4.0, "noise.s": 16 * 0.7},
        {"system.a": -1.0, "system.b": 0.0, "noise.s": 0.0},
    ]
    for slopes, numbers in zip((*found.moments, found.indices["lyapunov_exponent"]), expected, strict=True):
        assert {key: each.value for key, each in slopes.items()} == pytest.approx(numbers, abs=1e-9)


def test_refused():
    own, _ = SYSTEMS["triangular"]
    with pytest.raises(NotConverged, match=r"along the ray at phi = 1\.5708, across .* choose p >= 0") as failure:
        moment_lyapunov(Problem(own, NOISES["OU"]), [-0.5, 1.0, -1.5])
    assert failure.value.partial.p.tolist() == [1.0]
    with pytest.raises(ValueError, match=r"does not pass the ray of a jump, phi = 1\.5708: .* remove the jump"):
        Problem(PlaneSystem(own.terms, [Jump(math.pi / 2, -0.1)]), NOISES["OU"])
    with pytest.raises(NoSuchExponent, match="remove the jumps"):
        moment_lyapunov(Problem(PlaneSystem(own.terms, [Jump(math.atan2(-1, 7), -0.1)]), NOISES["OU"]), 1.0)
    with pytest.raises(NotConverged, match="no positive eigenfunction"):
        ExponentSolver(Problem(own, NOISES["OU"])).pair(1.0)


def test_others_have_none():
    for free in (((0.0, 1.0), (-1.0, 0.0)), ((0.0, 1.0), (1.0, 0.0)), ((0.0, 1.0), (0.0, 0.0))):
        assert Problem(system(free, ((0.0, 0.0), (-1.0, 0.0))), NOISES["OU"]).invariant_rays == ()
