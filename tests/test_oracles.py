"""Exponents of linear systems in the plane by oracles alone: two that share nothing give each number.

Some are by Fourier series alone; elements of `fpsolve` are the second method of these.

ẍ + 2bẋ + (k + ξ)x = 0 but where matrices stand; J = [[0, −1], [1, 0]].
"""

import math

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

from tests.oracles import closed_forms, moment_hierarchy, phase_circle

TURN, SADDLE, SHEAR = [[0.0, -1.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, -1.0]], [[-1.0, 0.0], [5.0, -1.0]]
NEGATIVE, NOISY_DAMPING = [[0.0, 1.0], [-1.0, 0.1]], [[0.0, 0.0], [0.0, 0.5]]
FLIP = [[-1.0, 1.0], [1.0, -1.0]]


def oscillator(stiffness=1.0, damping=0.1):
    return np.array([[0.0, 1.0], [-stiffness, -2 * damping]])


def noisy_stiffness(size=0.5):
    return [[0.0, 0.0], [-size, 0.0]]


def agree(expected, *found, abs=2e-12):
    assert [*found] == pytest.approx([expected] * len(found), abs=abs)


@pytest.mark.parametrize(
    ("stiffness", "expected"),
    [(1.0, 0.110230251830114), (0.25, 0.218593277235239), (-1.0, 0.829060894212746), (0.0, 0.289308259834239)],
)
def test_undamped_oscillator(stiffness, expected):
    drift, noise = oscillator(stiffness, 0.0), noisy_stiffness(1.0)
    made = phase_circle.white(drift, [noise])
    agree(expected, closed_forms.white_stiffness(stiffness, 1.0), phase_circle.lyapunov_exponent(made, 100))


@pytest.mark.parametrize(("p", "expected"), [(2, 2 ** (1 / 3)), (4, 42 ** (1 / 3))])
def test_free_particle(p, expected):
    drift, noise = oscillator(0.0, 0.0), noisy_stiffness(1.0)
    agree(expected, moment_hierarchy.white_noise_exponent(drift, [noise], p))
    agree(expected, phase_circle.moment_exponent(phase_circle.white(drift, [noise]), p, 60), abs=1e-11)


def test_damped_oscillator():
    drift, noise = oscillator(), noisy_stiffness()
    made, expected = phase_circle.white(drift, [noise]), -0.0688672519733493
    agree(expected, closed_forms.white_stiffness(1.0, 0.5, 0.1), phase_circle.lyapunov_exponent(made, 60))
    for p, moment in ((2, -0.0742396424254463), (4, -0.0145544380585)):
        agree(moment, moment_hierarchy.white_noise_exponent(drift, [noise], p))
        agree(moment, phase_circle.moment_exponent(made, p, 40))


def test_where_its_stability_ends():
    def of(exponent):
        return brentq(lambda square: exponent(math.sqrt(square)), 0.1, 1.5, xtol=1e-15)

    def circle(size):
        return phase_circle.white(oscillator(), [noisy_stiffness(size)])

    for p, expected in ((2, 0.4), (4, 0.259119496855)):
        closed = of(lambda s, p=p: moment_hierarchy.white_noise_exponent(oscillator(), [noisy_stiffness(s)], p))
        agree(expected, closed, of(lambda s, p=p: phase_circle.moment_exponent(circle(s), p, 24)))
    closed = of(lambda s: closed_forms.white_stiffness(1.0, s, 0.1))
    agree(0.882782300544, closed, of(lambda s: phase_circle.lyapunov_exponent(circle(s), 80)))


def test_damped_oscillator_with_a_wall():
    drift, noise, expected = oscillator(), noisy_stiffness(), -0.13970934720001
    made = phase_circle.white(drift, [noise])
    agree(expected, closed_forms.white_stiffness(1.0, 0.5, 0.1, 0.8), phase_circle.lyapunov_exponent(made, 60, 0.8))
    agree(-0.2124371993354, phase_circle.moment_exponent(made, 2, 40, 0.8))


def test_noise_in_the_damping_with_a_wall():
    """Noise that moves the phase neither where x = 0 nor where v = 0."""
    stratonovich = phase_circle.white(NEGATIVE, [NOISY_DAMPING])
    ito = phase_circle.white(NEGATIVE, [NOISY_DAMPING], "ito")
    for made, value in ((stratonovich, 0.0103221483130), (ito, -0.0523330808550)):
        agree(value, phase_circle.lyapunov_exponent(made, 40, 0.8))
    for p, value in ((1, 0.0582175109642), (2, 0.2147187990537)):
        agree(value, phase_circle.moment_exponent(stratonovich, p, 30, 0.8))


