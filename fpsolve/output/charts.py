"""Charts of stability as files: chart.csv, chart.json, chart.png and chart.pdf."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import numpy as np

from fpsolve.analysis.regions import P_BIFURCATIONS, Regions
from fpsolve.analysis.stability import SCAN_RTOL, Boundary
from fpsolve.analysis.zero import RTOL, Axis, Zero
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.curves import Curve
from fpsolve.case.figure import fixed
from fpsolve.case.sections import Varied
from fpsolve.drawing import COLOURS, Format, figure_for, label_axes, scale_axis
from fpsolve.files import write_csv, write_json
from fpsolve.model.kinds import parameter_of
from fpsolve.output.tables import head, in_case_words
from fpsolve.study.chart import Chart, charted

_TINTS = ("#FFFFFF", "#F3EFE6", "#E9DFCB", "#DBCBAA", "#C9B388")
"""Of regions, the darker the more of the quantities grow there."""
_ROOMY, _NAMED = 0.15, 0.01
"""Shares of the frame from which on a region has room for its name, or for a letter; others are in chart.json only."""
_CLOSED_FORM: dict[str, Any] = {"linestyle": (0, (2, 3)), "color": "black", "linewidth": 1.1, "zorder": 3}
_LETTER: dict[str, Any] = {"linestyle": "none", "markeredgewidth": 0, "color": "0.15"}
_SPECIAL = {"fold": ("fold", "^"), "crossing": ("crossing", "o"), "at ": ("value asked for", "s")}
"""Beginnings of labels, what the legend calls such points, and their markers."""


def write_chart(case: Case, chart: Chart, folder: Path) -> None:
    """chart.csv and chart.json, which says whether all is there."""
    write_csv(folder / "chart.csv", ["line", "branch", "x", "y", "width", "label"], _rows(chart))
    write_json(folder / "chart.json", {**head(case), **_summary(case, chart)})


def draw_chart(case: Case, chart: Chart, folder: Path) -> None:
    """chart.png and chart.pdf: the lines, their closed forms dashed, and the regions with their names."""
    frame, unit = (charted(case).x.axis, charted(case).y.axis), case.figure.time_unit
    keys = frame[0].key, frame[1].key
    held = held_in_words(case.curve({}), keys, unit)
    paths = [folder / "chart.png", folder / "chart.pdf"]
    with figure_for(paths, case.headline, held, Format(height=4.0)) as figure:
        axes = figure.add_subplot()
        label_axes(axes, *(parameter_of(key).timed(unit).attributes for key in keys))
        for axis, side in zip((axes.xaxis, axes.yaxis), frame, strict=True):
            scale_axis(axis, side.scale, (side.start, side.stop))
        small = {} if chart.regions is None else _shade(axes, chart.regions, frame)
        for i, line in enumerate(chart.lines):
            _draw_line(axes, line, COLOURS[i % len(COLOURS)])
            for branch in chart.closed_forms[i]:
                axes.plot(branch[:, 0], branch[:, 1], **_CLOSED_FORM)
        axes.plot([], [], label="closed form, Eqs. (38)-(39)", **_CLOSED_FORM)
        labels = [label for line in chart.lines for branch in line.branches for label in branch.labels]
        for start, (name, marker) in _SPECIAL.items():
            if any(start in label for label in labels):
                axes.plot([], [], marker, label=name, color="0.35", markersize=7, markerfacecolor="none")
        for name, letter in small.items():
            axes.plot([], [], marker=f"${letter}$", label=name, markersize=8, **_LETTER)


@dataclass(frozen=True, eq=False)
class Traced:
    """A line of a chart that was written.

    Attributes:
        branches: its points, each of shape (2, n).
        is_whole: whether the chart was finished.
    """

    branches: tuple[FloatArray, ...] = ()
    is_whole: bool = True


def read_line(folder: Path, keys: tuple[str, str], zero: Zero, parameters: Varied) -> Traced:
    """A line of the chart in a folder over two keys, if it has such a line and is of these parameters.

    Args:
        keys: of the abscissa and of the ordinate, in whichever order the chart has them.
        parameters: those of which the chart must hold all but the two keys.
    """
    try:
        summary = json.loads((folder / "chart.json").read_text(encoding="utf-8"))
        found = summary["x"]["key"], summary["y"]["key"]
        if set(found) != set(keys) or not summary["parameters"].items() <= parameters.items():
            return Traced()
        closed = [each["closed"] for line in summary["lines"] if line["line"] == zero.name for each in line["branches"]]
        with (folder / "chart.csv").open(encoding="utf-8", newline="") as file:
            rows = [row for row in csv.DictReader(file) if row["line"] == zero.name]
        branches = []
        for number, is_closed in enumerate(closed, start=1):
            points = [(float(row["x"]), float(row["y"])) for row in rows if row["branch"] == str(number)]
            path = np.array(points + points[:1] if is_closed else points).T
            branches.append(path if found == keys else path[::-1])
        return Traced(tuple(branches), bool(summary["complete"]))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):  # there is none, or it is no chart of ours
        return Traced()


def held_in_words(curve: Curve, varied: Iterable[str], time_unit: str) -> list[str]:
    """The parameters of a curve that are not varied, for below a title."""
    return [parameter_of(key).timed(time_unit).stated(value) for key, value in fixed(curve.parameters, varied).items()]


def _rows(chart: Chart) -> Iterator[list[Any]]:
    """A row for each point of each branch."""
    for line in chart.lines:
        for number, branch in enumerate(line.branches, start=1):
            points = zip(branch.x, branch.y, branch.width, branch.labels, strict=True)
            yield from (
                [line.zero.name, number, float(x), float(y), float(width), label] for x, y, width, label in points
            )


def _summary(case: Case, chart: Chart) -> dict[str, Any]:
    x, y = charted(case).x.axis, charted(case).y.axis
    regions = () if chart.regions is None else chart.regions.each
    held = {key: value for key, value in case.curve({}).parameters.items() if key not in (x.key, y.key)}
    return {
        "complete": chart.complete,
        "planned": len(charted(case).zero),
        "done": len(chart.lines) if chart.complete else max(len(chart.lines) - 1, 0),
        "parameters": held,
        "x": _frame(x),
        "y": _frame(y),
        "rtol": RTOL,
        "lines": [_line(line) for line in chart.lines],
        "closed_forms": [
            {"line": zero.name, "equation": "(38)-(39)", "branches": [branch.tolist() for branch in branches]}
            for zero, branches in zip(charted(case).zero, chart.closed_forms, strict=True)
        ],
        "regions": [
            {"name": each.name, "signs": each.signs, "share": each.share}
            | {"x": float(x.value(each.at[0])), "y": float(y.value(each.at[1]))}
            for each in regions
        ],
        "warnings": in_case_words(chart.remarks),
    }


def _frame(axis: Axis) -> dict[str, Any]:
    return {"key": axis.key, "start": axis.start, "stop": axis.stop, "scale": axis.scale, "at": list(axis.at)}


def _line(line: Boundary) -> dict[str, Any]:
    scan = None if line.scan is None else {"nodes": [line.scan.nodes.size] * 2, "rtol": SCAN_RTOL}
    return {
        "line": line.zero.name,
        "equation": line.zero.equation,
        "appears": _appears(line.zero),
        "scan": scan,
        "branches": [
            {"points": branch.x.size, "closed": branch.closed, "obstacles": list(branch.obstacles)}
            for branch in line.branches
        ],
    }


def _shade(axes: Any, regions: Regions, frame: tuple[Axis, Axis]) -> dict[str, str]:
    """Draw a tint for each region, and its name, or where that has no room a letter; the letters by the names."""
    from matplotlib.colors import ListedColormap

    x, y = frame
    edges = np.linspace(0, 1, regions.index.shape[0] + 1)
    unstable = [sum(sign > 0 for sign in each.signs.values()) for each in regions.each]
    tints = np.array([*unstable, np.nan])[regions.index]
    style: dict[str, Any] = {"cmap": ListedColormap(_TINTS), "vmin": -0.5, "vmax": len(_TINTS) - 0.5}
    axes.pcolormesh(x.value(edges), y.value(edges), tints.T, rasterized=True, **style)
    letters, small = iter(ascii_lowercase), dict[str, str]()
    for each in regions.each:
        name = each.name.replace("δ_p", r"$\delta_p$")
        place = x.value(each.at[0]), y.value(each.at[1])
        middle: dict[str, Any] = {"ha": "center", "va": "center", "color": "0.15"}
        if each.share > _ROOMY:
            axes.text(*place, "\n".join(name.split(", ")), fontsize=9.5, **middle)
        elif each.share > _NAMED:
            small[name] = next(letters, "z")
            axes.text(*place, small[name], fontsize=12, weight="bold", **middle)
    return small


def _draw_line(axes: Any, line: Boundary, colour: str) -> None:
    """A line with its special points; its name is λ = 0, or what appears at a value of δ_p."""
    for branch in line.branches:
        path = (np.append(each, each[:1]) if branch.closed else each for each in (branch.x, branch.y))
        axes.plot(*path, color=colour, linewidth=2)
        for start, (_, marker) in _SPECIAL.items():
            chosen = np.array([start in label for label in branch.labels])
            axes.plot(branch.x[chosen], branch.y[chosen], marker, color=colour, markersize=7, markerfacecolor="white")
    appears = _appears(line.zero)
    name = f"{line.zero.latex}: {appears}" if appears else line.zero.latex
    axes.plot([], [], color=colour, linewidth=2, label=name)


def _appears(zero: Zero) -> str | None:
    """Which bifurcation a value of δ_p is, if one."""
    return P_BIFURCATIONS.get(zero.p) if zero.kind == "stability_index" else None
