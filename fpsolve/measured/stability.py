"""What the errors of a fitted noise mean for stability, to first order by the derivatives of λ and Λ(2)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fpsolve.analysis.spreads import Spread
from fpsolve.arrays import FloatArray
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent.method import Budget
from fpsolve.exponent.solver import solver_of
from fpsolve.measured.fit import NoiseFit
from fpsolve.messages import Message
from fpsolve.model.problem import Problem

STEPS = 2
"""Of `verdict`, each of which calls `progress`."""
SURE = 2.0
"""Standard errors from 0 beyond which a sign is decided."""


@dataclass(frozen=True)
class GrowthRate(Spread):
    """λ or Λ(2), whose standard error `deviation` is the root of the sum of the squares of three.

    Attributes:
        scatter: that by the errors of the measured values, 1/√k of it with k times as long a record.
        misfit: that by what a fit is off beyond these errors, as no noise of its kind is the measured one.
        numerical: that of the solution.
    """

    scatter: float
    misfit: float
    numerical: float

    @property
    def is_decided(self) -> bool:
        return abs(self.value) > SURE * self.deviation

    @property
    def times(self) -> float:
        """How many times as long a record decides the sign of this value; ∞ where none does."""
        left = (self.value / SURE) ** 2 - self.misfit**2 - self.numerical**2
        return self.scatter**2 / left if left > 0 else math.inf


@dataclass(frozen=True)
class Verdict:
    """λ and Λ(2), in 1/time, each with a standard error; `below` of it is the probability that it is < 0.

    The law is normal. Its variance is that of the fit, and what the fit is off where it matters beyond standard errors.
    In a narrow band Λ(2) is known at once, by moment equations, and λ may not converge: it is None then, and `failure`
    says why.
    """

    exponent: GrowthRate | None
    moment: GrowthRate | None
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
        progress: called after λ and after Λ(2): `STEPS` times.

    Raises:
        ValueError: the problem has another noise.
        NotConverged: neither λ nor Λ(2) was solved.
    """
    solver = solver_of(problem, rtol=rtol, budget=budget)
    if problem.noise != fit.noise:
        raise ValueError("the noise of the problem is not that of the fit; make it of fit.noise, or of fit.scaled(...)")
    keys = [f"{section}.{name}" for section in [*problem.sections][1:] for name in fit.names]

    def moment() -> GrowthRate:
        if even := solver.method.even(2.0):
            return _rate(even.value, even.error, np.array([even.slope(key)[0] for key in keys]), fit)
        found = solver.solution(2.0)
        return _rate(found.value, found.error, 2 * solver.method.gradient(2.0, keys), fit)

    def exponent() -> GrowthRate:
        found = solver.lyapunov_exponent()
        return _rate(found.value, found.error_estimate, solver.method.gradient(0.0, keys), fit)

    solved, failure = list[GrowthRate | None](), None
    for solve in (moment, exponent):
        try:
            solved.append(solve())
        except (NotConverged, NoSuchExponent) as error:
            solved.append(None)
            failure = error
        progress()
    if failure and not any(solved):
        raise failure
    return Verdict(solved[1], solved[0], failure.message if failure else None)


def _rate(value: float, error: float, g: FloatArray, fit: NoiseFit) -> GrowthRate:
    """A value with its numerical error and its derivatives g by the parameters of a fit."""
    by_size = 0.5 * float(g @ (fit.powers * fit.values))
    scatter, misfit = math.sqrt(max(float(g @ fit.covariance @ g), 0.0)), abs(fit.off * by_size)
    if not any(abs(each.relative) > SURE * each.error for each in fit.misfit):  # it may be scatter, too
        scatter, misfit = math.hypot(scatter, misfit), 0.0
    return GrowthRate(value, value, math.hypot(scatter, misfit, error), scatter, misfit, error)