def test_telegraph_noise():
    def states(size, damping):
        return [oscillator(1 + size, damping), oscillator(1 - size, damping)]

    made = phase_circle.chain(states(0.5, 0.05), FLIP)
    agree(-0.03297945668172, phase_circle.lyapunov_exponent(made, 30))
    hierarchy = moment_hierarchy.moment_lyapunov(states(0.5, 0.05), FLIP, 2)
    agree(-0.0332610990213474, hierarchy, phase_circle.moment_exponent(made, 2, 30))
    hierarchy = brentq(lambda a: moment_hierarchy.moment_lyapunov(states(a, 0.1), FLIP, 2), 0.5, 1.2, xtol=1e-15)
    agree(0.81989159175, hierarchy)
    agree(0, phase_circle.moment_exponent(phase_circle.chain(states(hierarchy, 0.1), FLIP), 2, 40))


def test_ornstein_uhlenbeck_noise():
    def of(s, count):
        noise = 1.0, s / math.sqrt(2)
        return moment_hierarchy.ornstein_uhlenbeck_exponent(oscillator(), noisy_stiffness(1.0), *noise, 2, count)

    gaps = [abs(of(1.0, count) - 0.0940860185210208) for count in (4, 7, 10, 20)]
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[-1] < 2e-15
    expected = brentq(lambda s: of(s, 20), 0.5, 1.3, xtol=1e-15)
    agree(0.9103699720234, expected)
    for s, value in ((1.0, 0.0940860185210208), (expected, 0.0)):
        made = phase_circle.ornstein_uhlenbeck(oscillator(), noisy_stiffness(1.0), 1.0, s / math.sqrt(2), 20)
        agree(value, phase_circle.moment_exponent(made, 2, 24, start=value + 1e-3))


def test_a_saddle_that_turns():
    made = phase_circle.white(SADDLE, [TURN])
    exponent, second, at_minus_one = closed_forms.saddle_and_turning()
    agree(exponent, phase_circle.lyapunov_exponent(made, 30))
    agree(second, moment_hierarchy.white_noise_exponent(SADDLE, [TURN], 2), phase_circle.moment_exponent(made, 2, 30))
    agree(at_minus_one, -0.2460954174313, phase_circle.moment_exponent(made, -1, 30))


def test_shear_that_turns():
    """I(0) = −min Λ(p)."""
    made = phase_circle.white(SHEAR, [TURN])
    agree(-0.352315956524213, phase_circle.lyapunov_exponent(made, 40))
    hierarchy = moment_hierarchy.white_noise_exponent(SHEAR, [TURN], 2)
    agree(0.4853222371891, hierarchy, phase_circle.moment_exponent(made, 2, 40))
    by_series = minimize_scalar(lambda p: phase_circle.moment_exponent(made, p, 24), (0.4, 0.55, 0.7), tol=1e-7).fun
    agree(-0.0947751140996, by_series)


def test_noise_of_ito_has_another_drift_where_its_matrix_is_not_nilpotent():
    for noise, differs in ((noisy_stiffness(), False), (NOISY_DAMPING, True)):
        one, other = (
            moment_hierarchy.white_noise_exponent(oscillator(), [noise], 2, each) for each in ("stratonovich", "ito")
        )
        assert (abs(one - other) > 1e-3) is differs


def test_two_white_noises():
    """dx = ½cx dt + x∘dW₁ + Jx∘dW₂: ‖x‖^p alone, as Jx only turns; Λ(p) = ½cp + ½p²."""
    noises = [np.eye(2), TURN]
    for p in (2, 4):
        expected = 0.15 * p + 0.5 * p**2
        agree(expected, moment_hierarchy.white_noise_exponent(0.15 * np.eye(2), noises, p))
        agree(expected, phase_circle.moment_exponent(phase_circle.white(0.15 * np.eye(2), noises), p, 8))


def test_bounded_noise_and_a_harmonic_load():
    steady, driven, law = oscillator(1.0, 0.05), noisy_stiffness(1.0), (0.4, 2.0, 0.3)
    made = phase_circle.bounded(steady, driven, *law, 16)
    agree(0.0372304328376, phase_circle.lyapunov_exponent(made, 60), abs=1e-12)
    hierarchy = moment_hierarchy.bounded_exponent(steady, driven, *law, 2, 12)
    agree(0.0778013340478035, hierarchy, phase_circle.moment_exponent(made, 2, 24, start=0.0779))
    agree(2 * 0.0496213505039, moment_hierarchy.harmonic_exponent(steady, driven, 0.4, 2.0, 2), abs=1e-12)
    known = (0.05, 0.4, 0.1129960646376), (0.05, 0.2, 0.01664268566608), (0.1, 0.3, -0.0352313732)
    for damping, mu, expected in known:
        each = oscillator(1.0, damping), driven, mu, 2.0
        load = moment_hierarchy.harmonic_exponent(*each, 2, noisy_stiffness(0.3))
        agree(expected, load, moment_hierarchy.bounded_exponent(*each, 0.0, 2, 20, noisy_stiffness(0.3)), abs=1e-12)
