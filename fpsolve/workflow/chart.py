"""Charts of where stability ends in a plane of two parameters: lines, their crossings, regions, closed forms."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from string import ascii_lowercase
from textwrap import wrap
from typing import Any

import numpy as np

from fpsolve.analysis.axis import Axis
from fpsolve.analysis.regions import P_BIFURCATIONS, Region, Regions, regions
from fpsolve.analysis.scan import Sample, Scan, scan_row
from fpsolve.analysis.stability import Boundary, Solve, crossed, is_of_line, untraced
from fpsolve.analysis.target import Target
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.sections import ChartSection
from fpsolve.data import short_names
from fpsolve.drawing import COLOURS, Format, figure_for, label_axes, scale_axis
from fpsolve.errors import FpsolveError, NoPerturbationTheory
from fpsolve.exponent.kinds import choose
from fpsolve.files import writable, write_csv, write_json
from fpsolve.messages import Code, Message, message_of
from fpsolve.model.problem import Problem
from fpsolve.output.records import Records, answered, key_of, made, plain
from fpsolve.output.tables import head, in_case_words
from fpsolve.page.page import Block, Column, Drawing, Grid, Sentence
from fpsolve.pool import SERIAL, Pool
from fpsolve.results.text import plural
from fpsolve.show.notes import note_on
from fpsolve.theory.perturbation import second_order
from fpsolve.workflow.folders import CHART, kept, own_folder, saying_if_interrupted
from fpsolve.workflow.progress import NODES as SCANNED
from fpsolve.workflow.progress import POINTS, SILENT, Phase, Watch
from fpsolve.workflow.reports import shown_at_the_end, write_report

LINE_RECORDS = "records/charted.jsonl"
"""The file of the records of points of lines."""
POINT = Sample | Message
"""What is recorded of a point: F, or why there is none."""
FILES = "chart.csv", "chart.json"
"""The files with all numbers of a chart."""
CLOSED_FORM_NODES = 41
"""Of the grid, each way, on which the closed forms are evaluated."""
TINTS = ("#FFFFFF", "#F3EFE6", "#E9DFCB", "#DBCBAA", "#C9B388")
"""Of regions, the darker the more of the quantities grow there."""
UNKNOWN = "#C4C8CE"
"""Of the rest of a frame."""
NAMED = 0.01
"""Share of the frame from which on a region has room for a letter; smaller ones are in chart.json only."""
LETTER = 0.0125, 0.055
"""Width and height of a letter of a name, with what is free around it, in sides of the frame."""
CLOSED_FORM: dict[str, Any] = {"linestyle": (0, (2, 3)), "linewidth": 1.4, "zorder": 3}
"""The look of a closed form."""
FORM = Format(height=4.0)
"""The size of a figure."""
SPECIAL = {"fold": ("fold", "^"), "crossing": ("crossing", "o"), "at ": ("value asked for", "s")}
"""Beginnings of labels, what the legend calls such points, and their markers."""


@dataclass(frozen=True, eq=False)
class Chart:
    """What a case says of stability in a plane of two parameters.

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
            holes = [each for each in line.scan.reasons if each not in line.obstacles]
            found += [Message(Code.LINE_ENDS, line=line.target.equation, reason=each) for each in ends]
            found += [Message(Code.HOLES, symbol=line.target.symbol, reason=each) for each in holes]
        return tuple(message_of(each) for each in found if each)


def charted(case: Case) -> ChartSection:
    """The frame of a case and the lines in it. Raises `FpsolveError` where it has none."""
    if case.chart is not None:
        return case.chart
    raise FpsolveError(
        f'{case.path}: chart: missing; add [chart] with x = {{ key = "oscillator.omega", start = 0.3, '
        'stop = 5.0 }, y like it, and lines = ["moment(2) = 0"]'
    )


