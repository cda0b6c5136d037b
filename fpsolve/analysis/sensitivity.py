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

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpsolve.analysis.slopes import DIFFERENTIATED as DIFFERENTIATED
from fpsolve.analysis.slopes import RECORDS
from fpsolve.analysis.slopes import Sensitivities as Sensitivities
from fpsolve.analysis.slopes import Slopes as Slopes
from fpsolve.arrays import FloatArray
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent.adapt import Budget
from fpsolve.exponent.bordered import Bordered
from fpsolve.exponent.eigen import PrincipalPair, principal_pair
from fpsolve.exponent.error import Estimate
from fpsolve.exponent.function import nonzero_root
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.factors import one_thread
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message
from fpsolve.model.noise import Noise
from fpsolve.model.problem import ParameterDerivative, Problem, checked_moments, of_problem, with_original
from fpsolve.model.quantity import Quantity, moment_at

SMALL_P = 1e-4
"""For smaller |p| ∂Λ/∂θ / p is taken from its derivatives at p = 0."""
Operator = Callable[[FloatArray], FloatArray]


def changed_value(pair: PrincipalPair, by: ParameterDerivative) -> Estimate:
    """∂Λ/∂θ on one discretisation, with the error of rounding; the scale is that of the terms of L."""
    generator, x, y = pair.generator, pair.right, pair.left
    terms = list(generator.changed(by, pair.p).terms)
    mass = generator.changed_mass(by, pair.p)
    terms += [] if mass is None else [(-pair.value * phase, noise) for phase, noise in mass.terms]
    return _summed([KroneckerSum([term]) for term in terms], x, y, pair.space.turns)


def changed_slope(around: Bordered, by: ParameterDerivative) -> Estimate:
    """∂Λ′/∂θ on one discretisation."""
    pair = around.pair
    zeroth, first = _less(pair, by, 0, changed_value(pair, by).value), _less(pair, by, 1, 0.0)
    x, y = pair.right, pair.left
    parts = y @ first(x), y @ zeroth(around.by_p), around.adjoint_by_p @ zeroth(x)
    return _rounded(parts, around.norm)


def changed_curvature(around: Bordered, by: ParameterDerivative) -> Estimate:
    """∂Λ″/∂θ at p = 0 on one discretisation."""
    pair, x, y = around.pair, around.pair.right, around.pair.left
    zeroth = _less(pair, by, 0, changed_value(pair, by).value)
    first = _less(pair, by, 1, changed_slope(around, by).value)
    parts = (
        y @ _less(pair, by, 2, 0.0, around.second_derivative)(x),
        2 * (y @ first(around.by_p)),
        2 * (around.adjoint_by_p @ first(x)),
        2 * (around.adjoint_by_p @ zeroth(around.by_p)),
        y @ zeroth(around.second_by_p),
    )
    return _rounded(parts, around.norm)


def _less(pair: PrincipalPair, by: ParameterDerivative, k: int, change: float, own: float | None = None) -> Operator:
    """∂L⁽ᵏ⁾ − Λ⁽ᵏ⁾∂M − ∂Λ⁽ᵏ⁾/∂θ M."""
    value = own if own is not None else (pair.value, pair.derivative)[k]
    operator, mass = pair.generator.changed(by, pair.p, derivative=k), pair.generator.changed_mass(by, pair.p)

    def image(v: FloatArray) -> FloatArray:
        lost = 0.0 if mass is None else value * (mass @ v)
        return operator @ v - lost - change * pair.space.weighed(v)

    return image


@of_problem
def sensitivities(
    problem: Problem,
    p: ArrayLike = (),
    *,
    original: Noise | None = None,
    rtol: float = 1e-8,
    mesh: CylinderMesh | None = None,
    budget: Budget | None = None,
) -> Sensitivities:
    """∂Λ(p)/∂θ, ∂λ/∂θ, ∂δ_p/∂θ and ∂Λ″(0)/∂θ for every parameter θ of the oscillator and of the noise.

    For noise of Eq. (7) with r₀ = 1 ∂/∂r₀ is the derivative from below, as Λ is infinite, or another, above.

    Args:
        problem: a motion and its noise, in one argument or two.
        p: one moment, or an array of shape (n,); none by default.
        original: deprecated, as `ReducedNoise` has the parameters of the noise of Eq. (7).
        rtol, mesh, budget: as for `moment_lyapunov`.

    Raises:
        ValueError: a p is not finite, or the noise is not the reduction of `original`.
        NoSuchExponent: Λ(p) is infinite for one of the p.
    """
    problem = with_original(problem, original)
    solver = ExponentSolver(problem, mesh, rtol=rtol, budget=budget or Budget())
    points = checked_moments(p, problem, may_be_empty=True)
    return solve_sensitivities(solver, points, problem.derivatives())


