"""The rightmost eigenvalue of a generator of positive forms, as moments are, searched from the right.

No eigenvalue is nearer to a real σ > Λ than Λ, as none is on its right: a step to the left from a bound, by a share of
what remains, finds no other. On the left of Λ another one may be nearer.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs

from fpsolve.arrays import FloatArray
from fpsolve.budget import timed
from fpsolve.errors import NoHierarchy, SingularMatrix

ROUNDING = 10 * sys.float_info.epsilon
"""Error by rounding, over the terms of a sum."""
NEARER = 0.15
"""Share of σ − Λ that the next σ keeps."""
NEAR_ENOUGH = 1e-3
"""Change of Λ over σ − Λ with which the search ends."""
MOST_STEPS = 60
"""Largest number of σ."""
PASSED = 10.0
"""Factor to the last σ − Λ by which the next Λ is lower where rounding has put σ on the left of it: it is another."""
FEW = 16
"""Number of equations up to which all eigenvalues are found."""
MOST_POLISHES = 20
"""Largest number of σ from there on, for two steps of inverse iteration on both sides each."""
STILL = 1e-9
"""Largest change of a vector with the largest entry 1 that is none."""
ROUGH, VECTORS = 1e-2, 16
"""Tolerance of Arnoldi's method in the search, and the number of its vectors."""
ROUGHLY, EXACTLY = 1e-4, 1e-11
"""Tolerances of (σ − H)⁻¹ in the search and at its end."""
REMEDY = "compare with `fpsolve simulate`"

Solve = Callable[..., Any]
"""(σ − H)⁻¹ of a vector, or its transpose for trans = 1."""


class Eigenpair(NamedTuple):
    """An eigenvalue with its right and left vector, yᵀx = 1.

    Attributes:
        change: of the value by the last step, where that is not rounding.
        size: of the terms that the value is the sum of.
        finer: how many times polynomials of the time were made finer, where there are delays.
    """

    value: float
    x: Any
    y: Any
    change: float
    size: float
    finer: int = 0


class Rates(Protocol):
    """H, in whatever form it is held."""

    @property
    def T(self) -> Rates:
        """The transpose."""

    def __matmul__(self, x: FloatArray) -> FloatArray: ...

    def on(self, functions: Any) -> Rates:
        """H of some functions of the noise."""

    def sizes(self, x: FloatArray, y: FloatArray) -> float:
        """|y|ᵀ|H||x|."""

    def solver(self, sigma: float, tolerance: float = EXACTLY) -> Solve:
        """(σ − H)⁻¹, to a tolerance where that is by iteration. Raises `SingularMatrix`."""

    def at(self, value: float) -> Rates:
        """H at an eigenvalue, on which it depends where there are delays."""
        return self

    def inverse(self, sigma: float, size: int, tolerance: float = EXACTLY) -> Solve:
        """(σ − H)⁻¹ of so many numbers, within the budget. Raises as `solver`, and `OverBudget`."""
        with timed(size):
            solve = self.solver(sigma, tolerance)

        def asked(x: FloatArray, trans: int = 0) -> FloatArray:
            with timed(size):
                return solve(x, trans)

        return asked

    def rightmost(self, x: FloatArray, bound: float) -> Eigenpair:
        """The rightmost eigenvalue.

        Args:
            x: a positive right vector, which is a positive left one, too.
            bound: what no real part of an eigenvalue exceeds.

        Raises:
            NoHierarchy: it is not found.
        """
        y, size, change = x, self.sizes(x, x) / float(x @ x), 0.0
        sigma = bound + 0.1 * max(1e-3 * size, abs(bound), sys.float_info.min)
        value, away = -np.inf, np.inf
        for _ in range(MOST_STEPS):
            last, start = value, x
            share, x = _largest(self.inverse(sigma, x.size, ROUGHLY), x)
            value = sigma - 1 / share
            if last - value > PASSED * away:
                x, value, sigma = start, last, last + away
                break
            if abs(value - last) <= NEAR_ENOUGH * (sigma - value):
                break
            away = sigma - value
            sigma = value + NEARER * away
        for _ in range(MOST_POLISHES):
            before = x, y
            try:
                solve = self.inverse(sigma, x.size)
            except SingularMatrix:  # it is an eigenvalue to the last digit
                break
            for _ in range(2):
                x, y = (each / np.max(np.abs(each)) for each in (solve(x), solve(y, 1)))
            last, value = value, float(y @ (self @ x)) / float(y @ x)
            size = self.sizes(x, y) / abs(float(y @ x))
            change = abs(value - last)
            turned = max(np.max(np.abs(new - old)) for new, old in zip((x, y), before, strict=True))
            if change <= 0.1 * ROUNDING * size and turned <= STILL:
                break
            sigma = value + max(1e-3 * ROUNDING * size, NEARER * (sigma - value))
        return Eigenpair(value, x, y / (y @ x), change if change > ROUNDING * size else 0.0, size)


def _largest(solve: Solve, x: FloatArray) -> tuple[float, FloatArray]:
    """The largest real part of an eigenvalue of a positive map, and its vector, from a positive one."""
    if x.size <= FEW:
        values, vectors = np.linalg.eig(np.column_stack([solve(each) for each in np.eye(x.size)]))
    else:
        operator = LinearOperator(2 * x.shape, matvec=solve, dtype=float)
        try:
            values, vectors = eigs(operator, 1, which="LR", v0=x, ncv=VECTORS, tol=ROUGH)
        except ArpackError as failure:
            told = f"no rightmost eigenvalue is found among those of {x.size} equations"
            raise NoHierarchy(f"{told}; {REMEDY}") from failure
    at = int(np.argmax(values.real))
    return float(values[at].real), vectors[:, at].real
