"""Second-order perturbation theory of weak noise for any motion whose order 0 rotates; Eqs. (33)-(39) are an instance.

In coordinates in which the order 0 is a rotation by ω, with order-1 noise ε ξ (h, q), mean q̄ and wave |q̂| of q, and
S of Eq. (16),

    Λ₂(p) = p [Σ q̄₂ + (ω/π) Σ ln R + ½|q̂|² S(2ω)] + p² [½ q̄² S(0) + ¼|q̂|² S(2ω)],

as −⟨L₁ L₀⁻¹ L₁ 1⟩ = p ∫₀^∞ C(t) ⟨(h ∂φ + p q)(φ) q(φ + ωt)⟩ dt and h is the quarter-turned wave of q. For the paper's
oscillator q̄ = |q̂| = ½, and this is Eq. (37). White noise has S = s² at all ω. A `NonGaussianNoise` has the S of its
Ornstein-Uhlenbeck reduction, as in the paper. The mean of a noise is put into the drift of order 0. A harmonic load has
S = 0 at all other frequencies than its own, and so no part in Λ₂, also where it pumps: there the theory does not apply.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.errors import NoPerturbationTheory
from fpsolve.messages import Code, Message
from fpsolve.model.coordinates import framed
from fpsolve.model.plane import (
    Harmonics,
    affine,
    rotating_coordinates,
    squared_frequency,
    stretching,
    turning,
    written_coefficient,
)
from fpsolve.model.problem import Problem

STRONG = 0.05
"""Share of the terms of Eq. (37) that the orders beyond may have."""


@dataclass(frozen=True)
class Scale:
    """How large Λ(p) is before its terms cancel: what errors are measured by.

    Attributes:
        linear, quadratic: of |p| and p².
    """

    linear: float
    quadratic: float

    def moment(self, p: ArrayLike) -> Any:
        """The scale of Λ(p); that of λ is `linear`, that of Λ″(0) 2 `quadratic`."""
        size = np.abs(np.asarray(p, dtype=float))
        return (size * (self.linear + self.quadratic * size))[()]


@dataclass(frozen=True)
class SecondOrder:
    """ε²Λ₂(p), a parabola.

    Attributes:
        linear_terms: what is linear in p: damping of each order, impacts, noise.
        quadratic: the coefficient of p².
        impact_rate: N = ∂λ/∂ ln R of Eq. (39): how often per unit time the phase passes a ray, ω/π.
        log_factor: the sum of all ln R.
    """

    linear_terms: tuple[float, ...]
    quadratic: float
    impact_rate: float
    log_factor: float

    def moment_exponent(self, p: ArrayLike) -> Any:
        """ε²Λ₂(p), Eq. (37); an array for an array of p."""
        p = np.asarray(p, dtype=float)
        return (p * (self.quadratic * p + self.lyapunov_exponent) + 0.0)[()]  # 0 without a sign

    @property
    def lyapunov_exponent(self) -> float:
        """λ = ε²Λ₂′(0), Eq. (39)."""
        return sum(self.linear_terms)

    @property
    def stability_index(self) -> float:
        """δ_p, the non-zero root of ε²Λ₂(p), Eq. (38); nan where there is none, as without noise."""
        return -self.lyapunov_exponent / self.quadratic + 0.0 if self.quadratic else math.nan

    @property
    def variance_rate(self) -> float:
        """ε²Λ₂″(0), from Eq. (37): the growth rate of the variance of ln ‖x‖."""
        return 2 * self.quadratic

    @property
    def critical_log_factor(self) -> float:
        """ln R with which λ of Eq. (39) is 0."""
        return self.log_factor - self.lyapunov_exponent / self.impact_rate

    @property
    def critical_impact_factor(self) -> float:
        """R with which λ of Eq. (39) is 0; ∞ where it is beyond floating-point numbers."""
        with np.errstate(over="ignore"):
            return float(np.exp(self.critical_log_factor))

    @property
    def scale(self) -> Scale:
        """The sums of the absolute values of the terms."""
        return Scale(sum(map(abs, self.linear_terms)), self.quadratic)


def second_order(problem: Problem) -> SecondOrder:
    """ε²Λ₂(p) of a problem.

    Raises:
        NoPerturbationTheory: the order 0 does not rotate, the order 1 is not linear in the noise; or there is a
            harmonic load.
    """
    if loads := harmonic_loads(problem):
        raise NoPerturbationTheory(f"perturbation theory leaves out a harmonic load, which {' and '.join(loads)} is")
    return _of_random_noise(problem)


def harmonic_loads(problem: Problem) -> Sequence[str]:
    """The noises of which only the start is random, as sentences have them."""
    noises = zip([*problem.sections][1:], problem.noise.parts.values(), strict=True)
    loads = [(section, noise) for section, noise in noises if not noise.is_random]
    return [f"{section} with sigma = 0" if noise.values else "cos(nu*t)" for section, noise in loads]


@lru_cache(8)  # a set asks for it five times: scales, columns and notes
def _of_random_noise(problem: Problem) -> SecondOrder:
    """ε²Λ₂(p) without what harmonic loads change."""
    system, noises = problem.noise.motion(problem.linear), problem.noise.parts
    if problem.dimension > 2:
        raise NoPerturbationTheory("perturbation theory is for two variables only")
    if system.impulses:
        raise NoPerturbationTheory("perturbation theory is for weak noise, not for impulses")
    driven = {name: np.zeros((2, 2)) for name, noise in noises.items() if not (noise.is_white and len(noises) > 1)}
    steady = system.matrix_at(0.0, slice(0, 1))
    for term in system.terms if has_mean(problem) else ():
        mean = problem.named_noise(term.noise).mean
        steady += mean * (affine(term.g) or (0.0, 0.0))[1] * system.epsilon**term.order * np.array(term.matrix)
    frame, omega = _rotating_frame(steady)
    parts = [float(_growth(steady, frame).mean)]
    for term in system.terms:
        offset, slope = affine(term.g) or (math.nan, math.nan)
        if term.order == 1 and offset == 0:
            driven[term.noise if term.noise in driven else ""] += slope * np.array(term.matrix)
        elif term.order == slope == 0:
            continue
        elif term.order >= 2 and slope == 0:
            parts.append(offset * system.epsilon**term.order * _growth(term.matrix, frame).mean)
        elif not (term.order >= 2 and offset == 0):
            raise NoPerturbationTheory(
                f"perturbation theory is for motions whose noise enters as epsilon xi; a term of order {term.order} "
                f"with g = {written_coefficient(term.g).strip() or 1} is not of that form"
            )
    of_noise = []
    for name, matrix in driven.items():
        noise, q = problem.named_noise(name), _growth(matrix, frame)
        at_rest, at_twice = (noise.spectral_density(each) if noise.is_random else 0.0 for each in (0.0, 2 * omega))
        most = 2 * noise.standard_deviation / system.epsilon  # that of ½S, as ln ‖x‖ grows at ε|q̂||ξ| at most
        if noise.has_peak and not max(q.amplitude * at_twice, abs(q.mean) * at_rest) <= most:
            raise NoPerturbationTheory(
                f"perturbation theory is for noise whose band is broad compared with its effect, but {noise.kind} "
                f"noise has S(0) = {at_rest:.3g} and S({2 * omega:.3g}) = {at_twice:.3g} with the standard deviation "
                f"{noise.standard_deviation:.3g}"
            )
        of_noise.append((q, at_rest, at_twice))
    for each in system.diffusions:
        if each.order != 1:
            raise NoPerturbationTheory(f"perturbation theory is for white noise of order 1, not {each.order}")
        of_noise.append((_growth(each.matrix, frame), 1.0, 1.0))  # beside nothing: no path of white noise drives
    impact_rate, log_factors = omega / math.pi, [jump.second_order for jump in system.jumps]
    parts += [impact_rate * log_factor for log_factor in log_factors]
    parts += [system.epsilon**2 * at_twice / 2 * q.amplitude**2 for q, _, at_twice in of_noise]
    quadratic = float(
        sum(
            system.epsilon**2 * (at_rest / 2 * q.mean**2 + at_twice / 4 * q.amplitude**2)
            for q, at_rest, at_twice in of_noise
        )
    )
    return SecondOrder(tuple(map(float, parts)), quadratic, impact_rate, float(sum(log_factors)))


def second_order_or_none(problem: Problem) -> SecondOrder | None:
    """The terms up to the second order; None where perturbation theory does not apply."""
    try:
        return second_order(problem)
    except NoPerturbationTheory:
        return None


def has_mean(problem: Problem) -> bool:
    """Whether the noise has a mean, beyond rounding."""
    return any(abs(noise.mean) > 1e-12 * noise.standard_deviation for noise in problem.noise.parts.values())


def perturbed_moments(problem: Problem, p: FloatArray) -> FloatArray:
    """ε²Λ₂(p), Eq. (37), shape (n,); NaN where perturbation theory does not apply."""
    theory = second_order_or_none(problem)
    return np.full(np.shape(p), math.nan) if theory is None else theory.moment_exponent(p)


def weak_noise_note(problem: Problem, p: FloatArray, value: FloatArray) -> Message | None:
    """On Eq. (37) where the orders ε⁴ and above, Λ − ε²Λ₂, are not small against its terms, or it leaves out a load.

    Eq. (37) is a parabola, convex for every p; what limits it is the p from which on this criterion is broken.
    """
    if problem.dimension == 2 and (loads := harmonic_loads(problem)):
        return Message(Code.LOAD_LEFT_OUT, keys=loads)
    theory = second_order_or_none(problem)
    if theory is None:
        return None
    rest = value - theory.moment_exponent(p)
    scale = theory.scale.moment(p)
    shares = np.divide(np.abs(rest), scale, out=np.zeros_like(scale), where=scale > 0)
    beyond = shares > STRONG
    if not np.any(beyond):
        return None
    worst, first = int(np.argmax(shares)), np.min(np.abs(p[beyond]))
    return Message(
        Code.STRONG_NOISE,
        is_reduced=problem.noise.approximates_spectrum,
        most=STRONG,
        first=first,
        p=p[worst],
        rest=rest[worst],
        size=shares[worst],
    )


def first_order_eigenfunction(problem: Problem, p: float, phi: ArrayLike, xi: ArrayLike) -> FloatArray:
    """T₁(φ, ξ; p) of Eq. (33) with C = 1 and K(ξ, τ) = ξ exp(−α₀τ); φ and ξ broadcast.

    T₁ = pξ [q̄/α₀ + Re((q_c − i q_s) exp(2iφ)/(α₀ − 2iω))] solves L₀T₁ = −p q ξ, Eq. (32), for noise with relaxation
    rate α₀; for the paper's q₁ it is ½pξ [1/α₀ − (α₀ cos 2φ − 2ω sin 2φ)/(α₀² + 4ω²)].

    Raises:
        NoPerturbationTheory: as `second_order`; or the order 0 does not rotate uniformly in these coordinates.
    """
    second_order(problem)
    if has_mean(problem):
        raise NoPerturbationTheory(f"T₁ is for noise of mean 0, but it has {problem.noise.mean:g}")
    if len(problem.noise.parts) > 1:
        raise NoPerturbationTheory("T₁ is a function of one noise, but there are several")
    if not problem.noise.is_markov:
        raise NoPerturbationTheory(f"T₁ is for noise that is a Markov process by itself, but not {problem.noise.kind}")
    frame, omega = _rotating_frame(problem.linear.matrix_at(0.0, slice(0, 1)))
    if not np.array_equal(frame, np.eye(2)):
        raise NoPerturbationTheory("T₁ is for a uniform rotation; choose coordinates in which the order 0 is one")
    q = stretching(problem.linear.matrix_at(1.0, slice(1, 2)))
    omega = math.copysign(omega, turning(problem.linear.matrix_at(0.0, slice(0, 1))).mean)
    alpha, xi = 1 / problem.noise.correlation_time, np.asarray(xi, dtype=float)
    wave = (q.cosine - 1j * q.sine) * np.exp(2j * np.asarray(phi, dtype=float)) / (alpha - 2j * omega)
    return p / problem.linear.epsilon * xi * (q.mean / alpha + wave.real)


def scale_of(problem: Problem) -> Scale:
    """The scale of Λ(p): that of perturbation theory, or the sum of the sizes of the terms if that is smaller at p = 2.

    Perturbation theory overstates strong noise.

    In the sum the constant terms, with the mean of the noise, count by the largest |Re| of their eigenvalues. Noise of
    strength c and correlation time τ counts by c min(1, c τ). White noise counts by ½ ‖B‖ max |eᵀB e|.
    A jump counts once in a half-turn. Impulses that stretch by e^s count by their rate times s min(1, s).
    """
    own, of_noises = framed(problem), dict[str, float]()
    system = own.motion
    steady = np.zeros((problem.dimension, problem.dimension))
    for term in system.terms:
        size = system.epsilon**term.order * term.fastest[1]
        noise = problem.named_noise(term.noise)
        if line := affine(term.g):
            at_mean = line[0] + (line[1] and line[1] * noise.mean)
            steady += system.epsilon**term.order * at_mean * np.array(term.matrix)
            driven = size * (line[1] and abs(line[1]) * noise.standard_deviation)
        else:
            typical = term.g(noise.mean + noise.standard_deviation * np.array([-1.0, 1.0]))
            driven = size * float(np.sqrt(np.mean(typical**2)))
        of_noises[term.noise] = of_noises.get(term.noise, 0.0) + driven
    jumps = sum(abs(jump.log_factor) for jump in system.jumps) * own.unit_rate / math.pi
    driven = 0.0
    for name, size in of_noises.items():
        driven += size * min(1.0, size * problem.named_noise(name).correlation_time) if size else 0.0
    for each in system.diffusions:
        driven += 0.5 * system.epsilon ** (2 * each.order) * math.prod(each.fastest)
    driven += sum(each.rate * each.strength * min(1.0, each.strength) for each in system.impulses)
    sizes = Scale(float(np.max(np.abs(np.linalg.eigvals(steady).real))) + jumps + driven, driven)
    theory = None
    with suppress(NoPerturbationTheory):
        theory = _of_random_noise(problem)
    found = theory.scale if theory and theory.scale.moment(2.0) <= sizes.moment(2.0) else sizes
    return replace(found, linear=found.linear or found.quadratic or own.unit_rate)  # λ may be 0 exactly


def _growth(matrix: ArrayLike, frame: FloatArray) -> Harmonics:
    """q of a matrix in the coordinates in which the order 0 rotates."""
    return stretching(np.linalg.inv(frame) @ np.asarray(matrix) @ frame)


def _rotating_frame(a: FloatArray) -> tuple[FloatArray, float]:
    """P and ω for which P⁻¹AP is growth and a rotation by ω."""
    if (frame := rotating_coordinates(a)) is None:
        raise NoPerturbationTheory(
            "perturbation theory is for motions that rotate without noise, which this one does not"
        )
    return frame, math.sqrt(squared_frequency(a))
