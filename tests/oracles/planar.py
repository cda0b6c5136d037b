"""Λ(p) and λ of linear systems in the plane under noises of any kind, by Fourier series in φ times functions.

With x = a (cos φ, −sin φ) a matrix A moves a^p T(φ) by X = h ∂φ + p q, h = e′ᵀA e, q = eᵀA e. On exp(2inφ), |n| ≤ M,
the generator is X₀ + ½ Σ X_k² + rate ⟨exp(w X) − 1⟩ + Σ ξ_k X_k + Σ L_k, with ξ_k and L_k on functions that are
orthonormal in the stationary law of a noise. For even p the 2M + 1 = p + 1 functions a^p exp(2inφ), |n| ≤ p/2, are the
homogeneous polynomials of degree p, on which all of it is closed: the equations of the moments of even order. Λ(p) is
the rightmost eigenvalue, of small matrices that of all, of large ones that nearest to a shift on the right of the
spectrum.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import linalg, sparse
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs, eigsh, splu

from fpsolve import NonGaussianNoise

DENSE = 350
"""Functions up to which all eigenvalues are computed."""
MOST, MOST_IN_BAND = 30_000, 40_000
"""Functions beyond which no larger size is tried, of moments and of Fourier series."""
CLOSE = 1e-11
"""Of the size of Λ: where two sizes differ by less, the larger one counts."""


@dataclass(frozen=True)
class Law:
    """A noise that has a value: (L, ξ) on a number of functions of it that grows with the size, or on its states."""

    made: Callable
    grows: bool = True


def ornstein_uhlenbeck(alpha, deviation):
    """dξ = −αξ dt + √(2α) deviation dW, by normalised Hermite polynomials."""

    def made(size):
        root = deviation * np.sqrt(np.arange(1.0, size))
        return np.diag(-alpha * np.arange(float(size))), np.diag(root, 1) + np.diag(root, -1)

    return Law(made)


def between_ends(D0, tau0, r0):
    """Eq. (7) with r₀ < 1: polynomials orthonormal under (1 − z²)^a, z = ξ/ξ_s, a = 1/(1 − r₀).

    L u = D₀/τ₀² (P_s u′)′/P_s, so that L = −D₀/(τ₀ξ_s)² ∫ P_s u′v′, by Gauss's points of that weight.
    """
    a = 1 / (1 - r0)
    end = math.sqrt(2 * D0 * a / tau0)

    def made(size):
        k = np.arange(1.0, size + 1)
        beta = np.sqrt(k * (k + 2 * a) / ((2 * k + 2 * a + 1) * (2 * k + 2 * a - 1)))
        z, vectors = np.linalg.eigh(np.diag(beta[:-1], 1) + np.diag(beta[:-1], -1))
        value, slope = np.ones((size, size)), np.zeros((size, size))  # polynomial, point
        for m in range(size - 1):
            below, less = (value[m - 1], slope[m - 1]) if m else (0.0, 0.0)
            back = beta[m - 1] if m else 0.0
            value[m + 1] = (z * value[m] - back * below) / beta[m]
            slope[m + 1] = (value[m] + z * slope[m] - back * less) / beta[m]
        weighed = slope * np.abs(vectors[0])
        ladder = np.diag(beta[: size - 1], 1) + np.diag(beta[: size - 1], -1)
        return -D0 / (tau0 * end) ** 2 * weighed @ weighed.T, end * ladder

    return Law(made)


def chain(states, rates):
    """Jumps from state i to j at rates[i][j], on functions of the state."""
    rates = np.array(rates, dtype=float)
    np.fill_diagonal(rates, 0.0)
    generator = rates - np.diag(rates.sum(axis=1))
    weight = np.sqrt(np.abs(linalg.null_space(generator.T)[:, 0]))  # so that they are orthonormal in the law
    return Law(lambda _: (weight[:, None] * generator / weight, np.diag(np.asarray(states, dtype=float))), grows=False)


def circle(amplitude, nu, sigma):
    """ξ = amplitude cos θ, dθ = ν dt + σ dW."""
    return Law(lambda size: waves(amplitude, nu, sigma, 2 + size // 2))


def waves(amplitude, nu, sigma, size):
    """(L, ξ) of it on 1, √2 cos kθ, √2 sin kθ, k ≤ size."""
    decay, turn, up = np.zeros(2 * size + 1), np.zeros((2 * size + 1,) * 2), np.zeros((2 * size + 1,) * 2)
    for k in range(1, size + 1):
        c, s = 2 * k - 1, 2 * k
        decay[[c, s]] = -0.5 * (sigma * k) ** 2
        turn[s, c], turn[c, s] = -nu * k, nu * k
        if k < size:
            up[c + 2, c] = up[s + 2, s] = 0.5
    up[1, 0] = math.sqrt(0.5)
    return np.diag(decay) + turn, amplitude * (up + up.T)


def filtered(omega, zeta, s, c0, c1):
    """ξ = c₀y + c₁y′ of y″ + 2ζωy′ + ω²y = sẆ, by normalised He_j(u) He_k(w), j + k < size.

    u and w are y and y′ over their standard deviations: u′ = ωw and dw = −(ωu + 2ζωw) dt + 2√(ζω) dW.
    """
    deviation = s / math.sqrt(4 * zeta * omega**3)

    def made(size):
        lower = sparse.diags_array(np.sqrt(np.arange(1.0, size + 1)), offsets=1)
        raised, one = lower + lower.T, sparse.eye_array(size + 1)
        u, w, by_u, by_w = (
            sparse.csr_array(sparse.kron(*each)) for each in ((raised, one), (one, raised), (lower, one), (one, lower))
        )
        moved = omega * (w @ by_u - u @ by_w) - 2 * zeta * omega * (w @ by_w - by_w @ by_w)
        j, k = np.divmod(np.arange((size + 1) ** 2), size + 1)
        kept = np.flatnonzero(j + k < size)
        return tuple(sparse.csr_array(each)[kept][:, kept] for each in (moved, deviation * (c0 * u + c1 * omega * w)))

    return Law(made)


@dataclass(frozen=True)
class Planar:
    """dx = (A₀ + Σ ξ_k A_k) x dt + Σ B_k x∘dW_k, and x → exp(wC) x at random times.

    Args:
        drift: A₀.
        coloured: pairs (A_k, `Law`).
        white: the B_k; Itô's sense is for the caller to turn into this one.
        impulses: (C, rate, the w, how likely each is).
        log_factor: ln R of a wall at x = 0, that is φ = π/2, where noise does not move φ: T = R^{ps} u, s rising from 0
            to 1 around the half circle, turns ∂φ into ∂φ + p ln R/π.
    """

    drift: np.ndarray
    coloured: tuple = ()
    white: tuple = ()
    impulses: tuple = ()
    log_factor: float = 0.0

    def balanced(self):
        """In the coordinates (x, y/μ) in which the rates are least."""

        def change(matrix, mu):
            return np.array(matrix, dtype=float) * [[1.0, mu], [1 / mu, 1.0]]

        def size(mu):
            own = np.linalg.norm(change(self.drift, mu))
            for matrix, law in self.coloured:
                own += np.linalg.norm(change(matrix, mu)) * float(np.abs(law.made(4)[1]).max())
            own += sum(np.linalg.norm(change(matrix, mu)) ** 2 for matrix in self.white)
            return own + sum(np.linalg.norm(change(c, mu)) * rate * max(map(abs, w)) for c, rate, w, _ in self.impulses)

        mu = min(2.0 ** np.arange(-20, 21), key=size)
        return Planar(
            change(self.drift, mu),
            tuple((change(matrix, mu), law) for matrix, law in self.coloured),
            tuple(change(matrix, mu) for matrix in self.white),
            tuple((change(c, mu), *rest) for c, *rest in self.impulses),
            self.log_factor,
        )

    def moved(self, p, modes):
        """What no coloured noise has a part in: its matrix and that of ∂/∂p on the phases."""
        total, slope = phases(self.drift, p, modes, self.log_factor)
        for matrix in self.white:
            x, dx = phases(matrix, p, modes, self.log_factor)
            total, slope = total + 0.5 * x @ x, slope + 0.5 * (x @ dx + dx @ x)
        for matrix, rate, sizes, shares in self.impulses:
            struck, longer = jumps(matrix, sizes, shares, p, modes, self.log_factor)
            total, slope = total + rate * (struck - np.eye(2 * modes + 1)), slope + rate * longer
        return sparse.csr_array(total), sparse.csr_array(slope)

    def generator(self, p, modes, size):
        """L(p), ∂L/∂p and the constant function; phases are slow, functions of the noises fast."""
        laws = [law.made(size) for _, law in self.coloured]
        counts = [own[0].shape[0] for own in laws]

        def of_noises(place, matrix):
            before, after = math.prod(counts[:place]), math.prod(counts[place + 1 :])
            return sparse.kron(sparse.kron(sparse.eye_array(before), matrix), sparse.eye_array(after))

        one, ones = sparse.eye_array(2 * modes + 1), sparse.eye_array(math.prod(counts))
        total, slope = (sparse.kron(each, ones) for each in self.moved(p, modes))
        constant = np.ones(1)
        for place, ((matrix, law), (own, xi)) in enumerate(zip(self.coloured, laws, strict=True)):
            x, dx = phases(matrix, p, modes, self.log_factor)
            lifted = of_noises(place, xi)
            total = total + sparse.kron(x, lifted) + sparse.kron(one, of_noises(place, own))
            slope = slope + sparse.kron(dx, lifted)
            first = np.eye(1, counts[place])[0] if law.grows else np.abs(linalg.null_space(own.T)[:, 0])
            constant = np.kron(constant, first)
        middle = np.eye(1, 2 * modes + 1)[0]
        return sparse.csc_array(total), sparse.csc_array(slope), np.kron(middle, constant)


def of_paper(oscillator, noise, log_factor=0.0):
    """The paper's oscillator under the noise of Eq. (7), r₀ < 1, or Ornstein-Uhlenbeck noise; what is added to ln R."""
    law = (
        between_ends(noise.D0, noise.tau0, noise.r0)
        if isinstance(noise, NonGaussianNoise)
        else ornstein_uhlenbeck(noise.alpha, noise.standard_deviation)
    )
    drift = np.array([[0.0, oscillator.omega], [-oscillator.omega, oscillator.epsilon**2 * oscillator.c1]])
    driven = ((np.diag([0.0, oscillator.epsilon]), law),)
    return Planar(drift, driven, log_factor=oscillator.log_impact_factor + log_factor)


