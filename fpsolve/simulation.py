"""Sample paths of the system (3) under the noise (7) or (15), compiled by numba.

Nothing here knows of phases, generators or eigenvalues: the mass is at x ≥ 0, has the velocity ẋ = ω u and obeys
Eq. (3),

    ẋ = ω u,   u̇ = −ω x + g u,   g = ε ξ(t) + ε² (c₁ − c₂ x² − c₃ ω² u²),   u⁺ = −R u⁻ at x = 0.

A step of length h draws the noise at its end and its mean over the step. Then the fourth-order Runge-Kutta rule
integrates the motion in the frame that rotates with ω (Lawson's method), so that the free flight is exact. An impact
is sought within the step, to the precision of floating point, and the rest of the step follows after the bounce.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit

from fpsolve.noise import AnyNoise, FloatArray, NonGaussianNoise
from fpsolve.oscillator import VibroImpactOscillator

_CHUNK = 256
"""Paths that are advanced together, so that they stay in the cache and the processor can take several at once."""
_ANGLE, _GROWTH = 0.5, 0.125
"""A step with a larger ω h or |g| h is taken in parts: the first could hide impacts, the second costs accuracy."""
_NEWTON_STEPS = 5
compiled: Any = njit(nogil=True, cache=True, error_model="numpy")
_inlined: Any = njit(nogil=True, error_model="numpy", inline="always")


class Motion(NamedTuple):
    """The numbers of Eq. (3): ω, ε, ε²c₁, ε²c₂, ε²c₃ω², and the factor of u at an impact.

    The factor is −R for the mass at its wall, Eq. (3), and R for the smooth coordinate y of Eq. (6).
    """

    omega: float
    strength: float
    linear: float
    cubic: float
    rayleigh: float
    bounce: float


class NoiseStep(NamedTuple):
    """One step of the noise dξ = (f(ξ) + σ² b) dt + σ dW: its end ξ₁ and its mean ξ̄, from normal variables ζ.

    Ornstein-Uhlenbeck, by the exact transition of both: ξ₁ = decay ξ₀ + kick ζ₁ + end₀ and
    ξ̄ = mean ξ₀ + mean₁ ζ₁ + mean₂ ζ₂ + mean₀.
    Eq. (7), where `pull` > 0, by the implicit trapezoidal rule, of weak order 2, which never leaves the support:
    ξ₁ + pull ξ₁/(1 + cξ₁²) = ξ₀ − pull ξ₀/(1 + cξ₀²) + kick ζ₁ + end₀ with pull = h/2τ₀, and ξ̄ = (ξ₀ + ξ₁)/2.
    """

    rate: float
    decay: float
    kick: float
    end0: float
    mean: float
    mean1: float
    mean2: float
    mean0: float
    pull: float
    curvature: float


def motion(oscillator: VibroImpactOscillator, *, smooth: bool = False) -> Motion:
    """The coefficients of the system (3), or with `smooth` of Eq. (6) in y, whose modulus is x by Eq. (4)."""
    square, R = oscillator.epsilon**2, oscillator.impact_factor()
    return Motion(
        omega=oscillator.omega,
        strength=oscillator.epsilon,
        linear=square * oscillator.c1,
        cubic=square * oscillator.c2,
        rayleigh=square * oscillator.c3 * oscillator.omega**2,
        bounce=R if smooth else -R,
    )


def noise_step(noise: AnyNoise, h: float, tilt: float = 0.0) -> NoiseStep:
    """The coefficients of one step of length h; `tilt` is b, which adds σ² b to the drift."""
    force = noise.diffusion**2 * tilt
    if isinstance(noise, NonGaussianNoise) and noise.r0 != 1:
        kick, curvature = noise.diffusion * math.sqrt(h), noise.tau0 * (noise.r0 - 1) / (2 * noise.D0)
        return NoiseStep(0.0, 0.0, kick, force * h, 0.0, 0.0, 0.0, 0.0, h / (2 * noise.tau0), curvature)
    alpha = 1 / noise.tau0 if isinstance(noise, NonGaussianNoise) else noise.alpha
    std, a = noise.standard_deviation, alpha * h
    decay, mean = math.exp(-a), -math.expm1(-a) / a
    # Variances of ξ₁ and ξ̄ and their covariance, in units of std²; the series avoids cancellation.
    var_end, covariance = -math.expm1(-2 * a), a * mean**2
    if a > 0.02:
        var_mean = (2 * a + 4 * math.expm1(-a) - math.expm1(-2 * a)) / a**2
    else:
        var_mean = a * (2 / 3 - a / 2 + 7 * a**2 / 30 - a**3 / 12 + 31 * a**4 / 1260)
    kick = math.sqrt(var_end)
    mean1 = covariance / kick
    return NoiseStep(
        rate=a,
        decay=decay,
        kick=std * kick,
        end0=force / alpha * (1 - decay),
        mean=mean,
        mean1=std * mean1,
        mean2=std * math.sqrt(var_mean - mean1**2),
        mean0=force / alpha * (1 - mean),
        pull=0.0,
        curvature=0.0,
    )


def stationary_noise(noise: AnyNoise, size: int, rng: np.random.Generator) -> FloatArray:
    """Independent values of ξ from the stationary density: Gaussian, or Eq. (9) as a beta or a Student variable."""
    if not isinstance(noise, NonGaussianNoise) or noise.r0 == 1:
        return noise.standard_deviation * rng.standard_normal(size)
    a = 1 / abs(noise.r0 - 1)
    if noise.r0 < 1:
        return noise.half_width * (2 * rng.beta(a + 1, a + 1, size) - 1)
    nu = 2 * a - 1
    return math.sqrt(2 * noise.D0 * a / (noise.tau0 * nu)) * rng.standard_t(nu, size)


@compiled
def draw(noise, xi, xi_mean, xi_end, push, rng):  # type: ignore[no-untyped-def]
    """The mean and the end of the noise in one step that begins at `xi`; all of shape (n,).

    `push` takes in ∫f(ξ) dt over the step, f without the tilt.
    """
    for i in range(xi.size):
        xi_end[i] = rng.standard_normal()
    if noise.pull > 0:
        _draw_implicit(noise, xi, xi_mean, xi_end, push)
        return
    for i in range(xi.size):
        xi_mean[i] = rng.standard_normal()
    for i in range(xi.size):
        first, start = xi_end[i], xi[i]
        xi_end[i] = noise.decay * start + noise.kick * first + noise.end0
        xi_mean[i] = noise.mean * start + noise.mean1 * first + noise.mean2 * xi_mean[i] + noise.mean0
        push[i] -= noise.rate * xi_mean[i]


@compiled
def _draw_implicit(noise, xi, xi_mean, xi_end, push):  # type: ignore[no-untyped-def]
    """Eq. (7): the root a ≥ 0 of (y − a)(1 + s a²) = pull a in units of 1/√|c|, s the sign of c, by Newton's method."""
    unit = math.sqrt(abs(noise.curvature))
    sign = 1.0 if noise.curvature > 0 else -1.0
    pull = noise.pull
    for i in range(xi.size):
        start = unit * xi[i]
        before = start - pull * start / (1 + sign * start * start)
        target = before + unit * (noise.kick * xi_end[i] + noise.end0)
        y = abs(target)
        if sign < 0:  # inside the support from the first guess on: the smaller root of (y − a)(1 − a) = k
            edge = min(y, 1.0)
            k = pull * edge / (1 + edge)
            a = 0.5 * (y + 1 - math.sqrt((y - 1) * (y - 1) + 4 * k))
        else:
            a = y * (1 + y * y) / (1 + pull + y * y)
        for _ in range(_NEWTON_STEPS):
            square = 1 + sign * a * a
            a += ((y - a) * square - pull * a) / (square + pull - 2 * sign * a * (y - a))
        if sign < 0:
            a = min(max(a, 0.0), 1 - 1e-15)
        end = math.copysign(a, target)
        push[i] += (before - start + end - target) / unit
        xi_end[i] = end / unit
        xi_mean[i] = 0.5 * (xi[i] + xi_end[i])


