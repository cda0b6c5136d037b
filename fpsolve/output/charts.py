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
from fpsolve.files import write_csv, write_json
from fpsolve.model.quantity import parameter_of
from fpsolve.output.frame import Size, add_heading, add_legend, canvas
from fpsolve.output.tables import head
from fpsolve.pictures import COLOURS, plain_numbers
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
    x, y = charted(case).x.axis, charted(case).y.axis
    unit = case.figure.time_unit
    with canvas([folder / "chart.png", folder / "chart.pdf"], Size(height=4.7)) as figure:
        names = (parameter_of(key).timed(unit).title for key in (x.key, y.key))
        axes = figure.add_subplot(**dict(zip(("xlabel", "ylabel"), names, strict=True)))
        axes.set(xscale=x.scale, yscale=y.scale, xlim=(x.start, x.stop), ylim=(y.start, y.stop))
        for side, frame in ((axes.xaxis, x), (axes.yaxis, y)):
            if frame.scale == "log":
                plain_numbers(side, frame.start, frame.stop)
        small = {} if chart.regions is None else _shade(axes, chart.regions, (x, y))
        entries = {}
        for i, line in enumerate(chart.lines):
            for branch in chart.closed_forms[i]:
                axes.plot(branch[:, 0], branch[:, 1], **_CLOSED_FORM)
            entries[_legend(line.zero)] = _draw(axes, line, COLOURS[i % len(COLOURS)])
        entries["closed form, Eqs. (38)-(39)"] = axes.plot([], [], **_CLOSED_FORM)[0]
        labels = [label for line in chart.lines for branch in line.branches for label in branch.labels]
        for start, (name, marker) in _SPECIAL.items():
            if any(start in label for label in labels):
                entries[name] = axes.plot([], [], marker, color="0.35", markersize=7, markerfacecolor="none")[0]
        entries |= small
        add_legend(figure, list(entries.items()))
        add_heading(figure, case.headline, held_in_words(case.curve({}), (x.key, y.key), unit))


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
        "warnings": list(chart.remarks),
    }


def _frame(axis: Axis) -> dict[str, Any]:
    return {"key": axis.key, "start": axis.start, "stop": axis.stop, "scale": axis.scale, "at": list(axis.at)}


def _line(line: Boundary) -> dict[str, Any]:
    scan = None if line.scan is None else {"nodes": [line.scan.nodes.size] * 2, "rtol": SCAN_RTOL}
    return {
        "line": line.zero.name,
        "equation": line.zero.equation,
        "appears": P_BIFURCATIONS.get(line.zero.p) if line.zero.kind == "stability_index" else None,
        "scan": scan,
        "branches": [
            {"points": branch.x.size, "closed": branch.closed, "obstacles": list(branch.obstacles)}
            for branch in line.branches
        ],
    }


def _shade(axes: Any, regions: Regions, frame: tuple[Axis, Axis]) -> dict[str, Any]:
    """A tint for each region, and its name, or where that has no room a letter; what the legend says of these."""
    from matplotlib.colors import ListedColormap

    x, y = frame
    edges = np.linspace(0, 1, regions.index.shape[0] + 1)
    unstable = [sum(sign > 0 for sign in each.signs.values()) for each in regions.each]
    tints = np.array([*unstable, np.nan])[regions.index]
    colours, most = ListedColormap(_TINTS), len(_TINTS) - 1
    axes.pcolormesh(x.value(edges), y.value(edges), tints.T, cmap=colours, vmin=-0.5, vmax=most + 0.5, rasterized=True)
    letters, small = iter(ascii_lowercase), {}
    for each in regions.each:
        name = each.name.replace("δ_p", r"$\delta_p$")
        place = x.value(each.at[0]), y.value(each.at[1])
        if each.share > _ROOMY:
            axes.text(*place, "\n".join(name.split(", ")), ha="center", va="center", fontsize=9.5, color="0.15")
        elif each.share > _NAMED:
            letter = next(letters, "z")
            axes.text(*place, letter, ha="center", va="center", fontsize=12, weight="bold", color="0.15")
            small[name] = axes.plot(
                [], [], linestyle="none", marker=f"${letter}$", markersize=8, markeredgewidth=0, color="0.15"
            )[0]
    return small


def _draw(axes: Any, line: Boundary, colour: str) -> Any:
    """A line with its special points; what the legend shows of it."""
    for branch in line.branches:
        path = (np.append(each, each[:1]) if branch.closed else each for each in (branch.x, branch.y))
        axes.plot(*path, color=colour, linewidth=2)
        for start, (_, marker) in _SPECIAL.items():
            chosen = np.array([start in label for label in branch.labels])
            axes.plot(branch.x[chosen], branch.y[chosen], marker, color=colour, markersize=7, markerfacecolor="white")
    return axes.plot([], [], color=colour, linewidth=2)[0]


def _legend(zero: Zero) -> str:
    """λ = 0, or what appears at a value of δ_p, in LaTeX."""
    appears = P_BIFURCATIONS.get(zero.p) if zero.kind == "stability_index" else None
    return f"{zero.latex}: {appears}" if appears else zero.latex
