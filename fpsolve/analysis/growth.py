"""Growth in finite time: the rate function I(s) of s_t = (1/t) ln ‖x(t)‖, and the law of s_t for a start.

I(s) = sup_p (ps − Λ(p)) is reached where Λ′(p) = s, which Newton's method finds: Λ″ is known. P(s_t ≈ s) ~ e^{−tI(s)}.

For a start at the phase φ₀, with ‖x(0)‖ = 1 and ξ₀ in its stationary law, the operator L(p) moves the constant 1 on:

    K(p) = ln E‖x(t)‖^p = ln E [e^{tL(p)} 1](φ₀, ξ₀) → Λ(p)t + ln C(p),    C(p) = E T(φ₀, ξ₀) ⟨T*, 1⟩/⟨T*, T⟩.

On the functions that Λ(p) is solved with e^{tL} is exact but for rounding, by Arnoldi's method with (L − γ)⁻¹ (J. van
den Eshof, M. Hochbruck, SIAM J. Sci. Comput. 27, 2006), so that K has the memory of the start. At several p it gives a
Chebyshev series, and from this the saddle point K′(p) = ts with u = p√K″, w = ±√(2(pK′ − K)) and λₙ = K⁽ⁿ⁾/K″^½ⁿ gives
the density of s_t, and P(s_t ≥ s) uniformly in s (R. Lugannani, S. Rice, Adv. Appl. Probab. 12, 1980; the next terms by
H. E. Daniels, Int. Stat. Rev. 55, 1987):

    t e^{K − pK′}/√(2πK″) [1 + a],    Φ̄(w) + φ(w) [1/u − 1/w + (a/u − λ₃/2u² − 1/u³ + 1/w³)],    a = λ₄/8 − 5λ₃²/24.

The error is estimated by these next terms; as they change their sign, also by those of one order more,

    (24|λ₆| + 168|λ₃λ₅| + 105λ₄² + 630λ₃²|λ₄| + 385λ₃⁴)/1152;

and by what a finer discretisation, fewer Arnoldi vectors and the last coefficients of the series change.
"""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy.linalg
from numpy.polynomial.polynomial import polyfit, polyval
from numpy.typing import ArrayLike
from scipy.optimize import brentq
from scipy.stats import norm

from fpsolve.analysis.excursions import fine_phases, own_phase, start_functional
from fpsolve.arrays import FloatArray, real_number, real_numbers, shown
from fpsolve.budget import counted, one_number
from fpsolve.data import Quantity, Result, dataset
from fpsolve.errors import NoSuchExponent, NotConverged
from fpsolve.exponent.adapt import Budget, widened
from fpsolve.exponent.eigen import PrincipalPair, length, second_derivative
from fpsolve.exponent.function import SEARCH_INTERVAL
from fpsolve.exponent.solver import TINY_P, ExponentSolver, solver_of
from fpsolve.fem.generator import Generator
from fpsolve.fem.mesh import CylinderMesh
from fpsolve.messages import Code, Message
from fpsolve.model.problem import Problem, refuse_tails
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
from fpsolve.roots import Missing, NoRoot, Value, increasing_root

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

