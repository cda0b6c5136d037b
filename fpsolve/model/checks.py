"""Whether what a noise states agrees with itself: every member against what other members make of it.

Solvers believe a noise. A kind of one's own whose `derivative` or `spectral_density` is wrong gives wrong numbers with
small errors, as these errors are those of solving. Here the law P_s is integrated, the generator made of P_s and σ² is
diagonalised, parameters are varied and paths are drawn; each member must agree with that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from fpsolve.arrays import FloatArray
from fpsolve.errors import NoDerivative
from fpsolve.messages import Code, Message
from fpsolve.model.noise import Noise
from fpsolve.model.parameters import cached_by_problem

CLOSE = 1e-6
"""Share by which integrals may differ, beside the errors of what they are compared with."""
CLOSE_SPECTRUM = 1e-3
"""Share by which spectral densities may differ so."""
CLOSE_SLOPE = 1e-5
"""Share by which derivatives may differ so."""
PATHS = 4000
"""Number of paths of a noise."""
MOST_STEPS = 8
"""Largest number of steps of a path."""
STEP = 1e-5
"""Share of a parameter by which it is varied."""
SURE = 4.5
"""Standard errors beyond which a sample of paths differs."""
KOLMOGOROV = 2.2
"""√n sup|F_n − F| that a sample of the law exceeds with a probability of 1e-4."""


class Law(NamedTuple):
    """P_s on a grid on which ∫f dξ is Σ f measure, and what of it lies beyond."""

    xi: FloatArray
    measure: FloatArray
    density: FloatArray
    rest: float

    def mean(self, values: Any) -> float:
        """⟨f⟩ of a function at the points, if P_s is normalised."""
        return float(np.sum(self.measure * self.density * values))


class Spectrum(NamedTuple):
    """C(t) = Re Σ w exp(−r t), of sums of decaying and turning parts."""

    weights: Any
    rates: Any

    def density(self, omega: float) -> float:
        """S(ω) = ∫ C(t) cos ωt dt over all t."""
        return float(np.sum(2 * self.weights * self.rates / (self.rates**2 + omega**2)).real)

    def correlation(self, t: float) -> float:
        """C(t)."""
        return float(np.sum(self.weights * np.exp(-self.rates * t)).real)


class MatrixSpectrum(NamedTuple):
    """C(t) = left·e^{−Mt}·right; M may have fewer eigenvectors than rows."""

    left: FloatArray
    matrix: FloatArray
    right: FloatArray

    def density(self, omega: float) -> float:
        """S(ω), as of a `Spectrum`."""
        shifted = self.matrix + 1j * omega * np.eye(self.left.size)
        return float(2 * (self.left @ np.linalg.solve(shifted, self.right)).real)

    def correlation(self, t: float) -> float:
        """C(t)."""
        from scipy.linalg import expm  # takes a while to import

        return float(self.left @ expm(-t * self.matrix) @ self.right)


def check_noise(noise: Noise) -> tuple[Message, ...]:
    """What is wrong with the members of a noise, one sentence for each fault; nothing where they agree.

    P_s must integrate to 1 and have the stated mean, standard deviation, support and exponent at its ends; `diffusion`,
    `drift` and `spectral_density` must be those of P_s and σ²; `derivative` that of the noise with other parameters;
    `sample`, `start` and `step` must draw what P_s says. What a kind does not state is not checked. Paths are tried
    with 4000 of them, so that a `step` that is wrong by less than some percent passes.

    >>> from fpsolve import OrnsteinUhlenbeck
    >>> check_noise(OrnsteinUhlenbeck(alpha=1.0, sigma=0.5))
    ()

    Args:
        noise: of any kind, with the parameters that it shall be checked for; of several noises each is checked.

    Returns:
        Messages, which are texts such as "mean is 0, but the integral of ξ P_s gives 0.1; correct one of the two".
    """
    if len(noise.parts) > 1:
        return tuple(fault for part in noise.parts.values() for fault in check_noise(part))
    with np.errstate(all="ignore"):
        return tuple(_tried("the noise", lambda: _faults(noise)))


def refuse_wrong_derivative(noise: Noise, name: str) -> None:
    """Refuse a `derivative` by a parameter that differs from differences; a kind of fpsolve itself is not tried.

    Raises:
        NoDerivative: it is not that of the noise.
    """
    if type(noise).__module__.partition(".")[0] == "fpsolve":
        return
    if faults := _slopes(noise, name):
        raise NoDerivative(Message(Code.NOISE_REFUSED, kind=noise.kind, reason=faults[0]))


@cached_by_problem(1024)
def _slopes(noise: Noise, name: str) -> tuple[Message, ...]:
    with np.errstate(all="ignore"):
        return tuple(_tried(f'derivative("{name}")', lambda: _derivative(noise, name)))


def _tried(member: str, faults: Callable[[], Iterator[Message]]) -> Iterator[Message]:
    """Faults, an exception being one more."""
    try:
        yield from faults()
    except Exception as failure:  # whatever a kind of others raises
        told = f"{type(failure).__name__}: {failure}"
        yield Message(Code.NOISE_FAILS, member=member, reason=told)


def _differs(
    member: str, values: Any, source: str, must: Any, tolerance: Any, xi: FloatArray | None = None
) -> Iterator[Message]:
    """The worst difference of a member from what it must be, beyond a tolerance."""
    values, must, most = np.broadcast_arrays(*(np.asarray(each, dtype=float) for each in (values, must, tolerance)))
    shares = np.where(values == must, 0.0, np.abs(values - must) / most)
    at = np.unravel_index(int(np.argmax(shares)), shares.shape)  # a NaN, if there is one
    if not shares[at] <= 1:
        place = None if xi is None else float(xi[at])
        found, other = float(values[at]), float(must[at])
        yield Message(Code.NOISE_DIFFERS, member=member, xi=place, value=found, source=source, must=other)


def _faults(noise: Noise) -> Iterator[Message]:
    if noise.is_white or not noise.is_random:  # no value, no law; or a wave, whose start alone is random
        return
    sizes = {"standard_deviation": noise.standard_deviation, "correlation_time": noise.correlation_time}
    for name, value in sizes.items():
        if not 0 < value < math.inf:
            yield Message(Code.NOISE_SIZE, member=name, value=float(value))
            return
    law = _law(noise)
    if law is not None:
        found = [*_tried("log_density", lambda: _of_law(noise, law))]
        yield from found
        if found:
            return  # all that follows is made of it
    spectrum = _spectrum(noise, law)
    if spectrum is not None:
        yield from _tried("spectral_density", lambda: _of_spectrum(noise, law, spectrum))
    for name in noise.differentiable:
        yield from _tried(f'derivative("{name}")', lambda name=name: _derivative(noise, name))  # type: ignore[misc]
    if type(noise).sample is not Noise.sample:
        yield from _tried("sample", lambda: _of_sample(noise, law))
    if noise.is_simulated and not noise.has_states:
        yield from _tried("step", lambda: _of_step(noise, law, spectrum))


def _law(noise: Noise, fineness: int = 64) -> Law | None:
    """P_s on a grid that gets denser towards the ends of the support, or reaches far out (tanh-sinh rules)."""
    if noise.has_states or type(noise).log_density is Noise.log_density:
        return None
    bounded = _is_short(noise)
    t = np.arange(-3 * fineness if bounded else -5 * fineness, (3 if bounded else 5) * fineness + 1) / fineness
    inner, slope = 0.5 * math.pi * np.sinh(t), 0.5 * math.pi * np.cosh(t)
    if bounded:
        xi, measure = np.tanh(inner), slope / np.cosh(inner) ** 2
        inside = 1 - np.abs(xi) > 1e-15
        xi, measure = noise.half_width * xi[inside], noise.half_width * measure[inside]
    else:
        xi, measure = noise.standard_deviation * np.sinh(inner), noise.standard_deviation * np.cosh(inner) * slope
        inside = np.abs(xi) < noise.half_width
        xi, measure = xi[inside], measure[inside]
    density = np.exp(np.asarray(noise.log_density(xi), dtype=float))
    density = np.where(np.isfinite(density) | (np.abs(xi) < 50 * noise.standard_deviation), density, 0.0)
    edge = np.array([0, -1])
    rest = density[edge] * (noise.half_width - np.abs(xi[edge])) / (noise.end_exponent + 1) if bounded else np.zeros(2)
    return Law(xi, measure / fineness, density, float(np.sum(rest)))


def _is_short(noise: Noise) -> bool:
    """Whether its support ends where P_s is felt."""
    return noise.half_width < 30 * noise.standard_deviation


def _of_law(noise: Noise, law: Law) -> Iterator[Message]:
    std, width = noise.standard_deviation, noise.half_width
    finer = cast("Law", _law(noise, 128))
    if noise.end_exponent <= -1:
        yield Message(Code.NOISE_SIZE, member="end_exponent + 1", value=noise.end_exponent + 1)
        return
    if math.isfinite(width):
        for side in (-1, 1):
            logs = noise.log_density(side * width * (1 - np.array([1e-6, 1e-8])))
            found = float(logs[0] - logs[1]) / math.log(100)
            source = "the slope of log_density over the logarithm of the distance from the end"
            yield from _differs("end_exponent", noise.end_exponent, source, found, 1e-3 * (1 + abs(found)))
        beyond = float(np.max(noise.log_density(1.01 * width * np.array([-1.0, 1.0]))))
        source, place = "half_width, beyond which P_s is 0,", np.array(1.01 * width)
        yield from _differs("log_density", beyond, source, -math.inf, 1.0, place)
    total, error = finer.mean(1.0), abs(finer.mean(1.0) - law.mean(1.0)) + 2 * law.rest
    yield from _differs("the integral of exp(log_density)", total, "a density", 1.0, CLOSE + 3 * error)
    if not abs(total - 1) <= CLOSE + 3 * error:
        return
    mean, square = finer.mean(finer.xi), finer.mean(finer.xi**2)
    coarse = law.mean(law.xi), law.mean(law.xi**2)
    reach = min(width, 30 * std)
    tolerance = CLOSE * std + 3 * abs(mean - coarse[0]) + 2 * law.rest * reach
    yield from _differs("mean", noise.mean, "the integral of ξ P_s", mean, tolerance)
    deviation = math.sqrt(max(square - mean**2, 0.0))
    spread = 3 * abs(square - coarse[1]) / std + 2 * law.rest * reach
    yield from _differs("standard_deviation", std, "the integral of ξ² P_s", deviation, CLOSE * std + spread)


def _inner(noise: Noise, count: int = 41) -> FloatArray:
    """Values of ξ amid its law."""
    return np.asarray(
        noise.mean + min(0.9 * noise.half_width, 3 * noise.standard_deviation) * np.linspace(-1, 1, count)
    )


def _spectrum(noise: Noise, law: Law | None) -> Spectrum | MatrixSpectrum | None:
    """The spectrum of the generator, made of P_s and σ², of the rates of a chain or of the matrix of a filter."""
    some = cast("Any", noise)
    match noise.basis:
        case "states":
            weights = some.probabilities
            deviations = np.array(some.states) - weights @ some.states
            ranks = np.tile(weights, (weights.size, 1))  # what is constant decays, too, and is not in C(t)
            return MatrixSpectrum(weights * deviations, ranks - some.rates, deviations)
        case "waves":
            angles = 2 * math.pi * np.arange(256) / 256
            waves = np.fft.fft(some.of_angle(angles)) / 256
            k = np.fft.fftfreq(256, 1 / 256)
            return Spectrum(np.abs(waves[1:]) ** 2, 0.5 * some.sigma**2 * k[1:] ** 2 + 1j * some.nu * k[1:])
        case "pairs":
            first = noise.standard_deviation * np.eye(2)[0]
            return MatrixSpectrum(first, np.array(some.drift_matrix), first)
    return _diffusion_spectrum(noise, law) if law is not None else None


def _diffusion_spectrum(noise: Noise, law: Law) -> Spectrum:
    """The spectrum by the eigenvalues of −½(σ²P_s u′)′ = r P_s u on the grid, differences being central."""
    from scipy.linalg import eigh_tridiagonal  # takes a while to import

    xi, mass = law.xi, law.measure * law.density
    if _is_short(noise):  # a milder grid, as gaps of rounding have rates of rounding
        angles = math.pi * ((np.arange(xi.size) + 0.5) / xi.size - 0.5)
        xi = noise.half_width * np.sin(angles)
        mass = noise.density(xi) * noise.half_width * np.cos(angles) * math.pi / xi.size
    least = 1e-10 if noise.has_algebraic_tails else 1e-20
    known = np.flatnonzero(mass * (1 + (xi / noise.standard_deviation) ** 2) > least * mass.max())
    part = slice(known[0], known[-1] + 1)
    xi, mass, gap = xi[part], np.maximum(mass[part], 1e-300), np.diff(xi[part])
    middle = xi[:-1] + 0.5 * gap
    flux = 0.5 * noise.squared_diffusion(middle) * np.exp(noise.log_density(middle)) / gap
    root = np.sqrt(mass)
    diagonal = (np.append(flux, 0.0) + np.insert(flux, 0, 0.0)) / mass
    rates, vectors = eigh_tridiagonal(diagonal, -flux / (root[:-1] * root[1:]))
    parts = ((root * (xi - mass @ xi / mass.sum())) @ vectors) ** 2
    parts[0] = 0.0  # that of the constant
    rates[0] = 1.0
    return Spectrum(parts, np.maximum(rates, 1e-300))


def _of_spectrum(noise: Noise, law: Law | None, spectrum: Spectrum | MatrixSpectrum) -> Iterator[Message]:
    some, std = cast("Any", noise), noise.standard_deviation
    error, unit = CLOSE_SPECTRUM, 1 / noise.correlation_time
    if noise.is_diffusion and law is not None:
        xi = _inner(noise)
        h = 1e-4 * noise.standard_deviation
        square = np.broadcast_to(noise.squared_diffusion(xi), xi.shape)
        if not np.all(square > 0):
            worst = int(np.argmin(square))
            yield Message(Code.NOISE_SIZE, member="squared_diffusion", xi=float(xi[worst]), value=float(square[worst]))
            return
        at_zero = math.sqrt(float(noise.squared_diffusion(np.zeros(1))[0]))
        if at_zero > 0:
            yield from _differs("diffusion", noise.diffusion, "√squared_diffusion(0)", at_zero, CLOSE * at_zero)
        if callable(getattr(some, "drift", None)):
            logs, squares = ((f(xi + h) - f(xi - h)) / (2 * h) for f in (noise.log_density, noise.squared_diffusion))
            must, size = 0.5 * (square * logs + squares), std / noise.correlation_time
            yield from _differs("drift", some.drift(xi), "½(σ²P_s)′/P_s", must, 1e-4 * (np.abs(must) + size), xi)
        finer = _diffusion_spectrum(noise, cast("Law", _law(noise, 128)))
        unit = law.mean(noise.squared_diffusion(law.xi)) / (2 * std**2)
        error += 3 * abs(finer.density(unit) / spectrum.density(unit) - 1)
        spectrum = finer
        memory = spectrum.density(0.0) / (2 * std**2)
        if not noise.has_algebraic_tails and not 0.1 * memory < noise.correlation_time < 10 * memory:
            yield from _differs("correlation_time", noise.correlation_time, "∫C(t) dt/C(0) over t > 0", memory, 0.0)
    if noise.approximates_spectrum:
        return
    source = "the generator"
    for share in (0.0, 0.3, 1.0, 3.0):
        known = spectrum.density(share * unit)
        member, tolerance = f"spectral_density({share * unit:.4g})", error * abs(known) + 1e-6 * std**2 / unit
        found = list(_differs(member, noise.spectral_density(share * unit), source, known, tolerance))
        yield from found
        if found:
            return


def _derivative(noise: Noise, name: str) -> Iterator[Message]:
    """Each part of a `derivative` against differences of the noise with other values of this parameter."""
    try:
        stated = noise.derivative(name)
    except NotImplementedError:
        return  # it is optional
    theta = float(noise.values[name])
    if noise.is_white:
        return
    unit = 1 / abs(theta) if theta else 1.0
    part = f'derivative("{name}")'

    def compared(field: str, value: Any, f: Callable[[Any, float], Any], what: str, xi: Any = None) -> Any:
        must, error, size = _difference(noise, name, f)
        must = np.where(np.isfinite(must), must, value)  # where the difference is not known
        tolerance = CLOSE_SLOPE * (np.abs(must) + unit * min(1.0, size)) + 3 * error
        return _differs(f"{part}.{field}", value, f"the difference of {what}", must, tolerance, xi)

    some = cast("Any", noise)
    if noise.has_states:
        n = len(some.states)
        yield from compared("states", stated.states or np.zeros(n), lambda n, _: n.states, "states")
        yield from compared("rates", stated.rates or np.zeros((n, n)), lambda n, _: n.rates, "rates")
        return
    if noise.basis in ("pairs", "waves"):
        told = "ln standard_deviation"
        yield from compared("log_scale", stated.log_scale, lambda n, _: math.log(n.standard_deviation), told)
        if noise.basis == "pairs":
            yield from compared("drift", stated.drift or np.zeros((2, 2)), lambda n, _: n.drift_matrix, "drift_matrix")
            return
        yield from compared("turning", stated.turning, lambda n, _: n.nu, "nu")
        rate = stated.log_diffusion - stated.log_scale
        yield from compared("log_diffusion - log_scale", rate, lambda n, _: math.log(n.sigma), "ln sigma")
        return
    if math.isfinite(noise.half_width) and (stated.log_scale or noise.end_exponent <= 0):
        told = "ln half_width"
        found = list(compared("log_scale", stated.log_scale, lambda n, _: math.log(n.half_width), told))
        yield from found
        if found:
            return
    xi = _inner(noise)

    def at(n: Noise, change: float) -> FloatArray:
        """The points, which ξ/c holds."""
        return np.asarray(xi * math.exp(stated.log_scale * change))

    def logs(n: Noise, change: float) -> FloatArray:
        return np.asarray(0.5 * np.log(np.broadcast_to(n.squared_diffusion(at(n, change)), xi.shape)))

    yield from compared("log_diffusion", np.full_like(xi, stated.log_diffusion), logs, "½ ln squared_diffusion", xi)
    weights = noise.density(xi) / np.sum(noise.density(xi))
    own = np.broadcast_to(np.asarray(stated.log_density(xi), dtype=float), xi.shape)

    def law(n: Noise, change: float) -> FloatArray:
        found = n.log_density(at(n, change))
        return np.asarray(found - weights @ found)

    yield from compared("log_density", own - weights @ own, law, "log_density, but for a constant,", xi)
    if math.isfinite(noise.half_width):
        yield from compared("end_exponent", stated.end_exponent, lambda n, _: n.end_exponent, "end_exponent")


def _difference(noise: Noise, name: str, f: Callable[[Any, float], Any]) -> tuple[Any, Any, float]:
    """∂f/∂θ, f of the noise and of how much θ has changed, how far two steps of differences are apart, and |f|."""
    theta = float(noise.values[name])
    h = STEP * (abs(theta) or 1.0)

    def side(sign: int) -> Callable[[int], Any] | None:
        """f at a number of steps on a side of θ; None where the parameter may not have such values."""
        try:
            noise.at({name: theta + 4 * sign * h})
        except ValueError:
            return None
        return lambda k: np.asarray(f(noise.at({name: theta + sign * k * h}), sign * k * h), dtype=float)

    up, down = side(1), side(-1)
    if name in noise.one_sided:
        up = None
    if up and down:
        found = [(up(k) - down(k)) / (2 * k * h) for k in (1, 2)]
    else:
        one, sign = (up, 1) if up else (down, -1)
        if one is None:
            return math.nan, 0.0, 1.0
        found = [sign * (4 * one(k) - one(2 * k) - 3 * one(0)) / (2 * k * h) for k in (1, 2)]
    size = float(np.max(np.abs(np.asarray(f(noise, 0.0), dtype=float))))
    return found[0], np.abs(found[1] - found[0]), size


def _distance(values: FloatArray, law: Law) -> float:
    """√n sup|F_n − F| of values and the law."""
    order = np.sort(values)
    known = np.cumsum(law.measure * law.density)
    middle = known - 0.5 * law.measure * law.density
    expected = np.interp(order, law.xi, middle, left=0.0, right=1.0)
    counts = np.arange(values.size + 1) / values.size
    apart = max(np.max(np.abs(counts[1:] - expected)), np.max(np.abs(counts[:-1] - expected)))
    return math.sqrt(values.size) * float(apart)


def _of_sample(noise: Noise, law: Law | None) -> Iterator[Message]:
    values = np.asarray(noise.sample(PATHS, np.random.default_rng(1)))
    if values.shape != (PATHS,):
        yield Message(Code.NOISE_FAILS, member="sample", reason=f"it returns the shape {values.shape}, not ({PATHS},)")
    elif law is not None and not _distance(values, law) <= KOLMOGOROV:
        yield Message(Code.NOISE_FAILS, member="sample", reason="what it draws has another law than log_density")
    elif law is None:
        source, error = "what sample draws", SURE * noise.standard_deviation / math.sqrt(PATHS)
        yield from _differs("mean", noise.mean, source, float(values.mean()), error)


def _of_step(noise: Noise, law: Law | None, spectrum: Spectrum | MatrixSpectrum | None) -> Iterator[Message]:
    """Paths that begin by the stationary law keep it, and forget their start as the generator says."""
    h, rng = noise.largest_step, np.random.default_rng(2)
    if not 0 < h < math.inf:
        yield Message(Code.NOISE_SIZE, member="largest_step", value=float(h))
        return
    xi = np.array(noise.start(PATHS, rng), dtype=float)
    start = xi.reshape(-1, PATHS)[0].copy()
    sums, count = np.zeros(PATHS), min(MOST_STEPS, max(1, math.ceil(0.5 * noise.correlation_time / h)))
    step, before = noise.step(h), start
    for _ in range(count):
        before = xi.reshape(-1, PATHS)[0].copy()
        mean, end = _drawn(step, xi, rng)[:2]
        sums += mean - 0.5 * (before + end)
        if xi.ndim == 1:
            xi[:] = end
        else:
            xi[0] = end
    if law is not None and not _distance(end, law) <= KOLMOGOROV:
        told = f"after {count} steps of {h:.4g} paths that begin by start have another law than log_density"
        yield Message(Code.NOISE_FAILS, member="step", reason=told)
        return
    middle = 0.5 * (before + end)
    off = (sums / count) * (middle - noise.mean) / noise.standard_deviation**2
    if abs(float(off.mean())) > 0.02 + SURE * float(off.std()) / math.sqrt(PATHS):
        told = "xi_mean is not the mean of ξ over the step, as it does not fit the values at its beginning and end"
        yield Message(Code.NOISE_FAILS, member="step", reason=told)
    if spectrum is not None:
        products = (start - noise.mean) * (end - noise.mean) / noise.standard_deviation**2
        error = SURE * float(products.std()) / math.sqrt(PATHS)
        must = spectrum.correlation(count * h) / noise.standard_deviation**2
        member = f"the correlation of ξ after {count * h:.4g} by step"
        yield from _differs(member, float(products.mean()), "the generator", must, error + 0.01)
    if noise.basis == "polynomials" and noise.may_tilt and law is not None:
        yield from _of_bias(noise)


def _of_bias(noise: Noise) -> Iterator[Message]:
    """Faults of `step` with a bias b: by the same random numbers ξ must move by σ²bh more, and `push` be ∫f dt."""
    h, std = 0.02 * noise.largest_step, noise.standard_deviation
    start = np.resize(_inner(noise), PATHS)
    square = np.broadcast_to(noise.squared_diffusion(start), start.shape)
    b = 1e-3 / std
    moved = [_drawn(noise.step(h, bias), start.copy(), np.random.default_rng(3)) for bias in (0.0, b)]
    share = float(np.mean(moved[1][1] - moved[0][1]) / np.mean(square * b * h))
    yield from _differs("what a bias b of step moves ξ by, over σ²bh,", share, "the equation", 1.0, 0.05)
    slope = 1e-4 * std
    logs, squares = (
        (f(start + slope) - f(start - slope)) / (2 * slope) for f in (noise.log_density, noise.squared_diffusion)
    )
    drift = 0.5 * (square * logs + squares)
    size = float(np.sqrt(np.mean(drift**2))) * h
    if not float(np.sqrt(np.mean((moved[0][2] - drift * h) ** 2))) <= 0.2 * size + 3 * math.sqrt(h) * size:
        yield Message(Code.NOISE_FAILS, member="step", reason="what it adds to push is not ∫f(ξ) dt, f the drift")


def _drawn(step: Any, xi: FloatArray, rng: np.random.Generator) -> Sequence[FloatArray]:
    """The mean and the end of a step, and what it adds to the push; paths move in place if they have more rows."""
    mean, end, push = np.empty(PATHS), np.empty(PATHS), np.zeros(PATHS)
    step.draw(step, xi, mean, end, push, rng)
    return mean, end, push