def refuse_no_chart(case: Case) -> None:
    """Refuse a case without a chart, or that varies another key than its two. Raises `FpsolveError`."""
    frame = charted(case)
    if set(case.vary.keys) - {frame.x.key, frame.y.key}:
        raise FpsolveError(
            f"{case.path}: vary: a chart has one set of the other parameters; remove [vary], or write --set vary={{}}"
        )


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
    own: dict[str, Any] = {"step": frame.step, "nodes": frame.nodes, "budget": case.budget}
    return [untraced(target, frame.x, frame.y, problem, **own) for target in frame.lines]


def solve_chart(
    case: Case,
    lines: Sequence[Boundary],
    rows: Iterator[Scan],
    *,
    progress: Callable[[], None] = lambda: None,
    stepped: Callable[[], None] = lambda: None,
    has_closed_forms: bool = True,
) -> Iterator[Chart]:
    """What there is so far, after each scan, branch and line, and in the end the whole chart.

    Args:
        case: with a chart, see `refuse_no_chart`.
        lines: see `begun_lines`.
        rows: what `scan_row` gives for the `rows` of all lines, in order.
        progress: called once for each node of each scan.
        stepped: called once for each point that is traced.
        has_closed_forms: whether they are found, too, which takes seconds.
    """
    axes = lines[0].x, lines[0].y
    chart = Chart((), _closed_forms(lines[0].problem, charted(case).lines, axes) if has_closed_forms else ())
    for each in lines:
        done = chart.lines
        for line in each.solve(rows, progress, stepped):
            chart = replace(chart, lines=(*done, line))
            yield chart
    whole = tuple(crossed(chart.lines))
    yield Chart(whole, chart.closed_forms, regions(whole), complete=all(line.complete for line in whole))


def _closed_forms(
    problem: Problem, targets: Sequence[Target], axes: tuple[Axis, Axis]
) -> tuple[tuple[FloatArray, ...], ...]:
    """The lines ε²Λ₂(p)/p = 0 in the parameters themselves, for noise that is reduced as in the paper."""
    from contourpy import contour_generator

    shares = np.linspace(0, 1, CLOSED_FORM_NODES)
    x, y = axes
    linear, quadratic = np.full((2, shares.size, shares.size), np.nan)
    for i, u in enumerate(shares):
        for j, v in enumerate(shares):
            try:
                here = problem.at({x.key: float(x.value(u)), y.key: float(y.value(v))})
                theory = second_order(here)
            except (ValueError, NoPerturbationTheory):  # no such problem, or not this form of one
                continue
            linear[j, i], quadratic[j, i] = theory.lyapunov_exponent, theory.quadratic
    found = []
    for target in targets:
        ratio = linear + target.order * quadratic
        values = np.ma.masked_invalid((target.p or 1.0) * ratio - target.level)
        lines: list[FloatArray] = contour_generator(shares, shares, values, line_type="Separate").lines(0.0)  # type: ignore[assignment]
        found.append(tuple(np.stack([x.value(line[:, 0]), y.value(line[:, 1])], axis=1) for line in lines))
    return tuple(found)


def key_of_line(case: Case, line: Boundary) -> str:
    """What the records of the points of a line are found by."""
    axes = (replace(axis, at=()) for axis in (line.x, line.y))
    return key_of(case.curve({}).digest, [repr(each) for each in (line.target, *axes, line.budget, line.rtol)])


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
            if not (isinstance(found, Message) and may_pass(found)):
                records.put(key, {name: plain(POINT, found)})
        return known[name]

    return replace(line, recall=recall)


def may_pass(reason: Message) -> bool:
    """Whether a reason may be gone the next time, so that it is not recorded."""
    return reason.tells_of(Code.NO_MEMORY) or reason.tells_of(Code.SECONDS_SPENT) or is_of_line(reason)


