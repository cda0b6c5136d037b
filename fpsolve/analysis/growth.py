"""Growth in finite time: the rate function I(s) of s_t = (1/t) ln ‖x(t)‖, and the law of s_t with its prefactor.

I(s) = sup_p (ps − Λ(p)) is reached where Λ′(p) = s, which Newton's method finds: Λ″ is known. P(s_t ≈ s) ~ e^{−tI(s)}.

For a start at the phase φ₀, with ‖x(0)‖ = 1 and ξ₀ in its stationary law,

    E‖x(t)‖^p = C(p) e^{Λ(p)t} + Σₖ aₖ e^{Λₖt},    C(p) = E T(φ₀, ξ₀) ⟨T*, 1⟩/⟨T*, T⟩,

Λₖ the other eigenvalues. From the first part the saddle point p of ps − Λ(p), where w = ±√(2I), u = p√Λ″, gives the
density of s_t, and P(s_t ≥ s) uniformly in s (R. Lugannani, S. Rice, Adv. Appl. Probab. 12, 1980; for the factor C/p
beside the exponential N. Bleistein, Comm. Pure Appl. Math. 19, 1966):

    √(t/2πΛ″) C e^{−tI} [1 + a(C)/t],    Φ̄(√t w) + φ(√t w)/√t [C/u − 1/w + ((C/u) a(C/p) + 1/w³)/t],
    a(G) = Λ⁗/8Λ″² − 5Λ‴²/24Λ″³ + (G′/G) Λ‴/2Λ″² − (G″/G)/2Λ″.

The error is estimated by the terms with a(G), of one order more; as these change their sign, also by (A/t)², A being
a(C) with absolute values for its parts; by the errors of C and I; and by the aₖ nearest to Λ.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs
from scipy.stats import norm

from fpsolve.arrays import FloatArray, real_number, real_numbers, shown
from fpsolve.budget import counted, one_number
from fpsolve.data import Quantity, Result, dataset
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent.adapt import Budget, widened
from fpsolve.exponent.eigen import PrincipalPair, second_derivative
from fpsolve.exponent.function import SEARCH_INTERVAL
from fpsolve.exponent.solver import TINY_P, ExponentSolver
from fpsolve.fem.axis import TensorSpace
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem, of_problem
from fpsolve.model.quantity import (
    BELOW,
    GROWTH,
    GROWTH_DENSITY,
    PREFACTOR,
    PROBABILITY,
    RATE_FUNCTION,
    SADDLE,
    SECOND_DERIVATIVE,
    TIME,
    WIDTH,
)
from fpsolve.theory.far import grows_far_out

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

MOST_STEPS, MOST_RETREATS = 60, 6
"""Of Newton's method, and of the way back from a p that is not solved."""
CLOSE = 1e-9
"""Steps in p with which the search ends, relative to the larger of 1 and |p|."""
STEP = 0.02
"""In p, for the derivatives of Λ″ and ln C."""
CENTRE = np.array([-0.4, -0.2, 0.2, 0.4])
"""p through which the terms of P are interpolated around p = 0, where poles of theirs cancel."""
MODES = 6
"""Eigenvalues nearest to Λ that are looked at."""


