"""How often there are impacts, and how much must be lost in each so that λ = 0: one solve tells it for every loss.

An impact at x = 0 takes (0, ẋ) to (0, −Rẋ), which is R (0, ẋ) once every other half-wave is mirrored: it multiplies the
whole state by R. The motion between impacts is linear, and the noise does not depend on it. So under one path of the
noise the phase takes the same course for every R, and with n(t) impacts up to t

    ln ‖x(t)‖ = ln ‖x(t)‖ at R = 1 + n(t) ln R,    λ = λ₀ + N ln R,    N = lim n(t)/t,

for noise of any kind and strength: λ is affine in ln R, with the mean number N of impacts per unit time as its slope.

Eq. (19) says it too. R enters L(p) by (R^p − 1) |dφ/dt| δ(φ − π/2 mod π) alone, which is 0 at p = 0. There T = 1, and
T*, the stationary density of (φ, ξ), does not depend on R, so that

    λ = Λ′(0) = ⟨T*, L′(0) 1⟩ = ⟨T*, q⟩ + ln R ⟨T*, |dφ/dt| δ(φ − π/2 mod π)⟩,

whose last factor, the flux of T* over the rays of the impacts, is N. As 1 is in every discrete space, this holds on
each mesh as it stands. And λ = 0 where

    ln R_c = −λ₀/N = ln R − λ/N,

which for motions that are stable without loss is a gain, R_c > 1. Λ(p) for p ≠ 0 is not affine in ln R.
"""

from __future__ import annotations

import math
import sys

from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.error import Absent, Estimate, checked
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.messages import Code, Message
from fpsolve.model.problem import ParameterDerivative
from fpsolve.model.quantity import CRITICAL_IMPACT_FACTOR, CRITICAL_RESTITUTION, IMPACT_RATE

_EPS = sys.float_info.epsilon
LARGEST_LOG = 500.0
"""R_c is given for |ln R_c| up to this."""


def impact_rate(solver: ExponentSolver) -> Estimate | Absent:
    """N = ∂λ/∂ ln R, the mean number of impacts per unit time; it does not depend on R.

    Its error is the difference from that of a finer discretisation, for algebraic tails of a wider one.

    Args:
        solver: of a problem with impacts on one ray; of others there is none.

    Raises:
        NotConverged: it is not resolved.
    """
    count = len(solver.problem.system.jumps)
    if count != 1:
        return Absent(Message(Code.NOT_ONE_RAY, count=count or None))
    value, better = map(_flux, solver.at_zero)
    generator = solver.at_zero[1].generator
    usual = generator.unit_rate / math.pi
    rounding, lost = 10 * _EPS * max(usual, better), _EPS * generator.loss * usual
    error = abs(better - value) + (rounding if better > lost else lost)
    return checked(Estimate(better, error, usual, quantity=IMPACT_RATE), solver.near.remedy)


def critical_impact_factor(solver: ExponentSolver) -> Estimate | Absent:
    """R_c = R exp(−λ/N), with which λ = 0: more loss makes almost every path decay. It is > 1 if they do without loss.

    Raises:
        NotConverged: λ or N is not resolved.
    """
    log = _critical_log_factor(solver)
    if isinstance(log, Absent):
        return log
    if abs(log.value) > LARGEST_LOG:
        return Absent(Message(Code.LOG_OUT_OF_RANGE, value=log.value, most=LARGEST_LOG))
    value = math.exp(log.value)
    error = value * math.expm1(min(log.error_estimate, LARGEST_LOG))
    found = Estimate(value, error, value * max(1.0, log.scale), quantity=CRITICAL_IMPACT_FACTOR)
    return checked(found, solver.near.remedy)


def critical_restitution(solver: ExponentSolver) -> Estimate | Absent:
    """r_c, the coefficient of restitution with which λ = 0, by the impact law of the oscillator; or why there is none.

    Raises:
        NotConverged: λ or N is not resolved.
    """
    system = solver.problem.system
    if not system.impact_parameter:
        return Absent(Message(Code.NO_RESTITUTION))
    log = _critical_log_factor(solver)
    if isinstance(log, Absent):
        return log
    if log.value > 0:
        # λ is affine in ln R, and 0 at ln R_c
        lossless = solver.lyapunov_exponent().value * log.value / (log.value - system.jumps[0].log_factor)
        return Absent(Message(Code.ALWAYS_STABLE, value=lossless))
    value = system.impact_value(log.value)
    if value <= 0:
        return Absent(Message(Code.ALWAYS_UNSTABLE, value=value))
    slope = system.impact_slope(log.value)
    error, scale = slope * log.error_estimate + _EPS, max(1.0, slope * log.scale)
    return checked(Estimate(value, error, scale, quantity=CRITICAL_RESTITUTION), solver.near.remedy)


def _flux(pair: PrincipalPair) -> float:
    """⟨T*, ∂L′(0)/∂ ln R 1⟩ of a pair at p = 0."""
    (jump,) = pair.generator.problem.system.jumps
    load = pair.generator.changed(ParameterDerivative(jump.log_factor, jumps=(1.0,)), 0.0, derivative=1)
    return float(pair.left @ (load @ pair.right) / (pair.left @ pair.space.weighed(pair.right)))


def _critical_log_factor(solver: ExponentSolver) -> Estimate | Absent:
    """ln R_c = ln R − λ/N."""
    rate = impact_rate(solver)
    if isinstance(rate, Absent):
        return rate
    if rate.value <= rate.error_estimate:
        return Absent(Message(Code.RARE_IMPACTS, most=rate.value + rate.error_estimate))
    exponent, own = solver.lyapunov_exponent(), solver.problem.system.jumps[0].log_factor
    change = exponent.value / rate.value
    size = abs(own) + max(abs(change), exponent.scale / rate.value)
    error = (exponent.error_estimate + abs(change) * rate.error_estimate) / (rate.value - rate.error_estimate)
    return Estimate(own - change, error + _EPS * size, size)
