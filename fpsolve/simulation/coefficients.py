"""What the simulation takes from a system and a noise: matrices, in coordinates in which the motion is even."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.model.noise import Noise
from fpsolve.model.plane import System, affine, is_driven, is_steady, matrix_at, squared_frequency
from fpsolve.simulation.motions import DrivenMotion, Rays, StruckMotion, SwitchedMotion
from fpsolve.simulation.several import SplitMotion, drivers

_FAR = 5.0
"""Standard deviations at which noise held to one side is compared with noise held to the other."""
_UNRESOLVED = 1 / 30
"""Of the coefficient of [A₁, [A₁, A₀]] under white noise, its mean for given ∫dW and ∫W dt, as a share of s²h²."""


@dataclass(frozen=True)
class Coefficients:
    """A system as a noise moves it.

    The coordinates are those in which the order 0, where it turns, is a rotation times a growth, and else has two
    entries of one size beside its diagonal. A linear map of the plane leaves Λ(p) alone.

    Attributes:
        noise: which it is.
        steady: A₀, shape (2, 2); under a chain A of each state, shape (states, 2, 2).
        driven: A₁, shape (2, 2); under white noise that of dW, under a chain 0.
        strength: d ln‖x‖/dt for ξ = 1 at most; negative where it is ξ < 0 that makes more of it.
        fluctuation: the standard deviation of what the noise adds to d ln‖x‖/dt; of white noise to ln‖x‖ in a unit of
            time.
        half_turn: π/ω; without rotation π times the time in which the direction of x is forgotten.
        rays: the lines of the jumps.
        impulses: the matrices of impulses, shape (n, 2, 2); None without any.
    """

    noise: Noise
    steady: FloatArray
    driven: FloatArray
    strength: float
    fluctuation: float
    half_turn: float
    rays: Rays
    impulses: FloatArray | None = None

    @property
    def is_exact(self) -> bool:
        """Whether steps of any length leave nothing out."""
        return self.steady.ndim == 3 or self.impulses is not None

    def motion(self, h: float) -> DrivenMotion | SwitchedMotion | StruckMotion:
        """The numbers that move paths by a step of length h."""
        if self.impulses is not None:
            return StruckMotion(_rows(self.steady[None]), self.impulses, self.rays)
        if self.steady.ndim == 3:
            return SwitchedMotion(_rows(self.steady), self.rays)
        steady, driven = self.steady, self.driven
        double = _commutator(driven, _commutator(driven, steady))
        if self.noise.is_white:
            steady = steady + _UNRESOLVED * h * double
        return DrivenMotion(_rows(np.array([steady, driven, _commutator(steady, driven), double])), self.rays)

    def noise_step(self, h: float, bias: float = 0.0) -> Any:
        """The step of the noise, see `Noise.step`."""
        return self.noise.step(h, bias)

    def spread(self, h: float) -> float:
        """The standard deviation of what the noise adds to ln‖x‖ in a time h that it takes no note of."""
        return self.fluctuation * (math.sqrt(h) if self.noise.is_white else h)


@dataclass(frozen=True)
class SplitCoefficients(Coefficients):
    """A system as several noises move it; `driven` has a matrix for each, shape (noises, 2, 2), s with those of white.

    Attributes:
        sizes: the standard deviation of ‖A_k‖ξ_k of each; of white noise in a unit of time.
    """

    sizes: Sequence[tuple[float, bool]] = ()

    @property
    def is_exact(self) -> bool:
        return False

    def motion(self, h: float) -> SplitMotion:  # type: ignore[override]
        return SplitMotion(_rows(np.concatenate([self.steady[None], self.driven])), self.rays)

    def noise_step(self, h: float, bias: float = 0.0) -> Any:
        return drivers(self.noise.parts, h)

    def spread(self, h: float) -> float:
        return math.sqrt(sum(size**2 * (h if is_white else h**2) for size, is_white in self.sizes))


def split_coefficients(system: System, noise: Noise) -> SplitCoefficients:
    """The matrices of a system under several noises."""
    moved, _ = noise.motion(system)
    steady, driven, sizes = np.zeros((2, 2)), list[FloatArray](), list[tuple[float, bool]]()
    for term in moved.terms:
        if line := affine(term.g):
            steady += line[0] * system.epsilon**term.order * np.array(term.matrix)
    even = _even_coordinates(matrix_at(moved, 0.0, slice(0, 1)))
    back, intensity = np.linalg.inv(even), 0.0
    for name, part in noise.parts.items():
        own = [term for term in system.terms if is_driven(term.g) and term.noise == name]
        total = sum(
            (line[1] * system.epsilon**term.order * np.array(term.matrix) for term in own if (line := affine(term.g))),
            np.zeros((2, 2)),
        )
        size = float(np.linalg.norm(even @ total @ back, 2))
        if part.is_white:
            sizes.append((size * math.sqrt(part.spectral_density(0.0)), True))
            driven.append(total if len(part.marks) else total * math.sqrt(part.spectral_density(0.0)))
            intensity += sizes[-1][0] ** 2
        else:
            sizes.append((size * part.standard_deviation, False))
            driven.append(total)
            intensity += 2 * sizes[-1][0] ** 2 * min(part.correlation_time, part.period or math.inf)
    free = even @ matrix_at(moved, 0.0, slice(0, 1)) @ back
    return SplitCoefficients(
        noise,
        even @ steady @ back,
        even @ np.array(driven) @ back,
        0.0,
        math.sqrt(intensity),
        math.pi / _rate(free, intensity),
        _rays(system, noise, even, even @ steady @ back),
        sizes=sizes,
    )


def coefficients(system: System, noise: Any) -> Coefficients:
    """The matrices of a system under a noise that can be simulated."""
    if len(noise.parts) > 1:
        return split_coefficients(system, noise)
    moved, diffusions = noise.motion(system)
    is_switched = noise.has_states and not noise.is_white
    driven = np.zeros((2, 2))
    if is_switched:
        steady = matrix_at(moved, noise.reached)
    else:
        lines = [(system.epsilon**term.order * np.array(term.matrix), affine(term.g)) for term in moved.terms]
        steady = sum((line[0] * matrix for matrix, line in lines if line), np.zeros((2, 2)))
        driven = sum((line[1] * matrix for matrix, line in lines if line), np.zeros((2, 2)))
        driven = sum((system.epsilon**each.order * np.array(each.matrix) for each in diffusions), driven)
    free = np.tensordot(noise.probabilities, steady, 1) if is_switched else matrix_at(moved, 0.0, slice(0, 1))
    if not free.any():
        free = steady.mean(axis=0) if is_switched else steady
    even = _even_coordinates(free)
    back = np.linalg.inv(even)
    free, steady, driven = even @ free @ back, even @ steady @ back, even @ driven @ back
    struck = noise.impulses(system)
    impulses = even @ np.array([each.matrix for each in struck]) @ back if struck else None
    if struck:
        strength = fluctuation = math.sqrt(sum(each.rate * each.strength**2 for each in struck))
    elif is_switched:
        around = steady - np.tensordot(noise.probabilities, steady, 1)
        strength = fluctuation = math.sqrt(noise.probabilities @ np.sum(around**2, axis=(1, 2)) / 2)
    else:
        deviation = 1.0 if noise.is_white else noise.standard_deviation
        strength = float(np.max(np.abs(np.linalg.eigvalsh(driven + driven.T) / 2)))
        fluctuation = strength * deviation
        up, down = (np.linalg.eigvals(steady + side * _FAR * deviation * driven).real.max() for side in (1, -1))
        strength *= -1.0 if down > up else 1.0
    intensity = fluctuation**2 * (1.0 if noise.is_white else 2 * noise.correlation_time)
    return Coefficients(
        noise,
        steady,
        driven,
        strength,
        fluctuation,
        math.pi / _rate(free, intensity),
        _rays(system, noise, even, steady),
        impulses,
    )


def _rate(free: FloatArray, intensity: float) -> float:
    """ω where a motion turns, else the rate at which two directions come together."""
    square = float(squared_frequency(free))
    if square > 0:
        return math.sqrt(square)
    shear = float(np.linalg.norm(free - 0.5 * np.trace(free) * np.eye(2), 2))
    return max(math.sqrt(-square), (shear**2 * intensity) ** (1 / 3)) or intensity or 1.0


def _even_coordinates(free: FloatArray) -> FloatArray:
    """S for which S A S⁻¹ = α + ω((0, 1), (−1, 0)), or without rotation has entries of one size off its diagonal."""
    (p, q), (r, _) = free - 0.5 * np.trace(free) * np.eye(2)
    square = -(p * p + q * r)
    if square > 0:
        omega = math.copysign(math.sqrt(square), q)
        return np.array([[1.0, 0.0], [p / omega, q / omega]])
    return np.diag([1.0, math.sqrt(abs(q / r)) if q * r else 1.0])


def _rays(system: System, noise: Noise, even: FloatArray, steady: FloatArray) -> Rays:
    """The lines of the jumps in even coordinates."""
    phases = np.array([jump.phase for jump in system.jumps])
    along = np.stack([np.cos(phases), -np.sin(phases)], axis=1) @ even.T
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = along[:, ::-1] * np.array([1.0, -1.0])
    ways = np.zeros(phases.size)
    for j, jump in enumerate(system.jumps):
        if noise.is_white or is_steady(system, jump):
            ways[j] = math.copysign(1.0, across[j] @ steady.reshape(-1, 2, 2)[0] @ along[j])
    return Rays(along, across, np.array([jump.log_factor for jump in system.jumps]), ways)


def _commutator(a: FloatArray, b: FloatArray) -> FloatArray:
    return a @ b - b @ a


def _rows(matrices: FloatArray) -> FloatArray:
    """(t, p, q, r) of each matrix: half its trace, and the rest ((p, q), (r, −p))."""
    half = 0.5 * (matrices[:, 0, 0] + matrices[:, 1, 1])
    return np.stack([half, 0.5 * (matrices[:, 0, 0] - matrices[:, 1, 1]), matrices[:, 0, 1], matrices[:, 1, 0]], axis=1)
