"""Probability densities of (φ, ξ) on the full circle: stationary, adjoint and tilted, and their means."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.model.vibro_impact import q1


@dataclass(frozen=True, eq=False)
class Density:
    """A probability density on the cylinder, known at the points of a quadrature rule.

    Attributes:
        phi: points on the full circle, shape (m,), increasing.
        xi: points on the noise axis, shape (n,), increasing.
        phi_weights, xi_weights: weights of the rule, so that ∫f dφ dξ = phi_weights @ f @ xi_weights.
        values: the density, per radian and unit of ξ, shape (m, n).
    """

    phi: FloatArray
    xi: FloatArray
    phi_weights: FloatArray
    xi_weights: FloatArray
    values: FloatArray

    def mean(self, f: Callable[[FloatArray, FloatArray], ArrayLike]) -> float:
        """∫ f(φ, ξ) ρ dφ dξ; f gets φ as a column and ξ as a row, and may return either, or a number."""
        return float(
            self.phi_weights @ (np.asarray(f(self.phi[:, None], self.xi[None])) * self.values) @ self.xi_weights
        )

    def phi_marginal(self) -> FloatArray:
        """∫ρ dξ at `phi`, shape (m,)."""
        return self.values @ self.xi_weights

    def xi_marginal(self) -> FloatArray:
        """∫ρ dφ at `xi`, shape (n,)."""
        return self.phi_weights @ self.values


def stationary_density(pair: PrincipalPair) -> Density:
    """ρ(φ, ξ), solution of the Fokker-Planck equation L*(0)ρ = 0.

    Raises:
        ValueError: the pair is not the one at p = 0.
    """
    if pair.p != 0:
        raise ValueError(
            f"the stationary density is the adjoint eigenfunction at p = 0, but the pair has p = {pair.p:g}"
        )
    return adjoint_density(pair)


def adjoint_density(pair: PrincipalPair) -> Density:
    """T*(φ, ξ; p) normalised to 1."""
    return _density(pair, lambda right, left, factor: left / factor)


def tilted_density(pair: PrincipalPair) -> Density:
    """T T*: how phase and noise are distributed along the paths that carry the p-th moment."""
    return _density(pair, lambda right, left, factor: right * left)


def furstenberg_khasminskii(pair: PrincipalPair) -> float:
    """λ = ∫(ε q₁ξ + ε² q₂) ρ dφ dξ + ω ln R ∫[ρ(π/2, ξ) + ρ(3π/2, ξ)] dξ, with ρ from the pair at p = 0.

    ω ρ is the probability flux through an impact, where the log-amplitude jumps by ln R; it is taken at φ⁻,
    from where the impact is met.
    """
    generator, space = pair.generator, pair.generator.space
    oscillator, density = generator.oscillator, stationary_density(pair)
    eps = oscillator.epsilon
    growth = density.mean(lambda phi, xi: eps * xi * q1(phi) + eps**2 * oscillator.q2(phi))
    before = space.left_trace[space.mesh.impact_vertices] @ pair.left.reshape(space.phase.size, -1)
    at_impacts = before @ (space.noise.mass() @ space.noise.constant()) * 2 * math.pi / space.mesh.span
    return growth + oscillator.omega * oscillator.log_impact_factor * float(np.sum(at_impacts))


def _density(pair: PrincipalPair, combine: Callable[[FloatArray, FloatArray, FloatArray], FloatArray]) -> Density:
    """The weight times a combination of both eigenfunctions, normalised, repeated from a half circle to the full one.

    The eigenfunctions come without the factor that the space gives them; it is the third argument of `combine`.
    """
    space, unit = pair.generator.space, pair.generator.noise.standard_deviation
    phi, phi_weights, phi_values = space.phase.points, space.phase.weights, space.phase.values
    z, z_weights, z_values = space.noise.points, space.noise.weights, space.noise.values
    right, left = (phi_values @ (z_values @ v.reshape(space.phase.size, -1).T).T for v in (pair.right, pair.left))
    turns = round(2 * math.pi / space.mesh.span)
    values = np.tile(combine(right, left, space.factor(z)) * space.weight(z) / unit, (turns, 1))
    phi = np.concatenate([phi + k * space.mesh.span for k in range(turns)])
    phi_weights = np.tile(phi_weights, turns)
    total = phi_weights @ values @ (z_weights * unit)
    return Density(phi, unit * z, phi_weights, unit * z_weights, values / total)
