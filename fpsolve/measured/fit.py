"""Noises whose spectral densities are those that were measured.

A value Ŝᵢ that is the mean of nᵢ independent periodograms has the density of a gamma variable with the mean Sᵢ and the
relative standard error 1/√nᵢ. The likelihood takes the values as independent. The deviance

    D(θ) = 2 Σ wᵢ nᵢ (Ŝᵢ/Sᵢ(θ) − 1 − ln Ŝᵢ/Sᵢ(θ))

has the weights wᵢ: larger near the frequencies that matter, so that a wrong family is right there. With the rows
gᵢ = ∂ ln Sᵢ/∂θ the estimate has the covariance A⁻¹BA⁻¹, A = Σ wᵢnᵢ gᵢgᵢᵀ and B = Σ wᵢ²nᵢ gᵢgᵢᵀ for independent values.

Sᵢ(θ) of a record is the mean of its estimate: the transform of w⋆w(t) C(t), C the autocovariance of ξ and w the window.
So it has neither the bias of aliases nor that of leakage. There B has the correlation of neighbouring frequencies too.
Of bounded noise, which is not Gaussian, B is that of segments of simulated records of the fitted noise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.optimize import least_squares, nnls

from fpsolve.arrays import FloatArray, shown
from fpsolve.measured.kinds import KINDS, Kind
from fpsolve.measured.spectrum import MOST_AVERAGES, Record, Spectrum, bracketed, gaps, welch_variance
from fpsolve.measured.weak import Where, frequencies_that_matter
from fpsolve.messages import Code, Message
from fpsolve.model import Noise, Noises

FLOOR, WIDTH = 0.02, 0.3
"""The weight far from the frequencies that matter, and how far in ln ω the weight has fallen by half."""
NAMES = ("first", "second")
"""Of the noises of a sum."""
MOST_TERMS = len(NAMES)
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
MOST_STEPS, MORE_STEPS = 100, 2000
"""Evaluations of a search, and of one that goes on where this did not suffice."""
MISFIT, SHARE = 3.0, 0.02
"""Standard errors, and a share, by which a fit may be off where it matters before that is said."""
EXACT = 1e-3
"""The share by which it may be off without a standard error before it is made to pass there."""
MEDIAN = 2.73
"""Of the squares of second differences of independent normal numbers, over their variance."""
PASSING = 100.0
"""How much more than all other values together a density counts that a fit must have."""


class Misfit(NamedTuple):
    """The measured over the fitted density near a frequency that matters.

    Attributes:
        name: "2ω", or another.
        omega: in rad/time.
        relative: measured/fitted − 1, both as lines through the nearest values have them at ω.
        error: its standard error; where those of the values are not known, by how far these are from their neighbours.
    """

    name: str
    omega: float
    relative: float
    error: float


@dataclass(frozen=True, eq=False)
class NoiseFit:
    """A noise that was fitted.

    Attributes:
        parts: the independent noises whose sum ξ is.
        parameters: the values that were fitted, by the keys below "noise." of a `Problem`: "alpha", or "first.alpha".
        errors: their standard errors, by the same keys.
        covariance: in the order of the keys, shape (k, k).
        misfit: at each frequency that matters.
        spectrum: what was measured, or is made of the record.
        messages: what is to be said of the fit.
    """

    parts: tuple[Noise, ...]
    parameters: Mapping[str, float]
    covariance: FloatArray
    misfit: tuple[Misfit, ...]
    spectrum: Spectrum
    messages: tuple[Message, ...] = ()

    @property
    def errors(self) -> Mapping[str, float]:
        variances = np.maximum(np.diag(self.covariance), 0.0)
        return dict(zip(self.parameters, np.sqrt(variances).tolist(), strict=True))

    @cached_property
    def noise(self) -> Noise:
        """The noise for a `Problem`; a sum has the names "first" and "second"."""
        return self.parts[0] if len(self.parts) == 1 else Noises(tuple(zip(NAMES, self.parts, strict=False)))

    def spectral_density(self, omega: float) -> float:
        """S(ω) of the sum."""
        return sum(noise.spectral_density(omega) for noise in self.parts)

    def scaled(self, factor: float) -> NoiseFit:
        """The fit of the signal times a factor, such as `of_relative_stiffness`; its misfits and messages stay."""
        sizes = abs(factor) ** self.powers
        parameters = {key: value * by for (key, value), by in zip(self.parameters.items(), sizes, strict=True)}
        covariance = self.covariance * np.outer(sizes, sizes)
        return replace(self.at(parameters), covariance=covariance, spectrum=self.spectrum.scaled(factor))

    @property
    def powers(self) -> FloatArray:
        """The power of a factor of ξ by which each parameter changes, shape (k,)."""
        known, kinds = {"sigma": 1.0, "s": 1.0, "mu": 1.0, "D0": 2.0}, dict(zip(NAMES, self.parts, strict=False))

        def power(key: str) -> float:
            part, _, name = key.rpartition(".")
            return known[name] if name in kinds[part or NAMES[0]].of_xi else 0.0

        return np.array([power(key) for key in self.parameters])

    @property
    def off(self) -> float:
        """The largest share by which the fit is off where it matters, without what its standard error explains."""
        squares = [each.relative**2 - each.error**2 for each in self.misfit]
        return float(np.sqrt(np.max([0.0, *squares])))  # not a number where one is not

    def at(self, values: Mapping[str, float]) -> NoiseFit:
        """The same with other values of some parameters, by their keys."""
        parameters = {**self.parameters, **values}
        own = {name: dict[str, float]() for name in NAMES}
        for key, value in parameters.items():
            part, _, name = key.rpartition(".")
            own[part or NAMES[0]][name] = value
        parts = tuple(noise.at(own[name]) for name, noise in zip(NAMES, self.parts, strict=False))
        return replace(self, parts=parts, parameters=parameters)


class _Cut(NamedTuple):
    """Segments of a record that overlap by half: their window, of the length of one, and the step of time."""

    window: FloatArray
    step: float

    @property
    def hop(self) -> int:
        return self.window.size - self.window.size // 2

    @property
    def inside(self) -> slice:
        """Of the frequencies: neither those on which the mean acts nor the highest."""
        return slice(2, self.window.size // 2)

    @property
    def inflation(self) -> float:
        """n Σw⁴/(Σw²)²: by so much the variance of a sum over frequencies is larger, as neighbours are correlated."""
        return float(self.window.size * np.sum(self.window**4) / np.sum(self.window**2) ** 2)

    def periodograms(self, values: FloatArray) -> FloatArray:
        """Of each segment, one a row."""
        length = self.window.size
        starts = range(0, values.size - length + 1, self.hop)
        rows = [abs(np.fft.rfft(self.window * values[i : i + length])[self.inside]) ** 2 for i in starts]
        return self.step * np.array(rows, dtype=float)


class _Data(NamedTuple):
    """Values, of how many each is the mean, and what `expected` makes of kinds: Sᵢ(θ).

    Of a record `variance` is that of a mean over its square, and `record` how it is cut. Where the errors of values are
    not known, their number follows from how far each is from its neighbours.
    """

    omega: FloatArray
    values: FloatArray
    number: FloatArray
    expected: Callable[[Kind, FloatArray], FloatArray]
    variance: float
    record: _Cut | None


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
        noise_in: "stiffness", for which S(2ω) counts, or "damping", for which S(0) counts as well; of two modes
            S(2ω₁), S(2ω₂), S(ω₁ ± ω₂).
        terms: 1 or 2, how many independent noises of the kind ξ is the sum of.
        segment: of a record the time of a segment; None for the shortest that resolves the frequencies, or a
            thirty-second of the record if that is longer.

    Raises:
        ValueError: an argument is none of these, or nothing was measured near a frequency that matters.
    """
    matter = frequencies_that_matter(frequency, second_frequency, noise_in)
    if kind not in KINDS:
        raise ValueError(f"got kind = {shown(kind)}; must be one of {', '.join(KINDS)}")
    if isinstance(terms, bool) or terms not in range(1, MOST_TERMS + 1):
        raise ValueError(f"got terms = {shown(terms)}; must be a whole number from 1 to {MOST_TERMS}")
    if isinstance(data, Spectrum):
        spectrum, used = data, _of_spectrum(data)
    elif isinstance(data, Record):
        length = _segment(data, segment, matter)
        spectrum, used = data.spectrum(length), _of_record(data, length)
    else:
        raise TypeError(f"got {shown(data)}; must be a Spectrum or a Record")
    _refuse_far(spectrum, matter)
    weights = _weights(used.omega, [*matter.values()], 2 * frequency)
    places, errors = zip(*(_place(at, used) for at in matter.values()), strict=True)

    def best(passed: Sequence[FloatArray]) -> NoiseFit:
        fits = [_fitted(used, [family] * terms, weights, passed) for family in KINDS[kind]]
        # more parameters must lower the deviance by ln n each, as in Bayes' criterion
        families, theta, _, is_stopped = min(
            zip([[family] * terms for family in KINDS[kind]], *zip(*fits, strict=True), strict=True),
            key=lambda each: each[2] + len(each[1]) * math.log(len(used.values)),
        )
        off = np.dot(places, used.values) / np.dot(places, _sum(used, families, theta)) - 1
        misfit = tuple(Misfit(*each) for each in zip(matter, matter.values(), off.tolist(), errors, strict=True))
        found = _told(used, families, theta, weights, misfit, spectrum)
        stopped = (Message(Code.FIT_STOPPED, steps=MORE_STEPS),) if is_stopped else ()
        return replace(found, messages=(*stopped, *found.messages))

    found = best([])
    if not _off(found, EXACT):
        return found
    again = best(places)
    if left := _off(again, SHARE):
        text = "that was measured; take another kind, such as filter, or two terms"
        raise ValueError(f"no {kind} noise found has the density near {left[0].name} {text}")
    size = 0.5 * max(errors) * again.powers * np.array([*again.parameters.values()])
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
    inflation = 1.0 if data.record is None else data.record.inflation
    return weights, math.sqrt(inflation * np.sum(weights**2 / data.number)) if number < MOST_AVERAGES else 0.0


