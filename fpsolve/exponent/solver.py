"""The moment Lyapunov exponent Λ(p) at single p, each with an error estimate."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import ThreadpoolController

from fpsolve.arrays import FloatArray
from fpsolve.errors import NoSuchExponent, NotConverged, Remedy
from fpsolve.exponent.adapt import SAFETY, Budget, fits, resolve
from fpsolve.exponent.eigen import PrincipalPair, second_derivative
from fpsolve.exponent.error import Estimate, Solution, Stage, checked
from fpsolve.exponent.rival import rival
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.fem.space import CylinderSpace
from fpsolve.model.noise import has_algebraic_tails
from fpsolve.model.problem import Problem, refuse_infinite
from fpsolve.theory.perturbation import Scale, scale_of

SMALL_P = 1e-2
"""Below it the discretisation is chosen at this p, as Λ and its error go to zero together."""
TINY_P = 1e-3
"""Below it Λ(p)/p is a mean of Λ′, as rounding is not proportional to p."""
NEIGHBOURS = 6
"""How many known eigenfunctions those of another p are interpolated from."""


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
        error_estimate: estimate of |error of `value`|, from a finer mesh, the ends of the noise interval and the
            bound of rounding, shape (n,).
        residual: backward error of the eigenpairs, shape (n,).
        pairs: the eigenpairs, one for each p; none where Λ was interpolated.
        warnings: sentences on p where `error_estimate` exceeds rtol.
        root: where Λ(p)/p changes its sign, near δ_p; None where that is not among the p, or Λ was not interpolated.
        failures: why some p are missing, or none is to be trusted.
    """

    p: FloatArray
    value: FloatArray
    derivative: FloatArray
    error_estimate: FloatArray
    residual: FloatArray
    pairs: tuple[PrincipalPair, ...] = field(repr=False)
    warnings: tuple[str, ...] = ()
    root: float | None = None
    failures: tuple[Failure, ...] = ()


