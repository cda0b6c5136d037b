"""A chart of where stability ends: its special points, and what its regions mean."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from fpsolve.analysis.regions import Region
from fpsolve.analysis.zero import Zero
from fpsolve.case.case import Case
from fpsolve.case.vary import short_names
from fpsolve.output.charts import chart_figure
from fpsolve.page.page import Block, Column, Grid, Sentence
from fpsolve.results.text import plural
from fpsolve.show.notes import note_on
from fpsolve.study.chart import Chart, charted


def show(case: Case, chart: Chart) -> Iterator[Block]:
    """The lines with their special points, and the regions from the largest to the smallest."""
    if chart.lines:
        yield chart_figure(case, chart)
    yield chart_grid(case, chart)
    zeros = [line.zero for line in chart.lines]
    for each in () if chart.regions is None else chart.regions.each:
        yield Sentence(f"{each.share:.1%} of the frame: {each.name}.{region_meaning(each, zeros)}")
    yield from (note_on(case.name, each) for each in chart.remarks)


def chart_grid(case: Case, chart: Chart) -> Grid:
    """The branches of every line, and their special points."""
    keys = charted(case).x.key, charted(case).y.key
    names = short_names(keys)
    columns = [Column("line"), Column("branch", 1), Column("points", 2), *map(Column, names)]
    grid = Grid(case.headline, [*columns, Column("special point", is_text=True)])
    for line in chart.lines:
        for number, branch in enumerate(line.branches, start=1):
            count = f"{branch.x.size}{', closed' if branch.closed else ''}"
            grid.rows.append([line.zero.equation, str(number), count, "", "", ""])
            for i, label in enumerate(branch.labels):
                if label:
                    for key, name in zip(keys, names, strict=True):
                        label = label.replace(f"{key} ", f"{name} ")
                    grid.rows.append(["", "", "", f"{branch.x[i]:.7g}", f"{branch.y[i]:.7g}", label])
            grid.ends.add(len(grid.rows) - 1)
    return grid


def region_meaning(region: Region, zeros: Iterable[Zero]) -> str:
    """What becomes in a region of a chart: "Almost every path decays and the mean square grows."."""
    told, signs = list[str](), set[int]()
    for zero in sorted(zeros, key=lambda each: (each.kind == "moment", each.p)):
        sign = region.signs.get(zero.name, 0)
        if sign and zero.kind in ("lyapunov_exponent", "moment"):
            moment = "the mean square" if zero.p == 2 else f"E‖x‖^{zero.p:g}"
            told.append(
                f"{moment if zero.kind == 'moment' else 'almost every path'} {'grows' if sign > 0 else 'decays'}"
            )
            signs.add(sign)
    carried = ", which rare paths carry" if len(signs) == 2 and told[0].endswith("path decays") else ""
    text = " and ".join([", ".join(told[:-1]), told[-1]] if len(told) > 1 else told)
    return f" {text[0].upper()}{text[1:]}{carried}." if told else ""


def traced(chart: Chart) -> str:
    """How many lines a chart has: "3 lines, 4 branches"."""
    branches = sum(len(line.branches) for line in chart.lines)
    return f"{len(chart.lines)} {plural('line', len(chart.lines))}, {branches} {plural('branch', branches)}"
