"""Systems whose phase never leaves a ray: Λ(p) follows from two scalar problems, known in closed form."""

import math

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, moment_lyapunov, sensitivities
from fpsolve.arrays import identity
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent.function import nonzero_root
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, Problem, White

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
        assert problem.invariant_ray is not None
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


def smaller_moment(noise, p, blocks):
    """lim ln E min(e^(pa), e^(pb))/t, for a and b of one Gaussian W(t), by its integral at t = 2,000 and 4,000.

    The integral is carried by one end, or by the W at which a = b; then it has a factor t^(−½).
    """
    (first, strong), (second, weak) = blocks
    density = noise.spectral_density(0.0)

    def log_mean(time):
        w = np.linspace(-6, 6, 400_001) * density * time
        exponent = np.minimum(p * (first * time + strong * w), p * (second * time + weak * w)) - 0.5 * w**2 / (
            density * time
        )
        return exponent.max() + math.log(np.trapezoid(np.exp(exponent - exponent.max()), w)) - 0.5 * math.log(time)

    return (log_mean(4000.0) - log_mean(2000.0)) / 2000.0


@pytest.mark.parametrize("name", ["triangular", "diagonal", "the other way"])
@pytest.mark.parametrize("p", [-1.0, -0.6])
def test_negative_moments_are_the_smaller_of_two(name, p):
    """Between the ends too: of a = −0.3t + 0.4W and b = −0.1t + W that where a = b decides at p = −1."""
    own, blocks = SYSTEMS[name]
    expected = smaller_moment(NOISES["OU"], p, blocks)
    for noise in (NOISES["OU"], NOISES["white"]):
        solver = ExponentSolver(Problem(turned(own, 0.7), noise))
        found = solver.solution(p)
        assert found.error < 1e-8
        assert found.pair.value == pytest.approx(expected, abs=2e-4)  # ln 2/(2 · 2,000) where a = b
        slope = (solver.solution(p + 1e-3).pair.value - solver.solution(p - 1e-3 * (p > -1)).pair.value) / (
            1e-3 * (1 + (p > -1))
        )
        assert found.pair.derivative == pytest.approx(slope, abs=2e-3)


def test_negative_moments_in_the_sense_of_ito():
    """That of Itô is that of Stratonovich with −½s²k² in the rates, also between two rates."""
    own, _ = SYSTEMS["diagonal"]
    noise = White(0.7, "ito")
    moved = PlaneSystem([*own.terms, CoefficientMatrix(0, ((0.5 * 0.49 * 0.16, 0.0), (0.0, 0.5 * 0.49)))])
    for p in (-0.9, -3.0):
        found, expected = (
            ExponentSolver(Problem(*each)).solution(p) for each in ((moved, noise), (own, NOISES["white"]))
        )
        assert found.pair.value == pytest.approx(expected.pair.value, abs=1e-10)


@pytest.mark.slow
def test_negative_moments_are_the_limit_of_systems_without_such_a_ray():
    """Λ(p) for −1 < p < 0 is continuous where the ray ceases to be invariant: a second method on each side."""
    free, driven = ((-0.3, 0.0), (0.5, -0.1)), ((0.4, 0.0), (0.2, 1.0))
    whole = ExponentSolver(Problem(system(free, driven), NOISES["white"])).solution(-0.5).pair.value
    off = [
        whole
        - ExponentSolver(Problem(system(((-0.3, size), free[1]), driven), NOISES["white"])).solution(-0.5).pair.value
        for size in (1e-2, 1e-3, 1e-4)
    ]
    assert 0 < off[2] < off[1] / 3 < off[0] / 9
    assert off[2] < 3e-3


def test_classes_have_names():
    own, blocks = SYSTEMS["triangular"]
    p = np.array([-0.5, 2.0])
    across, along = blocks  # (0, 1) spans what is invariant
    found = moment_lyapunov(Problem(own, NOISES["OU"]), p)
    assert [each.is_along for each in found.classes] == [True, False]
    for each, block in zip(found.classes, (along, across), strict=True):
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
    """ln ‖x‖ ≈ |W| for diag(ξ, −ξ): Λ″(0) is s² from the right, 0 from the left, and Λ(p) = 0 for p < 0."""
    solver = ExponentSolver(Problem(system(((0.1, 0.0), (0.0, 0.1)), ((1.0, 0.0), (0.0, -1.0))), NOISES["white"]))
    with pytest.raises(NoSuchExponent, match=r"Λ″\(p\) jumps"):
        solver.variance_rate()
    assert solver.solution(-2.0).pair.value == pytest.approx(-0.2, abs=1e-9)
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
    with pytest.raises(NoSuchExponent, match=r"never leaves the ray at phi = 1\.5708, .* choose p >= -1"):
        moment_lyapunov(Problem(own, NOISES["OU"]), -1.5)
    with pytest.raises(ValueError, match=r"does not pass the ray of a jump, phi = 1\.5708: .* remove the jump"):
        Problem(PlaneSystem(own.terms, [Jump(math.pi / 2, -0.1)]), NOISES["OU"])
    with pytest.raises(NoSuchExponent, match="remove the jumps"):
        moment_lyapunov(Problem(PlaneSystem(own.terms, [Jump(math.atan2(-1, 7), -0.1)]), NOISES["OU"]), 1.0)
    with pytest.raises(NotConverged, match="no positive eigenfunction"):
        ExponentSolver(Problem(own, NOISES["OU"])).pair(1.0)


def test_others_have_none():
    for free in (((0.0, 1.0), (-1.0, 0.0)), ((0.0, 1.0), (1.0, 0.0)), ((0.0, 1.0), (0.0, 0.0))):
        assert Problem(system(free, ((0.0, 0.0), (-1.0, 0.0))), NOISES["OU"]).invariant_ray is None
