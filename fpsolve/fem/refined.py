"""Solutions by factors that round too much, refined until only the rounding of the matrix itself is left."""

from __future__ import annotations

import math

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.dense import Factors

REFINEMENTS = 5
"""Largest number of refinements of a solution."""
ROUNDING = 1e-16
"""Backward error below which a solution is not refined."""
LEAST_GAIN = 0.1
"""Largest share of the backward error that a refinement may leave, or there are no more of its kind."""
CALL_OPERATIONS = 1e7
"""Number of operations that take the time of the calls of four solutions, 0.35 ms."""
GIGABYTE_OPERATIONS = 2e10
"""Number of operations that take the time of refining four solutions with factors of one gigabyte, 0.7 s."""
LEAST_SHARE = 1e-8
"""Least share in a load of the vector of an eigenvalue close by, from which on it is in the solution."""


class RefinedFactors:
    """Factors of a sum, and the sum itself, by which their solutions are corrected.

    Attributes:
        rough: the factors.
    """

    def __init__(self, operator: KroneckerSum, factors: Factors) -> None:
        self._operator, self.rough, self.gigabytes = operator, factors, factors.gigabytes
        self.operations = factors.operations + CALL_OPERATIONS + GIGABYTE_OPERATIONS * factors.gigabytes
        self._vectors = dict[bool, FloatArray]()  # right and left, of an eigenvalue close by

    def make(self) -> None:
        """Eliminate."""
        self.rough.make()

    def solve(self, b: FloatArray, *, transposed: bool = False) -> FloatArray:
        """x of A x = b, or of Aᵀx = b, refined until only rounding is left.

        Next to an eigenvalue x has its vector so often that errors in it hide all others. Then what is refined is x of
        A x = γ b, such that ⟨v, A x − γ b⟩ = 0, v the left vector, and x/γ is the solution.
        """
        operator, x = self._operator.T if transposed else self._operator, self.rough.solve(b, transposed=transposed)
        gamma, last, left = 1.0, math.inf, self._vectors.get(not transposed)
        for _ in range(REFINEMENTS):
            image = operator @ x
            if left is not None and abs(left @ b) > LEAST_SHARE * float(np.linalg.norm(left) * np.linalg.norm(b)):
                gamma = float(left @ image / (left @ b))
            rest = gamma * b - image
            error = float(np.linalg.norm(rest)) / (self._operator.norm * float(np.linalg.norm(x)))
            if error < ROUNDING:
                break
            if error < LEAST_GAIN * last:
                x, last = x + self.rough.solve(rest, transposed=transposed), error
            elif left is None:
                left, last = self.rough.solve(b, transposed=not transposed), math.inf
            else:
                break
        if left is not None:
            self._vectors[transposed] = x
        return x / gamma
