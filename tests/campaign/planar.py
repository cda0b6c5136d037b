"""Random linear systems in the plane, in any unit of time, with a second method for each number.

The second method is the equations of the moments of even order, for other p and λ Fourier series (`oracles.planar`),
under two noises, or where these series do not settle, the simulation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, Problem, VibroImpactOscillator
from fpsolve.model import Bounded, Filter, Jump, MarkovChain, Noise, Poisson, SineWiener, Telegraph, White
from tests.campaign.numbers import (
    SETTLED,
    UNKNOWN,
    Known,
    Number,
    Solved,
    beside,
    between,
    elements,
    paths_of,
    together,
)
from tests.kit import matrices
from tests.oracles import planar

RTOL = {0: 1e-8, 1: 1e-6, 2: 1e-4}
"""By the `dimensions` of the noise."""
EVEN, OTHERS = (2.0, 4.0, 6.0), (1.5, -0.5, 0.0)
DOUBTED = 0.1
"""Of an even moment, how far that of the second method may be off; where it is further, it is none."""
SOME = 4
"""Of the systems under two noises one of so many has Λ(p) of other p and λ, as paths take seconds."""
MOTIONS = ("oscillator", "saddle", "node", "overdamped", "free", "non-normal", "nilpotent")
SINGLE = (
    "white", "ito", "ou", "bounded support", "gaussian", "telegraph", "chain", "cycle", "sine-wiener", "bounded",
    "filter", "poisson",
)  # fmt: skip
PAIRS = (
    ("ou", "ou"), ("white", "ou"), ("telegraph", "ou"), ("white", "filter"), ("poisson", "ou"), ("white", "ito"),
    ("bounded support", "ou"), ("white", "cycle"), ("chain", "telegraph"), ("white", "bounded"), ("white", "poisson"),
    ("telegraph", "bounded"), ("sine-wiener", "ito"),
)  # fmt: skip
DIMENSIONS = {"ou": 1, "bounded support": 1, "gaussian": 1, "sine-wiener": 1, "bounded": 1, "filter": 2}
"""Of the functions of a noise whose number grows."""


@dataclass(frozen=True)
class Drawn:
    """A system for both methods.

    Attributes:
        name: "saddle, ou and ou".
        problem: what is solved, in a unit of time of its own.
        known: the same for the oracle, in the unit in which it was drawn.
        dimensions: of the functions of the noise whose number grows.
        unit: the first unit over the second: exponents of `known` are `unit` times those of `problem`.
        is_single: whether there is one noise.
    """

    name: str
    problem: Problem
    known: planar.Planar
    dimensions: int
    unit: float = 1.0
    is_single: bool = True

    @property
    def has_ray(self) -> bool:
        """Whether the phase never leaves a ray: an eigenvector of A₀ is one of what every noise drives."""
        known = self.known
        driven = [matrix for matrix, *_ in (*known.coloured, *known.impulses)] + list(known.white)
        values, rays = np.linalg.eig(known.drift)
        return np.isrealobj(values) and any(
            all(abs(np.linalg.det([each @ ray, ray])) < 1e-10 for each in driven) for ray in rays.T
        )

    def moment(self, p: float) -> Known:
        """Λ(p) of even p by the equations of moments."""
        truth, doubt = planar.moment_exponent(self.known, p, self.dimensions)
        # it is none where the largest eigenvalues still grow with the functions
        return (truth / self.unit, doubt / self.unit) if doubt < DOUBTED * abs(truth) else UNKNOWN

    def by_fourier(self, p: float) -> Known:
        """Λ(p), or λ for 0, by Fourier series."""
        if p:
            truth, doubt = planar.fourier_exponent(self.known, p, self.dimensions)
        else:
            truth, doubt = planar.lyapunov_exponent(self.known, self.dimensions)
        return truth / self.unit, doubt / self.unit


def drawn(seed: int, *, is_own: bool = False) -> Drawn:
    """A system of a seed, in a unit of its own or not: motions and noises in turn, two of three under one noise."""
    rng = np.random.default_rng([50, seed])
    motion, turn = MOTIONS[seed % len(MOTIONS)], seed // len(MOTIONS)
    kinds = PAIRS[turn // 3 % len(PAIRS)] if turn % 3 == 2 else (SINGLE[(2 * (turn // 3) + turn % 3) % len(SINGLE)],)
    steady = _drift(motion, rng)
    scale = max(1.0, float(np.linalg.norm(steady, 2)) ** 0.5)
    unit = 10.0 ** rng.uniform(-4, 4)
    change = np.diag([1.0, 1 / unit]) if rng.random() < 0.5 else np.eye(2)  # v in the new unit is v/unit
    unit, change, parts = (1.0, np.eye(2), []) if is_own else (unit, change, [])
    for kind in kinds:
        driven = _driven(motion, rng)
        strength = between(0.03, 2.0 if len(kinds) == 1 else 1.0, rng)
        rate = scale * between(0.3, 10.0, rng)
        parts.append((driven, kind, *noise_of(kind, min(strength, rate / scale) * scale, rate, unit, rng)))
    # ξ is stated per unit of time by its own numbers, so that the matrix that it multiplies has no unit
    return system_of(f"{motion}, {' and '.join(kinds)}", steady, parts, unit, change)


def system_of(name, steady, parts, unit=1.0, change=None, log_factor=0.0) -> Drawn:
    """A system of A₀, of (A, kind, noise, the noise for the oracle), and of ln R of a wall at x = 0."""
    change = np.eye(2) if change is None else change
    back, kinds = np.linalg.inv(change), [kind for _, kind, *_ in parts]
    drift, coloured, white, impulses = np.array(steady), [], [], []
    for driven, kind, _, second in parts:
        if kind in ("white", "ito"):
            white.append(second * driven)
            drift -= 0.5 * (kind == "ito") * white[-1] @ white[-1]
        elif kind == "poisson":
            impulses.append((driven, *second))
        else:
            coloured.append((driven, second))
    known = planar.Planar(drift, tuple(coloured), tuple(white), tuple(impulses), log_factor)
    loads, noises = [change @ each @ back for each, *_ in parts], [noise for _, _, noise, _ in parts]
    one, jumps = len(parts) == 1, [Jump(math.pi / 2, log_factor)] if log_factor else []
    driven, noise = (loads[0], noises[0]) if one else (loads, noises)
    problem = matrices(change @ steady @ back / unit, driven, noise, jumps=jumps)
    return Drawn(name, problem, known, sum(DIMENSIONS.get(kind, 0) for kind in kinds), unit, one)


def _drift(motion: str, rng: np.random.Generator) -> np.ndarray:
    """A₀ of a kind; its rates are about 1, the fastest of overdamped motions up to 30."""
    match motion:
        case "oscillator":
            return np.array([[0.0, 1.0], [-1.0, -2 * between(0.003, 0.9, rng)]])
        case "saddle" | "node":
            rates = rng.uniform(0.2, 2.0, 2) * ([1, -1] if motion == "saddle" else [-1, -1])
            if motion == "node" and rng.random() < 0.2:
                rates = -rates
            angle, other = rng.uniform(0, math.pi), rng.uniform(0.3, math.pi / 2)
            basis = np.array([[math.cos(each), math.sin(each)] for each in (angle, angle + other)]).T
            return np.asarray(basis @ np.diag(rates) @ np.linalg.inv(basis))
        case "overdamped":
            return np.array([[0.0, 1.0], [-1.0, -between(2.5, 30.0, rng)]])
        case "free":
            return np.array([[0.0, 1.0], [0.0, -between(0.1, 5.0, rng)]])
        case "non-normal":
            large = between(5.0, 50.0, rng) * rng.choice([-1, 1])
            matrix = np.array([[rng.uniform(-1, 0.3), large], [rng.uniform(-0.2, 0.2) / large, rng.uniform(-1, 0.3)]])
            return matrix if rng.random() < 0.5 else matrix.T
    return np.array([[0.0, 1.0], [0.0, 0.0]])


def _driven(motion: str, rng: np.random.Generator) -> np.ndarray:
    """What ξ multiplies: the stiffness, the damping, or all entries, of the norm 1; sizes as in A₀."""
    kind = rng.integers(3)
    if kind == 2 or motion in ("saddle", "node", "non-normal"):
        matrix = rng.standard_normal((2, 2))
        return np.asarray(matrix / np.linalg.norm(matrix, 2))
    return np.array([[0.0, 0.0], [-1.0, 0.0]] if kind == 0 else [[0.0, 0.0], [0.0, -1.0]])


def noise_of(kind: str, size: float, rate: float, unit: float, rng: np.random.Generator) -> tuple[Noise, object]:
    """A noise of a standard deviation, or √S, and a rate of correlation, in a unit of time; and it for the oracle."""
    match kind:
        case "white" | "ito":
            s = min(size, 1.5)
            return White(s / math.sqrt(unit), "ito" if kind == "ito" else "stratonovich"), s
        case "ou":
            sigma = size * math.sqrt(2 * rate)
            return OrnsteinUhlenbeck(rate / unit, sigma / unit**1.5), planar.ornstein_uhlenbeck(rate, size)
        case "bounded support" | "gaussian":
            r0 = rng.uniform(0.3, 0.95) if kind == "bounded support" else 1.0
            tau = 1 / rate
            D0 = size**2 * tau * (5 - 3 * r0) / 2
            made = planar.between_ends(D0, tau, r0) if r0 < 1 else planar.ornstein_uhlenbeck(rate, size)
            return NonGaussianNoise(D0=D0 / unit, tau0=tau * unit, r0=r0), made
        case "telegraph":
            made = planar.chain([-size, size], [[0, rate / 2], [rate / 2, 0]])
            return Telegraph(a=size / unit, k=rate / 2 / unit), made
        case "chain" | "cycle":
            count = int(rng.integers(3, 5))
            rates = rate * (rng.uniform(0.2, 1.0, (count, count)) if kind == "chain" else np.zeros((count, count)))
            if kind == "chain":
                rates = 0.5 * (rates + rates.T)  # reversible: symmetric
            rates[np.arange(count), (np.arange(count) + 1) % count] += rate * (kind == "cycle")
            np.fill_diagonal(rates, 0.0)
            states = size * rng.standard_normal(count)
            return MarkovChain((states / unit).tolist(), (rates / unit).tolist()), planar.chain(states, rates)
        case "sine-wiener":
            sigma = math.sqrt(2 * rate)
            made = planar.circle(math.sqrt(2) * size, 0.0, sigma)
            return SineWiener(amplitude=math.sqrt(2) * size / unit, sigma=sigma / math.sqrt(unit)), made
        case "bounded":
            sigma, nu = math.sqrt(2 * min(rate, 2.0)), between(0.3, 4.0, rng)
            made = planar.circle(math.sqrt(2) * size, nu, sigma)
            return Bounded(mu=math.sqrt(2) * size / unit, nu=nu / unit, sigma=sigma / math.sqrt(unit)), made
        case "filter":
            omega, zeta = between(0.5, 4.0, rng), between(0.1, 1.5, rng)
            c0, c1 = ((1.0, 0.0), (0.0, 1.0 / omega), (1.0, 2 * zeta / omega))[rng.integers(3)]
            s = size * math.sqrt(4 * zeta * omega**3 / (c0**2 + (c1 * omega) ** 2))
            made = planar.filtered(omega, zeta, s, c0, c1)
            return Filter(omega / unit, zeta, s / unit**2.5, c0, c1 * unit), made
        case "poisson":
            sizes, weights = rng.standard_normal(2), rng.uniform(0.2, 1.0, 2)
            shares, often = weights / weights.sum(), min(rate, 5.0)
            sizes *= min(size / math.sqrt(often * shares @ sizes**2), 1.2 / np.abs(sizes).max())
            made = often, sizes.tolist(), shares.tolist()
            return Poisson(often / unit, tuple(sizes.tolist()), tuple(weights.tolist())), made
    raise AssertionError(kind)


def numbers(seed: int, *, has_others: bool | None = None) -> Iterator[Number]:
    """Λ(2), Λ(4), Λ(6), Λ(1.5), Λ(−0.5) and λ of a system, of half of them with all p at once."""
    system = drawn(seed)
    has_others = system.is_single or seed % SOME == 0 if has_others is None else has_others
    orders, rtol = EVEN + OTHERS[:-1] * has_others, RTOL[system.dimensions]
    found = together(system.problem, orders, rtol) if seed % 2 == 0 else elements(system.problem, orders, rtol)
    yield from beside(EVEN, found[: len(EVEN)], map(system.moment, EVEN), "moments")
    if has_others and not system.has_ray:  # where T is not smooth: the classes have tests of their own
        yield from of_others(system, [*found[len(EVEN) :], *elements(system.problem, [0.0], rtol)])


def of_others(system: Drawn, found: Sequence[Solved]) -> Iterator[Number]:
    """Λ(1.5), Λ(−0.5) and λ."""
    if system.is_single:
        known = [system.by_fourier(p) for p in OTHERS]
        if all(doubt < SETTLED * abs(truth) for truth, doubt in known):
            yield from beside(OTHERS, found, known, "Fourier")
            return
    yield from beside(OTHERS, found, paths_of(system.problem, OTHERS))


# Walls


WALLED = ("white", "ito", "telegraph", "chain", "cycle", "poisson", "ou", "bounded support", "sine-wiener", "bounded")


def walled(seed: int) -> Drawn:
    """A system that turns in all states and passes x = 0 forward, under noises in turn."""
    rng = np.random.default_rng([51, seed])
    kind, size, rate = WALLED[seed % len(WALLED)], between(0.1, 1.0, rng), between(0.3, 4.0, rng)
    steady, driven = rng.uniform(-1, 1, (2, 2, 2))
    steady[0, 1], driven[0, 1], steady[1, 0] = abs(steady[0, 1]) + 0.5, 0.0, steady[1, 0] - 4.0
    part = driven, kind, *noise_of(kind, size, rate, 1.0, rng)
    return system_of(f"{kind} and a wall", steady, [part], log_factor=math.log(rng.uniform(0.6, 0.95)))


def numbers_of_walls(seed: int) -> Iterator[Number]:
    """Λ(2), Λ(1.5), Λ(−0.5) and λ of an oscillator with a wall by Fourier series."""
    system = walled(seed)
    orders = 2.0, *OTHERS
    known = [system.by_fourier(p) for p in orders]
    yield from beside(orders, elements(system.problem, orders, RTOL[system.dimensions]), known, "Fourier")


# The paper's oscillator


def oscillator(seed: int) -> tuple[Drawn, float]:
    """The paper's oscillator over the whole range that fpsolve is made for, and p: either treatment as likely."""
    return of_paper(*paper(seed + 1)[seed])


