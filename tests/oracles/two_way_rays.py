"""Reference values for a ray that Ornstein-Uhlenbeck noise lets the phase pass both ways, stretched by R each time.

    dφ = v dt,    d ln a = q dt + ln R at every passage of φ₀,    v = h₀ + ξ h₁,    q = q₀ + ξ q₁

with waves h, q = mean + c cos 2φ + s sin 2φ, given as (mean, c, s), and ξ = std·z.
"""

import math

import numpy as np
import scipy.sparse as sp
from numpy.polynomial.hermite_e import hermeval
from scipy.sparse.linalg import eigs, spsolve


def lyapunov_exponent(h, q, kicks, *, alpha, std, harmonics, polynomials):
    """λ = E q + Σ ln R ∫|v| P dξ, P the stationary density of (φ, z): a Fourier series times Hermite functions.

    The stretches do not move the phase, so that P is smooth. On both sides of the z at which v = 0 the integral is
    that of a smooth function.

    Args:
        h, q: pairs of waves.
        kicks: pairs (φ₀, ln R).
    """
    k = np.arange(-harmonics, harmonics + 1)
    n = np.arange(polynomials)
    along, z = sp.diags(2j * k), sp.diags([np.sqrt(n[1:])] * 2, [-1, 1])
    flux = sp.kron(along @ _times(h[0], k), sp.identity(n.size)) + std * sp.kron(along @ _times(h[1], k), z)
    matrix = (-flux - alpha * sp.kron(sp.identity(k.size), sp.diags(n * 1.0))).tolil()
    first, source = harmonics * n.size, np.zeros(k.size * n.size, dtype=complex)
    matrix[first], matrix[first, first], source[first] = 0, 1, 1 / math.pi  # the integral of P is 1
    density = spsolve(matrix.tocsc(), source).reshape(k.size, n.size)
    mean = math.pi * (_times(q[0], k) @ density + std * _times(q[1], k) @ density @ z.toarray())[harmonics, 0].real
    sizes = np.exp(0.5 * np.array([math.lgamma(each + 1) for each in n]))
    return mean + sum(
        log * _passages(h, std, phase, (np.exp(2j * k * phase) @ density).real / sizes) for phase, log in kicks
    )


def _times(wave, k):
    """Multiplication of a Fourier series in 2φ."""
    mean, c, s = wave
    return sp.diags([(c - 1j * s) / 2, mean, (c + 1j * s) / 2], [-1, 0, 1], shape=(k.size, k.size)).tocsr()


def _passages(h, std, phase, density):
    """∫|v| P dξ at φ₀."""
    steady, driven = (mean + c * math.cos(2 * phase) + s * math.sin(2 * phase) for mean, c, s in h)
    turn = -steady / (std * driven)
    x, weights = np.polynomial.legendre.leggauss(200)
    total = 0.0
    for lower, upper in ((-12.0, turn), (turn, 12.0)):
        z = 0.5 * (lower + upper + (upper - lower) * x)
        values = np.abs(steady + std * z * driven) * hermeval(z, density) * np.exp(-0.5 * z**2)
        total += 0.5 * (upper - lower) * (weights @ values) / math.sqrt(2 * math.pi)
    return total


def moment_lyapunov(h, q, kick, p, *, alpha, std, phases, steps, near):
    """Λ(p), the eigenvalue next to a number, by finite volumes, smaller near the ray and where v = 0 there.

    In φ differences are upwind, of the first order: the flow through the ray carries R^p times the value beyond.
    """
    phase, log_factor = kick
    t = np.linspace(0, 1, phases + 1)
    faces = phase + math.pi * (t - 0.999 * np.sin(2 * math.pi * t) / (2 * math.pi))
    phi, width = 0.5 * (faces[1:] + faces[:-1]), np.diff(faces)

    def at(wave, angle):
        return wave[0] + wave[1] * np.cos(2 * angle) + wave[2] * np.sin(2 * angle)

    turn = -at(h[0], phase) / (std * at(h[1], phase))
    lines = turn + np.sinh(np.linspace(*np.arcsinh(3 * (np.array([-7.0, 7.0]) - turn)), steps + 1)) / 3
    z = 0.5 * (lines[1:] + lines[:-1])
    flow = alpha * np.exp(-0.5 * lines[1:-1] ** 2) / np.diff(z)
    mass = np.exp(-0.5 * z**2) * np.diff(lines)
    up, down = flow / mass[:-1], flow / mass[1:]
    noise = sp.diags([down, -np.append(up, 0) - np.append(0, down), up], [-1, 0, 1])
    speed = at(h[0], faces) + std * np.outer(z, at(h[1], faces))
    growth = at(q[0], phi) + std * np.outer(z, at(q[1], phi))
    stretch = np.ones(phases)
    stretch[-1] = math.exp(p * log_factor)  # of the face behind each cell
    forward, backward = np.maximum(speed[:, 1:], 0) / width, np.maximum(-speed[:, :-1], 0) / width
    cell = np.arange(steps * phases).reshape(steps, phases)
    moves = [
        (forward * stretch, cell, np.roll(cell, -1, axis=1)),
        (backward * np.roll(stretch, 1), cell, np.roll(cell, 1, axis=1)),
        (p * growth - forward - backward, cell, cell),
    ]
    values, rows, columns = (np.concatenate([np.ravel(move[i]) for move in moves]) for i in range(3))
    matrix = sp.csc_matrix((values, (rows, columns))) + sp.kron(noise, sp.identity(phases), format="csc")
    return float(eigs(matrix, k=1, sigma=near, v0=np.ones(cell.size))[0][0].real)
