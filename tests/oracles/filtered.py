"""E‖x‖^p of even p for ẋ = (A₀ + ξA₁)x, ξ = c₀y + c₁y′ of a filter y″ + 2ζωy′ + ω²y = sẆ, without a phase.

With u and w the filter's y and y′ over their standard deviations, u′ = ωw and dw = −(ωu + 2ζωw) dt + 2√(ζω) dW, so that
dE[m He_j(u) He_k(w)]/dt = E[(Km + ω(w∂_u − u∂_w) − 2ζω(w∂_w − ∂_w²)) m He_j He_k] for monomials m of degree p in x,
which K moves. These equations are closed but for ξ, which raises j + k by one: they are cut off there.
"""

import math

import numpy as np
from scipy import sparse

from tests.oracles.moment_hierarchy import rates_of_monomials


def equations(steady, driven, law, p, count, rates=rates_of_monomials):
    """Their sparse matrix with j + k < count, monomials fastest; `law` is (ω, ζ, s, c₀, c₁), `rates` K of a matrix."""
    omega, zeta, s, c0, c1 = law
    deviation = s / math.sqrt(4 * zeta * omega**3)
    lower = sparse.diags_array(np.sqrt(np.arange(1.0, count)), offsets=1)  # He_j′ = √j He_(j−1)
    raised, one = lower + lower.T, sparse.eye_array(count)
    of_u, of_w = (lambda m: sparse.kron(m, one)), (lambda m: sparse.kron(one, m))
    u, w, by_u, by_w = of_u(raised), of_w(raised), of_u(lower), of_w(lower)
    filtered = omega * (w @ by_u - u @ by_w) - 2 * zeta * omega * (w @ by_w - by_w @ by_w)
    j, k = np.divmod(np.arange(count**2), count)
    kept = np.flatnonzero(j + k < count)
    xi, filtered = (sparse.csr_array(m)[kept][:, kept] for m in (deviation * (c0 * u + c1 * omega * w), filtered))
    resting, moving = rates(steady, p), rates(driven, p)
    one = sparse.eye_array(kept.size)
    # E[m h] for all h, the transpose of what moves h
    return (
        sparse.kron(one, resting) + sparse.kron(xi.T, moving) + sparse.kron(filtered.T, sparse.eye_array(len(resting)))
    )


def moment_lyapunov(steady, driven, law, p, count):
    """Λ(p): the rightmost eigenvalue."""
    return float(np.max(np.linalg.eigvals(equations(steady, driven, law, p, count).toarray()).real))


def products(matrix, _):
    """K for all xᵢxⱼ of any number of variables."""
    one = np.eye(len(matrix))
    return np.kron(matrix, one) + np.kron(one, matrix)


def second_moment(steady, driven, law, count):
    """Λ(2) for any number of variables."""
    total = equations(np.array(steady), np.array(driven), law, 2, count, products).toarray()
    return float(np.max(np.linalg.eigvals(total).real))


def strength(omega, zeta, c0, c1, deviation):
    """s for which c₀y + c₁y′ has a standard deviation: Var y = s²/(4ζω³), Var y′ = ω² Var y, uncorrelated."""
    return deviation * math.sqrt(4 * zeta * omega**3 / (c0**2 + (c1 * omega) ** 2))
