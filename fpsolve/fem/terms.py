"""The tilted generator L(p) = L₀ + ε L₁ + ε² L₂ of Eq. (19), term by term, in weak form.

For trial T and test w, every integral weighted by P_s(ξ), a drive ε^n g(ξ) A x with h = e′ᵀA e and q = eᵀA e gives

    transport(ε^n h g) + p ε^n ∫ P_s q g w T,      transport(v) = ∫ P_s v w T_φ + point loads,

with the load ∫ P_s v (T(φ⁺) − T(φ⁻)) w at each φ-vertex, on the trace of w from which the whole phase speed, the sum
over all drives, points away (upwinding): w(φ⁻) where it is positive, w(φ⁺) where it is negative. A kick makes the load
that of R^p T(φ⁺) − T(φ⁻), or of T(φ⁺) − R^p T(φ⁻): an impact is exactly a point load.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from fpsolve.arrays import Coefficient, one
from fpsolve.fem.kronecker import KroneckerSum
from fpsolve.fem.space import CylinderSpace
from fpsolve.model.plane import Drive, Harmonics, Kick, System, phase_speed


@dataclass(frozen=True)
class Power:
    """The coefficient pⁿ."""

    n: int

    def __call__(self, p: float, derivative: int = 0) -> float:
        """Its k-th derivative."""
        return math.perm(self.n, derivative) * float(p) ** max(self.n - derivative, 0)


@dataclass(frozen=True)
class Jump:
    """The coefficient R^p − 1."""

    log_factor: float

    def __call__(self, p: float, derivative: int = 0) -> float:
        """Its k-th derivative."""
        if derivative == 0:
            return math.expm1(p * self.log_factor)
        return self.log_factor**derivative * math.exp(p * self.log_factor)


@dataclass(frozen=True, eq=False)
class Term:
    """One term of L(p): a coefficient of p times an operator.

    Attributes:
        order: the power of ε with which it begins; the power itself is in the operator.
        of_p: the coefficient.
        operator: its matrix in weak form.
        text: the term as a reader would write it.
    """

    order: int
    of_p: Power | Jump
    operator: KroneckerSum
    text: str


def terms_of(system: System, space: CylinderSpace) -> Iterator[Term]:
    """L(p) of Eq. (19), term by term."""
    yield Term(0, Power(0), KroneckerSum.of(space.phi.mass(), space.xi.generator()), "L_ξ, the generator of the noise")
    turns_back = _reversals(system, space)
    for drive in system.drives:
        size, text, noise = system.epsilon**drive.order, _prefix(drive), space.xi.mass(drive.g)
        if not drive.h.vanishes:
            operator = _transport(system, space, drive, noise, turns_back)
            yield Term(drive.order, Power(0), size * operator, f"{text}{_written(drive.h)} ∂φ")
        if not drive.q.vanishes:
            operator = KroneckerSum.of(space.phi.mass(drive.q), noise)
            yield Term(drive.order, Power(1), size * operator, f"p {text}{_written(drive.q)}")
    for kick in system.kicks:
        text = f"(R^p − 1) |dφ/dt| δ(φ − {kick.phase:.6g} mod π), R = {math.exp(kick.log_factor):.6g}"
        yield Term(2, Jump(kick.log_factor), _load(system, space, kick), text)


def _transport(system: System, space: CylinderSpace, drive: Drive, noise: csr_matrix, turns_back: Any) -> KroneckerSum:
    """∫ P_s h(φ) g(ξ) w T_φ and its upwind point loads at the φ-vertices; `noise` is ∫ P_s g(ξ)."""
    vertices = space.mesh.phi_lines[:-1]
    jumps = drive.h(vertices)[:, None] * (space.right_trace - space.left_trace)
    along = space.phi.convection(drive.h) + csr_matrix(space.left_trace[~turns_back].T @ jumps[~turns_back])
    total = KroneckerSum.of(along, noise)
    for j in np.flatnonzero(turns_back):
        for trace, direction in ((space.left_trace[j], 1), (space.right_trace[j], -1)):
            load = np.outer(trace, jumps[j])
            total += KroneckerSum.of(load, space.xi.mass(_upwind(system, vertices[j], direction, drive.g)))
    return total


def _load(system: System, space: CylinderSpace, kick: Kick) -> KroneckerSum:
    """A kick's point load beyond continuity: |v| w(φ⁻) T(φ⁺) where the phase runs forward, else |v| w(φ⁺) T(φ⁻)."""
    at = space.mesh.vertices_at(kick.phase)
    left, right = space.left_trace[at], space.right_trace[at]

    def speed(xi: Any) -> Any:
        return phase_speed(system, xi)(kick.phase)

    total = KroneckerSum.of(left.T @ right, space.xi.mass(lambda xi: np.maximum(speed(xi), 0)))
    if np.any(speed(space.xi.support) < 0):
        total += KroneckerSum.of(right.T @ left, space.xi.mass(lambda xi: np.maximum(-speed(xi), 0)))
    return total


def _reversals(system: System, space: CylinderSpace) -> Any:
    """At which φ-vertices the phase speed is negative for some ξ, boolean."""
    speed = phase_speed(system, space.xi.support[:, None])
    return np.any(speed(space.mesh.phi_lines[:-1]) < 0, axis=0)


def _upwind(system: System, phi: float, direction: int, g: Coefficient) -> Coefficient:
    """g(ξ) where the phase speed at φ has the asked direction, 1 or −1; 0 elsewhere."""
    return lambda xi: g(xi) * ((phase_speed(system, xi)(phi) >= 0) == (direction > 0))


def power_of_epsilon(order: int) -> str:
    """ε²."""
    return "ε" if order == 1 else "ε" + str(order).translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))


def _prefix(drive: Drive) -> str:
    """ε^n g(ξ)."""
    power = f"{power_of_epsilon(drive.order)} " if drive.order else ""
    g = "" if drive.g is one else "ξ " if drive.g.__name__ == "identity" else f"{drive.g.__name__}(ξ) "
    return power + g


def _written(harmonics: Harmonics) -> str:
    """(0.5 − 0.5 cos 2φ), or one number."""
    values = harmonics.mean, harmonics.cosine, harmonics.sine
    names = ("", " cos 2φ", " sin 2φ")
    parts = [(float(value), name) for value, name in zip(values, names, strict=True) if value]
    text = "".join(f" {'−' if value < 0 else '+'} {abs(value):g}{name}" for value, name in parts)
    text = text.removeprefix(" + ").removeprefix(" ")
    return text if parts == [(values[0], "")] else f"({text})"