def _segment(record: Record, stated: float | None, matter: Mapping[str, float]) -> int:
    """Samples of a segment, of which at least four resolve the lowest frequency that matters.

    Raises:
        ValueError: the record has too few periods of it, or the stated time is none of a segment.
    """
    n, lowest = record.values.size, min(each for each in matter.values() if each > 0)
    periods = lowest * record.duration / (2 * math.pi)
    if stated is not None:
        if not LEAST_SAMPLES * record.step <= stated <= MOST_SEGMENT * record.duration:
            low, high = LEAST_SAMPLES * record.step, MOST_SEGMENT * record.duration
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
    return max(record.segment_length(), math.ceil(PERIODS / periods * n))


def _refuse_far(spectrum: Spectrum, matter: Mapping[str, float]) -> None:
    omega = spectrum.frequencies
    for name, target in matter.items():
        near = omega[0] <= 0.1 * max(matter.values()) if target == 0 else bracketed(omega, target)
        if not near:
            k = int(np.argmin(abs(omega - target)))
            where, nearest = (f"{each:.4g} rad/time ({each / (2 * math.pi):.4g} cycles)" for each in (target, omega[k]))
            raise ValueError(
                f"nothing was measured near {f'{name} = {where}' if target else '0'}, which stability depends on; the "
                f"nearest point is {nearest}; measure there, or correct the natural frequency or its unit"
            )


