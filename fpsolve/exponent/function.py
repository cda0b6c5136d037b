"""Λ at several p, one by one or as a function, and the stability index."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import repeat
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, real_array, real_numbers
from fpsolve.budget import OverBudget, one_number, under_way
from fpsolve.data import Result, dataset
from fpsolve.errors import NotConverged
from fpsolve.exponent.adapt import Budget, Tolerance
from fpsolve.exponent.basis import MOST_NODES, Basis, Curve, bases
from fpsolve.exponent.error import MEANINGLESS, Absent, Estimate, Failure, Moment, checked
from fpsolve.exponent.solver import ExponentSolver, MomentLyapunov, missed, of_the_start, solver_of
from fpsolve.exponent.starts import warnings_of_other_places
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message, Remedy, message_of
from fpsolve.model.problem import Problem, checked_moments, negative_refused, tails_refused
from fpsolve.model.quantity import DERIVATIVE, MOMENT, SECOND_DERIVATIVE, STABILITY_INDEX, P, moment_at
from fpsolve.roots import Missing, NoRoot, Value, increasing_root

if TYPE_CHECKING:
    import xarray

SEARCH_INTERVAL: tuple[float, float] = (-20.0, 20.0)
OUTWARD = 4.0
"""The first p at most; others are at most twice as far out as the one before, as Λ(p) costs more there."""
ROUGH = 0.1
"""Error, over |Λ(p)|, at an end of the interval, where the sign alone counts."""
PRECISE = 0.5
"""Of what rtol allows δ_p, for the error of the last Λ(p)/p."""
FEW = 17
"""Number of p of the interval at which a sign of Λ(p)/p is looked for, besides the nodes."""
AT_ONCE = 256
"""Number of p that are evaluated together."""
SHOWN = 201
"""So many p of the interval are drawn."""
SLOPE_SHARE = 1e-3
"""Of what a tangent rises, by which it may lie too high, as slopes have errors."""
FEW_MOMENTS = 9
"""Up to so many p are solved one by one."""
WORTH = 0.6
"""Largest number of nodes of a function, over that of the p that are asked for."""


class MomentLyapunovFunction(Result):
    """Λ(p) of two variables on an interval of p, callable on arrays.

    It is solved at few p, with T, T* and their derivatives there, and between these by what they make of L(p), see
    `exponent.basis`: on one space, or one for each sign of p.

    >>> print(f"{MomentLyapunovFunction(problem, (-1.0, 3.0))(2.0):.9f}")
    -0.007397833

    Args:
        problem: a motion and its noise.
        interval: the smallest and the largest p.
        mesh: a mesh for all p; None chooses one that meets rtol.
        rtol: |error| ≤ rtol·max(|Λ|, the terms of Eq. (37) before they cancel); None is 1e-8, under two noises
            that are not white 1e-6.
        budget: what the choice of a mesh may cost for one p; None for the default one.
        solver: one of the same problem, to go on with; it decides the mesh, rtol and the budget.
        most: how many p may be solved.

    Attributes:
        nodes: the p that were solved, increasing, shape (n,).
        is_converged: whether more nodes would add nothing that rtol, or the errors on a given mesh, leave visible.
        solver: what solved them; its pairs are the eigenfunctions.

    Raises:
        ValueError: the interval is empty or not finite.
        NoSuchExponent: Λ(p) is infinite in the interval.
        NotConverged: some p are not resolved on the mesh, or within the budget; or there is no such function, as of
            several blocks, of more variables, or where slow noise carries a moment at several places.
    """

    def __init__(
        self,
        problem: Problem,
        interval: tuple[float, float],
        mesh: CylinderMesh | None = None,
        *,
        rtol: float | None = None,
        budget: Budget | None = None,
        solver: ExponentSolver | None = None,
        most: int = MOST_NODES,
    ) -> None:
        low, high = (float(end) for end in checked_moments(list(interval), problem))
        if not low < high:
            raise ValueError(f"the interval of p is {interval}; its ends must increase")
        self.interval = low, high
        self.solver = solver or solver_of(problem, mesh, rtol, budget)
        self._bases = bases(self.solver, low, high, most)
        self.nodes = np.unique([p for basis in self._bases for p in basis.nodes])
        self.is_converged = all(basis.is_converged for basis in self._bases)
        pairs = [basis.nodes[p] for basis in self._bases for p in sorted(basis.nodes)]
        self.residual = max(node.pair.residual for node in pairs)
        names, errors = ("p", "value", "derivative"), np.array([node.error for node in pairs])
        p, value, slope = (np.array([getattr(node.pair, name) for node in pairs]) for name in names)
        if obstacle := broken_convexity(p, value, slope, errors, lambda: self._slope_errors(p)):
            raise NotConverged(obstacle, remedy=self.solver.refinement)

    def __call__(self, p: ArrayLike) -> FloatArray:
        """Λ(p), per unit time, of the shape of p. Raises `ValueError` outside the interval."""
        return self._curve(p).value

    def derivative(self, p: ArrayLike) -> FloatArray:
        """Λ′(p)."""
        return self._curve(p).derivative

    def second_derivative(self, p: ArrayLike) -> FloatArray:
        """Λ″(p)."""
        return self._of_bases(p, Basis.second_derivative)

    def error_estimate(self, p: ArrayLike) -> FloatArray:
        """Estimate of |error of Λ(p)|: what is left between the nodes, that of the space, and rounding."""
        return self._curve(p).error

    def derivative_error(self, p: ArrayLike) -> FloatArray:
        """Estimate of |error of Λ′(p)|, of the shape of p: those of the nodes, and what is left between these.

        As the fourth power of each distance from a node is in it, its slope is that of a polynomial of the degree
        n = 4 · nodes, min(n², n/√(1 − x²)) times as large at most, x = ±1 at the ends (Markov, Bernstein).
        """
        curve, points = self._curve(p), np.asarray(p, dtype=float)
        half = 0.5 * (self.interval[1] - self.interval[0])
        x, n = (points - self.interval[0]) / half - 1, 4 * self.nodes.size
        steepness = np.minimum(n**2, n / np.sqrt(np.maximum(1 - x**2, 1e-300))) / half
        return np.asarray(curve.left * steepness + np.max(self._slope_errors(self.nodes)))

    def moments(self, p: ArrayLike) -> MomentLyapunov:
        """Λ(p) at several p; the residual is the largest of the nodes. Raises `NotConverged` if they contradict."""
        points = checked_moments(p, self.solver.problem)
        curve, scale = self._curve(points), self.solver.scales.moment(points)
        value, error = curve.value, curve.error
        columns = points, value, curve.derivative, error
        if obstacle := broken_convexity(*columns, lambda: self.derivative_error(points)):
            raise NotConverged(obstacle, remedy=self.solver.refinement)
        if obstacle := contradiction(self.solver, *columns):
            raise NotConverged(obstacle, remedy=self.solver.refinement)
        is_meaningless = ~(error <= MEANINGLESS * np.maximum(np.abs(value), scale)) & (points != 0)
        for i in np.flatnonzero(is_meaningless):
            estimate = Estimate(float(value[i]), float(error[i]), float(scale[i]), quantity=moment_at(points[i]))
            checked(estimate, self.solver.refinement, float(points[i]))
        return MomentLyapunov(
            p=points,
            value=value,
            derivative=curve.derivative,
            error_estimate=error,
            residual=np.full(points.size, self.residual),
            solver=self.solver,
            warnings=(*missed(self.solver, points, value, error), *self._misplaced()),
            function=self,
            root=_sign_change(points, value, curve.derivative),
            notes=of_the_start(self.solver, points),
        )

    def _misplaced(self) -> tuple[Message, ...]:
        mesh = self.solver.mesh
        return warnings_of_other_places(mesh, [] if mesh is None else [self.solver.pair(float(p)) for p in self.nodes])

    def root(self) -> float | None:
        """Where Λ(p)/p changes its sign in the interval, or None."""
        p = np.union1d(self.nodes, np.linspace(*self.interval, FEW))
        curve = self._curve(p)
        return _sign_change(p, curve.value, curve.derivative)

    def lyapunov_exponent(self) -> Estimate:
        """λ = Λ′(0), Eq. (2), solved at p = 0. Raises `NotConverged`."""
        return self.solver.lyapunov_exponent()

    def variance_rate(self) -> Estimate:
        """Λ″(0), solved at p = 0. Raises `NotConverged`."""
        return self.solver.variance_rate()

    def stability_index(self, search: tuple[float, float] = SEARCH_INTERVAL) -> Estimate | Absent:
        """δ_p, see `nonzero_root`, from `root` on, or why there is none. Raises `NotConverged`."""
        return nonzero_root(self.solver, search, self.root())

    def to_xarray(self, p: ArrayLike | None = None) -> xarray.Dataset:
        """Λ(p) with its derivatives and errors at some p, `SHOWN` of the interval if none are given."""
        p = np.linspace(*self.interval, SHOWN) if p is None else real_numbers(p, "p")
        curve = self._curve(p)
        numbers = {
            MOMENT: curve.value,
            MOMENT.error(): curve.error,
            DERIVATIVE: curve.derivative,
            DERIVATIVE.error(): self.derivative_error(p),
            SECOND_DERIVATIVE: self.second_derivative(p),
        }
        method, values = "finite elements and a reduced basis", self.solver.problem.values
        return dataset(MOMENT.words, method, numbers, {P: p}, values, rtol=self.solver.rtol)

    def _said(self) -> str:
        return "p from {:g} to {:g}, {} solved".format(*self.interval, self.nodes.size)

    def _curve(self, p: ArrayLike) -> Curve:
        """Everything at p, each of its shape. Raises `ValueError` outside the interval."""
        found = Curve(*self._of_bases(p, Basis.at))
        value, error = (np.where(np.asarray(p) == 0, 0.0, each) for each in (found.value, found.error))
        return found._replace(value=value, error=error)  # but for rounding

    def _of_bases(self, p: ArrayLike, function: Callable[[Basis, FloatArray], Any]) -> FloatArray:
        """What one or more functions of the basis of each p give, the shape of p last."""
        points = real_array(p, "p")
        low, high = self.interval
        slack = 1e-9 * (high - low)
        if not np.all((points >= low - slack) & (points <= high + slack)):
            raise ValueError(f"p must lie in [{low:g}, {high:g}], the interval of this function; make a wider one")
        flat = np.clip(points.ravel(), low, high)
        parts = np.array_split(np.argsort(flat, kind="stable"), math.ceil(flat.size / AT_ONCE) or 1)
        found: FloatArray = np.zeros(0)
        for basis in self._bases:
            for part in parts:
                own = part[(flat[part] >= basis.low) & (flat[part] <= basis.high)]
                values = np.asarray(function(basis, flat[own]))
                found = found if found.size else np.zeros((*values.shape[:-1], flat.size))
                found[..., own] = values
        return found.reshape((*found.shape[:-1], *points.shape))

    def _slope_errors(self, p: FloatArray) -> FloatArray:
        """Estimate of |error of Λ′| at nodes."""
        return np.array([self.solver.slope_error(each) for each in p.tolist()])


def _sign_change(p: FloatArray, value: FloatArray, slope: FloatArray) -> float | None:
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

    The errors of the slopes are asked for where those of the values do not suffice.
    """
    if not p.size:
        return None
    value = np.where(p == 0, 0.0, value)  # but for rounding
    others, away = np.append(value, 0.0), np.append(p, 0.0)[None] - p[:, None]
    above = others[None] - (value[:, None] + slope[:, None] * away)
    above = np.where(np.isfinite(above), above, math.inf)  # where no slope is known
    slack = 10 * (errors[:, None] + np.append(errors, 0.0)[None]) + 1e-6 * np.abs(others[None])
    if np.any(above < -slack):
        steep = np.nan_to_num(slope_errors(), nan=1e300)
        slack += 3 * steep[:, None] * np.abs(away)
    i, j = np.unravel_index(np.argmin(above + slack), above.shape)
    if not above[i, j] < -slack[i, j]:
        return None
    return Message(Code.NOT_CONVEX, p=p[i], other=np.append(p, 0.0)[j])