@_inlined
def _gain(m, xi, x, u):  # type: ignore[no-untyped-def]
    """g of Eq. (3)."""
    return m.strength * xi + m.linear - m.cubic * x * x - m.rayleigh * u * u


@_inlined
def _runge_kutta(m, h, half_cos, half_sin, cos, sin, x, u, xi, rise):  # type: ignore[no-untyped-def]
    """One step of Lawson's fourth-order rule under noise of mean `xi` that rises by 2 `rise`; cosines of ωh/2, ωh."""
    k1 = _gain(m, xi - rise, x, u) * u
    v = u + 0.5 * h * k1
    y, v = half_cos * x + half_sin * v, half_cos * v - half_sin * x
    k2 = _gain(m, xi, y, v) * v
    y, free = half_cos * x + half_sin * u, half_cos * u - half_sin * x
    v = free + 0.5 * h * k2
    k3 = _gain(m, xi, y, v) * v
    y, v = cos * x + sin * u + h * half_sin * k3, cos * u - sin * x + h * half_cos * k3
    k4 = _gain(m, xi + rise, y, v) * v
    v = u + h / 6 * k1
    k2 = h / 3 * (k2 + k3)
    return cos * x + sin * v + half_sin * k2, cos * v - sin * x + half_cos * k2 + h / 6 * k4


@_inlined
def _part(m, x, u, xi, rise, h, t, s):  # type: ignore[no-untyped-def]
    """The part from t to t + s of a step of length h."""
    half = 0.5 * m.omega * s
    mean = xi + rise * (2 * t + s - h) / h
    return _runge_kutta(
        m, s, math.cos(half), math.sin(half), math.cos(2 * half), math.sin(2 * half), x, u, mean, rise * s / h
    )