def _weights(omega: FloatArray, matter: Sequence[float], scale: float) -> FloatArray:
    """1 at a frequency that matters, and `FLOOR` far from all of them."""
    near = [
        1 / (1 + (omega / (WIDTH * scale)) ** 2) if target == 0 else 1 / (1 + (np.log(omega / target) / WIDTH) ** 2)
        for target in matter
    ]
    return FLOOR + (1 - FLOOR) * np.max(near, axis=0)


def _of_spectrum(data: Spectrum) -> _Data:
    number, omega = np.full_like(data.density, MOST_AVERAGES), data.frequencies
    if data.relative_error is not None:
        number = data.relative_error**-2
    elif not data.is_formula:
        number /= 1 + MOST_AVERAGES * np.median(np.diff(np.log(data.density), 2) ** 2) / MEDIAN
    positive = omega > 0
    return _Data(
        omega[positive],
        data.density[positive],
        number[positive],
        lambda kind, theta: kind.density(omega[positive], theta),
        math.nan,
        None,
    )


def _of_record(record: Record, length: int) -> _Data:
    """Periodograms of segments with Hann's window that overlap by half."""
    window = np.hanning(length + 1)[:-1]
    window /= math.sqrt(float(window @ window))
    cut = _Cut(window, record.step)
    segments = cut.periodograms(record.values)
    omega: FloatArray = np.asarray(2 * math.pi * np.fft.rfftfreq(length, record.step)[cut.inside], dtype=float)
    size = 2 * length
    lags = np.asarray(np.fft.irfft(abs(np.fft.rfft(window, size)) ** 2, size)[:length], dtype=float)
    lags[0] *= 0.5  # as C(0) stands once in 2 Re Σ
    t = np.asarray(record.step * np.arange(length), dtype=float)

    def expected(kind: Kind, theta: FloatArray) -> FloatArray:
        found = (
            2 * record.step * np.fft.rfft(np.multiply(lags, kind.covariance(t, theta), dtype=float)).real[cut.inside]
        )
        return np.asarray(np.maximum(found, 1e-300), dtype=float)

    number, variance = np.full(omega.size, float(len(segments))), welch_variance(record.values.size, length)
    return _Data(omega, segments.mean(axis=0), number, expected, variance, cut)


