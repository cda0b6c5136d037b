"""What some coordinates of a linear system obey by themselves.

Where all matrices of a system are block triangular in coordinates x = Σ V_k y_k, y_k = W_k x, each y_k obeys ẏ_k =
Σ εⁿ g(ξ) W_k A V_k y_k but for what other blocks drive.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import cdf2rdf

from fpsolve.arrays import ROUNDED, FloatArray
from fpsolve.model.coordinates import framed
from fpsolve.model.expressions import TIME
from fpsolve.model.plane import (
    BELOW,
    CoefficientMatrix,
    Jump,
    LinearMotion,
    ParameterDerivative,
    System,
    as_plane,
    rows_of,
)
from fpsolve.model.problem import Problem

WORST_CONDITION = 100.0
"""Largest condition of eigenvectors in which blocks are looked for."""


@dataclass(frozen=True)
class Subsystem(System):
    """One block of a system, with its parameters. One coordinate is given as ẋ = (a + J)x, J a uniform rotation.

    Attributes:
        whole: the system.
        basis: all V_k beside each other, of n rows and columns.
        own: the columns that are V_k.
        names: what its coordinates are called.
        rounded: share of a matrix in these coordinates that is rounding: 0 where they are variables of the system.
        jumps: that of a stop of the whole, whose coordinate and its rate it has.
    """

    whole: System
    basis: tuple[tuple[float, ...], ...]
    own: tuple[int, ...]
    names: tuple[str, ...]
    rounded: float
    jumps: tuple[Jump, ...]

    def linear(self) -> LinearMotion:
        whole = self.whole.linear()
        terms = as_plane(self.part(whole.terms))
        clock = whole.clock if any(term.noise == TIME for term in terms) else None
        return LinearMotion(terms, self.jumps, whole.epsilon, clock=clock)

    @cached_property
    def _sides(self) -> tuple[FloatArray, FloatArray]:
        """All W_k below each other, and all V_k beside each other."""
        basis = np.array(self.basis)
        return np.linalg.inv(basis), basis

    def inside(self, matrix: ArrayLike) -> FloatArray:
        """A matrix in the coordinates of all blocks, without what is rounding."""
        rows, columns = self._sides
        found = rows @ np.asarray(matrix) @ columns
        return np.where(np.abs(found) > self.rounded * np.linalg.norm(found), found, 0.0)

    def part(self, terms: Sequence[CoefficientMatrix]) -> tuple[CoefficientMatrix, ...]:
        """W_k A V_k of some terms of the whole, without those of which nothing is left."""
        found = [(term, self.inside(term.matrix)[np.ix_(self.own, self.own)]) for term in terms]
        return tuple(replace(term, matrix=matrix) for term, matrix in found if np.any(matrix))

    @property
    def section(self) -> str:  # type: ignore[override]
        return self.whole.section

    @property
    def noise_sections(self) -> Sequence[str]:
        """The sections of the noises that drive it; the first one of the whole where none does."""
        known = self.whole.noise_sections
        if len(known) == 1:
            return known
        return [each for each in known if each.removeprefix("noise.") in self.linear().driven_by] or known[:1]

    @property
    def values(self) -> Mapping[str, float | str]:
        return self.whole.values

    @property
    def differentiable(self) -> Sequence[str]:
        return self.whole.differentiable

    def at(self, values: Mapping[str, float | str]) -> Subsystem:
        """The same block of the whole with other values, which leave it one."""
        return replace(self, whole=self.whole.at(values))

    def derivative(self, name: str) -> ParameterDerivative:
        """The derivative of the whole system, in the coordinates of this block."""
        whole = self.whole.derivative(name)
        jumps, clock = whole.jumps if self.jumps else (), whole.noise if self.linear().clock else None
        return replace(whole, terms=as_plane(self.part(whole.terms), has_turn=False), jumps=jumps, noise=clock)


@lru_cache(maxsize=64)
def blocks_of(problem: Problem) -> tuple[Subsystem, ...]:
    """The blocks that can be solved by themselves, as all matrices are block triangular; empty where they are not.

    Groups of the variables, of which each drives later ones alone: the strongly connected components of the union of
    the patterns of all matrices. Where there is one group, those of coordinates y that show more, if there are any. Of
    two variables ‖x‖ on the first of the rays that the phase never leaves, and on the second one, or else the distance
    from the first.
    """
    system, motion = problem.linear, framed(problem)
    frame, resting = motion.frame.array, motion.resting_phases
    matrices, n, stop = [*system.by_noise().values()], system.dimension, system.stop
    jumps, rounded, names, groups = tuple[Jump, ...](), 0.0, system.states, list[tuple[int, ...]]()
    if n == 2:
        if not resting:
            return ()
        phases = np.array(resting if len(resting) == 2 else (resting[0], resting[0] + math.pi / 2))
        rays, names = np.stack([np.cos(phases), -np.sin(phases)]), ("", "")
        basis, rounded = frame @ rays, ROUNDED * np.linalg.cond(rays)
        groups = [(0,), (1,)] if any(map(_turns, matrices)) else [(0,)]
    elif stop is not None:  # in its coordinates, of which the first two must be one block, as a part has no stop
        basis, rounded, names = np.linalg.inv(np.array(stop.coordinates)), ROUNDED, stop.names(names)
        pattern = np.sum([abs(stop.inside(each)) for each in matrices], axis=0)
        pattern[1, 0] += 1.0
        together = components(pattern)
        groups = together if (0, 1) in together else []
        jumps = (Jump(math.pi / 2, math.log(stop.restitution)),)
    else:
        basis, groups = np.eye(n), components(np.sum(np.abs(matrices), axis=0))
        if len(groups) == 1:
            own, groups, rounded = hidden_blocks([np.linalg.inv(frame) @ each @ frame for each in matrices])
            basis, names = frame @ own, [f"y{str(k + 1).translate(BELOW)}" for k in range(n)]
    sides = rows_of(basis)
    return tuple(
        Subsystem(
            problem.system,
            sides,
            own,
            tuple(names[k] for k in own),
            rounded,
            jumps if own == (0, 1) else (),
        )
        for own in (groups if n == 2 or len(groups) > 1 else ())
    )


def _turns(a: FloatArray) -> bool:
    """Whether a matrix is no multiple of 1, beyond rounding."""
    return bool(np.any(np.abs(a - a[0, 0] * np.eye(len(a))) > ROUNDED * np.linalg.norm(a)))


def couples(blocks: Sequence[Subsystem], name: str) -> bool:
    """Whether another value of a parameter of the system lets one of the blocks drive one that it is driven by.

    Then the derivative of Λ(p) by it is not that of one block. By one that lets uncoupled blocks drive each other it
    is, as −V_k in place of V_k gives the opposite derivative of the couplings: Λ(p) is even in them.
    """
    whole = blocks[0].whole.linear()
    changes = whole.by_noise(blocks[0].whole.derivative(name).terms).values()
    if len(blocks) == 1:  # all rays are invariant
        return any(map(_turns, changes))
    drives = reached(couplings(blocks, whole.by_noise().values()))
    return bool(np.any(drives.T & couplings(blocks, changes)))


def couplings(blocks: Sequence[Subsystem], matrices: Iterable[FloatArray]) -> NDArray[np.bool_]:
    """Whether a block, the row, is driven by another one, the column, in some of the matrices, beyond rounding."""
    found = np.zeros((len(blocks), len(blocks)), dtype=bool)
    for matrix in (blocks[0].inside(each) for each in matrices):
        for i, one in enumerate(blocks):
            for j, other in enumerate(blocks):
                found[i, j] |= i != j and bool(np.any(matrix[np.ix_(one.own, other.own)]))
    return found


def reached(pattern: FloatArray | NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which variable, the row, feels which, the column, through any number of others; every one feels itself."""
    count = len(pattern)
    return np.linalg.matrix_power((pattern != 0) | np.eye(count, dtype=bool), count)


