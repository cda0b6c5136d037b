"""A sample of `tests.random_planar`, and its oracle against closed forms and other codes."""

import math

import numpy as np
import pytest

from tests.oracles import filtered, moment_hierarchy, phase_circle, planar
from tests.random_planar import drawn, numbers

STEADY, DRIVEN = np.array([[-0.2, 1.1], [-0.7, 0.1]]), np.array([[0.3, -0.4], [0.5, 0.2]])


SAMPLE = (0, 1, 2, 3, 4, 5, 7, 8, 9, 10, 11, 12, 23, 25, 26, 49, 53)


@pytest.mark.parametrize("seed", SAMPLE)
def test_even_moments_of_a_sample_are_right(seed):
    """Those that take least; `python -m tests.random_planar` has all."""
    for each in numbers(drawn(seed), seed, has_others=False):
        assert not each.is_wrong, str(each)
        assert not each.reason, str(each)


def test_moments_of_two_noises_are_those_of_three_sizes():
    """A node under two fast noises, whose Λ(4) three sizes of a moment hierarchy and a Fourier code agree upon."""
    steady = ((-1.0115024817178828, 0.027976596819670015), (3.2543543385618436, -2.1504180261123937))
    alpha, beta = 37.431388258716034, 32.63567554169098
    known = planar.Planar(
        np.array(steady),
        (
            (((0, 0), (1, 0)), planar.ornstein_uhlenbeck(alpha, 32.74906196496099 / math.sqrt(2 * alpha))),
            (((0, 0), (0, 1)), planar.ornstein_uhlenbeck(beta, 8.536346218849552 / math.sqrt(2 * beta))),
        ),
    )
    value, doubt = planar.moment_exponent(known, 4, 2)
    assert value == pytest.approx(-3.734143931469, abs=1e-11)
    assert doubt < 1e-10


@pytest.mark.parametrize("p", [2, 4, 6])
def test_moments_are_those_of_monomials(p):
    law, rates = (1.3, 0.8, 0.4, 0.7, 0.5), [[0, 1, 0.2], [0.1, 0, 2], [0.7, 0.3, 0]]
    states, generator = (1.0, -0.3, 0.5), np.array(rates) - np.diag(np.sum(rates, axis=1))
    coloured = {
        1: (
            (planar.ornstein_uhlenbeck(1.7, 0.4), moment_hierarchy.ornstein_uhlenbeck_exponent, (1.7, 0.4, p, 20)),
            (planar.circle(0.4, 0.0, 1.3), moment_hierarchy.sine_wiener_exponent, (0.4, 1.3, p, 10)),
            (planar.circle(0.4, 1.3, 1.3), moment_hierarchy.bounded_exponent, (0.4, 1.3, 1.3, p, 10)),
        ),
        2: ((planar.filtered(*law), filtered.moment_lyapunov, (law, p, 9)),),
    }
    for dimensions, kinds in coloured.items():
        for noise, other, more in kinds:
            found, doubt = planar.moment_exponent(planar.Planar(STEADY, ((DRIVEN, noise),)), p, dimensions)
            assert found == pytest.approx(other(STEADY, DRIVEN, *more), abs=1e-9)
            assert doubt < 1e-9
    jumping = planar.Planar(STEADY, ((DRIVEN, planar.chain(states, rates)),))
    expected = moment_hierarchy.moment_lyapunov([STEADY + xi * DRIVEN for xi in states], generator, p)
    assert planar.moment_exponent(jumping, p, 0)[0] == pytest.approx(expected, abs=1e-11)
    struck = DRIVEN, 1.3, (0.5, -0.7), (0.3, 0.7)
    expected = moment_hierarchy.impulses_exponent(STEADY, *struck, p)
    assert planar.moment_exponent(planar.Planar(STEADY, impulses=(struck,)), p, 0)[0] == pytest.approx(expected)
    expected = moment_hierarchy.white_noise_exponent(STEADY, [DRIVEN], p)
    assert planar.moment_exponent(planar.Planar(STEADY, white=(DRIVEN,)), p, 0)[0] == pytest.approx(expected)


@pytest.mark.slow
def test_fourier_series_are_those_of_another_code():
    for noise, made in (
        (planar.ornstein_uhlenbeck(1.7, 0.4), phase_circle.ornstein_uhlenbeck(STEADY, DRIVEN, 1.7, 0.4, 12)),
        (planar.circle(0.4, 1.3, 1.3), phase_circle.bounded(STEADY, DRIVEN, 0.4, 1.3, 1.3, 8)),
    ):
        known = planar.Planar(STEADY, ((DRIVEN, noise),))
        expected = phase_circle.lyapunov_exponent(made, 20)
        assert planar.lyapunov_exponent(known, 1)[0] == pytest.approx(expected, abs=1e-9)
        found, doubt = planar.fourier_exponent(known, 1.5, 1)
        assert found == pytest.approx(phase_circle.moment_exponent(made, 1.5, 20, start=found), abs=1e-9)
        assert doubt < 1e-8


def test_bounded_support_has_the_moments_of_its_law():
    """⟨ξ²⟩ = 2D₀/(τ₀(5 − 3r₀)) of Eq. (7), and L has the eigenvalue 0."""
    law = planar.between_ends(0.5, 0.6, 0.8)
    own, xi = law.made(12)
    assert (xi @ xi)[0, 0] == pytest.approx(2 * 0.5 / (0.6 * (5 - 3 * 0.8)), rel=1e-12)
    assert np.max(np.linalg.eigvalsh(own)) == pytest.approx(0.0, abs=1e-12)
    # L ξ = −V′(ξ)/τ₀ = −ξ/(τ₀(1 − ξ²/ξ_s²)), so that ⟨ξ, Lξ⟩ = −D₀/τ₀²
    assert own[1, 1] * xi[0, 1] ** 2 == pytest.approx(-0.5 / 0.6**2, rel=1e-12)
