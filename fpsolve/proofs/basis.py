"""Functions of φ and z in which eigenfunctions are tried, u = Σ u_km e^{2ikφ} B_m(z), and what L makes of them.

Coefficients are arrays (modes, m) of complex balls, modes k = −K … K. Multiplied by a factor D(z) > 0 that clears the
denominator of b, the mismatch Lu − μu is again a sum of e^{2ikφ} times polynomials of z, by exact formulas.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from fpsolve.proofs.balls import Balls, ball
from fpsolve.proofs.statement import Cylinder


class Basis(Protocol):
    """Polynomials of z, by coefficients of those that `cells` encloses."""

    @property
    def gauge(self) -> float:
        """β in T = e^{βz} u."""

    def values(self, u: Balls) -> Balls:
        """u."""

    def slope(self, u: Balls) -> Balls:
        """u_z."""

    def diffused(self, u: Balls, noise: Cylinder) -> Balls:
        """D ν (½ ∂zz − b ∂z) of u e^{gauge z}, divided by e^{gauge z}."""

    def cleared(self, u: Balls, noise: Cylinder) -> Balls:
        """D u."""

    def times_z(self, u: Balls) -> Balls:
        """z u, one degree more."""


def padded(u: Balls, waves: int = 0, degrees: int = 0) -> Balls:
    """With zeros for more modes on both sides and for higher degrees."""
    found = np.empty((u.shape[0] + 2 * waves, u.shape[1] + degrees), dtype=object)
    found.fill(ball(0))
    found[waves : waves + u.shape[0], : u.shape[1]] = u
    return found


def added(*parts: Balls) -> Balls:
    """The sum of coefficients of several degrees and numbers of modes."""
    waves, degrees = (max(part.shape[axis] for part in parts) for axis in (0, 1))
    found = padded(parts[0], (waves - parts[0].shape[0]) // 2, degrees - parts[0].shape[1])
    for part in parts[1:]:
        found = found + padded(part, (waves - part.shape[0]) // 2, degrees - part.shape[1])
    return found


def turned(bands: Balls, u: Balls) -> Balls:
    """F u, with one mode more on either side; `bands` as `Cylinder.bands` has them for the modes of u."""
    found = padded(0 * u, waves=1)
    for d in range(3):
        found[d : d + u.shape[0]] += bands[d][:, None] * u
    return found


def mismatch(basis: Basis, u: Balls, noise: Cylinder, p: Any, mu: Any) -> Balls:
    """D (Lu − μu)."""
    values = basis.values(u)
    waves = u.shape[0] // 2
    still, driven = (turned(noise.bands(i, p, waves), values) for i in (0, 1))
    rest = added(still, basis.times_z(driven), -mu * values)
    return added(basis.diffused(u, noise), basis.cleared(rest, noise))


def drift_mismatch(basis: Basis, f: Balls, noise: Cylinder, mu: Any) -> Balls:
    """D (q + κh + L(0) f − μ), L(0) without its gauge: how far the drift of ln‖x‖ + f is from μ."""
    values = basis.values(f)
    waves = f.shape[0] // 2
    still, driven = (turned(noise.bands(i, 0 * noise.nu, waves), values) for i in (0, 1))
    source = [noise.growth(i)[:, None] for i in (0, 1)]
    source[0][1, 0] -= mu
    rest = added(still, source[0], basis.times_z(added(driven, source[1])))
    return added(basis.diffused(f, noise), basis.cleared(rest, noise))


def held(basis: Basis, u: Balls, noise: Cylinder, p: Any, mu: Any) -> tuple[Balls, Balls]:
    """(F₀ + z F₁ + ½ νβ² − μ) u and F₁ u, of which n u and n_z u of `factor` are made; for p None the same of λ."""
    values, waves = basis.values(u), u.shape[0] // 2
    exponent = 0 * noise.nu if p is None else p
    still, driven = (turned(noise.bands(i, exponent, waves), values) for i in (0, 1))
    if p is None:
        source = [noise.growth(i)[:, None] for i in (0, 1)]
        source[0][1, 0] -= mu
        still, driven = added(still, source[0]), added(driven, source[1])
    else:
        beta = ball(basis.gauge)
        still = added(still, (noise.nu * beta * beta / 2 - mu) * values)
    return added(still, basis.times_z(driven)), driven


@dataclass(frozen=True)
class Core:
    """Polynomials He_m(y)/√m! of y = (z − centre)/scale, used in the part of the line where the noise mostly is.

    Attributes:
        gauge: β in T = e^{βz} u, which levels u.
    """

    centre: float
    scale: float
    gauge: float

    def values(self, u: Balls) -> Balls:
        """u."""
        return u

    def slope(self, u: Balls) -> Balls:
        """u_z, from d/dy He_m = m He_{m−1}."""
        found = padded(0 * u)
        found[:, :-1] = u[:, 1:] * _roots(u.shape[1])[1:] / ball(self.scale)
        return found

    def diffused(self, u: Balls, noise: Cylinder) -> Balls:
        """D ν (½ u_zz + (β − b) u_z + (½ β² − bβ) u), D b = b′(0) z."""
        beta = ball(self.gauge)
        first = added(self.slope(u), beta * u)
        second = added(self.slope(first), beta * first)
        return added(self.cleared(second * (noise.nu / 2), noise), self.times_z(first) * (-noise.nu * noise.slope))

    def cleared(self, u: Balls, noise: Cylinder) -> Balls:
        """D u, D = 1 − z² for bounded noise, else 1."""
        return added(u, -self.times_z(self.times_z(u))) if noise.is_bounded else u

    def times_z(self, u: Balls) -> Balls:
        """z u, from y He_m = He_{m+1} + m He_{m−1}."""
        found = padded(ball(self.centre) * u, degrees=1)
        roots, scale = _roots(u.shape[1] + 1), ball(self.scale)
        found[:, 1:] += u * (roots[1:] * scale)
        found[:, : u.shape[1] - 1] += u[:, 1:] * (roots[1:-1] * scale)
        return found


@dataclass(frozen=True)
class Whole:
    """B_0 = 1 and ∫(1 − z²) T_{m−1} dz on the whole support [−1, 1] of bounded noise.

    Both ends have u_z = 0, and b u_z is a polynomial, −b B_m′ = −a z T_{m−1}.
    """

    gauge: float = 0.0

    def values(self, u: Balls) -> Balls:
        """u in Chebyshev polynomials, of two degrees more; ∫T_n = ½ (T_{n+1}/(n + 1) − T_{n−1}/(n − 1))."""
        slope = self.slope(u)
        found = padded(0 * slope, degrees=1)
        found[:, 0] = u[:, 0]
        found[:, 1] += slope[:, 0]
        for n in range(1, slope.shape[1]):
            found[:, n + 1] += slope[:, n] / (2 * (n + 1))
            if n > 1:
                found[:, n - 1] -= slope[:, n] / (2 * (n - 1))
        return found

    def slope(self, u: Balls) -> Balls:
        """u_z = (1 − z²) Σ u_m T_{m−1}, (1 − z²) T_n = ½ T_n − ¼ (T_{n+2} + T_{|n−2|})."""
        inner = u[:, 1:]
        found = padded(inner / 2, degrees=2)
        for n in range(inner.shape[1]):
            for other in (n + 2, abs(n - 2)):
                found[:, other] -= inner[:, n] / 4
        return found

    def diffused(self, u: Balls, noise: Cylinder) -> Balls:
        """ν (½ u_zz − a z Σ u_m T_{m−1}), with d/dz (1 − z²) T_n = (n/2 − 1) T_{|n−1|} − (n/2 + 1) T_{n+1}."""
        inner = u[:, 1:]
        second = padded(0 * inner, degrees=1)
        for n in range(inner.shape[1]):
            second[:, abs(n - 1)] += inner[:, n] * (n - 2) / 2
            second[:, n + 1] -= inner[:, n] * (n + 2) / 2
        return added(second * (noise.nu / 2), self.times_z(inner) * (-noise.nu * noise.slope))

    def cleared(self, u: Balls, noise: Cylinder) -> Balls:
        """u, as nothing needs to be cleared: D = 1."""
        return u

    def times_z(self, u: Balls) -> Balls:
        """z u, from z T_n = ½ (T_{n+1} + T_{|n−1|})."""
        found = padded(0 * u, degrees=1)
        for n in range(u.shape[1]):
            found[:, n + 1] += u[:, n] / 2
            found[:, abs(n - 1)] += u[:, n] / 2
        return found


def _roots(count: int) -> Balls:
    """√0, √1, … as balls."""
    return np.array([ball(m).sqrt() for m in range(count)], dtype=object)
