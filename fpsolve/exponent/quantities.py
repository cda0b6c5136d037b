"""The quantities that are one number: what solves each, and its perturbation theory.

One solve tells how often there are impacts, and how much must be lost in each so that λ = 0. An impact at x = 0 takes
(0, ẋ) to (0, −Rẋ), which is R (0, ẋ) once every other half-wave is mirrored: it multiplies the
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
from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass, replace
from typing import Literal

from fpsolve.arrays import is_whole, shown
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.error import Absent, Estimate
from fpsolve.exponent.method import Budget
from fpsolve.exponent.root import SEARCH_INTERVAL, nonzero_root
from fpsolve.exponent.solver import ExponentSolver, solver_of
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message
from fpsolve.model import quantity
from fpsolve.model.problem import ParameterDerivative, Problem
from fpsolve.model.quantity import MOMENT as MOMENT
from fpsolve.model.quantity import Quantity as Quantity
from fpsolve.theory.perturbation import second_order_or_none

_EPS = sys.float_info.epsilon
LARGEST_LOG = 500.0
"""R_c is given for |ln R_c| up to this."""
DrawnName = Literal["moment", "lyapunov_exponent", "stability_index"]
"""What a figure can show."""
QuantityName = Literal[DrawnName, "variance_rate", "impact_rate", "critical_impact_factor", "critical_restitution"]


def impact_rate(solver: ExponentSolver, jump: int | None = None) -> Estimate | Absent:
    """N = ∂λ/∂ ln R, the mean number of impacts per unit time; it does not depend on R.

    Its error is the difference from that of a finer discretisation, for algebraic tails of a wider one.

    Args:
        solver: of a problem with impacts.
        jump: the place of a ray among the jumps of the system; None for the only one, if there is one alone.

    Raises:
        NotConverged: it is not resolved.
        ValueError: there is no such jump.
    """
    count = len(solver.problem.linear.jumps)
    if jump is None and count != 1:
        return Absent(Message(Code.NOT_ONE_RAY, count=count or None))
    number = 0 if jump is None else jump
    if not is_whole(number, 0, count - 1):
        raise ValueError(f"got jump = {shown(jump)}; must be a whole number from 0 to {count - 1}, or None")
    value, better = (_flux(each.pair, number) for each in (solver.method.around_zero, solver.method.finer_around_zero))
    generator = solver.method.finer_around_zero.pair.generator
    usual = generator.framed.unit_rate / math.pi
    rounding, lost = 10 * _EPS * max(usual, better), _EPS * generator.rounding_growth * usual
    error = abs(better - value) + (rounding if better > lost else lost)
    return solver.method.checked(Estimate(better, error, usual, quantity=quantity.IMPACT_RATE))


def critical_impact_factor(solver: ExponentSolver, jump: int | None = None) -> Estimate | Absent:
    """R_c = R exp(−λ/N), with which λ = 0: more loss makes almost every path decay. It is > 1 if they do without loss.

    Args:
        solver, jump: as `impact_rate`; other jumps stay as they are.

    Raises:
        NotConverged: λ or N is not resolved.
        ValueError: there is no such jump.
    """
    log = _critical_log_factor(solver, jump)
    if not log:
        return log
    if abs(log.value) > LARGEST_LOG:
        return Absent(Message(Code.LOG_OUT_OF_RANGE, value=log.value, most=LARGEST_LOG))
    value = math.exp(log.value)
    error = value * math.expm1(min(log.error_estimate, LARGEST_LOG))
    found = Estimate(value, error, value * max(1.0, log.scale), quantity=quantity.CRITICAL_IMPACT_FACTOR)
    return solver.method.checked(found)


def critical_restitution(solver: ExponentSolver, jump: int | None = None) -> Estimate | Absent:
    """r_c, the coefficient of restitution with which λ = 0, by the impact law of the system; or why there is none.

    Args:
        solver, jump: as `impact_rate`; r is R itself where the system has no law.

    Raises:
        NotConverged: λ or N is not resolved.
        ValueError: there is no such jump.
    """
    log, system = _critical_log_factor(solver, jump), solver.problem.system
    if not log:
        return log
    symbol, value, slope = system.restitution_at(log.value)
    if log.value > 0:
        # λ is affine in ln R, and 0 at ln R_c
        lossless = solver.lyapunov_exponent().value * log.value / (log.value - system.jumps[jump or 0].log_factor)
        return Absent(Message(Code.ALWAYS_STABLE, symbol=symbol, value=lossless))
    if math.isnan(value):
        return Absent(Message(Code.NO_RESTITUTION))
    if value <= 0:
        return Absent(Message(Code.ALWAYS_UNSTABLE, symbol=symbol, value=value))
    error, scale = slope * log.error_estimate + _EPS, max(1.0, slope * log.scale)
    return solver.method.checked(Estimate(value, error, scale, quantity=quantity.CRITICAL_RESTITUTION))


def _flux(pair: PrincipalPair, number: int) -> float:
    """⟨T*, ∂L′(0)/∂ ln R 1⟩ of a pair at p = 0, R that of one of the jumps."""
    jumps = pair.generator.problem.linear.jumps
    if not jumps:  # of a part beside a ray that the phase never passes, and so no jump twice
        return 0.0
    changes = tuple(float(i == number) for i in range(len(jumps)))
    load = pair.generator.changed(ParameterDerivative(jumps[number].log_factor, jumps=changes), 0.0, 0.0, derivative=1)
    return float(pair.left @ (load @ pair.right) / (pair.left @ pair.space.weighed(pair.right)))


def _critical_log_factor(solver: ExponentSolver, jump: int | None) -> Estimate | Absent:
    """ln R_c = ln R − λ/N."""
    rate = impact_rate(solver, jump)
    if not rate:
        return rate
    if rate.value <= rate.error_estimate:
        return Absent(Message(Code.RARE_IMPACTS, most=rate.value + rate.error_estimate))
    exponent, own = solver.lyapunov_exponent(), solver.problem.linear.jumps[jump or 0].log_factor
    change = exponent.value / rate.value
    size = abs(own) + max(abs(change), exponent.scale / rate.value)
    error = (exponent.error_estimate + abs(change) * rate.error_estimate) / (rate.value - rate.error_estimate)
    return Estimate(own - change, error + _EPS * size, size)


def lyapunov_exponent(
    problem: Problem, *, rtol: float | None = None, mesh: CylinderMesh | None = None, budget: Budget | None = None
) -> Estimate:
    """The largest Lyapunov exponent λ = Λ′(0), Eq. (2): how fast almost every path grows.

    For noise with algebraic tails there is no Λ′(0); `meaning` says so.

    >>> lyapunov_exponent(problem)
    Estimate(λ = -0.00448021... ± ..., in 1/time)

    Args:
        problem: a motion and its noise.
        rtol, mesh, budget: as for `moment_lyapunov`.

    Raises:
        ValueError: rtol is not between 1e-13 and 1.
        NotConverged: it is not resolved on the mesh, or within the budget.
    """
    return solver_of(problem, mesh, rtol, budget).lyapunov_exponent()


def stability_index(
    problem: Problem, *, rtol: float | None = None, mesh: CylinderMesh | None = None, budget: Budget | None = None
) -> Estimate | Absent:
    """The stability index δ_p, the non-zero root of Λ(p), or why there is none from -20 to 20.

    >>> stability_index(problem)
    Estimate(δ_p = 11.46858... ± ...)

    Args:
        problem: a motion and its noise.
        rtol, mesh, budget: as for `moment_lyapunov`.

    Raises:
        ValueError: rtol is not between 1e-13 and 1.
        NotConverged: some p on the way to it is not resolved on the mesh, or within the budget.
    """
    return nonzero_root(solver_of(problem, mesh, rtol, budget))


@dataclass(frozen=True)
class SummaryNumber(Quantity):
    """A quantity that is one number, and not one for each p.

    Attributes:
        solve: finds it, from a solver, or says why there is none in `interval`. Raises `NotConverged`.
        theory: what perturbation theory makes of it; it may be infinite, or NaN where that does not apply.
        interval: where it is sought.
    """

    _: KW_ONLY
    solve: Callable[[ExponentSolver], Estimate | Absent]
    theory: Callable[[Problem], float]
    interval: tuple[float, float] = (-math.inf, math.inf)


def _summary_number(
    quantity: Quantity,
    solve: Callable[[ExponentSolver], Estimate | Absent],
) -> SummaryNumber:
    """The theory is the number of this name of second-order perturbation theory; NaN where that does not apply."""

    def theory(problem: Problem) -> float:
        return float(getattr(second_order_or_none(problem), quantity.name, math.nan))

    return SummaryNumber(**vars(quantity), solve=solve, theory=theory)


def _restitution_by_theory(problem: Problem) -> float:
    theory, system = second_order_or_none(problem), problem.system
    return system.restitution_at(theory.critical_log_factor)[1] if theory and len(system.jumps) == 1 else math.nan


LYAPUNOV_EXPONENT: SummaryNumber = _summary_number(
    quantity.LYAPUNOV_EXPONENT, lambda solver: solver.lyapunov_exponent()
)
STABILITY_INDEX: SummaryNumber = replace(
    _summary_number(quantity.STABILITY_INDEX, nonzero_root), interval=SEARCH_INTERVAL
)
VARIANCE_RATE = _summary_number(quantity.VARIANCE_RATE, lambda solver: solver.variance_rate())
IMPACT_RATE = _summary_number(quantity.IMPACT_RATE, impact_rate)
CRITICAL_IMPACT_FACTOR = _summary_number(quantity.CRITICAL_IMPACT_FACTOR, critical_impact_factor)
CRITICAL_RESTITUTION = SummaryNumber(
    **vars(quantity.CRITICAL_RESTITUTION),
    solve=critical_restitution,
    theory=_restitution_by_theory,
    interval=(0.0, 1.0),
)
SUMMARY_NUMBERS: Mapping[str, SummaryNumber] = {
    each.name: each
    for each in (
        LYAPUNOV_EXPONENT,
        STABILITY_INDEX,
        VARIANCE_RATE,
        IMPACT_RATE,
        CRITICAL_IMPACT_FACTOR,
        CRITICAL_RESTITUTION,
    )
}
OF_IMPACTS = IMPACT_RATE.name, CRITICAL_IMPACT_FACTOR.name, CRITICAL_RESTITUTION.name
"""Those of them that a system without impacts has not."""
QUANTITIES: Mapping[str, Quantity] = {MOMENT.name: MOMENT, **SUMMARY_NUMBERS}