@dataclass(frozen=True, eq=False, repr=False)
class RateFunction(Result):
    """I(s) = sup_p (ps − Λ(p)) at several s.

    Attributes:
        growth: s, per unit time, shape (n,).
        p: where the supremum is reached, Λ′(p) = s, shape (n,).
        value: I(s), per unit time, shape (n,); 0 at s = λ.
        error_estimate: to first order that of Λ(p), shape (n,).
        second_derivative: Λ″(p) = 1/I″(s), shape (n,).
        solver: what solved them.
    """

    growth: FloatArray
    p: FloatArray
    value: FloatArray
    error_estimate: FloatArray
    second_derivative: FloatArray
    solver: ExponentSolver

    def range(self, interval: tuple[float, float] = SEARCH_INTERVAL) -> tuple[float, float]:
        """The s between which I(s) is known: Λ′ at the smallest and the largest p of an interval that is solved."""
        slopes = Slopes(self.solver, interval)
        return slopes.end(-1).slope, slopes.end(1).slope

    def to_xarray(self) -> xarray.Dataset:
        """I(s) over s, with its error, p(s) and Λ″(p(s))."""
        numbers = {
            RATE_FUNCTION: self.value,
            RATE_FUNCTION.error(): self.error_estimate,
            SADDLE: self.p,
            replace(SECOND_DERIVATIVE, dims=(GROWTH.name,)): self.second_derivative,
        }
        values = self.solver.problem.values
        return dataset(RATE_FUNCTION.words, "finite elements", numbers, {GROWTH: self.growth}, values)

    def _said(self) -> str:
        return f"{self.growth.size} s from {self.growth.min():.6g} to {self.growth.max():.6g}"


@dataclass(frozen=True, eq=False, repr=False)
class GrowthLaw(Result):
    """The law of s_t = (1/t) ln ‖x(t)‖, ‖x(0)‖ = 1, at several t and s.

    Attributes:
        time: t, shape (m,).
        growth: s, per unit time, shape (n,).
        density: of s_t at s, in time, shape (m, n).
        density_error: its estimated error.
        above, below: P(s_t ≥ s) and P(s_t ≤ s), shape (m, n).
        probability_error: the estimated error of both.
        width: √(Λ″(0)/t), the standard deviation of s_t to leading order, shape (m,); its centre is at λ.
        prefactor, prefactor_error: C(p(s)), shape (n,).
        rate: I(s), with p(s).
        start: φ₀.
    """

    time: FloatArray
    growth: FloatArray
    density: FloatArray
    density_error: FloatArray
    above: FloatArray
    below: FloatArray
    probability_error: FloatArray
    width: FloatArray
    prefactor: FloatArray
    prefactor_error: FloatArray
    rate: RateFunction
    start: float

    def to_xarray(self) -> xarray.Dataset:
        """P(s_t ≥ s), P(s_t ≤ s) and the density over t and s, with errors; C, p and I over s, the width over t."""
        of_law = replace(
            PROBABILITY.error(), comment="from the next order in 1/t, those of C and I, and other eigenvalues"
        )
        numbers: dict[Quantity, Any] = {
            PROBABILITY: self.above,
            of_law: self.probability_error,
            BELOW: self.below,
            GROWTH_DENSITY: self.density,
            GROWTH_DENSITY.error(): self.density_error,
            PREFACTOR: self.prefactor,
            PREFACTOR.error(): self.prefactor_error,
            SADDLE: self.rate.p,
            RATE_FUNCTION: self.rate.value,
            WIDTH: self.width,
        }
        places = {TIME: self.time, GROWTH: self.growth}
        values = self.rate.solver.problem.values
        return dataset("law of the growth rate", "finite elements", numbers, places, values, start_phase=self.start)

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: Any) -> None:
        order = np.argsort(self.growth)
        for t, density in zip(self.time, self.density, strict=True):
            axes.plot(self.growth[order], density[order], **{"label": f"t = {t:g}", **kwargs})
        axes.set(xlabel=GROWTH.title, ylabel=GROWTH_DENSITY.title)
        axes.legend(frameon=False)

    def _said(self) -> str:
        return f"at {self.time.size} t and {self.growth.size} s"