def series(problem, p, modes=12, size=40):
    """Λ(p) of the paper's oscillator by so many functions, read off the row of the constant function in Lu = Λu.

    Noise and the derivative in φ have no part in that row, so no large numbers cancel. A strong tilt leaves little of
    the constant function; then the eigenvalue itself is as good.
    """
    system = of_paper(problem.system, problem.noise)
    few, matrix, constant = system.generator(p, 6, 26)[0], *system.generator(p, modes, size)[::2]
    value, vector = rightmost(matrix, rightmost(few)[0].real)[0].real, constant
    factors = splu((matrix - (value + 1e-9 * abs(value)) * sparse.eye_array(constant.size)).tocsc())
    for _ in range(2):
        vector = factors.solve(vector)
        vector = vector / np.max(np.abs(vector))
    share = constant @ vector
    return float(constant @ (matrix @ vector) / share) if abs(share) > 0.1 else value


def phases(matrix, p, modes, log_factor=0.0):
    """X of A and its ∂/∂p on 1, √2 cos 2nφ, √2 sin 2nφ, n ≤ modes."""
    (a, b), (c, d) = np.asarray(matrix, dtype=float)
    count, n = 2 * modes + 1, np.arange(1, modes + 1)
    derivative = _entries(count, [(2 * n, 2 * n - 1, -2.0 * n), (2 * n - 1, 2 * n, 2.0 * n)])
    n, root = n[:-1], math.sqrt(0.5) * np.ones(min(modes, 1))
    first, zero, half = np.ones_like(root, dtype=int), np.zeros_like(root, dtype=int), 0.5 * np.ones(n.size)
    # times cos 2φ cos goes to cos and sin to sin, times sin 2φ cos goes to sin and sin to −cos
    up = _entries(count, [(2 * n + 1, 2 * n - 1, half), (2 * n + 2, 2 * n, half), (first, zero, root)])
    over = _entries(count, [(2 * n + 2, 2 * n - 1, half), (2 * n + 1, 2 * n, -half), (2 * first, zero, root)])
    one, cosine, sine = sparse.eye_array(count, format="csr"), up + up.T, over + over.T
    h = 0.5 * ((b - c) * one - (b + c) * cosine + (d - a) * sine)
    q = 0.5 * ((a + d) * one + (a - d) * cosine - (b + c) * sine)
    q = q + log_factor / math.pi * h
    # at the highest mode h ∂ + p q leaves these functions but for even p = 2·modes
    return sparse.csr_array(h @ derivative + p * q), sparse.csr_array(q)