@compiled
def _flight(m, x, u, xi, rise, h):  # type: ignore[no-untyped-def]
    """One step with its impacts, in parts short enough to see each of them; returns x, u and how many there were."""
    t, impacts = 0.0, 0
    longest = h
    if m.bounce < 0 and x == 0 and u < 0:  # on the wall and about to cross it
        u, impacts = m.bounce * u, 1
    while t < h:
        gain = max(abs(_gain(m, xi - rise, x, u)), abs(_gain(m, xi + rise, x, u)))
        s = min(h - t, longest, _ANGLE / m.omega, _GROWTH / (gain + 1e-300))
        side = 1.0 if x > 0 or (x == 0 and u > 0) else -1.0
        x1, u1 = _part(m, x, u, xi, rise, h, t, s)
        if side * x1 < 0:
            s, u1 = _impact(m, x, u, xi, rise, h, t, s, x1)
            x1, u1, impacts = 0.0, m.bounce * u1, impacts + 1
        elif side * u < 0 and side * u1 > 0 and s > 1e-9 * h:  # turned round without an impact: it was overlooked
            longest = 0.5 * s
            continue
        x, u, t = x1, u1, t + s
        if h - t < 1e-15 * h:
            t = h
    return x, u, impacts


@compiled
def _impact(m, x, u, xi, rise, h, t, s, beyond):  # type: ignore[no-untyped-def]
    """The time from t to the impact, and u before it, by Newton's method inside a bracket; `beyond` is x at t + s."""
    low, high = 0.0, s
    at = s * x / (x - beyond) if x != 0 else s
    u1 = u
    for _ in range(60):
        x1, u1 = _part(m, x, u, xi, rise, h, t, at)
        if x1 * beyond > 0:
            high = at
        else:
            low = at
        move = -x1 / (m.omega * u1)
        if abs(move) <= 1e-14 * h or high - low <= 1e-15 * h:
            break
        at = at + move if low < at + move < high else 0.5 * (low + high)
    return at, u1


@compiled
def move(m, h, x, u, mean, rise, x_end, u_end, is_plain):  # type: ignore[no-untyped-def]
    """Move paths by one step of length h, in place, and return the number of impacts.

    Args:
        m: a `Motion`.
        x, u: the state, shape (n,); m.bounce < 0 needs x ≥ 0.
        mean, rise: ξ in the step is mean + rise (2t/h − 1); shape (n,).
        x_end, u_end, is_plain: room for as many numbers, and as many booleans.
    """
    half = 0.5 * m.omega * h
    half_cos, half_sin, cos, sin = math.cos(half), math.sin(half), math.cos(2 * half), math.sin(2 * half)
    limit = _GROWTH / h if m.omega * h <= _ANGLE else 0.0
    impacts = 0
    for i in range(x.size):
        x_end[i], u_end[i] = _runge_kutta(m, h, half_cos, half_sin, cos, sin, x[i], u[i], mean[i], rise[i])
        gain = max(abs(_gain(m, mean[i] - rise[i], x[i], u[i])), abs(_gain(m, mean[i] + rise[i], x[i], u[i])))
        is_plain[i] = (x_end[i] > 0) & (x[i] >= 0) & ((u[i] >= 0) | (u_end[i] <= 0)) & (gain < limit)
    for i in range(x.size):
        if is_plain[i]:
            x[i], u[i] = x_end[i], u_end[i]
        else:
            x[i], u[i], bounces = _flight(m, x[i], u[i], mean[i], rise[i], h)
            impacts += bounces
    return impacts


@compiled
def advance(m, noise, h, x, u, xi, log_norm, push, steps, interval, rng):  # type: ignore[no-untyped-def]
    """Advance paths by `steps` steps of length h, in place, and return the number of impacts.

    Args:
        m, noise: a `Motion` and a `NoiseStep` of this h.
        x, u, xi: the state of the paths, shape (n,).
        log_norm: ln ‖(x, u)‖ that has been taken out of the state; after every `interval` steps, and at the end, it
            takes in what the state has grown by, and the state has the norm 1 again. With interval = 0 it is left.
        push: takes in ∫f(ξ) dt, see `draw`.
        rng: a `numpy.random.Generator`.
    """
    mean, end = np.empty(_CHUNK), np.empty(_CHUNK)
    x_end, u_end, is_plain = np.empty(_CHUNK), np.empty(_CHUNK), np.empty(_CHUNK, np.bool_)
    impacts = 0
    for first in range(0, x.size, _CHUNK):
        last = min(first + _CHUNK, x.size)
        xs, us, xis, pushes, n = x[first:last], u[first:last], xi[first:last], push[first:last], last - first
        for step in range(1, steps + 1):
            draw(noise, xis, mean[:n], end[:n], pushes, rng)
            for i in range(n):
                xis[i], end[i] = end[i], 0.5 * (end[i] - xis[i])
            impacts += move(m, h, xs, us, mean[:n], end[:n], x_end, u_end, is_plain)
            if interval > 0 and (step % interval == 0 or step == steps):
                for i in range(n):
                    norm = math.sqrt(xs[i] * xs[i] + us[i] * us[i])
                    log_norm[first + i] += math.log(norm)
                    xs[i] /= norm
                    us[i] /= norm
    return impacts
