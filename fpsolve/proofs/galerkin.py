"""Trial functions in floats, by Galerkin's method with the weight P_s e^{2g}; nothing here needs to be exact.

With T = e^g u, g′ = β, the noise part of L is −½ ν ∫ P_s T_z S_z in its weak form, so that u solves

    −½ ν ⟨u_z + βu, w_z + βw⟩ + ⟨(F₀ + z F₁) u, w⟩ = Λ ⟨u, w⟩,      ⟨u, w⟩ = ∫∫ P_s e^{2g} u w dφ dz.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.special import roots_jacobi

from fpsolve.arrays import FloatArray
from fpsolve.fem.factors import sparse_lu
from fpsolve.proofs.balls import balls
from fpsolve.proofs.basis import Basis, hermite_table
from fpsolve.proofs.statement import Cylinder

REACH = 11.0
"""Standard deviations of the weight that the quadrature covers on either side."""


@dataclass(frozen=True)
class Pair:
    """Λ(p) and u, or λ and f.

    Attributes:
        value: Λ(p) or λ.
        table: u_km, complex, modes −K … K.
        centre: the mean of z in the moment.
    """

    value: float
    table: FloatArray
    centre: float

    @property
    def edges(self) -> tuple[float, float]:
        """Sizes of the coefficients of the highest mode and of the highest degree."""
        return float(np.abs(self.table[-1]).sum()), float(np.abs(self.table[:, -1]).sum())

    @property
    def cosine(self) -> FloatArray:
        """Coefficients of cos 2kφ, k = 0 … K."""
        half = self.table[len(self.table) // 2 :].real * 2
        half[0] /= 2
        return half

    @property
    def sine(self) -> FloatArray:
        """Coefficients of sin 2kφ."""
        return -2 * self.table[len(self.table) // 2 :].imag


class Galerkin:
    """The eigenproblem with modes up to `waves` and polynomials below `degrees`."""

    def __init__(self, noise: Cylinder, basis: Basis, p: float | None, waves: int, degrees: int) -> None:
        self.noise, self.waves, self.degrees = noise, waves, degrees
        z, weight = _quadrature(basis, noise, degrees)
        values, slopes = _tabulated(basis, z, degrees)
        full = slopes + basis.gauge * values
        self._mass, self._position = (values * weight) @ values.T, (values * weight * z) @ values.T
        diffusion = float(noise.nu) / 2 * (full * weight) @ full.T
        modes = sp.identity(2 * waves + 1)
        still, driven = (self._turning(i, 0.0 if p is None else p) for i in (0, 1))
        self.mass, self.position = sp.kron(modes, self._mass, format="csc"), sp.kron(modes, self._position)
        self.matrix = (
            sp.kron(modes, -diffusion) + sp.kron(still, self._mass) + sp.kron(driven, self._position)
        ).tocsc()

    def _turning(self, i: int, p: float) -> sp.csr_matrix:
        """F_i on the modes −K … K."""
        from flint import arb

        bands = self.noise.bands(i, arb(p), self.waves).astype(complex)
        size = bands.shape[1]
        rows = [sp.diags(bands[d][max(0, 1 - d) : size - max(0, d - 1)], 1 - d, shape=(size, size)) for d in range(3)]
        return sum(rows[1:], rows[0]).tocsr()

    @np.errstate(all="ignore")
    def pair(self, guess: float) -> Pair:
        """The eigenvalue nearest to a guess of Λ(p), by inverse iteration from a constant; NaN on overflow."""
        u = np.zeros(self.matrix.shape[0], complex)
        u[self.waves * self.degrees] = 1.0
        adjoint, value = u, guess
        for _ in range(2):
            factors = sparse_lu((self.matrix - value * self.mass).tocsc())
            for _ in range(4):
                u, adjoint = factors.solve(self.mass @ u), factors.solve(self.mass @ adjoint, "H")
                u, adjoint = (vector / vector[np.argmax(np.abs(vector))] for vector in (u, adjoint))
            value = float(np.real(np.vdot(adjoint, self.matrix @ u) / np.vdot(adjoint, self.mass @ u)))
        centre = np.real(np.vdot(adjoint, self.position @ u) / np.vdot(adjoint, self.mass @ u))
        mean = (self.mass @ u)[self.waves * self.degrees]
        return Pair(value, self._table(u / mean), float(centre))

    def drift(self) -> Pair:
        """λ, and f of mean 0 with L(0) f = λ − q − κh."""
        source = [self.noise.growth(i).astype(complex) for i in (0, 1)]
        load = np.zeros((2 * self.waves + 1, self.degrees), complex)
        first = slice(self.waves - 1, self.waves + 2)
        load[first] = np.outer(source[0], self._mass[0]) + np.outer(source[1], self._position[0])
        unit = np.zeros(load.size)
        unit[self.waves * self.degrees] = 1.0
        column = sp.csc_matrix(self.mass @ unit).T
        bordered = sp.bmat([[self.matrix, -column], [column.T, None]], format="csc")
        found = sparse_lu(bordered).solve(np.append(-load.ravel(), 0.0))
        return Pair(float(found[-1].real), self._table(found[:-1]), 0.0)

    def _table(self, u: FloatArray) -> FloatArray:
        """Modes −K … K of a real function, shape (modes, degrees)."""
        table = u.reshape(2 * self.waves + 1, self.degrees)
        return (table + table[::-1].conj()) / 2


def _quadrature(basis: Basis, noise: Cylinder, degrees: int) -> tuple[FloatArray, FloatArray]:
    """Gauss's z and weights that sum to 1."""
    a = float(noise.slope)
    if not basis.is_core:
        z, weight = roots_jacobi(2 * degrees + 40, a, a)
        return z, weight / weight.sum()
    reach = basis.centre + REACH * basis.scale * np.array([-1.0, 1.0])
    low, high = np.clip(reach, -1, 1) if noise.is_bounded else reach
    x, weight = np.polynomial.legendre.leggauss(4 * degrees + 100)
    z = (low + high) / 2 + (high - low) / 2 * x
    log = a * np.log1p(-z * z) if noise.is_bounded else -z * z / 2
    log += 2 * basis.gauge * z
    weight *= np.exp(log - log.max())
    return z, weight / weight.sum()


def _tabulated(basis: Basis, z: FloatArray, degrees: int) -> tuple[FloatArray, FloatArray]:
    """B_m(z) and B_m′(z), (degrees, points) each."""
    if basis.is_core:
        root = np.sqrt(np.arange(degrees))
        values = hermite_table((z - basis.centre) / basis.scale, root)
        return values, root[:, None] * np.concatenate([0 * values[:1], values[:-1]]) / basis.scale
    unit = balls(np.eye(degrees))
    values, slopes = (
        np.polynomial.chebyshev.chebval(z, part.astype(float).T) for part in (basis.values(unit), basis.slope(unit))
    )
    return values, slopes
