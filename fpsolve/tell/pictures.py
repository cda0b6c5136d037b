"""Pictures of one parameter set: of its response, of what its parameters do, of its densities over directions, of T."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Literal

import numpy as np

from fpsolve.arrays import FloatArray, shown
from fpsolve.case.case import Case, ParameterSet
from fpsolve.case.sections import RESPONSE, SENSITIVITIES
from fpsolve.data import Quantity
from fpsolve.drawing import MOST_LINES, QUARTERS, Format, draw_bars, draw_colours, draw_dots, figure_for, label_axes
from fpsolve.exponent.density import Grid, direction_grid, on_nodes
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.method import DIRECTIONS, PHASE_AND_NOISE
from fpsolve.model.quantity import MOMENT, PHASE
from fpsolve.results.directions import directions_file
from fpsolve.results.nodes import FIELDS, Nodes
from fpsolve.results.vtk import name_at
from fpsolve.solve.question import Numerics
from fpsolve.solve.set_result import SetResult, SimulatedSet
from fpsolve.tell.blocks import Drawing
from fpsolve.theory.perturbation import scale_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FINER = 2
"""So many times as many nodes either way as a file for ParaView has; there they carry polynomials."""
RED = "#C8102E"
NEXT_TO_ZERO = 0.05
"""A least value below this share of the maximum is drawn as 0, which rounding and small errors miss."""
DECADES = 2
"""So many powers of ten of T, which is positive, are drawn on a logarithmic scale."""
Field = Literal["T", "T_adjoint", "tilted_density"]


def _of_response(case: Case, result: SetResult, folder: Path, simulated: SimulatedSet | None) -> Iterator[Drawing]:
    """response.png and .pdf, where there are densities: of both variables, of the amplitude, and what they do at rest.

    Beside that of the amplitude stands a simulated one, where there is one.
    """
    found, parameter_set = result.response, result.parameter_set
    if not (case.output.figure and found and (density := found.density)):
        return

    def draw(paths: Sequence[Path], heading: str) -> None:
        motion = parameter_set.problem.linear
        of, a = motion.response, density.amplitude[:, None]
        phi, of_plane = density.plane(of.has_wall)
        quantities = of.first, of.second, of.density, of.amplitude, of.amplitude_density
        x, v, of_both, amplitude, of_amplitude = (each.timed(case.units.time).attributes for each in quantities)
        most = float(density.of_plane.max())
        least = 1e-4 * most  # what is below has its colour
        with figure_for(paths, heading, parameter_set.fixed(case.units.time), Format(width=10.5)) as figure:
            plane, radial = figure.subplots(1, 2)
            places, shown = (a * np.cos(phi), -motion.aspect * a * np.sin(phi)), np.maximum(of_plane, least)
            draw_colours(plane, *places, shown, of_both, norm="log", vmin=least, vmax=most, shading="gouraud")
            label_axes(plane, x, v)
            plane.set_title(_at_rest("a crater around rest", found.stability_index, -2))
            radial.plot(density.amplitude, density.of_amplitude, label="finite elements")
            label_axes(radial, amplitude, of_amplitude)
            end = density.amplitude[0] + density.amplitude[-1]
            radial.set(xlim=(0, end), ylim=(0, 1.1 * float(density.of_amplitude.max())))
            radial.set_title(_at_rest("a hump away from rest", found.stability_index, -1))
            if sample := simulated and simulated.response:
                middles = 0.5 * (sample.amplitude_edges[1:] + sample.amplitude_edges[:-1])
                dots = middles, sample.amplitude_density, sample.amplitude_error
                draw_dots(radial, *dots, label="Monte Carlo ± 2 standard errors", marker=".", color="black")

    yield Drawing(f"Stationary response{parameter_set.of}", draw, f"response{parameter_set.suffix}", case.headline)


def _at_rest(words: str, index: float | None, limit: int) -> str:
    """What a density does at rest: it vanishes there where δ_p is below a limit, and is infinite where it is above."""
    assert index is not None  # as there is a density
    below = index < limit
    return rf"{words if below else 'infinite at rest'}: $\delta_p = {index:.3g} {'<' if below else '>'} {limit}$"


def _of_sensitivities(case: Case, result: SetResult, folder: Path, simulated: SimulatedSet | None) -> Iterator[Drawing]:
    """sensitivities.png and .pdf, if the case asks for them: θ ∂/∂θ of λ and of some Λ(p), scaled."""
    parameter_set, found = result.parameter_set, result.sensitivities
    if not (case.output.sensitivities and found):
        return

    def draw(paths: Sequence[Path], heading: str) -> None:
        scale, bars = scale_of(parameter_set.problem), dict[str, list[float]]()
        for label, (p, slopes) in found.shown().items():
            size = float(scale.moment(p)) if p else scale.linear
            bars[label] = [found.theta[key] * slopes[key].value / size for key in slopes]
        with figure_for(paths, heading, parameter_set.fixed(case.units.time)) as figure:
            words = r"effect of a relative change, $\theta\,\partial/\partial\theta$, over the scale"
            draw_bars(figure.add_subplot(xlabel=words), bars, [case.about(key).shown for key in found.theta])

    yield Drawing(
        f"Effect of the parameters{parameter_set.of}", draw, f"sensitivities{parameter_set.suffix}", case.headline
    )


MOST_PANELS = 4
"""Of a figure: the stationary density, and tilted ones."""


def _of_directions(case: Case, result: SetResult, folder: Path, _: SimulatedSet | None) -> Iterator[Drawing]:
    """densities.png and .pdf, where densities were written."""
    parameter_set, source = result.parameter_set, directions_file(result.parameter_set, folder)
    if case.output.figure and case.method.pictures == DIRECTIONS and source.is_file():
        grid = direction_grid(parameter_set.problem, 2)
        what = f"energy share and {grid.quantities[1].name.replace('_', ' ')}" if grid.share else "directions"
        title, job = f"Densities of {what}{parameter_set.of}", partial(_draw_directions, case, parameter_set, source)
        yield Drawing(title, job, f"densities{parameter_set.suffix}", case.headline)


def _draw_directions(
    case: Case, parameter_set: ParameterSet, source: Path, paths: Sequence[Path], heading: str
) -> None:
    """The stationary density, and some tilted ones."""
    import xarray  # with pandas, which takes 180 ms

    found = xarray.load_dataset(source, engine="h5netcdf")
    grid = direction_grid(parameter_set.problem, min(found["T"].shape[1:]))
    panels = []
    if "stationary_density" in found:
        panels.append(("stationary", found["stationary_density"]))
    chosen = np.unique(np.linspace(0, found.sizes["p"] - 1, MOST_PANELS - len(panels)).round().astype(int))
    for k in chosen:
        if float(found.p[k]):
            panels.append((f"tilted, p = {float(found.p[k]):g}", found["tilted_density"][k]))
    columns = min(len(panels), 2)
    rows = -(-len(panels) // columns)
    form = Format(width=5.8 * columns, height=3.0, scale=1.1)
    with figure_for(paths, heading, parameter_set.fixed(case.units.time), form) as figure:
        for place, (words, values) in enumerate(panels, 1):
            axes = figure.add_subplot(rows, columns, place)
            grid.draw(axes, values.values, {"long_name": "density", "units": grid.unit}, vmin=0.0)
            means = (f": mean {each.symbol} {mean:.1%}" for each, mean in grid.means(values.values).items())
            axes.set_title("".join([words, *means]), parse_math=False)


def _of_eigenfunctions(
    case: Case, result: SetResult, folder: Path, simulated: SimulatedSet | None
) -> Iterator[Drawing]:
    """A picture at one p for a page, where the eigenfunction was written."""
    parameter_set, p = result.parameter_set, case.usual_p
    is_there = case.shown.size and (folder / name_at(f"eigenfunctions{parameter_set.suffix}", p)).is_file()
    if case.method.pictures == PHASE_AND_NOISE and is_there:
        title = f"Eigenfunction T(φ, ξ) of p = {p:g}{parameter_set.of}"
        yield Drawing(title, partial(_draw_eigenfunction, case, parameter_set, p))


def _draw_eigenfunction(case: Case, parameter_set: ParameterSet, p: float, paths: Sequence[Path], heading: str) -> None:
    _draw_pair(Numerics.of(case).solver(parameter_set.problem).pair(p), "T", "viridis", case.units.time, paths)


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture that notebooks show.

    Attributes:
        png: the content of its file.
    """

    png: bytes

    def save(self, path: str | Path) -> Path:
        """Write it as a PNG file."""
        Path(path).write_bytes(self.png)
        return Path(path)

    def _repr_png_(self) -> bytes:
        return self.png


