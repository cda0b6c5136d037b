"""The tilted generator L(p) = L₀ + ε L₁ + ε² L₂ of Eq. (19), term by term, in weak form.

For trial T and test w, every integral weighted by P_s(ξ), a drive ε^n g(ξ) A x with h = e′ᵀA e and q = eᵀA e gives

    ∫ P_s ε^n g h w T_φ + p ε^n ∫ P_s g q w T,

and at each φ-vertex the point load ∫ P_s (v {w} − ½θ [w]) [T], with the phase speed v = Σ ε^n g h, the mean {w} and the
jump [w] = w(φ⁺) − w(φ⁻) of its two traces. θ = |v| is upwinding; for polynomials of ξ, which cannot follow its kink, θ
is its size for the typical ξ, |Σ ε^n h| over what no noise drives + Σ ε^n |h| (mean of g²)^½ over the rest. A kick
makes the load that of R^p T(φ⁺) − T(φ⁻), on w(φ⁻), as the phase runs forward, or of T(φ⁺) − R^p T(φ⁻), on w(φ⁺): an
impact is exactly a point load, for which θ must be |v|.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import diags, issparse

from fpsolve.arrays import Coefficient, FloatArray, one
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
    """One term of L(p): a coefficient of p times an operator Φ ⊗ ∫P_s g.

    Attributes:
        order: the power of ε with which it begins; the power itself is in the operator.
        of_p: the coefficient.
        phase: the matrix of φ.
        g: the function of ξ; None for L_ξ.
        text: the term as a reader would write it.
    """

    order: int
    of_p: Power | Jump
    phase: Any
    g: Coefficient | None
    text: str


def terms_of(system: System, space: CylinderSpace) -> Iterator[Term]:
    """L(p) of Eq. (19), term by term; those of φ alone are the same with any tilt."""
    phi = space.phi
    yield Term(0, Power(0), phi.identity, None, "L_ξ, the generator of the noise")
    jump, mean = phi.right_trace - phi.left_trace, 0.5 * (phi.right_trace + phi.left_trace)
    is_exact, direction = _upwind(system, space)
    trace = mean - _rows(0.5 * direction, jump)  # nothing is left of the other side: where ξ is large that would count
    for drive in system.drives:
        size, text = system.epsilon**drive.order, _prefix(drive)
        if not drive.h.vanishes:
            along = size * (phi.convection(drive.h) + trace.T @ _rows(drive.h(phi.lines[:-1]), jump))
            yield Term(drive.order, Power(0), along, drive.g, f"{text}{_written(drive.h)} ∂φ")
        if not drive.q.vanishes:
            yield Term(drive.order, Power(1), size * phi.mass(drive.q), drive.g, f"p {text}{_written(drive.q)}")
    yield from _penalties(system, space, jump, is_exact, direction)
    for kick in system.kicks:
        yield from _kicked(system, space, kick)


def _upwind(system: System, space: CylinderSpace) -> tuple[Any, FloatArray]:
    """At which φ-vertices θ = |v|, and the sign of v at those of them where it is the same for all ξ, otherwise 0."""
    vertices = space.phi.lines[:-1]
    is_exact = np.full(vertices.size, space.xi.is_local)
    for kick in system.kicks:
        is_exact[space.phi.vertices_at(kick.phase)] = True
    speed = phase_speed(system, space.xi.support[:, None])(vertices)
    return is_exact, np.where(is_exact, 1.0 * np.all(speed > 0, axis=0) - np.all(speed < 0, axis=0), 0.0)


def _penalties(system: System, space: CylinderSpace, jump: Any, is_exact: Any, direction: FloatArray) -> Iterator[Term]:
    """−½ ∫ P_s θ [w] [T] at the φ-vertices where the phase runs both ways, or θ is not |v|."""
    vertices, text = space.phi.lines[:-1], "upwind loads between cells"
    if not np.all(is_exact):
        typical = np.where(is_exact, 0.0, _typical_speed(system, space))
        yield Term(0, Power(0), -0.5 * jump.T @ _rows(typical, jump), one, text)
    for j in np.flatnonzero(is_exact & (direction == 0)):
        size = partial(_size_of_speed, system=system, phi=float(vertices[j]))
        yield Term(0, Power(0), -0.5 * jump[[j]].T @ jump[[j]], size, text)


def _typical_speed(system: System, space: CylinderSpace) -> FloatArray:
    """θ at the φ-vertices for the typical ξ, shape (m,)."""
    vertices, constant = space.phi.lines[:-1], space.xi.constant()
    total, steady, driven = (
        constant @ (space.xi_matrix(one) @ constant),
        np.zeros(vertices.size),
        np.zeros(vertices.size),
    )
    for drive in system.drives:
        speed = system.epsilon**drive.order * drive.h(vertices)
        if drive.g is one:
            steady += speed
        else:
            square = space.xi.mass(lambda xi, g=drive.g: g(xi) ** 2)  # type: ignore[misc]
            driven = driven + abs(speed) * math.sqrt(constant @ (square @ constant) / total)
    return abs(steady) + driven


def _size_of_speed(xi: Any, system: System, phi: float) -> Any:
    """|dφ/dt| at φ."""
    return np.abs(phase_speed(system, xi)(phi))


def _kicked(system: System, space: CylinderSpace, kick: Kick) -> Iterator[Term]:
    """A kick's point load beyond continuity: |v| w(φ⁻) T(φ⁺) where the phase runs forward, else |v| w(φ⁺) T(φ⁻)."""
    at = space.phi.vertices_at(kick.phase)
    left, right = space.phi.left_trace[at], space.phi.right_trace[at]
    text = f"(R^p − 1) |dφ/dt| δ(φ − {kick.phase:.6g} mod π), R = {math.exp(kick.log_factor):.6g}"
    speed = phase_speed(system, space.xi.support)(kick.phase)
    if np.ptp(speed) <= 1e-12 * np.max(np.abs(speed)):
        load = left.T @ right if speed[0] > 0 else right.T @ left
        yield Term(2, Jump(kick.log_factor), abs(float(speed[0])) * load, one, text)
        return
    for load, sign in ((left.T @ right, 1), (right.T @ left, -1)):
        if np.any(sign * speed > 0):
            yield Term(2, Jump(kick.log_factor), load, partial(_flux, system=system, phi=kick.phase, sign=sign), text)


def _flux(xi: Any, system: System, phi: float, sign: int) -> Any:
    """max(± dφ/dt, 0) at φ."""
    return np.maximum(sign * phase_speed(system, xi)(phi), 0)


def _rows(factors: FloatArray, matrix: Any) -> Any:
    """A matrix with its rows multiplied."""
    return diags(factors) @ matrix if issparse(matrix) else factors[:, None] * matrix


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