def _sum(data: _Data, families: Sequence[Kind], theta: FloatArray) -> FloatArray:
    """Σ of Sᵢ of the parts, by the logarithms of all parameters."""
    total, k = np.zeros_like(data.omega), 0
    for family in families:
        total += data.expected(family, np.exp(theta[k : k + len(family.names)]))
        k += len(family.names)
    return total


def _start(data: _Data, families: Sequence[Kind], weights: FloatArray) -> FloatArray:
    """From the sum Σ a² S of candidates with a² ≥ 0 that is nearest, relatively: one candidate more for each part."""
    family = families[0]
    places = np.geomspace(max(data.omega[0], 1e-3 * data.omega[-1]), data.omega[-1], 40)
    widths = (1.0,) if len(family.names) == 2 else (0.02, 0.06, 0.2, 0.7, 2.0)
    candidates = [np.array(family.start(place, width), dtype=float) for place in places for width in widths]
    firsts = [int(block[0]) for block in np.array_split(np.arange(data.omega.size), min(data.omega.size, 400))]

    def sums(each: FloatArray) -> FloatArray:
        return np.asarray(np.add.reduceat(weights * each, firsts), dtype=float)

    def mean(each: FloatArray) -> FloatArray:
        return sums(each) / sums(np.ones_like(each))

    root = np.sqrt(sums(data.number))
    measured = mean(data.values)
    columns = np.array([mean(data.expected(family, each)) for each in candidates]).T
    scaled = columns / measured[:, None] * root[:, None]
    chosen: list[int] = []
    for _ in families:
        left = [nnls(scaled[:, [*chosen, i]], root)[1] for i in range(len(candidates))]
        chosen.append(int(np.argmin(left)))
    sizes, _ = nnls(scaled[:, chosen], root)
    found = []
    for i, size in zip(chosen, np.maximum(sizes, 1e-3 * max(sizes)), strict=True):
        theta = candidates[i].copy()
        theta[family.amplitude] *= math.sqrt(size)
        found.append(np.log(theta))
    return np.concatenate(found)


def _fitted(
    data: _Data, families: Sequence[Kind], weights: FloatArray, passed: Sequence[FloatArray]
) -> tuple[FloatArray, float, bool]:
    """ln θ where the deviance is least, the deviance, and whether the search was stopped before its end.

    Args:
        passed: weights with which the means of Ŝ and of S(θ) must be the same.
    """
    size = np.sqrt(2 * weights * data.number)
    large = PASSING * float(np.linalg.norm(size))

    def residuals(theta: FloatArray) -> FloatArray:
        fitted = _sum(data, families, theta)
        bounded = np.clip(np.log(data.values) - np.log(fitted), -100, 100)
        there = [large * math.log((each @ data.values) / (each @ fitted)) for each in passed]
        return np.array([*np.sign(bounded) * size * np.sqrt(np.maximum(np.expm1(bounded) - bounded, 0)), *there])

    starts = [_start(data, families, weights)]
    if len(families) > 1:  # one part more beside the best sum of fewer, which halves a part of it in two places
        fewer, _, _ = _fitted(data, families[1:], weights, passed)
        first = fewer[: len(families[0].names)]
        shift = np.zeros_like(first)
        shift[0 if families[0].amplitude else 1] = 1.0
        half = np.zeros_like(first)
        half[families[0].amplitude] = 0.5 * math.log(2)
        starts.append(np.concatenate([first - half - shift, first - half + shift, fewer[first.size :]]))
    highest = np.concatenate([family.highest for family in families])
    found = []
    for start in (np.minimum(each, highest) for each in starts):
        bounds = (start - 15, np.minimum(start + 15, highest))
        each = least_squares(residuals, start, bounds=bounds, ftol=1e-10, xtol=1e-8, max_nfev=MOST_STEPS)
        if not each.status:  # it was stopped
            each = least_squares(residuals, each.x, bounds=bounds, ftol=1e-10, xtol=1e-8, max_nfev=MORE_STEPS)
        found.append(each)
    best = min(found, key=lambda each: each.cost)
    return best.x, 2 * best.cost, not best.status