def scans_of(keys: Mapping[str, Boundary], records: Records, pool: Pool) -> Iterator[Scan]:
    """The rows of the scans of all lines, by the keys of these, in their order."""
    rows = {
        row: key_of(key, line.scan_rtol, row.count, row.number) for key, line in keys.items() for row in line.rows()
    }

    def keeps(scan: Scan) -> bool:
        return not any(map(may_pass, scan.reasons))

    found = answered(records, pool, scan_row, rows, kind=Scan, key=rows.__getitem__, keeps=keeps)
    return (replace(scan, seconds=0.0) if is_known else scan for _, scan, is_known in found)


def write_chart(case: Case, chart: Chart, folder: Path) -> None:
    """Write chart.csv, and chart.json, which says whether all is there."""
    rows = (
        [str(line.target), number, *map(float, point), label]
        for line in chart.lines
        for number, branch in enumerate(line.branches, start=1)
        for *point, label in zip(branch.x, branch.y, branch.width, branch.labels, strict=True)
    )
    write_csv(folder / "chart.csv", ["line", "branch", "x", "y", "width", "label"], rows)
    targets, frame = charted(case).lines, {"x": charted(case).x, "y": charted(case).y}
    keys = [axis.key for axis in frame.values()]
    summary = {
        **head(case),
        "complete": chart.complete,
        "planned": len(targets),
        "done": sum(line.complete for line in chart.lines),
        "parameters": {key: value for key, value in case.problem.values.items() if key not in keys},
        **{side: asdict(axis) for side, axis in frame.items()},
        "lines": [
            {
                "line": str(line.target),
                "equation": line.target.equation,
                "appears": _appears(line.target),
                "rtol": line.rtol,
                "scan": {
                    "nodes": [line.scan.nodes.size] * 2,
                    "rtol": line.scan_rtol,
                    "of_value": line.of_value,
                },
                "branches": [
                    {"points": branch.x.size, "closed": branch.closed, "obstacles": list(branch.obstacles)}
                    for branch in line.branches
                ],
                "obstacles": list(line.obstacles),
            }
            for line in chart.lines
        ],
        "closed_forms": [
            {"line": str(target), "equation": "(38)-(39)", "branches": [branch.tolist() for branch in branches]}
            for target, branches in zip(targets, chart.closed_forms, strict=True)
        ],
        "regions": [
            {"name": each.name, "signs": each.signs, "share": each.share}
            | {side: float(axis.value(at)) for (side, axis), at in zip(frame.items(), each.at, strict=True)}
            for each in (chart.regions.each if chart.regions else ())
        ],
        "warnings": in_case_words(chart.remarks),
    }
    write_json(folder / "chart.json", summary)


def chart_figure(case: Case, chart: Chart) -> Drawing:
    """chart.png and .pdf; none where there is no line."""
    keys = f"{charted(case).x.key} and {charted(case).y.key}"
    return Drawing(f"Where stability ends, over {keys}", partial(_draw, case, chart), "chart", case.headline)


def _draw(case: Case, chart: Chart, paths: Sequence[Path], heading: str) -> None:
    """The lines, their closed forms dashed, and the regions with names."""
    frame = charted(case).x, charted(case).y
    keys = frame[0].key, frame[1].key
    held = case.curve({}).held(case.units.time, keys)
    with figure_for(paths, heading, held, FORM) as figure:
        axes = figure.add_subplot()
        label_axes(axes, *(case.about(key).attributes for key in keys))
        for axis, side in zip((axes.xaxis, axes.yaxis), frame, strict=True):
            scale_axis(axis, side.scale, (side.start, side.stop))
        small = {} if chart.regions is None else _shade(axes, chart.regions, frame)
        for i, line in enumerate(chart.lines):
            colour, appears = COLOURS[i % len(COLOURS)], _appears(line.target)
            for branch in line.branches:
                axes.plot(*branch.path, color=colour, linewidth=2)
                for start, (_, marker) in SPECIAL.items():
                    chosen = np.array([start in label for label in branch.labels])
                    hollow = {"color": colour, "markersize": 7, "markerfacecolor": "white"}
                    axes.plot(branch.x[chosen], branch.y[chosen], marker, **hollow)
            if line.branches:
                name = f"{line.target.latex}: {appears}" if appears else line.target.latex
                axes.plot([], [], color=colour, linewidth=2, label=name)
            for points in chart.closed_forms[i]:
                axes.plot(points[:, 0], points[:, 1], color=colour, **CLOSED_FORM)
        if any(chart.closed_forms):
            words = "closed form, Eqs. (38)-(39), in the colour of its line"
            axes.plot([], [], label=words, color="0.35", **CLOSED_FORM)
        labels = [label for line in chart.lines for branch in line.branches for label in branch.labels]
        for start, (name, marker) in SPECIAL.items():
            if any(start in label for label in labels):
                axes.plot([], [], marker, label=name, color="0.35", markersize=7, markerfacecolor="none")
        for name, letter in small.items():
            axes.plot([], [], " ", label=f"{letter}: {name}")


