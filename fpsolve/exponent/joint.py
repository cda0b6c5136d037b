"""Λ(p) for p < 0 of several classes, which depends on how they grow together.

‖x‖ is about the largest of the r_i = ‖x_i‖, so that E‖x‖^p is carried by paths on which none of them grows much. With
E Π r_i^(α_i) ~ exp(G(α) t), I(a) the rate function by which ln r_i ~ a_i t,

    Λ(p) = sup_a (min_i p a_i − I(a)) = min_θ G(pθ),    θ_i ≥ 0, Σ θ_i = 1,

as min p a_i is the least of p Σ θ_i a_i, and G is convex. At the end θ_i = 1 this is Λ_i(p), that of one class.

Where one class drives another, y of the latter may cancel what it is driven by. The mean over starts of y in a ball is
that of |Φ(y + d)|^p with d given by the path, at most a constant times ‖Φ‖^p for p > −1: so for these p almost every
start has this Λ(p). For p < −1 it is so where Λ(p) is that of a class that none drives, as ‖x‖^p ≤ r_i^p.

Three things tell the minimum. Two classes that no noise drives both are independent, G = Λ₁(α) + Λ₂(β). Of two of one
coordinate each G is that of `Problem.mixed`. And there is a bound for all others. On the paths that carry E r₁^p, ln r₁
grows at the rate Λ₁′(p), and their entropy against all paths grows at the rate H = pΛ₁′(p) − Λ₁(p). So on them ln r_i
grows at most at the rate (Λ_i(m) + H)/m, for every m > 0 (M. D. Donsker, S. R. S. Varadhan, Comm. Pure Appl. Math. 28,
1975). Where for some m this is less than Λ₁′(p), which is where Λ_i(m) lies below the tangent of Λ₁ at p, r₁ is the
largest on these paths, and Λ(p) = Λ₁(p).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from fpsolve.errors import NotConverged
from fpsolve.exponent.adapt import Tolerance
from fpsolve.exponent.error import Estimate, Solution, SumOfSolutions
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem

NEAR_END, CLOSE = 1e-3, 1e-5
"""Of a share between two classes: where the slope at its ends is looked at, and to what it is sought."""
ORDERS = (1.0, 0.5, 2.0, 0.25, 4.0)
"""The m that are tried."""
DOUBT, SAFETY = 1e-6, 10.0
"""By how much a tangent must be missed: by a share of the rates, and by so many errors."""


class ClassSolver(Protocol):
    """What solves a class, whose system is a `Subsystem`."""

    @property
    def problem(self) -> Problem: ...

    def solution(self, p: float, tolerance: Tolerance | None = None) -> Solution: ...

    def lyapunov_exponent(self) -> Estimate: ...


def joint_solution(
    problem: Problem,
    classes: Sequence[ClassSolver],
    solve: Callable[[Problem], Solution],
    p: float,
    tolerance: Tolerance | None,
) -> tuple[Solution, int | None]:
    """Λ(p), p < 0, and the number of the class that has it; None where it is between two.

    Args:
        problem: of several classes.
        classes: what solves each.
        solve: Λ(p) of another problem, within the tolerance.
        p: the moment.
        tolerance: that of each class, see `ExponentSolver.solution`.

    Raises:
        NotConverged: a class is not resolved, or Λ(p) does not follow from those of the classes.
    """
    blocks = problem.blocks
    still = [k for k, block in enumerate(blocks) if not block.driven_by]
    fastest = max(still, key=lambda k: classes[k].lyapunov_exponent().value, default=None)
    left = [k for k in range(len(blocks)) if blocks[k].driven_by or k == fastest]  # of those without noise one counts
    ends = {k: classes[k].solution(p, tolerance) for k in left}
    first = min(left, key=lambda k: ends[k].pair.value)
    if len(left) == 1:
        return ends[first], first
    are_two, are_scalar = len(left) == 2, all(blocks[k].is_scalar for k in left)
    if not (are_two and (are_scalar or not _share_noise(*(classes[k].problem for k in left)))):
        if not all(_lags(ends[first], classes[k], tolerance) for k in left if k != first):
            raise NotConverged(Message(Code.GROWING_TOGETHER, p=p, blocks=problem.block_names))
        return ends[first], _allowed(problem, p, first)
    found, number = _between(problem, [classes[k] for k in left], solve, p, tolerance)
    return found, _allowed(problem, p, None if number is None else left[number])


def _allowed(problem: Problem, p: float, number: int | None) -> int | None:
    """The number of a class; p < −1 is refused where one block drives another, but for a class that none drives."""
    drivers = np.count_nonzero(problem.is_driven_by, axis=1) - 1
    if p < -1 and np.any(drivers) and (number is None or drivers[number]):
        raise NotConverged(Message(Code.CANCELLATIONS, p=p, blocks=problem.block_names))
    return number


def _lags(end: Solution, other: ClassSolver, tolerance: Tolerance | None) -> bool:
    """Whether another class grows less on the paths that carry a moment, as far as its entropy tells."""
    p, value, slope = end.pair.p, end.pair.value, end.pair.derivative
    for m in ORDERS:
        try:
            found = other.solution(m, tolerance)
        except NotConverged:
            continue
        doubt = SAFETY * (end.error + found.error) + DOUBT * ((m - p) * abs(slope) + abs(value))
        if found.pair.value + doubt < value + (m - p) * slope:
            return True
    return False


def _between(
    problem: Problem,
    pair: Sequence[ClassSolver],
    solve: Callable[[Problem], Solution],
    p: float,
    tolerance: Tolerance | None,
) -> tuple[Solution, int | None]:
    """min G(pθ, p(1 − θ)) of two classes, and whether it is that of the one, 0, at θ = 1, or the other, 1, at θ = 0."""
    first, second = pair
    ends = [each.solution(p, tolerance) for each in pair]
    is_mixed = _share_noise(first.problem, second.problem)

    def at(share: float) -> Solution:
        if is_mixed:
            return solve(problem.mixed(first.problem, second.problem, share))
        parts = first.solution(p * share, tolerance), second.solution(p * (1 - share), tolerance)
        return _sum(p, share, *parts)

    from scipy.optimize import minimize_scalar  # which takes long to import, and few need

    for number, share in enumerate((1 - NEAR_END, NEAR_END)):
        if at(share).pair.value >= ends[number].pair.value:
            return ends[number], number
    tried = [*ends]

    def value(share: float) -> float:
        tried.append(at(share))
        return tried[-1].pair.value

    minimize_scalar(value, bounds=(0.0, 1.0), method="bounded", options={"xatol": CLOSE})
    best, second_best = sorted(tried, key=lambda each: each.pair.value)[:2]
    return replace(best, search=second_best.pair.value - best.pair.value), None


def _share_noise(first: Problem, second: Problem) -> bool:
    """Whether some noise drives both."""
    return bool(set(first.system.driven_by) & set(second.system.driven_by))


def _sum(p: float, share: float, first: Solution, second: Solution) -> Solution:
    """Λ₁(pθ) + Λ₂(p(1 − θ)), whose eigenfunction is the product of both."""
    one, other = first.pair, second.pair
    slope = share * one.derivative + (1 - share) * other.derivative
    residual = max(one.residual, other.residual)
    value = one.value + other.value
    pair = replace(one, p=p, eigenvalue=value, correction=0.0, derivative=slope, residual=residual)
    return SumOfSolutions(pair, parts=(first, second))
