"""Noises whose spectral densities are those that were measured.

A value Ŝᵢ that is the mean of nᵢ independent periodograms has the density of a gamma variable with the mean Sᵢ and the
relative standard error 1/√nᵢ. Whittle's likelihood takes the values as independent. The deviance

    D(θ) = 2 Σ wᵢ nᵢ (Ŝᵢ/Sᵢ(θ) − 1 − ln Ŝᵢ/Sᵢ(θ))

has the weights wᵢ: larger near the frequencies that matter, so that a wrong family is right there. With the rows
gᵢ = ∂ ln Sᵢ/∂θ the estimate has the covariance A⁻¹BA⁻¹, A = Σ wᵢnᵢ gᵢgᵢᵀ and B = Σ wᵢ²nᵢ gᵢgᵢᵀ for independent values.

Sᵢ(θ) of a record is the mean of its estimate: the transform of w⋆w(t) C(t), C the autocovariance of ξ and w the window.
So it has neither the bias of aliases nor that of leakage. There B has the correlation of neighbouring frequencies too.
Of bounded noise, which is not Gaussian, it is that of the scores of the segments themselves.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import least_squares, nnls

from fpsolve.arrays import FloatArray, shown
from fpsolve.measured.kinds import KINDS, Kind
from fpsolve.measured.spectrum import Record, Spectrum, bracketed, gaps, welch_variance
from fpsolve.measured.weak import Where, frequencies_that_matter
from fpsolve.messages import Code, Message
from fpsolve.model import Noise, Noises

FLOOR, WIDTH = 0.02, 0.3
"""The weight far from the frequencies that matter, and how far in ln ω the weight has fallen by half."""
NAMES = ("first", "second", "third")
"""Of the noises of a sum."""
MOST_TERMS = len(NAMES)
UNTOLD = 1e-8
"""Of the information of scaled parameters: a smaller eigenvalue is of a direction that the values do not tell."""
MISFIT = 3.0
"""Standard errors by which a fit may be wrong where it matters before that is said."""


class Misfit(NamedTuple):
    """The measured over the fitted density near a frequency that matters.

    Attributes:
        name: "2ω", or another.
        omega: in rad/time.
        relative: measured/fitted − 1, the mean over a band.
        error: its standard error; where those of the values are not known, by how far all of them are from the fit.
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
        method: "spectrum", "whittle" or "moments".
        messages: what is to be said of the fit.
    """

    parts: tuple[Noise, ...]
    parameters: Mapping[str, float]
    covariance: FloatArray
    misfit: tuple[Misfit, ...]
    spectrum: Spectrum
    method: str
    messages: tuple[Message, ...] = ()

    @property
    def errors(self) -> Mapping[str, float]:
        variances = np.maximum(np.diag(self.covariance), 0.0)
        return dict(zip(self.parameters, np.sqrt(variances).tolist(), strict=True))

    @cached_property
    def noise(self) -> Noise:
        """The noise for a `Problem`; a sum has the names "first" and "second".

        Raises:
            ValueError: it is the sum of three, which no problem takes.
        """
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
        return math.sqrt(max([0.0, *squares]))

    def at(self, values: Mapping[str, float]) -> NoiseFit:
        """The same with other values of some parameters, by their keys."""
        parameters = {**self.parameters, **values}
        own = {name: dict[str, float]() for name in NAMES}
        for key, value in parameters.items():
            part, _, name = key.rpartition(".")
            own[part or NAMES[0]][name] = value
        parts = tuple(noise.at(own[name]) for name, noise in zip(NAMES, self.parts, strict=False))
        return replace(self, parts=parts, parameters=parameters)


class _Data(NamedTuple):
    """Values, of how many each is the mean, and what `expected` makes of kinds: Sᵢ(θ).

    Of a record `segments` are the values of each, and `variance` that of a mean over its square.
    """

    omega: FloatArray
    values: FloatArray
    number: FloatArray
    expected: Callable[[Kind, FloatArray], FloatArray]
    segments: FloatArray | None
    variance: float


def fit_noise(
    data: Spectrum | Record,
    kind: str = "ornstein-uhlenbeck",
    *,
    frequency: float,
    second_frequency: float | None = None,
    noise_in: Where = "stiffness",
    terms: int = 1,
    method: Literal["spectrum", "whittle"] = "spectrum",
) -> NoiseFit:
    """The noise of a kind whose spectral density is nearest to a measured one, most of all where it matters.

    Args:
        data: a spectrum, or a record.
        kind: "ornstein-uhlenbeck", "filter", which chooses ξ = y, y′ or y + c₁y′, or "bounded".
        frequency: natural frequency ω, in rad/time.
        second_frequency: of a second mode, in rad/time.
        noise_in: "stiffness", for which S(2ω) counts, or "damping", for which S(0) counts as well; of two modes
            S(2ω₁), S(2ω₂), S(ω₁ ± ω₂).
        terms: 1 to 3, how many independent noises of the kind ξ is the sum of. A `Problem` takes two of them at most.
        method: of a record "spectrum", Welch's estimate, or "whittle", the periodogram of the whole record. With
            "whittle" values are taken as independent, as of a Gaussian noise.

    Standard errors of bounded noise from a record of 250 correlation times are too small, by up to a quarter, as seen
    in `python -m tests.random_fits`; with method = "whittle" that of its amplitude is far too large.

    Raises:
        ValueError: an argument is none of these, or nothing was measured near a frequency that matters.
    """
    matter = frequencies_that_matter(frequency, second_frequency, noise_in)
    if kind not in KINDS:
        raise ValueError(f"got kind = {shown(kind)}; must be one of {', '.join(KINDS)}")
    if isinstance(terms, bool) or terms not in range(1, MOST_TERMS + 1):
        raise ValueError(f"got terms = {shown(terms)}; must be a whole number from 1 to {MOST_TERMS}")
    if method not in ("spectrum", "whittle"):
        raise ValueError(f"got method = {shown(method)}; must be spectrum or whittle")
    if isinstance(data, Spectrum):
        spectrum, used, method = data, _of_spectrum(data), "spectrum"
    elif isinstance(data, Record):
        spectrum = data.spectrum()
        used = _of_record(data, whole=method == "whittle")
    else:
        raise TypeError(f"got {shown(data)}; must be a Spectrum or a Record")
    _refuse_far(spectrum, matter)
    weights = _weights(used.omega, [*matter.values()], 2 * frequency)
    fits = [_fitted(used, [family] * terms, weights) for family in KINDS[kind]]
    # more parameters must lower the deviance by ln n each, as in Bayes' criterion
    families, theta, _ = min(
        zip([[family] * terms for family in KINDS[kind]], *zip(*fits, strict=True), strict=True),
        key=lambda each: each[2] + len(each[1]) * math.log(len(used.values)),
    )
    return _told(used, families, theta, weights, matter, spectrum, method)


def _refuse_far(spectrum: Spectrum, matter: Mapping[str, float]) -> None:
    omega = spectrum.frequencies
    for name, target in matter.items():
        near = omega[0] <= 0.1 * max(matter.values()) if target == 0 else bracketed(omega, target)
        if not near:
            k = int(np.argmin(abs(omega - target)))
            raise ValueError(
                f"nothing was measured near {name} = {target:.4g} rad/time, which stability depends on; the nearest "
                f"point is {omega[k]:.4g}; measure there, or correct the natural frequency or its unit"
            )


def _weights(omega: FloatArray, matter: Sequence[float], scale: float) -> FloatArray:
    """1 at a frequency that matters, and `FLOOR` far from all of them."""
    near = [
        1 / (1 + (omega / (WIDTH * scale)) ** 2) if target == 0 else 1 / (1 + (np.log(omega / target) / WIDTH) ** 2)
        for target in matter
    ]
    return FLOOR + (1 - FLOOR) * np.max(near, axis=0)


def _of_spectrum(data: Spectrum) -> _Data:
    number = np.ones_like(data.density) if data.relative_error is None else data.relative_error**-2
    omega = data.frequencies
    positive = omega > 0
    return _Data(
        omega[positive],
        data.density[positive],
        number[positive],
        lambda kind, theta: kind.density(omega[positive], theta),
        None,
        math.nan,
    )


def _of_record(record: Record, whole: bool) -> _Data:
    """Periodograms of segments with Hann's window that overlap by half, or of the whole record."""
    length = record.values.size if whole else record.segment_length()
    window = np.asarray(np.ones(length) if whole else np.hanning(length + 1)[:-1], dtype=float)
    window /= math.sqrt(float(window @ window))
    hop = length - length // 2
    starts = range(0, record.values.size - length + 1, hop)
    inside = slice(2, length // 2)
    segments: FloatArray = np.array(
        [record.step * abs(np.fft.rfft(window * record.values[i : i + length])[inside]) ** 2 for i in starts]
    )
    omega: FloatArray = np.asarray(2 * math.pi * np.fft.rfftfreq(length, record.step)[inside], dtype=float)
    size = 2 * length
    lags = np.asarray(np.fft.irfft(abs(np.fft.rfft(window, size)) ** 2, size)[:length], dtype=float)
    lags[0] *= 0.5  # as C(0) stands once in 2 Re Σ
    t = np.asarray(record.step * np.arange(length), dtype=float)

    def expected(kind: Kind, theta: FloatArray) -> FloatArray:
        found = 2 * record.step * np.fft.rfft(np.multiply(lags, kind.covariance(t, theta), dtype=float)).real[inside]
        return np.asarray(np.maximum(found, 1e-300), dtype=float)

    number, variance = np.full(omega.size, float(len(starts))), welch_variance(record.values.size, length)
    return _Data(omega, segments.mean(axis=0), number, expected, None if whole else segments, variance)


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
    blocks = np.array_split(np.arange(data.omega.size), min(data.omega.size, 400))

    def mean(each: FloatArray) -> FloatArray:
        return np.array([np.average(each[block], weights=weights[block]) for block in blocks])

    root = np.sqrt([np.sum((weights * data.number)[b]) for b in blocks])
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


def _fitted(data: _Data, families: Sequence[Kind], weights: FloatArray) -> tuple[FloatArray, float]:
    """ln θ where the deviance is least, and the deviance."""
    size = np.sqrt(2 * weights * data.number)

    def residuals(theta: FloatArray) -> FloatArray:
        log_ratio = np.log(data.values) - np.log(_sum(data, families, theta))
        bounded = np.clip(log_ratio, -100, 100)
        return np.asarray(np.sign(bounded) * size * np.sqrt(np.maximum(np.expm1(bounded) - bounded, 0)))

    starts = [_start(data, families, weights)]
    if len(families) > 1:  # one part more beside the best sum of fewer, which halves a part of it in two places
        fewer, _ = _fitted(data, families[1:], weights)
        first = fewer[: len(families[0].names)]
        shift = np.zeros_like(first)
        shift[0 if families[0].amplitude else 1] = 1.0
        half = np.zeros_like(first)
        half[families[0].amplitude] = 0.5 * math.log(2)
        starts.append(np.concatenate([first - half - shift, first - half + shift, fewer[first.size :]]))
    found = [
        least_squares(residuals, start, bounds=(start - 15, start + 15), ftol=1e-10, xtol=1e-8, max_nfev=100)
        for start in starts
    ]
    best = min(found, key=lambda each: each.cost)
    return best.x, 2 * best.cost


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
    matter: Mapping[str, float],
    spectrum: Spectrum,
    method: str,
) -> NoiseFit:
    fitted, slopes = _sum(data, families, theta), _slopes(data, families, theta)
    ratio = data.values / fitted - 1
    n, k = data.values.size, theta.size
    unknown = method == "spectrum" and spectrum.relative_error is None
    dispersion = float(np.sum(weights * ratio**2) / np.sum(weights)) * n / max(n - k, 1) if unknown else 1.0
    information = slopes.T @ (slopes * (weights * data.number)[:, None])
    bread = np.linalg.pinv(information, hermitian=True)
    if data.segments is None:
        meat = dispersion * slopes.T @ (slopes * (weights**2 * data.number)[:, None])
    elif all(family.is_gaussian for family in families):
        # Hann's window correlates neighbours: of a Gaussian noise by 4/9, and by 1/36 at two steps
        rows = slopes * (weights * data.number * math.sqrt(data.variance))[:, None]
        meat = rows.T @ rows
        for lag, share in ((1, 4 / 9), (2, 1 / 36)):
            meat += share * (rows[lag:].T @ rows[:-lag] + rows[:-lag].T @ rows[lag:])
    else:
        scores = (data.segments / fitted - 1) * weights @ slopes
        scores -= scores.mean(axis=0)
        count = len(scores)
        meat = scores.T @ scores
        meat += scores[1:].T @ scores[:-1] + scores[:-1].T @ scores[1:]  # neighbours overlap
        meat *= count / max(count - 1.5, 1.0)
    values = np.exp(theta)
    covariance = bread @ meat @ bread * np.outer(values, values)
    parts, keys, place = [], list[str](), 0
    for name, family in zip(NAMES, families, strict=False):
        own = values[place : place + len(family.names)]
        parts.append(family.make(*own.tolist()))
        keys += [f"{name}.{each}" if len(families) > 1 else each for each in family.names]
        place += len(family.names)
    misfit = tuple(_misfit(name, at, data, ratio, dispersion) for name, at in matter.items())
    messages = [
        Message(Code.NOISE_MISFIT, name=each.name, relative=each.relative, error=each.error)
        for each in misfit
        if abs(each.relative) > max(MISFIT * each.error, 0.02)
    ]
    messages += [Message(Code.SPECTRUM_GAP, low=low, high=high) for low, high in gaps(spectrum)]
    if unknown:
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
        method=method,
        messages=tuple(messages),
    )


def _misfit(name: str, at: float, data: _Data, ratio: FloatArray, dispersion: float) -> Misfit:
    """In the band within 10 % of ω, or among the five nearest values."""
    distance = abs(data.omega - at)
    near = distance <= max(0.1 * at, float(np.sort(distance)[min(4, distance.size - 1)]))
    number = data.number[near]
    # Hann's window correlates neighbours: the variance of a sum over many is 35/18 times as large
    inflation = 35 / 18 if data.segments is not None else 1.0
    error = math.sqrt(dispersion * inflation / float(np.sum(number)))
    return Misfit(name, at, float(np.average(ratio[near], weights=number)), error)
