"""The quantities: what each is called, how it is written and drawn, what solves it, and its perturbation theory."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from fpsolve.exponent.adapt import Budget
from fpsolve.exponent.error import Absent, Estimate
from fpsolve.exponent.function import SEARCH_INTERVAL, nonzero_root
from fpsolve.exponent.impacts import critical_impact_factor, critical_restitution, impact_rate
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.model.problem import Problem, of_problem
from fpsolve.model.vibro_impact import VibroImpactOscillator
from fpsolve.theory.perturbation import second_order

DrawnName = Literal["moment", "lyapunov_exponent", "stability_index"]
"""What a figure can show."""
QuantityName = Literal[DrawnName, "variance_rate", "impact_rate", "critical_impact_factor", "critical_restitution"]


@dataclass(frozen=True)
class Quantity:
    """Something that is computed of a problem.

    Attributes:
        name: in case files and results.
        symbol: in sentences and tables.
        title: of an axis, in LaTeX, with the unit.
        equation: the number of its perturbation theory.
    """

    name: QuantityName
    symbol: str
    title: str
    equation: str


@dataclass(frozen=True)
class Index(Quantity):
    """A quantity that is one number, and not one for each p.

    Attributes:
        solve: finds it, from a solver and the `root` of its `MomentLyapunov`, or says why there is none in `interval`.
            Raises `NotConverged`.
        theory: what perturbation theory makes of it; it may be infinite.
        interval: where it is sought.
    """

    solve: Callable[[ExponentSolver, float | None], Estimate | Absent]
    theory: Callable[[Problem], float]
    interval: tuple[float, float] = (-math.inf, math.inf)


MOMENT = Quantity("moment", "Λ(p)", r"moment Lyapunov exponent $\Lambda(p)$ (1/time)", "(37)")
LYAPUNOV_EXPONENT = Index(
    "lyapunov_exponent",
    "λ",
    r"largest Lyapunov exponent $\lambda$ (1/time)",
    "(39)",
    solve=lambda solver, _: solver.lyapunov_exponent(),
    theory=lambda problem: second_order(problem).lyapunov_exponent,
)
STABILITY_INDEX = Index(
    "stability_index",
    "δ_p",
    r"stability index $\delta_p$",
    "(38)",
    solve=lambda solver, root: nonzero_root(solver, guess=root),
    theory=lambda problem: second_order(problem).stability_index,
    interval=SEARCH_INTERVAL,
)
VARIANCE_RATE = Index(
    "variance_rate",
    "Λ″(0)",
    r"growth rate of the variance $\Lambda''(0)$ (1/time)",
    "(37)",
    solve=lambda solver, _: solver.variance_rate(),
    theory=lambda problem: second_order(problem).variance_rate,
)
IMPACT_RATE = Index(
    "impact_rate",
    "N",
    r"impact rate $N = \partial\lambda/\partial\ln R$ (1/time)",
    "(39)",
    solve=lambda solver, _: impact_rate(solver),
    theory=lambda problem: second_order(problem).impact_rate,
)
CRITICAL_IMPACT_FACTOR = Index(
    "critical_impact_factor",
    "R_c",
    "critical impact factor $R_c$",
    "(39)",
    solve=lambda solver, _: critical_impact_factor(solver),
    theory=lambda problem: second_order(problem).critical_impact_factor,
)
CRITICAL_RESTITUTION = Index(
    "critical_restitution",
    "r_c",
    "critical coefficient of restitution $r_c$",
    "(39)",
    solve=lambda solver, _: critical_restitution(solver),
    theory=lambda problem: _restitution(problem, second_order(problem).critical_log_factor),
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
    if not isinstance(problem.system, VibroImpactOscillator):
        return math.nan
    return problem.system.restitution_of(log_factor)


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