def _shade(axes: Any, regions: Regions, frame: tuple[Axis, Axis]) -> dict[str, str]:
    """Draw a tint for each region, and its name, or where that has no room a letter; these by the names."""
    from matplotlib.colors import to_rgb

    x, y = frame
    edges, small = np.linspace(0, 1, regions.index.shape[0] + 1), dict[str, str]()
    unstable = (sum(sign > 0 for sign in each.signs.values()) for each in regions.each)
    tints = [TINTS[min(count, len(TINTS) - 1)] for count in unstable]
    colours = np.array([*map(to_rgb, (*tints, UNKNOWN))])[regions.index]  # -1 is the last one
    axes.pcolormesh(x.value(edges), y.value(edges), np.swapaxes(colours, 0, 1), rasterized=True)
    if (regions.index < 0).any():
        axes.fill([], [], color=UNKNOWN, label="not solved, or not defined")
    letters = iter(ascii_lowercase)
    for number, (each, tint) in enumerate(zip(regions.each, tints, strict=True)):
        box = {"facecolor": tint, "edgecolor": "none", "pad": 1.5, "alpha": 0.85}  # closed forms may cross the words
        middle: dict[str, Any] = {"ha": "center", "va": "center", "color": "0.15", "zorder": 4, "bbox": box}
        name = each.name.replace("δ_p", r"$\delta_p$")
        parts, size = name.split(", "), np.array(regions.index.shape)
        for lines in (parts, [line for part in parts for line in ([part] if "$" in part else wrap(part, 14))]):
            half = 0.5 * np.array([max(map(len, lines)) * LETTER[0], len(lines) * LETTER[1]])
            (left, low), (right, high) = (np.floor((each.at + end * half) * size).astype(int) for end in (-1, 1))
            covered = regions.index[left : right + 1, low : high + 1]
            if min(left, low) >= 0 and right < size[0] and high < size[1] and (covered == number).all():
                words, height = "\n".join(lines), 9.5
                break
        else:
            words, height = rf"$\mathbf{{{next(letters, 'z')}}}$" if each.share > NAMED else "", 12.0
            small |= {name: words} if words else {}
        axes.text(x.value(each.at[0]), y.value(each.at[1]), words, fontsize=height, **middle)
    return small


def _appears(target: Target) -> str | None:
    """Which bifurcation a value of δ_p is, if one."""
    return P_BIFURCATIONS.get(target.value) if target.kind == "stability_index" else None


def show(case: Case, chart: Chart) -> Iterator[Block]:
    """The regions from the largest to the smallest, and the lines with their special points."""
    targets = [line.target for line in chart.lines]
    yield Sentence("", case.headline)
    for each in () if chart.regions is None else chart.regions.each:
        yield Sentence(f"{each.share:.1%} of the frame: {each.name}.{region_meaning(each, targets)}")
    if chart.lines:
        yield chart_figure(case, chart)
    yield chart_grid(case, chart)
    yield from (note_on(case.name, each) for each in chart.remarks)