def _entries(count, parts):
    """A sparse matrix of rows, columns and values."""
    rows, columns, values = (np.concatenate(each) for each in zip(*parts, strict=True))
    return sparse.csr_array((values, (rows, columns)), shape=(count, count))


def jumps(matrix, sizes, shares, p, modes, log_factor=0.0):
    """⟨|Me|^p u(ψ)⟩, M = exp(wC), and its ∂/∂p, by values at as many even points of φ as there are functions."""
    count = 2 * modes + 1
    phi = math.pi * (0.5 + (np.arange(count) + 0.25) / count)

    def values(at):
        n = np.arange(1, modes + 1)
        found = np.ones((at.size, count))
        found[:, 1::2], found[:, 2::2] = (math.sqrt(2) * f(2 * np.outer(at, n)) for f in (np.cos, np.sin))
        return found

    back, total, slope = values(phi).T / count, 0.0, 0.0
    for size, share in zip(sizes, shares, strict=True):
        x, y = linalg.expm(size * np.asarray(matrix, dtype=float)) @ [np.cos(phi), -np.sin(phi)]
        psi = np.arctan2(-y, x)
        rise = (np.mod(psi - math.pi / 2, math.pi) - (phi - math.pi / 2)) / math.pi
        logs, moved = np.log(np.hypot(x, y)) + log_factor * rise, values(psi)
        total = total + share * back @ (np.exp(p * logs)[:, None] * moved)
        slope = slope + share * back @ ((logs * np.exp(p * logs))[:, None] * moved)
    return total, slope


