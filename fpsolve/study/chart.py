"""Charts: the lines of stability of a case, their crossings, regions, and the closed forms beside them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from fpsolve.analysis.regions import Regions, regions
from fpsolve.analysis.scan import Row, ScannedRow, scan_row
from fpsolve.analysis.stability import NODES, Boundary, crossed, empty_scan
from fpsolve.analysis.zero import Axis, Zero
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.sections import ChartSection
from fpsolve.errors import FpsolveError, NoPerturbationTheory
from fpsolve.messages import Code, Message, message_of
from fpsolve.model.problem import Problem
from fpsolve.theory.perturbation import second_order

Map = Callable[[Callable[[Row], ScannedRow], Iterable[Row]], Iterable[ScannedRow]]
"""The builtin `map`, or that of an executor: results in the order of the tasks."""
CLOSED_FORM_NODES = 41
"""Of the grid, each way, on which the closed forms are evaluated."""


@dataclass(frozen=True, eq=False)
class Chart:
    """What a case says of stability in a plane of two parameters.

    Attributes:
        lines: one for each entry of `zero` that is begun, in their order.
        closed_forms: for each entry of `zero` the branches of its closed form, Eqs. (38)-(39), each of shape (n, 2), in
            the parameters themselves.
        regions: once all lines are traced.
        complete: whether they are, none stopped by the budget.
    """

    lines: tuple[Boundary, ...]
    closed_forms: tuple[tuple[FloatArray, ...], ...]
    regions: Regions | None = None
    complete: bool = False

    @property
    def failures(self) -> tuple[Message, ...]:
        """Why lines end inside of the frame, or may lack branches."""
        obstacles = [text for line in self.lines for trace in line.traces for text in trace.obstacles]
        return (*obstacles, *(text for line in self.lines for text in line.obstacles))

    @property
    def remarks(self) -> tuple[Message, ...]:
        """What has no line, which lines end inside of the frame, and where no F exists, with the reasons."""
        found = [line.remark() for line in self.lines if line.complete or line.obstacles]
        for line in self.lines:
            reasons = (text for trace in line.traces for text in trace.obstacles)
            ends = dict.fromkeys(each for each in reasons if each not in line.obstacles)
            holes = [each for each in line.scan.reasons if each not in line.obstacles] if line.scan else []
            found += [Message(Code.LINE_ENDS, line=line.zero.equation, reason=each) for each in ends]
            found += [Message(Code.HOLES, symbol=line.zero.symbol, reason=each) for each in holes]
        return tuple(message_of(each) for each in found if each)


def charted(case: Case) -> ChartSection:
    """The frame of a case and the lines in it. Raises `FpsolveError` where it has none."""
    if case.chart is not None:
        return case.chart
    raise FpsolveError(
        f'{case.path}: chart: missing; add [chart] with x = {{ key = "oscillator.omega", start = 0.3, '
        'stop = 5.0 }, y like it, and zero = ["lyapunov_exponent", { moment = 2.0 }]'
    )


def refuse_no_chart(case: Case) -> None:
    """Refuse a case without a chart, or that varies another key than its two. Raises `FpsolveError`."""
    frame = charted(case)
    if set(case.vary.keys) - {frame.x.key, frame.y.key}:
        raise FpsolveError(
            f"{case.path}: vary: a chart has one set of the other parameters; remove [vary], or write --set vary={{}}"
        )


def chart_work(case: Case) -> int:
    """How often `solve_chart` reports progress: once for each node of each scan."""
    frame = charted(case)
    return (frame.nodes or NODES) ** 2 * len(frame.zero)


def solve_chart(
    case: Case,
    *,
    progress: Callable[[], None] = lambda: None,
    stepped: Callable[[], None] = lambda: None,
    map: Map = map,
    known: Callable[[Boundary], Boundary | None] = lambda _: None,
) -> Iterator[Chart]:
    """What there is so far, after each scan, branch and line, and in the end the whole chart.

    Args:
        case: with a chart, see `refuse_no_chart`.
        progress: called once for each node of each scan, see `chart_work`.
        stepped: called once for each point that is traced.
        map: computes the rows of all scans, as the builtin does or in other processes, while branches are traced here.
        known: gives a line that an earlier run has finished.
    """
    frame = charted(case)
    x, y = frame.x.axis, frame.y.axis
    curve = case.curve({})
    problem = curve.problem
    chart = Chart((), _closed_forms(problem, frame.zero, (x, y)))
    scan = empty_scan(frame.nodes) if frame.nodes else None
    begun = [Boundary(zero, x, y, problem, scan=scan, budget=case.budget) for zero in frame.zero]
    finished = [known(line) for line in begun]
    tasks = [row for line, earlier in zip(begun, finished, strict=True) if earlier is None for row in line.rows()]
    rows = iter(map(scan_row, tasks))
    for each, earlier in zip(begun, finished, strict=True):
        done = chart.lines
        if earlier is not None:
            chart = replace(chart, lines=(*done, earlier))
            yield chart
            continue
        for line in each.solve(rows, progress, stepped):
            chart = replace(chart, lines=(*done, line))
            yield chart
    lines = tuple(crossed(chart.lines))
    yield Chart(lines, chart.closed_forms, regions(lines), complete=all(line.complete for line in lines))


def _closed_forms(
    problem: Problem, zeros: Sequence[Zero], axes: tuple[Axis, Axis]
) -> tuple[tuple[FloatArray, ...], ...]:
    """The lines ε²Λ₂(p)/p = 0 in the parameters themselves, for noise that is reduced as in the paper."""
    from contourpy import contour_generator

    shares = np.linspace(0, 1, CLOSED_FORM_NODES)
    x, y = axes
    linear, quadratic = np.full((2, shares.size, shares.size), np.nan)
    for i, u in enumerate(shares):
        for j, v in enumerate(shares):
            try:
                theory = second_order(problem.at({x.key: float(x.value(u)), y.key: float(y.value(v))}))
            except (ValueError, NoPerturbationTheory):  # no such problem, or not this form of one
                continue
            linear[j, i], quadratic[j, i] = theory.lyapunov_exponent, theory.quadratic
    found = []
    for zero in zeros:
        values = np.ma.masked_invalid(linear + zero.p * quadratic)
        lines: list[FloatArray] = contour_generator(shares, shares, values, line_type="Separate").lines(0.0)  # type: ignore[assignment]
        found.append(tuple(np.stack([x.value(line[:, 0]), y.value(line[:, 1])], axis=1) for line in lines))
    return tuple(found)
