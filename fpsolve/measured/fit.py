"""Noises whose spectral densities are those that were measured.

A value Ŝᵢ that is the mean of nᵢ independent periodograms has the density of a gamma variable with the mean Sᵢ and the
relative standard error 1/√nᵢ. The likelihood takes the values as independent. The deviance

    D(θ) = 2 Σ wᵢ nᵢ (Ŝᵢ/Sᵢ(θ) − 1 − ln Ŝᵢ/Sᵢ(θ))

has the weights wᵢ: larger near the frequencies that matter, so that a wrong family is right there. With the rows
gᵢ = ∂ ln Sᵢ/∂θ the estimate has the covariance A⁻¹BA⁻¹, A = Σ wᵢnᵢ gᵢgᵢᵀ and B = Σ wᵢ²nᵢ gᵢgᵢᵀ for independent values.

Sᵢ(θ) of a record is the mean of its estimate: the transform of w⋆w(t) C(t), C the autocovariance of ξ and w the window.
So it has neither the bias of aliases nor that of leakage. There B has the correlation of neighbouring frequencies too.
Of bounded noise, which is not Gaussian, B is that of segments of simulated records of the fitted noise.

Noise of Eq. (7) with bounded tails is fitted to a record by its moments and its quadratic variation.

With b = 1 − r₀ > 0 the stationary density (9) is that of (1 − ξ²/h²)^(1/b), with

    kurtosis κ = 3(2a + 3)/(2a + 5), a = 1/b,   so that a = (5κ − 9)/(2(3 − κ)),   r₀ = 1 − 1/a,
    variance V = 2(D₀/τ₀)/(5 − 3r₀),   and E(dξ)² = 2D₀/τ₀² dt, the quadratic variation.

τ₀ is D₀/τ₀ over D₀/τ₀². Of a record with the step Δ, q(Δ) = E(ξ(t + Δ) − ξ(t))²/(2Δ) is D₀/τ₀² + O(Δ), and
(8q(Δ) − 6q(2Δ) + q(4Δ))/3 is it up to O(Δ³). What a sensor adds to the record as noise of its own spoils this.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.ndimage import correlate1d
from scipy.optimize import least_squares, nnls

from fpsolve.arrays import FloatArray, is_whole, shown
from fpsolve.measured.kinds import KINDS, Kind, Values
from fpsolve.measured.spectrum import MOST_AVERAGES, Record, Segments, Spectrum
from fpsolve.measured.weak import Where, checked_choice, frequencies_that_matter
from fpsolve.messages import Code, Message
from fpsolve.model import Noise, NonGaussianNoise
from fpsolve.model.noises.several import noises_of

FLOOR, WIDTH = 0.02, 0.3
"""The weight far from the frequencies that matter, and how far in ln ω the weight has fallen by half."""
NAMES = ("first", "second")
"""Of the noises of a sum."""
OF_HANN = 1 / 36, 4 / 9, 1.0, 4 / 9, 1 / 36
"""The correlation of a periodogram of Gaussian noise with those at neighbouring frequencies, by Hann's window."""
AT_END = 1e-4
"""Below the logarithm of its largest value a parameter counts as fixed there."""
UNTOLD = 1e-8
"""Of the information of scaled parameters: a smaller eigenvalue is of a direction that the values do not tell."""
SEGMENTS, LEAST_SEGMENTS, SAMPLES, BLOCK = 2000, 200, 2e7, 63
"""How many segments are simulated for standard errors: fewer of long ones, for some samples in all; in such blocks."""
LAGS = 3
"""How many steps apart segments count as correlated."""
PERIODS = 8
"""Of the lowest frequency that matters in each segment of a record, so that a segment resolves it to an eighth."""
MOST_SEGMENT = 0.4
"""Share of a record that a segment has at most, so that there are four that overlap by half."""
LEAST_SAMPLES = 16
"""In a segment."""
MOST_STEPS = 2000
"""Evaluations of a search."""
MISFIT, SHARE = 3.0, 0.02
"""Standard errors, and a share, by which a fit may be off where it matters before that is said."""
EXACT = 1e-3
"""The share by which it may be off without a standard error before it is made to pass there."""
MEDIAN = 2.73
"""Of the squares of second differences of independent normal numbers, over their variance."""
PASSING = 100.0
"""How much more than all other values together a density counts that a fit must have."""
BLOCKS = 40
"""Of a record, whose means tell the errors of moments."""
LEAST_TIMES = 20 * BLOCKS
LONGEST_STEP = 0.3
"""Of V/(D₀/τ₀²), after which C = V has fallen by its first slope: D₀/τ₀² is then wrong by a third of its cube."""