def solve_sensitivities(
    solver: ExponentSolver,
    p: FloatArray,
    along: Mapping[str, ParameterDerivative],
    *,
    indices: Sequence[str] = DIFFERENTIATED,
    root: float | None = None,
) -> Sensitivities:
    """The same with a solver of the problem, along some directions.

    Args:
        solver: of the problem.
        p: the moments, shape (n,), for which Λ is finite.
        along: the directions, by name.
        indices: those wanted.
        root: near δ_p, if it is known.
    """
    found, notes, parameters = Gradient(solver, along), list[Message](), solver.problem.parameters

    def tried(record: Quantity, solve: Callable[[], Slopes], p: float | None = None) -> Slopes:
        try:
            slopes = solve()
        except (NotConverged, NoSuchExponent) as failure:
            symbol = record.symbol if p is None else "Λ(p)"
            notes.append(Message(Code.NO_SENSITIVITIES, p=p, symbol=symbol, reason=failure.message))
            return {}
        return {key: replace(each, quantity=record.by(parameters[key].quantity)) for key, each in slopes.items()}

    def of_root() -> Slopes:
        index = nonzero_root(solver, guess=root)
        return found.root(index.value) if isinstance(index, Estimate) else {}

    moments = tuple(tried(moment_at(each), partial(found.moment, each), each) for each in p.tolist())
    solves = dict(zip(RECORDS, (found.lyapunov_exponent, of_root, found.variance_rate), strict=True))
    slopes = {name: tried(RECORDS[name], solves[name]) for name in indices}
    return Sensitivities(
        theta={key: by.theta for key, by in along.items()},
        quantities={key: parameters[key].quantity for key in along},
        p=p,
        moments=moments,
        indices={name: each for name, each in slopes.items() if each},
        notes=(*notes, *_one_sided(solver.problem, along)),
    )


class Gradient:
    """The derivatives along some directions; their errors are the differences from those of a finer discretisation.

    Args:
        solver: of the problem.
        along: the directions, by name.
    """

    def __init__(self, solver: ExponentSolver, along: Mapping[str, ParameterDerivative]) -> None:
        self._solver, self._along = solver, along

    def moment(self, p: float) -> Slopes:
        """∂Λ(p)/∂θ. Raises `NotConverged`, `NoSuchExponent`."""
        if p == 0:
            return dict.fromkeys(self._along, Estimate(0.0, 0.0, 0.0))
        pair = self._solver.pair(p)
        with one_thread():
            finer = principal_pair(pair.generator.enriched(), p, start=pair)
        return self._each(lambda by: _between(changed_value(pair, by), changed_value(finer, by)))

    def lyapunov_exponent(self) -> Slopes:
        """∂λ/∂θ. Raises `NotConverged`."""
        return self._each(lambda by: self._at_zero(partial(changed_slope, by=by)))

    def variance_rate(self) -> Slopes:
        """∂Λ″(0)/∂θ. Raises `NotConverged`, `NoSuchExponent`."""
        self._solver.variance_rate()
        return self._each(lambda by: self._at_zero(partial(changed_curvature, by=by)))

    def ratio(self, p: float) -> Slopes:
        """∂/∂θ of Λ(p)/p, which at p = 0 is λ; for small p from its derivatives there."""
        if abs(p) >= SMALL_P:
            return {key: _times(1 / p, each) for key, each in self.moment(p).items()}
        found = self.lyapunov_exponent()
        if p == 0:
            return found
        more = self.variance_rate()
        return {key: _sum(found[key], _times(0.5 * p, more[key])) for key in found}

    def root(self, p: float) -> Slopes:
        """∂δ_p/∂θ, p being δ_p."""
        increase = self._solver.ratio(p)[1]
        return {key: _times(-1 / increase, each) for key, each in self.ratio(p).items()}

    def _each(self, of_direction: Callable[[ParameterDerivative], Estimate]) -> Slopes:
        return {key: of_direction(by) for key, by in self._along.items()}

    def _at_zero(self, of_pair: Callable[[Bordered], Estimate]) -> Estimate:
        coarse, fine = self._pairs_at_zero
        return _between(of_pair(coarse), of_pair(fine))

    @cached_property
    def _pairs_at_zero(self) -> tuple[Bordered, Bordered]:
        coarse, fine = self._solver.at_zero
        return Bordered(coarse), Bordered(fine)


def _one_sided(problem: Problem, along: Mapping[str, ParameterDerivative]) -> tuple[Message, ...]:
    """Which derivatives are taken from below."""
    noise, values = problem.noise, problem.values
    return tuple(
        Message(Code.ONE_SIDED, key=key, value=values[key])
        for key in (f"{noise.section}.{name}" for name in noise.one_sided)
        if key in along
    )


def _summed(terms: Sequence[KroneckerSum], x: FloatArray, y: FloatArray, turns: int) -> Estimate:
    """⟨T*, (sum of some operators) T⟩/⟨T*, T⟩."""
    parts = turns * np.array([y @ (term @ x) for term in terms])
    sizes = turns * np.array([abs(y) @ (abs(term) @ abs(x)) for term in terms])
    return Estimate(float(np.sum(parts)), sys.float_info.epsilon * float(np.sum(sizes)), float(np.sum(np.abs(parts))))


def _between(coarse: Estimate, fine: Estimate) -> Estimate:
    """The finer one, its error including how far both are apart."""
    return Estimate(fine.value, abs(fine.value - coarse.value) + fine.error_estimate, fine.scale)


def _rounded(parts: Sequence[Any], norm: float) -> Estimate:
    """The sum of some parts, with about what rounding may change in it."""
    size = float(np.sum(np.abs(parts))) / norm
    return Estimate(float(np.sum(parts)) / norm, 1e3 * sys.float_info.epsilon * size, size)


def _times(factor: float, estimate: Estimate) -> Estimate:
    return Estimate(factor * estimate.value, abs(factor) * estimate.error_estimate, abs(factor) * estimate.scale)


def _sum(one: Estimate, other: Estimate) -> Estimate:
    return Estimate(one.value + other.value, one.error_estimate + other.error_estimate, max(one.scale, other.scale))
