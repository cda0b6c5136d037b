"""Trace where stability ends in a plane of two parameters."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.commands.errors import NOT_CONVERGED
from fpsolve.commands.options import (
    FLAGS,
    Cases,
    Done,
    Flags,
    kept,
    on_cases,
    saying_if_interrupted,
)
from fpsolve.files import writable, write_csv, write_json
from fpsolve.pool import SERIAL, Pool
from fpsolve.results.csv_json import head
from fpsolve.results.folders import own_folder
from fpsolve.solve.chart import (
    LINE_RECORDS,
    Chart,
    appears,
    begun_lines,
    charted,
    closed_forms_of,
    dear_lines,
    key_of_line,
    recalled,
    refuse_no_chart,
    scans_of,
    solve_chart,
)
from fpsolve.solve.records import Records
from fpsolve.tell.chart import chart_figure, show, traced
from fpsolve.tell.notes import note_on
from fpsolve.tell.progress import NODES as SCANNED
from fpsolve.tell.progress import POINTS, SILENT, Phase, Watch
from fpsolve.tell.reports import shown_at_the_end, write_report
from fpsolve.tell.terminal import print_blocks

FILES = "chart.csv", "chart.json"
"""The files with all numbers of a chart."""


def chart_case(
    case: Case,
    out: str | Path = "results",
    *,
    pool: Pool = SERIAL,
    watch: Watch = SILENT,
) -> Chart:
    """Trace the lines of the chart of a case, and write chart.csv, .json, .png and .pdf into `out`/<name of the case>/.

    It writes the tables again after every branch. It first removes the files of an earlier chart and those of other
    parameters, but does not repeat finished lines.

    Args:
        pool: who scans the plane.

    Raises:
        OutputError: the folder cannot be made or written to, or another run writes into it.
        FpsolveError: the case has no chart, or several parameter sets; nothing is written.
        KeyboardInterrupt: its text says what is kept; the figure shows that.
    """
    refuse_no_chart(case)
    chart, lines, started, folder = Chart((), ()), begun_lines(case), datetime.now(UTC), Path(out) / case.name

    def done() -> str:
        count = sum(len(line.traces) for line in chart.lines)
        return kept(count, f"branch{'es' if count != 1 else ''} of {len(chart.closed_forms) or 'its'} lines", folder)

    def draw() -> None:
        if chart.lines:
            with writable(folder):
                chart_figure(case, chart).write(folder)
            blocks, done = show(case, chart), chart.complete
            write_report(case, folder, watch, blocks, started=started, files=FILES, complete=done, name="chart.html")

    with (
        own_folder(folder, "chart", case=case),
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
            rows, closed = scans_of(keys, records, pool), closed_forms_of(lines)
            for chart in solve_chart(lines, rows, closed, progress=progress, stepped=stepped):
                write_chart(case, chart, folder)
    return chart


def write_chart(case: Case, chart: Chart, folder: Path) -> None:
    """Write chart.csv, and chart.json, which says whether all is there."""
    rows = (
        [str(line.target), number, *map(float, point), label]
        for line in chart.lines
        for number, branch in enumerate(line.branches, start=1)
        for *point, label in zip(branch.x, branch.y, branch.width, branch.labels, strict=True)
    )
    write_csv(folder / "chart.csv", ["line", "branch", "x", "y", "width", "label"], rows)
    section = charted(case)
    targets, frame = section.lines, {"x": section.x, "y": section.y}
    keys = section.x.key, section.y.key
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
                "appears": appears(line.target),
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
        "warnings": chart.remarks,
    }
    write_json(folder / "chart.json", summary)


def chart(
    cases: Cases,
    *,
    flags: Flags = FLAGS,
) -> int:
    """Trace where stability ends in a plane of two parameters; write chart.csv, .json, .png and .pdf into OUT/<case>/.

    [budget] line_seconds limits a line: the command keeps its points up to
    then, and the exit code is 3.
    [budget] seconds limits a row of points of the grid; a point may take half
    of the rest of its row.
    Both limits are processor time.

    Example: fpsolve chart cases/chart.toml --set chart.x.stop=3.0
    """
    is_quiet = flags.options.quiet

    def work(case: Case, pool: Pool) -> Done:
        if not is_quiet and (dear := dear_lines(case)):
            print_blocks([note_on(case.name, dear)])
        found = chart_case(case, flags.out, pool=pool, watch=flags.watch())
        failures = (note_on(case.name, each) for each in dict.fromkeys(found.failures))
        print_blocks(failures if is_quiet else show(case, found))
        return Done(traced(found), NOT_CONVERGED if found.fails else 0)

    return on_cases(cases, flags.options, work, refuse=refuse_no_chart, workers=flags.workers, out=flags.out)
