"""Second methods that share nothing give the same number: closed forms, equations of moments, Fourier series.

ẍ + 2bẋ + (k + ξ)x = 0 but where matrices stand; J = [[0, −1], [1, 0]].
"""

import math

import numpy as np
import pytest

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, Problem, VibroImpactOscillator
from fpsolve.model import Bounded, Poisson, SineWiener, Telegraph, White
from tests.numbers.second import even
from tests.oracles import closed_forms, moment_hierarchy, phase_circle, phase_fraction, planar

TURN, SADDLE, SHEAR = [[0.0, -1.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, -1.0]], [[-1.0, 0.0], [5.0, -1.0]]
STIFF, DAMPED = [[0.0, 0.0], [-1.0, 0.0]], [[0.0, 0.0], [0.0, 0.5]]
STEADY, DRIVEN = np.array([[-0.2, 1.1], [-0.7, 0.1]]), np.array([[0.3, -0.4], [0.5, 0.2]])
FLIP, LAW = [[-1.0, 1.0], [1.0, -1.0]], (0.4, 2.0, 0.3)


def spring(stiffness=1.0, damping=0.1):
    return np.array([[0.0, 1.0], [-stiffness, -2 * damping]])


def load(size):
    return size * np.array(STIFF)


def circle_of_white(drift, noises, p=0, modes=60, factor=1.0, sense="stratonovich"):
    made = phase_circle.white(drift, noises, sense)
    return (
        phase_circle.moment_exponent(made, p, modes, factor)
        if p
        else phase_circle.lyapunov_exponent(made, modes, factor)
    )


def telegraph(size=0.5):
    return [spring(1 + size, 0.05), spring(1 - size, 0.05)], FLIP


