"""The moment Lyapunov exponent Λ(p) at single p, each with an error estimate."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import KW_ONLY, dataclass, field, replace
from functools import cached_property, partial
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, read_only, real_number, real_numbers, require, shown
from fpsolve.budget import Meter, OverBudget, begin, unless_over_budget
from fpsolve.data import Result, dataset
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent.curve import Curve, polynomials, values
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.elements import doubt
from fpsolve.exponent.error import Estimate, Failure, InvariantClass, Moment
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import (
    BUDGET,
    RTOLS,
    SMALL_P,
    TINIEST_P,
    Budget,
    Method,
    Settings,
    Tolerance,
    checked_moments,
    refuse,
)
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message, Remedy, message_of
from fpsolve.model import quantity
from fpsolve.model.problem import Problem, checked_problem
from fpsolve.theory.frozen import eigenvalues_at

if TYPE_CHECKING:
    import xarray

FEW_MOMENTS = 16
"""Up to so many p are solved one by one."""
SLOPE_SHARE = 1e-3
"""Of what a tangent rises, by which it may lie too high, as slopes have errors."""


@dataclass(frozen=True, eq=False, repr=False)
class MomentLyapunov(Result):
    """Λ(p) at several p.

    Attributes:
        p: the moments, shape (n,), in the order asked for, without those that failed.
        value: Λ(p), per unit time, shape (n,).
        slope: Λ′(p), shape (n,). It is NaN at even p where moments have equations of their own, and at p = 0 under
            algebraic tails.
        error_estimate: estimate of |error of `value`|, shape (n,), from the highest modes, the ends of a noise interval
            and the bound of rounding. It is at least half a unit in the last place.
        residual: backward error of the eigenpairs, shape (n,); NaN where there is none.
        solver: what solved them.
        curves: of which these are values; none where each p was solved.
        failures: why some p are missing, or none is to be trusted.
    """

    p: FloatArray
    value: FloatArray
    slope: FloatArray
    error_estimate: FloatArray
    residual: FloatArray
    solver: ExponentSolver
    curves: tuple[Curve, ...] = ()
    failures: tuple[Failure, ...] = ()

    def __post_init__(self) -> None:
        least = 0.5 * np.spacing(np.abs(self.value))
        object.__setattr__(self, "error_estimate", np.maximum(self.error_estimate, least))
        super().__post_init__()

    @cached_property
    def warnings(self) -> tuple[Message, ...]:
        """On the p where `error_estimate` exceeds rtol, and on what was solved."""
        p, method, rtol = self.p, self.solver.method, self.solver.rtol
        size = np.where(np.abs(p) < TINIEST_P, math.inf, np.maximum(np.abs(self.value), method.scales.moment(p)))
        shares = self.error_estimate / size
        found = method.doubts([p for curve in self.curves for p in curve.nodes.tolist()] or p.tolist())
        if not (count := np.count_nonzero(shares > rtol)):
            return found
        worst, remedy = int(np.argmax(shares)), Remedy.ROUNDING if method.adapts else Remedy.MESH
        told = Message(
            Code.RTOL_MISSED, rtol=rtol, count=count, of=p.size, p=p[worst], size=shares[worst], remedy=remedy
        )
        return told, *found

    @cached_property
    def notes(self) -> tuple[Message, ...]:
        """What Λ(p) says of other numbers."""
        return self.solver.method.bounds(self.p, self.value, self.error_estimate)

    @cached_property
    def derivative(self) -> FloatArray:
        """Λ′(p), shape (n,): `slope`, and what is solved now where that is NaN; NaN where there is none."""
        known = zip(self.p.tolist(), self.slope.tolist(), strict=True)
        return read_only(np.array([self.solver.slope(p) if p and math.isnan(slope) else slope for p, slope in known]))

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
        """Λ(p) of each part of the problem, nothing where there are none. Raises `NotConverged`."""
        return self.solver.by_class(self.p)

    def to_xarray(self) -> xarray.Dataset:
        """Λ(p), `slope`, their errors and residuals over p."""
        columns = {name: getattr(self, name) for name in ("value", "error_estimate", "residual")}
        columns |= {"derivative": self.slope, "derivative_error": self.errors_of(self.slope)}
        numbers = {quantity.OVER_P[name]: each for name, each in columns.items()}
        return dataset(
            quantity.MOMENT.words,
            self.solver.method.name,
            numbers,
            {quantity.P: self.p},
            self.solver.problem.values,
            rtol=self.solver.rtol,
            warnings=self.warnings,
            notes=self.notes,
            failures=[each.reason for each in self.failures],
        )

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

    Attributes:
        slope_errors: of Λ′(p), by p.

    Raises:
        NoSuchExponent: the variance of the noise is infinite.
        TypeError: an argument is of another kind.
        ValueError: rtol is not between 1e-13 and 1.
    """

    problem: Problem
    mesh: CylinderMesh | None = None
    _: KW_ONLY
    rtol: float = 1e-8
    of_value: float = 0.0
    budget: Budget = BUDGET
    slope_errors: dict[float, float] = field(init=False, default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        checked_problem(self.problem)
        require(self.mesh, CylinderMesh | None, "mesh", "a CylinderMesh, or None")
        require(self.budget, Budget, "budget", "a Budget")
        require(self.rtol, Real, "rtol", "a number such as 1e-8")
        if not (self.problem.noise.is_white or math.isfinite(self.problem.noise.standard_deviation)):
            raise NoSuchExponent(Message(Code.INFINITE_VARIANCE))
        if not (math.isfinite(self.rtol) and RTOLS["gt"] < self.rtol < RTOLS["lt"]):
            limits = f"must be > {RTOLS['gt']:g} and < 1; write, for example, 1e-8"
            raise ValueError(f"got rtol = {shown(self.rtol)}; {limits}")
        _ = self.method  # refuses a mesh of three variables

    @cached_property
    def meter(self) -> Meter:
        """Of all numbers of the problem."""
        return self.budget.meter()

    @cached_property
    def method(self) -> Method:
        """The method for Λ(p) of such a problem."""
        settings = Settings(self.rtol, self.of_value, self.mesh, self.budget, self.meter)
        return choose(self.problem, settings)

    def of(self, method: Method) -> ExponentSolver:
        """That of a part of the problem."""
        found = replace(self, problem=method.problem)
        found.__dict__.update(method=method, meter=self.meter)
        return found

    def pair(self, p: float) -> PrincipalPair:
        """The principal eigenpair at p. Raises `NotConverged`, `NoSuchExponent`."""
        return self.method.pair(self._checked(p))

    def solution(self, p: float, tolerance: Tolerance | None = None) -> Any:
        """The principal eigenpair at p and its error, within a tolerance, that of rtol if none is given.

        Raises:
            NoSuchExponent: Λ(p) is infinite, or not computed.
            NotConverged: it is not resolved, or the budget does not suffice.
        """
        return self.method.solution(self._checked(p), tolerance)

    def _checked(self, p: float) -> float:
        point = real_number(p, "p")
        refuse(self.method.reason(point))
        return point

    def by_class(self, p: ArrayLike) -> tuple[InvariantClass, ...]:
        """λ and Λ(p) of each part, for p < 0 too; nothing where there are none. Raises `NotConverged`."""
        return self.method.by_part(real_numbers(p, "p", may_be_empty=True))

    def curves(self, low: float, high: float, most: int) -> tuple[Curve, ...]:
        """Λ on an interval, of two variables: polynomials on its halves, and theirs, where one is not enough.

        Args:
            low, high: the interval; it falls in two where a saddle has a corner.
            most: number of polynomials, twice as many where it falls in two.

        Raises:
            NotConverged: there are none.
        """
        intervals = [(low, high)]
        if low < -1 < high and not eigenvalues_at(self.problem, 0.0)[2]:
            intervals, most = [(low, -1.0), (-1.0, high)], 2 * most
        parts = list[Curve]()
        if self.method.is_function:
            parts = polynomials(self.method.ratio, intervals, self._allowed, most)
        if not parts:
            raise NotConverged(Message(Code.NO_FUNCTION, low=low, high=high))
        return tuple(parts)

    def _allowed(self, p: float) -> float:
        """The largest error of Λ(p)/p, and of λ."""
        size = max(abs(p), SMALL_P)
        return self.method.tolerance(size, 0.0) / size

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
        points = checked_moments(p, self.method, may_be_empty=True)
        earlier = known.items() if known and self.method.goes_on else ()
        rows = {q: row for q, row in earlier if not math.isnan(row.derivative)}
        for q, row in rows.items():
            if not math.isnan(row.derivative_error):
                self.slope_errors.setdefault(q, row.derivative_error)
        failures = {}
        outwards = np.lexsort((np.abs(points), points < 0))  # each from those before
        for q in points[outwards].tolist():
            begin(f"Λ({q:g})")
            try:
                if q not in rows:
                    row = rows[q] = self.method.row(q)
                    if known is not None:
                        has_pair = not math.isnan(row.residual)
                        known[q] = row._replace(derivative_error=self.slope_error(q)) if has_pair else row
            except NotConverged as failure:
                if q:
                    failures[q] = Failure(q, failure.message)
                else:  # Λ(0) = 0 even so
                    rows[q] = Moment(0.0, math.nan, math.nan, 0.0, math.nan)
            progress()
        found = np.array([q for q in points.tolist() if q in rows])
        value, slope, _, errors, residuals = np.array([rows[q] for q in found.tolist()]).reshape(-1, 5).T
        if self.method.lacks_moments:
            slope = np.full_like(slope, math.nan)  # of p = 0, beside which there is no Λ(p)
        failed = tuple(failures[q] for q in points.tolist() if q in failures)
        return MomentLyapunov(found, value, slope, errors, residuals, self, failures=failed)

    def slope(self, p: float) -> float:
        """Λ′(p) by eigenfunctions; NaN where these are not found, or there are none."""
        with suppress(NotConverged, NoSuchExponent):
            return self.solution(p).derivative
        return math.nan

    def slope_error(self, p: float) -> float:
        """Estimate of |error of Λ′(p)|; NaN where none is known."""
        with suppress(OverBudget, NoSuchExponent):  # which leave no number, and may be gone the next time
            if p not in self.slope_errors:
                found = math.nan
                with unless_over_budget():
                    found = self.method.slope_error(p)
                self.slope_errors[p] = found
        return self.slope_errors.get(p, math.nan)

    def lyapunov_exponent(self) -> Estimate:
        """λ, Eq. (2), the growth rate of almost every path. Raises `NotConverged`, `NoSuchExponent`."""
        refuse(self.method.reason(0.0))
        return self.method.lyapunov_exponent()

    def variance_rate(self) -> Estimate:
        """Λ″(0), the asymptotic growth rate of the variance of ln ‖x‖. Raises `NotConverged`, `NoSuchExponent`."""
        refuse(self.method.reason(0.0, quantity.VARIANCE_RATE.symbol))
        if not self.problem.is_driven:
            return Estimate(0.0, 0.0, 0.0, quantity=quantity.VARIANCE_RATE)
        return self.method.variance_rate()


def solver_of(
    problem: Problem, mesh: CylinderMesh | None = None, rtol: float | None = None, budget: Budget | None = None
) -> ExponentSolver:
    """A solver of a problem, with what is usual for it in place of each None. Raises as `ExponentSolver`."""
    rtol = choose(problem).usual_rtol if rtol is None else rtol
    return ExponentSolver(problem, mesh, rtol=rtol, budget=budget or BUDGET)


def share_of(most: float, p: float, value: float) -> float:
    """The tolerance of Λ(p) that leaves Λ(p)/p an error of this at most."""
    return most * abs(p)


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
        rtol: |error| ≤ rtol·max(|Λ|, the terms of Eq. (37) before they cancel); None is 1e-8. Under two noises
            that are not white it is 1e-6, for more than two variables 1e-5, with a wall of these 1e-3.
        mesh: a mesh for all p, where an `error_estimate` above rtol gives a warning; None chooses one that meets rtol.
        budget: what the choice of a mesh may cost; None for the default one.

    Many p are interpolated, see `exponent.curve`, where that saves solves; then `pairs` solves each p.

    Raises:
        ValueError: p is not finite, or empty, or rtol is not between 1e-13 and 1.
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
        p: one moment, or an array of shape (n,), which here may be empty.
        progress: called once for each p, whatever the number of solves.
        known: Λ(p) of an earlier run, by p; it takes each p that is solved before `progress` is called.

    Raises:
        NoSuchExponent: Λ(p) is infinite for one of the p.
    """
    asked = checked_moments(p, solver.method, may_be_empty=True)
    if np.unique(asked).size > FEW_MOMENTS and not solver.method.turns_back:
        try:
            with unless_over_budget():
                result = interpolated(solver, solver.curves(float(asked.min()), float(asked.max()), 1), asked)
                if not (result.warnings and solver.method.adapts):  # single solves round less
                    for _ in asked:
                        progress()
                    return result
        except OverBudget:  # a p among its nodes has no number either
            solver = solver.of(choose(solver.problem, solver.method.settings))
    result = solver.moments(asked, progress=progress, known=known)
    if not result.failures and (obstacle := _obstacle(result)):
        reason = message_of(obstacle).advising(solver.method.refinement)
        result = replace(result, failures=(Failure(None, reason),))
    return result


def interpolated(solver: ExponentSolver, curves: tuple[Curve, ...], p: FloatArray) -> MomentLyapunov:
    """Λ at several p by curves; the residual is the largest of the nodes. Raises `NotConverged` if they contradict."""
    value, slope, _, error, _ = values(curves, p)
    size = np.maximum(np.abs(value), solver.method.scales.moment(p))
    i = int(np.argmax(error / (size + 1e-300)))
    solver.method.check(float(p[i]), float(value[i]), float(error[i]))
    nodes = [p for curve in curves for p in curve.nodes.tolist()]
    residual = np.full(p.size, max(solver.method.solution(node).pair.residual for node in nodes))
    found = MomentLyapunov(p, value, slope, error, residual, solver, curves=curves)
    if obstacle := _obstacle(found):
        raise NotConverged(obstacle, remedy=solver.method.refinement)
    return found


def _obstacle(result: MomentLyapunov) -> Message | None:
    """Why not all values can be right; None where they may be."""
    steep = partial(result.errors_of, result.slope)
    columns = result.p, result.value, result.slope, result.error_estimate, steep
    return broken_convexity(*columns) or contradiction(result.solver, *columns)


def broken_convexity(
    p: FloatArray, value: FloatArray, slope: FloatArray, errors: FloatArray, slope_errors: Callable[[], FloatArray]
) -> Message | None:
    """Where a point, or Λ(0) = 0, lies below a tangent by more than the errors explain; or None, as Λ(p) is convex.

    Tangents are those of the next p on each side. The errors of the slopes are asked for where those of the values do
    not suffice.
    """
    if not p.size:
        return None
    order, value = np.argsort(p), np.where(p == 0, 0.0, value)  # but for rounding
    own, other = np.array([[*order[:-1], *order[1:], *order], [*order[1:], *order[:-1], *order.size * [p.size]]])
    p, value, errors = (np.append(each, 0.0) for each in (p, value, errors))
    away = p[other] - p[own]
    above = value[other] - (value[own] + slope[own] * away)
    above = np.where(np.isfinite(above), above, math.inf)  # where no slope is known
    slack = 10 * (errors[own] + errors[other]) + 1e-6 * np.abs(value[other])
    if np.any(above < -slack):
        slack += 3 * np.nan_to_num(slope_errors(), nan=1e300)[own] * np.abs(away)
    worst = np.argmin(above + slack)
    if not above[worst] < -slack[worst]:
        return None
    return Message(Code.NOT_CONVEX, p=p[own[worst]], other=p[other[worst]])


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
        if not (known := solver.method.even(q)):
            continue
        slack = doubt(errors, known) * np.maximum(1.0, np.abs(p) / q)
        above, rise = value - p / q * known.value, slope * (q - p)
        is_wrong = np.where((p > 0) & (p < q), above, -above) > slack
        too_steep = value + rise - known.value - slack - SLOPE_SHARE * np.abs(rise)
        if np.any(too_steep > 0):
            is_wrong |= too_steep > 3 * np.nan_to_num(slope_errors(), nan=1e300) * np.abs(q - p)
        if np.any(is_wrong):
            i = int(np.argmax(is_wrong))
            return Message(Code.NOT_PRINCIPAL, p=p[i], value=value[i], other=q, expected=known.value)
    return None
