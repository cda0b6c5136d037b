"""Coordinates y = S⁻¹x of a problem's own, in which the rates of its phase and of its growth are small.

A linear change of coordinates leaves Λ(p) alone, as ‖x‖ and ‖y‖ are within constant factors, and the phase ψ of y needs
fewer functions than φ of x: with x″ + ω²x = 0 the phase of (x, ẋ) runs between the speeds 1 and ω². So Λ(p) is right
whatever the units of x. That of time needs no care: every number scales with it. With x = a e(φ), e = (cos φ, −sin φ),
and ρ(φ) = |S⁻¹e(φ)|,

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
    affine,
    combined,
    is_driven,
    rotating_coordinates,
)

MOST_PARTS = 1000
HARDLY = 1.5
"""How many times larger the rates may be in a frame that is preferred."""
BARELY = 0.99
"""The share of the rates with which the search ends: μ changes by powers of two in it, so that nothing is rounded."""
ROUNDED = 1e-14
"""Of the terms of an entry of S⁻¹AS."""
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
        """The same system for y, the terms of order 0 that no noise drives as one; a rotation is one exactly."""
        others = [self.term(term) for term in system.terms if not is_free(term)]
        free = np.reshape(_free(system.terms), (2, 2))
        a = self._inverse @ free @ self._array
        growth, speed = 0.5 * (a[0, 0] + a[1, 1]), 0.5 * (a[0, 1] - a[1, 0])
        turned = np.array([[growth, speed], [-speed, growth]])
        is_turn = np.all(abs(a - turned) <= ROUNDED * (abs(self._inverse) @ abs(free) @ abs(self._array)))
        steady = CoefficientMatrix(0, (turned if is_turn else a).tolist())
        jumps = [replace(jump, phase=float(self.phase(np.array(jump.phase)))) for jump in system.jumps]
        return LinearMotion(system.epsilon, (steady, *others), tuple(jumps))

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


def own_frame(
    drift: Sequence[CoefficientMatrix],
    diffusions: Sequence[CoefficientMatrix],
    impulses: Sequence[Impulse],
    epsilon: float,
    spread: Callable[[str], tuple[float, float]],
) -> Frame | None:
    """The frame in which a motion is small; None where x itself is hardly worse.

    Its size is ‖A‖ + Σ‖B‖² + Σ r‖C‖ + Σ min(s‖D‖, τs²‖D‖²), A all that no noise drives, B of white noise, C of impulses
    at the rate r, D of noise with the standard deviation s and the correlation time τ: what the rates of growth and of
    the phase may be. In a frame in which the order 0 is growth and a uniform rotation the phase is the smoothest, so
    that this one is taken where there is one and the size hardly larger.

    Args:
        drift, diffusions, impulses: what moves the state along a path of ξ, by white noise, and at random times.
        epsilon: ε.
        spread: by the name of a noise the standard deviation of ξ and about how long it remembers its value.
    """
    parts = dict[str | None, list[tuple[float, CoefficientMatrix]]]()
    for term in drift:
        for name, c in zip((None, term.noise), affine(term.g) or (0.0, 1.0), strict=True):
            parts.setdefault(name, []).append((c * epsilon**term.order, term))
    steady = combined(parts.pop(None, ()))
    driven = [(matrix, *spread(name or "")) for name, terms in parts.items() if any(matrix := combined(terms))]
    white = [combined([(epsilon**each.order, each)]) for each in diffusions]
    struck = [(each.rate, (*each.exponent[0], *each.exponent[1])) for each in impulses]
    rotating = rotating_coordinates(np.reshape(_free(drift), (2, 2)))
    if rotating is None and not (driven or white or struck):
        return None  # what is nilpotent is as small as one likes

    def size(row: tuple[float, float]) -> float:
        total = _norm(steady, row) + sum((norm := _norm(each, row)) * norm for each in white)
        total += sum(rate * _norm(each, row) for rate, each in struck)
        for each, deviation, time in driven:
            strength = deviation * _norm(each, row)
            total += strength * min(1.0, strength * time)
        return total

    own = best = 0.0, 1.0
    least = size(own)
    while True:
        slant, ratio = best
        near = (slant, 2 * ratio), (slant, ratio / 2), (slant + ratio / 2, ratio), (slant - ratio / 2, ratio)
        found = min((size(row), row) for row in near)
        if not found[0] < BARELY * least:
            break
        least, best = found
    choice = [own, best]
    if rotating is not None:
        (first, _), (lower, last) = rotating.tolist()
        choice.insert(0, (lower / first, last / abs(first)))
    chosen = next((row for row in choice if size(row) <= HARDLY * least), own)
    return None if chosen == own else Frame(((1.0, 0.0), chosen))


def _norm(matrix: Sequence[float], row: tuple[float, float]) -> float:
    """‖S⁻¹AS‖ of A row by row and S of the rows (1, 0) and (l, μ)."""
    (a, b, c, d), (slant, ratio) = matrix, row
    first = a + b * slant
    return math.hypot(first, b * ratio, (c + d * slant - slant * first) / ratio, d - slant * b)


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
