"""Functions f_k of a noise, g f_k = Σ Ξ_lk f_l and L_ξ f_k = Σ G_lk f_l: two matrices for each kind of noise."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import eigh_tridiagonal

from fpsolve.arrays import Coefficient, FloatArray
from fpsolve.model.noise import Noise
from fpsolve.model.parameters import cached_by_problem
from fpsolve.polynomials import gegenbauer, hermite

MORE_POINTS = 16
"""Number of points of a quadrature rule beyond two for each function."""
PURE = 1e-9
"""Difference of the logarithm of a density to that of Gauss or Gegenbauer that is rounding."""


class Functions(NamedTuple):
    """Functions f_k of a noise, nested by their degree.

    Attributes:
        degrees: of each, shape (n,).
        generator: G, shape (n, n).
        mass: Ξ of a coefficient g.
        unit: the coefficients of 1, shape (n,).
        law: E f_k, shape (n,).
    """

    degrees: Any
    generator: Any
    mass: Callable[[Coefficient], Any]
    unit: FloatArray
    law: FloatArray


def _polynomials(noise: Noise, count: int) -> Functions:
    """Those orthonormal in P_s, by a rule of Gauss for e^(−z²/2), or for (1 − z²)^a on a bounded support."""
    is_bounded = math.isfinite(noise.half_width)
    size, middle = (noise.half_width, 0.0) if is_bounded else (noise.standard_deviation, noise.mean)
    points = 2 * count + MORE_POINTS
    pure = gegenbauer(points, noise.end_exponent) if is_bounded else hermite(points)
    z, weights = pure.rule()
    values, slopes = (each[:, :count] for each in pure.at(z))
    xi = middle + size * z
    logs = noise.log_density(xi) - (noise.end_exponent * np.log1p(-(z**2)) if is_bounded else -0.5 * z**2)
    if np.ptp(logs) > PURE:
        weights = weights * np.exp(logs - logs.max())
        weights /= weights.sum()
        _, r = np.linalg.qr(np.sqrt(weights)[:, None] * values)
        values, slopes = (np.linalg.solve((np.sign(np.diag(r))[:, None] * r).T, each.T).T for each in (values, slopes))
    rates = 0.5 * weights * noise.squared_diffusion(xi) / size**2
    start = np.eye(1, count)[0]
    return Functions(
        np.arange(count),
        -slopes.T @ (rates[:, None] * slopes),
        lambda g: values.T @ ((weights * g(xi))[:, None] * values),
        start,
        start,
    )


def _states(noise: Any, count: int) -> Functions:
    """1 in one state each; of these there are never more."""
    states = np.array(noise.states)
    rates = np.array(noise.rates)
    return Functions(
        np.zeros(states.size), rates, lambda g: np.diag(g(states)), np.ones(states.size), noise.probabilities
    )


def _waves(noise: Any, count: int) -> Functions:
    """1, √2 cos kθ, √2 sin kθ of the angle dθ = ν dt + σ dW; the degree is k over the harmonics of coefficients."""
    k = (np.arange(2 * (count - 1) * noise.harmonics + 1) + 1) // 2
    points = 2 * k.size + 4 * MORE_POINTS
    theta = np.arange(points) * (2 * np.pi / points)
    waves = np.exp(1j * np.outer(theta, k))
    values = np.sqrt(2 - (k == 0)) * np.where(np.arange(k.size) % 2, waves.real, waves.imag)
    values[:, 0] = 1.0
    turn = np.where(np.arange(k.size - 1) % 2, k[1:], 0)  # (sin kθ)′ = k cos kθ
    generator = np.diag(-0.5 * noise.sigma**2 * k**2) + noise.nu * (np.diag(turn, 1) - np.diag(turn, -1))
    xi, start = noise.of_angle(theta), np.eye(1, k.size)[0]
    degrees = -(-k // noise.harmonics)
    return Functions(degrees, generator, lambda g: values.T @ (g(xi)[:, None] * values) / theta.size, start, start)


def _pairs(noise: Any, count: int) -> Functions:
    """He_i(u₁) He_j(u₂), i + j < count, with du = −Mu dt + N dW: L = −Σ M_ij a_j† a_i, a the lowering of degrees."""
    degrees, second = np.tril_indices(count)
    first = degrees - second
    lower = []
    for power, less in ((first, degrees), (second, degrees + 1)):
        at = np.flatnonzero(power)
        lower.append(sparse.csr_array((np.sqrt(power[at]), (at - less[at], at)), shape=2 * (degrees.size,)))
    generator = -sum(noise.drift_matrix[i, j] * (lower[j].T @ lower[i]) for i, j in np.ndindex(2, 2))
    start = np.eye(1, degrees.size)[0]

    def mass(g: Coefficient) -> Any:
        b = np.sqrt(np.arange(1.0, 2 * count + MORE_POINTS))
        u, vectors = eigh_tridiagonal(np.zeros(b.size + 1), b)
        table = vectors[:count] * np.sign(vectors[0])  # He_k at the points, times the roots of the weights
        matrix = (table * g(noise.standard_deviation * u)) @ table.T
        return np.where(np.equal.outer(second, second), matrix[np.ix_(first, first)], 0.0)

    return Functions(degrees, generator, mass, start, start)


FUNCTIONS = {"polynomials": _polynomials, "states": _states, "waves": _waves, "pairs": _pairs}
"""What makes those of a basis."""


@cached_by_problem(64)  # derivatives by parameters of the system have the same
def functions_of(noise: Noise, count: int) -> Functions:
    """Those of degrees below a count."""
    return FUNCTIONS[noise.basis](noise, count)
