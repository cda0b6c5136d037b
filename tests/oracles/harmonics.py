"""Moments of a linear system under sine-Wiener noise, without a phase: E x^a ẋ^b e^{ikθ} obey linear equations.

For ẍ + cẋ + (s + A sin θ) x = 0, dθ = σ dW, the moments M_{j,k} = E x^{p−j} ẋ^j e^{ikθ} of even order p obey

    Ṁ_{j,k} = (p − j) M_{j+1,k} − j (c M_{j,k} + s M_{j−1,k}) − j A (M_{j−1,k+1} − M_{j−1,k−1})/(2i) − ½σ²k² M_{j,k},

and Λ(p) is the largest real part of an eigenvalue, cut off at |k| ≤ K.
"""

import numpy as np


def moment_exponent(p, damping, stiffness, amplitude, sigma, harmonics=24):
    """Λ(p) for even p."""
    k = np.arange(-harmonics, harmonics + 1)
    n, m = p + 1, k.size
    matrix = np.zeros((n, m, n, m), dtype=complex)
    for j in range(n):
        for i in range(m):
            matrix[j, i, j, i] = -j * damping - 0.5 * sigma**2 * k[i] ** 2
            if j < p:
                matrix[j, i, j + 1, i] = p - j
            if j:
                matrix[j, i, j - 1, i] = -j * stiffness
                for step in (1, -1):
                    if 0 <= i + step < m:
                        matrix[j, i, j - 1, i + step] = -j * amplitude * step / 2j
    return float(np.max(np.linalg.eigvals(matrix.reshape(n * m, n * m)).real))


def white_noise_exponent(p, damping, stiffness, spectrum):
    """Λ(p) for even p under white noise of the spectral density S(0) in place of A sin θ."""
    n = p + 1
    matrix = np.zeros((n, n))
    for j in range(n):
        matrix[j, j] = -j * damping
        if j < p:
            matrix[j, j + 1] = p - j
        if j:
            matrix[j, j - 1] = -j * stiffness
        if j > 1:
            matrix[j, j - 2] = 0.5 * spectrum * j * (j - 1)
    return float(np.max(np.linalg.eigvals(matrix).real))
