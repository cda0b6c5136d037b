"""The stationary response of the nonlinear oscillator by a Markov chain: first-order upwind differences on a grid.

The chain jumps between the points of a grid of (u, φ, z), with ln a = u + γ(φ), γ = −(ln R/π) φ from impact to impact,
and z = ξ/std of Ornstein-Uhlenbeck noise. Its rates are not negative, so that its law is positive on every grid. The
ends of u reflect: no tail is imposed. It shares nothing with `fpsolve.nonlinear`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csc_matrix, eye
from scipy.sparse.linalg import spsolve


@dataclass(frozen=True)
class Chain:
    """The oscillator ẍ + ω²x = (εξ + ε²(c₁ − c₂x² − c₃ẋ²)) ẋ, bounces by R, dξ = −αξ dt + σ dW."""

    omega: float
    epsilon: float
    c1: float
    c2: float
    c3: float
    log_factor: float
    alpha: float
    sigma: float

    def means(self, ends: tuple[float, float], shape: tuple[int, int, int], reach: float = 4.0) -> dict[str, float]:
        """E a², E x², E ẋ² and impacts in unit time, with errors of the first order, on a grid of (u, φ, z)."""
        steps = (ends[1] - ends[0]) / shape[0], math.pi / shape[1], 2 * reach / shape[2]
        u = ends[0] + (np.arange(shape[0]) + 0.5) * steps[0]
        phi = -math.pi / 2 + (np.arange(shape[1]) + 0.5) * steps[1]
        z = -reach + (np.arange(shape[2]) + 0.5) * steps[2]
        u, phi, z = np.meshgrid(u, phi, z, indexing="ij")
        xi = self.sigma / math.sqrt(2 * self.alpha) * z
        a = np.exp(u - self.log_factor / math.pi * phi)
        x, v = a * np.cos(phi), -self.omega * a * np.sin(phi)
        push = self.epsilon * xi + self.epsilon**2 * (self.c1 - self.c2 * x**2 - self.c3 * v**2)
        turning = self.omega + push * np.sin(phi) * np.cos(phi)
        rising = push * np.sin(phi) ** 2 + self.log_factor / math.pi * turning
        numbers = np.arange(u.size).reshape(shape)
        rows, columns, rates = [], [], []
        for axis, speed in enumerate((rising, turning, -self.alpha * z)):
            spread = self.alpha / steps[2] ** 2 if axis == 2 else 0.0
            for side in (1, -1):
                rate = np.maximum(side * speed, 0) / steps[axis] + spread
                target = np.roll(numbers, -side, axis)
                inside = np.ones(shape, dtype=bool)
                if axis != 1:  # only φ is a circle
                    edge = [slice(None)] * 3
                    edge[axis] = slice(-1, None) if side == 1 else slice(0, 1)
                    inside[tuple(edge)] = False
                rows.append(target[inside])
                columns.append(numbers[inside])
                rates.append(rate[inside])
        jumps = coo_matrix((np.concatenate(rates), (np.concatenate(rows), np.concatenate(columns))), (u.size, u.size))
        leaving = np.asarray(jumps.sum(axis=0)).ravel()
        generator = csc_matrix(jumps) - eye(u.size, format="csc").multiply(leaving)
        law = _kernel(csc_matrix(generator)).reshape(shape)
        at_impact = np.sum((law * turning)[:, [0, -1]]) / 2 / steps[1]
        return {
            "minimum": float(law.min()),
            "amplitude_squared": float(np.sum(law * a**2)),
            "x_squared": float(np.sum(law * x**2)),
            "v_squared": float(np.sum(law * v**2)),
            "impact_rate": float(at_impact),
        }


def _kernel(generator: csc_matrix) -> np.ndarray:
    """The law p with Q p = 0 and Σ p = 1: one of its values is 1, then it is scaled."""
    kept = np.delete(np.arange(generator.shape[0]), middle := generator.shape[0] // 2)
    law = np.ones(generator.shape[0])
    law[kept] = spsolve(generator[kept][:, kept], -generator[kept][:, [middle]].toarray().ravel())
    return law / law.sum()
