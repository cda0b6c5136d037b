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
from fpsolve.model.direction import Direction
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


@dataclass(frozen=True)
class JumpSlope:
    """The coefficient ∂R^p/∂ ln R = p R^p."""

    log_factor: float

    def __call__(self, p: float, derivative: int = 0) -> float:
        """Its k-th derivative."""
        log = self.log_factor
        grown = derivative * log ** max(derivative - 1, 0) + p * log**derivative
        return grown * math.exp(p * log)


OfMoment = Power | Jump | JumpSlope


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
    of_p: OfMoment
    phase: Any
    g: Coefficient | None
    text: str


def terms_of(system: System, space: CylinderSpace) -> Iterator[Term]:
    """L(p) of Eq. (19), term by term; those of φ alone are the same with any tilt."""
    yield Term(0, Power(0), space.phi.identity, None, "L_ξ, the generator of the noise")
    is_exact, direction = _upwind(system, space)
    for drive in system.drives:
        yield from _driven(drive, system.epsilon, space, direction)
    yield from _penalties(system, space, is_exact, direction)
    for kick in system.kicks:
        text = f"(R^p − 1) |dφ/dt| δ(φ − {kick.phase:.6g} mod π), R = {math.exp(kick.log_factor):.6g}"
        for load, sign in _loads(system, space, kick):
            size, flux = _flux_over(system, space, kick, sign)
            yield Term(2, Jump(kick.log_factor), size * load, flux, text)


def changed_terms(system: System, space: CylinderSpace, by: Direction) -> Iterator[Term]:
    """∂L(p)/∂θ of the same terms where the motion and its kicks change with θ.

    Where θ is the size of the speed for the typical ξ it is held: [T] = 0 there but for the error of the elements.
    """
    vertices, jump, text = space.phi.lines[:-1], _jump(space), "∂/∂θ"
    is_exact, direction = _upwind(system, space)
    for drive in by.drives:
        yield from _driven(drive, system.epsilon, space, direction)
    moved = Moved(system.epsilon, by.drives)
    for j in np.flatnonzero(is_exact & (direction == 0)):
        slope = partial(_change_of_size, system=system, moved=moved, phi=float(vertices[j]))
        yield Term(0, Power(0), -0.5 * jump[[j]].T @ jump[[j]], slope, text)
    for kick, change in zip(system.kicks, by.kicks or np.zeros(len(system.kicks)), strict=True):
        for load, sign in _loads(system, space, kick):
            if change:
                size, flux = _flux_over(system, space, kick, sign)
                yield Term(2, JumpSlope(kick.log_factor), change * size * load, flux, text)
            if by.drives:
                slope = partial(_change_of_flux, system=system, moved=moved, phi=kick.phase, sign=sign)
                yield Term(2, Jump(kick.log_factor), load, slope, text)


def _driven(drive: Drive, epsilon: float, space: CylinderSpace, direction: FloatArray) -> Iterator[Term]:
    """h ∂φ with the loads at the φ-vertices, and p q."""
    phi, jump = space.phi, _jump(space)
    mean = 0.5 * (phi.right_trace + phi.left_trace)
    trace = mean - _rows(0.5 * direction, jump)  # nothing is left of the other side: where ξ is large that would count
    size, text = epsilon**drive.order, _prefix(drive)
    if not drive.h.vanishes:
        along = size * (phi.convection(drive.h) + trace.T @ _rows(drive.h(phi.lines[:-1]), jump))
        yield Term(drive.order, Power(0), along, drive.g, f"{text}{_written(drive.h)} ∂φ")
    if not drive.q.vanishes:
        yield Term(drive.order, Power(1), size * phi.mass(drive.q), drive.g, f"p {text}{_written(drive.q)}")


def _jump(space: CylinderSpace) -> Any:
    """T(φ⁺) − T(φ⁻) at the φ-vertices."""
    return space.phi.right_trace - space.phi.left_trace


def _upwind(system: System, space: CylinderSpace) -> tuple[Any, FloatArray]:
    """At which φ-vertices θ = |v|, and the sign of v at those of them where it is the same for all ξ, otherwise 0."""
    vertices = space.phi.lines[:-1]
    is_exact = np.full(vertices.size, space.xi.is_local)
    for kick in system.kicks:
        is_exact[space.phi.vertices_at(kick.phase)] = True
    speed = phase_speed(system, space.xi.support[:, None])(vertices)
    return is_exact, np.where(is_exact, 1.0 * np.all(speed > 0, axis=0) - np.all(speed < 0, axis=0), 0.0)


def _penalties(system: System, space: CylinderSpace, is_exact: Any, direction: FloatArray) -> Iterator[Term]:
    """−½ ∫ P_s θ [w] [T] at the φ-vertices where the phase runs both ways, or θ is not |v|."""
    vertices, jump, text = space.phi.lines[:-1], _jump(space), "upwind loads between cells"
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


def _change_of_size(xi: Any, system: System, moved: Moved, phi: float) -> Any:
    """∂|dφ/dt|/∂θ at φ."""
    return np.sign(phase_speed(system, xi)(phi)) * phase_speed(moved, xi)(phi)


@dataclass(frozen=True, eq=False)
class Moved:
    """∂/∂θ of a motion, as a motion."""

    epsilon: float
    drives: tuple[Drive, ...]
    kicks: tuple[Kick, ...] = ()


def _loads(system: System, space: CylinderSpace, kick: Kick) -> Iterator[tuple[Any, int]]:
    """A kick's point loads beyond continuity: w(φ⁻) T(φ⁺) where the phase runs forward, 1, else w(φ⁺) T(φ⁻), −1."""
    at = space.phi.vertices_at(kick.phase)
    left, right = space.phi.left_trace[at], space.phi.right_trace[at]
    speed = phase_speed(system, space.xi.support)(kick.phase)
    for load, sign in ((left.T @ right, 1), (right.T @ left, -1)):
        if np.any(sign * speed > 0):
            yield load, sign


def _flux_over(system: System, space: CylinderSpace, kick: Kick, sign: int) -> tuple[float, Coefficient]:
    """max(± dφ/dt, 0) at a kick: a number, times a function of ξ."""
    speed = phase_speed(system, space.xi.support)(kick.phase)
    if np.ptp(speed) <= 1e-12 * np.max(np.abs(speed)):
        return abs(float(speed[0])), one
    return 1.0, partial(_flux, system=system, phi=kick.phase, sign=sign)


def _flux(xi: Any, system: System, phi: float, sign: int) -> Any:
    """max(± dφ/dt, 0) at φ."""
    return np.maximum(sign * phase_speed(system, xi)(phi), 0)


def _change_of_flux(xi: Any, system: System, moved: Moved, phi: float, sign: int) -> Any:
    """∂/∂θ of `_flux`."""
    return np.where(sign * phase_speed(system, xi)(phi) > 0, sign * phase_speed(moved, xi)(phi), 0.0)


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