def rightmost(matrix, near=None):
    """The rightmost eigenvalue, complex, and about its rounding; `near` is that of fewer functions.

    To the right of the spectrum the nearest eigenvalue is the rightmost, as no other has a larger real part. A shift
    that is not to the right shows by an eigenvalue there, or by one that is nearer than the rightmost.
    """
    count = matrix.shape[0]
    norm = float(np.abs(matrix).sum(axis=0).max())
    if count <= DENSE:
        values, left, right = linalg.eig(matrix.toarray(), left=True)
        k = int(np.argmax(values.real))
        angle = abs(left[:, k].conj() @ right[:, k])
        return complex(values[k]), 2e-16 * norm / max(angle, 1e-16)
    rows, columns = matrix.nonzero()
    # phases are slow: Fourier series have a narrow band, moments have few phases and no band
    order = "NATURAL" if np.max(np.abs(rows - columns)) < 0.1 * count else "COLAMD"
    start, half = np.random.default_rng(0).standard_normal(count), 0.5 * (matrix + matrix.T)
    if near is None:  # the largest eigenvalue of the symmetric part is a bound
        shift = 1e-2 + 1.05 * float(eigsh(half, 1, which="LA", v0=start, tol=1e-2, return_eigenvectors=False)[0])
    else:
        shift = near + 0.05 * (1 + abs(near))
    for _ in range(8):
        factors = splu((matrix - shift * sparse.eye_array(count)).tocsc(), permc_spec=order)
        inverse = LinearOperator(matrix.shape, factors.solve, dtype=float)
        found, right = eigs(inverse, 4, v0=start, tol=1e-11, ncv=40, maxiter=100)
        values = shift + 1 / found
        k = int(np.argmax(values.real))
        if values[k].real < shift and abs(values[k] - shift) <= np.min(np.abs(values - shift)) * (1 + 1e-9):
            break
        shift = max(shift, values[k].real) + 0.5 * (1 + abs(shift))
    else:
        raise ArithmeticError("no shift to the right of the spectrum")
    transposed = LinearOperator(matrix.shape, lambda x: factors.solve(x, trans="T"), dtype=float)
    other, left = eigs(transposed, 2, v0=start, tol=1e-6, ncv=40, maxiter=100)
    j = int(np.argmin(np.abs(shift + 1 / other - values[k])))
    angle = abs(left[:, j] @ right[:, k])
    return complex(values[k]), 2e-16 * norm / max(float(angle), 1e-16)


def nearest(matrix, value, count=3):
    """The eigenvalues of a large matrix that are next to a value."""
    return eigs(matrix, count, sigma=value, v0=np.ones(matrix.shape[0]), return_eigenvectors=False)


