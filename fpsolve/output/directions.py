"""Pictures of densities over directions, of the files that hold them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fpsolve.case.case import Case, Curve
from fpsolve.drawing import Format, figure_for
from fpsolve.exponent.density import direction_grid
from fpsolve.exponent.method import DIRECTIONS
from fpsolve.page.page import Drawing
from fpsolve.parts.directions import directions_file
from fpsolve.results.curve import CurveResult, SimulatedCurve

if TYPE_CHECKING:
    import xarray


MOST_PANELS = 4
"""Of a figure: the stationary density, and tilted ones."""


def figures(case: Case, result: CurveResult, folder: Path, _: SimulatedCurve | None) -> Iterator[Drawing]:
    """densities.png and .pdf, where densities were written."""
    curve, source = result.curve, directions_file(result.curve, folder)
    if case.output.figure and case.method.pictures == DIRECTIONS and source.is_file():
        grid = direction_grid(curve.problem, 2)
        what = f"energy share and {grid.quantities[1].name.replace('_', ' ')}" if grid.share else "directions"
        title, job = f"Densities of {what}{curve.of}", partial(_draw, case, curve, source)
        yield Drawing(title, job, f"densities{curve.suffix}", case.headline)


def _draw(case: Case, curve: Curve, source: Path, paths: Sequence[Path], heading: str) -> None:
    """The stationary density, and some tilted ones."""
    import xarray  # with pandas, which takes half a second

    with xarray.open_dataset(source, engine="h5netcdf") as found:
        _draw_panels(case, curve, found, paths, heading)


def _draw_panels(case: Case, curve: Curve, found: xarray.Dataset, paths: Sequence[Path], heading: str) -> None:
    grid = direction_grid(curve.problem, min(found["T"].shape[1:]))
    panels = []
    if "stationary_density" in found:
        panels.append(("stationary", found["stationary_density"]))
    chosen = np.unique(np.linspace(0, found.sizes["p"] - 1, MOST_PANELS - len(panels)).round().astype(int))
    for k in chosen:
        if float(found.p[k]):
            panels.append((f"tilted, p = {float(found.p[k]):g}", found["tilted_density"][k]))
    columns = 1 if len(panels) == 1 else 2
    rows = -(-len(panels) // columns)
    form = Format(width=7.2 if columns == 1 else 11.5, height=3.6 if rows == 1 else 2.6, scale=1.1)
    with figure_for(paths, heading, curve.held(case.units.time), form) as figure:
        axes = np.ravel(figure.subplots(rows, columns))
        for place, (axis, (words, values)) in enumerate(zip(axes, panels, strict=False)):
            is_right = place % columns == columns - 1 or place == len(panels) - 1
            about = {"long_name": "density", "units": grid.unit} if is_right else {"long_name": "", "units": "1"}
            grid.draw(axis, values.values, about, vmin=0.0)
            if place % columns:
                axis.set_ylabel("")
            if place + columns < len(panels):
                axis.set_xlabel("")
            means = (f": mean {each.symbol} {mean:.1%}" for each, mean in grid.means(values.values).items())
            axis.set_title("".join([words, *means]), parse_math=False)
        for axis in axes[len(panels) :]:
            axis.set_axis_off()
