"""Stationary first and second moments of a state with delays that noise also forces: dx = … + f(ξ) dt + Σ b_k dW_k.

A variable that is 1 makes all terms linear: the moments of (x, 1) obey Z(0) S = 0, see `delays`, with 1·1 known. So
the others are one more solve with the same Z. They exist where Λ(2) < 0, and are reached from all starts (for one
variable U. Küchler and B. Mensch, Stochastics 40 (1992) 23).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent.delays import ROUNDED
from fpsolve.exponent.moments import FIRST, GROWTH, Equations, even_moment
from fpsolve.exponent.powers import moment_form
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem

MOST_FINER = 6
"""Largest number of times that steps and functions are made finer."""


@dataclass(frozen=True, eq=False)
class StationaryMoments:
    """The first and second moments of a stationary state, in the mean over a period where coefficients have one.

    Attributes:
        mean: E x, shape (n,): 0 unless a noise both multiplies and forces the state.
        square: E x xᵀ, shape (n, n).
        error_estimate: estimate of |error| of `square`.
    """

    mean: FloatArray
    square: FloatArray
    error_estimate: FloatArray

    @property
    def covariance(self) -> FloatArray:
        """E x xᵀ − E x E xᵀ."""
        return self.square - np.outer(self.mean, self.mean)


def stationary_moments(problem: Problem, rtol: float = 1e-6) -> StationaryMoments:
    """E x and E x xᵀ of a system with delays and terms of degree 0.

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
    before, _ = _solved(equations, 0)
    for finer in range(1, MOST_FINER + 1):
        found, rounding = _solved(equations, finer)
        errors = np.abs(found - before) + rounding
        squares = np.maximum(np.diag(found)[:-1], 0.0)
        if np.all(np.diag(errors)[:-1] <= rtol * squares):
            return StationaryMoments(found[-1, :-1], found[:-1, :-1], errors[:-1, :-1])
        before = found
    raise NotConverged(Message(Code.RESPONSE_OPEN, size=float(np.max(np.diag(errors)[:-1] / squares))))


def _solved(equations: Equations, finer: int) -> Iterator[FloatArray]:
    """E yyᵀ of y = (x, 1) and what rounding changes, with steps and functions as fine as that."""
    counts = [math.ceil(FIRST * GROWTH**finer)] * len(equations.noises)
    mean, scales = equations.means(counts), equations.scales
    rates = equations.rates(*equations.over_noise(counts), finer)
    z, sizes = rates.matrix(0.0), rates.sizes(0.0)
    is_one = np.arange(len(z)) % scales.size == scales.size - 1  # E 1·1 f
    moments, rounding = np.zeros((2, len(z)))
    moments[is_one] = mean
    inverse = np.linalg.inv(z[~is_one][:, ~is_one])
    moments[~is_one] = -inverse @ (z[~is_one][:, is_one] @ mean)
    rounding[~is_one] = ROUNDED * np.abs(inverse) @ (sizes[~is_one] @ np.abs(moments))
    return (
        moment_form(weights @ each.reshape(-1, scales.size) * (scales / scales[-1]), equations.dimension, 2)
        for weights, each in ((mean, moments), (np.abs(mean), rounding))
    )
