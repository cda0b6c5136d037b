"""The oscillator of the paper and its noises: weak, strong, slow and fast, by Fourier-Hermite and Gegenbauer series."""

import math
from functools import partial

import numpy as np

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, Problem, VibroImpactOscillator, make_mesh
from fpsolve.model import Jump, Noise
from tests.kit import matrices, rates
from tests.numbers.values import Row, index, moment, moments
from tests.oracles import perturbation
from tests.oracles.planar import series

HERMITE = "Fourier-Hermite series"
PAPER = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95)
WEAK = PAPER.ou_reduction()
UNIT = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)


def paper(epsilon: float = 0.1, restitution: float = 0.8, c1: float = 0.1, omega: float = 1.0, impact="delta"):
    return VibroImpactOscillator(omega=omega, restitution=restitution, c1=c1, epsilon=epsilon, impact=impact)


def elastic(epsilon: float, noise: Noise, c1: float = 0.0, omega: float = 1.0) -> Problem:
    """Without loss."""
    return Problem(paper(epsilon, 1.0, c1, omega), noise)


def resolved(motion: VibroImpactOscillator, noise: Noise, p: float, size=(10, 30), rtol: float = 1e-8) -> Row:
    """The error stated is within rtol on the scale of Eq. (37)."""
    scale = perturbation.moment_scale(motion, noise, p)
    source = f"{HERMITE} {noise.kind} {motion.impact} rtol {rtol}"
    problem, doubt = Problem(motion, noise), 1e-15 * motion.omega  # an eigenvalue of a matrix of that size
    return Row(problem, moment(p, rtol=rtol), partial(series, problem, p, *size), doubt, rtol * scale, source)


def white_limit(kappa: float = 0.25) -> float:
    """Λ(2) without loss: λ(λ − 2κ)(λ − κ/2) + 4ω²(λ − κ) = 0, κ = ε²σ²/α² (Stratonovich)."""
    roots = np.roots([1.0, -2.5 * kappa, kappa**2 + 4.0, -4 * kappa])
    return roots[np.abs(roots.imag) < 1e-12].real.max()


def slow(tau: float, D0: float = 1.3) -> Problem:
    """Noise that may hold the motion at two places; at the slower one it turns."""
    return elastic(math.sqrt(0.1), NonGaussianNoise(D0=D0, tau0=tau, r0=1.0).ou_reduction())


HELD = paper(0.1, 0.8, 0.1, omega=10.0), NonGaussianNoise(D0=1.0, tau0=20.0, r0=0.95).ou_reduction()
GAUSSIAN = OrnsteinUhlenbeck(alpha=1.3, sigma=0.8)
GROWING = OrnsteinUhlenbeck(alpha=1.5, sigma=0.8)
WALL = Jump(math.pi / 2, math.log(0.8))
ROWS = [
    *(resolved(paper(), WEAK, p, rtol=rtol) for rtol in (1e-4, 1e-6, 1e-8, 1e-10, 1e-12) for p in (-1.5, 2.0, 5.5)),
    *(
        resolved(paper(0.15, 0.7, 0.2, 2.0, impact), OrnsteinUhlenbeck(alpha=1.5, sigma=1.2), p, (8, 24))
        for impact, moments_of in (("delta", (-3.0, 2.5, 8.0)), ("restitution", (-1.17, 0.67, 4.33)))
        for p in moments_of
    ),
    *(
        resolved(paper(0.3, 0.7, -0.2, 1.4, "restitution"), NonGaussianNoise(D0=0.8, tau0=0.7, r0=r0), p, (12, 36))
        for r0, orders in ((-1.0, (-3.0, 5.0)), (0.3, (-1.0, 7.0)), (0.7, (1.0, 3.0)), (0.95, (-3.0, 1.0, 7.0)))
        for p in orders
    ),
    resolved(paper(), PAPER, 2.0, (8, 24)),
    *(
        Row(
            elastic(epsilon, UNIT),
            moment(p, rtol=1e-9),
            value,
            1e-9 * value,
            1e-8,
            "up to 24 000 Fourier-Hermite functions",
        )
        for epsilon, p, value in (
            (1.0, 2.0, 0.886234813612),
            (1.0, 3.0, 3.388172823067),
            (1.0, 4.0, 6.938432719324),
            (2.0, 2.0, 7.740233350685),
            (0.5, 8.0, 3.409208991669),
        )
    ),
    *(
        Row(
            slow(tau, D0),
            moment(p),
            value,
            3e-7 * value,
            1e-6,
            "60 × 500 functions, or fixed meshes over both places",
        )
        for tau, p, D0, value in (
            (20.0, 9.0, 1.3, 6.336967),
            (10.0, 9.0, 1.3, 6.330893),
            (5.0, 10.0, 1.0, 4.373960272),
            (5.0, 10.0, 0.9, 2.608412),
        )
    ),
    resolved(*HELD, 15.0, (8, 200)),
    *(
        Row(
            elastic(epsilon, GAUSSIAN, c1, 1.7),
            moment(-2.0, rtol=1e-9),
            epsilon**2 * (0.8**2 / (2 * 1.3**2) - c1),
            0.0,
            1e-8,
            f"−ε²c₁ + ε²S(0)/2 without impact {epsilon} {c1}",
        )
        for epsilon in (0.1, 0.5, 1.0, 1.5, 2.0)
        for c1 in (-0.4, 0.3)
    ),
    *moments(
        matrices([[0.1, 1.0], [-1.0, 0.1]], np.eye(2), GROWING, jumps=[WALL]),
        {p: p * (0.1 + WALL.log_factor / math.pi) + p**2 / 2 * GROWING.spectral_density(0.0) for p in (-2, 1, 4)},
        1e-13,
        1e-7,
        "noise that moves no phase, p²S(0)/2",
    ),
    *(
        Row(
            Problem(paper(1.0, 0.6, 0.0, 1.7, law), OrnsteinUhlenbeck(alpha=1.0, sigma=1e-9)),
            moment(p, mesh=make_mesh(phi_degree=14)),
            p * 1.7 * paper(1.0, 0.6, impact=law).log_impact_factor / math.pi,
            1e-11,
            1e-7,
            f"impacts alone {law}",
        )
        for law, p in (("delta", -2.0), ("restitution", 4.0))
    ),
    *(
        Row(
            Problem(motion, WEAK),
            index(),
            perturbation.stability_index(motion, WEAK),
            10 * motion.epsilon**2,
            1e-5,
            f"second order, ε = {motion.epsilon}",
        )
        for motion in (paper(1e-2, c1=-0.3), paper(1e-4, c1=-0.3), paper(1e-5, c1=-0.3))
    ),
    Row(
        rates(
            "theta' = omega; omega' = -2*zeta*sqrt(g/l)*omega - (g + xi)/l*theta",
            OrnsteinUhlenbeck(alpha=3.0, sigma=3.625 * math.sqrt(6.0)),
            **{"g": 9.81, "l": 1.2, "zeta": 0.0871052631579},
        ),
        *(index(), 7.067497956, 2e-9, 8e-8, "interpolant from -1 to 9, where Newton steps run in circles"),
    ),
]