SIZES = {0: (1,), 1: (10, 20, 40, 80, 160), 2: (6, 9, 14, 21, 32, 44, 62, 88)}
"""Functions of a noise, by how many dimensions all noises have together."""
MODES = (16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192)
MOST_STRUCK = 1024
"""Modes of φ beyond which no larger number is tried under impulses, as they leave no zeros in a matrix."""
FEWER = {0: (1,), 1: (8, 14, 22, 32, 42, 50), 2: (5, 8, 12, 16)}
"""Beside the modes of a Fourier series."""


def moment_exponent(system: Planar, p, dimensions):
    """Λ(p) for even p > 0, and how far it may be off; `dimensions` of the noises whose functions grow in number."""
    return _settled(system.balanced(), p, [(int(p) // 2, size) for size in SIZES[dimensions]])


def fourier_exponent(system: Planar, p, dimensions):
    """Λ(p) for any p > −1, and how far it may be off."""
    sizes = FEWER[dimensions]
    return _settled(system.balanced(), p, [(m, sizes[min(i, len(sizes) - 1)]) for i, m in enumerate(_modes(system))])


def lyapunov_exponent(system: Planar, dimensions):
    """λ = ⟨u*, (dL/dp) 1⟩ with u*L(0) = 0, ⟨u*, 1⟩ = 1, and how far it may be off."""
    system, sizes = system.balanced(), FEWER[dimensions]
    values = Limit(1e-3 * float(np.linalg.norm(system.drift)))
    for i, modes in enumerate(_modes(system)):
        total, slope, one = system.generator(0.0, modes, sizes[min(i, len(sizes) - 1)])
        if total.shape[0] > MOST_IN_BAND or values.is_settled:
            break
        values.add(slope_at_zero(total, slope, one))
    return values.last, values.doubt


def slope_at_zero(total, slope, one):
    """⟨u*, (dL/dp) 1⟩ with u*L = 0 and ⟨u*, 1⟩ = 1, which stands for the equation that follows from the others."""
    at, size, count = int(np.argmax(np.abs(one))), float(np.abs(total).max()), one.size
    kept = sparse.diags_array((np.arange(count) != at).astype(float))
    row = sparse.csr_array((one * size, (np.full(count, at), np.arange(count))), shape=total.shape)
    left = splu(sparse.csc_array(kept @ total.T + row)).solve(size * np.eye(1, count, at)[0])
    return float(left @ (slope @ one))


def _modes(system):
    return [each for each in MODES if each <= MOST_STRUCK or not system.impulses]


def _settled(system, p, sizes):
    """Λ(p) by larger and larger sizes until two agree, and how far it may be off."""
    values, is_band = Limit(1e-3 * float(np.linalg.norm(system.drift)), is_closed=len(sizes) == 1), sizes[0][0] > 8
    for modes, size in sizes:
        matrix, _, _ = system.generator(p, modes, size)
        if matrix.shape[0] > (MOST_IN_BAND if is_band else MOST) or values.is_settled:
            break
        try:
            found, rounding = rightmost(matrix, values.last if values.found else None)
        except (ArithmeticError, ArpackError, RuntimeError):  # not found, or singular
            continue
        if abs(found.imag) <= 1e-7 * (abs(found) + 1e3 * values.least):  # else too few functions: Λ is real
            values.add(found.real, 10 * rounding)
    return values.last, values.doubt


class Limit:
    """Values by more and more functions."""

    def __init__(self, least, is_closed=False):
        self.least, self.is_closed, self.found, self.rounding = least, is_closed, [], 0.0

    def add(self, value, rounding=0.0):
        self.found.append(value)
        self.rounding = rounding

    @property
    def last(self):
        return self.found[-1] if self.found else math.nan

    @property
    def is_settled(self):
        return len(self.found) > 1 and self._truncation <= self._close

    @property
    def _close(self):
        return max(CLOSE * (abs(self.last) + self.least), self.rounding)

    @property
    def doubt(self):
        return self._truncation + self.rounding

    @property
    def _truncation(self):
        """The last change where it is rounding; else the larger of the last two, or all that are to come after it if
        changes fall like a geometric series, as where T is Hölder one may be small by chance; ∞ where they do not."""
        if self.is_closed and self.found:
            return 0.0
        if len(self.found) < 2:
            return math.inf
        *earlier, change = np.abs(np.diff(self.found))
        if change <= self._close:
            return float(change)
        if not earlier:
            return math.inf
        share = change / max(earlier[-1], change)
        return float(max(change, earlier[-1]) * max(1.0, share / (1 - share))) if share < 0.7 else math.inf
