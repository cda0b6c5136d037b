"""The parts of a proof that state a system by its matrices or a noise by its rates, as floats taken as exact."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from fpsolve.arrays import FloatArray, identity, one
from fpsolve.model.exact import Exact, ExactJump, ExactLaw, ExactMotion, chain_law
from fpsolve.model.noise import Noise
from fpsolve.model.noises.several import noises_of
from fpsolve.model.noises.white import White
from fpsolve.model.plane import (
    MOST_VARIABLES,
    CoefficientMatrix,
    System,
    affine,
    matrix_at,
    rotating_coordinates,
    written_coefficient,
)
from fpsolve.model.problem import Problem
from fpsolve.model.systems.plane_system import LinearSystem

MOST_TERMS, MOST_ORDER, MOST_STATES = 200, 40, 400
KNOWN = "OrnsteinUhlenbeck, NonGaussianNoise, SineWiener, Telegraph, MarkovChain and White"
"""Noises for which a proof is known."""
NEAR = 1e-12
"""How near a multiple of π/4 a phase is taken as that."""
Row = Annotated[list[float], Field(min_length=2, max_length=2)]
Matrix = Annotated[list[Row], Field(min_length=2, max_length=2)]
SquareMatrix = Annotated[
    list[Annotated[list[float], Field(min_length=1, max_length=MOST_VARIABLES)]],
    Field(min_length=1, max_length=MOST_VARIABLES),
]
OctantRays = ((1, 0), (1, -1), (0, -1), (-1, -1))
"""Along (cos φ, −sin φ) for φ = 0, π/4, π/2 and 3π/4."""


class Record(BaseModel):
    """A part of a proof; numbers are floats that are taken as exact."""

    model_config = ConfigDict(strict=True, extra="forbid", allow_inf_nan=False, frozen=True)


class TermRecord(Record):
    """ε^order (offset + slope ξ) A x."""

    order: Annotated[int, Field(ge=0, le=MOST_ORDER)]
    matrix: Matrix
    offset: float
    slope: float


class JumpRecord(Record):
    """x⁺ = e^{log_factor} x⁻ where x passes the line through the ray."""

    ray: Row
    log_factor: float

    @model_validator(mode="after")
    def _is_a_line(self) -> Self:
        if not any(self.ray):
            raise ValueError("a ray has a direction")
        return self


class MotionRecord(Record):
    """A system by its matrices.

    Attributes:
        numbers: "binary": what is proven holds for the exact values of these floats.
        epsilon: ε.
        coordinates: P of x = P y; the phase and the size of which a proof speaks are those of y. Λ is the same.
    """

    numbers: Literal["binary"] = "binary"
    epsilon: Annotated[float, Field(gt=0)]
    terms: Annotated[list[TermRecord], Field(min_length=1, max_length=MOST_TERMS)]
    jumps: Annotated[list[JumpRecord], Field(max_length=MOST_TERMS)]
    coordinates: Matrix

    @model_validator(mode="after")
    def _can_be_turned_back(self) -> Self:
        if not _determinant(_fractions(self.coordinates)):
            raise ValueError("the coordinates have no inverse")
        return self

    @classmethod
    def of(cls, system: System) -> MotionRecord:
        """The terms and the jumps of a system.

        Raises:
            TypeError: a coefficient is not a + bξ.
        """
        terms = []
        for term in system.terms:
            line = affine(term.g)
            if line is None:
                told = written_coefficient(term.g).strip()
                raise TypeError(f"got the coefficient {told}; proofs are for coefficients a + b ξ")
            matrix = [list(row) for row in term.matrix]
            terms.append(TermRecord(order=term.order, matrix=matrix, offset=line[0], slope=line[1]))
        jumps = [JumpRecord(ray=ray_of(jump.phase), log_factor=float(jump.log_factor)) for jump in system.jumps]
        return cls(epsilon=float(system.epsilon), terms=terms, jumps=jumps, coordinates=_rotating(system))

    @property
    def exact(self) -> ExactMotion:
        """The motion of y."""
        change = _fractions(self.coordinates)
        back = np.array([[change[1, 1], -change[0, 1]], [-change[1, 0], change[0, 0]]]) / _determinant(change)
        sizes = [Fraction(self.epsilon) ** term.order * _fractions(term.matrix) for term in self.terms]
        still, driven = (
            back @ sum(Fraction(getattr(term, part)) * a for term, a in zip(self.terms, sizes, strict=True)) @ change
            for part in ("offset", "slope")
        )
        jumps = (ExactJump(back @ _fractions(j.ray), Fraction(1), Fraction(j.log_factor)) for j in self.jumps)
        return ExactMotion(still, driven, tuple(jumps))


class LinearRecord(Record):
    """A motion by its matrices.

    Attributes:
        numbers: "binary": what is proven holds for the exact values of these floats.
        drift, diffusions: A, and all B_k, in Stratonovich's sense.
    """

    numbers: Literal["binary"] = "binary"
    drift: SquareMatrix
    diffusions: Annotated[list[SquareMatrix], Field(max_length=MOST_TERMS)]

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        if any(np.shape(each) != 2 * (len(self.drift),) for each in (self.drift, *self.diffusions)):
            raise ValueError("matrices must be square and of one size")
        return self

    @classmethod
    def of(cls, problem: Problem) -> LinearRecord:
        """The matrices of a problem. Raises `TypeError` where its noise is not white."""
        drift, diffusions, impulses = problem.noise.motion(problem.system)
        if impulses or not problem.noise.is_white or problem.system.pasts:
            told = f"got a system of {problem.dimension} variables under other noise than white, or with a delay"
            raise TypeError(f"{told}; proofs are for two variables under {KNOWN}, and for more under White")
        steady, *noisy = (
            sum(
                (drift.epsilon**each.order * np.array(each.matrix) for each in terms),
                np.zeros(2 * (problem.dimension,)),
            )
            for terms in (drift.terms, *([each] for each in diffusions))
        )
        return cls(drift=steady.tolist(), diffusions=[each.tolist() for each in noisy])

    def problem(self, factor: FloatArray) -> Problem:
        """That of y = G x."""
        turned = [(factor @ np.array(a) @ np.linalg.inv(factor)).tolist() for a in (self.drift, *self.diffusions)]
        terms = [CoefficientMatrix(int(k > 0), a, identity if k else one, str(k or "")) for k, a in enumerate(turned)]
        return Problem(LinearSystem(terms), noises_of({str(k): White(s=1.0) for k in range(1, len(turned))}))


class ChainRecord(Record):
    """A noise by the values of its states and its rates; what stands on the diagonal does not count.

    Attributes:
        numbers: "binary": what is proven holds for the exact values of these floats.
    """

    numbers: Literal["binary"] = "binary"
    states: Annotated[list[float], Field(min_length=1, max_length=MOST_STATES)]
    rates: Annotated[list[list[float]], Field(min_length=1, max_length=MOST_STATES)]

    @model_validator(mode="after")
    def _has_rates(self) -> Self:
        rows = range(len(self.states))
        if {len(self.rates), *map(len, self.rates)} != {len(rows)}:
            raise ValueError("rates must be from each state to each")
        if any(self.rates[i][j] < 0 for i in rows for j in rows if i != j):
            raise ValueError("rates from one state to another must be >= 0")
        return self

    @classmethod
    def of(cls, noise: Noise) -> ChainRecord:
        """The states and rates of a chain.

        Raises:
            TypeError: there are too many states, or it is none.
        """
        if not noise.has_states or noise.is_white:
            raise TypeError(f"got {type(noise).__name__}; proofs are for {KNOWN}")
        states = np.asarray(noise.states)  # type: ignore[attr-defined]
        if len(states) > MOST_STATES:
            raise TypeError(f"got a chain of {len(states)} states; proofs are for {MOST_STATES} at most")
        return cls(states=states.tolist(), rates=np.asarray(noise.rates).tolist())  # type: ignore[attr-defined]

    @property
    def exact(self) -> ExactLaw:
        """The chain."""
        return chain_law(_fractions(self.states), _fractions(self.rates))


def ray_of(phase: float) -> list[float]:
    """A direction with a phase: whole numbers near a multiple of π/4, else cos φ and −sin φ as floats."""
    octants = phase / (math.pi / 4)
    if abs(octants - round(octants)) <= NEAR:
        return [float(each) for each in OctantRays[round(octants) % 4]]
    return [math.cos(phase), -math.sin(phase)]


def _rotating(system: System) -> list[list[float]]:
    """P for which P⁻¹A₀P is growth and a rotation, or the identity where the order 0 does not rotate."""
    found = rotating_coordinates(matrix_at(system, 0.0, slice(0, 1)))
    return (np.eye(2) if found is None else found).tolist()


def _fractions(numbers: Any) -> Exact:
    """The exact values of floats."""
    found: Exact = np.vectorize(Fraction, otypes=[object])(numbers)
    return found


def _determinant(a: Exact) -> Fraction:
    found: Fraction = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
    return found