MOST_RETREATS = 6
"""Largest number of halvings of an end of the p, until Λ(p) is solved there."""
CLOSE = 1e-9
"""Steps in p with which the search ends, relative to the larger of 1 and |p|."""
CENTRE = np.array([-3, -2, -1, 1, 2, 3]) / 3
"""p over `AROUND`/√K″ through which the terms of P are interpolated around p = 0, where their poles cancel."""
AROUND = 0.6
"""Largest |p|√K″ of these."""
VECTORS = 80
"""Number of vectors of Arnoldi's method for e^{tL}."""
FEWER = 10
"""Number of vectors less that tell its error."""
POLE = 10.0
"""(γ − Λ)t: how far to the right of Λ the pole γ of Arnoldi's method is, in units of 1/t."""
LEVELS = (9, 17, 33, 65)
"""Numbers of p in a Chebyshev series."""
DIGITS = 1e-7
"""Share of the largest coefficient of a series down to which it goes."""
MOST_FINER = 8
"""Largest number of discretisations of e^{tL}."""
FINE = 1e-8
"""Change of K from one discretisation to the next with which it is settled."""
MOST_WIDER = 8
"""Largest number of intervals of p, each wider than the last, that are tried for the saddle points."""


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
            PROBABILITY.error(), comment="from the next order of the saddle point, and a finer discretisation"
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
        problem: a motion and its noise.
        s: one growth rate, or an array of shape (n,), per unit time.
        interval: the p among which p(s) is sought.
        rtol, mesh, budget: as for `moment_lyapunov`.

    Raises:
        ValueError: s is not finite, or empty, or rtol is not positive.
        NoSuchExponent: Λ(p) has a kink: the noise has algebraic tails, or it is that of parts that do not all
            drive each other.
        NotConverged: some s are not reached by Λ′ in the interval, or some p are not resolved; `partial` is the result
            for the others.
    """
    solver = solver_of(problem, mesh, rtol, budget)
    return _rates(Slopes(solver, interval), real_numbers(s, "s"))


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
    """The density of s_t = (1/t) ln ‖x(t)‖ and P(s_t ≥ s), from ln E‖x(t)‖^p at its saddle points, with their errors.

    Args:
        problem: a motion and its noise.
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
    solver = solver_of(problem, mesh, rtol, budget)
    if problem.dimension > 2 or any(each.basis == "pairs" for each in problem.coloured.parts.values()):
        raise NoSuchExponent(Message(Code.NO_PREFACTOR))
    slopes = Slopes(solver, interval)
    rate = _rates(slopes, real_numbers(s, "s"))
    pairs = [slopes.at(p).pair for p in rate.p.tolist()]
    factors, finer = (
        np.array([math.nan if each is None else prefactor(each, phase) for each in of])
        for of in (pairs, [finer_or_none(solver, pair) for pair in pairs])
    )
    rows = np.array([laws(slopes, phase, time, rate.growth, rate.p) for time in times.tolist()])
    density, density_error, above, below, error = np.moveaxis(rows, 2, 0)
    return GrowthLaw(
        time=times,
        growth=rate.growth,
        density=density,
        density_error=density_error,
        above=above,
        below=below,
        probability_error=error,
        width=np.sqrt(solver.variance_rate().value / times),
        prefactor=factors,
        prefactor_error=np.abs(finer - factors),
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
        NoSuchExponent: Λ has kinks, or the noise has algebraic tails.
        ValueError: the interval does not have 0 inside.
    """

    def __init__(self, solver: ExponentSolver, interval: tuple[float, float]) -> None:
        refuse_tails(solver.problem, "the law of growth")
        if len(solver.classes) > 1:
            raise NoSuchExponent(Message(Code.NO_RATE_FUNCTION, parts=solver.problem.block_names))
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
            pair = (self.solver.whole if abs(p) < TINY_P else self.solver).solution(p).pair
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

        def gap(p: float) -> Value:
            try:
                here = self.at(p)
            except NotConverged as failure:
                raise Missing(p) from failure
            step = CLOSE * max(1.0, abs(p)) * here.curvature
            return Value(here.slope - s, here.curvature, step, 1e3 * step)

        start = min((*self._known.values(), self.at(0.0)), key=lambda each: abs(each.slope - s)).p
        try:
            return self.at(increasing_root(gap, start, (self.low, self.high)))
        except (Missing, NoRoot) as failure:
            end = min(self._known.values(), key=lambda each: abs(each.slope - s))
            missing = failure.missing if isinstance(failure, NoRoot) else failure
            cause: Any = missing and missing.__cause__
            told = {"p": end.p, "slope": end.slope, "reason": cause and cause.reason}
            raise NotConverged(Message(Code.GROWTH_BEYOND, s=s, **told)) from cause


def _rates(slopes: Slopes, s: FloatArray) -> RateFunction:
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


class _Cumulants:
    """K(p) = ln E‖x(t)‖^p for a start at a phase, at one t, and its Chebyshev series on an interval.

    Args:
        slopes: Λ.
        start: φ₀.
        time: t.

    Attributes:
        lost: about the error of K′(p); NaN where a finer discretisation, which tells it, is not to be had.
    """

    def __init__(self, slopes: Slopes, start: float, time: float) -> None:
        self._solver, self._start, self.time = slopes.solver, start, time
        self._known = {0.0: (0.0, 0.0)}

    def holds(self, s: FloatArray, low: float, high: float) -> bool:
        """Whether K′ = ts has its roots in an interval: K is convex, so that its chords tell."""
        step = 0.1 * min(-low, high)
        first, last = (self.at(each + step)[0] - self.at(each)[0] for each in (low, high - step))
        return bool(first < step * self.time * s.min() and step * self.time * s.max() < last)

    def fit(self, low: float, high: float) -> None:
        """Make the series on an interval. Raises `NotConverged`."""
        most = LEVELS[-1] - 1
        nodes = 0.5 * (low + high) - 0.5 * (high - low) * np.cos(np.pi * np.arange(most + 1) / most)
        for count in LEVELS:
            p = nodes[:: most // (count - 1)]
            values, errors = np.array([self.at(each) for each in p.tolist()]).T
            noise = float(np.max(errors))
            series = np.polynomial.Chebyshev.fit(p, values, count - 1, domain=[low, high])
            left = float(np.max(np.abs(series.coef[-3:])))
            if left <= max(3 * noise, DIGITS * float(np.max(np.abs(series.coef)))):
                break
        kept = np.flatnonzero(np.abs(series.coef) > noise)  # derivatives magnify the others
        degree = max(int(kept.max(initial=0)), 6)
        self.series = series.truncate(degree + 1)
        self.lost = max(left, noise) * degree**2 / (0.5 * (high - low))
        self._derivatives = [self.series, *(self.series.deriv(n) for n in range(1, 7))]
        self.slopes = float(self._derivatives[1](low)) / self.time, float(self._derivatives[1](high)) / self.time
        self._low, self._high = low, high

    def at(self, p: float) -> tuple[float, float]:
        """K(p) and its error, from ever finer discretisations: for small t it has layers that T has not."""
        if p in self._known:
            return self._known[p]
        solution = self._solver.whole.solution(p)
        generator, last = solution.pair.generator, math.inf
        with counted(self._solver.budget.countdown(f"E‖x({self.time:g})‖^{p:g}")):
            for _ in range(MOST_FINER):
                found, fewer = log_moment(solution.pair, self._start, self.time, generator)
                change, last = abs(found - last), found
                chosen = widened(generator).enriched()
                if change <= FINE or chosen.size > self._solver.budget.unknowns:
                    break
                generator = Generator(generator.problem, chosen)
        error = (change if math.isfinite(change) else math.nan) + abs(found - fewer) + self.time * solution.error
        self._known[p] = found, error
        return self._known[p]

    def saddle(self, p: float) -> _Saddle:
        """K and its derivatives at p."""
        return _Saddle(p, *(float(each(p)) for each in self._derivatives))

    def where(self, s: float) -> _Saddle:
        """The saddle point K′(p) = ts. Raises `NotConverged`."""
        if not self.slopes[0] < s < self.slopes[1]:
            side = int(s > self.slopes[0])
            raise NotConverged(
                Message(Code.GROWTH_BEYOND, s=s, p=(self._low, self._high)[side], slope=self.slopes[side])
            )
        gap = self._derivatives[1] - self.time * s
        return self.saddle(float(brentq(gap, self._low, self._high, xtol=CLOSE * (self._high - self._low))))

    def law(self, s: float) -> tuple[float, ...]:
        """The density at s, its error, P(s_t ≥ s), P(s_t ≤ s), and the error of both."""
        here, doubt = self.where(s), 0.0
        first, further, wave = here.terms
        reach = min(AROUND / math.sqrt(here.curvature), -self._low, self._high)
        if abs(here.p) < CENTRE[3] * reach:
            p, values = reach * CENTRE, np.array([self.saddle(each).terms for each in (reach * CENTRE).tolist()])
            fits = polyfit(p, values, 5), polyfit(p[1:-1], values[1:-1], 3)
            (first, further, wave), fewer = (np.asarray(polyval(here.p, each)).tolist() for each in fits)
            doubt = abs(first - fewer[0]) + abs(further - fewer[1]) + abs(here.p * (wave - fewer[2]))
        w = wave * here.p
        bell, lost = float(norm.pdf(w)), self.lost / math.sqrt(here.curvature)
        sides = [float(norm.sf(side * w)) + side * bell * (first + further) for side in (1, -1)]
        above, below = (min(max(each, 0.0), 1.0) for each in sides)
        height = self.time * math.exp(here.value - here.p * here.slope) / math.sqrt(2 * math.pi * here.curvature)
        relative = abs(here.next) + here.beyond + lost * (1 + abs(here.p) * math.sqrt(here.curvature))
        error = min(bell * (abs(further) + doubt + lost) + here.beyond * min(above, below), 1.0)
        return max(height * (1 + here.next), 0.0), height * relative, above, below, error


@dataclass(frozen=True)
class _Saddle:
    """K at one p and its six derivatives there."""

    p: float
    value: float
    slope: float
    curvature: float
    third: float
    fourth: float
    fifth: float
    sixth: float

    @property
    def w(self) -> float:
        """±√(2(pK′ − K))."""
        return math.copysign(math.sqrt(max(2 * (self.p * self.slope - self.value), 0.0)), self.p)

    def ratio(self, n: int) -> float:
        """λₙ."""
        return (self.third, self.fourth, self.fifth, self.sixth)[n - 3] / self.curvature ** (0.5 * n)

    @property
    def next(self) -> float:
        """a."""
        return self.ratio(4) / 8 - 5 * self.ratio(3) ** 2 / 24

    @property
    def beyond(self) -> float:
        """The absolute values of the terms of the order after that."""
        third, fourth, fifth, sixth = (abs(self.ratio(n)) for n in (3, 4, 5, 6))
        terms = 24 * sixth, 168 * third * fifth, 105 * fourth**2, 630 * third**2 * fourth, 385 * third**4
        return sum(terms) / 1152

    @property
    def terms(self) -> tuple[float, float, float]:
        """1/u − 1/w, a/u − λ₃/2u² − 1/u³ + 1/w³, and w/p; NaN at p = 0."""
        u, w = self.p * math.sqrt(self.curvature), self.w
        if not u * w:
            return math.nan, math.nan, math.nan
        return 1 / u - 1 / w, self.next / u - self.ratio(3) / (2 * u**2) - 1 / u**3 + 1 / w**3, w / self.p


def laws(slopes: Slopes, start: float, time: float, s: FloatArray, p: FloatArray) -> FloatArray:
    """`_Cumulants.law` at several s, shape (n, 5), from p near the saddle points. Raises `NotConverged`."""
    margin = (AROUND + 0.1) / math.sqrt(time * slopes.at(0.0).curvature)
    ends, found = (min(p.min(), 0.0), max(p.max(), 0.0)), _Cumulants(slopes, start, time)
    for _ in range(MOST_WIDER):
        low, high = max(ends[0] - margin, slopes.low), min(ends[1] + margin, slopes.high)
        if found.holds(s, low, high):
            break
        margin *= 1.5
    found.fit(low, high)
    return np.array([found.law(each) for each in s.tolist()])


def log_moment(
    pair: PrincipalPair, start: float, time: float, generator: Generator | None = None
) -> tuple[float, float]:
    """ln E‖x(t)‖^p for a start at a phase, the noise being in its stationary law, and the same by fewer vectors.

    It is that of another generator than that of the pair, if one is given.

    With R = (L − γM)⁻¹M e^{tL}M⁻¹ = R⁻¹e^{t(γ + R⁻¹)} (L − γM)⁻¹, and R on Arnoldi's vectors is a small matrix H.
    """
    generator = generator or pair.generator
    space, (first, last) = generator.space(pair.p), _ends(generator, pair.p, start)
    pole = POLE / time
    factor = generator.at(pair.p).factorised(pair.value + pole)
    vector = factor.solve(last)
    size, most = length(vector), min(VECTORS, space.size)
    basis, small = np.zeros((most + 1, space.size)), np.zeros((most + 1, most))
    basis[0] = vector / size
    for k in range(most):
        vector = factor.solve(space.weighed(basis[k]))
        scale = length(vector)
        for _ in range(2):  # once more for what rounding leaves
            parts = basis[: k + 1] @ vector
            small[: k + 1, k] += parts
            vector = vector - parts @ basis[: k + 1]
        small[k + 1, k] = length(vector)
        if small[k + 1, k] <= 1e-13 * scale:
            most = k + 1
            break
        basis[k + 1] = vector / small[k + 1, k]
    logs = []
    for count in (most, max(most - FEWER, 1) if most == VECTORS else most):
        inverse = np.linalg.inv(small[:count, :count])
        moved = scipy.linalg.expm(time * (pole * np.eye(count) + inverse))[:, 0]
        logs.append(pair.value * time + math.log(size * float((basis[:count] @ first) @ (inverse @ moved))))
    return logs[0], logs[1]


def finer_or_none(solver: ExponentSolver, pair: PrincipalPair) -> PrincipalPair | None:
    """The pair on a finer discretisation, where it is to be had."""
    with suppress(NotConverged):
        return solver.whole.finer_pair(pair)
    return None


def prefactor(pair: PrincipalPair, start: float) -> float:
    """C(p) of E‖x(t)‖^p ~ C(p) e^{Λ(p)t} for a start at a phase, the noise being in its stationary law.

    It is in the coordinates of the problem, whatever those are in which the pair was solved.
    """
    first, last = _ends(pair.generator, pair.p, start)
    norm = pair.left @ pair.space.weighed(pair.right)
    return float((first @ pair.right) * (last @ pair.left) / norm)


def _ends(generator: Generator, p: float, start: float) -> tuple[FloatArray, FloatArray]:
    """The coefficients of the mean of T over the start, and of ⟨T*, 1⟩, shape (size,) each."""
    space = generator.space(p)
    points, weights = fine_phases(generator, space)
    _, stretch = own_phase(generator, p, points)
    at_phi, noises = space.phi.at(points).T @ (weights / stretch), list[FloatArray]()
    for axis in space.noises:
        at = axis.samples()
        noises.append(np.ravel(at.values.T @ (at.measure * at.weight / at.factor)))
    return start_functional(generator, p, start), space.product([np.ravel(at_phi), *noises])
