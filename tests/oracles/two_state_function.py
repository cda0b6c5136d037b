"""T at Λ(p) = 0 of a plane system under telegraph noise, by integrating (h ∂φ + p q + Q)T = 0 over half a turn."""

import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq


def around(matrices, k, p, points=4001):
    """φ from −π/2 to π/2, a wall at both ends, and the matrix that takes T(−π/2⁺) to T(φ), shape (n, 2, 2)."""
    flip = k * np.array([[-1.0, 1.0], [1.0, -1.0]])

    def slope(phi, flat):
        e, n = np.array([math.cos(phi), -math.sin(phi)]), np.array([-math.sin(phi), -math.cos(phi)])
        h = np.array([n @ a @ e for a in matrices])
        q = np.array([e @ a @ e for a in matrices])
        return (-(np.diag(p * q) + flip) @ flat.reshape(2, 2) / h[:, None]).ravel()

    phi = np.linspace(-math.pi / 2, math.pi / 2, points)
    found = solve_ivp(slope, phi[[0, -1]], np.eye(2).ravel(), t_eval=phi, rtol=1e-11, atol=1e-13)
    return phi, found.y.T.reshape(-1, 2, 2)


def root_and_function(matrices, k, low, high, log_factor=0.0):
    """δ_p in a bracket, φ, and T at φ, shape (n, 2): T(π/2⁻) = R^p T(−π/2⁺)."""

    def positive(p):  # the eigenvalue whose vector has one sign
        _, through = around(matrices, k, p)
        values, vectors = np.linalg.eig(through[-1])
        best = max(range(2), key=lambda i: min(vectors[:, i].real / vectors[np.argmax(abs(vectors[:, i])), i].real))
        return values[best].real, vectors[:, best].real / vectors[np.argmax(abs(vectors[:, best])), best].real, through

    p = brentq(lambda each: positive(each)[0] - math.exp(each * log_factor), low, high, xtol=1e-12)
    _, first, through = positive(p)
    return p, np.linspace(-math.pi / 2, math.pi / 2, through.shape[0]), through @ first
