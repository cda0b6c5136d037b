"""Stationary first and second moments of a state that noise also forces: dx = … + f(ξ) dt + Σ b_k dW_k.

A variable that is 1 makes all terms linear: the moments of (x, 1) obey Z(0) S = 0, see `delays`, with 1·1 known. So
the others are one more solve with the same Z. They exist where Λ(2) < 0, and are reached from all starts (for one
variable U. Küchler and B. Mensch, Stochastics 40 (1992) 23).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent.moments import FIRST, GROWTH, Equations, even_moment
from fpsolve.exponent.powers import moment_form
from fpsolve.exponent.rightmost import ROUNDING
from fpsolve.fem.factors import sparse_lu
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem

MOST_FINER = 6
"""Largest number of times that steps and functions are made finer."""


@dataclass(frozen=True, eq=False)
class StationaryMoments:
    """The first and second moments of a stationary state, in the mean over a period where coefficients have one.

    Attributes:
        whole: E yyᵀ of y = (x, 1), shape (n + 1, n + 1).
        errors: estimates of |error| of these.
    """

    whole: FloatArray
    errors: FloatArray

    @property
    def mean(self) -> FloatArray:
        """E x, shape (n,): 0 unless a noise both multiplies and forces the state."""
        return self.whole[-1, :-1]

    @property
    def square(self) -> FloatArray:
        """E x xᵀ, shape (n, n)."""
        return self.whole[:-1, :-1]

    @property
    def covariance(self) -> FloatArray:
        """E x xᵀ − E x E xᵀ."""
        return self.square - np.outer(self.mean, self.mean)


def stationary_moments(problem: Problem, rtol: float = 1e-6) -> StationaryMoments:
    """E x and E x xᵀ of a system with terms of degree 0, and with delays or without.

    Args:
        problem: of a system with a `forced` one.
        rtol: wanted error of each E x_i², over it.

    Raises:
        FpsolveError: nothing forces the state, or Λ(2) is not negative.
        NoHierarchy: the equations do not close, or are too many.
        NotConverged: the error does not become that small.
    """
    if problem.linear.forced is None:
        raise FpsolveError(Message(Code.RESPONSE_LINEAR))
    growth = even_moment(problem, 2)
    if not growth.value < -growth.error:
        raise FpsolveError(Message(Code.RESPONSE_UNSTABLE, value=growth.value, error=growth.error))
    equations = Equations(Problem(problem.linear.forced, problem.noise), 2)
    before, lost = _solved(equations, 0), ROUNDING + growth.rounding / -growth.value
    for finer in range(1, MOST_FINER + 1):
        found = _solved(equations, finer)
        sizes = np.sqrt(np.maximum(np.diag(found), 0.0))
        errors, squares = np.abs(found - before) + lost * np.outer(sizes, sizes), sizes[:-1] ** 2
        if np.all(np.diag(errors)[:-1] <= rtol * squares):
            return StationaryMoments(found, errors)
        before = found
    raise NotConverged(Message(Code.RESPONSE_OPEN, size=float(np.max(np.diag(errors)[:-1] / squares))))


def _solved(equations: Equations, finer: int) -> FloatArray:
    """E yyᵀ of y = (x, 1), with steps and functions as fine as that."""
    counts = [math.ceil(FIRST * GROWTH**finer)] * len(equations.noises)
    mean, scales = equations.means(counts), equations.scales
    h = equations.rates(*equations.over_noise(counts), finer).at(0.0).matrix
    is_one = np.arange(h.shape[0]) % scales.size == scales.size - 1  # E 1·1 f
    moments = np.zeros(h.shape[0])
    moments[is_one] = mean
    factors = sparse_lu(h[~is_one][:, ~is_one], permc_spec="COLAMD")
    moments[~is_one] = -factors.solve(h[~is_one][:, is_one] @ mean)
    whole = mean @ moments.reshape(-1, scales.size) * (scales / scales[-1])
    return moment_form(whole, equations.dimension, 2)
