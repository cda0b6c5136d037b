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
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem

NEXT_TO_NULL, STEPS = 1e-3, 6
"""σ of inverse iteration, over the rate at which moments decay, and its steps, which leave 1e-18."""
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
    decay, before = -growth.value, np.array(np.inf)
    if not decay > growth.error:
        raise FpsolveError(Message(Code.RESPONSE_UNSTABLE, value=growth.value, error=growth.error))
    equations = Equations(Problem(problem.linear.forced, problem.noise), 2)
    for finer in range(MOST_FINER + 1):
        found, left = _solved(equations, decay, finer)
        sizes = np.sqrt(np.maximum(np.diag(found), 0.0))
        lost = ROUNDING + (growth.rounding + left) / decay
        errors, squares = np.abs(found - before) + lost * np.outer(sizes, sizes), sizes[:-1] ** 2
        own = np.diag(errors)[:-1]
        if np.all(own <= rtol * squares):
            return StationaryMoments(found, errors)
        before = found
    raise NotConverged(Message(Code.RESPONSE_OPEN, size=float(np.max(own / squares))))


def _solved(equations: Equations, decay: float, finer: int) -> tuple[FloatArray, float]:
    """E yyᵀ of y = (x, 1), the null vector m of H, and |Hm|/|m|, with steps and functions as fine as that.

    By inverse iteration: each step divides what is left, which decays at a rate, by about this rate over σ.
    """
    counts = [math.ceil(FIRST * GROWTH**finer)] * len(equations.noises)
    mean = equations.means(counts)
    moments = np.kron(mean, np.eye(equations.scales.size)[-1])
    h = equations.rates(*equations.over_noise(counts), finer).at(0.0)
    inverse = h.inverse(NEXT_TO_NULL * decay, moments.size, ROUNDING)
    for _ in range(STEPS):
        moments = NEXT_TO_NULL * decay * inverse(moments)
    whole = mean @ moments.reshape(mean.size, -1) * equations.scales
    left = float(np.linalg.norm(h @ moments) / np.linalg.norm(moments))
    return moment_form(whole / whole[-1], equations.dimension, 2), left