def contradiction(
    solver: ExponentSolver, p: FloatArray, value: FloatArray, slope: FloatArray, errors: FloatArray
) -> Message | None:
    """Where a point lies on the wrong side of the chord from Λ(0) = 0 to an even moment, or its tangent above that.

    The even moments are Λ(2) and those of the p themselves, by equations that know no directions, see `even`.
    """
    for q in sorted({2.0, *p[(p > 0) & (p % 2 == 0)].tolist()} if p.size else ()):
        if not (known := solver.even(q)):
            continue
        slack = np.array([solver.doubt(error, known) for error in errors]) * np.maximum(1.0, np.abs(p) / q)
        above, rise = value - p / q * known.value, slope * (q - p)
        is_wrong = np.where((p > 0) & (p < q), above, -above) > slack
        is_wrong |= value + rise - known.value > slack + SLOPE_SHARE * np.abs(rise)
        if np.any(is_wrong):
            i = int(np.argmax(is_wrong))
            return Message(Code.NOT_PRINCIPAL, p=p[i], value=value[i], other=q, expected=known.value)
    return None


@one_number("δ_p")
def nonzero_root(
    solver: ExponentSolver, interval: tuple[float, float] = SEARCH_INTERVAL, guess: float | None = None
) -> Estimate | Absent:
    """δ_p, the non-zero root of Λ(p), or why Λ has none in the interval.

    Λ is convex, so Λ(p)/p increases and has one root at most, see `increasing_root`. The last solve is as accurate as
    δ_p is to be. Where Λ(p) is not resolved far out it is looked for as far as it is.

    Raises:
        NotConverged: no p on the way is resolved, or not one between two at which Λ(p)/p has other signs.
    """
    if not solver.problem.is_driven:
        return Absent(Message(Code.NOT_DRIVEN))
    if told := tails_refused(solver.problem, STABILITY_INDEX.symbol):
        return Absent(told)
    noise = solver.problem.noise
    low, high = (float(end) for end in np.clip(interval, *solver.problem.moments))
    ends = low, high
    if solver.classes:  # for p > 0 Λ(p) is the largest of theirs
        if len(solver.classes) > 1 and solver.lyapunov_exponent().value > 0:
            return Absent(negative_refused(solver.problem))
        roots = [nonzero_root(each, interval) for each in solver.classes if each.problem.system.driven_by]
        if known := [each for each in roots if each]:
            return min(known, key=lambda each: each.value)
        return Absent(Message(Code.NO_ROOT, low=ends[0], high=ends[1], is_bounded=noise.is_bounded))
    solved, outward = dict[float, tuple[float, float, float]](), {*ends}  # where the sign is wanted

    def at(p: float, tolerance: Tolerance | None = None) -> Value:
        is_rough = p in outward and solver.mesh is None and tolerance is None
        try:
            solved[p] = _rough_ratio(solver, p) if is_rough else _precise_ratio(solver, p, tolerance)
        except (NotConverged, OverBudget) as failure:
            raise Missing(p) from failure
        ratio, slope, error = solved[p]
        if not slope > 0:
            raise NotConverged(Message(Code.NOT_INCREASING, p=p), remedy=solver.refinement)
        outward.update((-max(OUTWARD, 2 * abs(p)), max(OUTWARD, 2 * abs(p))))
        return Value(ratio, slope, 0.1 * error)

    signed: tuple[float, ...] = ()
    if guess is None:
        if "λ" in solver.spent:  # where this begins
            raise NotConverged(solver.spent["λ"])
        ratio, slope, error = solver.ratio(0.0)
        guess = -ratio / slope if slope > 0 else math.copysign(1.0, -ratio)
        guess = min(max(guess, -OUTWARD), OUTWARD)
        outward |= {-OUTWARD, OUTWARD}
        if abs(ratio) > 2 * error and low < 0 < high:
            (low, high), signed = (0.0, high) if ratio < 0 else (low, 0.0), (0.0,)
    try:
        p = increasing_root(at, guess, (low, high), signed, OUTWARD)
        found = _index(p, *solved[p])
        if found.relative_error > solver.rtol and solver.mesh is None:
            tolerance = partial(_share_of, PRECISE * solver.rtol * solved[p][1] * max(1.0, abs(p)))
            p = increasing_root(partial(at, tolerance=tolerance), p, ends)
            found = _index(p, *solved[p])
    except Missing as missing:
        cause: Any = missing.__cause__
        raise cause from None
    except NoRoot as none:
        if none.missing is None:
            return Absent(Message(Code.NO_ROOT, low=ends[0], high=ends[1], is_bounded=noise.is_bounded))
        if isinstance(none.missing.__cause__, OverBudget):
            raise none.missing.__cause__ from None
        low, high = (ends[0], none.last) if none.is_negative else (none.last, ends[1])
        return Absent(Message(Code.NO_ROOT_REACHED, low=low, high=high, reason=_not_resolved(none.missing)))
    ratio, slope, error = solved[p]
    curve = (np.array([number]) for number in (p, p * ratio, ratio + p * slope, abs(p) * error))
    if obstacle := contradiction(solver, *curve):
        raise NotConverged(obstacle, remedy=solver.refinement)
    return checked(found, solver.refinement)


