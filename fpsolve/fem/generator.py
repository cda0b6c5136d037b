"""The tilted generator L(p) of Eq. (19) on a mesh: matrices for any p, from terms assembled once."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.linalg
from scipy.sparse.linalg import LinearOperator

from fpsolve.arrays import Mask, Matrix, dense, one
from fpsolve.fem.axis import KroneckerSum, along
from fpsolve.fem.factors import Factors, factorised
from fpsolve.fem.mesh import CylinderMesh, vertices_at
from fpsolve.fem.noise_axes import NoiseAxis
from fpsolve.fem.space import Space
from fpsolve.fem.terms import ALL_ORDERS, Term, Terms, TermSum, power_of_epsilon
from fpsolve.model.problem import ParameterDerivative, Problem
from fpsolve.superlu import sparse_lu

SMALL_P = 1e-2
"""For smaller |p| the discretisation is chosen at this one, as Λ and its error go to zero together."""
KEPT_SPACES = 40
"""Number of spaces, of the last p, whose matrices are kept."""
LANCZOS_STEPS = 16
"""Number of steps of Lanczos after which the end of a spectrum is known to a bound."""
LEFT_BY_STATES = 1.0
"""Share of the effect of two modes that is left at least where T is not analytic, as where the phase rests in a state,
or at φ that white noise does not move: there it falls unevenly, and ever more slowly."""


@dataclass(frozen=True, eq=False)
class Pencil:
    """L(p) − σM for one p: what is solved.

    Attributes:
        p: the moment.
        space: the trial and test functions.
        matrix: that of L(p), its first term with the matrices of noise that `space.mass` has.
        chain: the axis of noise along which L(p) is eliminated; None where there is none.
    """

    p: float
    space: Space
    matrix: KroneckerSum
    chain: int | None

    def on(self, axis: int, kept: Mask) -> Pencil:
        """What it is on some functions of an axis, where a mask is true."""
        return replace(self, matrix=self.matrix.on(axis, kept))

    @cached_property
    def numerical_abscissa(self) -> float:
        """About the largest ω of ½(L + Lᵀ)v = ωMv, rather above it, by some steps of Lanczos from a start of all v."""
        space, rows, betas = self.space, [0.0], [0.0]
        unit, inverses = space.phi.unit, [None, *(np.linalg.inv(dense(axis.matrix(one))) for axis in space.noises)]
        if unit is not None:
            solve = sparse_lu(unit.tocsc()).solve
            inverses[0] = LinearOperator(unit.shape, matvec=solve, matmat=solve, dtype=float)
        rest, old = np.random.default_rng(0).standard_normal(space.size), np.zeros(space.size)
        for _ in range(LANCZOS_STEPS):
            weighed = space.weighed(rest)
            betas.append(math.sqrt(rest @ weighed))
            new = rest / betas[-1]
            image = 0.5 * (self.matrix @ new + self.matrix.T @ new)
            rows.append(float(new @ image))
            rest = np.ravel(along(inverses, space.table(image))) - rows[-1] * new - betas[-1] * old
            old = new
        ritz, ends = scipy.linalg.eigh_tridiagonal(rows[1:], betas[2:])
        return float(ritz[-1] + abs(ends[-1, -1]) * math.sqrt(rest @ space.weighed(rest)))

    def factorised(self, shift: float) -> Factors:
        """LU factors of L(p) − σM."""
        return factorised(self.matrix.shifted(shift), self.chain)


class Generator:
    """L(p) in weak form; `print` lists its terms.

    Args:
        problem: a motion and its noise.
        chosen: on the half circle (its principal eigenvalue is that of the full circle) or the full circle.

    Raises:
        MeshError: there is no φ-line at a jump, or a cell's polynomials in the noise cannot be told apart.
    """

    def __init__(self, problem: Problem, chosen: Space | CylinderMesh) -> None:
        if isinstance(chosen, CylinderMesh):
            chosen = Space.on(chosen, problem.coloured, problem.frame)
        self.problem, self.chosen, self.size = problem, chosen, chosen.size
        self.phi = chosen.phi
        self._spaces: dict[float, Space] = {}
        self._changes: dict[ParameterDerivative, tuple[Term, ...]] = {}
        self._last: Pencil | None = None
        for jump in problem.motion.jumps:
            vertices_at(self.phi.lines, jump.phase)
        _ = self.space(0.0).constant  # refuses a mesh that cannot be used

    def __reduce__(self) -> tuple[Any, ...]:
        """What it is made of; the matrices are assembled again when they are needed."""
        return type(self), (self.problem, self.chosen)

    def __str__(self) -> str:
        lines = [f"  {power_of_epsilon(term.order):<2}  {term.text}" for term in self.terms()]
        return "\n".join([f"L(p), Eq. (19){self.problem.frame.words} the sum of", *lines])

    def space(self, p: float) -> Space:
        """Trial and test functions; the tilt of those of ξ moves with p."""
        key = p if self.chosen.is_tilted else 0.0
        if key not in self._spaces:
            if len(self._spaces) >= KEPT_SPACES:
                del self._spaces[next(iter(self._spaces))]
            self._spaces[key] = self.chosen.at(p, self.problem.coloured.parts.values())
        return self._spaces[key]

    def at(self, p: float) -> Pencil:
        """What is solved at p; the last one is kept."""
        if self._last is None or self._last.p != p:
            space = self.space(p)
            self._last = Pencil(p, space, self.matrix(p), space.chain)
        return self._last

    def forget(self) -> None:
        """Let go of what is kept of the last p."""
        self._last = None

    @cached_property
    def slowest(self) -> list[float]:
        """For each axis the least share of the effect of its highest modes that two more may leave."""
        has_states = any(noise.has_states for noise in self.problem.noise.parts.values())
        return [LEFT_BY_STATES * has_states, *(axis.slowest for axis in self.space(0.0).noises)]

    def enriched(self) -> Generator:
        """The generator on the next finer space."""
        return Generator(self.problem, self.chosen.enriched())

    def terms(self) -> tuple[Term, ...]:
        """L(p) term by term."""
        return tuple(self._own_terms.whole())

    @cached_property
    def _own_terms(self) -> Terms:
        found: Terms = self.phi.terms(self.problem, self.space(0.0).noises)
        return found

    def matrix(self, p: float, *, derivative: int = 0, orders: slice = ALL_ORDERS) -> KroneckerSum:
        """The matrix of dᵏL/dpᵏ in the space for p, from the terms of some orders in ε, the ξ-matrix of 1 first.

        Args:
            p: the moment.
            derivative: k; the tilt is held.
            orders: slice(1, None) leaves out L₀.
        """
        return self._sum.matrix(self.space(p).axes, p, derivative, orders)

    def changed(self, by: ParameterDerivative, p: float, rate: float, *, derivative: int = 0) -> KroneckerSum:
        """The matrix of ∂/∂θ (dᵏL/dpᵏ − rate M), the functions of φ and ξ held, M = `mass`; that of P_s is in it."""
        axes = self.space(p).noises
        if by not in self._changes:
            self._changes[by] = tuple(self._own_terms.changed(by))
        parts: list[tuple[Matrix, ...]] = [
            (phase, *(axis.matrix(g) for axis, g in zip(axes, term.noises, strict=True)))
            for term in self._changes[by]
            if (phase := term.at(p, derivative)) is not None
        ]
        if by.noise is not None:
            (noises, phase), *others = self._sum.phase_matrices(p, derivative).items()  # the first is that of 1
            moved = [(noises, phase - rate * self.phi.identity), *others]
            changes = [by.noise if k == by.part else None for k in range(len(axes))]
            parts += [(phase, *map(NoiseAxis.matrix, axes, noises, changes)) for noises, phase in moved]
        return KroneckerSum(parts or [(0.0 * self.phi.identity, *(axis.matrix(one) for axis in axes))])

    @cached_property
    def _sum(self) -> TermSum:
        return TermSum(self.terms())

    @cached_property
    def loss(self) -> float:
        """About how many times its rounding elimination may harm T − 1: the size of L, free of forcing, over a rate."""
        orders = ALL_ORDERS if self.problem.diffusions or self.problem.impulses else slice(0, 1)
        space = self.space(0.0)
        free = [self.matrix(0.0, orders=orders).terms[0][0], *(axis.matrix(None) for axis in space.noises)]
        return 30 * sum(float(abs(each).sum(axis=0).max()) for each in free) / self.problem.unit_rate

    @cached_property
    def keeps_constants(self) -> bool:
        """Whether ⟨P_s, L₀T⟩ = 0 for every T: the order 0 only rotates uniformly, as it does in the plane alone."""
        if self.problem.dimension > 2:
            return False
        free = [term for term in self.problem.motion.terms if term.order == 0]
        is_weak = all(each.order for each in self.problem.diffusions) and not self.problem.impulses
        return is_weak and all(term.h.amplitude == 0 and term.q.vanishes for term in free)