class Misfit(NamedTuple):
    """The measured over the fitted density near a frequency that matters.

    Attributes:
        name: "2ω", or another.
        relative: measured/fitted − 1, both as lines through the nearest values have them at ω.
        error: its standard error; where those of the values are not known, by how far these are from their neighbours.
    """

    name: str
    relative: float
    error: float


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """A noise that was fitted.

    Attributes:
        parts: the independent noises whose sum ξ is.
        names: of the parameters of each part that were fitted, such as "alpha".
        parameters: their values by the keys below "noise." of a `Problem`: "alpha", or "first.alpha".
        errors: their standard errors, by the same keys.
        covariance: in the order of the keys, shape (k, k).
        misfit: at each frequency that matters.
        spectrum: what was measured, or is made of the record.
        messages: what is to be said of the fit.
    """

    parts: tuple[Noise, ...]
    names: tuple[str, ...]
    covariance: FloatArray
    misfit: tuple[Misfit, ...]
    spectrum: Spectrum
    messages: tuple[Message, ...] = ()

    @property
    def parameters(self) -> Mapping[str, float]:
        parts = zip([f"{name}." for name in NAMES] if len(self.parts) > 1 else [""], self.parts, strict=True)
        return {prefix + name: float(noise.values[name]) for prefix, noise in parts for name in self.names}

    @property
    def values(self) -> FloatArray:
        """Those of the parameters, shape (k,)."""
        return np.array([*self.parameters.values()])

    @property
    def errors(self) -> Mapping[str, float]:
        found = np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).tolist()
        return dict(zip(self.parameters, found, strict=True))

    @cached_property
    def noise(self) -> Noise:
        """The noise for a `Problem`; a sum has the names "first" and "second"."""
        return noises_of(dict(zip(NAMES, self.parts, strict=False)))

    def spectral_density(self, omega: float) -> float:
        """S(ω) of the sum."""
        return sum(noise.spectral_density(omega) for noise in self.parts)

    def scaled(self, factor: float) -> NoiseFit:
        """The fit of the signal times a factor, such as ω²; its misfits and messages stay."""
        sizes = abs(factor) ** self.powers
        covariance = self.covariance * np.outer(sizes, sizes)
        return replace(self.at(self.values * sizes), covariance=covariance, spectrum=self.spectrum.scaled(factor))

    @property
    def powers(self) -> FloatArray:
        """The power of a factor of ξ by which each parameter changes, shape (k,)."""
        sizes = [{"D0": 2.0}.get(name, 1.0) * (name in self.parts[0].of_xi) for name in self.names]
        return np.array(sizes * len(self.parts))

    @property
    def off(self) -> float:
        """The largest share by which the fit is off where it matters, without what its standard error explains."""
        squares = [each.relative**2 - each.error**2 for each in self.misfit]
        return float(np.sqrt(np.max([0.0, *squares])))  # not a number where one is not

    def at(self, values: FloatArray) -> NoiseFit:
        """The same with other values of the parameters, in the order of their keys, shape (k,)."""
        rows = values.reshape(len(self.parts), -1).tolist()
        parts = [noise.at(dict(zip(self.names, row, strict=True))) for noise, row in zip(self.parts, rows, strict=True)]
        return replace(self, parts=tuple(parts))


class _Data(NamedTuple):
    """What is fitted.

    Attributes:
        spectrum: of which all but ω = 0 counts.
        omega: ω > 0, shape (n,).
        values: Ŝᵢ, shape (n,).
        number: of how many periodograms each is the mean; where errors of values are not known, it follows from how far
            each is from its neighbours.
        error: the relative standard error of each.
        expected: Sᵢ of one noise by its kind and parameters.
        correlation: of a value with its neighbours and itself.
        segments: of a record.
        weights: wᵢ, shape (n,).
    """

    spectrum: Spectrum
    omega: FloatArray
    values: FloatArray
    number: FloatArray
    error: FloatArray
    expected: Callable[[Kind, Values], FloatArray]
    correlation: Sequence[float] = (1.0,)
    segments: Segments | None = None
    weights: FloatArray = np.ones(1)

    def sum(self, kind: Kind, fitted: FloatArray) -> FloatArray:
        """Sᵢ of several noises of a kind, by all parameters that are fitted."""
        return np.sum([self.expected(kind, each) for each in kind.values(fitted)], axis=0)


