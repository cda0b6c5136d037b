"""Random linear systems of more than two variables, of such with a stop, and of such with delays."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy.optimize import brentq

from fpsolve import OrnsteinUhlenbeck, Problem
from fpsolve.exponent import even_moment
from fpsolve.model import Bounded, Filter, MarkovChain, Noise, Poisson, SineWiener, Telegraph, White
from tests.campaign.numbers import UNKNOWN, Number, asked, beside, between, elements, paths_of
from tests.kit import matrices, rates
from tests.numbers.second import even, with_segment
from tests.oracles.segments import Segment, written

KINDS = ("white", "ornstein-uhlenbeck", "telegraph", "filter")


def unit_noise(kind: str, memory: float, rng: np.random.Generator) -> Noise:
    """Of a standard deviation of 1 and a correlation time, or s = 1."""
    match kind:
        case "white":
            return White(s=1.0)
        case "telegraph":
            return Telegraph(a=1.0, k=0.5 / memory)
        case "ornstein-uhlenbeck":
            return OrnsteinUhlenbeck(alpha=1 / memory, sigma=math.sqrt(2 / memory))
    omega, zeta = rng.uniform(0.7, 3.0), rng.uniform(0.2, 0.9)
    return Filter(omega, zeta, 1 / Filter(omega, zeta, 1.0).standard_deviation)


def modes(seed: int) -> Problem:
    """Of three and four variables, damping of 0.1 % to 30 %, noise weak to strong; kinds and dimensions in turn."""
    rng = np.random.default_rng([2031, seed])
    kind, n = KINDS[seed % 4], 3 + seed // 4 % 2
    frequencies = np.cumprod([1.0, rng.uniform(1.1, 3.0)])
    dampings = np.exp(rng.uniform(math.log(1e-3), math.log(0.3), 2))
    steady, driven = np.zeros((n, n)), np.zeros((n, n))
    for k in range(n // 2):
        omega, at = frequencies[k], slice(2 * k, 2 * k + 2)
        steady[at, at] = [[0.0, omega], [-omega, -2 * dampings[k] * omega]]
    if n == 3:  # an oscillator with a current that it drives and that acts upon it
        decay, coupling = rng.uniform(0.2, 2.0), rng.uniform(0.05, 0.5)
        steady[2, 2], steady[2, 1], steady[1, 2] = -decay, coupling, -coupling
        driven[1::2, 0], driven[1, 2], driven[2] = 1.0, rng.normal() / 2, rng.normal(size=3) / 3
    else:
        driven[np.ix_((1, 3), (0, 2))] = rng.normal(size=(2, 2))
        driven[np.ix_((1, 3), (1, 3))] = rng.normal(size=(2, 2)) / 4
    driven *= between(0.05, 0.8, rng) / np.linalg.norm(driven, 2)
    return matrices(steady, driven, unit_noise(kind, between(0.3, 2.0, rng), rng))


def numbers_of_modes(seed: int) -> Iterator[Number]:
    """λ, Λ(1) and Λ(−1) of a system of three or four variables beside the simulation."""
    problem, orders = modes(seed), (0.0, 1.0, -1.0)
    yield from beside(orders, elements(problem, orders, 1e-5, 60.0), paths_of(problem, orders, paths=4096, steps=3e7))


def numbers_of_loose(seed: int) -> Iterator[Number]:
    """λ and Λ(1) of a system of three or four variables at loose tolerances beside a fine one."""
    problem, orders = modes(seed), (0.0, 1.0)
    known = [each[:2] for each in elements(problem, orders, 1e-5, 60.0)]
    for rtol in (1e-2, 1e-3):
        yield from beside(orders, elements(problem, orders, rtol, 20.0), known, "a fine tolerance")


def frame(seed: int) -> Problem:
    """Two modes q̈ + 2ζω q̇ + ω²q + ξKq = 0 under noise of 10 % to 109 % of that for which Λ(2) = 0."""
    rng = np.random.default_rng([2027, seed])
    kind, frequencies = KINDS[seed % 4], np.array([1.0, rng.uniform(1.1, 3.0)])
    dampings = np.exp(rng.uniform(math.log(0.005), math.log(0.05), 2))
    load, share = rng.normal(size=(2, 2)), rng.uniform(0.1, 1.09)
    noise, zero = unit_noise(kind, between(0.3, 2.0, rng), rng), np.zeros((2, 2))
    steady = np.block([[zero, np.eye(2)], [-np.diag(frequencies**2), -2 * np.diag(dampings * frequencies)]])
    driven = np.block([[zero, zero], [-load - load.T, zero]]) / np.linalg.norm(load + load.T, 2)

    def growth(size: float) -> float:
        return even_moment(matrices(steady, size * driven, noise), 2).value

    high = next(size for size in 2.0 ** np.arange(-9, 9) if growth(size) > 0)
    return matrices(steady, share * brentq(growth, high / 2, high, xtol=1e-6) * driven, noise)


def numbers_of_frames(seed: int) -> Iterator[Number]:
    """λ and Λ(1) of a frame, each in 10 s, beside the simulation, and Λ(2) beside the equations of moments."""
    problem, orders = frame(seed), (0.0, 1.0)
    yield from beside(orders, elements(problem, orders, 1e-4, 10.0), paths_of(problem, orders, steps=3e6))
    known = even_moment(problem, 2)
    yield from beside([2.0], elements(problem, [2.0], 1e-4, 10.0), [(known.value, known.error)], "moments")


ELASTIC = 20


def stopped(seed: int, *, is_free: bool = False) -> Problem:
    """Two modes, the first with a stop; from `ELASTIC` on R is 1, and white noise of its own drives the couplings.

    Args:
        is_free: without the stop, in whose place it is as good where R = 1.
    """
    rng = np.random.default_rng([2060, seed])
    is_elastic, memory = seed >= ELASTIC, between(0.3, 2.0, rng)
    noise = unit_noise(("white", "telegraph", "ornstein-uhlenbeck")[seed % 3], memory, rng)
    restitution = 1.0 if is_elastic else rng.uniform(0.5, 1.0)
    frequencies, dampings = np.cumprod([1.0, rng.uniform(1.1, 3.0)]), [between(5e-3, 0.2, rng) for _ in range(2)]
    steady, driven = np.zeros((4, 4)), np.zeros((4, 4))
    steady[[0, 2], [1, 3]] = 1.0
    steady[[1, 3], [0, 2]], steady[[1, 3], [1, 3]] = -(frequencies**2), -2 * np.array(dampings) * frequencies
    steady[[1, 3], [2, 0]] = 0.0 if is_elastic else rng.choice([-1, 1]) * between(0.02, 0.7, rng)
    driven[np.ix_((1, 3), (0, 2))] = rng.normal(size=(2, 2))
    driven[np.ix_((1, 3), (1, 3))] = rng.normal(size=(2, 2)) / 4
    driven *= between(0.05, 0.8, rng) / np.linalg.norm(driven, 2)
    within = np.kron(np.eye(2), np.ones((2, 2)))
    terms = [("", [(0.0, steady)]), ("xi*", [(0.0, driven)])]
    if is_elastic:
        terms[1:] = [("xi1*", [(0.0, within * driven)]), ("xi2*", [(0.0, (1 - within) * driven)])]
    text = "; ".join(f"{each}' = {rate}" for each, rate in zip("qvrw", written(terms, "qvrw"), strict=True))
    walls = [] if is_free else [{"at": "q = 0", "restitution": restitution}]
    return rates(text, [noise, White(s=1.0)] if is_elastic else noise, walls)


def numbers_of_stops(seed: int) -> Iterator[Number]:
    """λ, Λ(1) and Λ(2) beside the simulation; an elastic impact turns the sign of q₁, and so that of white noise."""
    problem, orders = stopped(seed), (0.0, 1.0, 2.0)
    found = elements(problem, orders, 1e-3, 60.0)
    if seed < ELASTIC:
        yield from beside(orders, found, paths_of(problem, orders, paths=1024, steps=3e6))
        return
    free = elements(stopped(seed, is_free=True), orders, 1e-3, 60.0)
    yield from beside(orders, found, [each[:2] for each in free], "elements without the stop")


# Six variables of which three numbers are known


@functools.cache
def triangular() -> tuple[Problem, list[Any]]:
    """Two modes and two lag states under a filter, told from another basis, and λ and Λ(1).

    The first mode drives all others, which decay faster, so that these are those of the first mode by itself.
    """
    free, driven = np.zeros((2, 6, 6))
    free[:2, :2], free[2:4, 2:4] = [[0.0, 1.0], [-1.0, -0.1]], [[0.0, 1.0], [-2.2, -0.5]]
    free[4, 4], free[5, 5], free[3, 0], free[4, 0], free[4, 3], free[5, 2] = -0.4, -0.8, 0.3, 0.4, 0.2, 0.5
    driven[1, 0], driven[3, 2], driven[3, 0] = -1.0, -0.8, 0.3
    noise, basis = (
        Filter(omega=1.6, zeta=0.4, s=0.6),
        np.eye(6) + 0.3 * np.random.default_rng(1).standard_normal((6, 6)),
    )
    first = matrices(free[:2, :2], driven[:2, :2], noise)
    whole = matrices(*(basis @ each @ np.linalg.inv(basis) for each in (free, driven)), noise)
    return whole, elements(first, [0.0, 1.0])


def numbers_of_coverage(seed: int) -> Iterator[Number]:
    """λ and Λ(1) of six variables by simulation: 95 ± 3 % of 200 seeds are within the interval of 95 %."""
    problem, known = triangular()
    yield from beside([0.0, 1.0], known, paths_of(problem, [0.0, 1.0], paths=4096, lengths=8.0, steps=1e9, seed=seed))


# Even moments of up to twelve variables


MANY = "white", "ito", "gaussian", "chain", "sine-wiener", "bounded", "filter", "poisson", "both"
COUNTS = {"gaussian": 40, "both": 60, "sine-wiener": 16, "bounded": 16, "filter": 14}
PADDED = 46
"""Variables whose second moments are taken as matrices, under any noise."""


def _cycle(size: float, rng: np.random.Generator) -> MarkovChain:
    """A chain that is not reversible."""
    jumps = rng.uniform(0.1, 1.5, (3, 3)) + np.array([[0, 2, 0], [0, 0, 2], [2, 0, 0]])
    np.fill_diagonal(jumps, 0.0)
    return MarkovChain(size * rng.uniform(-1.5, 1.5, 3), jumps)


def _coloured(kind: str, rng: np.random.Generator, size: float) -> Noise:
    """A noise of about this size."""
    rate = math.exp(rng.uniform(-0.5, 1.0))
    match kind:
        case "gaussian":
            return OrnsteinUhlenbeck(alpha=rate, sigma=size * math.sqrt(2 * rate))
        case "chain":
            return _cycle(size, rng)
        case "sine-wiener":
            return SineWiener(1.4 * size, rate)
        case "bounded":
            return Bounded(1.4 * size, 2.0, rate)
    omega, zeta, outputs = 1.5 * rate, 1.0 if rng.uniform() < 0.3 else rng.uniform(0.1, 1.5), rng.uniform(-1, 1, 2)
    return Filter(omega, zeta, size / Filter(omega, zeta, 1.0, *outputs).standard_deviation, *map(float, outputs))


def many(seed: int, *, is_padded: bool = False) -> tuple[Problem, Callable[[int, float], float]]:
    """A random system of 3 to 12 variables under noises in turn, and Λ(p) by the oracle, of p and of Λ(p) about.

    A sixth has two equal eigenvalues and one eigenvector of them, and all are about as large as the rate of the noise.

    Args:
        is_padded: with further variables, which decay fast and are driven, so that Λ(2) stays.
    """
    rng = np.random.default_rng([55, seed])
    n, kind = 3 + seed // len(MANY) % 10, MANY[seed % len(MANY)]
    free = rng.standard_normal((n, n)) / math.sqrt(n) + rng.uniform(0, 2) * np.triu(rng.uniform(-1, 1, (n, n)), 1)
    if seed % 6 == 0:
        free[:2], free[:, 1] = 0.0, 0.0
        free[0, :2], free[1, 1] = (-0.3, 1.0), -0.3
    free -= (np.linalg.eigvals(free).real.max() + rng.uniform(0.02, 0.5)) * np.eye(n)
    load, other = rng.standard_normal((2, n, n)) / math.sqrt(n)
    if seed % 4 == 0:
        load = np.outer(load[0], load[1]) * math.sqrt(n)
    size, strong = np.exp(rng.uniform((-3.0, -3.0), (0.0, 0.0)))
    if kind in ("white", "ito"):
        noise: Noise = White(s=size, interpretation="ito" if kind == "ito" else "stratonovich")
    elif kind == "poisson":
        noise = Poisson(1.5, (-size, 0.5 * size))
    else:
        noise = _coloured(("chain" if n > 6 else "gaussian") if kind == "both" else kind, rng, size)
    driven = [(load, noise), (other, White(s=strong))][: 1 + (kind == "both")]
    loads, noises = map(list, zip(*driven, strict=True))

    def oracle(p: int, near: float) -> float:
        return even(p, free, *driven, count=COUNTS.get(kind, 30) if n < 9 else 30, near=near)

    if is_padded:
        more = PADDED - n
        free_, tied = np.pad(free, (0, more)), rng.standard_normal((more, n))
        free_[n:, n:], free_[n:, :n] = -5.0 * np.eye(more), tied
        return matrices(free_, [np.pad(each, (0, more)) for each in loads], noises), oracle
    return matrices(free, loads, noises), oracle


def numbers_of_many(seed: int, p: int = 2) -> Iterator[Number]:
    """Λ(2) by closed equations beside Kronecker products, of every second system with matrices of 46 variables."""
    problem, oracle = many(seed, is_padded=p == 2 and seed % 2 == 1)
    found = asked(lambda: ((made := even_moment(problem, p)).value, made.error + 1e-12 * made.scale))
    yield from beside([p], [found], [(oracle(p, found.value) if not found.reason else math.nan, 0.0)], "moments")


# Delays


DELAYED = "white", "two white", "stratonovich", "gaussian", "chain", "chain and white"


def delayed(seed: int) -> tuple[Problem, Callable[[int], Segment]]:
    """Of 1 to 4 variables with one or two delays in their state and noise, and a segment of so many nodes."""
    rng = np.random.default_rng([56, seed])
    n, kind = 1 + seed // len(DELAYED) % 4, DELAYED[seed % len(DELAYED)]
    tau, count = math.exp(rng.uniform(-1.0, 1.2)), rng.integers(1, 4)
    delays = [(tau,), (tau / 2, tau), (2 * tau / 3, tau)][count - 1]

    def terms(size: float) -> list[tuple[float, np.ndarray]]:
        parts = rng.standard_normal((1 + len(delays), n, n)) * size / math.sqrt(n)
        return list(zip((0.0, *delays), parts, strict=True))

    size = math.exp(rng.uniform(-1.5, 0.0))
    drift, load, other = terms(1.0), terms(size), terms(size)
    drift[0] = 0.0, drift[0][1] - rng.uniform(0.5, 2.0) * np.eye(n)
    noises: list[Noise] = [White(s=1.0, interpretation="stratonovich" if kind == "stratonovich" else "ito")]
    if kind in ("gaussian", "chain", "chain and white"):
        rate = math.exp(rng.uniform(-0.5, 1.0))
        noises = [OrnsteinUhlenbeck(rate, 0.5 * math.sqrt(2 * rate)) if kind == "gaussian" else _cycle(1.0, rng)]
    if kind in ("two white", "chain and white"):
        noises.append(White(s=1.0, interpretation="ito"))
    return with_segment(drift, list(zip([load, other], noises, strict=False)))


def numbers_of_delays(seed: int, sizes: tuple[int, int] = (6, 24)) -> Iterator[Number]:
    """Λ(2) beside segments of few nodes and of more, which come nearer."""
    problem, segment = delayed(seed)
    found, known = asked(lambda: ((made := even_moment(problem, 2, rtol=1e-9)).value, made.error)), UNKNOWN
    if not found.reason:
        start = found.value + 0.5 * (1 + abs(found.value))
        few, more = (segment(size).exponent(start) for size in sizes)
        known = more, max(1e-9, abs(few - found.value) * (sizes[0] / sizes[-1]) ** 0.8)
    yield from beside([2.0], [found], [known], "segments")
