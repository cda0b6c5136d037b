"""The moment Lyapunov exponent Λ(p) at single p, each with an error estimate."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import ThreadpoolController

from fpsolve.arrays import FloatArray
from fpsolve.errors import NoSuchExponent, NotConverged, Remedy
from fpsolve.exponent.adapt import WORTH_A_TRY, Budget, fits, refined, resolve
from fpsolve.exponent.eigen import PrincipalPair, principal_pair, second_derivative, slope_rounding
from fpsolve.exponent.error import Estimate, Solution, checked
from fpsolve.exponent.rival import rival
from fpsolve.fem.generator import Generator
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.model.noise import has_algebraic_tails
from fpsolve.model.problem import Problem, refuse_infinite
from fpsolve.theory.perturbation import Scale, scale_of

TRIM = 0.8
"""A smaller space must have at most this share of the unknowns."""
SMALL_P = 1e-2
"""For smaller |p| the discretisation is chosen at this one, as Λ and its error go to zero together."""
TINY_P = 1e-3
"""Below it Λ(p)/p is a mean of Λ′, as rounding is not proportional to p."""
NEIGHBOURS = 6
"""How many known eigenfunctions those of another p are interpolated from."""
Tolerance = Callable[[float, float], float]
"""The largest error allowed, from p and a value of Λ(p)."""


@dataclass(frozen=True)
class Failure:
    """Why there is no Λ(p), or none to be trusted.

    Attributes:
        p: the moment; None where all of them are doubtful.
        reason: what happened, and what to do.
    """

    p: float | None
    reason: str


@dataclass(frozen=True, eq=False)
class MomentLyapunov:
    """Λ(p) at several p.

    Attributes:
        p: the moments, shape (n,), in the order asked for, without those that failed.
        value: Λ(p), per unit time, shape (n,).
        derivative: Λ′(p), shape (n,).
        error_estimate: estimate of |error of `value`|, from the highest modes, the ends of a noise interval and the
            bound of rounding, shape (n,).
        residual: backward error of the eigenpairs, shape (n,).
        solver: what solved them.
        warnings: sentences on p where `error_estimate` exceeds rtol.
        root: where Λ(p)/p changes its sign, near δ_p; None where that is not among the p, or Λ was not interpolated.
        failures: why some p are missing, or none is to be trusted.
    """

    p: FloatArray
    value: FloatArray
    derivative: FloatArray
    error_estimate: FloatArray
    residual: FloatArray
    solver: ExponentSolver = field(repr=False)
    warnings: tuple[str, ...] = ()
    root: float | None = None
    failures: tuple[Failure, ...] = ()

    @property
    def pairs(self) -> tuple[PrincipalPair, ...]:
        """The eigenpairs, one for each p; solved now where Λ was interpolated. Raises `NotConverged`."""
        return tuple(self.solver.pair(float(p)) for p in self.p)

    def forgetful(self) -> MomentLyapunov:
        """The same numbers, without the eigenfunctions that the solver keeps."""
        return replace(self, solver=replace(self.solver))


@dataclass(frozen=True, eq=False)
class ExponentSolver:
    """Λ(p) of one problem, each solve starting from those at the nearest p.

    Args:
        problem: a motion and its noise.
        mesh: a mesh for all p; None chooses a discretisation for each p that meets rtol.
        rtol: |error| ≤ rtol·max(|Λ|, the terms of Eq. (37) before they cancel).
        budget: what the choice of a discretisation may cost.

    Raises:
        NoSuchExponent: the variance of the noise is infinite.
        ValueError: rtol is not positive.
    """

    problem: Problem
    mesh: CylinderMesh | None = None
    _: KW_ONLY
    rtol: float = 1e-8
    budget: Budget = field(default_factory=Budget)
    _known: dict[float, Solution] = field(init=False, default_factory=dict)
    _failed: dict[float, NotConverged] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        if not math.isfinite(self.problem.noise.standard_deviation):
            raise NoSuchExponent(
                "the noise has infinite variance, so that it has no unit of length to mesh; choose r0 < 5/3"
            )
        if not (math.isfinite(self.rtol) and self.rtol > 0):
            raise ValueError(f"rtol is {self.rtol!r}; it must be a positive number such as 1e-8")

    def pair(self, p: float) -> PrincipalPair:
        """The principal eigenpair at p. Raises `NotConverged`, `NoSuchExponent`."""
        return self.solution(p).pair

    def solution(self, p: float, tolerance: Tolerance | None = None) -> Solution:
        """The principal eigenpair at p and its error, within a tolerance, that of rtol if none is given.

        Raises:
            NoSuchExponent: Λ(p) is infinite.
            NotConverged: the mesh does not resolve the problem, or the budget does not suffice to find one.
        """
        refuse_infinite(self.problem, p)
        tolerance = tolerance or self.tolerance
        if p in self._failed and tolerance == self.tolerance:
            raise self._failed[p]
        if p not in self._known or (self.mesh is None and not _meets(self._known[p], tolerance)):
            try:
                with _one_thread().limit(limits=1):
                    self._known[p] = self._found(p, tolerance)
            except NotConverged as failure:
                if tolerance == self.tolerance:  # a tighter one may be out of reach where this is not
                    self._failed[p] = failure
                raise
            except np.linalg.LinAlgError as failure:
                raise NotConverged(f"Λ({p:g}) cannot be solved on this mesh ({failure}); {Remedy.MESH}") from failure
            except (ArithmeticError, RuntimeError, ValueError) as failure:
                raise NotConverged(f"Λ({p:g}) is beyond floating-point numbers ({failure})") from failure
        return self._known[p]

    def largest(self) -> tuple[float, Generator] | None:
        """The p of the largest size that was solved, and with what; None where none was."""
        p = max(self._known, key=abs, default=None)
        return None if p is None else (p, self._known[p].pair.generator)

    @cached_property
    def scales(self) -> Scale:
        """What errors are measured by: the sizes of the terms of Eq. (37) before they cancel."""
        return scale_of(self.problem)

    def scale(self, p: float) -> float:
        """The sum of the absolute values of the terms of Eq. (37)."""
        return float(self.scales.moment(p))

    def tolerance(self, p: float, value: float) -> float:
        """The largest error allowed of a value of Λ(p)."""
        return self.rtol * max(abs(value), self.scale(p))

    def moments(self, p: ArrayLike, *, progress: Callable[[], None] = lambda: None) -> MomentLyapunov:
        """Λ(p) at several p; `progress` is called after each, also after one that fails.

        Raises:
            NoSuchExponent: Λ(p) is infinite for one of the p.
        """
        points = checked_moments(p, self.problem) if np.size(p) else np.zeros(0)
        solutions, failures = {}, []
        for i in best_order(points):
            try:
                solution = self.solution(float(points[i]))
                if points[i] != 0:  # where Λ = 0 has no scale
                    checked(f"Λ({points[i]:g})", self.estimate(solution))
                solutions[i] = solution
            except NotConverged as failure:
                failures.append(Failure(float(points[i]), str(failure)))
            progress()
        return self._result([solutions[i] for i in sorted(solutions)], failures)

    def estimate(self, solution: Solution) -> Estimate:
        """Λ(p) on the scale of the terms of Eq. (37) before they cancel."""
        return Estimate(solution.pair.value, solution.error, self.scale(solution.pair.p))

    def lyapunov_exponent(self) -> Estimate:
        """λ = Λ′(0), Eq. (2). Raises `NotConverged`."""
        value, _, error = self.ratio(0.0)
        return checked("λ", Estimate(value, error, self.scales.linear))

    def variance_rate(self) -> Estimate:
        """Λ″(0), the asymptotic growth rate of the variance of ln ‖x‖. Raises `NotConverged`.

        Its error is the difference from that of a finer discretisation.
        """
        pair = self.pair(0.0)
        finer = principal_pair(pair.generator.enriched(), 0.0, start=pair)
        value, better = second_derivative(pair), second_derivative(finer)
        scale = 2 * self.scales.quadratic
        rounding = 10 * sys.float_info.epsilon * max(scale, abs(better))
        return checked("Λ″(0)", Estimate(better, abs(better - value) + rounding, scale))

    def ratio(self, p: float, tolerance: Tolerance | None = None) -> tuple[float, float, float]:
        """Λ(p)/p, its derivative in p, and the error of the first; λ at p = 0.

        Near p = 0 it is the mean of Λ′ from 0 to p, by two points of Gauss; its error is that at p = ±`SMALL_P`.
        """
        if abs(p) >= TINY_P:
            solution = self.solution(p, tolerance)
            value = solution.pair.value / p
            return value, (solution.pair.derivative - value) / p, solution.error / abs(p)
        points = {p * (0.5 + shift) for shift in (-0.5 / math.sqrt(3), 0.5 / math.sqrt(3))}
        pairs = [self.solution(point, tolerance).pair for point in points]
        near = self._near_zero(p, tolerance or self.tolerance)
        error = near.error / abs(near.pair.p) + slope_rounding(pairs[0])
        return float(np.mean([pair.derivative for pair in pairs])), 0.5 * second_derivative(pairs[0]), error

    def _near_zero(self, p: float, tolerance: Tolerance) -> Solution:
        """The solution at ±`SMALL_P` that a smaller p goes with."""
        side = p or (-1.0 if has_algebraic_tails(self.problem.noise) else 1.0)  # where Λ is finite
        return self.solution(math.copysign(SMALL_P, side), tolerance)

    def _found(self, p: float, tolerance: Tolerance) -> Solution:
        """A solution that meets a tolerance, or the one on the given mesh."""
        if self.mesh is not None:
            pair = self._tried(self._given[0], p).pair
            return Solution(pair, principal_pair(self._given[1], p, start=pair))
        if abs(p) < SMALL_P:
            return self._tried(self._near_zero(p, tolerance).pair.generator, p)
        nearest = min(self._known, key=lambda q: abs(q - p), default=None)
        start = None
        if nearest is not None:
            generator = self._trimmed(self._known[nearest], tolerance)
            try:
                start = self._tried(generator, p) if fits(generator, nearest, p) else None
            except NotConverged:
                start = None
            if start is not None and _meets(start, tolerance) and rival(start.pair) is None:
                return start
        return resolve(
            self.problem,
            p,
            tolerance=lambda value: tolerance(p, value),
            rtol=self.rtol,
            budget=self.budget,
            start=start,
        )

    @cached_property
    def _given(self) -> tuple[Generator, Generator]:
        """That of the given mesh, and one of four degrees more, whose error hardly counts beside it."""
        assert self.mesh is not None
        generator = Generator(self.problem, self.mesh)
        return generator, generator.enriched().enriched()

    def _trimmed(self, solution: Solution, tolerance: Tolerance) -> Generator:
        """The generator of a solution, or a much smaller one that would do."""
        pair, size = solution.pair, solution.pair.generator.size
        if abs(pair.p) < SMALL_P or size <= WORTH_A_TRY:
            return pair.generator
        smaller = refined(solution, tolerance(pair.p, pair.value), 0)
        is_better = smaller.unknowns(self.problem.noise) <= TRIM * size
        return Generator(self.problem, smaller) if is_better else pair.generator

    def _tried(self, generator: Generator, p: float) -> Solution:
        """The solution at p with a generator, from those around p, or from the nearest one."""
        known = (solution.pair for solution in self._known.values())
        near = sorted(known, key=lambda pair: abs(pair.p - p))[:NEIGHBOURS]
        return Solution(principal_pair(generator, p, start=near))

    def _result(self, solutions: Sequence[Solution], failures: Sequence[Failure]) -> MomentLyapunov:
        pairs = tuple(solution.pair for solution in solutions)
        p, errors = np.array([pair.p for pair in pairs]), np.array([solution.error for solution in solutions])
        value = np.array([pair.value for pair in pairs])
        return MomentLyapunov(
            p=p,
            value=value,
            derivative=np.array([pair.derivative for pair in pairs]),
            error_estimate=errors,
            residual=np.array([pair.residual for pair in pairs]),
            solver=self,
            warnings=(*missed(self, p, value, errors), *misplaced(self, pairs)),
            failures=tuple(failures),
        )


def missed(solver: ExponentSolver, p: FloatArray, value: FloatArray, error: FloatArray) -> tuple[str, ...]:
    """A warning about the p at which the estimated error exceeds rtol, or nothing."""
    size = np.where(p == 0, math.inf, np.maximum(np.abs(value), [solver.scale(float(each)) for each in p]))
    shares = error / size
    if not np.any(shares > solver.rtol):
        return ()
    worst = int(np.argmax(shares))
    remedy = Remedy.MESH if solver.mesh is not None else "as rounding limits it"
    return (
        f"rtol = {solver.rtol:g} is not met at {np.count_nonzero(shares > solver.rtol)} of {p.size} moments, worst at "
        f"p = {p[worst]:g} with an estimated relative error of {shares[worst]:.1e}; {remedy}, or use a larger rtol",
    )


def misplaced(solver: ExponentSolver, pairs: Sequence[PrincipalPair]) -> tuple[str, ...]:
    """A warning about a pair on a given mesh whose moment slow noise may carry elsewhere, or nothing."""
    if solver.mesh is None:  # then both places have been looked at
        return ()
    found = ((pair, rival(pair)) for pair in pairs)
    pair, z = next(((pair, z) for pair, z in found if z is not None), (None, None))
    if pair is None:
        return ()
    return (
        f"Λ({pair.p:g}) may be larger: slow noise may carry the moment near {z:.3g} standard "
        f"deviations; {Remedy.REACH}",
    )


def _meets(solution: Solution, tolerance: Tolerance) -> bool:
    """Whether an error is within a tolerance; for small p, where Λ has no scale, always."""
    pair = solution.pair
    return abs(pair.p) < SMALL_P or solution.error <= tolerance(pair.p, pair.value)


@cache
def _one_thread() -> ThreadpoolController:
    """Keeps BLAS from threads, which for the small blocks of a sparse LU cost three times what they save."""
    return ThreadpoolController()


def best_order(p: FloatArray) -> Any:
    """Indices of p, inwards from the largest and then from the smallest: a mesh for a large |p| serves smaller ones."""
    return np.lexsort((-np.abs(p), p < 0))


def checked_moments(p: ArrayLike, problem: Problem) -> FloatArray:
    """p as an array of shape (n,), every one finite and with a finite Λ(p). Raises `ValueError`, `NoSuchExponent`."""
    points = np.atleast_1d(np.asarray(p, dtype=float))
    if points.ndim != 1 or points.size == 0 or not np.all(np.isfinite(points)):
        raise ValueError(f"p must be a finite number or a non-empty list of finite numbers, got {p!r}")
    for point in points:
        refuse_infinite(problem, float(point))
    return points