class _Found(NamedTuple):
    """The parameters of noises of a kind where the deviance is least; whether the search was stopped before its end."""

    kind: Kind
    values: FloatArray
    deviance: float
    is_stopped: bool


def fit_noise(
    data: Spectrum | Record,
    kind: str = "ornstein-uhlenbeck",
    *,
    frequency: float,
    second_frequency: float | None = None,
    noise_in: Where = "stiffness",
    terms: int = 1,
    segment: float | None = None,
) -> NoiseFit:
    """The noise of a kind whose spectral density is nearest to a measured one, most of all where it matters.

    Args:
        data: a spectrum, or a record.
        kind: "ornstein-uhlenbeck", "filter", which chooses ξ = y, y′ or y + c₁y′, or "bounded".
        frequency: natural frequency ω, in rad/time.
        second_frequency: of a second mode, in rad/time.
        noise_in: "stiffness", where S(2ω) counts, or "damping", where S(0) counts as well. Of two modes S(2ω₁), S(2ω₂)
            and S(ω₁ ± ω₂) count.
        terms: 1 or 2, how many independent noises of the kind ξ is the sum of.
        segment: time of a segment of a record. None is the shortest that resolves the frequencies, or 1/32 of the
            record if longer.

    Raises:
        ValueError: an argument is none of these, or nothing was measured near a frequency that matters.
    """
    matter = frequencies_that_matter(frequency, second_frequency, noise_in)
    kinds = KINDS[checked_choice("kind", kind, KINDS)]
    if not is_whole(terms, 1, len(NAMES)):
        raise ValueError(f"got terms = {shown(terms)}; must be a whole number from 1 to {len(NAMES)}")
    if isinstance(data, Spectrum):
        used = _of_spectrum(data)
    elif isinstance(data, Record):
        used = _of_record(data, _segment(data, segment, matter))
    else:
        raise TypeError(f"got {shown(data)}; must be a Spectrum or a Record")
    _refuse_far(used.spectrum.frequencies, matter)
    # 1 at a frequency that matters, and FLOOR far from all of them
    away = [abs(np.log(used.omega / each)) if each else used.omega / (2 * frequency) for each in matter.values()]
    used = used._replace(weights=FLOOR + (1 - FLOOR) / (1 + (np.min(away, axis=0) / WIDTH) ** 2))
    places, errors = zip(*(_place(at, used) for at in matter.values()), strict=True)

    def best(passed: Sequence[FloatArray]) -> NoiseFit:
        fits = [_fitted(used, each, terms, passed) for each in kinds]
        # more parameters must lower the deviance by ln n each, as in Bayes' criterion
        found = min(fits, key=lambda each: each.deviance + len(each.values) * math.log(len(used.values)))
        off = np.dot(places, used.values) / np.dot(places, used.sum(found.kind, found.values)) - 1
        misfit = tuple(map(Misfit, matter, off.tolist(), errors))
        return _told(used, found, misfit)

    found = best([])
    if not _off(found, EXACT):
        return found
    again = best(places)
    if left := _off(again, SHARE):
        raise ValueError(
            f"no {kind} noise found has the density near {left[0].name} that was measured; take another kind, such as "
            "filter, or two terms"
        )
    size = 0.5 * max(errors) * again.powers * again.values
    told = [Message(Code.NOISE_MISFIT, name=each.name, relative=each.relative) for each in _off(found, SHARE)]
    return replace(again, covariance=again.covariance + np.outer(size, size), messages=(*told, *again.messages))


def _off(fit: NoiseFit, share: float) -> list[Misfit]:
    """Where a fit is off by more than its error, and a share."""
    return [each for each in fit.misfit if abs(each.relative) > max(MISFIT * each.error, share)]


