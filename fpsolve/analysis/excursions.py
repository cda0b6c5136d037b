"""Excursions: the probability that ‖x‖ ever exceeds A times its start, from T at p = δ_p.

At p = δ_p, where Λ(p) = 0, ‖x‖^p T(φ, ξ) is a martingale. Let ‖x₀‖ = 1, T₀ be the mean of T over the start, and stop it
when ‖x‖ first reaches A > 1. Where T lies between positive bounds, as for noise on a bounded set and white noise,

    (T₀/max T) A^−δ ≤ P(sup ‖x‖ ≥ A) ≤ (T₀/min T) A^−δ,    δ = δ_p.

The upper bound needs nothing else. The lower one needs λ < 0, so that paths that never reach A add nothing in the end,
and A is passed by at most a factor g: it has (gA)^−δ, where g > 1 for jumps upwards only. Where g = 1 and ln ‖x‖ has no
diffusion of its own, ‖x‖ is differentiable when it reaches A, so that max and min are over q(φ, ξ) = d ln ‖x‖/dt ≥ 0.

For other noise T has no such bounds. The number of upcrossings of A has the mean

    E ∫ δ(ln ‖x‖ − ln A) q⁺ dt  ~  C A^−δ,    C = T₀ ⟨T*, q⁺⟩/(Λ′(δ) ⟨T*, T⟩),

as under the measure changed by the martingale (φ, ξ) has the density T T*/⟨T*, T⟩, and ln ‖x‖ grows by Λ′(δ) in a unit
of time: by the renewal theorem it is as often near ln A as near any other value. For A → ∞ it bounds P(sup ‖x‖ ≥ A).

‖x‖ is the length of the vector of the variables of the system. With x = Sy and ρ = |y|/|x| its T(φ, ξ) is ρ^p T_y(ψ, ξ)
of what is solved for y, see `model.coordinates`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.arrays import FloatArray, dense, real_array, real_number, real_numbers, shown
from fpsolve.budget import unless_over_budget
from fpsolve.data import Result, dataset
from fpsolve.drawing import add_legend, in_full, label_axes
from fpsolve.errors import NotConverged
from fpsolve.exponent.density import mean_functions, own_phases, phase_functions
from fpsolve.exponent.eigen import PrincipalPair
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.method import Budget, refuse
from fpsolve.exponent.root import nonzero_root
from fpsolve.exponent.solver import ExponentSolver, solver_of
from fpsolve.fem.axis import along
from fpsolve.fem.element import middles
from fpsolve.fem.noise_axes import LineAxis, StateAxis
from fpsolve.messages import Code, Message, Remedy
from fpsolve.model.plane import Harmonics
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import LEAST_PROBABLE, LEVEL, MOST_PROBABLE, UPCROSSINGS

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

SYMBOL = "P(sup ‖x‖ ≥ A)"
STATIONARY: Literal["stationary"] = "stationary"
UNIFORM: Literal["uniform"] = "uniform"
Start = float | Literal["uniform"]
StartOfNoise = float | Literal["stationary"]
FINE = 8
"""Number of points, for each polynomial degree either way, at which T is looked at."""
MOST_POINTS = 4_000_000
"""Largest number of these points, and of those of an integral."""
CLOSE = 1e-4
"""Relative error of T at its extremes, and of C, down to which finer discretisations are made."""
MOST_ROUNDS = 4
"""Largest number of finer discretisations."""
PARTS = 32
"""Number of parts into which a cell of φ is cut for the integral of q⁺, which has kinks."""
POINTS = 2000
"""Number of points of ξ in this integral."""
SHOWN_LEVELS = (2.0, 4.0, 8.0, 16.0, 32.0)


@dataclass(frozen=True, eq=False, repr=False)
class Excursion(Result):
    """P(sup ‖x‖ ≥ A) over all times, ‖x₀‖ = 1.

    Attributes:
        lyapunov_exponent: λ; if it is positive, P = 1 for every A.
        stability_index: δ_p > 0; None where P = 1, or where there is none.
        lower, upper: what A^−δ_p is multiplied by in both bounds; None where there is no such bound.
        upcrossings: C of the mean number of upcrossings C A^−δ_p for A → ∞; None where ‖x‖ jumps upwards or diffuses.
        is_certain: whether P = 1, as λ > 0.
        phi, xi: the start: φ₀ in radians, or "uniform"; ξ₀, or "stationary".
        notes: what there is not, and why.
        parameters: of the problem, by keys such as "noise.D0".
    """

    lyapunov_exponent: Estimate
    stability_index: Estimate | None = None
    lower: Estimate | None = None
    upper: Estimate | None = None
    upcrossings: Estimate | None = None
    is_certain: bool = False
    phi: float | str = 0.0
    xi: float | str = STATIONARY
    notes: tuple[Message, ...] = ()
    parameters: Mapping[str, float | str] = field(default_factory=dict)

    def bounds(self, level: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """The bounds of P(sup ‖x‖ ≥ A), each of the shape of A, widened by all errors; 0 and 1 where nothing is known.

        Raises:
            ValueError: a level is not above 1.
        """
        levels = _checked_levels(level)
        low, high = np.zeros(levels.shape), np.ones(levels.shape)
        index = self.stability_index
        if self.is_certain:
            return high, high
        if index is not None:
            if self.lower is not None:
                factor = max(self.lower.value - self.lower.error_estimate, 0.0)
                low = factor * levels ** -(index.value + index.error_estimate)
            if self.upper is not None:
                factor = self.upper.value + self.upper.error_estimate
                high = np.minimum(factor * levels ** -(index.value - index.error_estimate), 1.0)
        return low, high

    def expected_upcrossings(self, level: ArrayLike) -> FloatArray:
        """C A^−δ_p, the mean number of upcrossings for A → ∞, of the shape of A; NaN where it is not known.

        Raises:
            ValueError: a level is not above 1.
        """
        levels, index = _checked_levels(level), self.stability_index
        if self.upcrossings is None or index is None:
            return np.full(levels.shape, math.nan)
        return np.asarray(self.upcrossings.value * levels**-index.value)

    def to_xarray(self, level: ArrayLike = SHOWN_LEVELS) -> xarray.Dataset:
        """The bounds, and the asymptotic number of upcrossings, over some A."""
        levels = real_numbers(level, "level")
        low, high = self.bounds(levels)
        numbers = {LEAST_PROBABLE: low, MOST_PROBABLE: high}
        if self.upcrossings is not None:
            numbers[UPCROSSINGS] = self.expected_upcrossings(levels)
        about, notes = ("probability of excursions", "finite elements"), self.notes
        return dataset(*about, numbers, {LEVEL: levels}, self.parameters, notes=notes, phi=self.phi, xi=self.xi)

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: object) -> None:
        """Both bounds over A, and what lies between them."""
        levels = np.geomspace(1.01, 100.0, 101)
        low, high = self.bounds(levels)
        [line] = axes.plot(levels, low, **{"label": "bounds", **in_full(kwargs)})
        colour = line.get_color()
        axes.plot(levels, high, **{**in_full(kwargs), "color": colour, "label": None})
        axes.fill_between(levels, low, high, color=colour, alpha=0.2, linewidth=0)
        if self.upcrossings is not None:
            count = self.expected_upcrossings(levels)
            axes.plot(levels, count, linestyle="--", color=colour, label="upcrossings for large A")
        axes.set(xscale="log", yscale="log", xlim=(1.0, 100.0))
        label_axes(axes, found[LEVEL.name].attrs, found[LEAST_PROBABLE.name].attrs | {"long_name": "probability"})
        add_legend(axes)

    def _said(self) -> str:
        if self.is_certain:
            return "P(sup ‖x‖ ≥ A) = 1"
        if self.stability_index is None:
            return "not known"
        if self.lower is None:
            return f"P(sup ‖x‖ ≥ A) ~ A^-{self.stability_index.value:.6g}"
        ends = self.lower.value, math.inf if self.upper is None else self.upper.value
        return "P(sup ‖x‖ ≥ A) A^{:.6g} from {:.4g} to {:.4g}".format(self.stability_index.value, *ends)


def excursion(
    problem: Problem,
    *,
    phi: Start = 0.0,
    xi: StartOfNoise = STATIONARY,
    rtol: float | None = None,
    budget: Budget | None = None,
) -> Excursion:
    """Bounds of the probability that ‖x‖ ever exceeds A ‖x₀‖, for every A > 1; for unbounded noise its exponent δ_p.

    ‖x‖ is √(x₁² + x₂²) in the variables of the system, `problem.linear.states`.

    Args:
        problem: a motion and its noise.
        phi: φ₀ of the start x₀ = (cos φ₀, −sin φ₀), just after a jump if there is one on this ray; or "uniform".
        xi: ξ₀; or "stationary".
        rtol, budget: as for `moment_lyapunov`.

    Raises:
        ValueError: there is no such start.
        NotConverged: λ, δ_p or T is not resolved within the budget.
    """
    solver = solver_of(problem, rtol=rtol, budget=budget)
    return solve_excursion(solver, phi=phi, xi=xi)


def solve_excursion(solver: ExponentSolver, *, phi: Start, xi: StartOfNoise) -> Excursion:
    """The excursions of a solver's problem."""
    problem = solver.problem
    if solver.mesh:  # which need not reach the ends of the noise
        solver = replace(solver, mesh=None)
    check_start(problem, phi, xi)
    exponent = solver.lyapunov_exponent()
    found = Excursion(exponent, phi=phi, xi=xi, parameters=dict(problem.values))
    if abs(exponent.value) <= exponent.error_estimate:
        return replace(
            found, notes=(Message(Code.EXCURSION_OPEN, value=exponent.value, error=exponent.error_estimate),)
        )
    if exponent.value > 0:
        return replace(found, is_certain=True)
    refuse(solver.method.reason(1.0, SYMBOL))
    index = nonzero_root(solver)
    if not index:
        return replace(found, notes=(_without_index(index.reason),))
    found = replace(found, stability_index=index)
    if unseen := solver.method.unseen():
        return replace(found, notes=(unseen,))
    moved = problem.noise.motion(problem.linear)
    overshoot, is_smooth = moved.overshoot, moved.rises_smoothly
    p, pairs, notes = index.value, [solver.pair(index.value)], list[Message]()
    if problem.noise.is_bounded:
        least, most = _settled(solver, pairs, lambda pair: _extremes(pair, is_smooth) / _at_start(pair, phi, xi))
        found = replace(found, lower=_inverse(most, overshoot**-p), upper=_inverse(least))
        if found.upper is None:
            notes.append(Message(Code.EXCURSION_NO_UPPER, value=least.value, error=least.error_estimate))
    else:
        notes.append(Message(Code.EXCURSION_UNBOUNDED))
    if is_smooth:
        [many] = _settled(solver, pairs, lambda pair: _flux(pair) * _at_start(pair, phi, xi) / pair.derivative)
        if not many.error_estimate <= many.value:
            raise NotConverged(Message(Code.EXCURSION_UNRESOLVED), remedy=Remedy.BUDGET)
        found = replace(found, upcrossings=replace(many, quantity=UPCROSSINGS))
    return replace(found, notes=tuple(notes))