def chart_grid(case: Case, chart: Chart) -> Grid:
    """The branches of every line, and their special points."""
    keys = charted(case).x.key, charted(case).y.key
    names = short_names(keys)
    columns = [Column("line"), Column("branch", 1), Column("points", 2), *map(Column, names)]
    grid = Grid("", [*columns, Column("special point", is_text=True)])
    for line in chart.lines:
        for number, branch in enumerate(line.branches, start=1):
            count = f"{branch.x.size}{', closed' if branch.closed else ''}"
            grid.rows.append([line.target.equation, str(number), count, "", "", ""])
            for i, label in enumerate(branch.labels):
                if label:
                    for key, name in zip(keys, names, strict=True):
                        label = label.replace(f"{key} ", f"{name} ")
                    grid.rows.append(["", "", "", f"{branch.x[i]:.7g}", f"{branch.y[i]:.7g}", label])
            grid.ends.add(len(grid.rows) - 1)
    return grid


def region_meaning(region: Region, targets: Iterable[Target]) -> str:
    """What becomes in a region of a chart: "Almost every path decays and the mean square grows."."""
    told, signs = list[str](), set[int]()
    for target in sorted(targets, key=lambda each: (each.kind == "moment", each.p)):
        sign = region.signs.get(str(target), 0)
        if sign and target.kind != "stability_index" and not target.level:
            moment = "the mean square" if target.p == 2 else f"E‖x‖^{target.p:g}"
            told.append(
                f"{moment if target.kind == 'moment' else 'almost every path'} {'grows' if sign > 0 else 'decays'}"
            )
            signs.add(sign)
    carried = ", which rare paths carry" if len(signs) == 2 and told[0].endswith("path decays") else ""
    text = " and ".join([", ".join(told[:-1]), told[-1]] if len(told) > 1 else told)
    return f" {text[0].upper()}{text[1:]}{carried}." if told else ""


def traced(chart: Chart) -> str:
    """How many lines a chart has: "3 lines, 4 branches"."""
    branches = sum(len(line.branches) for line in chart.lines)
    return f"{len(chart.lines)} {plural('line', len(chart.lines))}, {branches} {plural('branch', branches)}"


def chart_case(
    case: Case,
    out: str | Path = "results",
    *,
    pool: Pool = SERIAL,
    watch: Watch = SILENT,
) -> Chart:
    """Trace the lines of the chart of a case, and write chart.csv, .json, .png and .pdf into `out`/<name of the case>/.

    The tables are written again after every branch. What an earlier chart wrote there is removed first, and what was
    solved or simulated with other parameters; but lines that it has finished are not traced again.

    Args:
        pool: who scans the plane.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
        FpsolveError: the case has no chart, or several curves; nothing is written.
        KeyboardInterrupt: its text says what is kept; the figure shows that.
    """
    refuse_no_chart(case)
    chart, lines, started = Chart((), ()), begun_lines(case), datetime.now(UTC)

    def done() -> str:
        count = sum(len(line.traces) for line in chart.lines)
        return kept(count, f"branch{'es' if count != 1 else ''} of {len(chart.closed_forms) or 'its'} lines", folder)

    def draw() -> None:
        if chart.lines:
            with writable(folder):
                chart_figure(case, chart).write(folder)
            write_report(case, folder, watch, show(case, chart), started=started, files=FILES, complete=chart.complete)

    with (
        own_folder(case, out, (CHART,)) as folder,
        saying_if_interrupted(done),
        watch.bar(Phase(case.name, "scan", sum(line.nodes**2 for line in lines), SCANNED)) as progress,
        watch.bar(Phase(case.name, "lines", unit=POINTS)) as stepped,
        writable(folder),
        pool,
    ):
        records = Records(folder / LINE_RECORDS)
        keys = {key_of_line(case, line): line for line in lines}
        lines = [recalled(records, *each) for each in keys.items()]
        with shown_at_the_end(draw):
            for chart in solve_chart(case, lines, scans_of(keys, records, pool), progress=progress, stepped=stepped):
                write_chart(case, chart, folder)
    return chart