@of_problem
def rate_function(
    problem: Problem,
    s: ArrayLike,
    *,
    interval: tuple[float, float] = SEARCH_INTERVAL,
    rtol: float | None = None,
    mesh: CylinderMesh | None = None,
    budget: Budget | None = None,
) -> RateFunction:
    """The rate function I(s) = sup_p (ps − Λ(p)) of (1/t) ln ‖x(t)‖: P(s_t ≈ s) ~ e^{−tI(s)}.

    Args:
        oscillator, noise: a motion and its noise; or one `Problem` of both, in their place or as `problem`.
        s: one growth rate, or an array of shape (n,), per unit time.
        interval: the p among which p(s) is sought.
        rtol, mesh, budget: as for `moment_lyapunov`.

    Raises:
        ValueError: s is not finite, or empty, or rtol is not positive.
        NoSuchExponent: Λ(p) has a kink: the noise has algebraic tails, or the phase never leaves a ray.
        NotConverged: some s are not reached by Λ′ in the interval, or some p are not resolved; `partial` is the result
            for the others.
    """
    solver = ExponentSolver(problem, mesh, rtol=problem.wanted(rtol), budget=budget or Budget())
    return _found(Slopes(solver, interval), real_numbers(s, "s"))


@of_problem
def growth_law(
    problem: Problem,
    t: ArrayLike,
    s: ArrayLike,
    *,
    start: float = 0.0,
    interval: tuple[float, float] = SEARCH_INTERVAL,
    rtol: float | None = None,
    mesh: CylinderMesh | None = None,
    budget: Budget | None = None,
) -> GrowthLaw:
    """The density of s_t = (1/t) ln ‖x(t)‖ and P(s_t ≥ s), from T and T* at the saddle points p(s), with their errors.

    Args:
        oscillator, noise: a motion and its noise; or one `Problem` of both, in their place or as `problem`.
        t: one time, or an array of shape (m,); t > 0.
        s: one growth rate, or an array of shape (n,), per unit time.
        start: the phase φ₀ at t = 0, in radians; 0 is the first variable displaced alone. On the ray of a jump it is
            behind it. The noise is in its stationary law.
        interval, rtol, mesh, budget: as for `rate_function`.

    Raises:
        ValueError: s or t is not finite, or empty, or t is not positive.
        NoSuchExponent: as for `rate_function`; or there are more than two variables, or the noise is a filter's.
        NotConverged: as for `rate_function`.
    """
    times, phase = real_numbers(t, "t"), real_number(start, "start")
    if not np.all(times > 0):
        raise ValueError(f"got t = {shown(t)}; must be positive")
    solver = ExponentSolver(problem, mesh, rtol=problem.wanted(rtol), budget=budget or Budget())
    if problem.dimension > 2 or any(each.basis == "pairs" for each in problem.coloured.parts.values()):
        raise NoSuchExponent(Message(Code.NO_PREFACTOR))
    slopes = Slopes(solver, interval)
    rate = _found(slopes, real_numbers(s, "s"))
    around = [_Saddle(slopes, p, phase) for p in rate.p.tolist()]
    fits = list[np.polynomial.Polynomial]()
    if np.any(np.abs(rate.p) < CENTRE[2]):
        values = np.array([_Saddle(slopes, p, phase).terms for p in CENTRE.tolist()])
        fits = [np.polynomial.Polynomial.fit(CENTRE, column, CENTRE.size - 1) for column in values.T]
    shape = times.size, rate.growth.size
    density, density_error, above, below, error = (np.empty(shape) for _ in range(5))
    for i, saddle in enumerate(around):
        exponent, wave = float(rate.value[i]), math.copysign(math.sqrt(2 * rate.value[i]), saddle.p)
        first, further = [float(fit(saddle.p)) for fit in fits] if abs(saddle.p) < CENTRE[2] else saddle.terms
        root = np.sqrt(times)
        relative = saddle.error + times * rate.error_estimate[i] + saddle.remainder(times) + (saddle.size / times) ** 2
        height = np.sqrt(times / (2 * math.pi * saddle.curvature)) * saddle.prefactor * np.exp(-times * exponent)
        density[:, i] = np.maximum(height * (1 + saddle.next_density / times), 0.0)
        density_error[:, i] = height * (np.abs(saddle.next_density) / times + relative)
        bell = norm.pdf(root * wave) / root
        change = bell * further / times
        for side, where in ((1, above), (-1, below)):
            where[:, i] = np.clip(norm.sf(side * root * wave) + side * (bell * first + change), 0.0, 1.0)
        error[:, i] = np.abs(change) + relative * np.minimum(above[:, i], below[:, i])
    return GrowthLaw(
        time=times,
        growth=rate.growth,
        density=density,
        density_error=density_error,
        above=above,
        below=below,
        probability_error=error,
        width=np.sqrt(solver.variance_rate().value / times),
        prefactor=np.array([each.prefactor for each in around]),
        prefactor_error=np.array([each.prefactor * each.error for each in around]),
        rate=rate,
        start=phase,
    )


