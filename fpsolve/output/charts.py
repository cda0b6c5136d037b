"""Charts of stability as files: chart.csv, chart.json, chart.png and chart.pdf."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path
from string import ascii_lowercase
from textwrap import wrap
from typing import Any

import numpy as np

from fpsolve.analysis.regions import P_BIFURCATIONS, Regions
from fpsolve.analysis.zero import Axis, Zero
from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.sections import Varied
from fpsolve.drawing import COLOURS, Format, figure_for, label_axes, scale_axis
from fpsolve.files import parsed_json, plain_text, write_csv, write_json
from fpsolve.output.tables import head, in_case_words
from fpsolve.page.page import Drawing
from fpsolve.page.plots import line_of, plot_of
from fpsolve.study.chart import Chart, charted

_TINTS = ("#FFFFFF", "#F3EFE6", "#E9DFCB", "#DBCBAA", "#C9B388")
"""Of regions, the darker the more of the quantities grow there."""
_NAMED = 0.01
"""Share of the frame from which on a region has room for a letter; smaller ones are in chart.json only."""
_CLOSED_FORM: dict[str, Any] = {"linestyle": (0, (2, 3)), "linewidth": 1.4, "zorder": 3}
_FORM = Format(height=4.0)
_SPECIAL = {"fold": ("fold", "^"), "crossing": ("crossing", "o"), "at ": ("value asked for", "s")}
"""Beginnings of labels, what the legend calls such points, and their markers."""


def write_chart(case: Case, chart: Chart, folder: Path) -> None:
    """Write chart.csv, and chart.json, which says whether all is there."""
    rows = (
        [line.zero.name, number, *map(float, point), label]
        for line in chart.lines
        for number, branch in enumerate(line.branches, start=1)
        for *point, label in zip(branch.x, branch.y, branch.width, branch.labels, strict=True)
    )
    write_csv(folder / "chart.csv", ["line", "branch", "x", "y", "width", "label"], rows)
    zeros, frame = charted(case).zero, {"x": charted(case).x.axis, "y": charted(case).y.axis}
    keys = [axis.key for axis in frame.values()]
    summary = {
        **head(case),
        "complete": chart.complete,
        "planned": len(zeros),
        "done": sum(line.complete for line in chart.lines),
        "parameters": {key: value for key, value in case.curve({}).parameters.items() if key not in keys},
        **{
            side: {"key": axis.key, "start": axis.start, "stop": axis.stop, "scale": axis.scale, "at": list(axis.at)}
            for side, axis in frame.items()
        },
        "lines": [
            {
                "line": line.zero.name,
                "equation": line.zero.equation,
                "appears": _appears(line.zero),
                "rtol": line.rtol,
                "scan": None if line.scan is None else {"nodes": [line.scan.nodes.size] * 2, "rtol": line.scan_rtol},
                "branches": [
                    {"points": branch.x.size, "closed": branch.closed, "obstacles": list(branch.obstacles)}
                    for branch in line.branches
                ],
                "obstacles": list(line.obstacles),
            }
            for line in chart.lines
        ],
        "closed_forms": [
            {"line": zero.name, "equation": "(38)-(39)", "branches": [branch.tolist() for branch in branches]}
            for zero, branches in zip(zeros, chart.closed_forms, strict=True)
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
    job, plot = partial(_draw, case, chart), partial(_plot_of_chart, case, chart)
    return Drawing(f"Where stability ends, over {keys}", job, "chart", case.headline, plot=plot)


def _draw(case: Case, chart: Chart, paths: Sequence[Path], heading: str) -> None:
    """The lines, their closed forms dashed, and the regions with names."""
    frame = charted(case).x.axis, charted(case).y.axis
    keys = frame[0].key, frame[1].key
    held = case.curve({}).held(case.units.time, keys)
    with figure_for(paths, heading, held, _FORM) as figure:
        axes = figure.add_subplot()
        label_axes(axes, *(case.about(key).attributes for key in keys))
        for axis, side in zip((axes.xaxis, axes.yaxis), frame, strict=True):
            scale_axis(axis, side.scale, (side.start, side.stop))
        small = {} if chart.regions is None else _shade(axes, chart.regions, frame)
        for i, line in enumerate(chart.lines):
            colour, appears = COLOURS[i % len(COLOURS)], _appears(line.zero)
            for branch in line.branches:
                path = (np.append(each, each[:1]) if branch.closed else each for each in (branch.x, branch.y))
                axes.plot(*path, color=colour, linewidth=2)
                for start, (_, marker) in _SPECIAL.items():
                    chosen = np.array([start in label for label in branch.labels])
                    hollow = {"color": colour, "markersize": 7, "markerfacecolor": "white"}
                    axes.plot(branch.x[chosen], branch.y[chosen], marker, **hollow)
            if line.branches:
                name = f"{line.zero.latex}: {appears}" if appears else line.zero.latex
                axes.plot([], [], color=colour, linewidth=2, label=name)
            for points in chart.closed_forms[i]:
                axes.plot(points[:, 0], points[:, 1], color=colour, **_CLOSED_FORM)
        if any(chart.closed_forms):
            words = "closed form, Eqs. (38)-(39), in the colour of its line"
            axes.plot([], [], label=words, color="0.35", **_CLOSED_FORM)
        labels = [label for line in chart.lines for branch in line.branches for label in branch.labels]
        for start, (name, marker) in _SPECIAL.items():
            if any(start in label for label in labels):
                axes.plot([], [], marker, label=name, color="0.35", markersize=7, markerfacecolor="none")
        for name, letter in small.items():
            axes.plot([], [], " ", label=f"{letter}: {name}")


def _plot_of_chart(case: Case, chart: Chart) -> dict[str, Any]:
    """The lines, with their special points."""
    lines = []
    for line in chart.lines:
        for branch in line.branches:
            x, y, labels = branch.x.tolist(), branch.y.tolist(), list(branch.labels)
            ends = slice(1 if branch.closed else 0)
            text = [escape(label) for label in labels + labels[ends]]
            lines.append(line_of(line.zero.equation, x + x[ends], y + y[ends], text=text))
    frame = charted(case).x, charted(case).y
    return plot_of("Where stability ends", lines, [{"title": {"text": escape(a.key)}, "type": a.scale} for a in frame])


def read_line(folder: Path, keys: tuple[str, str], zero: Zero, parameters: Varied) -> tuple[list[FloatArray], bool]:
    """The branches of a line of the chart in a folder over two keys, each of shape (2, n), and whether it is finished.

    There are none where the chart has no such line, or is not of these parameters.

    Args:
        keys: of the abscissa and of the ordinate, in whichever order the chart has them.
        parameters: those of which the chart must hold all but the two keys.
    """
    try:
        summary = parsed_json(plain_text(folder / "chart.json"))
        found = summary["x"]["key"], summary["y"]["key"]
        if set(found) != set(keys) or not summary["parameters"].items() <= parameters.items():
            return [], True
        table = csv.DictReader(io.StringIO(plain_text(folder / "chart.csv"), newline=""))
        rows = [row for row in table if row["line"] == zero.name]
        branches = []
        of_line = (each for line in summary["lines"] if line["line"] == zero.name for each in line["branches"])
        for number, branch in enumerate(of_line, start=1):
            points = [[float(row[key]) for key in "xy"] for row in rows if row["branch"] == str(number)]
            path = np.array(points + points[:1] if branch["closed"] else points).T
            if len(path) != 2 or not np.isfinite(path).all():
                raise ValueError("a branch has no points")
            branches.append(path if found == keys else path[::-1])
        return branches, bool(summary["complete"])
    except (
        OSError,
        ValueError,
        LookupError,
        TypeError,
        AttributeError,
        csv.Error,
    ):  # there is none, or it is none of ours
        return [], True


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
    middle: dict[str, Any] = {"ha": "center", "va": "center", "color": "0.15", "zorder": 4}
    for number, each in enumerate(regions.each):
        tint = _TINTS[min(unstable[number], len(_TINTS) - 1)]
        middle["bbox"] = {"facecolor": tint, "edgecolor": "none", "pad": 1.5, "alpha": 0.85}  # over a closed form
        name = each.name.replace("δ_p", r"$\delta_p$")
        parts = name.split(", ")
        narrow = [line for part in parts for line in ([part] if "$" in part else wrap(part, 14))]
        for lines in (parts, narrow):
            words = axes.text(0, 0, "\n".join(lines), fontsize=9.5, **middle)
            if place := _room(words, regions.index == number):
                words.set_position((x.value(place[0]), y.value(place[1])))
                break
            words.remove()
        else:
            if each.share > _NAMED:
                small[name] = rf"$\mathbf{{{next(letters, 'z')}}}$"
                axes.text(x.value(each.at[0]), y.value(each.at[1]), small[name], fontsize=12, **middle)
    return small


def _room(words: Any, inside: FloatArray) -> tuple[float, float] | None:
    """Where the middle of words is deepest in a region with all of them inside, in shares of the sides; or None."""
    from scipy.ndimage import distance_transform_edt, minimum_filter

    box, n, inches = words.get_window_extent(), inside.shape[0], words.figure.dpi
    shares = 1.15 * box.width / (0.85 * _FORM.width * inches), 1.15 * box.height / (_FORM.height * inches)
    fits = minimum_filter(inside, [max(1, round(n * share)) for share in shares], mode="constant")
    if not fits.any():
        return None
    depth = np.where(fits, distance_transform_edt(np.pad(inside, 1))[1:-1, 1:-1], 0)
    u, v = np.unravel_index(int(np.argmax(depth)), depth.shape)
    return (float(u) + 0.5) / n, (float(v) + 0.5) / n


def _appears(zero: Zero) -> str | None:
    """Which bifurcation a value of δ_p is, if one."""
    return P_BIFURCATIONS.get(zero.p) if zero.kind == "stability_index" else None
