"""Any linear motion in the plane, compiled: ẋ = A(ξ) x, whose norm grows by R where x crosses the line of a ray.

A jump multiplies the state and leaves its direction alone, and so does the flow of a linear system with a factor. So a
jump may be made at any time of the step in which the line is crossed: what counts is how often it is.

Under a diffusion A(ξ) = A₀ + ξ A₁. A step of length h knows the mean m of ξ and, from its ends, the slope 2r/h of a
line with that mean. The flow of this line is exp Ω to the order 4 (W. Magnus, Comm. Pure Appl. Math. 7, 1954),

    Ω = h A₀ + a A₁ + b [A₀, A₁] + c [A₁, [A₁, A₀]],   a = h m,   b = −h² r/6,   c = 3b²/(5h).

Under white noise a = ΔW and b = ∫(W − ½ΔW) dt are those of the path itself, A₁ with the factor s, and for these c has
the mean 3b²/(5h) + h²/30 (J. Foster, T. Lyons and H. Oberhauser, SIAM J. Numer. Anal. 58, 2020), whose second part
stands in A₀: a scheme of strong order 3/2 and weak order 2.

Under a chain the motion between two jumps of ξ is exp(A t), and these come after exponential times: nothing is left
out. So it is between impulses, each of which multiplies the state: they are a chain whose state is the last one's size.

Rows of arrays are not taken out of them where a path is moved, which takes numba longer than all else.

State: x, u and that of the noise of each path, ξ or the number of a state, arrays of shape (n,) changed in place; of
noise with more numbers a row for each, shape (numbers, n), ξ being the first. A matrix is stored as half its trace t
and the rest ((p, q), (r, −p)), whose square is p² + qr times one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba.extending import overload

from fpsolve.arrays import FloatArray
from fpsolve.simulation.compiled import compiled, inlined
from fpsolve.simulation.rays import Rays

_LIMIT = 0.75**2
"""p² + ½(q² + r²) of Ω above which a step is taken in parts: below, series are exact, and no turn is overlooked."""
_MOST_PARTS = 10_000
_HUGE = 1e100
"""Square of a norm from which on it is taken out of the state."""


def _draw(step, xi, xi_mean, xi_end, push, rng):  # type: ignore[no-untyped-def]
    """`draw` of the class of a step; this is what numba replaces by it."""
    raise NotImplementedError


@overload(_draw)
def _drawn_by_its_kind(step, xi, xi_mean, xi_end, push, rng):  # type: ignore[no-untyped-def]
    return step.instance_class.draw


@compiled
def draw(step, xi, xi_mean, xi_end, push, rng):  # type: ignore[no-untyped-def]
    """The mean and the end of the noise in one step that begins at `xi`, see `Noise.step`."""
    _draw(step, xi, xi_mean, xi_end, push, rng)  # type: ignore[no-untyped-call]


def _first_row(state):  # type: ignore[no-untyped-def]
    """ξ of the state of a noise; this is what numba replaces."""
    raise NotImplementedError


@overload(_first_row)
def _first_row_by_shape(state):  # type: ignore[no-untyped-def]
    return (lambda state: state) if state.ndim == 1 else (lambda state: state[0])


@compiled
def drawn(step, state, xi_mean, xi_rise, push, rng):  # type: ignore[no-untyped-def]
    """Move the state of a noise by one step, in which ξ is about mean + rise (2t/h − 1)."""
    draw(step, state, xi_mean, xi_rise, push, rng)
    xi = _first_row(state)  # type: ignore[no-untyped-call]
    for i in range(xi.size):
        xi[i], xi_rise[i] = xi_rise[i], 0.5 * (xi_rise[i] - xi[i])


@inlined
def picked(reached, rng):  # type: ignore[no-untyped-def]
    """A random number of a law, whose chances up to each are given."""
    mark, k = rng.random(), 0
    while reached[k] < mark:
        k += 1
    return k


class DrivenMotion(NamedTuple):
    """A₀, A₁, [A₀, A₁] and [A₁, [A₁, A₀]] as rows (t, p, q, r), shape (4, 4)."""

    matrices: FloatArray
    rays: Rays

    @staticmethod
    def move(m, noise, h, x, u, xi, log_norm, push, room, rng):  # type: ignore[no-untyped-def]
        """One step of length h, in place; returns how often lines were crossed.

        Args:
            m, noise: this, and the `step` of a diffusion or of white noise.
            x, u, xi: the state of the paths, and that of their noise.
            log_norm: takes in what the norm has grown by beyond that of the state.
            push: takes in ∫f(ξ) dt, see `draw`.
            room: for 5 numbers of each path.
            rng: a `numpy.random.Generator`.
        """
        mean, rise = room[0, : x.size], room[1, : x.size]
        drawn(noise, xi, mean, rise, push, rng)
        return step_driven(m, h, x, u, mean, rise, log_norm, room[2], room[3], room[4])


class SwitchedMotion(NamedTuple):
    """A of each state as rows (t, p, q, r), shape (states, 4), and what multiplies x on arrival, (states, 2, 2)."""

    matrices: FloatArray
    arrivals: FloatArray
    rays: Rays

    @staticmethod
    def move(m, noise, h, x, u, xi, log_norm, push, room, rng):  # type: ignore[no-untyped-def]
        """As that of a `DrivenMotion`, with the `step` of a chain and the numbers of its states in the place of ξ."""
        return step_switched(m, noise, h, x, u, xi, log_norm, rng)


_C = tuple(1 / math.factorial(2 * k) for k in range(9))
_S = tuple(1 / math.factorial(2 * k + 1) for k in range(9))


@inlined
def _cosh(y):  # type: ignore[no-untyped-def]
    """cosh √y, to 1e-15 for |y| ≤ `_LIMIT`."""
    return 1 + y * (_C[1] + y * (_C[2] + y * (_C[3] + y * (_C[4] + y * (_C[5] + y * (_C[6] + y * _C[7]))))))


@inlined
def _sinh(y):  # type: ignore[no-untyped-def]
    """sinh √y/√y, to 1e-15 for |y| ≤ `_LIMIT`."""
    return 1 + y * (_S[1] + y * (_S[2] + y * (_S[3] + y * (_S[4] + y * (_S[5] + y * (_S[6] + y * _S[7]))))))


@inlined
def _side(rays, j, x, u):  # type: ignore[no-untyped-def]
    """The distance from a line, with a sign."""
    return rays.across[j, 0] * x + rays.across[j, 1] * u


@inlined
def _crossings(rays, j, x, u, x1, u1):  # type: ignore[no-untyped-def]
    """How often a line is crossed from x to x₁, which is not far; against its way it counts −1."""
    before, after = _side(rays, j, x, u) >= 0, _side(rays, j, x1, u1) >= 0
    if before == after:
        return 0
    is_forward = after == (rays.along[j, 0] * x1 + rays.along[j, 1] * u1 >= 0)
    return 1 if is_forward == (rays.ways[j] > 0) else -1


@compiled
def step_driven(m, h, x, u, mean, rise, log_norm, x_end, u_end, care):  # type: ignore[no-untyped-def]
    """Move paths by one step of length h, in place, and return how often they crossed lines.

    Args:
        m: a `DrivenMotion`.
        x, u: the state.
        mean, rise: ξ in the step is mean + rise (2t/h − 1).
        log_norm: takes in what the norm has grown by beyond that of the state.
        x_end, u_end, care: room for as many numbers.
    """
    t0, p0, q0, r0 = m.matrices[0]
    t1, p1, q1, r1 = m.matrices[1]
    _, p2, q2, r2 = m.matrices[2]
    _, p3, q3, r3 = m.matrices[3]
    n, lever = x.size, -h * h / 6
    for i in range(n):
        a, b = h * mean[i], lever * rise[i]
        c = 0.6 * b * b / h
        p = h * p0 + a * p1 + b * p2 + c * p3
        q = h * q0 + a * q1 + b * q2 + c * q3
        r = h * r0 + a * r1 + b * r2 + c * r3
        square = p * p + q * r
        cosh, sinh = _cosh(square), _sinh(square)
        x_end[i] = (cosh + sinh * p) * x[i] + sinh * q * u[i]
        u_end[i] = sinh * r * x[i] + (cosh - sinh * p) * u[i]
        log_norm[i] += h * t0 + a * t1
        care[i] = 0.0 if p * p + 0.5 * (q * q + r * r) < _LIMIT else 2.0
    rays, crossed = m.rays, 0
    for j in range(rays.logs.size):
        for i in range(n):
            before, after = _side(rays, j, x[i], u[i]), _side(rays, j, x_end[i], u_end[i])
            care[i] = max(care[i], 0.0 if before * after > 0 else 1.0)
    for i in range(n):
        if care[i] == 2:
            x_end[i], u_end[i], log, count = _in_parts(m, h, x[i], u[i], mean[i], rise[i])
            log_norm[i] += log
            crossed += count
        elif care[i] == 1:
            for j in range(rays.logs.size):
                count = _crossings(rays, j, x[i], u[i], x_end[i], u_end[i])
                log_norm[i] += count * rays.logs[j]
                crossed += count
        x[i], u[i] = x_end[i], u_end[i]
    return crossed


@inlined
def _flow(m, x, u, h, mean, rise):  # type: ignore[no-untyped-def]
    """The state after a time h, but for the growth of the norm by half traces."""
    a, b = h * mean, -h * h / 6 * rise
    c = 0.6 * b * b / h
    p = h * m.matrices[0, 1] + a * m.matrices[1, 1] + b * m.matrices[2, 1] + c * m.matrices[3, 1]
    q = h * m.matrices[0, 2] + a * m.matrices[1, 2] + b * m.matrices[2, 2] + c * m.matrices[3, 2]
    r = h * m.matrices[0, 3] + a * m.matrices[1, 3] + b * m.matrices[2, 3] + c * m.matrices[3, 3]
    square = p * p + q * r
    cosh, sinh = _cosh(square), _sinh(square)
    return (cosh + sinh * p) * x + sinh * q * u, sinh * r * x + (cosh - sinh * p) * u


@compiled
def _in_parts(m, h, x, u, mean, rise):  # type: ignore[no-untyped-def]
    """One step in parts that are small enough: the state, its growth beside that by half traces, and the crossings."""
    rays, log, crossed = m.rays, 0.0, 0
    largest = 0.0
    for xi in (mean - rise, mean + rise):
        p = m.matrices[0, 1] + xi * m.matrices[1, 1]
        q = m.matrices[0, 2] + xi * m.matrices[1, 2]
        r = m.matrices[0, 3] + xi * m.matrices[1, 3]
        largest = max(largest, p * p + 0.5 * (q * q + r * r))
    size = h * math.sqrt(largest / _LIMIT)
    if not size < _MOST_PARTS:
        return math.nan, math.nan, math.nan, 0
    parts = 1 + int(size)
    s = h / parts
    for part in range(parts):
        xi, slope = mean + rise * ((2 * part + 1) / parts - 1), rise / parts
        x1, u1 = _flow(m, x, u, s, xi, slope)
        for j in range(rays.logs.size):
            count = _crossings(rays, j, x, u, x1, u1)
            log += count * rays.logs[j]
            crossed += count
        norm = math.sqrt(x1 * x1 + u1 * u1)
        log += math.log(norm)
        x, u = x1 / norm, u1 / norm
    return x, u, log, crossed


@compiled
def step_switched(m, chain, h, x, u, states, log_norm, rng):  # type: ignore[no-untyped-def]
    """Move paths by a time h, in place, with all jumps of the noise in it, and return how often they crossed lines.

    Args:
        m, chain: a `SwitchedMotion` and the `step` of a chain.
        x, u: the state.
        states: the number of that of the noise.
        log_norm: takes in what the norm has grown by beyond that of the state.
        rng: a `numpy.random.Generator`.
    """
    crossed = 0
    for i in range(x.size):
        k, left = int(states[i]), h
        while left > 0:
            stay = rng.standard_exponential() / chain.leaving[k]
            t = min(stay, left)
            x[i], u[i], log, count = exact_flow(m, k, t, x[i], u[i])
            log_norm[i] += log
            crossed += count
            left -= stay
            if left > 0:
                k = picked(chain.reached[k], rng)
                a, b, c, d = m.arrivals[k, 0, 0], m.arrivals[k, 0, 1], m.arrivals[k, 1, 0], m.arrivals[k, 1, 1]
                x[i], u[i] = a * x[i] + b * u[i], c * x[i] + d * u[i]
                square = x[i] * x[i] + u[i] * u[i]
                if not 1 / _HUGE < square < _HUGE:
                    log_norm[i] += 0.5 * math.log(square)
                    x[i] /= math.sqrt(square)
                    u[i] /= math.sqrt(square)
        states[i] = k
    return crossed


@inlined
def exact_flow(m, k, t, x, u):  # type: ignore[no-untyped-def]
    """exp(A t) x: its direction, the growth of the norm beyond it, and the crossings, none of which is overlooked."""
    return flow_on(m, k, exact_factors(m, k, t), x, u)


@compiled
def exact_factors(m, k, t):  # type: ignore[no-untyped-def]
    """c, s, the growth of the norm and the half-turns of exp(A t) = ± e^growth (c + s B), B the rest of A."""
    half_trace, p, q, r = m.matrices[k, 0], m.matrices[k, 1], m.matrices[k, 2], m.matrices[k, 3]
    square, growth = p * p + q * r, half_trace * t
    if square < 0:  # it turns, and crosses each line once in every half-turn
        omega = math.sqrt(-square)
        turns = int(omega * t / math.pi)
        angle = omega * t - turns * math.pi
        return math.cos(angle), math.sin(angle) / omega, growth, turns
    if square > 0:
        rate = math.sqrt(square)
        fall = -math.expm1(-2 * rate * t)
        return 1 - 0.5 * fall, 0.5 * fall / rate, growth + rate * t, 0
    return 1.0, t, growth, 0


@inlined
def factors(m, k, t):  # type: ignore[no-untyped-def]
    """The same, by series where it is small."""
    half_trace, p, q, r = m.matrices[k, 0], m.matrices[k, 1], m.matrices[k, 2], m.matrices[k, 3]
    square = (p * p + q * r) * t * t
    if abs(square) > _LIMIT:
        return exact_factors(m, k, t)
    return _cosh(square), t * _sinh(square), half_trace * t, 0


@compiled
def flow_on(m, k, factors, x, u):  # type: ignore[no-untyped-def]
    """The same of x by its factors."""
    p, q, r = m.matrices[k, 1], m.matrices[k, 2], m.matrices[k, 3]
    cosh, sinh, log, turns = factors
    x1, u1 = (cosh + sinh * p) * x + sinh * q * u, sinh * r * x + (cosh - sinh * p) * u
    crossed = 0
    for j in range(m.rays.logs.size):
        count = turns + int((_side(m.rays, j, x, u) >= 0) != (_side(m.rays, j, x1, u1) >= 0))
        log += count * m.rays.logs[j]
        crossed += count
    return x1, u1, log, crossed
