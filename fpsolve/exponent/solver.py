"""The moment Lyapunov exponent Λ(p) at single p, each with an error estimate."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property, partial
from itertools import pairwise, repeat
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, real_number, real_numbers, shown
from fpsolve.budget import counted, one_number
from fpsolve.data import Result, dataset
from fpsolve.errors import NoHierarchy, NoSuchExponent, NotConverged
from fpsolve.exponent.adapt import (
    AT_CORNER,
    WIDER,
    Budget,
    Tolerance,
    WholeProblem,
    is_at_corner,
    solved_p,
    spent_remedy,
    widened,
)
from fpsolve.exponent.curve import Curve, Node, polynomial, values
from fpsolve.exponent.eigen import PairDerivatives, PrincipalPair, second_derivative, slope_rounding
from fpsolve.exponent.error import Estimate, Failure, Moment, Solution, checked, slope_error
from fpsolve.exponent.starts import warnings_of_other_places
from fpsolve.fem.factors import one_thread
from fpsolve.fem.generator import SMALL_P
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import ALMOST_EVERY, Code, Message, Remedy, message_of
from fpsolve.model import quantity
from fpsolve.model.problem import (
    RTOLS,
    Problem,
    checked_moments,
    checked_problem,
    even_only,
    negative_refused,
    refuse_infinite,
    refuse_tails,
)
from fpsolve.theory.frozen import eigenvalues_at
from fpsolve.theory.moments import EvenMoment, even_moment
from fpsolve.theory.perturbation import Scale, scale_of

if TYPE_CHECKING:
    import xarray

MOST_EQUATIONS = 8000
"""Of even moments."""
OF_CLOSED = 1e-4
"""Share of rtol that moments lack of the terms of their equations, as ω is one of these, and Λ a share of ζω."""
SURELY = 10.0
"""Multiple of the errors of two values from which on they contradict each other."""
ROUNDED = 1e-6
"""Share of the values themselves that is added to that."""
NODES = 0.3
"""Share of the tolerance of a curve for the errors of its nodes, which may grow between them."""
FEW_MOMENTS = 16
"""Up to so many p are solved one by one."""
SLOPE_SHARE = 1e-3
"""Of what a tangent rises, by which it may lie too high, as slopes have errors."""
TINY_P = 1e-3
"""Below it Λ(p)/p is a mean of Λ′, as rounding is not proportional to p."""
TINIEST_P = 1e-9
"""For smaller |p| the error of Λ(p), which falls as p, has no scale, which may fall as p²."""

_KINDS: Sequence[tuple[str, Any, str]] = (
    ("mesh", CylinderMesh | None, "a CylinderMesh, or None"),
    ("budget", Budget, "a Budget"),
    ("rtol", Real, "a number such as 1e-8"),
)


@dataclass(frozen=True, eq=False)
class InvariantClass:
    """The growth on a ray that the phase never leaves, or of the distance from it; or that of a block of variables.

    Attributes:
        phase: φ of the ray; None for a block of variables.
        is_along: whether it is ‖x‖ on the ray, and not the distance from it.
        lyapunov_exponent: its λ.
        p: the moments, shape (n,).
        value, error_estimate: its Λ(p), shape (n,).
        variables: the names of those of the block; none for a ray.
    """

    phase: float | None
    is_along: bool
    lyapunov_exponent: Estimate
    p: FloatArray
    value: FloatArray
    error_estimate: FloatArray
    variables: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """What it is called in tables: "along the ray at phi = 1.5708", "x, v"."""
        if self.phase is None:
            return ", ".join(self.variables)
        return f"{'along' if self.is_along else 'across'} the ray at phi = {self.phase:.6g}"


@dataclass(frozen=True, eq=False, repr=False)
class MomentLyapunov(Result):
    """Λ(p) at several p.

    Attributes:
        p: the moments, shape (n,), in the order asked for, without those that failed.
        value: Λ(p), per unit time, shape (n,).
        slope: Λ′(p), shape (n,), where it takes no solve of its own, NaN elsewhere: at even p where moments have
            equations of their own, and at p = 0 where algebraic tails leave it no slope.
        error_estimate: estimate of |error of `value`|, from the highest modes, the ends of a noise interval and the
            bound of rounding, at least half a unit in the last place of the value, shape (n,).
        residual: backward error of the eigenpairs, shape (n,); NaN where there is none.
        solver: what solved them.
        warnings: on the p where `error_estimate` exceeds rtol.
        curves: of which these are values; none where each p was solved.
        root: where Λ(p)/p changes its sign, near δ_p; None where that is not among the p, or Λ was not interpolated.
        failures: why some p are missing, or none is to be trusted.
        notes: on them.
    """

    p: FloatArray
    value: FloatArray
    slope: FloatArray
    error_estimate: FloatArray
    residual: FloatArray
    solver: ExponentSolver
    warnings: tuple[Message, ...] = ()
    curves: tuple[Curve, ...] = field(default=(), repr=False)
    root: float | None = None
    failures: tuple[Failure, ...] = ()
    notes: tuple[Message, ...] = ()

    def __post_init__(self) -> None:
        least = 0.5 * np.spacing(np.abs(self.value))
        object.__setattr__(self, "error_estimate", np.maximum(self.error_estimate, least))

    @cached_property
    def derivative(self) -> FloatArray:
        """Λ′(p), shape (n,): `slope`, and what is solved now where that is NaN; NaN where there is none."""
        known = zip(self.p.tolist(), self.slope.tolist(), strict=True)
        return np.array([self.solver.slope(p) if p and math.isnan(slope) else slope for p, slope in known])

    @property
    def derivative_error(self) -> FloatArray:
        """Estimate of |error of `derivative`|, shape (n,), which takes some solves; NaN where none is known."""
        return self.errors_of(self.derivative)

    def errors_of(self, slopes: FloatArray) -> FloatArray:
        """Estimates of the errors of `slope` or of `derivative`."""
        if self.curves:
            return values(self.curves, self.p).derivative_error
        known = zip(self.p.tolist(), np.isfinite(slopes).tolist(), strict=True)
        return np.array([self.solver.slope_error(p) if is_known else math.nan for p, is_known in known])

    @property
    def pairs(self) -> tuple[PrincipalPair, ...]:
        """The eigenpairs, one for each p; solved now where Λ was interpolated. Raises `NotConverged`."""
        return tuple(self.solver.pair(float(p)) for p in self.p)

    @property
    def classes(self) -> tuple[InvariantClass, ...]:
        """Λ(p) of each of the `classes` of the problem, nothing where there are none. Raises `NotConverged`."""
        return self.solver.by_class(self.p)

    def to_xarray(self) -> xarray.Dataset:
        """Λ(p), `slope`, their errors and residuals over p."""
        columns = {name: getattr(self, name) for name in ("value", "error_estimate", "residual")}
        columns |= {"derivative": self.slope, "derivative_error": self.errors_of(self.slope)}
        numbers = {quantity.OVER_P[name]: each for name, each in columns.items()}
        failures, values = [each.reason for each in self.failures], self.solver.problem.values
        more = {"warnings": self.warnings, "notes": self.notes, "failures": failures}
        title, places = quantity.MOMENT.words, {quantity.P: self.p}
        return dataset(title, self.solver.problem.method, numbers, places, values, rtol=self.solver.rtol, **more)

    def _said(self) -> str:
        if not self.p.size:
            return "no p"
        last = f"Λ({self.p[-1]:g}) = {self.value[-1]:.6g} ± {self.error_estimate[-1]:.0e}"
        return last if self.p.size == 1 else f"{self.p.size} p from {self.p.min():g} to {self.p.max():g}, {last}"


@dataclass(frozen=True, eq=False)
class ExponentSolver:
    """Λ(p) of one problem, each solve starting from those at the nearest p.

    >>> ExponentSolver(problem).pair(2.0)
    PrincipalPair(Λ(2) = -0.0073978..., Λ′(2) = -0.0029176..., ... unknowns)

    Args:
        problem: a motion and its noise.
        mesh: a mesh for all p; None chooses a discretisation for each p that meets rtol.
        rtol: |error| ≤ rtol·max(|Λ|, the terms of Eq. (37) before they cancel).
        of_value: |error| ≤ of_value·|Λ| is enough, too, as for a sign.
        budget: what the choice of a discretisation may cost.
        starts: solutions of a problem with parameters close by, by their p, see `WholeProblem`; beyond the plane even
            moments.

    Attributes:
        slope_errors: of Λ′(p), by p.
        spent: numbers that the budget has ended, by their symbols.

    Raises:
        NoSuchExponent: the variance of the noise is infinite.
        TypeError: an argument is of another kind.
        ValueError: rtol is not positive.
    """

    problem: Problem
    mesh: CylinderMesh | None = None
    _: KW_ONLY
    rtol: float = 1e-8
    of_value: float = 0.0
    budget: Budget = field(default_factory=Budget)
    starts: Mapping[float, Any] = field(default_factory=dict, repr=False)
    slope_errors: dict[float, float] = field(init=False, default_factory=dict, repr=False)
    spent: dict[str, Message] = field(init=False, default_factory=dict, repr=False)
    _even: dict[float, EvenMoment | None] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        checked_problem(self.problem)
        for name, kind, words in _KINDS:
            if not isinstance(getattr(self, name), kind) or getattr(self, name) is True:
                raise TypeError(f"got {name} = {shown(getattr(self, name))}; must be {words}")
        if self.mesh is not None and self.problem.dimension > 2:
            raise ValueError(
                "got a mesh, but meshes are for two variables only, as their lines are those of a phase; leave it out"
            )
        if not (self.problem.noise.is_white or math.isfinite(self.problem.noise.standard_deviation)):
            raise NoSuchExponent(Message(Code.INFINITE_VARIANCE))
        with suppress(ValueError):
            if RTOLS["gt"] < real_number(self.rtol, "rtol") < RTOLS["lt"]:
                return
        raise ValueError(f"got rtol = {shown(self.rtol)}; must be > {RTOLS['gt']:g} and < 1; write, for example, 1e-8")

    @cached_property
    def whole(self) -> WholeProblem:
        """What solves Λ(p); of several classes that of the one with the largest λ. Raises `NoSuchExponent`."""
        if told := even_only(self.problem, "λ, or another number that follows from eigenfunctions,"):
            raise NoSuchExponent(told)
        if self.classes:
            return max(self.classes, key=lambda each: each.lyapunov_exponent().value).whole
        starts = {} if self.problem.dimension > 2 else self.starts
        return WholeProblem(self.problem, mesh=self.mesh, starts=starts, **self._own)

    @property
    def known(self) -> Mapping[float, Any]:
        """What a problem next to it starts from, see `starts`."""
        if self.problem.dimension == 2 and not self.problem.is_closed_only:
            return self.whole.known
        return {p: each for p, each in self._even.items() if each}

    @property
    def refinement(self) -> Remedy:
        """What to do where it should be resolved better."""
        return Remedy.SMALLER_RTOL if self.mesh is None else Remedy.MESH

    @property
    def _own(self) -> dict[str, Any]:
        tolerance = partial(
            tolerated, self.rtol, self.of_value, self.scales
        )  # not a method: a cycle would keep matrices for long
        return {"rtol": self.rtol, "budget": self.budget, "tolerance": tolerance}

    def pair(self, p: float) -> PrincipalPair:
        """The principal eigenpair at p. Raises `NotConverged`, `NoSuchExponent`."""
        if self.classes:
            if self.problem.dimension > 2:
                raise NotConverged(Message(Code.NO_EIGENFUNCTION_OF_BLOCKS, p=p, blocks=self.problem.block_names))
            raise NotConverged(Message(Code.NO_EIGENFUNCTION, p=p, phase=self.problem.invariant_rays[0]))
        return self.solution(p).pair

    @cached_property
    def classes(self) -> tuple[ExponentSolver, ...]:
        """Those of the `classes` of the problem, which has no positive eigenfunction where there are several."""
        return tuple(ExponentSolver(each, self.mesh, **self._usual) for each in self.problem.classes)

    @property
    def _usual(self) -> dict[str, Any]:
        return {"rtol": self.rtol, "of_value": self.of_value, "budget": self.budget}

    def solution(self, p: float, tolerance: Tolerance | None = None) -> Solution:
        """The principal eigenpair at p and its error, within a tolerance, that of rtol if none is given.

        Of several classes it is that of the largest Λ(p) for p ≥ 0. Over a unit of time a block has x_i⁺ = Φ_i x_i +
        Σ R_ij x_j, with finite moments of all of these. So x_i is a sum of what others drove at each time and Φ_i has
        carried on since, E‖Φ_i R_ij x_j‖^p ~ exp(Λ_i(p)(t − s) + Λ_j(p) s) at most, and by Minkowski's inequality for
        p ≥ 1, or |a + b|^p ≤ |a|^p + |b|^p for p < 1, E‖x_i‖^p grows as the largest of these, but for powers of t. It
        grows no slower: two starts that differ in x_i alone differ by Φ_i of that for ever, so that E‖x‖^p of one of
        them grows as Λ_i(p). For p < 0 it depends on how the x_i grow together, and is refused.

        Raises:
            NoSuchExponent: Λ(p) is infinite.
            NotConverged: the mesh does not resolve the problem, or the budget does not suffice to find one; or p < 0,
                of several classes.
        """
        point = real_number(p, "p")
        refuse_infinite(self.problem, point)
        point = solved_p(point)
        self._refuse_negative(point)
        if not self.classes:
            try:
                found = self.whole.solution(point, tolerance)
            except NotConverged as failure:
                if failure.reason.code is Code.BUDGET_SPENT:  # which tells a value
                    self._witness(point, failure.reason.data["value"], failure.reason.data["error"])
                raise
            self._witness(point, found.pair.value, found.error)
            return found
        of_each, is_zero = [each.solution(point, tolerance) for each in self.classes], abs(point) < TINIEST_P
        return max(of_each, key=lambda each: each.pair.derivative if is_zero else each.pair.value / point)

    def _witness(self, p: float, value: float, error: float) -> None:
        """Refuse a value with this error that contradicts the even moment of the same p."""
        if (known := self.even(p)) and abs(value - known.value) > self.doubt(error, known):
            told = {"p": p, "value": value, "other": p, "expected": known.value}
            raise NotConverged(Message(Code.NOT_PRINCIPAL, **told), remedy=self.refinement)

    def even(self, p: float) -> EvenMoment | None:
        """Λ(p) of an even p > 0 by the equations of the moments; None where these do not close, or are too many.

        In the plane it is the witness under noise of several dimensions and under chains, where other pairs may be
        positive, too; under other noise it would take as long as elements do, and is None.
        """
        noise = self.problem.coloured
        is_simple = len(noise.parts) == 1 and noise.basis != "pairs" and (noise.is_white or not noise.has_states)
        if p <= 0 or p % 2 or (is_simple and self.problem.dimension == 2) or self.classes:
            return None
        if p not in self._even:
            self._even[p] = None
            with suppress(NoHierarchy, NotConverged, ArithmeticError):
                self._even[p] = self._solve_even(p)
        return self._even[p]

    def _solve_even(self, p: float) -> EvenMoment:
        """Λ(p) of an even p by the equations of the moments. Raises `NoHierarchy`, `NotConverged`."""
        near = self.starts.get(p) if self.problem.dimension > 2 or self.problem.is_closed_only else None
        with one_thread(), counted(self.budget.countdown(f"Λ({p:g})")):
            if self.problem.is_closed_only:  # where Λ has no other scale than that of these equations
                found = even_moment(self.problem, p, rtol=OF_CLOSED * self.rtol, near=near)
            else:
                found = even_moment(self.problem, p, 0.1 * self.tolerance(p, 0.0), MOST_EQUATIONS, near=near)
            checked(Estimate(found.value, found.error, self.scale(p)), self.refinement, p)
        return found

    def by_moments(self, p: float) -> EvenMoment | None:
        """Λ(p) where the equations of the moments are its number, and no witness: beyond the plane, if they are found.

        Raises:
            NotConverged: they are all that is computed, and are not solved.
        """
        if not self.problem.is_closed_only:
            return self.even(p) if self.problem.dimension > 2 else None
        if p <= 0 or p % 2:
            return None
        if not self._even.get(p):
            try:
                self._even[p] = self._solve_even(p)
            except (NoHierarchy, ArithmeticError) as failure:
                raise NotConverged(Message(Code.NOT_CONVERGED, p=p, reason=str(failure))) from failure
        return self._even[p]

    def doubt(self, error: float, known: EvenMoment) -> float:
        """The difference beyond which a value with this error contradicts an even moment."""
        return SURELY * (error + known.error) + ROUNDED * abs(known.value)

    def leading(self, p: float) -> ExponentSolver:
        """The one of the classes whose Λ(p), or for p = 0 whose λ, that of the problem is; itself without classes.

        Raises:
            NoSuchExponent: it is that of two classes, so that Λ(p) has no derivatives by parameters.
            NotConverged: as `solution`.
        """
        if len(self.classes) < 2:
            return self.classes[0] if self.classes else self
        self._refuse_negative(p)
        rates = [each.ratio_alone(p) for each in self.classes]
        best, second = sorted(range(len(rates)), key=lambda k: -rates[k][0])[:2]
        if rates[best][0] - rates[second][0] <= rates[best][1] + rates[second][1]:
            raise NoSuchExponent(Message(Code.KINK, p=p or None))
        return self.classes[best]

    def _refuse_negative(self, p: float) -> None:
        """Refuse p < 0 of several classes, one of which a noise drives. Raises `NotConverged`."""
        if p < self.problem.moments[0] - TINIEST_P:  # 0 but for rounding
            raise NotConverged(negative_refused(self.problem))

    def by_class(self, p: ArrayLike) -> tuple[InvariantClass, ...]:
        """λ and Λ(p) of the `classes`, for p < 0 too; nothing where there are none. Raises `NotConverged`."""
        points, found = real_numbers(p, "p", may_be_empty=True), []
        phases = self.problem.invariant_rays
        for number, (block, each) in enumerate(zip(self.problem.blocks, self.classes, strict=True)):
            solved = [each.estimate(point, each.solution(point)) for point in points.tolist()]
            value, error = (np.array([getattr(one, name) for one in solved]) for name in ("value", "error_estimate"))
            is_along = number < len(phases)
            phase = (phases[number] if is_along else phases[0]) if phases else None
            names = () if phases else block.names
            found.append(InvariantClass(phase, is_along, each.lyapunov_exponent(), points, value, error, names))
        return tuple(found)

    @cached_property
    def scales(self) -> Scale:
        """What errors are measured by: the sizes of the terms of Eq. (37) before they cancel."""
        return scale_of(self.problem)

    def scale(self, p: float) -> float:
        """The sum of the absolute values of the terms of Eq. (37)."""
        return float(self.scales.moment(p))

    def tolerance(self, p: float, value: float) -> float:
        """The largest error allowed of a value of Λ(p)."""
        return tolerated(self.rtol, self.of_value, self.scales, p, value)

    def curves(
        self, low: float, high: float, otherwise: Callable[..., Curve | None] = lambda *_: None
    ) -> tuple[Curve, ...]:
        """Λ on an interval, of two variables: a polynomial, or what does otherwise, in two where a saddle has a corner.

        Args:
            low, high: the interval.
            otherwise: takes the arguments of `polynomial` where there is none.

        Raises:
            NotConverged: there is none.
        """
        ends, found = [low, high], list[Curve]()
        if self.problem.dimension > 2 or len(self.classes) > 1:
            raise NotConverged(Message(Code.NO_FUNCTION, low=low, high=high))
        if low < -1 < high and not eigenvalues_at(self.problem, 0.0)[2]:
            ends.insert(1, -1.0)
        for start, end in pairwise(ends):
            with one_thread():
                curve = polynomial(self._node, start, end, self._allowed) or otherwise(
                    self._node, start, end, self._allowed
                )
            if curve is None:
                raise NotConverged(Message(Code.NO_FUNCTION, low=low, high=high))
            found.append(curve)
        return tuple(found)

    def _allowed(self, p: float) -> float:
        """The largest error of Λ(p)/p, and of λ."""
        return self.tolerance(max(abs(p), SMALL_P), 0.0) / max(abs(p), SMALL_P)

    def _node(self, p: float) -> Node:
        tolerance = partial(share_of, NODES * self._allowed(p))
        ratio, error = self.ratio_alone(p, tolerance)
        return Node(ratio, error, self.solution(p, tolerance).pair.derivative if p else ratio)

    @property
    def goes_on(self) -> bool:
        """Whether numbers of an earlier run do in place of eigenpairs, which others need for their messages."""
        return self.mesh is None and not (self.problem.noise.has_algebraic_tails or self.classes)

    def take(self, p: float, row: Moment) -> None:
        """Have the error of Λ′(p), which takes an eigenpair, from an earlier run."""
        if not math.isnan(row.derivative_error):
            self.slope_errors.setdefault(p, row.derivative_error)

    def moments(
        self,
        p: ArrayLike,
        *,
        progress: Callable[[], None] = lambda: None,
        known: dict[float, Moment] | None = None,
    ) -> MomentLyapunov:
        """Λ(p) at several p; `progress` is called after each, also after one that fails.

        Args:
            p: the moments.
            progress: called after each.
            known: those of an earlier run, by their p; it takes each that is solved.

        Raises:
            NoSuchExponent: Λ(p) is infinite for one of the p.
        """
        points = checked_moments(p, self.problem, may_be_empty=True)
        is_kept, known = known is not None, {} if known is None else known
        rows, solved, failures = dict[int, Moment](), dict[int, PrincipalPair](), list[Failure]()
        for i in best_order(points):
            point = float(points[i])
            if self.goes_on and point in known and not math.isnan(known[point].derivative):
                rows[i] = known[point]
                self.take(point, rows[i])
                progress()
                continue
            try:
                if even := self.by_moments(point):
                    rows[i] = known[point] = _of_moments(even)
                    progress()
                    continue
                solution = self.solution(point)
                estimate, pair = self.estimate(point, solution), solution.pair
                if abs(point) >= TINIEST_P:  # else Λ has no scale
                    checked(estimate, self.refinement, point)
                solved[i] = pair
                rows[i] = Moment(estimate.value, pair.derivative, math.nan, estimate.error_estimate, pair.residual)
                known[point] = rows[i]
                if is_kept:
                    known[point] = rows[i]._replace(derivative_error=self.slope_error(point))
            except NotConverged as failure:
                if not self.problem.is_closed_only and (even := self.even(point)):
                    rows[i] = known[point] = _of_moments(even)
                else:
                    failures.append(Failure(point, failure.message))
            progress()
        pairs, found = tuple(solved[i] for i in sorted(solved)), points[sorted(rows)]
        value, slope, _, errors, residuals = np.array([rows[i] for i in sorted(rows)]).reshape(-1, 5).T
        if self.problem.has_algebraic_tails:
            slope = np.full_like(slope, math.nan)  # of p = 0, beside which there is no Λ(p)
        return MomentLyapunov(
            p=found,
            value=value,
            slope=slope,
            error_estimate=errors,
            residual=residuals,
            solver=self,
            warnings=(*missed(self, found, value, errors), *warnings_of_other_places(self.mesh, pairs)),
            failures=tuple(failures),
            notes=(*of_the_start(self, found), *bounds(self, found, value, errors)),
        )

    def slope(self, p: float) -> float:
        """Λ′(p) by eigenfunctions; NaN where these are not found, or there are none."""
        with suppress(NotConverged, NoSuchExponent):
            return self.solution(p).pair.derivative
        return math.nan

    def estimate(self, p: float, solution: Solution) -> Estimate:
        """Λ(p) on the scale of the terms of Eq. (37) before they cancel.

        Near p = 0, where rounding is not proportional to p, it is that of Λ(p)/p.
        """
        value, error = solution.pair.value, solution.error
        if p == 0:  # but for rounding, in every space
            value, error = 0.0, 0.0
        elif abs(p) < TINY_P:
            ratio, error = self.ratio_alone(p)
            value, error = p * ratio, abs(p) * error
        return Estimate(value, error, self.scale(p), quantity=quantity.moment_at(p))

    def slope_error(self, p: float) -> float:
        """Estimate of |error of Λ′(p)|; NaN where none is known.

        It is from the highest modes, see `error.slope_error`; where these do not tell, twice what a finer
        discretisation changes, or what has changed since a coarser one of the same place.
        """
        if p not in self.slope_errors:
            self.slope_errors[p] = math.nan
            with suppress(NotConverged):
                self.slope_errors[p] = self._slope_error(p)
        return self.slope_errors[p]

    @one_number("Λ′({:g})")
    def _slope_error(self, p: float) -> float:
        if abs(p) < TINIEST_P:
            return self.ratio_alone(0.0)[1]
        if self.classes:
            return float(np.max([each.slope_error(p) for each in self.classes]))
        solution = self.solution(p)
        with one_thread():
            jump = self._jump() if is_at_corner(self.problem, p) else 0.0
            if solution.measured is None:
                return slope_error(solution.pair) + jump
            coarser = [each.pair for each in getattr(solution.start, "before", ())]
            other = coarser[-1] if coarser else self.whole.finer_pair(solution.pair)
            return 2 * abs(other.derivative - solution.pair.derivative) + slope_rounding(solution.pair) + jump

    def _jump(self) -> float:
        """What Λ′ rises at p = −1 if Λ″ on both sides does not explain it: there is any slope between at a corner."""
        low, high = (self.solution(-1 + side).pair for side in (-2 * AT_CORNER, 2 * AT_CORNER))
        rise, smooth = high.derivative - low.derivative, second_derivative(low) + second_derivative(high)
        return rise if rise > 3 * smooth * 2 * AT_CORNER else 0.0

    def lyapunov_exponent(self) -> Estimate:
        """λ, Eq. (2), the growth rate of almost every path: Λ′(0) but for algebraic tails. Raises `NotConverged`."""
        try:
            with counted(self.budget.countdown("λ")):
                value, error = self.ratio_alone(0.0)
        except NotConverged as failure:
            if failure.reason.code is not Code.NUMBER_SPENT:
                raise
            spent = NotConverged(failure.reason, failure.partial, spent_remedy(self.problem))
            self.spent["λ"] = spent.message
            raise spent from None
        meaning = ALMOST_EVERY if self.problem.has_algebraic_tails else ""
        found = Estimate(value, error, self.scales.linear, meaning, quantity.LYAPUNOV_EXPONENT)
        return checked(found, self.refinement)

    @one_number("Λ″(0)")
    def variance_rate(self) -> Estimate:
        """Λ″(0), the asymptotic growth rate of the variance of ln ‖x‖.

        Its error is what two finer discretisations change in it, as one change is small by chance; twice the first one
        where the budget does not suffice for the second.

        Raises:
            NoSuchExponent: it does not exist, or the noise has algebraic tails.
            NotConverged: it is not resolved.
        """
        if not self.problem.is_driven:
            return Estimate(0.0, 0.0, 0.0, quantity=quantity.VARIANCE_RATE)
        if len(self.classes) > 1:
            rates = sorted((each.lyapunov_exponent() for each in self.classes), key=lambda each: -each.value)
            if rates[0].value - rates[1].value <= rates[0].error_estimate + rates[1].error_estimate:
                raise NoSuchExponent(Message(Code.NO_COMMON_RATE, value=rates[0].value))
        refuse_tails(self.problem, quantity.VARIANCE_RATE.symbol)
        scale = 2 * self.scales.quadratic
        value, better = self.around_zero.second_derivative, self.finer_around_zero.second_derivative
        error = 2 * abs(better - value)
        with suppress(NotConverged):
            finest = PairDerivatives(self.whole.finer_pair(self.finer_around_zero.pair)).second_derivative
            error, better = abs(finest - better) + 0.5 * error, finest
        error += 10 * sys.float_info.epsilon * max(scale, abs(better))
        return checked(Estimate(better, error, scale, quantity=quantity.VARIANCE_RATE), self.refinement)

    @cached_property
    def around_zero(self) -> PairDerivatives:
        """The pair at p = 0 and its derivatives. Raises `NotConverged`."""
        return PairDerivatives(self.whole.solution(0.0).pair)

    @cached_property
    def finer_around_zero(self) -> PairDerivatives:
        """That of a finer discretisation, for algebraic tails of a wider one. Raises `NotConverged`."""
        return PairDerivatives(self.whole.finer_pair(self.around_zero.pair))

    @one_number("Λ({0:g})/{0:g}")
    def ratio(self, p: float, tolerance: Tolerance | None = None) -> tuple[float, float, float]:
        """Λ(p)/p, its derivative in p, and the error of the first; λ at p = 0."""
        value, error = self.ratio_alone(p, tolerance)
        if abs(p) < TINY_P:  # ∫₀¹ s Λ″(sp) ds, by one point of Gauss
            return value, 0.5 * second_derivative(self.whole.solution(p * 2 / 3, tolerance).pair), error
        return value, (self._nearest(p, tolerance).pair.derivative - value) / p, error

    def _nearest(self, p: float, tolerance: Tolerance | None) -> Solution:
        if self.classes:
            return self.solution(p, tolerance)
        return self.whole.solution(p, tolerance)

    def ratio_alone(self, p: float, tolerance: Tolerance | None = None) -> tuple[float, float]:
        """Λ(p)/p and its error.

        Near p = 0 it is the mean of Λ′ from 0 to p, by two points of Gauss; its error is that at p = ±`SMALL_P`.
        """
        if known := self.by_moments(p):
            return known.value / p, known.error / p
        self._refuse_negative(p)
        if abs(p) >= TINY_P:
            solution = self._nearest(p, tolerance)
            return solution.pair.value / p, solution.error / abs(p)
        if self.classes:
            return max(each.ratio_alone(p, tolerance) for each in self.classes)
        points = {p * (0.5 + shift) for shift in (-0.5 / math.sqrt(3), 0.5 / math.sqrt(3))}
        pairs = [self.whole.solution(point, tolerance).pair for point in points]
        if self.problem.has_algebraic_tails:  # of which Λ(p) for p < 0 hardly tells: their moments are finite
            return self._among_tails(pairs[0])
        near = self.whole.near_zero(p, tolerance)
        error = near.error / abs(near.pair.p) + slope_rounding(pairs[0])
        return float(np.mean([pair.derivative for pair in pairs])) + near.pair.correction / near.pair.p, error

    def _among_tails(self, pair: PrincipalPair) -> tuple[float, float]:
        """λ from a pair at p = 0, on ever wider intervals of the noise, and what its modes and the ends leave.

        As the variance is finite, an interval twice as wide leaves less than half of λ that the noise makes beyond it.
        On a given mesh it is that of the mesh.
        """
        ends = pair.space.xi.lines[[0, -1]]
        change = math.inf if np.any(pair.space.xi.weight(ends) * ends**2 > sys.float_info.epsilon) else 0.0
        while change > (WIDER - 1) * self._allowed(0.0):
            wider = self.whole.pair_among(widened(pair.generator), pair)
            change = abs(wider.derivative - pair.derivative)
            if self.mesh is not None:
                return pair.derivative, change * WIDER / (WIDER - 1) + slope_error(pair)
            pair = wider
        return pair.derivative, change / (WIDER - 1) + slope_error(pair)


def solver_of(
    problem: Problem, mesh: CylinderMesh | None = None, rtol: float | None = None, budget: Budget | None = None
) -> ExponentSolver:
    """A solver of a problem, with what is usual for it in place of each None. Raises as `ExponentSolver`."""
    rtol = checked_problem(problem).usual_rtol if rtol is None else rtol
    return ExponentSolver(problem, mesh, rtol=rtol, budget=budget or Budget())


def share_of(most: float, p: float, value: float) -> float:
    """The tolerance of Λ(p) that leaves Λ(p)/p an error of this at most."""
    return most * abs(p)


def _of_moments(even: EvenMoment) -> Moment:
    return Moment(even.value, math.nan, math.nan, even.error, math.nan)


def tolerated(rtol: float, of_value: float, scales: Scale, p: float, value: float) -> float:
    """rtol of the terms of Eq. (37) before they cancel, or it or `of_value` of Λ(p), whichever is the largest."""
    return max(rtol * float(scales.moment(p)), max(rtol, of_value) * abs(value))


def best_order(p: FloatArray) -> Any:
    """Indices of p, inwards from the largest and then from the smallest: a mesh for a large |p| serves smaller ones."""
    return np.lexsort((-np.abs(p), p < 0))


def missed(solver: ExponentSolver, p: FloatArray, value: FloatArray, error: FloatArray) -> tuple[Message, ...]:
    """A warning about the p at which the estimated error exceeds rtol, or nothing."""
    size = np.where(np.abs(p) < TINIEST_P, math.inf, np.maximum(np.abs(value), solver.scales.moment(p)))
    shares = error / size
    count = np.count_nonzero(shares > solver.rtol)
    if not count:
        return ()
    worst, remedy = int(np.argmax(shares)), Remedy.ROUNDING if solver.mesh is None else Remedy.MESH
    found = {"p": p[worst], "size": shares[worst]}
    return (Message(Code.RTOL_MISSED, rtol=solver.rtol, count=count, of=p.size, **found, remedy=remedy),)


def of_the_start(solver: ExponentSolver, p: FloatArray) -> tuple[Message, ...]:
    """That Λ(p) for p < −1 depends on it, or nothing.

    On paths with singular values s₁ > s₂ of the matrix that moves x, starts in the cone of the faster mode grow as s₁,
    and of those in that of the slower one a share s₂/s₁ stays there and grows as s₂: E s₁^p and E s₂^(p + 1)/s₁, which
    are equal at p = −1.
    """
    return (Message(Code.START_MATTERS),) if np.any(p < -1) and solver.problem.has_cones else ()


def bounds(solver: ExponentSolver, p: FloatArray, value: FloatArray, error: FloatArray) -> tuple[Message, ...]:
    """What the even moments of a problem that has no others say of λ, of Λ between them, and of δ_p; or nothing."""
    if not (solver.problem.is_closed_only and p.size):
        return ()
    at, order = int(np.argmin(p)), np.argsort(p)
    low = float(p[order][value[order] < -error[order]].max(initial=0.0))
    high = float(p[value > error].min(initial=math.inf))
    root = f"> {low:g}" * (low > 0) + " and " * (low > 0 and high < math.inf) + f"< {high:g}" * (high < math.inf)
    bound = float(value[at] + error[at]) / float(p[at])
    return (Message(Code.CONVEX_BOUNDS, p=p[at], bound=bound, root=root or None),)


def moment_lyapunov(
    problem: Problem,
    p: ArrayLike,
    *,
    rtol: float | None = None,
    mesh: CylinderMesh | None = None,
    budget: Budget | None = None,
) -> MomentLyapunov:
    """The moment Lyapunov exponent Λ(p) = lim (1/t) ln E‖x(t)‖^p, Eq. (1), as the principal eigenvalue of Eq. (19).

    >>> moment_lyapunov(problem, 2.0)  # the `problem` of `Problem`
    MomentLyapunov(Λ(2) = -0.00739783... ± ...)

    Args:
        problem: a motion and its noise.
        p: one moment, or an array of shape (n,).
        rtol: |error| ≤ rtol·max(|Λ|, the terms of Eq. (37) before they cancel); None is 1e-8, under two noises
            that are not white 1e-6, for more than two variables 1e-5.
        mesh: a mesh for all p, where an `error_estimate` above rtol gives a warning; None chooses one that meets rtol.
        budget: what the choice of a mesh may cost; None for the default one.

    Many p are interpolated, see `exponent.curve`, where that saves solves; then `pairs` solves each p.

    Raises:
        ValueError: p is not finite, or empty, or rtol is not positive.
        NoSuchExponent: Λ(p) is infinite.
        NotConverged: some p are not resolved on the mesh, or within the budget; `partial` is the result for the others.
    """
    solver = solver_of(problem, mesh, rtol, budget)
    result = solve_moments(solver, real_numbers(p, "p"))
    if result.failures:
        reasons = [*dict.fromkeys(failure.reason for failure in result.failures)]
        raise NotConverged(Message(Code.SEVERAL, reasons=reasons), result)
    return result


def solve_moments(
    solver: ExponentSolver,
    p: ArrayLike,
    *,
    progress: Callable[[], None] = lambda: None,
    known: dict[float, Moment] | None = None,
) -> MomentLyapunov:
    """Λ at several p, by interpolation where that saves solves; what did not converge is in its `failures`.

    Args:
        solver: of the problem.
        p: one moment, or an array of shape (n,), which here may be empty; equal ones are solved once.
        progress: called once for each p, whatever the number of solves.
        known: Λ(p) of an earlier run, by p; it takes each p that is solved before `progress` is called.

    Raises:
        NoSuchExponent: Λ(p) is infinite for one of the p.
    """
    asked = checked_moments(p, solver.problem, may_be_empty=True)
    points, reports = np.array([*dict.fromkeys(asked.tolist())], dtype=float), repeat(progress, asked.size)

    def report() -> None:
        next(reports, lambda: None)()

    result = None
    if points.size > FEW_MOMENTS:
        with suppress(NotConverged):
            result = interpolated(solver, solver.curves(float(points.min()), float(points.max())), points)
            if result.warnings and solver.mesh is None:  # single solves round less
                result = None
    result = result or _one_by_one(solver, points, report, known)
    for each in reports:
        each()
    return result if points.size == asked.size else _at(result, asked)


def _at(result: MomentLyapunov, p: FloatArray) -> MomentLyapunov:
    """A result at p some of which are equal, without those that failed."""
    places = {each: i for i, each in enumerate(result.p.tolist())}
    index = [places[each] for each in p.tolist() if each in places]
    names = ("p", "value", "slope", "error_estimate", "residual")
    return replace(result, **{name: getattr(result, name)[index] for name in names})


def _one_by_one(
    solver: ExponentSolver, p: FloatArray, progress: Callable[[], None], known: dict[float, Moment] | None
) -> MomentLyapunov:
    """Λ at each p by a solve of its own, if these are convex; Λ(0) = 0 even where its eigenpair failed."""
    result = solver.moments(p, progress=progress, known=known)
    columns = result.p, result.value, result.slope, result.error_estimate
    obstacle = None
    if not result.failures:
        steep = partial(result.errors_of, result.slope)
        obstacle = broken_convexity(*columns, steep) or contradiction(solver, *columns, steep)
    if obstacle:
        return replace(result, failures=(Failure(None, message_of(obstacle).advising(solver.refinement)),))
    failures = tuple(failure for failure in result.failures if failure.p != 0)
    if len(failures) == len(result.failures):
        return result
    failed = {failure.p for failure in failures}
    place = [float(each) for each in p if each not in failed].index(0.0)
    row = {"p": 0.0, "value": 0.0, "slope": np.nan, "error_estimate": 0.0, "residual": np.nan}
    with_zero: dict[str, Any] = {name: np.insert(getattr(result, name), place, number) for name, number in row.items()}
    return replace(result, failures=failures, **with_zero)


def interpolated(solver: ExponentSolver, curves: tuple[Curve, ...], p: FloatArray) -> MomentLyapunov:
    """Λ at several p by curves; the residual is the largest of the nodes. Raises `NotConverged` if they contradict."""
    value, derivative, _, error, slope_error = values(curves, p)
    columns = p, value, derivative, error
    steep = partial(np.asarray, slope_error)
    if obstacle := broken_convexity(*columns, steep) or contradiction(solver, *columns, steep):
        raise NotConverged(obstacle, remedy=solver.refinement)
    for i in np.flatnonzero(p):
        estimate = Estimate(float(value[i]), float(error[i]), solver.scale(p[i]), quantity=quantity.moment_at(p[i]))
        checked(estimate, solver.refinement, float(p[i]))
    pairs = [solver.solution(each).pair for curve in curves for each in curve.nodes.tolist()]
    return MomentLyapunov(
        p=p,
        value=value,
        slope=derivative,
        error_estimate=error,
        residual=np.full(p.size, max(pair.residual for pair in pairs)),
        solver=solver,
        warnings=(*missed(solver, p, value, error), *warnings_of_other_places(solver.mesh, pairs)),
        curves=curves,
        root=sign_change(p, value, derivative),
        notes=of_the_start(solver, p),
    )


def sign_change(p: FloatArray, value: FloatArray, slope: FloatArray) -> float | None:
    """Where Λ(p)/p, which increases, changes its sign, by one step of Newton; None where it does not."""
    order = np.argsort(p)
    order = order[p[order] != 0]
    p, ratio, rise = p[order], value[order] / p[order], slope[order] - value[order] / p[order]
    sides = np.flatnonzero((ratio[:-1] <= 0) & (ratio[1:] > 0))
    if not sides.size:
        return None
    i = sides[0] + int(abs(ratio[sides[0] + 1]) < abs(ratio[sides[0]]))
    return float(np.clip(p[i] - ratio[i] * p[i] / rise[i], p[sides[0]], p[sides[0] + 1]))


def broken_convexity(
    p: FloatArray, value: FloatArray, slope: FloatArray, errors: FloatArray, slope_errors: Callable[[], FloatArray]
) -> Message | None:
    """Where a point, or Λ(0) = 0, lies below a tangent by more than the errors explain; or None, as Λ(p) is convex.

    Tangents are those of the 1st, 2nd, 4th, 8th … p on each side, and of p = 0. The errors of the slopes are asked for
    where those of the values do not suffice.
    """
    if not p.size:
        return None
    order, at_zero = np.argsort(p), np.flatnonzero(p == 0)[:1]
    value = np.append(np.where(p == 0, 0.0, value), 0.0)  # but for rounding
    sides = [(order[:-k], order[k:]) for k in 2 ** np.arange((p.size - 1).bit_length())]
    pairs = [*sides, *(side[::-1] for side in sides), (order, np.full(p.size, p.size))]
    pairs += [(np.repeat(at_zero, p.size), np.tile(order, at_zero.size))]
    own, other = np.concatenate(pairs, axis=1)
    away, errors = np.append(p, 0.0)[other] - p[own], np.append(errors, 0.0)
    above = value[other] - (value[own] + slope[own] * away)
    above = np.where(np.isfinite(above), above, math.inf)  # where no slope is known
    slack = 10 * (errors[own] + errors[other]) + 1e-6 * np.abs(value[other])
    if np.any(above < -slack):
        slack += 3 * np.nan_to_num(slope_errors(), nan=1e300)[own] * np.abs(away)
    worst = np.argmin(above + slack)
    if not above[worst] < -slack[worst]:
        return None
    return Message(Code.NOT_CONVEX, p=p[own[worst]], other=np.append(p, 0.0)[other[worst]])


def contradiction(
    solver: ExponentSolver,
    p: FloatArray,
    value: FloatArray,
    slope: FloatArray,
    errors: FloatArray,
    slope_errors: Callable[[], FloatArray],
) -> Message | None:
    """Where a point lies on the wrong side of the chord from Λ(0) = 0 to an even moment, or its tangent above that.

    The even moments are Λ(2) and those of the p themselves, by equations that know no directions, see `even`. The
    errors of the slopes are asked for where those of the values do not suffice.
    """
    for q in sorted({2.0, *p[(p > 0) & (p % 2 == 0)].tolist()} if p.size else ()):
        if not (known := solver.even(q)):
            continue
        slack = np.array([solver.doubt(error, known) for error in errors]) * np.maximum(1.0, np.abs(p) / q)
        above, rise = value - p / q * known.value, slope * (q - p)
        is_wrong = np.where((p > 0) & (p < q), above, -above) > slack
        too_steep = value + rise - known.value - slack - SLOPE_SHARE * np.abs(rise)
        if np.any(too_steep > 0):
            is_wrong |= too_steep > 3 * np.nan_to_num(slope_errors(), nan=1e300) * np.abs(q - p)
        if np.any(is_wrong):
            i = int(np.argmax(is_wrong))
            return Message(Code.NOT_PRINCIPAL, p=p[i], value=value[i], other=q, expected=known.value)
    return None
