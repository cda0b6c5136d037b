"""Coordinates y = S⁻¹x of a problem's own, in which the rates of its phase and of its growth are small.

A linear change of coordinates leaves Λ(p) alone, as ‖x‖ and ‖y‖ are within constant factors, and the phase ψ of y needs
fewer functions than φ of x: with x″ + ω²x = 0 the phase of (x, ẋ) runs between the speeds 1 and ω². So Λ(p) is right
whatever the units of x. That of time needs no care: every number scales with it. With x = a e(φ), e = (cos φ, −sin φ),
and ρ(φ) = |S⁻¹e(φ)|,

    ‖x‖^p T(φ) = ‖y‖^p T_y(ψ),  so that  T(φ) = ρ^p T_y(ψ(φ)),  dψ/dφ = 1/(det S ρ²).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, reduce

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular

from fpsolve.arrays import FloatArray
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.plane import (
    STEADY,
    CoefficientMatrix,
    CubicTerms,
    Impulse,
    LinearMotion,
    Matrix,
    is_driven,
    kept_phases,
    rotating_coordinates,
    rows_of,
)
from fpsolve.model.problem import ParameterDerivative, Problem
from fpsolve.model.quantity import moment_at

MOST_PARTS = 1000
"""Largest number of parts of a rule in the phase of the frame."""
HARDLY = 2.0
"""Largest factor by which rates may be larger in a frame that is preferred."""
BARELY = 0.99
"""Share of the rates at which the search for a frame ends. S changes by powers of two: hardly anything is rounded."""
MOST_TURNED = 4
"""Largest number of variables of which frames are tried."""
FOREVER, WHITE = (1.0, 1e100), (1e100, 1e-200)
"""Standard deviation and correlation time of what is constant, and of white noise of the intensity 1, as limits."""
MOST_STEPS = 400
"""Largest number of steps of this search: some 60 for each variable and unit of 1e18."""
OF_PRODUCTS = 1e-14
"""Share of the terms of an entry of S⁻¹AS that is rounding."""


@dataclass(frozen=True)
class Frame:
    """S, a lower triangular matrix with a positive diagonal: x₁ = 0 where y₁ = 0, and in the plane ψ grows with φ.

    Attributes:
        matrix: S.
    """

    matrix: Matrix

    @cached_property
    def array(self) -> FloatArray:
        """S as an array."""
        return np.array(self.matrix)

    @property
    def is_itself(self) -> bool:
        """Whether S = 1, so that y is x."""
        return np.array_equal(self.array, np.eye(len(self.array)))

    @cached_property
    def _inverse(self) -> FloatArray:
        return np.asarray(solve_triangular(self.array, np.eye(len(self.array)), lower=True))

    def term(self, term: CoefficientMatrix) -> CoefficientMatrix:
        """A term for y, with the matrix S⁻¹AS."""
        return replace(term, matrix=self._inverse @ np.array(term.matrix) @ self.array)

    def cubic(self, terms: CubicTerms) -> CubicTerms:
        """Cubic terms for y: S⁻¹ C of the products of Sy."""
        first, second = self.array
        products = [reduce(np.convolve, [first] * (3 - k) + [second] * k) for k in range(4)]
        return CubicTerms(self._inverse @ np.array(terms.matrix) @ np.array(products))

    def exponent(self, of: Impulse) -> Impulse:
        """An impulse, or its derivative, for y."""
        return replace(of, exponent=self._inverse @ np.array(of.exponent) @ self.array)

    def motion(self, system: LinearMotion) -> LinearMotion:
        """A system for y, the terms of order 0 that no noise drives as one; a rotation is one exactly."""
        if self.is_itself:
            return system
        others = [self.term(term) for term in system.terms if not is_free(term)]
        free = system.by_noise([*filter(is_free, system.terms)])[STEADY]
        a = self._inverse @ free @ self.array
        turned = 0.5 * (np.trace(a) * np.eye(len(a)) + a - a.T)
        is_turn = np.all(abs(a - turned) <= OF_PRODUCTS * (abs(self._inverse) @ abs(free) @ abs(self.array)))
        steady = CoefficientMatrix(0, turned if is_turn and len(a) == 2 else a)
        jumps = [replace(jump, phase=float(self.phase(np.array(jump.phase)))) for jump in system.jumps]
        diffusions, impulses = map(self.term, system.diffusions), map(self.exponent, system.impulses)
        return LinearMotion((steady, *others), jumps, system.epsilon, diffusions=[*diffusions], impulses=[*impulses])

    @property
    def parts(self) -> int:
        """The number of parts of a cell of ψ over which dφ/dψ is integrated: the more, the more φ and ψ differ."""
        return min(math.ceil(float(np.linalg.cond(self.array))), MOST_PARTS)

    def phase(self, phi: FloatArray) -> FloatArray:
        """ψ(φ), which is φ at odd multiples of π/2."""
        return _turned(self._inverse, phi)

    def own_phase(self, psi: ArrayLike) -> FloatArray:
        """φ(ψ)."""
        return _turned(self.array, psi)

    def length(self, phi: FloatArray) -> FloatArray:
        """ρ(φ), how long y is for a unit vector x."""
        return np.asarray(np.linalg.norm(self._inverse @ _unit(phi), axis=0))

    def density(self, phi: FloatArray) -> FloatArray:
        """dψ/dφ."""
        return np.asarray(np.linalg.det(self._inverse) / self.length(phi) ** 2)


class Framed:
    """The motion of a problem in the coordinates in which it is solved, see `framed`.

    Attributes:
        problem: the system and its noise.
        frame: S.
        rate_bound: how fast it moves there at most, about, by all that moves it.
        motion: the system along a path of ξ: what is left of it beside white noise.
    """

    def __init__(self, problem: Problem) -> None:
        moved = problem.noise.motion(problem.linear)
        self.frame, self.rate_bound = frame, _ = own_frame(problem, moved)
        self.problem, self.motion = problem, frame.motion(moved)

    def changed(self, by: ParameterDerivative) -> ParameterDerivative:
        """A derivative of the problem in the same coordinates, as L(p) is smooth in parameters in one frame only."""
        terms, diffusions = (tuple(map(self.frame.term, each)) for each in (by.terms, by.diffusions))
        return replace(by, terms=terms, diffusions=diffusions, impulses=tuple(map(self.frame.exponent, by.impulses)))

    @cached_property
    def unit_rate(self) -> float:
        """Its own unit of rates: ω or the size of the order 0, or of all where there is none."""
        return self.motion.angular_frequency() or self.rate_bound or 1.0

    def wall_speeds(self, motion: LinearMotion) -> list[float]:
        """dφ/dt of a motion at the ray of each jump, which no noise changes."""
        extremes = self.problem.valued.extremes
        return [float(np.ravel(motion.phase_speed(extremes)(jump.phase))[0]) for jump in self.motion.jumps]

    @cached_property
    def resting_phases(self) -> tuple[float, ...]:
        """Phases of rays of a plane that are never left, nor reached; one, 0, where all rays are."""
        jolts = [each.matrix for each in self.motion.diffusions] + [each.exponent for each in self.motion.impulses]
        return kept_phases([*map(np.array, jolts), *self.motion.by_noise().values()])

    @cached_property
    def invariant_rays(self) -> tuple[float, ...]:
        """φ of these in the coordinates of the system."""
        return tuple(float(self.frame.own_phase(phi) % math.pi) for phi in self.resting_phases)


@lru_cache(64)
def framed(problem: Problem) -> Framed:
    """That of a problem, made once."""
    return Framed(problem)


def infinite(problem: Problem, p: float, symbol: str = "") -> Message | None:
    """Why there is no finite Λ(p), at p = 0 no λ: algebraic tails of the noise, or jumps on a ray that is never left.

    Args:
        problem: a motion and its noise.
        p: the moment.
        symbol: what the number is called; that of Λ(p) if none is given.
    """
    if p and problem.noise.has_algebraic_tails and problem.is_driven:
        return Message(Code.TAILS, what=symbol or moment_at(p).symbol, remedy=Remedy.REDUCTION)
    if any(jump.log_factor for jump in problem.linear.jumps) and (rays := framed(problem).invariant_rays):
        return Message(Code.INVARIANT_RAY, p=p, phase=rays[0])
    return None


def mean_matrix(problem: Problem, motion: LinearMotion) -> FloatArray:
    """Σ ε^n ⟨g⟩ A of the terms of a motion, in the mean over the noise."""
    means = [motion.epsilon**term.order * problem.named_noise(term.noise).mean_of(term.g) for term in motion.terms]
    matrices = np.reshape([term.matrix for term in motion.terms], (-1, motion.dimension, motion.dimension))
    return np.tensordot(np.array(means), matrices, 1)


def is_free(term: CoefficientMatrix) -> bool:
    """Whether a term is of order 0, and no noise drives it."""
    return term.order == 0 and not is_driven(term.g)


def own_frame(problem: Problem, moved: LinearMotion) -> tuple[Frame, float]:
    """The frame in which a motion is small, x itself where that is hardly worse; and its size there, a rate.

    That is Σ min(s‖D‖, τs²‖D‖²), D of noise with the standard deviation s and the correlation time τ: what the rates of
    growth and of the phase may be. What no noise drives never changes, so that it is ‖A‖; of white noise it is ‖B‖²; of
    impulses at the rate r it is r‖C‖. In a frame in which the order 0 is growth and a uniform rotation the phase is the
    smoothest, so that this one is taken where there is one and the size hardly larger; else other scales if these
    suffice.

    Args:
        problem: the system and its noise.
        moved: how the noise moves it.
    """
    sums, n = moved.by_noise(), problem.dimension
    parts = [(sums.pop(STEADY), *FOREVER)]
    parts += [(moved.epsilon**each.order * np.array(each.matrix), *WHITE) for each in moved.diffusions]
    parts += [(each.rate * np.array(each.exponent), *FOREVER) for each in moved.impulses]
    for (name, _), each in sums.items():
        noise = problem.named_noise(name)
        if each.any():
            parts.append((each, noise.standard_deviation, noise.correlation_time))
    matrices, deviations, times = (np.array(each) for each in zip(*parts, strict=True))

    def size(frame: FloatArray) -> float:
        turned = np.linalg.inv(frame) @ matrices @ frame
        norms = np.sqrt(np.einsum("kij,kij->k", turned, turned))
        strengths = deviations * norms
        return float(strengths @ np.minimum(1.0, strengths * times))

    own = best = np.eye(n)
    least, choice = size(own), [own]
    for is_scaling in (True, False) if n <= MOST_TURNED else ():
        steps = [  # y_i twice or half, and with half of y_j more or less
            own + change * np.outer(own[i], own[j])
            for i in range(1, n)
            for j in range(i if is_scaling else 0, i + 1)
            for change in ((1.0, -0.5) if i == j else (0.5, -0.5))
        ]
        for _ in range(MOST_STEPS):
            found, number = min((size(best @ step), k) for k, step in enumerate(steps))
            if not found < BARELY * least:
                break
            least, best = found, best @ steps[number]
        else:  # as what is nilpotent, which is as small as one likes
            least, best = size(own), own
        choice.append(best)
    free = moved.by_noise([*filter(is_free, moved.terms)])[STEADY]
    if n == 2 and (rotating := rotating_coordinates(free)) is not None:
        (first, _), (lower, last) = rotating
        choice.insert(0, np.array([[1.0, 0.0], [lower / first, last / abs(first)]]))
    chosen = next((each for each in choice if size(each) <= HARDLY * least), own)
    return Frame(rows_of(chosen)), least


def _unit(phi: FloatArray) -> FloatArray:
    """e(φ), shape (2, n), of which the first is exactly 0 at π/2: the other one may be small beside it."""
    return np.stack([np.sin(math.pi / 2 - np.abs(phi)), -np.sin(phi)])


def _turned(matrix: FloatArray, phi: ArrayLike) -> FloatArray:
    """The phase of a matrix times e(φ), in the same half turn; φ itself for 1."""
    if np.array_equal(matrix, np.eye(2)):
        return np.asarray(phi, dtype=float)
    half_turns = math.pi * np.round(np.asarray(phi) / math.pi)
    x = matrix @ _unit(np.ravel(np.asarray(phi) - half_turns))
    return np.asarray(np.arctan2(-x[1], x[0]).reshape(np.shape(phi)) + half_turns)