def _index(p: float, ratio: float, slope: float, error: float) -> Estimate:
    """δ_p by Λ(p)/p next to it, its slope and error."""
    return Estimate(p, error / slope + abs(ratio / slope), scale=1.0, quantity=STABILITY_INDEX)


def _rough_ratio(solver: ExponentSolver, p: float) -> tuple[float, float, float]:
    """Λ(p)/p, its slope and error, which tell the sign; as `_precise_ratio` does where that is not enough."""
    ratio, slope, error = solver.ratio(p, lambda p, value: max(ROUGH * abs(value), solver.tolerance(p, value)))
    return (ratio, slope, error) if abs(ratio) > 2 * error and slope > 0 else _precise_ratio(solver, p, None)


def _not_resolved(missing: Missing) -> Message:
    """Why Λ(p) is not. Raises `OverBudget` where that is of more than δ_p."""
    failure = missing.__cause__
    if isinstance(failure, NotConverged):
        return failure.message
    assert isinstance(failure, OverBudget)
    if failure.countdown is not under_way():
        raise failure
    told = Message(Code.NUMBER_SPENT, symbol=moment_at(missing.args[0]).symbol, reason=failure.reason)
    return NotConverged(told, remedy=Remedy.BUDGET).message


def _precise_ratio(solver: ExponentSolver, p: float, tolerance: Tolerance | None) -> tuple[float, float, float]:
    """Λ(p)/p, its slope and error within a tolerance; within that of rtol where that of δ_p is out of reach."""
    with suppress(NotConverged):
        return solver.ratio(p, tolerance)
    return solver.ratio(p)


