"""Reference values of Λ(p) for strong and slow noise: a matrix continued fraction in the phase.

With the impact gauged away, T = R^(p s(φ)) u, the sawtooth s rising from 0 to 1 between impacts, and κ = p ln R/π,

    L u = L_ξ u + (ω + F h₁)(∂φ + κ) u + p F q₁ u,    F = εξ + ε²c₁,    h₁ = ½ sin 2φ, q₁ = ½(1 − cos 2φ).

For u = Σ u_k e^{2ikφ} this couples k with k ± 1 only. The u_k, k ≠ 0, are eliminated from the largest |k| on, which
leaves a matrix G(λ) of functions of the noise; Λ is where its rightmost real eigenvalue is λ. The functions of
z = ξ/std are polynomials, orthonormal in P_s exp(2bz), times exp(bz).
"""

import math

import numpy as np
import scipy.linalg
from scipy.special import roots_jacobi


def moment_lyapunov(oscillator, noise, p, start, *, harmonics, polynomials, tilt, steps=12):
    """Λ(p) by the secant method from a value near it."""
    relaxation, force = _noise(oscillator, noise, polynomials, tilt)
    kappa = p * math.log(oscillator.impact_factor()) / math.pi

    def rightmost(value):
        reduced = _reduced(oscillator.omega, relaxation, force, kappa, p, value, harmonics)
        values = scipy.linalg.eigvals(reduced)
        return values[np.argmin(np.abs(values - value))]

    values, rests = [start * (1 + 1e-4) + 1e-9, start], []
    for value in values:
        rests.append((rightmost(value) - value).real)
    for _ in range(steps):
        slope = (rests[-1] - rests[-2]) / (values[-1] - values[-2])
        step = -rests[-1] / slope if slope else 0.0
        values.append(values[-1] + step)
        if abs(step) < 1e-14 * max(abs(values[-1]), oscillator.omega * 1e-2):
            break
        rests.append((rightmost(values[-1]) - values[-1]).real)
    return values[-1]


def _reduced(omega, relaxation, force, kappa, p, value, harmonics):
    """G(λ): the operator of k = 0 with what the other k send back."""
    unit = np.eye(len(force))
    back = np.zeros_like(force, dtype=complex)
    for k in range(harmonics, 0, -1):
        inner = relaxation + omega * (2j * k + kappa) * unit + 0.5 * p * force - value * unit + back
        up = ((2j * (k - 1) + kappa) / 4j - 0.25 * p) * force  # from k − 1 to k
        down = (-(2j * k + kappa) / 4j - 0.25 * p) * force  # from k to k − 1
        back = -down @ np.linalg.solve(inner, up)
    return relaxation + omega * kappa * unit + 0.5 * p * force + 2 * back.real


def _noise(oscillator, noise, polynomials, tilt):
    """L_ξ and F in the orthonormal functions."""
    unit = noise.standard_deviation
    rate = 0.5 * (noise.diffusion / unit) ** 2
    size, damped = oscillator.epsilon * unit, oscillator.epsilon**2 * oscillator.c1
    if math.isinf(noise.half_width):  # P_s exp(2bz) is P_s moved by 2b: Hermite polynomials of y = z − 2b
        n, one = np.arange(polynomials), np.eye(polynomials)
        y = np.diag(np.sqrt(n[1:]), 1) + np.diag(np.sqrt(n[1:]), -1)
        return -rate * (np.diag(n) + tilt * y + tilt**2 * one), size * (y + 2 * tilt * one) + damped * one
    end, a = noise.half_width / unit, noise.end_exponent
    x, weights = roots_jacobi(2 * polynomials + 60, a - 1, a - 1)
    z = end * x
    measure = weights * np.exp(2 * tilt * z - np.max(2 * tilt * z)) * (1 - x**2)
    values, slopes = _orthonormal(z, measure, polynomials)
    slopes = slopes + tilt * values
    weighted = values * measure[:, None]
    return -rate * (slopes * measure[:, None]).T @ slopes, (weighted * (size * z + damped)[:, None]).T @ values


def _orthonormal(z, measure, count):
    """Orthonormal polynomials and their slopes at the points, by Arnoldi's recurrence, orthogonalised twice."""
    values, slopes = np.zeros((2, z.size, count))
    values[:, 0] = 1 / math.sqrt(measure.sum())
    for j in range(1, count):
        new, slope = z * values[:, j - 1], values[:, j - 1] + z * slopes[:, j - 1]
        for _ in range(2):
            parts = values[:, :j].T @ (measure * new)
            new, slope = new - values[:, :j] @ parts, slope - slopes[:, :j] @ parts
        norm = math.sqrt(measure @ new**2)
        values[:, j], slopes[:, j] = new / norm, slope / norm
    return values, slopes
