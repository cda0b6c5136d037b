"""How Λ(p), λ, δ_p and Λ″(0) change with every parameter θ, from T and T*, without finite differences.

With (L − ΛM)T = 0 in weak form, M the mass matrix, which changes with the weight P_s of a noise,

    ∂Λ/∂θ = ⟨T*, (∂L − Λ ∂M)T⟩/⟨T*, T⟩,

the functions of φ and ξ held: it is the derivative of the discrete Λ, whose error is quadratic in those of T and T*.
Its derivatives by p are the mixed ones: with B = ∂L − Λ ∂M − ∂Λ/∂θ M and B′ = ∂L′ − Λ′∂M − ∂Λ′/∂θ M

    ∂Λ′/∂θ ~ ⟨T*, (∂L′ − Λ′∂M)T⟩ + ⟨T*, B T′⟩ + ⟨T*′, B T⟩,
    ∂Λ″/∂θ ~ ⟨T*, (∂L″ − Λ″∂M)T⟩ + 2⟨T*, B′T′⟩ + 2⟨T*′, B′T⟩ + 2⟨T*′, B T′⟩ + ⟨T*, B T″⟩ + ⟨T*″, B T⟩,

in which B T = 0 at p = 0, where T = 1 whatever θ. And ∂δ_p/∂θ = −∂Λ/∂θ / Λ′ at δ_p.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray
from fpsolve.data import Result, dataset
from fpsolve.drawing import draw_bars
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent.changed import Changed, scaled
from fpsolve.exponent.eigen import PairDerivatives
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.method import NEAR_ZERO, Budget, checked_moments
from fpsolve.exponent.root import nonzero_root
from fpsolve.exponent.solver import ExponentSolver, solver_of
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.problem import ParameterDerivative, Problem
from fpsolve.model.quantity import (
    LYAPUNOV_EXPONENT,
    MOMENT,
    STABILITY_INDEX,
    THETA,
    VARIANCE_RATE,
    P,
    Quantity,
    moment_at,
)

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

RECORDS = {each.name: each for each in (LYAPUNOV_EXPONENT, STABILITY_INDEX, VARIANCE_RATE)}
"""The quantities besides Λ(p) that have sensitivities, by their names: those that are no function of p."""
MOST_BARS = 4
"""Largest number of p whose sensitivities are drawn."""
NOTHING = Estimate(0.0, 0.0, 0.0)
"""∂/∂θ where nothing changes."""
Slopes = Mapping[str, Estimate]
"""∂/∂θ by the key of θ."""


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivities(Result):
    """∂/∂θ for every parameter θ of a problem; all are `Estimate`s by the key of θ, such as "oscillator.omega".

    Attributes:
        theta: the values of the parameters.
        quantities: what the parameters are.
        p: the moments, shape (n,).
        moments: ∂Λ(p)/∂θ, one mapping for each p; empty where Λ(p) did not converge.
        summary_numbers: ∂/∂θ of "lyapunov_exponent", "stability_index" and "variance_rate", of those that exist.
        notes: what is one-sided, and what is missing, and why.
    """

    theta: Mapping[str, float]
    quantities: Mapping[str, Quantity]
    p: FloatArray
    moments: tuple[Slopes, ...]
    summary_numbers: Mapping[str, Slopes]
    notes: tuple[Message, ...] = ()

    def to_xarray(self) -> xarray.Dataset:
        """The derivatives over p and θ, and their errors; NaN where there is none."""
        numbers = {}
        single = [(RECORDS[name], (self.summary_numbers[name],)) for name in RECORDS if name in self.summary_numbers]
        for record, rows in [(MOMENT, self.moments), *single]:
            slope = record.by(THETA)
            for quantity, of in ((slope, "value"), (slope.error(), "error_estimate")):
                table = [[getattr(row[key], of) if key in row else np.nan for key in self.theta] for row in rows]
                shape = (len(rows), len(self.theta))
                numbers[quantity] = np.reshape(table, shape if record is MOMENT else shape[1:])
        key = replace(THETA, name="parameter", words="key of a parameter", latex="", unit="1")
        unit = replace(THETA, name="theta_unit", words="unit of theta", latex="", unit="1")
        coordinates = {
            P: self.p,
            key: np.array([each.name for each in self.quantities.values()], dtype=str),
            THETA: np.array([*self.theta.values()], dtype=float),
            unit: np.array([each.unit for each in self.quantities.values()], dtype=str),
        }
        return dataset("sensitivities", "finite elements", numbers, coordinates, self.theta, notes=self.notes)

    def shown(self) -> Mapping[str, tuple[float, Slopes]]:
        """By their symbols λ, as p = 0, and Λ of some p, each with its derivatives: the numbers of pictures."""
        rows = [(float(p), slopes) for p, slopes in zip(self.p, self.moments, strict=True) if p and slopes]
        chosen = np.unique(np.linspace(0, len(rows) - 1, min(len(rows), MOST_BARS)).round().astype(int))
        exponent = self.summary_numbers.get(LYAPUNOV_EXPONENT.name)
        first = {LYAPUNOV_EXPONENT.latex: (0.0, exponent)} if exponent else {}
        return first | {moment_at(rows[i][0]).latex: rows[i] for i in chosen}

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: object) -> None:
        bars = {
            label: np.array([self.theta[key] * each.value for key, each in slopes.items()])
            for label, (_, slopes) in self.shown().items()
        }
        draw_bars(axes, bars, [each.shown for each in self.quantities.values()], **kwargs)
        axes.set_xlabel(r"effect of a relative change, $\theta\,\partial/\partial\theta$ (1/time)")
        if bars:
            axes.legend()

    def _said(self) -> str:
        what = [*self.summary_numbers, *[f"Λ({p:g})" for p in self.p[:1]], *["..."] * (self.p.size > 1)]
        return f"of {', '.join(what) or 'nothing'} by {len(self.theta)} parameters"


def sensitivities(
    problem: Problem,
    p: ArrayLike = (),
    *,
    rtol: float | None = None,
    mesh: CylinderMesh | None = None,
    budget: Budget | None = None,
    progress: Callable[[], None] = lambda: None,
) -> Sensitivities:
    """∂Λ(p)/∂θ, ∂λ/∂θ, ∂δ_p/∂θ and ∂Λ″(0)/∂θ for every parameter θ of the oscillator and of the noise.

    For noise of Eq. (7) with r₀ = 1 ∂/∂r₀ is the derivative from below, as Λ is infinite, or another, above.

    >>> sensitivities(problem, 2.0)
    Sensitivities(of lyapunov_exponent, stability_index, variance_rate, Λ(2) by 6 parameters)

    Args:
        problem: a motion and its noise.
        p: one moment, or an array of shape (n,); none by default.
        rtol, mesh, budget: as for `moment_lyapunov`.
        progress: called once for each p, and for each of λ, δ_p and Λ″(0).

    Raises:
        ValueError: a p is not finite.
        NoSuchExponent: Λ(p) is infinite for one of the p.
    """
    solver = solver_of(problem, mesh, rtol, budget)
    points = checked_moments(p, solver.method, may_be_empty=True)
    summary_numbers = tuple(RECORDS) if solver.method.has_pairs else ()
    return solve_sensitivities(
        solver, points, problem.derivatives(), summary_numbers=summary_numbers, progress=progress
    )


def solve_sensitivities(
    solver: ExponentSolver,
    p: FloatArray,
    along: Mapping[str, ParameterDerivative],
    *,
    summary_numbers: Iterable[str],
    progress: Callable[[], None] = lambda: None,
) -> Sensitivities:
    """The sensitivities of a solver's problem along some directions.

    Args:
        solver: of the problem.
        p: the moments, shape (n,), for which Λ is finite.
        along: the directions, by name.
        summary_numbers: those wanted.
        progress: called once for each p and each summary number, also where it fails.
    """
    problem, parameters = solver.problem, solver.problem.parameters
    notes = [Message(Code.NO_DERIVATIVE, key=key, value=value) for key, value in problem.undifferentiable.items()]
    closing = {key: by.theta for key, by in along.items() if solver.method.closes(key)}
    notes += [Message(Code.CLOSES_BLOCKS, key=key, value=theta) for key, theta in closing.items()]
    along = {key: by for key, by in along.items() if key not in closing}
    found = Gradient(solver, along)

    def tried(record: Quantity, solve: Callable[[], Slopes], p: float | None = None) -> Slopes:
        try:
            slopes = solve()
        except (NotConverged, NoSuchExponent) as failure:
            reason = failure.message
        except MemoryError:
            reason = Message(Code.NO_MEMORY, remedy=Remedy.MEMORY)
        else:
            return {key: replace(each, quantity=record.by(parameters[key].quantity)) for key, each in slopes.items()}
        finally:
            progress()
        symbol = record.symbol if p is None else "Λ(p)"
        notes.append(Message(Code.NO_SENSITIVITIES, p=p, symbol=symbol, reason=reason))
        return {}

    moments = tuple(tried(moment_at(each), partial(found.moment, each), each) for each in p.tolist())
    solves: Any = dict(zip(RECORDS, (partial(found.ratio, 0.0), found.root, found.variance_rate), strict=True))
    slopes = {name: tried(RECORDS[name], solves[name]) for name in summary_numbers}
    values = problem.values
    noises = zip([*problem.sections][1:], problem.noise.parts.values(), strict=True)
    keys = [f"{section}.{name}" for section, noise in noises for name in noise.one_sided]
    one_sided = [Message(Code.ONE_SIDED, key=key, value=values[key]) for key in keys if key in along]
    return Sensitivities(
        theta={key: by.theta for key, by in along.items()},
        quantities={key: parameters[key].quantity for key in along},
        p=p,
        moments=moments,
        summary_numbers={name: each for name, each in slopes.items() if each},
        notes=(*notes, *one_sided),
    )


class Gradient:
    """The derivatives along some directions on a finer discretisation, with errors from the differences to it.

    For algebraic tails that is also a wider one: at their ends ∂ ln P_s/∂r₀ is large.

    Args:
        solver: of the problem.
        along: the directions, by name.
    """

    def __init__(self, solver: ExponentSolver, along: Mapping[str, ParameterDerivative]) -> None:
        self._solver, self._method, self._along = solver, solver.method, along

    def moment(self, p: float) -> Slopes:
        """∂Λ(p)/∂θ. Raises `NotConverged`, `NoSuchExponent`."""
        if p == 0:
            return dict.fromkeys(self._along, NOTHING)
        return {key: scaled(p, each) for key, each in self.ratio(p).items()}

    def ratio(self, p: float) -> Slopes:
        """∂/∂θ of Λ(p)/p, at p = 0 of λ. Raises `NotConverged`, `NoSuchExponent`."""
        method, along = self._method.held(p, self._along)
        if known := method.preferred_even(p):
            found = dict.fromkeys(self._along, NOTHING)
            for key, by in along.items():
                value, error = known.slope(key)
                size = known.scale / abs(by.theta) if by.theta else abs(value)
                found[key] = scaled(1 / p, Estimate(value, error, size))
            return found
        share = method.ratio_alone(p)[1] / (method.scales.linear + method.scales.quadratic * abs(p))
        return self._compared(p, share, lambda _, changed: changed.ratio(p))

    def variance_rate(self) -> Slopes:
        """∂Λ″(0)/∂θ. Raises `NotConverged`, `NoSuchExponent`."""
        share = self._method.variance_rate().relative_error
        return self._compared(0.0, share, lambda _, changed: changed.curvature)

    def root(self) -> Slopes:
        """∂δ_p/∂θ: that of Λ(p)/p over that by p at δ_p, with twice the relative error of δ_p; none without δ_p.

        Raises `NotConverged`, `NoSuchExponent`.
        """
        if not (index := nonzero_root(self._solver)):
            return {}
        p = index.value

        def of(at: PairDerivatives, changed: Changed) -> Estimate:
            rise = at.pair.derivative / p if at.pair.p else 0.5 * at.second_derivative
            return scaled(-1 / rise, changed.ratio(p))

        return self._compared(p, 2 * index.error_estimate / max(abs(p), NEAR_ZERO), of)

    def _compared(self, p: float, share: float, of: Callable[[PairDerivatives, Changed], Estimate]) -> Slopes:
        """Numbers of the finer one, their errors from how far both are apart.

        That of one parameter may be small by chance, or fall slowly: twice as much counts, and of the scale of each the
        share that the error of what is derived has of its own scale, as both are of one pair.
        """
        method, along = self._method.held(p if abs(p) >= NEAR_ZERO else 0.0, self._along)
        around, found = method.around(p), dict.fromkeys(self._along, NOTHING)
        finer = PairDerivatives(method.finer_pair(around.pair)) if around.pair.p else method.finer_around_zero
        for key, by in along.items():
            coarse, fine = (of(each, Changed(each, by)) for each in (around, finer))
            apart = 2 * abs(fine.value - coarse.value) + share * fine.scale
            found[key] = replace(fine, error_estimate=fine.error_estimate + apart)
        return found
