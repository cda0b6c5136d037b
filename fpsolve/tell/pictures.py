"""Pictures of one curve: of its response, of what its parameters do, of its densities over directions, of T."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fpsolve.case.case import Case, Curve
from fpsolve.case.sections import RESPONSE, SENSITIVITIES
from fpsolve.drawing import Format, draw_bars, draw_colours, draw_dots, figure_for, label_axes
from fpsolve.exponent.density import direction_grid
from fpsolve.exponent.method import DIRECTIONS, PHASE_AND_NOISE
from fpsolve.model.plane import LinearMotion
from fpsolve.results.directions import directions_file
from fpsolve.results.vtk import name_at
from fpsolve.solve.curve import CurveResponse, CurveResult, ResponseDensity, SimulatedCurve
from fpsolve.solve.question import Numerics
from fpsolve.tell.blocks import Drawing
from fpsolve.tell.eigenfunctions import draw_eigenfunction
from fpsolve.theory.perturbation import scale_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def _of_response(case: Case, result: CurveResult, folder: Path, simulated: SimulatedCurve | None) -> Iterator[Drawing]:
    """response.png and .pdf, where there are densities: of both variables, of the amplitude, and what they do at rest.

    Beside that of the amplitude stands a simulated one, where there is one.
    """
    found, curve = result.response, result.curve
    if not (case.output.figure and found and (density := found.density)):
        return

    def draw(paths: Sequence[Path], heading: str) -> None:
        of = curve.problem.linear.response
        with figure_for(paths, heading, curve.held(case.units.time), Format(width=10.5)) as figure:
            plane, radial = figure.subplots(1, 2)
            _draw_joint_density(plane, found, density, curve.problem.linear, case)
            radial.plot(density.amplitude, density.of_amplitude, label="finite elements")
            label_axes(
                radial, *(each.timed(case.units.time).attributes for each in (of.amplitude, of.amplitude_density))
            )
            end = density.amplitude[0] + density.amplitude[-1]
            radial.set(xlim=(0, end), ylim=(0, 1.1 * float(density.of_amplitude.max())))
            radial.set_title(_at_rest("a hump away from rest", found.stability_index, -1))
            if sample := simulated and simulated.response:
                x = 0.5 * (sample.amplitude_edges[1:] + sample.amplitude_edges[:-1])
                dots = x, sample.amplitude_density, sample.amplitude_error
                draw_dots(radial, *dots, label="Monte Carlo ± 2 standard errors", marker=".", color="black")

    yield Drawing(f"Stationary response{curve.of}", draw, f"response{curve.suffix}", case.headline)


def _draw_joint_density(
    axes: Axes, found: CurveResponse, density: ResponseDensity, system: LinearMotion, case: Case
) -> None:
    """ρ of both variables in colours over four decades; what is below has the colour of the lowest."""
    of = system.response
    about, x, v = (each.timed(case.units.time).attributes for each in (of.density, of.first, of.second))
    a, (phi, of_plane), most = density.amplitude[:, None], density.plane(of.has_wall), float(density.of_plane.max())
    places, shown = (a * np.cos(phi), -system.aspect * a * np.sin(phi)), np.maximum(of_plane, 1e-4 * most)
    draw_colours(axes, *places, shown, about, norm="log", vmin=1e-4 * most, vmax=most, shading="gouraud")
    label_axes(axes, x, v)
    axes.set_title(_at_rest("a crater around rest", found.stability_index, -2))


def _at_rest(words: str, index: float | None, limit: int) -> str:
    """What a density does at rest: it vanishes there where δ_p is below a limit, and is infinite where it is above."""
    assert index is not None  # as there is a density
    below = index < limit
    return rf"{words if below else 'infinite at rest'}: $\delta_p = {index:.3g} {'<' if below else '>'} {limit}$"


def _of_sensitivities(
    case: Case, result: CurveResult, folder: Path, simulated: SimulatedCurve | None
) -> Iterator[Drawing]:
    """sensitivities.png and .pdf, if the case asks for them: θ ∂/∂θ of λ and of some Λ(p), scaled."""
    curve, found = result.curve, result.sensitivities
    if not (case.output.sensitivities and found):
        return

    def draw(paths: Sequence[Path], heading: str) -> None:
        scale, bars = scale_of(curve.problem), dict[str, list[float]]()
        for label, (p, slopes) in found.shown().items():
            size = float(scale.moment(p)) if p else scale.linear
            bars[label] = [found.theta[key] * slopes[key].value / size for key in slopes]
        with figure_for(paths, heading, curve.held(case.units.time)) as figure:
            words = r"effect of a relative change, $\theta\,\partial/\partial\theta$, over the scale"
            draw_bars(figure.add_subplot(xlabel=words), bars, [case.about(key).shown for key in found.theta])

    yield Drawing(f"Effect of the parameters{curve.of}", draw, f"sensitivities{curve.suffix}", case.headline)


MOST_PANELS = 4
"""Of a figure: the stationary density, and tilted ones."""


def _of_directions(case: Case, result: CurveResult, folder: Path, _: SimulatedCurve | None) -> Iterator[Drawing]:
    """densities.png and .pdf, where densities were written."""
    curve, source = result.curve, directions_file(result.curve, folder)
    if case.output.figure and case.method.pictures == DIRECTIONS and source.is_file():
        grid = direction_grid(curve.problem, 2)
        what = f"energy share and {grid.quantities[1].name.replace('_', ' ')}" if grid.share else "directions"
        title, job = f"Densities of {what}{curve.of}", partial(_draw_directions, case, curve, source)
        yield Drawing(title, job, f"densities{curve.suffix}", case.headline)


def _draw_directions(case: Case, curve: Curve, source: Path, paths: Sequence[Path], heading: str) -> None:
    """The stationary density, and some tilted ones."""
    import xarray  # with pandas, which takes 180 ms

    found = xarray.load_dataset(source, engine="h5netcdf")
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
        for axis, (words, values) in zip(axes, panels, strict=False):
            grid.draw(axis, values.values, {"long_name": "density", "units": grid.unit}, vmin=0.0)
            means = (f": mean {each.symbol} {mean:.1%}" for each, mean in grid.means(values.values).items())
            axis.set_title("".join([words, *means]), parse_math=False)
        for axis in axes[len(panels) :]:
            axis.set_axis_off()


def _of_eigenfunctions(
    case: Case, result: CurveResult, folder: Path, simulated: SimulatedCurve | None
) -> Iterator[Drawing]:
    """A picture at one p for a page, where the eigenfunction was written."""
    curve, p = result.curve, case.usual_p
    is_there = case.shown.size and (folder / name_at(f"eigenfunctions{curve.suffix}", p)).is_file()
    if case.method.pictures == PHASE_AND_NOISE and is_there:
        title = f"Eigenfunction T(φ, ξ) of p = {p:g}{curve.of}"
        yield Drawing(title, partial(_draw_eigenfunction, case, curve, p), kind="png")


def _draw_eigenfunction(case: Case, curve: Curve, p: float, paths: Sequence[Path], heading: str) -> None:
    picture = draw_eigenfunction(Numerics.of(case).solver(curve.problem).pair(p), time_unit=case.units.time)
    for path in paths:
        picture.save(path)


Figures = Callable[[Case, CurveResult, Path, SimulatedCurve | None], Iterator[Drawing]]
FIGURES: Mapping[str, Figures] = {
    RESPONSE: _of_response,
    SENSITIVITIES: _of_sensitivities,
    PHASE_AND_NOISE.part: _of_eigenfunctions,
    DIRECTIONS.part: _of_directions,
}
"""Of a curve in a folder, beside its simulation if there is one; by the name of a question, or another name."""