def draw_eigenfunction(
    pair: PrincipalPair, field: Field = "T", *, cmap: str = "viridis", time_unit: str = "time"
) -> Picture:
    """Draw an eigenfunction, or the tilted density, over phase and noise; for noise with states a line for each.

    Of more than two variables over directions, see `analysis.DirectionDensity`, as the functions of the pair have it: T
    as its mean, T* and T T* as densities.

    Args:
        pair: the eigenpair.
        field: "T", "T_adjoint", or their product "tilted_density".
        cmap: the colours, by matplotlib's names.
        time_unit: what the unit of time is called, such as "s".

    Raises:
        ValueError: there is no such field.
        OutputError: T depends on more than φ and ξ.
    """
    if field not in FIELDS:
        raise ValueError(f"got field = {shown(field)}; must be one of {', '.join(map(repr, FIELDS))}")
    with TemporaryDirectory() as place:
        path = Path(place, "picture.png")
        _draw_pair(pair, field, cmap, time_unit, [path])
        return Picture(path.read_bytes())


def _draw_pair(pair: PrincipalPair, field: Field, cmap: str, time_unit: str, paths: Sequence[Path]) -> None:
    """An eigenfunction with what it is of, into files."""
    problem = pair.generator.problem
    number = f"p = {pair.p:g}, {MOMENT.symbol} = {round(pair.value, 14) + 0.0:.6g} ({MOMENT.timed(time_unit).unit})"
    known = [each.quantity.timed(time_unit).stated(each.value) for each in problem.parameters.values()]
    with figure_for(paths, number, known) as figure:
        axes = figure.add_subplot()
        if choose(problem).pictures == DIRECTIONS:
            found = on_nodes(pair)
            about = _about(field, found.grid, time_unit).attributes
            found.grid.draw(axes, found.fields._asdict()[field], about, cmap=cmap)
        else:
            _draw_over_noise(pair, field, cmap, time_unit, axes)


