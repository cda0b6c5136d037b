"""Λ as a function of p."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, read_only, real_array, real_numbers, require
from fpsolve.data import Result, dataset
from fpsolve.errors import NotConverged
from fpsolve.exponent.curve import Values, values
from fpsolve.exponent.error import Absent, Estimate
from fpsolve.exponent.method import Budget, checked_moments
from fpsolve.exponent.root import SEARCH_INTERVAL, nonzero_root
from fpsolve.exponent.solver import (
    ExponentSolver,
    MomentLyapunov,
    broken_convexity,
    interpolated,
    solver_of,
)
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import DERIVATIVE, MOMENT, SECOND_DERIVATIVE, P

if TYPE_CHECKING:
    import xarray

SHOWN = 201
"""So many p of the interval are drawn."""
MOST_PARTS = 40
"""Largest number of polynomials."""


class MomentLyapunovFunction(Result):
    """Λ(p) of two variables on an interval of p, callable on arrays.

    It is solved at few p and is a polynomial of Λ(p)/p between these, see `exponent.curve`. Where none is accurate, as
    in strong noise, the interval is halved, and its halves are, until each part has one.

    >>> print(f"{MomentLyapunovFunction(problem, (-1.0, 3.0))(2.0):.9f}")
    -0.007397833

    Args:
        problem: a motion and its noise.
        interval: the smallest and the largest p.
        mesh: a mesh for all p; None chooses one that meets rtol.
        rtol: |error| ≤ rtol·max(|Λ|, the terms of Eq. (37) before they cancel); None is 1e-8, under two noises
            that are not white 1e-6.
        budget: what the choice of a mesh may cost for one p; None for the default one.
        solver: one of the same problem, to go on with; it decides the mesh, rtol and the budget.

    Attributes:
        nodes: the p that were solved, increasing, shape (n,).
        solver: what solved them; its pairs are the eigenfunctions.

    Raises:
        ValueError: the interval is empty or not finite.
        NoSuchExponent: Λ(p) is infinite in the interval.
        NotConverged: some p are not resolved on the mesh, or within the budget. Or there is no such function, as for
            several blocks or more variables.
    """

    def __init__(
        self,
        problem: Problem,
        interval: tuple[float, float],
        mesh: CylinderMesh | None = None,
        *,
        rtol: float | None = None,
        budget: Budget | None = None,
        solver: ExponentSolver | None = None,
    ) -> None:
        require(interval, Iterable, "interval", "the least and the largest p, such as (-1.0, 4.0)")
        self.solver = solver or solver_of(problem, mesh, rtol, budget)
        low, high = (float(end) for end in checked_moments(list(interval), self.solver.method))
        if not low < high:
            raise ValueError(f"the interval of p is {interval}; its ends must increase")
        self.interval = low, high
        self._curves = self.solver.curves(low, high, MOST_PARTS)
        self.nodes = read_only(np.unique([p for curve in self._curves for p in curve.nodes]))
        at = self._values(self.nodes)
        if obstacle := broken_convexity(self.nodes, at.value, at.derivative, at.error, lambda: at.derivative_error):
            raise NotConverged(obstacle, remedy=self.solver.method.refinement)

    def __call__(self, p: ArrayLike) -> FloatArray:
        """Λ(p), per unit time, of the shape of p. Raises `ValueError` outside the interval."""
        return self._values(p).value

    def derivative(self, p: ArrayLike) -> FloatArray:
        """Λ′(p)."""
        return self._values(p).derivative

    def second_derivative(self, p: ArrayLike) -> FloatArray:
        """Λ″(p)."""
        return self._values(p).second

    def error_estimate(self, p: ArrayLike) -> FloatArray:
        """Estimate of |error of Λ(p)|: what is left between the nodes, and their errors."""
        return self._values(p).error

    def derivative_error(self, p: ArrayLike) -> FloatArray:
        """Estimate of |error of Λ′(p)|, of the shape of p: of a polynomial by Markov's bound on its slope."""
        return self._values(p).derivative_error

    def moments(self, p: ArrayLike) -> MomentLyapunov:
        """Λ(p) at several p; the residual is the largest of the nodes. Raises `NotConverged` if they contradict."""
        return interpolated(self.solver, self._curves, checked_moments(p, self.solver.method))

    def stability_index(self, search: tuple[float, float] = SEARCH_INTERVAL) -> Estimate | Absent:
        """δ_p, see `nonzero_root`, or why there is none. Raises `NotConverged`."""
        return nonzero_root(self.solver, search)

    def to_xarray(self, p: ArrayLike | None = None) -> xarray.Dataset:
        """Λ(p) with its derivatives and errors at some p, `SHOWN` of the interval if none are given."""
        p = np.linspace(*self.interval, SHOWN) if p is None else real_numbers(p, "p")
        value, derivative, second, error, derivative_error = self._values(p)
        numbers = {
            MOMENT: value,
            MOMENT.error(): error,
            DERIVATIVE: derivative,
            DERIVATIVE.error(): derivative_error,
            SECOND_DERIVATIVE: second,
        }
        method, parameters = "finite elements at some p, and interpolation", self.solver.problem.values
        return dataset(MOMENT.words, method, numbers, {P: p}, parameters, rtol=self.solver.rtol)

    def _said(self) -> str:
        return "p from {:g} to {:g}, {} solved".format(*self.interval, self.nodes.size)

    def _values(self, p: ArrayLike) -> Values:
        """Everything at p, each of its shape. Raises `ValueError` outside the interval."""
        points = real_array(p, "p")
        low, high = self.interval
        slack = 1e-9 * (high - low)
        if not np.all((points >= low - slack) & (points <= high + slack)):
            raise ValueError(f"p must lie in [{low:g}, {high:g}], the interval of this function; make a wider one")
        found = values(self._curves, np.clip(points.ravel(), low, high))
        return Values(*(each.reshape(points.shape) for each in found))