PAPER = VibroImpactOscillator(omega=1.3, epsilon=0.7, c1=0.2, restitution=0.6)
NODE = spring(0.7, 1.2), (DRIVEN, 2.0, 0.7), (np.array(DAMPED), 5.0, 0.9)
EXPONENT, SECOND, AT_MINUS_ONE = closed_forms.saddle_and_turning()
SAME = {
    **{
        f"λ, white noise, k = {k}": (
            lambda k=k: closed_forms.white_stiffness(k, 1.0),
            lambda k=k: circle_of_white(spring(k, 0.0), [STIFF], modes=100),
        )
        for k in (1.0, 0.25, -1.0, 0.0)
    },
    **{
        f"Λ({p}), a free particle": (
            lambda a=a: a ** (1 / 3),
            lambda p=p: even(p, spring(0.0, 0.0), (STIFF, White(1.0))),
            lambda p=p: circle_of_white(spring(0.0, 0.0), [STIFF], p),
        )
        for p, a in ((2, 2), (4, 42))
    },
    **{
        f"λ, damping, R = {factor}": (
            lambda factor=factor: closed_forms.white_stiffness(1.0, 0.5, 0.1, factor),
            lambda factor=factor: circle_of_white(spring(), [load(0.5)], factor=factor),
        )
        for factor in (1.0, 0.8)
    },
    **{
        f"Λ({p}), {sense}": (
            lambda p=p, sense=sense: even(p, spring(), (DAMPED, White(1.0, sense))),
            lambda p=p, sense=sense: circle_of_white(spring(), [DAMPED], p, sense=sense),
        )
        for p in (2, 4)
        for sense in ("stratonovich", "ito")
    },
    "Λ(2), telegraph": (
        lambda: moment_hierarchy.moment_lyapunov(*telegraph(), 2),
        lambda: phase_circle.moment_exponent(phase_circle.chain(*telegraph()), 2, 30),
        lambda: even(2, spring(1.0, 0.05), (STIFF, Telegraph(0.5, 1.0))),
    ),
    "Λ(2), Ornstein-Uhlenbeck": (
        lambda: even(2, spring(), (STIFF, OrnsteinUhlenbeck(1.0, 0.7 * math.sqrt(2)))),
        lambda: phase_circle.moment_exponent(
            phase_circle.ornstein_uhlenbeck(spring(), STIFF, 1.0, 0.7, 20), 2, 24, start=0.1
        ),
    ),
    "λ, a saddle that turns": (lambda: EXPONENT, lambda: circle_of_white(SADDLE, [TURN])),
    "Λ(2), a saddle that turns": (
        lambda: SECOND,
        lambda: even(2, SADDLE, (TURN, White(1.0))),
        lambda: circle_of_white(SADDLE, [TURN], 2),
    ),
    "Λ(-1), a saddle that turns": (lambda: AT_MINUS_ONE, lambda: circle_of_white(SADDLE, [TURN], -1)),
    "Λ(2), shear that turns": (
        lambda: even(2, SHEAR, (TURN, White(1.0))),
        lambda: circle_of_white(SHEAR, [TURN], 2),
    ),
    "Λ(4), two white noises": (  # x∘dW₁ + Jx∘dW₂, where Jx only turns: ½cp + ½p²
        lambda: 0.15 * 4 + 0.5 * 4**2,
        lambda: even(4, 0.15 * np.eye(2), (np.eye(2), White(1.0)), (TURN, White(1.0))),
        lambda: circle_of_white(0.15 * np.eye(2), [np.eye(2), TURN], 4, 8),
    ),
    "Λ(2), bounded": (
        lambda: even(2, spring(), (STIFF, Bounded(*LAW))),
        lambda: phase_circle.moment_exponent(phase_circle.bounded(spring(), STIFF, *LAW, 16), 2, 24, start=0.0),
    ),
    "Λ(2), harmonic and white": (
        lambda: moment_hierarchy.harmonic_exponent(spring(), STIFF, 0.4, 2.0, 2, load(0.3)),
        lambda: moment_hierarchy.bounded_exponent(spring(), STIFF, 0.4, 2.0, 0.0, 2, 20, load(0.3)),
    ),
    "Λ(4), sine-Wiener": (
        lambda: even(4, STEADY, (DRIVEN, SineWiener(0.4, 1.3))),
        lambda: planar.moment_exponent(planar.Planar(STEADY, ((DRIVEN, planar.circle(0.4, 0.0, 1.3)),)), 4, 1)[0],
    ),
    "Λ(4), two Ornstein-Uhlenbeck noises": (
        lambda: even(
            4,
            NODE[0],
            *((a, OrnsteinUhlenbeck(rate, size * math.sqrt(2 * rate))) for a, rate, size in NODE[1:]),
            count=14,
            near=None,
        ),
        lambda: planar.moment_exponent(
            planar.Planar(NODE[0], tuple((a, planar.ornstein_uhlenbeck(*law)) for a, *law in NODE[1:])), 4, 2
        )[0],
    ),
    "Λ(6), impulses": (
        lambda: even(6, STEADY, (DRIVEN, Poisson(1.3, (0.5, -0.7), (0.3, 0.7)))),
        lambda: phase_circle.moment_exponent(
            phase_circle.impulses(STEADY, DRIVEN, 1.3, (0.5, -0.7), (0.3, 0.7)), 6, 24
        ),
    ),
    **{
        f"Λ({p}), a wall and {name}": (
            lambda noise=noise, p=p: planar.fourier_exponent(planar.of_paper(PAPER, noise), p, 1)[0],
            lambda noise=noise, p=p: planar.series(Problem(PAPER, noise), p, 24, 30),
            lambda noise=noise, p=p, near=near: phase_fraction.moment_lyapunov(
                PAPER, noise, p, near, harmonics=24, polynomials=30, tilt=0.0
            ),
        )
        for name, noise, p, near in (
            ("Ornstein-Uhlenbeck", OrnsteinUhlenbeck(alpha=1.0, sigma=1.0), 1.5, 0.1),
            ("bounded support", NonGaussianNoise(D0=0.5, tau0=0.6, r0=0.8), -2.0, 0.1),
        )
    },
}


@pytest.mark.parametrize("name", SAME)
def test_second_methods_agree(name):
    first, *others = (method() for method in SAME[name])
    assert others == pytest.approx([first] * len(others), abs=1e-11)


def test_bounded_support_has_the_moments_of_its_law():
    """⟨ξ²⟩ = 2D₀/(τ₀(5 − 3r₀)) of Eq. (7), L has the eigenvalue 0, and ⟨ξ, Lξ⟩ = −D₀/τ₀²."""
    own, xi = planar.between_ends(0.5, 0.6, 0.8).made(12)
    assert (xi @ xi)[0, 0] == pytest.approx(2 * 0.5 / (0.6 * (5 - 3 * 0.8)), rel=1e-12)
    assert np.max(np.linalg.eigvalsh(own)) == pytest.approx(0.0, abs=1e-12)
    assert own[1, 1] * xi[0, 1] ** 2 == pytest.approx(-0.5 / 0.6**2, rel=1e-12)


def test_a_filter_has_its_variance_and_its_poles():
    omega, zeta, s, c0, c1 = 1.3, 0.4, 0.7, 0.8, 0.5
    own, xi = (each.toarray() for each in planar.filtered(omega, zeta, s, c0, c1).made(5))
    assert (xi @ xi)[0, 0] == pytest.approx(s**2 * (c0**2 + (c1 * omega) ** 2) / (4 * zeta * omega**3), rel=1e-12)
    pole = omega * complex(-zeta, math.sqrt(1 - zeta**2))
    assert min(abs(np.linalg.eigvals(own) - pole)) < 1e-12
