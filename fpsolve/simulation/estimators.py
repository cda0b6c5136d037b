"""Moment Lyapunov exponents by Monte Carlo simulation of the system (3), with errors from independent batches.

All estimates start in the stationary law of phase and noise. The linear system is simulated, without terms of degree 3.

Direct (W.-C. Xie, J. Appl. Mech. 72, 2005): M(t) = E‖x(t)‖^p over paths that are normalised again and again, and
Λ(p) = (ln M(2t) − ln M(t))/t. One set of paths serves all p and all t = 2ʲ × transient; each p takes the longest t
after which many paths still carry the mean, and λ is the time average of the growth.

Population dynamics (P. Del Moral, Feynman-Kac Formulae, 2004): for each p the paths of a batch carry weights ‖x‖^p;
when these differ too much, paths are drawn anew in proportion to them. The product Z of the mean weights has
E Z = E‖x‖^p, and its logarithm is normal for many paths (J. Bérard, P. Del Moral, A. Doucet, Electron. J. Probab. 19,
2014), so that Λ(p) = (E ln Z + ½ Var ln Z)/time.

Where a step h leaves a bias as h², some batches take steps of 3h: 9/8 of what those of h find, less 1/8 of what they
find, has none of it; 3/2 and 1/2 where it is as h, at a wall of several variables under white noise. The standard error
is that of both. A step of the order 4 leaves less than is seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import logsumexp

from fpsolve.arrays import FloatArray, real_number
from fpsolve.data import Quantity, Result, dataset
from fpsolve.drawing import draw_dots, finish, label_axes
from fpsolve.errors import NotConverged
from fpsolve.messages import Code, Message, message_of
from fpsolve.model.problem import Problem
from fpsolve.model.quantity import EFFECTIVE_PATHS, IMPACTS, LYAPUNOV_EXPONENT, MOMENT, OF_STOPS, VARIANCE_RATE, P
from fpsolve.simulation.batches import PlainBatch, Plan, Population, advance_all, standard_error
from fpsolve.simulation.coefficients import coefficients
from fpsolve.simulation.setup import (
    BATCHES,
    FEWER,
    PATHS,
    PROGRESS_STEPS,
    TRANSIENTS,
    Estimator,
    check_settings,
    obstacles,
    simulated_parts,
)
from fpsolve.simulation.walls import Floor, Rays

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

ROUGH = {Floor: (1, (6, 7, 14, 15, 22, 23, 30, 31)), Rays: (2, (14, 15, 30, 31))}
"""By the wall the order of the bias of a step, and the batches of rough steps, of populations as many near as far."""
FEW: Mapping[Estimator, int] = {"direct": 5000, "population": 1000}
"""With fewer effective paths there is no estimate. Direct runs that miss the rare large ‖x‖^p have both more effective
paths and a smaller mean, so that estimates near a lower bound would be too small."""
MOST_POPULATIONS = 9
"""Orders whose populations are simulated unasked."""
DRIFT = 4.0
"""Standard errors by which two parts of the same estimate may differ."""
_TINY = 1e-9
"""|p| below which Λ(p) is λp, as ln E‖x‖^p is rounded."""
_KEPT = 0.3
"""The share of effective paths that a long window of the direct estimator must leave."""
_LEVELS = 12
_BURN_IN, _LONGER = 9, 2
"""Slices in which a population finds its law, and times that modes have beyond the plane to share the motion."""


@dataclass(frozen=True)
class MomentEstimate:
    """Λ(p) by simulation.

    Attributes:
        p: order of the moment.
        value, standard_error: Λ(p) and the standard deviation of this estimate; None where too few paths carry it.
        estimator: "direct" or "population".
        effective_paths: how many paths carry the mean. Direct: (Σw)²/Σw² over all windows with the weights w = ‖x‖^p
            at their ends. Population: the same for the paths of a transient ago with the weights of their descendants.
    """

    p: float
    value: float | None
    standard_error: float | None
    estimator: Estimator
    effective_paths: float


@dataclass(frozen=True, repr=False)
class MonteCarlo(Result):
    """The results of a simulation of one parameter set.

    Attributes:
        estimates: Λ(p), in the order of p.
        lyapunov_exponent, lyapunov_exponent_error: λ and its standard error.
        variance_rate, variance_rate_error: Λ″(0), from the variance of ln‖x‖ over the paths, and its standard error.
        paths, time, step, seed: how many paths, their length after the transient, the time step, the seed.
        impacts: how many bounces the paths without weights had.
        warnings: what limits these numbers, each with its criterion.
        interrupted: whether the simulation was stopped early.
        parameters: of the problem, by keys such as "noise.D0".
        wall: for a wall of more than two variables fast impacts in unit time and the share of time at rest, with
            standard errors, by the names of `OF_STOPS`.
    """

    estimates: tuple[MomentEstimate, ...]
    lyapunov_exponent: float
    lyapunov_exponent_error: float
    variance_rate: float
    variance_rate_error: float
    paths: int
    time: float
    step: float
    seed: int
    impacts: int
    warnings: tuple[Message, ...]
    interrupted: bool = False
    parameters: Mapping[str, float | str] = field(default_factory=dict, compare=False)
    wall: Mapping[str, tuple[float, float]] = field(default_factory=dict, hash=False)

    def to_xarray(self) -> xarray.Dataset:
        """Λ(p) over p, λ and Λ″(0), with their standard errors; NaN where too few paths carry a moment."""
        each = [(each.p, each.value, each.standard_error, each.effective_paths) for each in self.estimates]
        p, value, error, effective = np.array(each, dtype=float).reshape(-1, 4).T
        kind = "standard error"
        numbers: dict[Quantity, ArrayLike] = {
            MOMENT: value,
            MOMENT.error(kind): error,
            EFFECTIVE_PATHS: effective,
            LYAPUNOV_EXPONENT: self.lyapunov_exponent,
            LYAPUNOV_EXPONENT.error(kind): self.lyapunov_exponent_error,
            VARIANCE_RATE: self.variance_rate,
            VARIANCE_RATE.error(kind): self.variance_rate_error,
            IMPACTS: self.impacts,
        }
        for name, (of, of_error) in self.wall.items():
            numbers |= {OF_STOPS[name]: of, OF_STOPS[name].error(kind): of_error}
        estimator = ", ".join(dict.fromkeys(each.estimator for each in self.estimates))
        more: dict[str, float | str | Sequence[str]] = {
            "paths": self.paths, "time": self.time, "step": self.step, "seed": self.seed, "estimator": estimator,
            "interrupted": int(self.interrupted), "warnings": self.warnings,
        }  # fmt: skip
        return dataset(MOMENT.words, "Monte Carlo", numbers, {P: p}, self.parameters, **more)

    def _draw(self, found: xarray.Dataset, axes: Axes, **kwargs: object) -> None:
        style = {"label": f"{found.attrs['method']} ± 2 standard errors", **kwargs}
        if found.moment.notnull().any():
            draw_dots(axes, found.p.values, found.moment.values, found.moment_error.values, **style)
        label_axes(axes, found.p.attrs, found.moment.attrs)
        finish(axes, **style)

    def _said(self) -> str:
        rate = f"λ = {self.lyapunov_exponent:.6g} ± {self.lyapunov_exponent_error:.0e}"
        return f"{rate}, Λ(p) at {len(self.estimates)} p, {self.paths} paths"


def simulate(
    problem: Problem,
    p: float | Sequence[float],
    *,
    estimator: Estimator | None = None,
    paths: int = PATHS,
    time: float | None = None,
    step: float | None = None,
    seed: int = 0,
    progress: Callable[[], None] = lambda: None,
) -> MonteCarlo:
    """Simulate paths of the linear system and estimate λ and Λ(p) from them.

    The result depends on the seed only, not on the number of processors. An interrupt (Ctrl-C) ends the simulation
    early and gives the estimates of what is done, marked as `interrupted`; before two transients are done there are
    none, and KeyboardInterrupt is raised.

    >>> simulate(problem, [1.0], paths=64, time=100.0, seed=1)
    MonteCarlo(λ = -0.0041... ± 4e-04, Λ(p) at 1 p, 64 paths)

    Args:
        problem: any linear motion, an oscillator without its c₂ and c₃, and its noise.
        p: orders of the moments, one or several.
        estimator: "direct", cheap and for moderate p; "population", one simulation for each p. None is the former, and
            the latter at nine p at most at which too few paths carry the mean.
        paths: how many; a multiple of 32 is used.
        time: length of the paths after the transient; 64 transients if None, and 16 beyond the plane, where
            they are longer. Whole transients are used.
        step: time step; None chooses one.
        seed: ≥ 0.
        progress: called 100 times in all.

    Raises:
        FpsolveError: the noise states no step of its paths, or multiplies a term by a function that is no a + bξ.
        ValueError: an argument is out of its range, or the step is too large; the text names the largest good one.
        NoSuchExponent: some Λ(p) is infinite.
        NotConverged: the numbers overflowed.
        KeyboardInterrupt: before two transients were done.
    """
    run = partial(_simulated, problem, paths=paths, time=time, step=step, seed=seed, progress=progress)
    if estimator is not None:
        return run(p, estimator, PROGRESS_STEPS)
    found = run(p, "direct", PROGRESS_STEPS // 2)
    few = [each.p for each in found.estimates if each.value is None]
    if found.interrupted:
        return found
    if not few:
        for _ in range(PROGRESS_STEPS // 2):
            progress()
        return found
    few = [few[i] for i in dict.fromkeys(np.linspace(0, len(few) - 1, MOST_POPULATIONS).round().astype(int).tolist())]
    try:
        more = run(few, "population", PROGRESS_STEPS // 2)
    except KeyboardInterrupt:
        return replace(found, interrupted=True)
    known = {each.p: each for each in more.estimates}
    estimates = tuple(known.get(each.p, each) for each in found.estimates)
    told = [each for each in (*found.warnings, *more.warnings) if message_of(each).code != Code.FEW_PATHS]
    return replace(found, estimates=estimates, warnings=(*_missing(estimates), *told), interrupted=more.interrupted)


def _simulated(
    problem: Problem,
    p: float | Sequence[float],
    estimator: Estimator,
    calls: int,
    *,
    paths: int,
    time: float | None,
    step: float | None,
    seed: int,
    progress: Callable[[], None],
) -> MonteCarlo:
    """What one estimator finds, see `simulate`."""
    oscillator, noise = simulated_parts(problem)
    time, step = (None if each is None else real_number(each, name) for name, each in (("time", time), ("step", step)))
    check_settings(problem, p, estimator, paths, seed)
    for name, sentence in obstacles(oscillator, noise, time=time, step=step).items():
        raise ValueError(f"{name}: {sentence}")
    known = coefficients(oscillator, noise)
    h, transient = known.default_step if step is None else step, known.transient()
    is_plane, is_direct = known.mixing_time == 0, estimator == "direct"
    length = transient if is_direct else known.transient(is_mixed=False)
    time = (TRANSIENTS if is_plane else FEWER) * transient if time is None else time
    wanted = max(2, round(time / length))
    plan = Plan(
        known=known,
        motion=known.motion(h),
        step=h,
        p=np.atleast_1d(np.array(p, dtype=float)),
        estimator=estimator,
        paths=math.ceil(paths / BATCHES),
        slice_steps=known.together * round(length / (known.together * h)),
        burn_in=max(1 if is_direct else _BURN_IN, math.ceil(_LONGER * known.mixing_time / length)),
        wanted=wanted,
        levels=min(_LEVELS, wanted.bit_length()) if is_direct else 0,
    )
    power, some = ROUGH[type(known.wall)]
    rough = some if known.together > 1 else ()
    plans = [plan.rougher if i in rough else plan for i in range(BATCHES)]
    groups = [[i for i in range(BATCHES) if i not in rough], *([*rough] for _ in rough[:1])]
    share = 1 / (known.together**power - 1) if rough else 0.0
    weights = np.array([1 + share, -share])[: len(groups)]
    # each batch has a stream of random numbers of its own
    seeds = [each.spawn(1 + plan.p.size) for each in np.random.SeedSequence(seed).spawn(BATCHES)]
    plain = [PlainBatch(each, spawned[0]) for each, spawned in zip(plans, seeds, strict=True)]
    populations = [
        [
            Population(plans[i], each[1 + k], float(order), is_far=bool(i % 2))
            for k, order in enumerate(plan.p if estimator == "population" else ())
        ]
        for i, each in enumerate(seeds)
    ]
    batches = [*plain, *chain.from_iterable(populations)]
    advances = [batch.advance for batch in batches]
    interrupted = advance_all(advances, plan.burn_in + plan.wanted, plan.slice_seconds, progress, calls)
    slices = np.array([batch.slices for batch in batches])
    if slices.min() < 2:
        raise KeyboardInterrupt
    times = plan.length * np.array([batch.slices for batch in plain])
    exponents = np.array([batch.growth for batch in plain]) / times
    variance_rates = np.array([batch.variance for batch in plain]) / times
    if not np.all(np.isfinite(exponents)):
        raise NotConverged(Message(Code.SIMULATION_OVERFLOWED))
    found = [
        direct_estimates(plan, [plain[i] for i in group])
        if is_direct
        else population_estimates(plan, [each for i in group for each in populations[i]])
        for group in groups
    ]
    at_wall = np.array([batch.tally for batch in plain]).T / (times * plan.paths)
    of_wall = [_counted([values[group] for group in groups]) for values in at_wall]
    (rate, error), (variance_rate, variance_rate_error) = (
        _at_no_step([(values[group].mean(), standard_error(values[group])) for group in groups], weights)
        for values in (exponents, variance_rates)
    )
    estimates = list[MomentEstimate]()
    for k, order in enumerate(plan.p.tolist()):
        value, deviation = _at_no_step([each[k, :2] for each, _ in found], weights)
        effective = float(np.nan_to_num(sum(each[k, 2] for each, _ in found)))
        is_known = math.isfinite(value + deviation) and effective >= FEW[estimator]
        if abs(order) < _TINY:
            value, deviation, is_known = order * rate if order else 0.0, abs(order) * error, True
        estimates.append(
            MomentEstimate(order, value if is_known else None, deviation if is_known else None, estimator, effective)
        )
    stopped = [Message(Code.STOPPED, share=slices.mean() / plan.wanted)] if interrupted else []
    return MonteCarlo(
        estimates=tuple(estimates),
        lyapunov_exponent=rate,
        lyapunov_exponent_error=error,
        variance_rate=variance_rate,
        variance_rate_error=variance_rate_error,
        paths=plan.paths * BATCHES,
        time=float(slices.mean()) * plan.length,
        step=h,
        seed=seed,
        impacts=int(sum(batch.tally[0] for batch in plain)),
        warnings=(*_missing(estimates), *found[0][1], *stopped),
        interrupted=interrupted,
        parameters=dict(problem.values),
        wall=dict(zip(OF_STOPS if isinstance(known.wall, Floor) else (), of_wall, strict=False)),
    )


def _at_no_step(found: Sequence[ArrayLike], weights: FloatArray) -> tuple[float, float]:
    """A number and its standard error by the batches of each step, without the bias of the step."""
    values, errors = np.array(found).T
    return float(weights @ values), float(np.linalg.norm(weights * errors))


def _counted(values: Sequence[FloatArray]) -> tuple[float, float]:
    """What batches of the usual step count, and its standard error with half of what three times this step changes."""
    off = np.ptp([each.mean() for each in values]) / 2
    return float(values[0].mean()), math.hypot(standard_error(values[0]), off)


def direct_estimates(plan: Plan, batches: Sequence[PlainBatch]) -> tuple[FloatArray, list[Message]]:
    """Λ(p) by the slope of ln M between t and 2t, its error by the jackknife over batches, how many paths carry it; and
    warnings.
    """
    levels = min(plan.levels, min(batch.slices for batch in batches).bit_length())
    windows = np.array([[batch.slices >> j for j in range(levels)] for batch in batches], dtype=float)[:, :, None]
    log_sums = np.array([batch.log_sums[:levels] for batch in batches])
    total, squares = logsumexp(log_sums, axis=0), logsumexp([batch.log_squares[:levels] for batch in batches], axis=0)
    log_rest = total + np.log(-np.expm1(np.minimum(log_sums - total, -1e-15)))
    effective = np.exp(2 * total - squares)
    share = effective / (windows.sum(axis=0) * plan.paths)
    times = plan.length * 2.0 ** np.arange(levels - 1)[:, None]
    slopes = np.diff(total - np.log(windows.sum(axis=0)), axis=0) / times
    rests = np.diff(log_rest - np.log(windows.sum(axis=0) - windows), axis=1) / times
    estimates, warnings = list[tuple[float, ...]](), list[Message]()
    needed = FEW["direct"] * len(batches) / BATCHES
    for k, p in enumerate(plan.p):
        usable = np.flatnonzero((share[1:, k] >= _KEPT) & (effective[1:, k] >= needed))
        j = int(usable[-1]) if usable.size else 0
        found = _jackknife(slopes[j, k], rests[:, j, k])
        estimates.append((*found, effective[j + 1, k]))
        if j > 0:
            change, uncertainty = _jackknife(slopes[j, k] - slopes[j - 1, k], rests[:, j, k] - rests[:, j - 1, k])
            warnings += _drift(plan, p, change, uncertainty)
    return np.array(estimates).reshape(-1, 3), warnings


def population_estimates(plan: Plan, populations: Sequence[Population]) -> tuple[FloatArray, list[Message]]:
    """Λ(p) by the mean growth of ln Z, corrected by half its variance, its error by batches; the rest as above.

    Every second batch has started far away, see `Population`. Where the two kinds disagree the moment has two places;
    each batch then gives the growth of one of them, which is a lower bound, and the larger growth counts.
    """
    count = min(each.slices for each in populations)
    found = np.array([each.found[:, :count] for each in populations]).reshape(-1, plan.p.size, 2, count)
    mean, effective = np.moveaxis(found.mean(axis=-1), -1, 0)
    off = found[..., 0, :] - mean[..., None]
    variance, covariance = np.mean(off**2, axis=-1), np.sum(off[..., 1:] * off[..., :-1], axis=-1) / (count - 1)
    lost = count / max(count - 3, 1)  # as all three are around a mean of the same slices
    growth = (mean + lost * np.maximum(0.5 * variance + covariance, 0)) / plan.length
    trends = off @ (np.arange(count) - (count - 1) / 2) / count
    estimates, warnings = list[tuple[float, ...]](), list[Message]()
    for k, p in enumerate(plan.p):
        used = slice(None)
        near, far = growth[::2, k], growth[1::2, k]
        gap, gap_error = float(far.mean() - near.mean()), math.hypot(standard_error(near), standard_error(far))
        if abs(gap) > DRIFT * gap_error > 0:
            used = slice(int(gap > 0), None, 2)
            warnings.append(Message(Code.TWO_PLACES, p=p, gap=abs(gap), size=abs(gap) / gap_error))
        estimates.append((growth[used, k].mean(), standard_error(growth[used, k]), np.sum(effective[used, k])))
        warnings += _drift(plan, p, float(trends[used, k].mean()), standard_error(trends[used, k]))
    return np.array(estimates).reshape(-1, 3), warnings


def _missing(estimates: Sequence[MomentEstimate]) -> Iterator[Message]:
    """Why some p have no estimate, in one warning for each estimator."""
    for estimator, needed in FEW.items():
        if few := [each for each in estimates if each.value is None and each.estimator == estimator]:
            low, high = (pick(each.effective_paths for each in few) for pick in (min, max))
            found = {"p": [each.p for each in few], "low": low, "high": None if low == high else high}
            yield Message(Code.FEW_PATHS, **found, needed=needed, is_direct=estimator == "direct")


def _drift(plan: Plan, p: float, change: float, error: float) -> list[Message]:
    """That Λ(p) changes over the simulation, if it does."""
    if abs(p) < _TINY or not abs(change) > DRIFT * error > 0:
        return []
    is_direct = plan.estimator == "direct"
    return [Message(Code.DRIFTING, p=p, size=abs(change) / error, most=DRIFT, is_direct=is_direct)]


def _jackknife(value: float, rests: FloatArray) -> tuple[float, float]:
    """A statistic of all batches, freed of its bias of first order, and its standard error, from those without one."""
    count, mean = rests.size, rests.mean()
    error = math.sqrt((count - 1) / count * np.sum((rests - mean) ** 2))
    return float(count * value - (count - 1) * mean), float(error)
