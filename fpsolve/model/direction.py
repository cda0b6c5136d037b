"""How a problem changes with one of its parameters θ: ∂/∂θ of its motion, of its kicks and of its noise."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fpsolve.arrays import Coefficient, FloatArray
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.noise import NonGaussianNoise, OrnsteinUhlenbeck
from fpsolve.model.plane import Drive
from fpsolve.model.problem import Problem

_SMALL = 0.05
"""Below it a series is closer than a difference of logarithms."""


@dataclass(frozen=True)
class NoiseChange:
    """∂/∂θ of a diffusion, at fixed ξ.

    Attributes:
        log_diffusion: d ln σ/dθ.
        log_density: ∂ ln P_s(ξ)/∂θ, but for a constant.
        end_exponent: ∂a/∂θ of P_s ~ (1 − ξ²/ξ_s²)^a at the ends of a bounded support.
    """

    log_diffusion: float
    log_density: Coefficient
    end_exponent: float = 0.0


@dataclass(frozen=True)
class Direction:
    """∂/∂θ of a problem, all at fixed φ and ξ.

    Attributes:
        theta: the value of θ.
        drives: Σ ε^n g(ξ) A x of these is ∂/∂θ of the motion.
        kicks: ∂ ln R/∂θ of each of the kicks of the motion; empty where none changes.
        noise: that of the noise; None where it does not change.
    """

    theta: float
    drives: tuple[Drive, ...] = ()
    kicks: tuple[float, ...] = ()
    noise: NoiseChange | None = None


def directions(problem: Problem, original: NonGaussianNoise | None = None) -> Mapping[str, Direction]:
    """The directions of all parameters of a problem, by names such as "oscillator.omega" and "noise.D0".

    Args:
        problem: a motion and its noise.
        original: the noise of Eq. (7) that an Ornstein-Uhlenbeck noise is the reduction (12)-(14) of; then θ are its
            parameters, and not α₀ and σ₀.

    A motion without `derivative` has none, nor have the rates and states of a `MarkovChain`.

    Raises:
        ValueError: the noise is not the reduction of `original`.
    """
    found = {}
    for name in getattr(problem.system, "parameters", ()):
        drives, kicks = problem.system.derivative(name)  # type: ignore[attr-defined]
        found[f"oscillator.{name}"] = Direction(float(getattr(problem.system, name)), drives, kicks)
    noise = problem.noise if original is None else original
    if original is not None and problem.noise not in (original, original.ou_reduction()):
        raise ValueError(f"got original = {original}, but {problem.noise} is not its reduction")
    for name, change in _noise_changes(problem, noise).items():
        found[f"noise.{name}"] = Direction(float(getattr(noise, name)), noise=change)
    return found


def _noise_changes(problem: Problem, noise: object) -> Mapping[str, NoiseChange]:
    """Those with the parameters of a noise, of which that of the problem may be the reduction."""
    solved = problem.noise
    if isinstance(solved, MarkovChain):
        return {}
    if isinstance(noise, NonGaussianNoise):
        if isinstance(solved, OrnsteinUhlenbeck):
            return _of_reduction(noise, solved)
        return _of_exact(noise)
    if isinstance(solved, OrnsteinUhlenbeck):
        return {
            "alpha": _gaussian(solved, 0.0, 1 / solved.alpha),
            "sigma": _gaussian(solved, 1 / solved.sigma, 0.0),
        }
    return {}


def _gaussian(noise: OrnsteinUhlenbeck, log_sigma: float, log_alpha: float) -> NoiseChange:
    """Of Eq. (15), from d ln σ₀ and d ln α₀: ln P_s = −z²/2 and z ~ √α₀/σ₀."""
    return NoiseChange(log_sigma, lambda xi: (log_sigma - 0.5 * log_alpha) * (xi / noise.standard_deviation) ** 2)


def _of_reduction(noise: NonGaussianNoise, reduced: OrnsteinUhlenbeck) -> Mapping[str, NoiseChange]:
    """With D₀, τ₀ and r₀ of α₀ = (5 − 3r₀)/(2(2 − r₀)τ₀) and σ₀ = √(2D₀)/τ₀, Eqs. (12)-(14)."""
    return {
        "D0": _gaussian(reduced, 0.5 / noise.D0, 0.0),
        "tau0": _gaussian(reduced, -1 / noise.tau0, -1 / noise.tau0),
        "r0": _gaussian(reduced, 0.0, 1 / (2 - noise.r0) - 3 / (5 - 3 * noise.r0)),
    }


def _of_exact(noise: NonGaussianNoise) -> Mapping[str, NoiseChange]:
    """Of Eq. (9), ln P_s = −ln(1 + q)/(r₀ − 1) with q = (r₀ − 1)u and u = τ₀ξ²/(2D₀)."""

    def by_log_tau0(xi: FloatArray) -> FloatArray:
        u = 0.5 * noise.tau0 / noise.D0 * xi**2
        return np.asarray(-u / (1 + (noise.r0 - 1) * u))

    def by_r0(xi: FloatArray) -> FloatArray:
        u = 0.5 * noise.tau0 / noise.D0 * xi**2
        return u**2 * _curvature_of_log((noise.r0 - 1) * u)

    end_exponent = 1 / (1 - noise.r0) ** 2 if math.isfinite(noise.half_width) else 0.0
    return {
        "D0": NoiseChange(0.5 / noise.D0, lambda xi: -by_log_tau0(xi) / noise.D0),
        "tau0": NoiseChange(-1 / noise.tau0, lambda xi: by_log_tau0(xi) / noise.tau0),
        "r0": NoiseChange(0.0, by_r0, end_exponent),
    }


def _curvature_of_log(q: FloatArray) -> FloatArray:
    """(ln(1 + q) − q/(1 + q))/q², which is ½ − ⅔q + ¾q² − … near 0."""
    n = np.arange(2, 18)
    series = np.polynomial.polynomial.polyval(q, (-1.0) ** n * (1 - 1 / n))
    far = np.where(np.abs(q) < _SMALL, 1.0, q)
    return np.where(np.abs(q) < _SMALL, series, (np.log1p(far) - far / (1 + far)) / far**2)


@dataclass(frozen=True)
class Family:
    """The problems that differ from one in the values of their parameters.

    Attributes:
        problem: one of them.
        original: the noise of Eq. (7) that its noise is the reduction (12)-(14) of; None where it is none.
    """

    problem: Problem
    original: NonGaussianNoise | None = None

    def directions(self) -> Mapping[str, Direction]:
        """Those of the parameters that it has, by their keys."""
        return directions(self.problem, self.original)

    def at(self, values: Mapping[str, float]) -> Family:
        """The one with these values of some parameters, by keys such as "oscillator.omega".

        Raises:
            ValueError: a value is out of range.
        """
        halves = {"oscillator": self.problem.system, "noise": self.original or self.problem.noise}
        for half, old in halves.items():
            new = {key.partition(".")[2]: value for key, value in values.items() if key.startswith(f"{half}.")}
            if new:
                halves[half] = replace(old, **new)  # type: ignore[type-var]
        if self.original is None:
            return Family(Problem(halves["oscillator"], halves["noise"]))  # type: ignore[arg-type]
        original: NonGaussianNoise = halves["noise"]  # type: ignore[assignment]
        is_reduced = isinstance(self.problem.noise, OrnsteinUhlenbeck)
        noise = original.ou_reduction() if is_reduced else original
        return Family(Problem(halves["oscillator"], noise), original)  # type: ignore[arg-type]