@dataclass(frozen=True, eq=False)
class ExponentSolver:
    """Λ(p) of one problem, each solve starting from the nearest p solved before.

    Args:
        problem: a motion and its noise.
        mesh: a mesh for all p; None chooses one for each p that meets rtol.
        rtol: |error| ≤ rtol·max(|Λ|, the terms of Eq. (37) before they cancel).
        budget: what the choice of a mesh may cost.
        uniform: measure the error of Λ(p)/p at every p by its scale at p = 0, as an interpolation over p needs it.

    Raises:
        NoSuchExponent: the variance of the noise is infinite.
        ValueError: rtol is not positive.
    """

    problem: Problem
    mesh: CylinderMesh | None = None
    _: KW_ONLY
    rtol: float = 1e-8
    budget: Budget = field(default_factory=Budget)
    uniform: bool = False
    _known: dict[float, tuple[Stage, Solution]] = field(init=False, default_factory=dict)
    _failed: dict[float, NotConverged] = field(init=False, default_factory=dict)
    _stages: list[Stage] = field(init=False, default_factory=list)

    def __post_init__(self) -> None:
        if not math.isfinite(self.problem.noise.standard_deviation):
            raise NoSuchExponent(
                "the noise has infinite variance, so that it has no unit of length to mesh; choose r0 < 5/3"
            )
        if not (math.isfinite(self.rtol) and self.rtol > 0):
            raise ValueError(f"rtol is {self.rtol!r}; it must be a positive number such as 1e-8")
        if self.mesh is not None:
            widening = 2.0 if has_algebraic_tails(self.problem.noise) else 1.15
            self._stages.append(Stage.on(self.problem, self.mesh, widening=widening))

    def pair(self, p: float) -> PrincipalPair:
        """The principal eigenpair at p. Raises `NotConverged`, `NoSuchExponent`."""
        return self.solution(p).pair

    def solution(self, p: float) -> Solution:
        """The principal eigenpairs at p on a mesh and on a finer one.

        Raises:
            NoSuchExponent: Λ(p) is infinite.
            NotConverged: the mesh does not resolve the problem, or the budget does not suffice to find one.
        """
        refuse_infinite(self.problem, p)
        if p in self._failed:
            raise self._failed[p]
        if p not in self._known:
            try:
                with _one_thread().limit(limits=1):
                    self._known[p] = self._adapted(p) if self.mesh is None else self._tried(self._stages[0], p)
                for stage, _ in self._known.values():  # a curve walks from stage to stage, and seldom back
                    if stage is not self._known[p][0]:
                        stage.release()
            except NotConverged as failure:
                self._failed[p] = failure
                raise
            except np.linalg.LinAlgError as failure:
                raise NotConverged(f"Λ({p:g}) cannot be solved on this mesh ({failure}); {Remedy.MESH}") from failure
            except (ArithmeticError, RuntimeError, ValueError) as failure:
                raise NotConverged(f"Λ({p:g}) is beyond floating-point numbers ({failure})") from failure
        return self._known[p][1]

    def largest(self) -> CylinderSpace | None:
        """The space on which the p of the largest size was solved; None where none was."""
        return self._known[max(self._known, key=abs)][0].coarse.space if self._known else None

    @cached_property
    def scales(self) -> Scale:
        """What errors are measured by: the sizes of the terms of Eq. (37) before they cancel."""
        return scale_of(self.problem)

    def scale(self, p: float) -> float:
        """The sum of the absolute values of the terms of Eq. (37)."""
        return float(self.scales.moment(p))

    def tolerance(self, p: float, value: float) -> float:
        """The largest error allowed of a value of Λ(p)."""
        if self.uniform:
            return self.rtol * abs(p) * self.scales.linear
        return self.rtol * max(abs(value), self.scale(p))

    def uniformly(self) -> ExponentSolver:
        """The same solver, but `uniform`; what either solves is known to both."""
        other = replace(self, uniform=True)
        for name in ("_known", "_stages"):
            object.__setattr__(other, name, getattr(self, name))
        return other

    def moments(self, p: ArrayLike, *, progress: Callable[[], None] = lambda: None) -> MomentLyapunov:
        """Λ(p) at several p; `progress` is called after each, also after one that fails.

        Raises:
            NoSuchExponent: Λ(p) is infinite for one of the p.
        """
        points = checked_moments(p, self.problem)
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
        scale = self.scales.linear
        return self._difference("λ", lambda pair: pair.derivative, scale)

    def variance_rate(self) -> Estimate:
        """Λ″(0), the asymptotic growth rate of the variance of ln ‖x‖. Raises `NotConverged`."""
        scale = 2 * self.scales.quadratic
        return self._difference("Λ″(0)", second_derivative, scale)

    def ratio(self, p: float) -> tuple[float, float, float]:
        """Λ(p)/p, its derivative in p, and the error of the first; λ at p = 0.

        Near p = 0 it is the mean of Λ′ from 0 to p, by two points of Gauss.
        """
        if abs(p) >= TINY_P:
            solution = self.solution(p)
            value = solution.pair.value / p
            return value, (solution.pair.derivative - value) / p, solution.error / abs(p)
        points = {p * (0.5 + shift) for shift in (-0.5 / math.sqrt(3), 0.5 / math.sqrt(3))}
        solutions = [self.solution(point) for point in points]
        value, finer = (
            float(np.mean([pair.derivative for pair in pairs]))
            for pairs in zip(*((each.pair, each.finer) for each in solutions), strict=True)
        )
        rounding = max(each.pair.rounding for each in solutions)
        return value, 0.5 * second_derivative(solutions[0].pair), abs(finer - value) + rounding

    def _difference(self, name: str, quantity: Callable[[PrincipalPair], float], scale: float) -> Estimate:
        solution = self.solution(0.0)
        coarse, fine = quantity(solution.pair), quantity(solution.finer)
        return checked(name, Estimate(coarse, abs(fine - coarse) + solution.pair.rounding, scale))

    def _tried(self, stage: Stage, p: float) -> tuple[Stage, Solution]:
        """The solution at p on a stage: from those around p on it, or from the nearest one."""
        known = sorted(
            (solution.pair for other, solution in self._known.values() if other is stage),
            key=lambda pair: abs(pair.p - p),
        )
        near = known[:NEIGHBOURS]
        is_inside = bool(near) and min(pair.p for pair in near) < p < max(pair.p for pair in near)
        return stage, stage.solve(p, near if is_inside else near[:1])

    def _adapted(self, p: float) -> tuple[Stage, Solution]:
        """A solution that meets rtol, on the stage of the nearest p if that does, otherwise on a new one."""
        nearest = min(self._known, key=lambda q: abs(q - p), default=None)
        if nearest is not None:
            stage = self._known[nearest][0]
            if fits(stage, self.problem, nearest, p):
                try:
                    tried = self._tried(stage, p)
                except NotConverged:
                    tried = None
                if tried is not None and self._suffices(tried[1]) and rival(tried[1].pair) is None:
                    return tried
        side = p or (-1.0 if has_algebraic_tails(self.problem.noise) else 1.0)  # where Λ is finite
        q = p if abs(p) >= SMALL_P else math.copysign(SMALL_P, side)
        for rtol in self.rtol * 10.0 ** -np.arange(4):
            share = rtol / self.rtol
            new = resolve(
                self.problem,
                q,
                tolerance=lambda value, q=q, share=share: share * self.tolerance(q, value),  # type: ignore[misc]
                rtol=rtol,
                budget=self.budget,
            )
            self._known.setdefault(q, new)
            if q == p:
                return new
            tried = self._tried(new[0], p)
            if self._suffices(tried[1]):
                return tried
        raise NotConverged(f"Λ({p:g}) did not converge on the meshes for p = {q:g}; {Remedy.BUDGET}")

    def _suffices(self, solution: Solution) -> bool:
        """Whether Λ(p), and at p = 0 its derivative, meets rtol; for tiny p apart from rounding."""
        pair = solution.pair
        if abs(pair.p) < TINY_P:
            scale = self.scales.linear
            error, allowed = abs(pair.derivative - solution.finer.derivative), self.rtol * scale
        else:
            error, allowed = solution.error, self.tolerance(pair.p, pair.value)
        return SAFETY * error <= allowed

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
            pairs=pairs,
            warnings=(*self.missed(p, value, errors), *self.misplaced(pairs)),
            failures=tuple(failures),
        )

    def missed(self, p: FloatArray, value: FloatArray, error: FloatArray) -> tuple[str, ...]:
        """A warning about the p at which the estimated error exceeds rtol, or nothing."""
        size = np.where(p == 0, math.inf, np.maximum(np.abs(value), [self.scale(float(each)) for each in p]))
        shares = error / size
        if not np.any(shares > self.rtol):
            return ()
        worst = int(np.argmax(shares))
        remedy = Remedy.MESH if self.mesh is not None else "as rounding limits it"
        return (
            f"rtol = {self.rtol:g} is not met at {np.count_nonzero(shares > self.rtol)} of {p.size} moments, worst at "
            f"p = {p[worst]:g} with an estimated relative error of {shares[worst]:.1e}; {remedy}, or use a larger rtol",
        )

    def misplaced(self, pairs: Sequence[PrincipalPair]) -> tuple[str, ...]:
        """A warning about a pair on a given mesh whose moment slow noise may carry elsewhere, or nothing."""
        if self.mesh is None:  # then both places have been looked at
            return ()
        found = ((pair, rival(pair)) for pair in pairs)
        pair, z = next(((pair, z) for pair, z in found if z is not None), (None, None))
        if pair is None:
            return ()
        return (
            f"Λ({pair.p:g}) may be larger: slow noise may carry the moment near {z:.3g} standard "
            f"deviations; {Remedy.REACH}",
        )


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
