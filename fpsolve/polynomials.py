"""Orthonormal polynomials of any weight and their rules of quadrature.

They follow from their three-term recurrence b_(k+1) P_(k+1) = (x − a_k) P_k − b_k P_(k−1).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.linalg import eigh_tridiagonal
from scipy.special import gammaln

from fpsolve.arrays import FloatArray, finite


@dataclass(frozen=True, eq=False)
class Polynomials:
    """Orthonormal under a weight of total 1; P₀ = 1.

    Attributes:
        a, b: a₀, …, a_(n−1) and b₁, …, b_n, shapes (n,).
    """

    a: FloatArray
    b: FloatArray

    def at(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """P_k(x) and P_k′(x) for k < n, shapes (len(x), n)."""
        found = np.zeros((self.a.size + 1, 2, x.size))
        found[0, 0] = 1.0
        for k, (a, b) in enumerate(zip(self.a, self.b, strict=True)):
            found[k + 1] = (x - a) * found[k]
            found[k + 1, 1] += found[k, 0]
            if k:
                found[k + 1] -= self.b[k - 1] * found[k - 1]
            found[k + 1] /= b
        return found[:-1, 0].T, found[:-1, 1].T

    @cached_property
    def rule(self) -> tuple[FloatArray, FloatArray]:
        """Gauss points by the method of Golub and Welsch, and weights, each to its own relative accuracy."""
        x = eigh_tridiagonal(finite(self.a), finite(self.b[:-1]), eigvals_only=True)
        return x, 1 / np.sum(self.at(x)[0] ** 2, axis=1)


@lru_cache(maxsize=64)
def hermite(count: int) -> Polynomials:
    """Those of exp(−x²/2)/√(2π)."""
    return Polynomials(np.zeros(count), np.sqrt(np.arange(1.0, count + 1)))


@lru_cache(maxsize=64)
def gegenbauer(count: int, exponent: float) -> Polynomials:
    """Those of (1 − x²)^exponent on [−1, 1], exponent > −1."""
    k, c = np.arange(2.0, count + 1), exponent + 0.5
    b = 0.5 * np.sqrt(k * (k + 2 * c - 1) / ((k - 1 + c) * (k + c)))
    return Polynomials(np.zeros(count), np.append(np.sqrt(0.5 / (1 + c)), b))


def logarithm(x: FloatArray, exponent: float, count: int) -> FloatArray:
    """ln(1 − x²) but for a constant, projected on the polynomials of degree < count in the weight (1 − x²)^exponent.

    ∫ (1 − x²)^b C_2k dx of the Gegenbauer polynomials of λ = exponent + ½ is known for every b. Its derivative at b =
    exponent gives ∫ ln(1 − x²) C_2k, in the mean −λ/(k(k + λ)).
    """
    polynomials, k, c = gegenbauer(count, exponent), np.arange(1, (count + 1) // 2), exponent + 0.5
    at_one = np.exp(gammaln(2 * c + 2 * k) - gammaln(2 * c) - gammaln(2 * k + 1))
    lengths = at_one / polynomials.at(np.ones(1))[0][0, 2 * k]
    return np.asarray(polynomials.at(x)[0][:, 2 * k] @ (-c / (k * (k + c)) / lengths))


def stieltjes(x: FloatArray, weights: FloatArray, count: int) -> Polynomials:
    """Those of a discrete weight on many more points than polynomials (Lanczos' form of the Stieltjes procedure)."""
    a, b = np.empty(count), np.empty(count)
    last, this = np.zeros_like(x), np.sqrt(weights / weights.sum())
    for k in range(count):
        image = x * this
        a[k] = this @ image
        image -= a[k] * this
        if k:
            image -= b[k - 1] * last
        b[k] = np.sqrt(image @ image)
        last, this = this, image / b[k]
    return Polynomials(a, b)