def _slopes(data: _Data, families: Sequence[Kind], theta: FloatArray) -> FloatArray:
    """∂ ln Sᵢ/∂ ln θ by central differences, shape (n, k)."""
    h = 1e-5
    columns = [
        (np.log(_sum(data, families, theta + h * unit)) - np.log(_sum(data, families, theta - h * unit))) / (2 * h)
        for unit in np.eye(len(theta))
    ]
    return np.array(columns).T


def _told(
    data: _Data,
    families: Sequence[Kind],
    theta: FloatArray,
    weights: FloatArray,
    misfit: tuple[Misfit, ...],
    spectrum: Spectrum,
) -> NoiseFit:
    slopes = _slopes(data, families, theta)
    slopes[:, theta > np.concatenate([family.highest for family in families]) - AT_END] = 0.0  # fixed there
    information = slopes.T @ (slopes * (weights * data.number)[:, None])
    bread = np.linalg.pinv(information, rcond=UNTOLD, hermitian=True)
    if data.record is not None and any(family.path for family in families):
        meat = _simulated(data, data.record, families, theta, _sum(data, families, theta), weights[:, None] * slopes)
    elif data.record is None:
        meat = slopes.T @ (slopes * (weights**2 * data.number)[:, None])
    else:
        # Hann's window correlates neighbours: of a Gaussian noise by 4/9, and by 1/36 at two steps
        rows = slopes * (weights * data.number * math.sqrt(data.variance))[:, None]
        meat = rows.T @ rows
        for lag, share in ((1, 4 / 9), (2, 1 / 36)):
            meat += share * (rows[lag:].T @ rows[:-lag] + rows[:-lag].T @ rows[lag:])
    values = np.exp(theta)
    covariance = bread @ meat @ bread * np.outer(values, values) * (not spectrum.is_formula)
    parts, keys, place = [], list[str](), 0
    for name, family in zip(NAMES, families, strict=False):
        own = values[place : place + len(family.names)]
        parts.append(family.make(*own.tolist()))
        keys += [f"{name}.{each}" if len(families) > 1 else each for each in family.names]
        place += len(family.names)
    messages = [Message(Code.SPECTRUM_GAP, low=low, high=high) for low, high in gaps(spectrum)]
    if spectrum.relative_error is None and not spectrum.is_formula:
        messages.append(Message(Code.NO_SPECTRUM_ERROR))
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    if np.linalg.eigvalsh(information / np.outer(size, size))[0] < UNTOLD:
        messages.append(Message(Code.UNTOLD_PARAMETERS))
    return NoiseFit(
        parts=tuple(parts),
        parameters=dict(zip(keys, values.tolist(), strict=True)),
        covariance=covariance,
        misfit=misfit,
        spectrum=spectrum,
        messages=tuple(messages),
    )


def _simulated(
    data: _Data, cut: _Cut, families: Sequence[Kind], theta: FloatArray, fitted: FloatArray, rows: FloatArray
) -> FloatArray:
    """The covariance of the sum of the scores of all segments, by segments of paths of the fitted noise.

    Args:
        data, cut: of the record.
        families: of the parts, none of which is Gaussian.
        theta: the logarithms of their parameters.
        fitted: Sᵢ(θ).
        rows: wᵢgᵢ, shape (n, k).
    """
    rng, measured = np.random.default_rng(0), int(data.number[0])
    block = min(measured, BLOCK)
    n = cut.window.size + (block - 1) * cut.hop
    blocks = math.ceil(min(SEGMENTS, max(LEAST_SEGMENTS, SAMPLES / cut.hop)) / block)
    sums = np.zeros((min(block, LAGS + 1), theta.size, theta.size))
    for _ in range(blocks):
        values, k = np.zeros(n), 0
        for family in families:
            assert family.path is not None  # the parts are of one kind
            values += family.path(np.exp(theta[k : k + len(family.names)]), cut.step, n, rng)
            k += len(family.names)
        scores = (cut.periodograms(values) / fitted - 1) @ rows
        for lag, each in enumerate(sums):
            each += scores[lag:].T @ scores[: block - lag] * (measured - lag) / (block - lag) / blocks
    meat: FloatArray = sums[0] + sum(each + each.T for each in sums[1:])
    return meat
