"""What the errors of a fitted noise mean for stability, to first order by the derivatives of λ and Λ(2)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fpsolve.analysis.sensitivity import sensitivities
from fpsolve.analysis.spreads import Spread
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.measured.fit import NoiseFit
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import LYAPUNOV_EXPONENT


@dataclass(frozen=True)
class Verdict:
    """λ and Λ(2), in 1/time, each a `Spread` with a standard error; `below` of it is the probability that it is < 0.

    The law is normal. Its variance is that of the fit, and what the fit is off where it matters beyond standard errors.
    """

    exponent: Spread
    moment: Spread


def verdict(problem: Problem, fit: NoiseFit, *, rtol: float | None = None) -> Verdict:
    """λ and Λ(2) with the standard errors √(gᵀCg + (m ∂/∂ ln S)²).

    g = ∂/∂θ by the parameters of the noise, and C is their covariance. ∂/∂ ln S is the derivative by the size of the
    whole spectrum. m² is the largest of (measured/fitted − 1)² minus its variance at the frequencies that matter: where
    the family is not the true one, it tells the error that this makes.

    Args:
        problem: a system with `fit.noise`, in the unit in which the system takes it, see `NoiseFit.scaled`.
        fit: of the noise.
        rtol: as for `moment_lyapunov`.

    Raises:
        ValueError: the problem has another noise.
        NotConverged: λ or Λ(2) was not solved.
    """
    if problem.noise != fit.noise:
        raise ValueError("the noise of the problem is not that of the fit; make it of fit.noise, or of fit.scaled(...)")
    rtol = problem.usual_rtol if rtol is None else rtol
    solver = ExponentSolver(problem, rtol=rtol)
    exponent, moment = solver.lyapunov_exponent(), solver.solution(2.0)
    found = sensitivities(problem, [2.0], rtol=rtol)
    section = problem.system.noise_sections[0] if len(fit.parts) == 1 else "noise"
    return Verdict(
        _spread(exponent.value, exponent.error_estimate, found.indices[LYAPUNOV_EXPONENT.name], fit, section),
        _spread(moment.pair.value, moment.error, found.moments[0], fit, section),
    )


def _spread(value: float, error: float, slopes: Mapping[str, Estimate], fit: NoiseFit, section: str) -> Spread:
    g = np.array([slopes[f"{section}.{key}"].value for key in fit.parameters])
    by_size = 0.5 * float(g @ (fit.powers * np.array([*fit.parameters.values()])))
    return Spread(
        value, value, math.hypot(math.sqrt(max(float(g @ fit.covariance @ g), 0.0)), error, fit.off * by_size)
    )
