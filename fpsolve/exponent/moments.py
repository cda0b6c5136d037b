"""Λ at several p, one by one or by interpolation, and what did not converge."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.errors import NotConverged
from fpsolve.exponent.adapt import Budget
from fpsolve.exponent.error import Failure
from fpsolve.exponent.function import MomentLyapunovFunction, broken_convexity
from fpsolve.exponent.solver import ExponentSolver, MomentLyapunov
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message, message_of
from fpsolve.model.problem import Problem, checked_moments, of_problem
from fpsolve.theory.far import grows_far_out

FEW_MOMENTS = 9
"""Up to so many p are solved one by one."""


@of_problem
def moment_lyapunov(
    problem: Problem,
    p: ArrayLike,
    *,
    rtol: float = 1e-8,
    mesh: CylinderMesh | None = None,
    budget: Budget | None = None,
) -> MomentLyapunov:
    """The moment Lyapunov exponent Λ(p) = lim (1/t) ln E‖x(t)‖^p, Eq. (1), as the principal eigenvalue of Eq. (19).

    Args:
        problem: a motion and its noise, in one argument or two.
        p: one moment, or an array of shape (n,).
        rtol: |error| ≤ rtol·max(|Λ|, the terms of Eq. (37) before they cancel).
        mesh: a mesh for all p, where an `error_estimate` above rtol gives a warning; None chooses one that meets rtol.
        budget: what the choice of a mesh may cost; None for the default one.

    Many p are interpolated, see `MomentLyapunovFunction`, where that saves solves; the result then has no `pairs`.

    Raises:
        ValueError: p is not finite, or empty, or rtol is not positive.
        NoSuchExponent: Λ(p) is infinite.
        NotConverged: some p are not resolved on the mesh, or within the budget; `partial` is the result for the others.
    """
    solver = ExponentSolver(problem, mesh, rtol=rtol, budget=budget or Budget())
    result = solve_moments(solver, checked_moments(p, problem))
    if result.failures:
        raise NotConverged(Message(Code.SEVERAL, reasons=[failure.reason for failure in result.failures]), result)
    return result


def solve_moments(
    solver: ExponentSolver, p: ArrayLike, *, progress: Callable[[], None] = lambda: None
) -> MomentLyapunov:
    """Λ at several p, by interpolation where that saves solves; what did not converge is in its `failures`.

    Args:
        solver: of the problem.
        p: one moment, or an array of shape (n,), which here may be empty; equal ones are solved once.
        progress: called once for each p, whatever the number of solves.

    Raises:
        NoSuchExponent: Λ(p) is infinite for one of the p.
    """
    asked = checked_moments(p, solver.problem, may_be_empty=True)
    points, reports = np.array([*dict.fromkeys(asked.tolist())], dtype=float), repeat(progress, asked.size)

    def report() -> None:
        next(reports, lambda: None)()

    result = _interpolated(solver, points, report) or _one_by_one(solver, points, report)
    for each in reports:
        each()
    return result if points.size == asked.size else _at(result, asked)


def _at(result: MomentLyapunov, p: FloatArray) -> MomentLyapunov:
    """A result at p some of which are equal, without those that failed."""
    places = {each: i for i, each in enumerate(result.p.tolist())}
    index = [places[each] for each in p.tolist() if each in places]
    names = ("p", "value", "derivative", "error_estimate", "residual")
    return replace(result, **{name: getattr(result, name)[index] for name in names})


def _interpolated(solver: ExponentSolver, p: FloatArray, progress: Callable[[], None]) -> MomentLyapunov | None:
    """Λ at many p; None where that takes as many solves, or does not converge."""
    if p.size <= FEW_MOMENTS or grows_far_out(solver.problem):
        return None
    ends = float(p.min()), float(p.max())
    try:
        function = MomentLyapunovFunction(solver.problem, ends, solver=solver, among=p, progress=progress)
        return function.moments(p) if function.is_converged else None
    except NotConverged:
        return None


def _one_by_one(solver: ExponentSolver, p: FloatArray, progress: Callable[[], None]) -> MomentLyapunov:
    result = solver.moments(p, progress=progress)
    obstacle = None if result.failures else broken_convexity(result.pairs, result.error_estimate)
    if obstacle:
        return replace(result, failures=(Failure(None, message_of(obstacle).advising(solver.near.refinement)),))
    return _with_zero(result, p)


def _with_zero(result: MomentLyapunov, p: FloatArray) -> MomentLyapunov:
    """A result with Λ(0) = 0, which needs no solve; where its eigenpair failed, Λ′ and residual are NaN."""
    failures = tuple(failure for failure in result.failures if failure.p != 0)
    if len(failures) == len(result.failures):
        return result
    failed = {failure.p for failure in failures}
    place = [float(each) for each in p if each not in failed].index(0.0)
    row = {"p": 0.0, "value": 0.0, "derivative": np.nan, "error_estimate": 0.0, "residual": np.nan}
    columns: dict[str, Any] = {name: np.insert(getattr(result, name), place, number) for name, number in row.items()}
    return replace(result, failures=failures, **columns)
