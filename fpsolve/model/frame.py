"""Coordinates y = S⁻¹x in which the motion without noise is growth and a uniform rotation.

A linear change of coordinates leaves Λ(p) alone, as ‖x‖ and ‖y‖ are within constant factors, and the phase ψ of y needs
fewer functions than φ of x: with x″ + ω²x = 0 the phase of (x, ẋ) runs between the speeds 1 and ω². With x = a e(φ),
e = (cos φ, −sin φ), and ρ(φ) = |S⁻¹e(φ)|,

    ‖x‖^p T(φ) = ‖y‖^p T_y(ψ),  so that  T(φ) = ρ^p T_y(ψ(φ)),  dψ/dφ = 1/(det S ρ²).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, reduce
from typing import Any, TypeVar

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.model.plane import (
    CoefficientMatrix,
    CubicTerms,
    Impulse,
    ImpulseDerivative,
    LinearMotion,
    System,
    combined,
    is_driven,
    rotating_coordinates,
)

MOST_PARTS = 1000
T = TypeVar("T", Impulse, ImpulseDerivative)


@dataclass(frozen=True)
class Frame:
    """S, a lower triangular matrix with a positive diagonal: x₁ = 0 where y₁ = 0, and ψ grows with φ.

    Attributes:
        matrix: S.
    """

    matrix: tuple[tuple[float, float], tuple[float, float]]

    @cached_property
    def _array(self) -> FloatArray:
        return np.array(self.matrix)

    @cached_property
    def _inverse(self) -> FloatArray:
        return np.asarray(np.linalg.inv(self._array))

    def term(self, term: CoefficientMatrix) -> CoefficientMatrix:
        """The same term for y, S⁻¹AS."""
        return replace(term, matrix=(self._inverse @ np.array(term.matrix) @ self._array).tolist())

    def cubic(self, terms: CubicTerms) -> CubicTerms:
        """The same cubic terms for y: S⁻¹ C of the products of Sy."""
        first, second = self._array
        products = [reduce(np.convolve, [first] * (3 - k) + [second] * k) for k in range(4)]
        return CubicTerms((self._inverse @ np.array(terms.matrix) @ np.array(products)).tolist())

    def exponent(self, of: T) -> T:
        """An impulse, or its derivative, for y."""
        return replace(of, exponent=(self._inverse @ np.array(of.exponent) @ self._array).tolist())

    def motion(self, system: System) -> System:
        """The same system for y, the terms of order 0 that no noise drives as one."""
        others = [self.term(term) for term in system.terms if not is_free(term)]
        a = self._inverse @ np.reshape(_free(system.terms), (2, 2)) @ self._array
        growth, speed = 0.5 * (a[0, 0] + a[1, 1]), 0.5 * (a[0, 1] - a[1, 0])
        rotation = CoefficientMatrix(0, ((growth, speed), (-speed, growth)))  # exactly one
        jumps = [replace(jump, phase=float(self.phase(np.array(jump.phase)))) for jump in system.jumps]
        return LinearMotion(system.epsilon, (rotation, *others), tuple(jumps))

    @property
    def parts(self) -> int:
        """Into how many parts a cell of ψ is cut where dφ/dψ is integrated: more, the more φ and ψ differ."""
        return min(math.ceil(float(np.linalg.cond(self._array))), MOST_PARTS)

    def phase(self, phi: FloatArray) -> FloatArray:
        """ψ(φ), which is φ at odd multiples of π/2."""
        return _turned(self._inverse, phi)

    def own_phase(self, psi: FloatArray) -> FloatArray:
        """φ(ψ)."""
        return _turned(self._array, psi)

    def length(self, phi: FloatArray) -> FloatArray:
        """ρ(φ), how long y is for a unit vector x."""
        return np.asarray(np.linalg.norm(self._inverse @ _unit(phi), axis=0))

    def density(self, phi: FloatArray) -> FloatArray:
        """dψ/dφ."""
        return np.asarray(np.linalg.det(self._inverse) / self.length(phi) ** 2)


def amplitude_frame(system: System) -> Frame:
    """The frame in which ‖y‖ is the amplitude of a system with cubic terms, see `System.aspect`."""
    return Frame(((1.0, 0.0), (0.0, system.aspect / system.second_unit)))


def is_free(term: CoefficientMatrix) -> bool:
    """Whether a term is of order 0, and no noise drives it."""
    return term.order == 0 and not is_driven(term.g)


def normal_frame(
    drift: Sequence[CoefficientMatrix],
    diffusions: Sequence[CoefficientMatrix],
    epsilon: float,
    spread: Callable[[str], tuple[float, float]],
) -> Frame | None:
    """The frame in which the order 0 of a drift is growth and a uniform rotation; None where it does not rotate.

    It is also None where the phase of x runs more evenly, as where noise is much stronger than what turns the state.

    Args:
        drift, diffusions: what moves the state along a path of ξ, and by white noise.
        epsilon: ε.
        spread: by the name of a noise the standard deviation of ξ and about how long it remembers its value.
    """
    numbers = _free(drift)
    if numbers[1] == -numbers[2] and numbers[0] == numbers[3]:
        return None
    if (rotating := rotating_coordinates(np.reshape(numbers, (2, 2)))) is None:
        return None
    (first, _), (lower, last) = rotating.tolist()
    frame = Frame(((1.0, 0.0), (lower / first, last / abs(first))))

    def unevenness(terms: Sequence[CoefficientMatrix], whites: Sequence[CoefficientMatrix]) -> float:
        """The amplitudes of the waves of dφ/dt over its mean."""
        total, driven, mean = 0.0, dict[str, float](), 0.0
        for term in terms:
            size = epsilon**term.order
            if is_driven(term.g):
                strength = size * spread(term.noise)[0] * float(abs(term.h.mean) + term.h.amplitude)
                driven[term.noise] = driven.get(term.noise, 0.0) + strength
            else:
                total += size * abs(float(term.g(0.0))) * float(term.h.amplitude)
                mean += size * float(term.g(0.0)) * float(term.h.mean)
        total += sum(each * min(1.0, each * spread(name)[1]) for name, each in driven.items())
        total += sum((epsilon**each.order * float(abs(each.h.mean) + each.h.amplitude)) ** 2 for each in whites)
        return total / max(abs(mean), 1e-300)

    here = unevenness([frame.term(each) for each in drift], [frame.term(each) for each in diffusions])
    return frame if here < unevenness(drift, diffusions) else None


def _free(terms: Sequence[CoefficientMatrix]) -> tuple[float, float, float, float]:
    """The matrix of those of order 0 that no noise drives, row by row."""
    return combined((float(term.g(0.0)), term) for term in terms if is_free(term))


def _unit(phi: FloatArray) -> FloatArray:
    """e(φ), shape (2, n)."""
    return np.stack([np.cos(phi), -np.sin(phi)])


def _turned(matrix: FloatArray, phi: Any) -> FloatArray:
    """The phase of a matrix times e(φ), in the same half turn."""
    half_turns = math.pi * np.round(np.asarray(phi) / math.pi)
    x = matrix @ _unit(np.ravel(phi - half_turns))
    return np.asarray(np.arctan2(-x[1], x[0]).reshape(np.shape(phi)) + half_turns)
