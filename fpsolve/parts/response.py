"""The stationary response of a curve with terms of degree 3, or of degree 0 with a delay: its numbers, its density,
their files and figures.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.case.case import Case
from fpsolve.case.sections import RESPONSE
from fpsolve.data import Quantity
from fpsolve.drawing import COLOURS, Format, draw_colours, draw_dots, figure_for, label_axes, points
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.forced import stationary_moments
from fpsolve.exponent.method import Budget
from fpsolve.files import write_csv
from fpsolve.model.noise import Noise
from fpsolve.model.plane import System
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import ResponseQuantities
from fpsolve.page.page import Block, Drawing, Sentence, filled
from fpsolve.parts.part import Job, Part, Settings, estimated
from fpsolve.results.curve import CurveResponse, CurveResult, ResponseDensity, SimulatedCurve
from fpsolve.results.table import pair
from fpsolve.results.text import NUMBER_COLUMNS, row_of
from fpsolve.vtk import field_data, write_between

if TYPE_CHECKING:
    from fpsolve.nonlinear.response import StationaryResponse
    from fpsolve.simulation.response import Response

MOST_GRIDS = 10
"""Largest number of curves of which densities are written."""
Grid = tuple[int, int, int]
"""How many amplitudes, phases and values of the noise."""
SPREAD = 4.0
"""Standard deviations of the noise on each side of its mean in which its values lie."""


def solve_response(problem: Problem, rtol: float, grid: Grid | None, budget: Budget) -> CurveResponse:
    """The stationary response, with its density if a grid is given, or by moments; raises as what it is found by."""
    if problem.system.forced:
        moments = stationary_moments(problem, rtol)
        squares = zip(np.diag(moments.square).tolist(), np.diag(moments.error_estimate).tolist(), strict=True)
        estimates = [Estimate(value, error, abs(value)) for value, error in squares]
        return CurveResponse(dict(zip(problem.system.response.means, estimates, strict=True)))
    from fpsolve.nonlinear.response import stationary_response  # which takes a while to import

    found = stationary_response(problem, rtol=rtol, budget=budget)
    return CurveResponse(
        found.means,
        found.impact_rate,
        found.balance,
        found.stability_index,
        found.minimum_over_maximum,
        found.unknowns,
        None if grid is None else _density(found, grid),
    )


def _density(found: StationaryResponse, grid: Grid) -> ResponseDensity:
    amplitudes, phases, values = grid
    problem = found.problem
    a = (np.arange(amplitudes) + 0.5) * found.reach / amplitudes
    phi = found.flow.phases(phases)
    xi = _values_of(problem.valued, values)
    whole = [found.density([each], phi, xi)[0] for each in a]  # one by one, which takes little memory
    of_plane = found.polar_density(a[:, None], phi)
    return ResponseDensity(
        a, phi, xi, found.amplitude_density(a), of_plane, np.array(whole, dtype=np.float32).astype(float)
    )


def _values_of(noise: Noise, count: int) -> FloatArray:
    """Middles of cells in which nearly all of the noise is."""
    far = SPREAD * noise.standard_deviation
    low, high = max(noise.mean - far, -noise.half_width), min(noise.mean + far, noise.half_width)
    return np.asarray(low + (np.arange(count) + 0.5) * (high - low) / count)


def _settings(case: Case, number: int) -> Settings | None:
    """The tolerance of the response, which is its own, and the grid of its density if there are few curves."""
    if not case.has_response:
        return None
    grid = case.response.grid
    places = [grid.amplitude, grid.phi, grid.xi] if case.planned <= MOST_GRIDS else None
    return {"rtol": case.response.rtol, "grid": places}


def _solve(job: Job, settings: Settings) -> CurveResponse:
    grid = settings["grid"] and tuple(settings["grid"])
    return solve_response(job.curve.problem, settings["rtol"], grid, job.numerics.budget)


def _numbers(case: Case, result: CurveResult | None) -> Mapping[Quantity, Any]:
    about = case.system.response.numbers if case.has_response else {}
    found = result.response.numbers if result and result.response else {}
    return {key: value for name, each in about.items() for key, value in estimated(each, found.get(name)).items()}


def _content(case: Case, result: CurveResult) -> Mapping[str, Any]:
    """The means and impacts with their errors, what the density does near rest, and how far these are to be trusted."""
    if not case.has_response or (found := result.response) is None:
        return {RESPONSE: None} if case.has_response else {}
    means: dict[str, Any] = {}
    for name, number in found.means.items():
        means |= pair(name, number)
    content = {
        "means": means,
        **({} if found.impact_rate is None else pair("impact_rate", found.impact_rate)),
    }
    if found.balance is not None:
        content |= {
            "has_hump": found.has_hump,
            "has_crater": found.has_crater,
            **pair("balance", found.balance),
            "least_over_largest_density": found.least,
            "unknowns": found.unknowns,
        }
    return {RESPONSE: content}


def _files(result: CurveResult, folder: Path) -> None:
    """Write the stationary density of a curve, if it has one, as response.csv, response.vtu and response_3d.vtu.

    The table has that of the amplitude. response.vtu shows both variables as x and y, with the `density` of these, and
    `amplitude` and `phi`; response_3d.vtu shows (a, φ, ξ) as x, y and z, with the `density` of these. Field data: the
    numbers of the response, `stability_index`, and the parameters as in `write_eigenfunctions`.
    """
    found, curve = result.response, result.curve
    if found is None or found.density is None:
        return
    density, system = found.density, curve.problem.system
    rows = zip(density.amplitude.tolist(), density.of_amplitude.tolist(), strict=True)
    write_csv(folder / f"response{curve.suffix}.csv", ["amplitude", "density"], rows)
    about = system.response.numbers
    known = {about[name].name: each.value for name, each in found.numbers.items()}
    facts = {
        **known,
        "stability_index": found.stability_index,
        "curve": float(curve.number),
        **field_data(curve.parameters, curve.varied, curve.problem),
    }
    phases, of_plane = density.plane(system.response.has_wall)
    a, phi = np.meshgrid(density.amplitude, phases, indexing="ij")
    plane = {"density": of_plane, "amplitude": a, "phi": phi}
    places = [a * np.cos(phi), -a * system.aspect * np.sin(phi), 0 * a]
    write_between(folder / f"response{curve.suffix}.vtu", places, plane, facts)
    places = [*np.meshgrid(density.amplitude, density.phi, density.xi, indexing="ij")]
    whole = {"density": density.whole.astype(np.float32)}
    write_between(folder / f"response_3d{curve.suffix}.vtu", places, whole, facts)


def _show(case: Case, result: CurveResult) -> Iterator[Block]:
    """The means and the impacts with their errors, and where the densities are largest."""
    if result.response is None:
        return
    about = case.system.response
    rows = [row_of(about.numbers[name], each, case.units.time) for name, each in result.response.numbers.items()]
    yield filled(f"Stationary response{result.curve.of}", NUMBER_COLUMNS, rows)
    if result.response.balance is not None:
        yield Sentence(shape(result.response, about))


def shape(found: CurveResponse, about: ResponseQuantities) -> str:
    """Where the densities of a response are largest: what changes at δ_p = −1 and −2, the P-bifurcations."""
    both = about.joint_symbol
    if not found.has_hump:
        return f"ρ(A) and {both} are infinite at rest, as δ_p > -1."
    plane = "a crater around rest, as δ_p < -2" if found.has_crater else "is infinite there, as δ_p > -2"
    return f"ρ(A) has a hump away from rest, as δ_p < -1, and {both} {plane}."


def _figures(case: Case, result: CurveResult, folder: Path, simulated: SimulatedCurve | None) -> Iterator[Drawing]:
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


PART: Part = Part(
    RESPONSE,
    _settings,
    _solve,
    CurveResponse,
    RESPONSE,
    numbers=_numbers,
    content=_content,
    files=_files,
    show=_show,
    figures=_figures,
    uses_solver=False,
)