@dataclass(frozen=True, eq=False)
class Slope:
    """Λ at one p.

    Attributes:
        p: the moment.
        ratio, ratio_slope: Λ(p)/p and its derivative, of which I at Λ′(p) is p² times; λ and ½Λ″(0) at p = 0.
        error: that of Λ(p).
        curvature: Λ″(p).
        pair: the eigenpair.
    """

    p: float
    ratio: float
    ratio_slope: float
    error: float
    curvature: float
    pair: PrincipalPair

    @property
    def slope(self) -> float:
        """Λ′(p)."""
        return self.ratio + self.p * self.ratio_slope


class Slopes:
    """Λ′ on an interval of p, and its inverse.

    Args:
        solver: of a problem whose Λ has no kinks.
        interval: the p that are looked at, those for which Λ is finite.

    Raises:
        NoSuchExponent: Λ has kinks.
        ValueError: the interval does not have 0 inside.
    """

    def __init__(self, solver: ExponentSolver, interval: tuple[float, float]) -> None:
        if grows_far_out(solver.problem) or len(solver.classes) > 1:
            raise NoSuchExponent(Message(Code.NO_RATE_FUNCTION))
        low, high = (real_number(each, "interval") for each in interval)
        if not low < 0 < high:
            raise ValueError(f"got interval = {shown(interval)}; must be two numbers, one below 0 and one above")
        self.solver, self.budget = solver, solver.budget
        self.low, self.high = np.clip([low, high], *solver.problem.moments).tolist()
        self._known: dict[float, Slope] = {}

    @one_number("Λ″({:g})")
    def at(self, p: float) -> Slope:
        """Λ at p. Raises `NotConverged`, `NoSuchExponent`."""
        if p not in self._known:
            ratio, ratio_slope, error = self.solver.ratio(p)
            pair = (self.solver.near if abs(p) < TINY_P else self.solver).solution(p).pair
            self._known[p] = Slope(p, ratio, ratio_slope, abs(p) * error, second_derivative(pair), pair)
        return self._known[p]

    def end(self, side: int) -> Slope:
        """The outermost p that is solved, below 0 for −1, above for 1."""
        found, p = self.at(0.0), self.low if side < 0 else self.high
        for _ in range(MOST_RETREATS):
            with suppress(NotConverged):
                return self.at(p)
            p *= 0.5
        return found

    def where(self, s: float) -> Slope:
        """The p with Λ′(p) = s, up to a step of Newton's method that is left. Raises `NotConverged`."""
        ends, retreats, last = [self.low, self.high], 0, math.inf
        here = min((*self._known.values(), self.at(0.0)), key=lambda each: abs(each.slope - s))
        for _ in range(MOST_STEPS):
            gap = s - here.slope
            step = gap / here.curvature
            is_close = abs(step) <= CLOSE * max(1.0, abs(here.p))
            if is_close or (abs(step) < 1e3 * CLOSE and abs(step) > 0.5 * last):  # what is left is rounding
                return here
            side = gap > 0
            ends[not side], last = here.p, abs(step)
            if here.p == (self.low, self.high)[side]:
                break
            p = here.p + step
            if (p - ends[side]) * (1 if side else -1) >= 0:
                is_open = ends[side] in (self.low, self.high) and ends[side] not in self._known
                p = ends[side] if is_open else 0.5 * (here.p + ends[side])
            try:
                here = self.at(p)
            except NotConverged as failure:
                retreats += 1
                if retreats > MOST_RETREATS:
                    told = {"s": s, "p": here.p, "slope": here.slope, "reason": failure.reason}
                    raise NotConverged(Message(Code.GROWTH_UNSOLVED, **told)) from failure
                ends[side] = 0.5 * (here.p + p)
        raise NotConverged(Message(Code.GROWTH_BEYOND, s=s, p=here.p, slope=here.slope))


