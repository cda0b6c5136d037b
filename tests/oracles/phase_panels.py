"""Λ(p) and λ of systems in the plane by collocation in Chebyshev points of panels of the half circle.

A panel ends where the noise does not move the phase, as at a wall: there the equation is of first order. The solution
is smooth in every panel; at the joints T⁻ = R^p T⁺, and T′ is continuous where the equation is of second order.
"""

import math

import numpy as np
import scipy.linalg


def moment_exponent(drift, noise, p, points, restitution=1.0, panels=1):
    """Λ(p) of dx = A₀x dt + A₁x∘dW: the rightmost eigenvalue; the equations without Λ are those of the joints."""
    operator, weight, _ = _assembled(drift, noise, p, points, restitution, panels)
    values = scipy.linalg.eigvals(operator, weight)
    return float(np.max(values[np.isfinite(values)].real))


def lyapunov_exponent(drift, noise, points, restitution=1.0, panels=1):
    """λ by q̄ + ½h q̄′ = λ − L f, the equation of Λ(p) to first order in p: T = 1 + p f, Λ = pλ; f(−π/2) = 0."""
    operator, weight, change = _assembled(drift, noise, 0.0, points, restitution, panels)
    size = operator.shape[0]
    # unknowns f and λ: L f + (dL/dp) 1 = λ at the points, joints f⁻ = f⁺ + ln R
    whole = np.zeros((size + 1, size + 1))
    whole[:size, :size], whole[:size, size], whole[size, 0] = operator, -np.diagonal(weight), 1.0
    return float(np.linalg.solve(whole, np.append(-change, 0.0))[size])


def chain_lyapunov_exponent(matrices, rates, points):
    """λ of a chain by h_i f_i′ + q_i + Σ_j Q_ij f_j = λ with f(−π/2) = f(π/2); f_0(−π/2) = 0."""
    x, d = _chebyshev(points)
    n, count = points + 1, len(matrices)
    whole, right = np.zeros((count * n + 1, count * n + 1)), np.zeros(count * n + 1)
    whole[:-1, :-1], whole[:-1, -1], whole[-1, 0] = np.kron(rates, np.eye(n)), -1.0, 1.0
    for i, matrix in enumerate(matrices):
        h, _, q, _ = _coefficients(matrix, math.pi / 2 * x)
        here = slice(i * n, (i + 1) * n)
        whole[here, here] += h[:, None] * d * (2 / math.pi)
        right[here] = -q
        end = (i + 1) * n - 1
        whole[end], right[end] = 0.0, 0.0
        whole[end, end], whole[end, i * n] = 1.0, -1.0
    return float(np.linalg.solve(whole, right)[-1])


def _assembled(drift, noise, p, points, restitution, panels):
    x, d = _chebyshev(points)
    n, width = points + 1, math.pi / panels
    operator, weight, change = np.zeros((panels * n, panels * n)), np.zeros(panels * n), np.zeros(panels * n)
    for k in range(panels):
        phi, here = -math.pi / 2 + width * (k + (x + 1) / 2), slice(k * n, (k + 1) * n)
        (h0, _, q0, _), (h, dh, q, dq) = _coefficients(drift, phi), _coefficients(noise, phi)
        slope = d * (2 / width)
        block = (0.5 * h**2)[:, None] * (slope @ slope)
        block += (h0 + 0.5 * h * dh + p * h * q)[:, None] * slope
        block += np.diag(p * q0 + 0.5 * p * h * dq + 0.5 * p**2 * q**2)
        operator[here, here], weight[here], change[here] = block, 1.0, q0 + 0.5 * h * dq
    return _joined(operator, weight, change, noise, p, restitution, panels, n, d * (2 / width))


def _joined(operator, weight, change, noise, p, restitution, panels, n, slope):
    for k in range(panels):  # from the end of panel k to the start of the next one
        end, start, is_wall = (k + 1) * n - 1, (k + 1) % panels * n, k == panels - 1
        factor = restitution**p if is_wall else 1.0
        operator[end] = 0.0
        operator[end, end], operator[end, start] = 1.0, operator[end, start] - factor
        weight[end], change[end] = 0.0, -math.log(restitution) if is_wall else 0.0
        h = _coefficients(noise, np.array([math.pi / 2 if is_wall else -math.pi / 2 + math.pi * (k + 1) / panels]))[0]
        if abs(h[0]) > 1e-12:
            operator[start] = 0.0
            operator[start, k * n : (k + 1) * n] += slope[-1]
            operator[start, start : start + n] -= factor * slope[0]
            weight[start], change[start] = 0.0, 0.0
    return operator, np.diag(weight), change


def _coefficients(matrix, phi):
    """h, h′, q, q′ from e and e′ themselves."""
    matrix = np.asarray(matrix, dtype=float)
    e, turned = np.array([np.cos(phi), -np.sin(phi)]), np.array([-np.sin(phi), -np.cos(phi)])
    ae, at = matrix @ e, matrix @ turned
    h, q = np.sum(turned * ae, axis=0), np.sum(e * ae, axis=0)
    return h, np.sum(turned * at, axis=0) - q, q, h + np.sum(e * at, axis=0)


def _chebyshev(n):
    """Points from −1 to 1 and the matrix of the derivative."""
    k = np.arange(n + 1)
    x = -np.cos(np.pi * k / n)
    c = np.where((k == 0) | (k == n), 2.0, 1.0) * (-1.0) ** k
    d = np.outer(c, 1 / c) / (x[:, None] - x[None, :] + np.eye(n + 1))
    return x, d - np.diag(d.sum(axis=1))
