"""Pictures of the stationary response: its densities, beside a simulated one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.case.case import Case
from fpsolve.drawing import COLOURS, Format, draw_colours, draw_dots, figure_for, label_axes, points
from fpsolve.model.plane import System
from fpsolve.model.quantity import ResponseQuantities
from fpsolve.page.page import Drawing
from fpsolve.results.curve import CurveResponse, CurveResult, ResponseDensity, SimulatedCurve

if TYPE_CHECKING:
    from fpsolve.simulation.response import Response


def figures(case: Case, result: CurveResult, folder: Path, simulated: SimulatedCurve | None) -> Iterator[Drawing]:
    """response.png and .pdf, where there are densities."""
    if case.output.figure and result.response and result.response.density:
        title, name = f"Stationary response{result.curve.of}", f"response{result.curve.suffix}"
        sample = simulated.response if simulated else None
        yield Drawing(title, partial(_draw, case, result, sample), name, case.headline)


def _draw(case: Case, result: CurveResult, sample: Response | None, paths: Sequence[Path], heading: str) -> None:
    """The densities of both variables and of the amplitude; above both, what they do at rest.

    Beside that of the amplitude stands a simulated one, where there is one.
    """
    found, system = result.response, result.curve.problem.system
    if found is None or (density := found.density) is None:
        return
    with figure_for(paths, heading, result.curve.held(case.units.time), Format(width=10.5)) as figure:
        plane, radial = figure.subplots(1, 2)
        figure.get_layout_engine().set(wspace=0.1)
        _draw_joint_density(plane, found, density, system, case)
        _draw_amplitudes(radial, found, density, system.response, case)
        if sample:
            x = 0.5 * (sample.amplitude_edges[1:] + sample.amplitude_edges[:-1])
            look: dict[str, Any] = {"marker": ".", "color": "black", "markersize": points(4), "capsize": points(2)}
            words = "Monte Carlo ± 2 standard errors"
            draw_dots(radial, x, sample.amplitude_density, sample.amplitude_error, label=words, **look)


def _draw_joint_density(axes: Any, found: CurveResponse, density: ResponseDensity, system: System, case: Case) -> None:
    """ρ of both variables in colours over four decades; what is below has the colour of the lowest."""
    from matplotlib.colors import LogNorm

    of = system.response
    about, x, v = (each.timed(case.units.time).attributes for each in (of.density, of.first, of.second))
    a, (phi, of_plane), most = density.amplitude[:, None], density.plane(of.has_wall), float(density.of_plane.max())
    shown, look = np.maximum(of_plane, 1e-4 * most), {"norm": LogNorm(1e-4 * most, most), "shading": "gouraud"}
    draw_colours(axes, a * np.cos(phi), -system.aspect * a * np.sin(phi), shown, about, **look)
    label_axes(axes, x, v)
    axes.set_title(_at_rest("a crater around rest", found.stability_index, -2))


def _draw_amplitudes(
    axes: Any, found: CurveResponse, density: ResponseDensity, about: ResponseQuantities, case: Case
) -> None:
    """ρ(a) as a line."""
    axes.plot(density.amplitude, density.of_amplitude, color=COLOURS[0], label="finite elements")
    label_axes(axes, *(each.timed(case.units.time).attributes for each in (about.amplitude, about.amplitude_density)))
    end = density.amplitude[0] + density.amplitude[-1]
    axes.set(xlim=(0, end), ylim=(0, 1.1 * float(density.of_amplitude.max())))
    axes.set_title(_at_rest("a hump away from rest", found.stability_index, -1))


def _at_rest(words: str, index: float | None, limit: int) -> str:
    """What a density does at rest: it vanishes there where δ_p is below a limit, and is infinite where it is above."""
    assert index is not None  # as there is a density
    below = index < limit
    return rf"{words if below else 'infinite at rest'}: $\delta_p = {index:.3g} {'<' if below else '>'} {limit}$"
