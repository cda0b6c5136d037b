"""The stationary response of a parameter set with terms of degree 3, or of degree 0."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fpsolve.case.case import Case
from fpsolve.case.sections import RESPONSE
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.forced import stationary_moments
from fpsolve.exponent.method import Budget
from fpsolve.model.problem import Problem
from fpsolve.solve.question import Job, Numbers, Question, Settings
from fpsolve.solve.set_result import ResponseDensity, SetResponse, SetResult, estimated

if TYPE_CHECKING:
    from fpsolve.nonlinear.response import StationaryResponse


MOST_GRIDS = 10
"""Largest number of parameter sets of which densities are written."""
Grid = tuple[int, int, int]
"""How many amplitudes, phases and values of the noise."""
SPREAD = 4.0
"""Standard deviations of the noise on each side of its mean in which its values lie."""


def solve_response(problem: Problem, rtol: float, grid: Grid | None, budget: Budget) -> SetResponse:
    """The stationary response, with its density if a grid is given, or by moments; raises as what it is found by."""
    if problem.linear.forced:
        moments = stationary_moments(problem, rtol)
        pairs, of_all = np.triu_indices(len(moments.whole), 1), (moments.whole, moments.errors, np.abs(moments.whole))
        columns = [np.append(np.diag(each)[:-1], each[pairs]).tolist() for each in of_all]
        return SetResponse(dict(zip(problem.linear.response.means, map(Estimate, *columns), strict=True)))
    from fpsolve.nonlinear.response import stationary_response  # 390 ms

    found = stationary_response(problem, rtol=rtol, budget=budget)
    return SetResponse(
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
    noise = problem.valued
    far = SPREAD * noise.standard_deviation
    low, high = max(noise.mean - far, -noise.half_width), min(noise.mean + far, noise.half_width)
    xi = low + (np.arange(values) + 0.5) * (high - low) / values  # the middles of cells
    whole = [found.density([each], phi, xi)[0] for each in a]  # one by one, which takes little memory
    of_plane = found.polar_density(a[:, None], phi)
    return ResponseDensity(
        a, phi, xi, found.amplitude_density(a), of_plane, np.array(whole, dtype=np.float32).astype(float)
    )


def _settings(case: Case, number: int) -> Settings | None:
    """The tolerance of the response, which is its own, and the grid of its density if there are few parameter sets."""
    if RESPONSE not in case.asked:
        return None
    grid = case.response.grid
    places = [grid.amplitude, grid.phi, grid.xi] if case.planned <= MOST_GRIDS else None
    return {"rtol": case.response.rtol, "grid": places}


def _solve(job: Job, settings: Settings) -> SetResponse:
    grid = settings["grid"] and tuple(settings["grid"])
    return solve_response(job.parameter_set.problem, settings["rtol"], grid, job.numerics.budget)


def _numbers(case: Case, result: SetResult | None) -> Numbers:
    about = case.problem.linear.response.numbers if RESPONSE in case.asked else {}
    found = result.response.numbers if result and result.response else {}
    return {key: value for name, each in about.items() for key, value in estimated(each, found.get(name)).items()}


QUESTION: Question = Question(
    RESPONSE,
    _settings,
    _solve,
    SetResponse,
    RESPONSE,
    numbers=_numbers,
)
