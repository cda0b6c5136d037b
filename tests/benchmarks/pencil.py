"""The principal eigenvalue of a pencil A(p) u = Λ(p) M u, A(p) = Σ pⁿ Aₙ, one p after another: what all peers share.

At p = 0 the pair is known: Λ = 0 and u = 1. From there the pair is followed outwards in p. Its neighbours predict
Λ and u; inverse iteration with the predicted Λ as shift, one LU factorisation for each p, corrects both. To be
sure that it is the principal pair that was followed, both ends of the curve are computed again by Arnoldi iteration
from a shift right of Λ, to which Λ is the nearest eigenvalue. There the matrix is definite, and elimination is stable
without pivoting. Near Λ small pivots are rare: a threshold of 1e-3 keeps the order of elimination, and the residual is
checked.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from tests.benchmarks.problem import FloatArray

DENSE_UNKNOWNS = 100  # below it LAPACK is faster than SuperLU
NEIGHBOURS = 4  # extrapolation by a cubic
MAX_STEPS = 30
BACKWARD_ERROR = 1e-9


class Pencil:
    """Λ(p) of A(p) = Σ pⁿ Aₙ and a symmetric positive definite M, all sparse and of the same size.

    Args:
        coefficients: A₀, A₁, ...
        mass: M.
        constant: the unknowns of the function 1, the eigenvector at p = 0.
        bound: a number right of Λ(p).
        tolerance: absolute one of Λ.
    """

    def __init__(
        self,
        coefficients: Sequence[sp.sparray],
        mass: sp.sparray,
        constant: FloatArray,
        bound: Callable[[float], float],
        tolerance: float,
    ) -> None:
        scale = mass.diagonal() ** -0.5  # P_s spans many orders of magnitude
        matrices = [
            (sp.diags_array(scale) @ matrix @ sp.diags_array(scale)).tocsc() for matrix in (*coefficients, mass)
        ]
        self._mass, self._bound, self._tolerance = matrices[-1], bound, tolerance
        self._pattern, self._entries = _on_one_pattern(matrices)
        constant = constant / scale
        weight = self._mass @ constant
        constant /= weight @ constant
        self._weight = weight / (weight @ constant)  # ∫ P_s u = 1 normalises every eigenvector
        self.known: dict[float, tuple[float, FloatArray]] = {0.0: (0.0, constant)}

    @property
    def unknowns(self) -> int:
        """Size of the matrices."""
        return self._mass.shape[0]

    def moment(self, p: float) -> float:
        """Λ(p), from the right."""
        return 0.0 if p == 0 else self._from_the_right(p)[0]

    def moments(self, p: FloatArray) -> FloatArray:
        """Λ at every p, followed from p = 0 outwards, and confirmed from the right at the first and the last p."""
        for point in sorted((float(point) for point in p), key=abs):
            if point not in self.known:
                self.known[point] = self.follow(point)
        for end in {float(np.min(p)), float(np.max(p))} - {0.0}:
            self.confirm(end)
        return np.array([self.known[float(point)][0] for point in p])

    def follow(self, p: float) -> tuple[float, FloatArray]:
        """Inverse iteration from the extrapolated pair; from the right where the neighbours are too far."""
        shift, u = self._predict(p)
        matrix = self._shifted(p, shift)
        solve, value = self._factor(matrix, pivot_threshold=1e-3), shift
        for _ in range(MAX_STEPS):
            image = solve(self._mass @ u)
            amount = self._weight @ image
            u, previous, value = image / amount, value, shift + 1 / amount
            if abs(value - previous) <= self._tolerance:
                break
        residual = np.linalg.norm(matrix @ u - (value - shift) * (self._mass @ u))
        if residual <= BACKWARD_ERROR * np.max(np.abs(matrix.data)) * np.linalg.norm(u):
            return value, u
        return self._from_the_right(p)

    def _predict(self, p: float) -> tuple[float, FloatArray]:
        """Value and vector of the polynomial through the nearest p, the value off by a little for a regular matrix."""
        nearest = sorted(self.known, key=lambda other: abs(other - p))[:NEIGHBOURS]
        share = [np.prod([(p - b) / (a - b) for b in nearest if b != a]) for a in nearest]
        pairs = [self.known[a] for a in nearest]
        value = sum(s * pair[0] for s, pair in zip(share, pairs, strict=True))
        return value + 100 * self._tolerance, sum(s * pair[1] for s, pair in zip(share, pairs, strict=True))

    def confirm(self, p: float) -> None:
        """Raise if the principal eigenvalue is another one than that which was followed."""
        (value, _), (principal, _) = self.known[p], self._from_the_right(p, tolerance=1e-4)
        if abs(principal - value) > 1e-2 * (self._bound(p) - value):
            raise ArithmeticError(f"at p = {p:g} the principal eigenvalue is {principal:g}, not {value:g}")

    def _from_the_right(self, p: float, tolerance: float = 0.0) -> tuple[float, FloatArray]:
        """The pair nearest to a shift right of Λ, by Arnoldi iteration."""
        shift = self._bound(p)
        solve = self._factor(self._shifted(p, shift), pivot_threshold=0.0)
        resolvent = spla.LinearOperator(self._mass.shape, lambda u: solve(self._mass @ u), dtype=float)
        (largest,), vectors = spla.eigs(resolvent, 1, v0=self.known[0.0][1], tol=tolerance)
        u = vectors[:, 0] / (self._weight @ vectors[:, 0])
        if abs(largest.imag) > 1e-6 * abs(largest):
            raise ArithmeticError(f"at p = {p:g} no real eigenvalue is nearest to {shift:g}: {shift + 1 / largest}")
        return float(shift + 1 / largest.real), u.real

    def _shifted(self, p: float, shift: float) -> sp.csc_array:
        """A(p) − shift M."""
        powers = p ** np.arange(len(self._entries) - 1)
        indices, indptr = self._pattern
        return sp.csc_array((np.append(powers, -shift) @ self._entries, indices, indptr), shape=self._mass.shape)

    def _factor(self, matrix: sp.csc_array, pivot_threshold: float) -> Callable[[FloatArray], FloatArray]:
        """Solutions of `matrix` u = f."""
        if self.unknowns <= DENSE_UNKNOWNS:
            factors = la.lu_factor(matrix.toarray(), overwrite_a=True, check_finite=False)
            return lambda f: la.lu_solve(factors, f, check_finite=False)
        symmetric = {"permc_spec": "MMD_AT_PLUS_A", "options": {"SymmetricMode": True}}
        return spla.splu(matrix, diag_pivot_thresh=pivot_threshold, **symmetric).solve


def _on_one_pattern(matrices: Sequence[sp.csc_array]) -> tuple[tuple[FloatArray, FloatArray], FloatArray]:
    """Row indices and column pointers of the union, and the entries of each matrix on it."""
    union = sum(abs(matrix) for matrix in matrices).tocsc()
    union.sort_indices()
    size = union.shape[0]
    keys = union.indices + size * np.repeat(np.arange(size), np.diff(union.indptr))
    entries = np.zeros((len(matrices), union.nnz))
    for row, matrix in zip(entries, matrices, strict=True):
        part = matrix.tocoo()
        np.add.at(row, np.searchsorted(keys, part.row + size * part.col.astype(np.int64)), part.data)
    return (union.indices, union.indptr), entries