def _place(at: float, data: _Data) -> tuple[FloatArray, float]:
    """The weights of values that tell S(ω), those of a line through the nearest at ω, and its relative standard error.

    There are as many as the error needs, within 10 % of ω, or five, and on a line but for their scatter; else two. At 0
    it is their mean, as S is flat there.
    """
    distance = abs(data.omega - at)
    order = np.argsort(distance)
    number = data.number[order[0]]
    count = min(math.ceil(1 / (number * SHARE**2)), max(int(np.sum(distance <= 0.1 * at)), 5))
    while True:
        near = order[: max(count, 2)]
        line = np.vander((data.omega[near] - at) / distance[near[-1]], 1 + (at > 0))
        inverse, values = np.linalg.pinv(line), data.values[near] / data.values[near].mean()
        off, free = values - line @ (inverse @ values), near.size - line.shape[1]
        if count <= 2 or number * off @ off <= free + math.sqrt(8 * free):  # two standard deviations, or more
            break
        count = 2 * count // 3
    weights = np.zeros_like(data.omega)
    weights[near] = np.maximum(inverse[-1], 0)
    variance = sum(data.correlation) * float(np.sum(weights**2 / data.number))
    return weights, math.sqrt(variance) if number < MOST_AVERAGES else 0.0


def _segment(record: Record, stated: float | None, matter: Mapping[str, float]) -> int:
    """Samples of a segment, of which at least four resolve the lowest frequency that matters.

    Raises:
        ValueError: the record has too few periods of it, or the stated time is none of a segment.
    """
    n, lowest = record.values.size, min(each for each in matter.values() if each > 0)
    periods = lowest * record.duration / (2 * math.pi)
    if stated is not None:
        low, high = LEAST_SAMPLES * record.step, MOST_SEGMENT * record.duration
        if not low <= stated <= high:
            raise ValueError(
                f"got segment = {stated:g}; must be from {low:.4g} to {high:.4g}, in the unit of its times"
            )
        return int(stated / record.step)
    if periods * MOST_SEGMENT < PERIODS:
        raise ValueError(
            f"the record has {periods:.3g} periods of the frequency {lowest:.4g} rad/time, and must have "
            f"{PERIODS / MOST_SEGMENT:g}; "
            "record for longer, or correct the natural frequency, its unit, or --rate"
        )
    return max(record.usual_segment, math.ceil(PERIODS / periods * n))


def _refuse_far(omega: FloatArray, matter: Mapping[str, float]) -> None:
    """Raise `ValueError` where a frequency that matters is not between two neighbours a quarter of it apart."""
    for name, target in matter.items():
        low, high = omega[omega <= target * (1 + 1e-9)], omega[omega >= target * (1 - 1e-9)]
        near = min(high, default=math.inf) - max(low, default=-math.inf) <= 0.25 * target
        if not (near if target else omega[0] <= 0.1 * max(matter.values())):
            where = f"{name} = {target:.4g} rad/time ({target / (2 * math.pi):.4g} cycles)" if target else "0"
            told = f"nothing was measured near {where}, which stability depends on"
            raise ValueError(f"{told}; measure there, or correct the natural frequency or its unit")


def _of_spectrum(data: Spectrum) -> _Data:
    omega, density, error = data.frequencies, data.density, data.relative_error
    if error is None:
        scatter = 0.0 if data.is_formula else float(np.median(np.diff(np.log(density), 2) ** 2)) / MEDIAN
        error = np.full_like(density, math.sqrt(1 / MOST_AVERAGES + scatter))
    kept = omega > 0
    omega, error = omega[kept], error[kept]
    return _Data(data, omega, density[kept], error**-2, error, lambda kind, values: kind.density(omega, **values))


def _of_record(record: Record, length: int) -> _Data:
    """Its spectrum by segments of a length."""
    spectrum, segments, size = record.spectrum(length), Segments(length, record.step), 2 * length
    lags = np.fft.irfft(abs(np.fft.rfft(segments.window, size)) ** 2, size)[:length]
    lags *= 2 * record.step
    lags[0] *= 0.5  # as C(0) stands once in 2 Re Σ
    t = record.step * np.arange(length)

    def expected(kind: Kind, values: Values) -> FloatArray:
        return np.maximum(np.fft.rfft(lags * kind.covariance(t, **values)).real[segments.inside], 1e-300)

    number = 1.0 + (record.values.size - length) // segments.hop
    omega, error = spectrum.frequencies, np.asarray(spectrum.relative_error, dtype=float)
    return _Data(spectrum, omega, spectrum.density, np.full_like(omega, number), error, expected, OF_HANN, segments)