def check_start(problem: Problem, phi: object, xi: object) -> None:
    """Refuse a start that a problem does not have. Raises `ValueError`."""
    if not (isinstance(phi, str) and phi == UNIFORM):
        real_number(phi, "phi")
    if isinstance(xi, str) and xi == STATIONARY:
        return
    value = real_number(xi, "xi")
    if why := problem.valued.misfit(value):
        raise ValueError(f"got xi = {value:g}{why}")


def _without_index(reason: Message) -> Message:
    """What it means that Λ(p) has no other root than 0, λ < 0."""
    if reason.code in (Code.NO_ROOT, Code.NO_ROOT_REACHED):
        return Message(Code.EXCURSION_BEYOND, high=reason.data["high"])
    return Message(Code.EXCURSION_NO_INDEX, reason=reason)


def _settled(
    solver: ExponentSolver, pairs: list[PrincipalPair], numbers: Callable[[PrincipalPair], FloatArray]
) -> list[Estimate]:
    """Some numbers by a pair, each with what its points miss, and its difference from a coarser pair.

    Args:
        solver: of the pairs.
        pairs: on ever finer discretisations; those that are made join them.
        numbers: by a pair, each with what its points miss.

    Raises:
        NotConverged: there is no finer discretisation within the budget.
    """
    last, found = numbers(pairs[0])[:, 0], None
    with unless_over_budget():
        for k in range(1, 1 + MOST_ROUNDS):
            if k == len(pairs):
                pairs.append(solver.method.finer_pair(pairs[-1]))
            value, missed = numbers(pairs[k]).T
            error, last = missed + abs(value - last), value
            found = list(map(Estimate, value.tolist(), error.tolist(), abs(value).tolist()))
            if np.all(error <= CLOSE * abs(value)):
                break
    if found is None:
        raise NotConverged(Message(Code.EXCURSION_UNRESOLVED), remedy=Remedy.BUDGET)
    return found


