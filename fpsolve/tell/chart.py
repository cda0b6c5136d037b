"""A chart in words and pictures: lines, their crossings, regions, closed forms."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from string import ascii_lowercase
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fpsolve.analysis.axis import Axis
from fpsolve.analysis.regions import Region, Regions
from fpsolve.analysis.target import Target
from fpsolve.case.case import Case
from fpsolve.data import short_names
from fpsolve.drawing import Format, figure_for, label_axes, scale_axis
from fpsolve.solve.chart import Chart, appears, charted
from fpsolve.tell.blocks import Block, Column, Drawing, Grid, Sentence
from fpsolve.tell.notes import note_on
from fpsolve.tell.text import plural

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TINTS = ((1.0, 1.0, 1.0), (0.953, 0.937, 0.902), (0.914, 0.875, 0.796), (0.859, 0.796, 0.667), (0.788, 0.702, 0.533))
"""Of regions, the darker the more of the quantities grow there."""
UNKNOWN = (0.769, 0.784, 0.808)
"""Of the rest of a frame."""
NAMED = 0.01
"""Share of the frame from which on a region has room for a letter; smaller ones are in chart.json only."""
LETTER = 0.014, 0.06
"""Width and height of a letter of a name, with what is free around it, in sides of the frame."""
SPECIAL = {"fold": ("fold", "^"), "crossing": ("crossing", "o"), "at ": ("value asked for", "s")}
"""Beginnings of labels, what the legend calls such points, and their markers."""


def chart_figure(case: Case, chart: Chart) -> Drawing:
    """chart.png and .pdf; none where there is no line."""
    keys = f"{charted(case).x.key} and {charted(case).y.key}"
    return Drawing(f"Where stability ends, over {keys}", partial(_draw, case, chart), "chart", case.headline)


def _draw(case: Case, chart: Chart, paths: Sequence[Path], heading: str) -> None:
    """The lines, their closed forms dotted, and the regions with names."""
    frame = charted(case).x, charted(case).y
    keys = [side.key for side in frame]
    with figure_for(paths, heading, case.parameter_set({}).fixed(case.units.time, keys), Format(height=4.0)) as figure:
        axes = figure.add_subplot()
        label_axes(axes, *(case.about(key).attributes for key in keys))
        for axis, side in zip((axes.xaxis, axes.yaxis), frame, strict=True):
            scale_axis(axis, side.scale, (side.start, side.stop))
        small = {} if chart.regions is None else _shade(axes, chart.regions, frame)
        for i, line in enumerate(chart.lines):
            words = ": ".join(filter(None, (line.target.latex, appears(line.target))))
            for branch in line.branches:
                axes.plot(*branch.path, color=f"C{i}", label=words)
                words = ""
                for start, (_, marker) in SPECIAL.items():
                    chosen = np.array([start in label for label in branch.labels])
                    axes.plot(branch.x[chosen], branch.y[chosen], marker, color=f"C{i}", markerfacecolor="white")
            for points in chart.closed_forms[i]:
                axes.plot(*points.T, ":", color=f"C{i}", zorder=3)
        if any(chart.closed_forms):
            axes.plot([], [], ":", color="0.35", label="perturbation theory, Eqs. (38)-(39)")
        labels = " ".join(label for line in chart.lines for branch in line.branches for label in branch.labels)
        for start, (name, marker) in SPECIAL.items():
            if start in labels:
                axes.plot([], [], marker, color="0.35", markerfacecolor="none", label=name)
        for name, letter in small.items():
            axes.plot([], [], " ", label=f"{letter}: {name}")


def _shade(axes: Axes, regions: Regions, frame: tuple[Axis, Axis]) -> dict[str, str]:
    """Draw a tint for each region, and its name, or where that has no room a letter; these by the names."""
    x, y = frame
    edges, letters, small = np.linspace(0, 1, len(regions.index) + 1), iter(ascii_lowercase), dict[str, str]()
    unstable = (sum(sign > 0 for sign in each.signs.values()) for each in regions.each)
    tints = [TINTS[min(count, len(TINTS) - 1)] for count in unstable]
    colours = np.array([*tints, UNKNOWN])[regions.index.T]  # -1 is the last one
    axes.pcolormesh(x.value(edges), y.value(edges), colours, rasterized=True)
    if (regions.index < 0).any():
        axes.fill([], [], color=UNKNOWN, label="not solved, or not defined")
    for number, (each, tint) in enumerate(zip(regions.each, tints, strict=True)):
        name = each.name.replace("δ_p", r"$\delta_p$")
        parts = name.split(", ")
        folded = [line for part in parts for line in ([part] if "$" in part else wrap(part, 14))]
        fitting = ("\n".join(lines) for lines in (parts, folded) if _has_room(regions.index == number, each.at, lines))
        if not (words := next(fitting, "")) and each.share > NAMED:
            words = small[name] = rf"$\mathbf{{{next(letters, 'z')}}}$"
        text = axes.text(
            float(x.value(each.at[0])), float(y.value(each.at[1])), words, fontsize="small", ha="center", va="center"
        )
        text.set(color="0.15", zorder=4)
        text.set_bbox({"facecolor": tint, "edgecolor": "none", "pad": 1.5, "alpha": 0.85})  # over closed forms
    return small


def _has_room(inside: NDArray[np.bool_], at: tuple[float, float], lines: Sequence[str]) -> bool:
    """Whether lines of letters around a place of the frame are inside of a region."""
    half = 0.5 * np.array([max(map(len, lines)) * LETTER[0], len(lines) * LETTER[1]])
    (left, low), (right, high) = (np.floor((np.array(at) + end * half) * inside.shape).astype(int) for end in (-1, 1))
    is_framed = min(left, low) >= 0 and right < inside.shape[0] and high < inside.shape[1]
    return bool(is_framed and inside[left : right + 1, low : high + 1].all())


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
                        label = label.replace(key, name)
                    grid.rows.append(["", "", "", f"{branch.x[i]:.7g}", f"{branch.y[i]:.7g}", label])
            grid.ends.add(len(grid.rows) - 1)
    return grid


def region_meaning(region: Region, targets: Iterable[Target]) -> str:
    """What becomes in a region of a chart: "Almost every path decays and the mean square grows."."""
    told = dict[str, int]()
    for target in sorted(targets, key=lambda each: (each.kind == "moment", each.p)):
        sign = region.signs.get(str(target), 0)
        if sign and target.kind != "stability_index" and not target.level:
            moment = "the mean square" if target.p == 2 else f"E‖x‖^{target.p:g}"
            what = moment if target.kind == "moment" else "almost every path"
            told[f"{what} {'grows' if sign > 0 else 'decays'}"] = sign
    if not told:
        return ""
    *others, last = told
    text = " and ".join(filter(None, (", ".join(others), last)))
    carried = ", which rare paths carry" if {*told.values()} == {-1, 1} and "almost every path decays" in told else ""
    return f" {text[0].upper()}{text[1:]}{carried}."


def traced(chart: Chart) -> str:
    """How many lines a chart has: "3 lines, 4 branches"."""
    branches = sum(len(line.branches) for line in chart.lines)
    return f"{len(chart.lines)} {plural('line', len(chart.lines))}, {branches} {plural('branch', branches)}"