def _start(data: _Data, kind: Kind, terms: int) -> FloatArray:
    """The logarithms of the parameters of the sum Σ a² S of candidates with a² ≥ 0 that is nearest, relatively.

    Each noise adds the candidate that leaves least.
    """
    places = np.geomspace(max(data.omega[0], 1e-3 * data.omega[-1]), data.omega[-1], 40)
    candidates = np.array([kind.start(place, width) for place in places for width in (0.02, 0.06, 0.2, 0.7, 2.0)])
    n = data.omega.size
    firsts = np.linspace(0, n, min(n, 400), endpoint=False).astype(int)

    def sums(each: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(data.weights * each, firsts), dtype=float)

    root, measured = np.sqrt(sums(data.number)), sums(data.values)
    scaled = np.array([sums(data.sum(kind, each)) / measured * root for each in candidates]).T
    chosen: list[int] = []
    for _ in range(terms):
        left = [nnls(scaled[:, [*chosen, i]], root)[1] for i in range(len(candidates))]
        chosen.append(int(np.argmin(left)))
    sizes, _ = nnls(scaled[:, chosen], root)
    sizes = np.maximum(sizes, 1e-3 * max(sizes))
    return np.ravel(np.log(candidates[chosen]) + 0.5 * np.outer(np.log(sizes), kind.multiplies))


def _fitted(data: _Data, kind: Kind, terms: int, passed: Sequence[FloatArray]) -> _Found:
    """The noises of a kind for which the deviance is least.

    Args:
        passed: weights with which the means of Ŝ and of S(θ) must be the same.
    """
    size = np.sqrt(2 * data.weights * data.number)
    large = PASSING * float(np.linalg.norm(size))

    def residuals(theta: FloatArray) -> FloatArray:
        fitted = data.sum(kind, np.exp(theta))
        bounded = np.clip(np.log(data.values) - np.log(fitted), -100, 100)
        there = [large * math.log((each @ data.values) / (each @ fitted)) for each in passed]
        return np.append(np.sign(bounded) * size * np.sqrt(np.maximum(np.expm1(bounded) - bounded, 0)), there)

    starts = [_start(data, kind, terms)]
    if terms > 1:  # the best one, a half of it on either side
        one, k = np.log(_fitted(data, kind, 1, passed).values), len(kind.names)
        half, place = one - 0.5 * math.log(2) * kind.multiplies, np.eye(k)[np.argmin(kind.multiplies)]
        starts.append(np.concatenate([half - place, half + place]))
    highest = np.tile(kind.highest, terms)
    found = []
    for start in (np.minimum(each, highest) for each in starts):
        bounds = (start - 15, np.minimum(start + 15, highest))
        found.append(least_squares(residuals, start, bounds=bounds, ftol=1e-10, xtol=1e-8, max_nfev=MOST_STEPS))
    best = min(found, key=lambda each: each.cost)
    return _Found(kind, np.exp(best.x), 2 * best.cost, not best.status)


def slopes_of(f: Callable[[FloatArray], FloatArray], x: FloatArray) -> FloatArray:
    """∂f/∂ ln xₖ by central differences, shape (n, k).

    Args:
        f: of all x, to shape (n,).
        x: positive, shape (k,).
    """
    steps = 1e-5 * np.eye(len(x))
    return np.array([(f(x * (1 + step)) - f(x * (1 - step))) / 2e-5 for step in steps]).T


def _told(data: _Data, found: _Found, misfit: tuple[Misfit, ...]) -> NoiseFit:
    kind, values, spectrum = found.kind, found.values, data.spectrum
    parts = tuple(kind.noise.at(each) for each in kind.values(values))
    slopes = slopes_of(lambda each: np.log(data.sum(kind, each)), values)
    slopes[:, np.log(values) > np.tile(kind.highest, len(parts)) - AT_END] = 0.0  # fixed there
    weighted = slopes * (data.weights * data.number)[:, None]
    information = slopes.T @ weighted
    bread = np.linalg.pinv(information, rcond=UNTOLD, hermitian=True)
    if data.segments and kind.path:
        meat = _simulated(data, data.segments, found, slopes)
    else:
        rows = weighted * data.error[:, None]
        meat = rows.T @ correlate1d(rows, data.correlation, axis=0, mode="constant")
    covariance = bread @ meat @ bread * np.outer(values, values) * (not spectrum.is_formula)
    messages = [Message(Code.FIT_STOPPED, steps=MOST_STEPS)] * found.is_stopped
    if spectrum.relative_error is None and not spectrum.is_formula:
        messages.append(Message(Code.NO_SPECTRUM_ERROR))
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    if np.linalg.eigvalsh(information / np.outer(size, size))[0] < UNTOLD:
        messages.append(Message(Code.UNTOLD_PARAMETERS))
    return NoiseFit(parts, kind.names, covariance, misfit, spectrum, tuple(messages))


