"""What the errors of a fitted noise mean for stability, to first order by the derivatives of λ and Λ(2)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fpsolve.analysis.sensitivity import Sensitivities, solve_sensitivities
from fpsolve.analysis.spreads import Spread
from fpsolve.errors import FpsolveError, NoSuchExponent, NotConverged
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.method import Budget
from fpsolve.exponent.solver import solver_of
from fpsolve.measured.fit import NoiseFit
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import LYAPUNOV_EXPONENT

STEPS = 4
"""Of `verdict`, each of which calls `progress`."""


@dataclass(frozen=True)
class Verdict:
    """λ and Λ(2), in 1/time, each a `Spread` with a standard error; `below` of it is the probability that it is < 0.

    The law is normal. Its variance is that of the fit, and what the fit is off where it matters beyond standard errors.
    In a narrow band Λ(2) is known at once, by moment equations, and λ may not converge: it is None then, and `failure`
    says why.
    """

    exponent: Spread | None
    moment: Spread | None
    failure: Message | None = None


def verdict(
    problem: Problem,
    fit: NoiseFit,
    *,
    rtol: float | None = None,
    budget: Budget | None = None,
    progress: Callable[[], None] = lambda: None,
) -> Verdict:
    """λ and Λ(2) with the standard errors √(gᵀCg + (m ∂/∂ ln S)²).

    g = ∂/∂θ by the parameters of the noise, and C is their covariance. ∂/∂ ln S is the derivative by the size of the
    whole spectrum. m² is the largest of (measured/fitted − 1)² minus its variance at the frequencies that matter: where
    the family is not the true one, it tells the error that this makes.

    Args:
        problem: a system with `fit.noise`, in the unit in which the system takes it, see `NoiseFit.scaled`.
        fit: of the noise.
        rtol, budget: as for `moment_lyapunov`.
        progress: called for λ and Λ(2), and again for the derivatives of each: `STEPS` times.

    Raises:
        ValueError: the problem has another noise.
        NotConverged: neither λ nor Λ(2) was solved.
    """
    solver = solver_of(problem, rtol=rtol, budget=budget)
    if problem.noise != fit.noise:
        raise ValueError("the noise of the problem is not that of the fit; make it of fit.noise, or of fit.scaled(...)")
    section = problem.system.noise_sections[0] if len(fit.parts) == 1 else "noise"
    keys = [f"{section}.{key}" for key in fit.parameters]
    along = {key: by for key, by in problem.derivatives().items() if key in keys}
    name = LYAPUNOV_EXPONENT.name

    def moment() -> Spread:
        if even := solver.method.even(2.0):
            progress()
            return _spread(even.value, even.error, {key: even.slope(key)[0] for key in keys}, fit, keys)
        found = solver.solution(2.0)
        progress()
        slopes = _slopes(solve_sensitivities(solver, np.array([2.0]), along, indices=[], progress=progress))
        return _spread(found.value, found.error, _values(slopes.moments[0]), fit, keys)

    def exponent() -> Spread:
        found = solver.lyapunov_exponent()
        progress()
        slopes = _slopes(solve_sensitivities(solver, np.zeros(0), along, indices=[name], progress=progress))
        return _spread(found.value, found.error_estimate, _values(slopes.indices[name]), fit, keys)

    solved, failures = list[Spread | None](), list[FpsolveError]()
    for solve in (moment, exponent):
        try:
            solved.append(solve())
        except (NotConverged, NoSuchExponent) as failure:
            solved.append(None)
            failures.append(failure)
    if len(failures) == len(solved):
        raise failures[-1]
    return Verdict(solved[1], solved[0], failures[0].message if failures else None)


def _values(slopes: Mapping[str, Estimate]) -> dict[str, float]:
    return {key: each.value for key, each in slopes.items()}


def _slopes(found: Sensitivities) -> Sensitivities:
    """Derivatives. Raises `NotConverged` where there are none."""
    for note in found.notes:
        if note.code is Code.NO_SENSITIVITIES:
            raise NotConverged(note.data["reason"])
    return found


def _spread(value: float, error: float, slopes: Mapping[str, float], fit: NoiseFit, keys: Sequence[str]) -> Spread:
    g = np.array([slopes[key] for key in keys])
    by_size = 0.5 * float(g @ (fit.powers * np.array([*fit.parameters.values()])))
    return Spread(
        value, value, math.hypot(math.sqrt(max(float(g @ fit.covariance @ g), 0.0)), error, fit.off * by_size)
    )
