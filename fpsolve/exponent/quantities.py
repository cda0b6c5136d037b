"""The quantities that are one number: what solves each, and its perturbation theory."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from fpsolve.exponent.adapt import Budget
from fpsolve.exponent.error import Absent, Estimate
from fpsolve.exponent.function import SEARCH_INTERVAL, nonzero_root
from fpsolve.exponent.impacts import critical_impact_factor, critical_restitution, impact_rate
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.model import quantity
from fpsolve.model.problem import Problem, of_problem
from fpsolve.model.quantity import MOMENT as MOMENT
from fpsolve.model.quantity import Quantity as Quantity
from fpsolve.theory.perturbation import second_order_or_none

DrawnName = Literal["moment", "lyapunov_exponent", "stability_index"]
"""What a figure can show."""
QuantityName = Literal[DrawnName, "variance_rate", "impact_rate", "critical_impact_factor", "critical_restitution"]


@dataclass(frozen=True)
class Index(Quantity):
    """A quantity that is one number, and not one for each p.

    Attributes:
        solve: finds it, from a solver and the `root` of its `MomentLyapunov`, or says why there is none in `interval`.
            Raises `NotConverged`.
        theory: what perturbation theory makes of it; it may be infinite, or NaN where that does not apply.
        interval: where it is sought.
    """

    solve: Callable[[ExponentSolver, float | None], Estimate | Absent] = field(kw_only=True)
    theory: Callable[[Problem], float] = field(kw_only=True)
    interval: tuple[float, float] = field(kw_only=True)


def _theory(problem: Problem, name: str) -> float:
    """A number of second-order perturbation theory; NaN where that does not apply."""
    return float(getattr(second_order_or_none(problem), name, math.nan))


def _index(
    record: Quantity,
    solve: Callable[[ExponentSolver, float | None], Estimate | Absent],
    theory: Callable[[Problem], float],
    interval: tuple[float, float] = (-math.inf, math.inf),
) -> Index:
    """A record with what solves it."""
    return Index(**vars(record), solve=solve, theory=theory, interval=interval)


LYAPUNOV_EXPONENT = _index(
    quantity.LYAPUNOV_EXPONENT,
    solve=lambda solver, _: solver.lyapunov_exponent(),
    theory=lambda problem: _theory(problem, "lyapunov_exponent"),
)
STABILITY_INDEX = _index(
    quantity.STABILITY_INDEX,
    solve=lambda solver, root: nonzero_root(solver, guess=root),
    theory=lambda problem: _theory(problem, "stability_index"),
    interval=SEARCH_INTERVAL,
)
VARIANCE_RATE = _index(
    quantity.VARIANCE_RATE,
    solve=lambda solver, _: solver.variance_rate(),
    theory=lambda problem: _theory(problem, "variance_rate"),
)
IMPACT_RATE = _index(
    quantity.IMPACT_RATE,
    solve=lambda solver, _: impact_rate(solver),
    theory=lambda problem: _theory(problem, "impact_rate"),
)
CRITICAL_IMPACT_FACTOR = _index(
    quantity.CRITICAL_IMPACT_FACTOR,
    solve=lambda solver, _: critical_impact_factor(solver),
    theory=lambda problem: _theory(problem, "critical_impact_factor"),
)
CRITICAL_RESTITUTION = _index(
    quantity.CRITICAL_RESTITUTION,
    solve=lambda solver, _: critical_restitution(solver),
    theory=lambda problem: _restitution(problem, _theory(problem, "critical_log_factor")),
    interval=(0.0, 1.0),
)
_ALL = (
    *(LYAPUNOV_EXPONENT, STABILITY_INDEX, VARIANCE_RATE),
    *(IMPACT_RATE, CRITICAL_IMPACT_FACTOR, CRITICAL_RESTITUTION),
)
INDICES: Mapping[str, Index] = {each.name: each for each in _ALL}
QUANTITIES: Mapping[str, Quantity] = {MOMENT.name: MOMENT, **INDICES}


def _restitution(problem: Problem, log_factor: float) -> float:
    """The r with a given ln R, by the impact law of the oscillator; NaN for other motions."""
    return problem.system.impact_value(log_factor) if problem.system.impact_parameter else math.nan


@of_problem
def lyapunov_exponent(
    problem: Problem, *, rtol: float = 1e-8, mesh: CylinderMesh | None = None, budget: Budget | None = None
) -> Estimate:
    """The largest Lyapunov exponent λ = Λ′(0), Eq. (2): how fast almost every path grows.

    For noise with algebraic tails a positive λ is not Λ′(0), see `theory.far_places`; `meaning` says so.

    Args:
        problem: a motion and its noise, in one argument or two.
        rtol, mesh, budget: as for `moment_lyapunov`.

    Raises:
        ValueError: rtol is not positive.
        NotConverged: it is not resolved on the mesh, or within the budget.
    """
    return ExponentSolver(problem, mesh, rtol=rtol, budget=budget or Budget()).lyapunov_exponent()


@of_problem
def stability_index(
    problem: Problem, *, rtol: float = 1e-8, mesh: CylinderMesh | None = None, budget: Budget | None = None
) -> Estimate | Absent:
    """The stability index δ_p, the non-zero root of Λ(p), or why there is none from -20 to 20.

    For noise with algebraic tails there is none: Λ(p) > 0 for every p ≠ 0, see `theory.far_places`.

    Args:
        problem: a motion and its noise, in one argument or two.
        rtol, mesh, budget: as for `moment_lyapunov`.

    Raises:
        ValueError: rtol is not positive.
        NotConverged: some p on the way to it is not resolved on the mesh, or within the budget.
    """
    return nonzero_root(ExponentSolver(problem, mesh, rtol=rtol, budget=budget or Budget()))