def _found(slopes: Slopes, s: FloatArray) -> RateFunction:
    """I at several s, those near λ first. Raises `NotConverged`."""
    rows, failures = dict[int, tuple[float, ...]](), list[Message]()
    centre = slopes.at(0.0).slope
    for i in np.argsort(np.abs(s - centre), kind="stable").tolist():
        try:
            here = slopes.where(float(s[i]))
        except NotConverged as failure:
            failures.append(failure.message)
            continue
        gap = float(s[i]) - here.slope
        value = here.p**2 * here.ratio_slope + gap * here.p + gap**2 / (2 * here.curvature)
        error = here.error + gap**2 / (2 * here.curvature)
        rows[i] = (float(s[i]), here.p + gap / here.curvature, max(value, 0.0), error, here.curvature)
    growth, p, values, errors, curvature = np.array([rows[i] for i in sorted(rows)]).reshape(-1, 5).T
    result = RateFunction(growth, p, values, errors, curvature, slopes.solver)
    if failures:
        raise NotConverged(Message(Code.SEVERAL, reasons=failures), result)
    return result


class _Saddle:
    """What the law needs at a saddle point, for a start at a phase.

    Args:
        slopes: Λ.
        p: the saddle point.
        start: φ₀.
    """

    def __init__(self, slopes: Slopes, p: float, start: float) -> None:
        self.p, self._start, self._solver = p, start, slopes.solver
        own, below, above = (slopes.at(each) for each in (p, p - STEP, p + STEP))
        self.pair, self.curvature, self._own = own.pair, own.curvature, own
        logs = [math.log(prefactor(each.pair, start)) for each in (below, own, above)]
        self.prefactor = math.exp(logs[1])
        third = (above.curvature - below.curvature) / (2 * STEP)
        fourth = (above.curvature - 2 * own.curvature + below.curvature) / STEP**2
        self._skew, self._excess = third / own.curvature**1.5, fourth / own.curvature**2
        first = (logs[2] - logs[0]) / (2 * STEP)
        self._first, self._second = first, (logs[2] - 2 * logs[1] + logs[0]) / STEP**2 + first**2

    @property
    def next_density(self) -> float:
        """a(C)."""
        return sum(self._next(self._first, self._second))

    @property
    def size(self) -> float:
        """A."""
        return sum(map(abs, self._next(self._first, self._second)))

    @cached_property
    def terms(self) -> tuple[float, float]:
        """C/u − 1/w, and (C/u) a(C/p) + 1/w³."""
        p, own = self.p, self._own
        u, w = p * math.sqrt(self.curvature), math.copysign(math.sqrt(2 * p**2 * own.ratio_slope), p)
        of_quotient = self._next(self._first - 1 / p, self._second - 2 * self._first / p + 2 / p**2)
        return self.prefactor / u - 1 / w, self.prefactor / u * sum(of_quotient) + 1 / w**3

    def _next(self, first: float, second: float) -> tuple[float, ...]:
        """The parts of a(G) from G′/G and G″/G."""
        mixed = first / math.sqrt(self.curvature) * self._skew / 2
        return self._excess / 8, -5 * self._skew**2 / 24, mixed, -second / (2 * self.curvature)

    @cached_property
    def error(self) -> float:
        """The relative error of C, from a finer discretisation."""
        if self.p == 0:
            return 0.0
        finer = self._solver.near.finer_pair(self.pair, widened(self.pair.generator).enriched())
        return abs(prefactor(finer, self._start) / self.prefactor - 1)

    @cached_property
    def _others(self) -> Sequence[tuple[float, float]]:
        """Of eigenvalues near Λ how far they are from it, and |aₖ|/C."""
        with counted(self._solver.budget.countdown(f"the eigenvalues next to Λ({self.p:g})")):
            return others(self.pair, self._start) if self.p else ()

    def remainder(self, t: FloatArray) -> FloatArray:
        """Σ |aₖ|/C e^{−(Λ − Re Λₖ)t} over these."""
        return sum((size * np.exp(-gap * t) for gap, size in self._others), np.zeros_like(t))


