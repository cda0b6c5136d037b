"""Charts: the lines on which stability ends in a plane of two parameters, each point of which is solved once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from contourpy import contour_generator

from fpsolve.analysis.axis import check_axes
from fpsolve.analysis.regions import P_BIFURCATIONS, Regions, regions
from fpsolve.analysis.scan import Sample, Scan, scan_row
from fpsolve.analysis.stability import Boundary, Solve, crossed, is_of_line, untraced
from fpsolve.analysis.target import Target
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.sections import ChartSection
from fpsolve.errors import NoPerturbationTheory
from fpsolve.exponent.kinds import choose
from fpsolve.messages import Code, Message, message_of
from fpsolve.model.faults import TableError
from fpsolve.pool import Pool
from fpsolve.solve.records import Records, answered, key_of, made, plain
from fpsolve.theory.perturbation import second_order

LINE_RECORDS = "records/charted.jsonl"
"""The file of the records of points of lines."""
POINT = Sample | Message
"""What is recorded of a point: F, or why there is none."""
CLOSED_FORM_NODES = 41
"""Of the grid, each way, on which the closed forms are evaluated."""


@dataclass(frozen=True, eq=False)
class Chart:
    """Stability in a plane of two parameters.

    Attributes:
        lines: one for each entry of `lines` that is begun, in their order.
        closed_forms: for each of them the branches of its closed form, Eqs. (38)-(39), each of shape (n, 2), in the
            parameters themselves.
        regions: once all lines are traced.
        complete: whether they are, none stopped by the budget.
    """

    lines: tuple[Boundary, ...]
    closed_forms: tuple[tuple[FloatArray, ...], ...]
    regions: Regions | None = None
    complete: bool = False

    @property
    def fails(self) -> bool:
        """Whether a line ends too early, or nothing was found: F of no line exists anywhere in the frame."""
        return bool(self.failures) or not any(np.isfinite(line.scan.values).any() for line in self.lines)

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
            holes = {each.code: each for each in line.scan.reasons if each not in line.obstacles}  # one of a kind
            found += [Message(Code.LINE_ENDS, line=line.target.equation, reason=each) for each in ends]
            found += [Message(Code.HOLES, symbol=line.target.symbol, reason=each) for each in holes.values()]
        return tuple(message_of(each) for each in found if each)


def charted(case: Case) -> ChartSection:
    """The frame of a case and the lines in it. Raises `CaseError` where it has none."""
    if case.chart is not None:
        return case.chart
    raise case.refusal(
        'missing; add [chart] with x = { key = "oscillator.omega", start = 0.3, stop = 5.0 }, y like it, and '
        'lines = ["moment(2) = 0"]',
        "chart",
    )


def refuse_no_chart(case: Case) -> None:
    """Refuse a case without a chart, or whose axes span no frame, or that varies another key than these two.

    Raises:
        CaseError: it is such a case.
    """
    frame, problem = charted(case), case.problem
    try:
        check_axes(problem, frame.x, frame.y)
    except TableError as failure:
        raise case.refusal(failure.text, "chart", *failure.path) from None
    if set(case.vary.keys) - {frame.x.key, frame.y.key}:
        text = "a chart has one set of the other parameters; remove [vary], or write --set vary={}"
        raise case.refusal(text, "vary")


def dear_lines(case: Case) -> Message | None:
    """What the lines of a chart cost whose points take seconds; None where there are none."""
    if not (dear := [line for line in begun_lines(case) if choose(line.problem).is_dear(line.target.order)]):
        return None
    nodes, few = sum(line.nodes**2 for line in dear), round(1 / dear[0].step)
    equations = [line.target.equation for line in dear]
    return Message(Code.DEAR_CHART, lines=equations, nodes=nodes, few=few, many=3 * few)


def begun_lines(case: Case) -> list[Boundary]:
    """The lines of a chart, of which nothing is traced."""
    frame, problem = charted(case), case.problem
    begun = partial(untraced, step=frame.step, nodes=frame.nodes, budget=case.budget)
    return [begun(target, frame.x, frame.y, problem) for target in frame.lines]


def solve_chart(
    lines: Sequence[Boundary],
    rows: Iterator[Scan],
    closed_forms: tuple[tuple[FloatArray, ...], ...] = (),
    *,
    progress: Callable[[], None] = lambda: None,
    stepped: Callable[[], None] = lambda: None,
) -> Iterator[Chart]:
    """What there is so far, after each scan, branch and line, and in the end the whole chart.

    Args:
        lines: see `begun_lines`.
        rows: what `scan_row` gives for the `rows` of all lines, in order.
        closed_forms: see `closed_forms_of`.
        progress: called once for each node of each scan.
        stepped: called once for each point that is traced.
    """
    done: tuple[Boundary, ...] = ()
    for each in lines:
        for line in each.solve(rows, progress, stepped):
            yield Chart((*done, line), closed_forms)
        done = *done, line
    whole = tuple(crossed(done))
    yield Chart(whole, closed_forms, regions(whole), complete=all(line.complete for line in whole))


def closed_forms_of(lines: Sequence[Boundary]) -> tuple[tuple[FloatArray, ...], ...]:
    """The lines ε²Λ₂(p)/p = 0 in the parameters themselves, for noise that is reduced as in the paper."""
    problem, x, y = lines[0].problem, lines[0].x, lines[0].y
    shares = np.linspace(0, 1, CLOSED_FORM_NODES)

    def theory(u: float, v: float) -> tuple[float, float]:
        try:
            found = second_order(problem.at({x.key: float(x.value(u)), y.key: float(y.value(v))}))
        except (ValueError, NoPerturbationTheory):  # no such problem, or not this form of one
            return math.nan, math.nan
        return found.lyapunov_exponent, found.quadratic

    linear, quadratic = np.moveaxis(np.array([[theory(u, v) for u in shares] for v in shares]), -1, 0)

    def branches(target: Target) -> tuple[FloatArray, ...]:
        values = (target.p or 1.0) * (linear + target.order * quadratic) - target.level
        found: list[FloatArray] = contour_generator(shares, shares, np.ma.masked_invalid(values)).lines(0.0)  # type: ignore[assignment]
        return tuple(np.stack([x.value(line[:, 0]), y.value(line[:, 1])], axis=1) for line in found)

    return tuple(branches(line.target) for line in lines)


def key_of_line(case: Case, line: Boundary) -> str:
    """What the records of the points of a line are found by."""
    axes = (replace(axis, at=()) for axis in (line.x, line.y))
    return key_of(case.parameter_set({}).digest, [repr(each) for each in (line.target, *axes, line.budget, line.rtol)])


def recalled(records: Records, key: str, line: Boundary) -> Boundary:
    """The line, of which each point is solved once for all runs."""
    known = dict[str, Sample | Message]()
    for name, each in records.get(key).items():
        with suppress(ValueError):  # which counts as none
            known[name] = made(POINT, each)

    def recall(at: FloatArray, solve: Solve) -> Sample | Message:
        name = str(at.tolist())
        if name not in known:
            known[name] = found = solve(at)
            if not (isinstance(found, Message) and _may_pass(found)):
                records.put(key, {name: plain(POINT, found)})
        return known[name]

    return replace(line, recall=recall)


def _may_pass(reason: Message) -> bool:
    """Whether a reason may be gone the next time, so that it is not recorded."""
    return reason.tells_of(Code.NO_MEMORY) or reason.tells_of(Code.SECONDS_SPENT) or is_of_line(reason)


def scans_of(keys: Mapping[str, Boundary], records: Records, pool: Pool) -> Iterator[Scan]:
    """The rows of the scans of all lines, by the keys of these, in their order."""
    rows = {
        row: key_of(key, line.scan_rtol, row.count, row.number) for key, line in keys.items() for row in line.rows()
    }
    how = answered(
        records, pool, scan_row, rows, kind=Scan, key=rows.__getitem__,
        keeps=lambda scan: not any(map(_may_pass, scan.reasons)),
    )  # fmt: skip
    return (replace(scan, seconds=0.0) if is_known else scan for _, scan, is_known in how)


def appears(target: Target) -> str | None:
    """Which bifurcation a value of δ_p is, if one."""
    return P_BIFURCATIONS.get(target.value) if target.kind == "stability_index" else None
