"""Where stability ends: the lines λ = 0, Λ(p) = 0 and δ_p = v in a frame of two parameters.

F is λ, or Λ(p)/p; δ_p = v is the line Λ(v) = 0. Its gradient is exact, see `analysis.sensitivity`. Other processes may
compute rows of a scan.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product
from typing import TYPE_CHECKING

import numpy as np

from fpsolve.analysis.axis import Axis, check_axes
from fpsolve.analysis.continuation import LONGEST, SHORTEST, Trace, find_branches, with_branch
from fpsolve.analysis.scan import Row, Sample, Scan, scan_row, scanned
from fpsolve.analysis.special_points import Placed, crossings, with_folds, with_points, with_values
from fpsolve.analysis.target import Distance, Target, is_none, target_of
from fpsolve.arrays import FloatArray, ReadOnly, is_whole, real_number, shown
from fpsolve.budget import Meter, OverBudget
from fpsolve.data import Result, brief, dataset
from fpsolve.drawing import label_axes, scale_axis
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import BUDGET, Budget
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import POINTS

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

SCAN_RTOL = 1e-5
"""Smallest error of F on the grid of a scan that is asked for, relative to its scale."""
ITS_SIGN = 0.3
"""Largest error of a dear F, over F, where its sign is sure."""
NODES, DEAR_NODES = 13, 7
"""Number of points of a scan, each way, and where F is dear."""
DEAR_STEP = 0.05
"""Longest step between two points of a line, in sides of the frame, where F is dear."""
LINE_KEY = "budget.line_seconds"
"""The key of a case that limits the time of a line."""
SCAN_SHARE = 0.5
"""Share of this time for the scan."""
LARGEST = 0.1
"""Step that may be asked for, in sides of the frame."""


Solve = Callable[[FloatArray], Sample | Message]
"""F at (u, v), or why there is none."""


def solved_anew(at: FloatArray, solve: Solve) -> Sample | Message:
    """F at a point of which nothing is known."""
    return solve(at)


@dataclass(frozen=True, eq=False, repr=False)
class Branch(ReadOnly):
    """One branch of a line.

    Attributes:
        x, y: the values of the two parameters, shape (n,).
        width: how far the line may be off, |error of F|/|∇F|, as a share of the sides of the frame, shape (n,).
        labels: what is special about a point: "leaves the frame", "fold in x", "fold in y", "at noise.D0 = 1",
            "crossing with moment(2) = 0"; empty for ordinary ones.
        closed: whether the last point is followed by the first.
        obstacles: why it ends inside of the frame, if it does.
    """

    x: FloatArray
    y: FloatArray
    width: FloatArray
    labels: tuple[str, ...]
    closed: bool = False
    obstacles: tuple[Message, ...] = ()

    @property
    def path(self) -> tuple[FloatArray, FloatArray]:
        """x and y, of a closed one the first point again at the end."""
        x, y = (np.append(each, each[: self.closed]) for each in (self.x, self.y))
        return x, y

    def __repr__(self) -> str:
        return brief(self, f"{self.x.size} points{', closed' * self.closed}")


@dataclass(frozen=True, eq=False, repr=False)
class Boundary(Result):
    """A line F = 0 in a frame of two parameters; it pickles.

    Attributes:
        target: what F is.
        x, y: the frame.
        problem: with the values of the other parameters.
        scan: F on the grid in which its branches are looked for.
        traces: its branches, in shares of the sides of the frame.
        step: the longest step between two points, in sides of the frame.
        budget: for a solve, and for the line.
        seconds: of the processor, that the scan and the branches took.
        obstacles: why branches that the scan shows may be missing.
        complete: whether all branches that the scan shows are there.
        recall: gives F at a point that was solved earlier, or else solves it.
    """

    target: Target
    x: Axis
    y: Axis
    problem: Problem
    scan: Scan
    traces: tuple[Trace, ...] = ()
    step: float = LONGEST
    budget: Budget = BUDGET
    seconds: float = 0.0
    obstacles: tuple[Message, ...] = ()
    complete: bool = False
    recall: Callable[[FloatArray, Solve], Sample | Message] = solved_anew

    @property
    def branches(self) -> tuple[Branch, ...]:
        """The branches in the parameters themselves."""
        found = []
        for trace in self.traces:
            u, v, width = np.array([(*point.at, point.width) for point in trace.points]).T
            labels = tuple(point.label for point in trace.points)
            found.append(Branch(self.x.value(u), self.y.value(v), width, labels, trace.closed, trace.obstacles))
        return tuple(found)

    @property
    def rtol(self) -> float:
        """The error of F on the line that is wanted, relative to its scale."""
        return choose(self.problem).line_rtol(self.target.order)

    @property
    def of_value(self) -> float:
        """The error of F that is enough away from the line, over F: of a dear F its sign does there."""
        return ITS_SIGN if choose(self.problem).is_dear(self.target.order) and not self.target.level else 0.0

    @property
    def scan_rtol(self) -> float:
        """The error of F in the scan that is wanted, relative to its scale."""
        return max(SCAN_RTOL, self.rtol)

    @property
    def zero_field(self) -> ZeroField:
        """F over the unit square, and the rest of the time for the line."""
        most = self.budget.line_seconds or math.inf
        return ZeroField(self, self.rtol, most - self.seconds, Message(Code.LINE_SPENT, most=most))

    def remark(self) -> str:
        """That there is no line, or not all of it, as a `Message`, or an empty text."""
        exists = np.isfinite(self.scan.values)
        if self.obstacles and exists.any():
            return Message(Code.LINE_STOPPED, line=self.target.equation, reason=self.obstacles[0])
        if self.obstacles:
            return Message(Code.UNSOLVED, symbol=self.target.symbol, reason=self.obstacles[0])
        if self.traces:
            return ""
        values = self.scan.values[exists]
        if not values.size:
            return Message(Code.NOWHERE, symbol=self.target.symbol)
        if np.any(values > 0) and np.any(values < 0):
            return Message(Code.NO_LINE, line=self.target.equation, symbol=self.target.symbol)
        return Message(Code.ONE_SIGN, side=self.target.side(float(values[0])), is_whole=bool(exists.all()))

    @property
    def nodes(self) -> int:
        """The number of points of a scan, each way."""
        return self.scan.nodes.size

    def rows(self) -> list[Row]:
        """The rows of its scan, tasks for `scan_row`, each of which begins anew; they pickle small."""
        count = self.nodes
        share = SCAN_SHARE * (self.budget.line_seconds or math.inf) / count
        seconds, key = min((self.budget.seconds, "budget.seconds"), (share, LINE_KEY))
        spent = Message(Code.ROW_SPENT, most=seconds, key=key)
        return [Row(ZeroField(self, self.scan_rtol, seconds, spent), count, number) for number in range(count)]

    def solve(
        self,
        rows: Iterator[Scan] | None = None,
        progress: Callable[[], None] = lambda: None,
        stepped: Callable[[], None] = lambda: None,
    ) -> Iterator[Boundary]:
        """The scan, then one branch after the other, and the whole line: what there is so far, each time.

        Args:
            rows: what `scan_row` gives for its `rows`, in order, of which no more are taken; None to scan them here.
            progress: called once for each node of the scan.
            stepped: called once for each point of a branch.
        """
        scan = scanned(self.nodes, map(scan_row, self.rows()) if rows is None else rows, progress)
        now = replace(self, scan=scan, traces=(), seconds=scan.seconds, obstacles=(), complete=False)
        yield now
        zero_field = now.zero_field
        for trace in find_branches(zero_field, scan, self.step, stepped):
            now = replace(now, traces=with_branch(now.traces, self._special(zero_field, trace)))
            yield now
        obstacles = [] if zero_field.stopped is None else [zero_field.stopped]
        is_empty = not np.isfinite(scan.values).any()
        obstacles += [each for each in scan.reasons if is_of_line(each) or (is_empty and not is_none(each))]
        seconds = now.seconds + zero_field.seconds
        yield replace(now, seconds=seconds, obstacles=tuple(obstacles), complete=not obstacles)

    def _special(self, zero_field: ZeroField, trace: Trace) -> Trace:
        """A branch with its folds, and the points that the axes ask for."""
        trace = with_folds(zero_field, trace, ("x", "y"))
        for number, axis in enumerate((self.x, self.y)):
            wanted = [(axis.share(value), f"at {axis.key} = {value:.12g}") for value in axis.at]
            trace = with_values(zero_field, trace, number, wanted)
        return trace

    def to_xarray(self) -> xarray.Dataset:
        """The points of all branches, one after the other, with the line, the branch and the label of each."""
        branches = self.branches
        numbers = np.repeat(np.arange(1, len(branches) + 1), [branch.x.size for branch in branches])
        sides = [self.problem.parameters[axis.key].quantity for axis in (self.x, self.y)]
        x, y = (replace(side, name=name, dims=("point",)) for side, name in zip(sides, "xy", strict=True))
        variables = {
            quantity: np.concatenate([np.zeros(0), *(getattr(branch, of) for branch in branches)])
            for quantity, of in ((x, "x"), (y, "y"), (POINTS["width"], "width"))
        }
        coordinates = {
            POINTS["line"]: np.full(numbers.size, str(self.target)),
            POINTS["branch"]: numbers,
            POINTS["label"]: np.array([label for branch in branches for label in branch.labels], dtype=str),
        }
        fixed = {key: value for key, value in self.problem.values.items() if key not in (self.x.key, self.y.key)}
        closed = ", ".join(str(number) for number, branch in enumerate(branches, start=1) if branch.closed)
        found = dataset(
            "line of stability",
            "finite elements",
            variables,
            coordinates,
            fixed,
            line=self.target.equation,
            closed_branches=closed,
            remark=self.remark(),
        )
        found.x.attrs["key"], found.y.attrs["key"] = self.x.key, self.y.key
        return found

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: object) -> None:
        gap = np.full((2, 1), np.nan)
        parts = [part for branch in self.branches for part in (gap, branch.path)][1:] or [gap]
        [line] = axes.plot(*np.hstack(parts), label=self.target.latex)
        line.set(**kwargs)
        label_axes(axes, found.x.attrs, found.y.attrs)
        for side, axis in ((axes.xaxis, self.x), (axes.yaxis, self.y)):
            scale_axis(side, axis.scale, (axis.start, axis.stop))
        axes.legend()

    def _said(self) -> str:
        branches = f"{len(self.traces)} branch{'es' * (len(self.traces) != 1)}"
        return f"{self.target.equation}: {branches} over {self.x.key} and {self.y.key}"


class ZeroField:
    """F of a line over the unit square, with its gradient.

    Args:
        line: the target, the frame, and what a solve may cost.
        rtol: of F, relative to its scale.
        seconds: of the processor for all values together; each may take half of what is left, and what a set may.
        spent: what is said where they do not suffice.

    Attributes:
        seconds: of the processor, so far.
        stopped: what was said, or None.
    """

    def __init__(self, line: Boundary, rtol: float, seconds: float, spent: Message) -> None:
        self._line, self._rtol, self._most, self._spent = line, rtol, seconds, spent
        keys, of_value = [line.x.key, line.y.key], line.of_value
        self._distance = Distance(line.problem, line.target, keys, rtol=rtol, of_value=of_value, budget=line.budget)
        self.seconds, self.stopped = 0.0, None if seconds > 0 else spent

    def __call__(self, at: FloatArray) -> Sample:
        """F at (u, v).

        Raises:
            FpsolveError: there is none, or the time does not suffice.
        """
        found = self._line.recall(at, self._solved)
        if isinstance(found, Message):
            raise NotConverged(found)
        return found

    def _solved(self, at: FloatArray) -> Sample | Message:
        """F, or why there is none."""
        sides = list(zip((self._line.x, self._line.y), at.tolist(), strict=True))
        theta, slopes = np.array([(axis.value(share), axis.slope(share)) for axis, share in sides]).T
        left = 0.5 * (self._most - self.seconds)
        meter = Meter(min(left, self._line.budget.seconds), number=self._line.target.symbol)
        try:
            with meter.running():
                found = self._distance(theta)
        except FpsolveError as failure:
            if isinstance(failure, OverBudget) and meter.seconds == left:
                self.stopped = self._spent
                return self.stopped
            return failure.message
        finally:
            self.seconds += meter.spent
        return found._replace(at=at, gradient=found.gradient * slopes, rtol=self._rtol)


def boundary(
    problem: Problem,
    target: str,
    x: Axis,
    y: Axis,
    *,
    step: float | None = None,
    nodes: int | None = None,
    budget: Budget | None = None,
    progress: Callable[[], None] = lambda: None,
) -> Boundary:
    """The line λ = 0, Λ(p) = 0 or δ_p = v in a frame of two parameters.

    >>> from fpsolve.analysis import Axis
    >>> x, y = Axis("oscillator.c1", -2.0, 2.0), Axis("noise.sigma", 0.5, 2.0)
    >>> boundary(problem, "lyapunov_exponent = 0", x, y, nodes=5)
    Boundary(λ = 0: 1 branch over oscillator.c1 and noise.sigma)

    Args:
        problem: a motion and its noise, whose other parameters are fixed.
        target: such as "lyapunov_exponent = 0", "moment(2) = 0" or "stability_index = -1".
        x, y: the frame.
        step: the longest step between two points, in sides of the frame; 0.02 if omitted, or 0.05 if F needs
            elements of three axes.
        nodes: of the grid in which branches are looked for, each way; if omitted 13, or 7.
        budget: for a solve, and for the line: beyond its `line_seconds` what is traced is returned, with `obstacles`.
        progress: called once for each node of the grid, and once for each point of a branch.

    Raises:
        ValueError: an axis is no parameter of the problem or out of its range, or both are the same. Or `target`,
            `step` or `nodes` is wrong.
    """
    check_axes(problem, x, y)
    if nodes is not None and not is_whole(nodes, 2):
        raise ValueError(f"got nodes = {shown(nodes)}; must be a whole number from 2")
    line = untraced(target_of(target), x, y, problem, step=step, nodes=nodes, budget=budget or Budget())
    *_, whole = line.solve(progress=progress, stepped=progress)
    return whole


def untraced(
    target: Target,
    x: Axis,
    y: Axis,
    problem: Problem,
    *,
    step: float | None,
    nodes: int | None,
    budget: Budget,
) -> Boundary:
    """A line of which nothing is traced, with the usual step and nodes where they are None. Raises `ValueError`."""
    dear = choose(problem).is_dear(target.order)
    step = (DEAR_STEP if dear else LONGEST) if step is None else step
    if not SHORTEST < real_number(step, "step") <= LARGEST:
        raise ValueError(f"got step = {step:g}; must be above {SHORTEST:g} and up to {LARGEST:g} sides of the frame")
    count = nodes or (DEAR_NODES if dear else NODES)
    scan = Scan(np.linspace(0, 1, count), np.zeros((0, 0)), np.zeros((0, 0, 2)))
    return Boundary(target, x, y, problem, scan, step=float(step), budget=budget)


def is_of_line(reason: Message) -> bool:
    """Whether the time for a line ended it, or a row of its scan."""
    return reason.code is Code.LINE_SPENT or (reason.code is Code.ROW_SPENT and reason.data["key"] == LINE_KEY)


def crossed(lines: Sequence[Boundary]) -> list[Boundary]:
    """Lines in one frame, each with the points that it has in common with the others."""
    new, each_field = defaultdict[tuple[int, int], list[Placed]](list), [line.zero_field for line in lines]
    for (i, first), (j, second) in combinations(enumerate(lines), 2):
        fields = each_field[i], each_field[j]
        for (a, trace), (b, crossing) in product(enumerate(first.traces), enumerate(second.traces)):
            for on_first, on_second in crossings(trace, crossing, fields):
                for key, (place, point), other in (((i, a), on_first, second), ((j, b), on_second, first)):
                    new[key].append((place, point._replace(label=f"crossing with {other.target}")))
    return [
        replace(
            line,
            traces=tuple(with_points(trace, new[i, a]) for a, trace in enumerate(line.traces)),
            recall=solved_anew,  # as records are of this process
        )
        for i, line in enumerate(lines)
    ]