def _simulated(data: _Data, segments: Segments, found: _Found, slopes: FloatArray) -> FloatArray:
    """The covariance of the sum of the scores of all segments, by segments of paths of the fitted noise.

    Args:
        data, segments: of the record.
        found: noises that are not Gaussian.
        slopes: gᵢ, shape (n, k).
    """
    kind, fitted, rows = found.kind, data.sum(found.kind, found.values), data.weights[:, None] * slopes
    assert kind.path
    rng, measured = np.random.default_rng(0), int(data.number[0])
    block = min(measured, BLOCK)
    n = segments.length + (block - 1) * segments.hop
    blocks = math.ceil(np.clip(SAMPLES / segments.hop, LEAST_SEGMENTS, SEGMENTS) / block)
    meat = np.zeros((rows.shape[1], rows.shape[1]))
    for _ in range(blocks):
        values = np.sum([kind.path(n, segments.step, rng, **each) for each in kind.values(found.values)], axis=0)
        scores = (segments.periodograms(values) / fitted - 1) @ rows
        for lag in range(min(block, LAGS + 1)):
            product = scores[lag:].T @ scores[: block - lag] * (measured - lag) / (block - lag) / blocks
            meat += product + product.T if lag else product
    return meat


def non_gaussian_from_record(record: Record) -> NoiseFit:
    """`NonGaussianNoise` with r₀ < 1 from a record, with the standard errors of means over 40 blocks of it.

    Raises:
        ValueError: the kurtosis is not that of bounded tails, between 9/5 and 3, or the steps are too long.
    """
    x = record.values
    n = x.size // BLOCKS * BLOCKS
    columns = [x**2, x**4]
    for lag in (1, 2, 4):
        moved = np.pad(x[lag:] - x[:-lag], (0, lag)) ** 2 / (2 * lag * record.step)
        columns.append(moved * x.size / (x.size - lag))
    blocks = np.array(columns)[:, :n].reshape(len(columns), BLOCKS, -1).mean(axis=2).T
    means = blocks.mean(axis=0)
    names, slopes = ("D0", "tau0", "r0"), slopes_of(_parameters, means)
    noise = NonGaussianNoise(**dict(zip(names, _parameters(means).tolist(), strict=True)))
    decay = 2 * noise.tau0 / (5 - 3 * noise.r0)
    if record.step > LONGEST_STEP * decay:
        raise ValueError(
            f"the steps of the record are {record.step:.4g}, too long for its quadratic variation; they must be below "
            f"{LONGEST_STEP * decay:.4g}, {LONGEST_STEP:g} of V/(D0/tau0²); record at a higher rate, or fit "
            "another kind"
        )
    times = record.duration / noise.correlation_time
    messages = (Message(Code.SHORT_RECORD, times=times, least=LEAST_TIMES),) if times < LEAST_TIMES else ()
    covariance = slopes @ np.cov((blocks / means).T) @ slopes.T / BLOCKS
    return NoiseFit((noise,), names, covariance, (), record.spectrum(), messages)


def _parameters(means: FloatArray) -> FloatArray:
    """D₀, τ₀ and r₀ of the means of ξ², ξ⁴, q(Δ), q(2Δ), q(4Δ)."""
    variance, fourth, q1, q2, q4 = means
    kurtosis = fourth / variance**2
    if not 9 / 5 < kurtosis < 3:
        raise ValueError(
            f"the kurtosis of the record is {kurtosis:.4g}; bounded noise of Eq. (7) has one between 1.8 and 3; fit "
            "another kind, such as ornstein-uhlenbeck for 3"
        )
    a = (5 * kurtosis - 9) / (2 * (3 - kurtosis))
    r0 = 1 - 1 / a
    rate = (8 * q1 - 6 * q2 + q4) / 3
    if not rate > 0:
        raise ValueError("the steps of the record are too long for its quadratic variation; record at a higher rate")
    strength = 0.5 * variance * (5 - 3 * r0)
    tau0 = strength / rate
    return np.array([strength * tau0, tau0, r0], dtype=float)
