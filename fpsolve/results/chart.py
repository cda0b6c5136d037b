"""The files of a chart: chart.csv, chart.json."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.files import write_csv, write_json
from fpsolve.results.csv_json import head
from fpsolve.solve.chart import Chart, appears, charted

FILES = "chart.csv", "chart.json"
"""The files with all numbers of a chart."""


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
