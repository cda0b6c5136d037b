"""The tilted generator L(p) of Eq. (19) on a mesh: matrices for any p, from terms assembled once."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, kron

from fpsolve.arrays import FloatArray
from fpsolve.fem.kronecker import KroneckerPattern, KroneckerSum
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.space import CylinderSpace
from fpsolve.fem.terms import Jump, Power, Term, power_of_epsilon, terms_of
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.plane import angular_frequency, crosses_both_ways, growth_rate, phase_speed
from fpsolve.model.problem import Problem

_ALL = slice(None)


class Generator:
    """L(p) in weak form on a mesh; `print` lists its terms.

    Args:
        problem: a motion and its noise.
        mesh: half circle (its principal eigenvalue is that of the full circle) or full circle.
        tilt: s of the factor exp(s z) in the trial and test functions, see `DiffusionSpace`.

    Raises:
        MeshError: the mesh has no line at a kick, or a cell's polynomials in the noise cannot be told apart.
    """

    def __init__(self, problem: Problem, mesh: CylinderMesh, tilt: float = 0.0) -> None:
        self.problem, self.space = problem, CylinderSpace(mesh, problem.noise, tilt)
        for kick in problem.system.kicks:
            self.space.mesh.vertices_at(kick.phase)

    def __reduce__(self) -> tuple[Any, ...]:
        """What it is made of; the matrices are assembled again when they are needed."""
        return type(self), (self.problem, self.space.mesh, self.space.xi.tilt)

    def __str__(self) -> str:
        lines = [f"  {power_of_epsilon(term.order):<2}  {term.text}" for term in self.terms()]
        return "\n".join(["L(p), Eq. (19), the sum of", *lines])

    def terms(self) -> tuple[Term, ...]:
        """L(p) term by term."""
        return tuple(terms_of(self.problem.system, self.space))

    def matrix(self, p: float, *, derivative: int = 0, shift: float = 0.0, orders: slice = _ALL) -> csc_matrix:
        """The matrix of dᵏL/dpᵏ − shift, from the terms of some orders in ε; all matrices share their indices.

        Args:
            p: the moment.
            derivative: k.
            shift: times the mass matrix.
            orders: slice(1, None) leaves out L₀.
        """
        pattern, keys, entries = self._assembled
        wanted = range(1 + max(order for order, _ in keys))[orders]
        of_p = [c(p, derivative) if order in wanted else 0.0 for order, c in keys]
        return pattern.matrix(np.array([*of_p, -shift]) @ entries)

    @cached_property
    def mass(self) -> csc_matrix:
        """∫ P_s w T."""
        return csc_matrix(kron(self.space.phi.mass(), self.space.xi.mass()))

    @cached_property
    def _assembled(self) -> tuple[KroneckerPattern, list[tuple[int, Power | Jump]], FloatArray]:
        """The sparsity pattern, (order, coefficient) of each sum of terms, and its entries; the last is the mass."""
        sums: dict[tuple[int, Power | Jump], KroneckerSum] = {}
        for term in self.terms():
            key = term.order, term.of_p
            sums[key] = sums[key] + term.operator if key in sums else term.operator
        operators = [*sums.values(), KroneckerSum.of(self.space.phi.mass(), self.space.xi.mass())]
        pattern = KroneckerPattern(operators)
        return pattern, list(sums), np.stack([pattern.entries(operator) for operator in operators])

    def release(self) -> None:
        """Give the memory of the assembled parts free; they are assembled again when they are needed."""
        for name in ("_assembled", "mass"):
            self.__dict__.pop(name, None)

    @property
    def unit_rate(self) -> float:
        """The system's own unit of rates, ω."""
        return angular_frequency(self.problem.system)

    @property
    def keeps_constants(self) -> bool:
        """Whether ⟨P_s, L₀T⟩ = 0 for every T: the order 0 of the motion rotates uniformly, without growth."""
        free = [drive for drive in self.problem.system.drives if drive.order == 0]
        return all(drive.h.amplitude == 0 and drive.q.vanishes for drive in free)

    def upper_bound(self, p: float) -> float:
        """A number right of Λ(p): the supremum of p q over φ and ξ, and of the kicks spread evenly over φ.

        Where states of a chain move the phase over a ray to and fro, each jump between them may bring a kick more.
        """
        system, noise, xi = self.problem.system, self.problem.noise, self.space.xi.support
        q, speed = growth_rate(system, xi), phase_speed(system, xi)
        growth = max(0.0, float(np.max(p * q.mean + abs(p) * q.amplitude)))
        fastest = float(np.max(np.abs(speed.mean) + speed.amplitude))
        for kick in system.kicks:
            gain = max(0.0, p * kick.log_factor)
            growth += gain * fastest / math.pi
            if isinstance(noise, MarkovChain) and crosses_both_ways(system, kick, xi):
                growth += float(-np.min(noise.rates)) * math.expm1(gain)
        return growth
