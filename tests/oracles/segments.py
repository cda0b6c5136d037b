"""Second moments of a segment of the path, x(t + θ) at Chebyshev nodes of θ, of a system with delays under noise.

The nodes move by ∂x/∂θ, the first one by the equation. Paths are rough, so that this is of a finite order only, which
is that of the mean of a path between nodes.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import schur
from scipy.linalg.lapack import ztrsyl
from scipy.optimize import brentq
from scipy.sparse.linalg import LinearOperator, gmres

Terms = Sequence[tuple[float, np.ndarray]]
"""Matrices, and how long ago the state is that they multiply."""


def differentiating(size: int) -> np.ndarray:
    """The slopes at Chebyshev nodes, from 1 to −1."""
    nodes = np.cos(np.pi * np.arange(size + 1) / size)
    ends = np.r_[2.0, np.ones(size - 1), 2.0] * (-1.0) ** np.arange(size + 1)
    slopes = np.outer(ends, 1 / ends) / (np.subtract.outer(nodes, nodes) + np.eye(size + 1))
    return slopes - np.diag(slopes.sum(axis=1))


class Segment:
    """dx = Σ A_k x(t − τ_k) dt + ξ Σ C_k x(t − τ_k) dt + Σ_j Σ B_jk x(t − τ_k) dW_j, ξ a chain (or one state alone).

    Args:
        drift, load, white: A, C and for each W the B.
        states, rates: of the chain; a generator on the points of a rule of Gauss is one, too, but for signs.
        size: one less than the number of nodes.
    """

    def __init__(self, drift: Terms, load: Terms, white: Sequence[Terms], states, rates, size: int) -> None:
        self.tau = max(delay for terms in (drift, load, *white) for delay, _ in terms)
        self.n, self.size = len(drift[0][1]), size
        free = np.kron(differentiating(size) * 2 / self.tau, np.eye(self.n))
        free[: self.n] = self.row(drift)
        self.rates, self.white = np.array(rates, dtype=float), [self.row(terms) for terms in white]
        self.states, self.free, self.load = np.array(states, dtype=float), free, self.row(load)
        self.decays, self.basis = np.linalg.eig(self.rates.T)
        self.t, self.z = schur(free, output="complex")

    def row(self, terms: Terms) -> np.ndarray:
        """What a sum of them reads of the nodes."""
        found, degrees = np.zeros((self.n, self.n * (self.size + 1))), np.arange(self.size + 1)
        angles = np.pi * degrees / self.size
        for delay, matrix in terms:
            at = np.arccos(np.clip(1 - 2 * delay / self.tau, -1, 1))
            shares = np.linalg.solve(np.cos(np.outer(degrees, angles)), np.cos(degrees * at))
            found += np.kron(shares, matrix)
        return found

    def moved(self, p: np.ndarray) -> np.ndarray:
        """The rates of the moments P of each state, shape (states, N, N)."""
        found = self.free @ p
        found[:, : self.n] += self.states[:, None, None] * (self.load @ p)
        found = found + found.transpose(0, 2, 1) + np.tensordot(self.rates.T, p, 1)
        for row in self.white:
            found[:, : self.n, : self.n] += row @ p @ row.T
        return found

    def alone(self, q: np.ndarray, sigma: float) -> np.ndarray:
        """(σ − L)⁻¹Q where noise does not multiply the state."""
        found = []
        for decay, each in zip(self.decays, np.tensordot(np.linalg.inv(self.basis), q, 1), strict=True):
            shifted = (sigma - decay) * np.eye(len(self.t)) - self.t
            y, scale, _ = ztrsyl(shifted, -self.t, self.z.conj().T @ each @ self.z, tranb="C")
            found.append(self.z @ (y / scale) @ self.z.conj().T)
        return np.tensordot(self.basis, np.array(found), 1).real

    def resolved(self, q: np.ndarray, sigma: float) -> np.ndarray:
        """(σ − L)⁻¹Q, by steps of Krylov from that without noise."""
        shape = q.shape
        whole = LinearOperator(
            2 * (q.size,),
            lambda v: np.ravel(self.alone(sigma * v.reshape(shape) - self.moved(v.reshape(shape)), sigma)),
        )
        found, failed = gmres(whole, self.alone(q, sigma).ravel(), rtol=1e-10, restart=100, maxiter=5)
        assert not failed
        found = found.reshape(shape)
        return 0.5 * (found + found.transpose(0, 2, 1))  # as L is of symmetric moments alone

    def radius(self, sigma: float) -> float:
        """ln of the spectral radius of Q → Σ B (σ − L)⁻¹Q Bᵀ under white noise alone, which is 0 at Λ(2)."""
        images = []
        pairs = list(zip(*np.triu_indices(self.n), strict=True))
        for i, j in pairs:
            q = np.zeros((self.n, self.n))
            q[i, j] = q[j, i] = 1.0
            p = self.alone(self.start(q), sigma)[0]
            image = sum(row @ p @ row.T for row in self.white)
            images.append([image[pair] for pair in pairs])
        return float(np.log(np.abs(np.linalg.eigvals(np.array(images))).max()))

    def start(self, forced: np.ndarray) -> np.ndarray:
        """A law whose first node is forced, in each state."""
        found = np.zeros((self.states.size, *self.free.shape))
        found[:, : self.n, : self.n] = forced
        return found

    def exponent(self, sigma: float) -> float:
        """Λ(2) from a σ on its right."""
        if self.states.size == 1:
            low = 2 * float(np.linalg.eigvals(self.free).real.max())
            gap = brentq(lambda gap: self.radius(low + np.exp(gap)), -25.0, np.log(sigma - low), xtol=1e-12)
            return low + float(np.exp(gap))
        p, value = self.resolved(self.start(np.eye(self.n)), sigma), np.inf
        for _ in range(60):
            image = self.resolved(p, sigma)
            last, value = value, sigma - float(np.vdot(p, p) / np.vdot(p, image))
            p = image / np.linalg.norm(image)
            if abs(value - last) <= 1e-10 * (1 + abs(value)):
                break
            if abs(value - last) <= 1e-3 * (sigma - value) and sigma - value > 1e-2 * (1 + abs(value)):
                sigma = value + 0.1 * (sigma - value)  # nearer, still on the right
        return value

    def stationary(self, force: np.ndarray, law: np.ndarray) -> np.ndarray:
        """E xxᵀ where Σ force dW drives the state, for the probabilities of the states."""
        q = self.start(np.outer(force, force)) * np.reshape(law, (-1, 1, 1))
        return self.resolved(q, 0.0).sum(axis=0)[: self.n, : self.n]


def written(terms: Sequence[tuple[str, Terms]], names: Sequence[str], force: Sequence[float] = (), by: str = "f"):
    """The rates of Σ factor Σ A_k x(t − τ_k), as texts."""
    rates = []
    for i in range(len(names)):
        parts = [f"{float(force[i])!r}*{by}"] if len(force) else []
        for factor, own in terms:
            for delay, matrix in own:
                for name, size in zip(names, np.asarray(matrix)[i].tolist(), strict=True):
                    state = f"{name}(t - {delay!r})" if delay else name
                    parts += [f"{size!r}*{factor}{state}"] if size else []
        rates.append(" + ".join(parts) or "0")
    return tuple(rates)