def paper(count: int, seed: int = 2026) -> list[tuple[VibroImpactOscillator, Noise, float]]:
    """ε, τ₀, D₀ log-uniform, the others uniform; either noise treatment as likely."""
    rng, found = np.random.default_rng(seed), []
    for _ in range(count):
        epsilon, tau0, D0 = (between(*ends, rng) for ends in ((0.01, 2), (1e-4, 20), (0.01, 2)))
        omega, r, c1, p, r0 = (
            float(rng.uniform(*ends)) for ends in ((0.3, 10), (0.5, 1), (-0.5, 0.5), (-3, 10), (0.6, 1))
        )
        original = NonGaussianNoise(D0=D0, tau0=tau0, r0=r0)
        noise = original if rng.random() < 0.5 else original.ou_reduction()
        found.append((VibroImpactOscillator(omega=omega, restitution=r, c1=c1, epsilon=epsilon), noise, p))
    return found


def of_paper(system: VibroImpactOscillator, noise: Noise, p: float) -> tuple[Drawn, float]:
    """A problem of the paper for both methods, and p."""
    return Drawn(noise.kind, Problem(system, noise), planar.of_paper(system, noise), 1), p


def numbers_of_paper(seed: int) -> Iterator[Number]:
    """Λ(p) by Fourier series."""
    system, p = oscillator(seed)
    yield from beside([p], elements(system.problem, [p], 1e-8), [system.by_fourier(p)], "Fourier")