def components(pattern: FloatArray | NDArray[np.bool_]) -> list[tuple[int, ...]]:
    """The variables in groups that feel each other, of which each feels earlier ones alone."""
    feels = reached(pattern)
    groups = {tuple(np.flatnonzero(row & feels[:, k]).tolist()) for k, row in enumerate(feels)}
    return sorted(groups, key=lambda group: (np.count_nonzero(feels[group[0]]) - len(group), group))


def hidden_blocks(matrices: Sequence[FloatArray]) -> tuple[FloatArray, list[tuple[int, ...]], float]:
    """A basis in which matrices have blocks, the columns of each, and what share of a matrix is rounding there.

    There is one block where none are found.

    What is invariant for all matrices is so for sums of their products. Such a sum with coefficients at random has
    different eigenvalues unless two blocks are alike, and then what is invariant is spanned by its eigenvectors.
    """
    scaled = [a / norm for a in matrices if (norm := np.linalg.norm(a))]
    words = [*scaled, *(a @ b for a in scaled for b in scaled)]
    mixed = np.tensordot(np.random.default_rng(0).standard_normal(len(words)), words, 1)
    values, vectors = np.linalg.eig(mixed)
    (_, basis), sizes = cdf2rdf(values, vectors), [1 + bool(each.imag) for each in values if each.imag >= 0]
    if not (condition := np.linalg.cond(basis)) < WORST_CONDITION:
        return np.eye(len(basis)), [(*range(len(basis)),)], 0.0
    least = ROUNDED * condition
    inside = [np.linalg.solve(basis, a @ basis) for a in scaled]
    pattern = np.any([np.abs(a) > least * np.linalg.norm(a) for a in inside], axis=0)
    of_mode = np.repeat(np.eye(len(sizes), dtype=bool), sizes, axis=1)
    groups = components(pattern | of_mode.T @ of_mode)
    order = [k for group in groups for k in group]
    places = [tuple(order.index(k) for k in group) for group in groups]
    return basis[:, order], places, least
