"""What the errors of a fitted noise mean for stability, to first order by the derivatives of λ and Λ(2)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fpsolve.analysis.sensitivity import solve_sensitivities
from fpsolve.analysis.spreads import Spread
from fpsolve.errors import NotConverged
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.solver import solver_of
from fpsolve.measured.fit import NoiseFit
from fpsolve.messages import Code
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import LYAPUNOV_EXPONENT

STEPS = 4
"""Of `verdict`, each of which calls `progress`."""


@dataclass(frozen=True)
class Verdict:
    """λ and Λ(2), in 1/time, each a `Spread` with a standard error; `below` of it is the probability that it is < 0.

    The law is normal. Its variance is that of the fit, and what the fit is off where it matters beyond standard errors.
    """

    exponent: Spread
    moment: Spread


def verdict(
    problem: Problem, fit: NoiseFit, *, rtol: float | None = None, progress: Callable[[], None] = lambda: None
) -> Verdict:
    """λ and Λ(2) with the standard errors √(gᵀCg + (m ∂/∂ ln S)²).

    g = ∂/∂θ by the parameters of the noise, and C is their covariance. ∂/∂ ln S is the derivative by the size of the
    whole spectrum. m² is the largest of (measured/fitted − 1)² minus its variance at the frequencies that matter: where
    the family is not the true one, it tells the error that this makes.

    Args:
        problem: a system with `fit.noise`, in the unit in which the system takes it, see `NoiseFit.scaled`.
        fit: of the noise.
        rtol: as for `moment_lyapunov`.
        progress: called for λ and Λ(2), and again for the derivatives of each: `STEPS` times.

    Raises:
        ValueError: the problem has another noise.
        NotConverged: λ, Λ(2) or a derivative was not solved.
    """
    solver = solver_of(problem, rtol=rtol)
    if problem.noise != fit.noise:
        raise ValueError("the noise of the problem is not that of the fit; make it of fit.noise, or of fit.scaled(...)")
    exponent = solver.lyapunov_exponent()
    progress()
    moment = solver.solution(2.0)
    progress()
    section = problem.system.noise_sections[0] if len(fit.parts) == 1 else "noise"
    keys = [f"{section}.{key}" for key in fit.parameters]
    along = {key: by for key, by in problem.derivatives().items() if key in keys}
    name = LYAPUNOV_EXPONENT.name
    found = solve_sensitivities(solver, np.array([2.0]), along, indices=[name], progress=progress)
    for note in found.notes:
        if note.code is Code.NO_SENSITIVITIES:
            raise NotConverged(note.data["reason"])
    return Verdict(
        _spread(exponent.value, exponent.error_estimate, found.indices[name], fit, keys),
        _spread(moment.pair.value, moment.error, found.moments[0], fit, keys),
    )


def _spread(value: float, error: float, slopes: Mapping[str, Estimate], fit: NoiseFit, keys: Sequence[str]) -> Spread:
    g = np.array([slopes[key].value for key in keys])
    by_size = 0.5 * float(g @ (fit.powers * np.array([*fit.parameters.values()])))
    return Spread(
        value, value, math.hypot(math.sqrt(max(float(g @ fit.covariance @ g), 0.0)), error, fit.off * by_size)
    )
