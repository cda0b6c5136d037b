"""The tilted generator L(p) of Eq. (19) on a mesh: matrices for any p, from terms assembled once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from fpsolve.arrays import Matrix, one
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.factors import Factors, factorised
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.noise_axes import NoiseAxis
from fpsolve.fem.space import Space
from fpsolve.fem.terms import Noises, Term, Terms
from fpsolve.model.coordinates import framed
from fpsolve.model.problem import ParameterDerivative, Problem


@dataclass(frozen=True, eq=False)
class Pencil:
    """L(p) − σM for one p: what is solved.

    Attributes:
        p: the moment.
        space: the trial and test functions.
        matrix: that of L(p), its first term with the matrices of noise that `space.mass` has.
    """

    p: float
    space: Space
    matrix: KroneckerSum

    def shifted(self, shift: float) -> KroneckerSum:
        """L(p) − σM."""
        (phase, *noises), *others = self.matrix.terms
        return KroneckerSum([(phase - shift * self.space.phi.matrix(one), *noises), *others])

    def factorised(self, shift: float) -> Factors:
        """LU factors of L(p) − σM."""
        return factorised(self.shifted(shift), self.space.chain)


class Generator:
    """L(p) in weak form; `print` lists its terms.

    Args:
        problem: a motion and its noise.
        chosen: on the half circle (its principal eigenvalue is that of the full circle) or the full circle.

    Attributes:
        terms: those of Eq. (19).
        keeps_constants: see `Terms`.

    Raises:
        MeshError: there is no φ-line at a jump, or a cell's polynomials in the noise cannot be told apart.
    """

    def __init__(self, problem: Problem, chosen: Space | CylinderMesh) -> None:
        self.framed = framed(problem)
        if isinstance(chosen, CylinderMesh):
            chosen = Space.on(chosen, problem.valued, self.framed.frame.phase)
        self.problem, self.chosen, self.size = problem, chosen, chosen.size
        self._spaces: dict[float, Space] = {}
        self._changes: dict[ParameterDerivative, tuple[Term, ...]] = {}
        self._last: Pencil | None = None
        self._maker: Terms = chosen.phi.terms(self.framed, chosen.phi, self.space(0.0).noises)
        self.terms, self.keeps_constants = self._maker.all(), self._maker.keeps_constants

    def __reduce__(self) -> tuple[object, ...]:
        """What it is made of; the matrices are assembled again when they are needed."""
        return type(self), (self.problem, self.chosen)

    def __str__(self) -> str:
        where = "" if self.framed.frame.is_itself else " in coordinates of its own,"
        return "\n  ".join(
            [f"L(p), Eq. (19){where} the sum of these terms, each with its order", *map(str, self.terms)]
        )

    def space(self, p: float) -> Space:
        """Trial and test functions; the tilt of those of ξ moves with p, and each axis has tables of its own."""
        key, (phi, *axes) = p if self.chosen.is_tilted else 0.0, self.chosen.axes
        if key not in self._spaces:
            noises = self.problem.valued.parts.values()
            self._spaces[key] = Space([phi, *(axis.of(noise, p) for axis, noise in zip(axes, noises, strict=True))])
        return self._spaces[key]

    def at(self, p: float) -> Pencil:
        """What is solved at p; the last one is kept."""
        if self._last is None or self._last.p != p:
            self._last = Pencil(p, self.space(p), self.matrix(p))
        return self._last

    def growth_bound(self, p: float) -> float:
        """An estimate of Λ(p) from above, by the sizes of the terms at the quadrature points."""
        return self._maker.growth_bound(p, self.space(p).noises)

    @cached_property
    def left_in_phase(self) -> float:
        """The least share of the effect of the highest modes of φ that two more may leave.

        It is not 0 where chains or white noise move x: a state, or a direction, that is hardly ever left then has a
        pair of its own.
        """
        return max(noise.left_in_phase for noise in self.problem.noise.parts.values())

    def _phases(self, p: float, derivative: int, is_forcing: bool = False) -> dict[Noises, Matrix]:
        """For each function of the noises the matrix of φ of dᵏL/dpᵏ, or of its forcing; the first is that of 1."""
        phi, *noises = self.chosen.axes
        found: dict[Noises, Matrix] = {(one,) * len(noises): 0.0 * phi.matrix(one)}
        for term in self.terms:
            phase = term.at(p, derivative, is_forcing)
            if phase is not None:
                found[term.noises] = found[term.noises] + phase if term.noises in found else phase
        return found

    def matrix(self, p: float, *, derivative: int = 0, is_forcing: bool = False) -> KroneckerSum:
        """The matrix of dᵏL/dpᵏ in the space for p, the tilt held, or of L − L₀; the ξ-matrix of 1 first.

        Args:
            p: the moment.
            derivative: k.
            is_forcing: whether L₀, of the order 0 in ε, is left out.
        """
        axes, parts = self.space(p).noises, []
        for noises, phase in self._phases(p, derivative, is_forcing).items():
            parts.append([phase, *map(NoiseAxis.matrix, axes, noises)])
        return KroneckerSum(parts)

    def changed(self, by: ParameterDerivative, p: float, rate: float, *, derivative: int = 0) -> KroneckerSum:
        """The matrix of ∂/∂θ (dᵏL/dpᵏ − rate M), the functions of φ and ξ held, M = `mass`; that of P_s is in it."""
        axes = self.space(p).noises
        if by not in self._changes:
            self._changes[by] = tuple(self._maker.changed(by))
        parts = [
            (phase, *map(NoiseAxis.matrix, axes, term.noises))
            for term in self._changes[by]
            if (phase := term.at(p, derivative)) is not None
        ]
        if by.noise is not None:
            (noises, phase), *others = self._phases(p, derivative).items()  # the first is that of 1
            moved = [(noises, phase - rate * self.chosen.phi.matrix(one)), *others]
            changes = [by.noise if k == by.part else None for k in range(len(axes))]
            parts += [(phase, *map(NoiseAxis.matrix, axes, noises, changes)) for noises, phase in moved]
        return KroneckerSum(parts or [(0.0 * self.chosen.phi.matrix(one), *(axis.matrix(one) for axis in axes))])

    @cached_property
    def rounding_growth(self) -> float:
        """By about how much LU factors amplify rounding in T − 1: the size of L, free of forcing, over a rate."""
        size = abs(self.matrix(0.0).terms[0][0]).sum(axis=0).max()
        for axis in self.space(0.0).noises:
            size += abs(axis.matrix(None)).sum(axis=0).max()
        return float(30 * size / self.framed.unit_rate)
