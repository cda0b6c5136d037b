"""A chart in words and pictures: lines, their crossings, regions, closed forms."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from string import ascii_lowercase
from textwrap import wrap
from typing import Any

import numpy as np

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
            colour, bifurcation = f"C{i}", appears(line.target)
            for branch in line.branches:
                axes.plot(*branch.path, color=colour)
                for start, (_, marker) in SPECIAL.items():
                    chosen = np.array([start in label for label in branch.labels])
                    axes.plot(branch.x[chosen], branch.y[chosen], marker, color=colour, markerfacecolor="white")
            if line.branches:
                name = f"{line.target.latex}: {bifurcation}" if bifurcation else line.target.latex
                axes.plot([], [], color=colour, label=name)
            for points in chart.closed_forms[i]:
                axes.plot(points[:, 0], points[:, 1], color=colour, **CLOSED_FORM)
        if any(chart.closed_forms):
            words = "closed form, Eqs. (38)-(39), in the colour of its line"
            axes.plot([], [], label=words, color="0.35", **CLOSED_FORM)
        labels = [label for line in chart.lines for branch in line.branches for label in branch.labels]
        for start, (name, marker) in SPECIAL.items():
            if any(start in label for label in labels):
                axes.plot([], [], marker, label=name, color="0.35", markerfacecolor="none")
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