def prefactor(pair: PrincipalPair, start: float) -> float:
    """C(p) of E‖x(t)‖^p ~ C(p) e^{Λ(p)t} for a start at a phase, the noise being in its stationary law.

    It is in the coordinates of the problem, whatever those are in which the pair was solved.
    """
    first, last = _ends(pair, start)
    norm = pair.left @ pair.space.weighed(pair.right)
    return float((first @ pair.right) * (last @ pair.left) / norm)


def others(pair: PrincipalPair, start: float) -> Sequence[tuple[float, float]]:
    """Of the eigenvalues Λₖ nearest to Λ Λ − Re Λₖ and |aₖ|/C; nothing where they are not found."""
    space, pencil = pair.space, pair.generator.at(pair.p)
    count = min(MODES, space.size - 2)
    if count < 1:
        return ()
    shift = pair.value + 0.1 * pair.generator.unit_rate
    factor = pencil.factorised(shift)

    def found(transposed: bool) -> tuple[Any, Any]:
        operator = LinearOperator(
            (space.size, space.size),
            lambda x: factor.solve(space.weighed(x.ravel()), transposed=transposed),
            dtype=float,
        )
        values, vectors = eigs(operator, count, v0=pair.left if transposed else pair.right, tol=1e-6)
        return shift + 1 / values, vectors

    try:
        (values, right), (lefts, left) = found(False), found(True)
    except (ArpackError, RuntimeError):
        return ()
    first, last = _ends(pair, start)
    rows, own = list[tuple[float, float]](), prefactor(pair, start)
    for k, value in enumerate(values):
        if abs(value - pair.value) <= 1e-6 * pair.generator.unit_rate:
            continue
        x, y = right[:, k], left[:, int(np.argmin(np.abs(lefts - value)))]
        overlap = y @ (space.weighed(x.real) + 1j * space.weighed(x.imag))
        rows.append((pair.value - float(value.real), float(abs((first @ x) * (last @ y) / overlap)) / own))
    return rows


def _ends(pair: PrincipalPair, start: float) -> tuple[FloatArray, FloatArray]:
    """The coefficients of the mean of T over the start, and of ⟨T*, 1⟩, shape (size,) each."""
    space, frame = pair.space, pair.generator.problem.frame
    phi, at, own, weights = space.phi, np.array([start]), 1.0, None
    if frame is not None:
        own = float(frame.length(at)[0]) ** pair.p
        at = frame.phase(at)
        points, weights = phi.finer_rule(frame.parts)
        weights = weights * frame.length(frame.own_phase(points)) ** -pair.p
    table = phi.values if weights is None else phi.at(points)
    last = table.T @ (phi.weights if weights is None else weights)
    first = own * np.ravel(phi.at(phi.lines[0] + np.mod(at - phi.lines[0], phi.span)).T @ np.ones(1))
    noise, total = _of_noises(space)
    return space.product([first / total, *noise]), space.product([np.ravel(last), *noise])


def _of_noises(space: TensorSpace) -> tuple[list[FloatArray], float]:
    """∫ P_s u for every function u of each noise, P_s scaled as the weight of the space is, and ∫ P_s."""
    found, total = list[FloatArray](), 1.0
    for axis in space.axes[1:]:
        at = axis.samples()
        weight = at.measure * at.weight / at.factor
        found.append(np.ravel(at.values.T @ weight))
        total *= float(weight @ (1 / at.factor))
    return found, total