def _about(field: str, grid: Grid, time_unit: str) -> Quantity:
    """A function; densities have the unit of a grid."""
    quantity = FIELDS[field]
    return replace(quantity, unit=quantity.unit if field == "T" else grid.unit).timed(time_unit)


def _draw_over_noise(pair: PrincipalPair, field: str, cmap: str, time_unit: str, axes: Axes) -> None:
    """A function of phase and noise where it is not negligible, in colours, or as a line for each state of the noise.

    The scale begins at 0 where the least value is next to it, or all are the same.
    """
    nodes, about = Nodes.of(pair, FINER).seen(pair), _about(field, Grid.of(pair), time_unit)
    values = nodes.at_xi(nodes.fields(pair)._asdict()[field])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    is_log = field == "T" and 0 < 10**DECADES * low < high
    if nodes.is_lines:
        _draw_lines(axes, nodes, values, is_log=is_log)
    else:
        is_next = not is_log and (abs(low) < NEXT_TO_ZERO * high or high - low < 1e-6 * high)
        ends = {"norm": "log" if is_log else "linear", "vmin": 0.0 if is_next else low, "vmax": high}
        draw_colours(
            axes, nodes.phi.ravel(), nodes.xi, values.T, about.attributes, shading="gouraud", cmap=cmap, **ends
        )
    for impact in nodes.impacts:
        axes.axvline(impact, color=RED, linewidth=1.2)
    axes.set_xticks(*QUARTERS)
    noise = pair.generator.problem.noise_quantity.timed(time_unit)
    label_axes(axes, PHASE.attributes, (about if nodes.is_lines else noise).attributes)


def _draw_lines(axes: Axes, nodes: Nodes, values: FloatArray, *, is_log: bool) -> None:
    """A line over φ for each value of the noise, with a gap where the function jumps."""
    blocks = nodes.phi[..., None], values.reshape(*nodes.phi.shape, -1)
    phi, shown = (np.pad(each, ((0, 0), (0, 1), (0, 0)), constant_values=math.nan) for each in blocks)
    is_named = 1 < nodes.xi.size <= MOST_LINES
    for number, xi in enumerate(nodes.xi):
        axes.plot(phi.ravel(), shown[..., number].ravel(), label=rf"$\xi$ = {xi:g}" if is_named else None)
    axes.set_xlim(0, 2 * math.pi)
    if is_log:
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))


FIGURES = {
    RESPONSE: _of_response,
    SENSITIVITIES: _of_sensitivities,
    PHASE_AND_NOISE.part: _of_eigenfunctions,
    DIRECTIONS.part: _of_directions,
}
"""Of a parameter set in a folder, beside its simulation if there is one, by the names of the questions they answer."""