def _inverse(of: Estimate, factor: float = 1.0) -> Estimate | None:
    """A factor over a positive number; None where this may be 0."""
    value, error = of.value, of.error_estimate
    if not value > error:
        return None
    return Estimate(factor / value, factor * error / (value * (value - error)), factor / value)


def _growth(pair: PrincipalPair, psi: FloatArray, xi: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """q over φ and values of the noises, and ρ^p as a factor of such tables."""
    problem, columns = pair.generator.problem, (-1, *[1] * len(xi))
    phi, stretch = own_phases(pair, psi)
    rate: Harmonics = problem.noise.motion(problem.linear).growth_rate(problem.valued.combined(xi))
    return rate(phi.reshape(columns)), stretch.reshape(columns)


def _at_start(pair: PrincipalPair, phi: Start, xi: StartOfNoise) -> float:
    """T₀, the mean of T over the start, in the coordinates of the system."""
    space = pair.space
    if phi == UNIFORM:
        at_phi = mean_functions(pair)
    else:
        own = np.array([float(phi)])
        functions, length, _ = phase_functions(pair, own, own + 1e-9)
        at_phi = length[0] ** pair.p * dense(functions)[0]
    means = space.product([at_phi, *(_mean_functions(axis, xi) for axis in space.noises)])
    return float(means @ pair.right)


def _mean_functions(axis: LineAxis | StateAxis, xi: StartOfNoise) -> FloatArray:
    """The means of the functions of a noise over its start, shape (size,)."""
    if xi == STATIONARY:
        at = axis.samples()
        return (axis.law() * at.factor) @ at.values
    return axis.started(xi)


def _extremes(pair: PrincipalPair, is_smooth: bool) -> FloatArray:
    """The least and the largest T where ‖x‖ passes a level, each with what it may be beyond between the points.

    These are in all cells of φ, seen from inside, and all over the noise, the ends included.
    """
    space, lines = pair.space, pair.space.phi.lines
    counts = [FINE * (int(np.max(axis.modes)) + 1) for axis in space.axes]
    share = min(1.0, (MOST_POINTS / (math.prod(counts) * (lines.size - 1))) ** (1 / len(counts)))
    phases, *noises = (max(16, math.ceil(share * count)) for count in counts)
    psi = np.linspace(lines[:-1], lines[1:], phases + 1, axis=1)
    inside = np.repeat(middles(lines), phases + 1)
    xi, functions = zip(
        *(axis.everywhere(count) for axis, count in zip(space.noises, noises, strict=True)), strict=True
    )
    table = along([space.phi.at(psi.ravel(), inside), *functions], space.table(pair.right))
    growth, stretch = _growth(pair, psi.ravel(), xi)
    values = (table * stretch).reshape(shape := (*psi.shape, *table.shape[1:]))
    rate = np.broadcast_to(growth, table.shape).reshape(shape)
    if not is_smooth or rate.max() < 0:
        rate = np.ones(shape)
    axes = [1, *(2 + k for k, axis in enumerate(space.noises) if axis.dimension)]  # along which T is continuous
    bent, wider = _between(values, axes), rate + _between(rate, axes)
    found = []
    for sign in (1, -1):
        least = _where_positive(sign * values, rate, axes).min()
        lowest = _where_positive(sign * values - bent, wider, axes).min()
        found.append([sign * least, max(least - lowest, 0.0)])
    return np.array(found)


def _between(values: FloatArray, axes: Sequence[int]) -> FloatArray:
    """How far a function may be beyond its values at three neighbours: an eighth of their second difference."""
    total = np.zeros_like(values)
    for axis in axes:
        ends = [(int(k == axis),) * 2 for k in range(values.ndim)]
        total += np.pad(np.abs(np.diff(values, n=2, axis=axis)) / 8, ends, mode="edge")
    return total


def _where_positive(values: FloatArray, rate: FloatArray, axes: Sequence[int]) -> FloatArray:
    """The values where a rate is not negative, also where it is 0 between two points, shape (n,)."""
    found = [values[rate >= 0]]
    for axis in axes:
        both = np.moveaxis(np.stack([rate, values]), axis + 1, 1)
        (here, own), (there, other) = both[:, :-1], both[:, 1:]
        crosses = (here >= 0) != (there >= 0)
        share = here[crosses] / (here[crosses] - there[crosses])
        found.append(own[crosses] + share * (other[crosses] - own[crosses]))
    return np.concatenate(found)


def _flux(pair: PrincipalPair) -> FloatArray:
    """⟨T*, q⁺⟩, with ⟨T*, T⟩ = 1 on the full circle, and what the points miss of it, shape (1, 2)."""
    fine, coarse = (_flux_by(pair, parts) for parts in (PARTS, PARTS // 2))
    return np.array([[fine, abs(fine - coarse)]])


def _flux_by(pair: PrincipalPair, parts: int) -> float:
    """The same from so many parts of each cell of φ."""
    space = pair.space
    psi, weights = space.phi.finer_rule(parts)
    most = (MOST_POINTS / psi.size) ** (1 / len(space.noises))
    each = [axis.finer_samples(round(min(most, POINTS * parts / PARTS))) for axis in space.noises]
    left = along([space.phi.at(psi), *(at.values for at in each)], space.table(pair.left))
    rate, stretch = _growth(pair, psi, [at.xi for at in each])
    measure = reduce(np.multiply.outer, [at.weight * at.measure / at.factor for at in each])
    of_phi = np.sum((np.maximum(rate, 0) * left / stretch * measure).reshape(psi.size, -1), axis=1)
    return space.turns * float(weights @ of_phi)


def _checked_levels(level: ArrayLike) -> FloatArray:
    """Levels A. Raises `ValueError`."""
    levels = real_array(level, "level")
    if not np.all(levels > 1):
        raise ValueError(f"got level = {shown(level)}; must be above 1, as ‖x₀‖ = 1 is reached at the start")
    return levels
