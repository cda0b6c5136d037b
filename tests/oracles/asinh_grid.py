"""Reference values of Λ(p) for noise with algebraic tails: finite differences on a grid even in φ and in asinh ξ.

    v(φ, ξ) T_φ + p q(φ, ξ) T + D (P_s T_ξ)_ξ / P_s = Λ T,    T(φ⁻) = R^p T(φ⁺) at φ = π/2

with v and q of Eqs. (17)-(18), D = D₀/τ₀² and P_s of Eq. (9). Differences in φ are biased towards where the phase comes
to next, of the third order; those in ξ are central, conservative, of the second. Nothing flows through the ends of ξ.
The unknowns are T √(P_s dξ), so that places far out count like others.
"""

import math

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import eigs, splu


def moment_lyapunov(oscillator, noise, p, *, phases, steps, lower, upper, above, count=6):
    """The largest of the eigenvalues next to `above`, a number right of Λ(p), whose T has one sign.

    Where T is steep, at the phases that the flow leaves, it oscillates on the grid; the sign is looked at elsewhere.


    Args:
        oscillator, noise: the problem; its noise is that of Eq. (7) with r₀ > 1.
        p: the moment.
        phases: number of points in φ on half a circle.
        steps: number of points in ξ.
        lower, upper: the ends of ξ.
        above: where eigenvalues are sought.
        count: how many are.
    """
    h = math.pi / phases
    phi = math.pi / 2 + h * (0.5 + np.arange(phases))
    xi, couplings, losses = _noise(noise, steps, lower, upper)
    force = oscillator.epsilon * xi + oscillator.epsilon**2 * oscillator.c1
    speed = oscillator.omega + np.outer(force, 0.5 * np.sin(2 * phi))
    growth = np.outer(force, np.sin(phi) ** 2)
    log_factor = math.log(oscillator.impact_factor())
    matrix = sp.kron(sp.diags([couplings, losses, couplings], [-1, 0, 1]), sp.identity(phases))
    matrix = matrix + sp.diags((p * growth).ravel())
    for step, weight in ((-1, -2.0), (0, -3.0), (1, 6.0), (2, -1.0)):
        for sign in (1, -1):
            at = np.arange(phases) + sign * step
            factor = np.exp(p * log_factor * (at // phases))
            shift = sp.csr_array((factor, (np.arange(phases), at % phases)), shape=(phases, phases))
            flow = sp.diags(np.maximum(sign * speed, 0).ravel() * weight / (6 * h))
            matrix = matrix + flow @ sp.kron(sp.identity(steps), shift)
    lu = splu(
        (matrix - above * sp.identity(matrix.shape[0])).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.1
    )
    inverse = sp.linalg.LinearOperator(matrix.shape, matvec=lu.solve)
    values, vectors = eigs(matrix, k=count, sigma=above, OPinv=inverse, v0=np.ones(matrix.shape[0]), tol=1e-9)
    at_rest = vectors.reshape(steps, phases, -1)[:, phases // 2]  # displaced, with little velocity: all paths pass here
    share = np.abs(at_rest).sum(axis=0) / np.abs(vectors).sum(axis=0)
    has_one_sign = np.abs(at_rest.sum(axis=0)) > 0.95 * np.abs(at_rest).sum(axis=0)
    principal = values[has_one_sign & (share > 0.05 * share.max())]
    if not principal.size:
        raise ValueError(f"no eigenvalue next to {above:g} has a T of one sign; use another number of points")
    return float(np.max(principal.real))


@np.errstate(divide="ignore", invalid="ignore")  # for T of one sign, which is looked at
def held(oscillator, noise, p, *, phases, steps, lower, upper, above):
    """The eigenvalue next to `above` whose T has one sign, for paths that are killed where the phase begins to turn.

    Between the ends of ξ the force f = ε(ξ + εc₁) is below −2ω, and dφ/dt = ω + f ½ sin 2φ is positive at φ = π +
    ¼ω/|f| and negative at φ = π + ½ atan(4ω/|f|). So no path leaves an arc between these for all ξ, and points on it,
    even in ln(φ − π), will do. Differences look ahead, and are of the second order. Where paths are killed T = 0.
    """
    xi, couplings, losses = _noise(noise, steps, lower, upper, is_killed=True)
    force = oscillator.epsilon * xi + oscillator.epsilon**2 * oscillator.c1
    ratio = oscillator.omega / -force
    assert np.all((ratio > 0) & (ratio < 0.5))
    ends = math.log(0.25 * np.min(ratio)), math.log(0.5 * math.atan(4 * np.max(ratio)))
    h = (ends[1] - ends[0]) / (phases - 1)
    phi = np.exp(ends[0] + h * np.arange(phases))  # less π
    speed = (oscillator.omega + np.outer(force, 0.5 * np.sin(2 * phi))) / phi
    assert np.all(speed[:, 0] > 0)
    assert np.all(speed[:, -1] < 0)
    matrix = sp.kron(sp.diags([couplings, losses, couplings], [-1, 0, 1]), sp.identity(phases))
    matrix = matrix + sp.diags((p * np.outer(force, np.sin(phi) ** 2)).ravel())
    for sign in (1, -1):
        first, second = sp.eye(phases, k=sign), sp.eye(phases, k=2 * sign)
        ahead = (-3 * sp.identity(phases) + 4 * first - second) / (2 * h)
        flow = sp.diags(np.maximum(sign * speed, 0).ravel())
        matrix = matrix + flow @ sp.kron(sp.identity(steps), ahead)
    lu, found, last = splu((matrix - above * sp.identity(matrix.shape[0])).tocsc()), np.ones(matrix.shape[0]), 0.0
    for _ in range(100):
        image = lu.solve(found)
        distance = float(found @ found / (found @ image))
        found = image / np.linalg.norm(image)
        if abs(distance - last) < 1e-10 * abs(above):
            break
        last = distance
    if not abs(found.sum()) > (1 - 1e-6) * np.abs(found).sum():
        raise ValueError(f"the eigenvalue next to {above:g} has no T of one sign")
    return above + distance


def _noise(noise, steps, lower, upper, is_killed=False):
    """ξ, and the symmetric form of D (P_s T_ξ)_ξ / P_s: what couples neighbours, and the diagonal."""
    unit, diffusion = noise.standard_deviation, 0.5 * noise.diffusion**2
    s = np.linspace(math.asinh(lower / unit), math.asinh(upper / unit), 2 * steps + 1)
    xi, slope = unit * np.sinh(s), unit * np.cosh(s)
    logs, step = noise.log_density(xi), s[2] - s[0]
    mass = (logs + np.log(slope))[1::2]
    flux = (logs - np.log(slope))[2:-1:2] + math.log(diffusion / step**2)
    losses = np.zeros(steps)
    losses[:-1] -= np.exp(flux - mass[:-1])
    losses[1:] -= np.exp(flux - mass[1:])
    if is_killed:
        ends = (logs - np.log(slope))[[0, -1]] + math.log(2 * diffusion / step**2)
        losses[[0, -1]] -= np.exp(ends - mass[[0, -1]])
    return xi[1::2], np.exp(flux - 0.5 * (mass[:-1] + mass[1:])), losses