def _share_of(most: float, p: float, value: float) -> float:
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
        rtol: |error| ≤ rtol·max(|Λ|, the terms of Eq. (37) before they cancel); None is 1e-8, under two noises
            that are not white 1e-6, for more than two variables 1e-5.
        mesh: a mesh for all p, where an `error_estimate` above rtol gives a warning; None chooses one that meets rtol.
        budget: what the choice of a mesh may cost; None for the default one.

    Many p are interpolated, see `MomentLyapunovFunction`, where that saves solves; then `pairs` solves each p.

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
    if points.size > FEW_MOMENTS and solver.problem.dimension == 2 and len(solver.classes) < 2:
        ends = float(points.min()), float(points.max())
        with suppress(NotConverged):
            function = MomentLyapunovFunction(solver.problem, ends, solver=solver, most=round(WORTH * points.size))
            result = function.moments(points) if function.is_converged else None
            if result and result.warnings and solver.mesh is None:  # single solves round less
                result = None
    result = result or _one_by_one(solver, points, report, known)
    for each in reports:
        each()
    return result if points.size == asked.size else _at(result, asked)


def _at(result: MomentLyapunov, p: FloatArray) -> MomentLyapunov:
    """A result at p some of which are equal, without those that failed."""
    places = {each: i for i, each in enumerate(result.p.tolist())}
    index = [places[each] for each in p.tolist() if each in places]
    names = ("p", "value", "derivative", "error_estimate", "residual")
    return replace(result, **{name: getattr(result, name)[index] for name in names})


def _one_by_one(
    solver: ExponentSolver, p: FloatArray, progress: Callable[[], None], known: dict[float, Moment] | None
) -> MomentLyapunov:
    """Λ at each p by a solve of its own, if these are convex; Λ(0) = 0 even where its eigenpair failed."""
    result = solver.moments(p, progress=progress, known=known)
    columns = result.p, result.value, result.derivative, result.error_estimate
    obstacle = None
    if not result.failures:
        obstacle = broken_convexity(*columns, lambda: result.derivative_error) or contradiction(solver, *columns)
    if obstacle:
        return replace(result, failures=(Failure(None, message_of(obstacle).advising(solver.refinement)),))
    failures = tuple(failure for failure in result.failures if failure.p != 0)
    if len(failures) == len(result.failures):
        return result
    failed = {failure.p for failure in failures}
    place = [float(each) for each in p if each not in failed].index(0.0)
    row = {"p": 0.0, "value": 0.0, "derivative": np.nan, "error_estimate": 0.0, "residual": np.nan}
    with_zero: dict[str, Any] = {name: np.insert(getattr(result, name), place, number) for name, number in row.items()}
    return replace(result, failures=failures, **with_zero)
