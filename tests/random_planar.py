"""Random linear systems in the plane under one noise or two of any kind, each number beside a second method.

`python -m tests.random_planar [first last]` solves Λ(2), Λ(4), Λ(6), Λ(1.5), Λ(−0.5) and λ of the systems of these
seeds, 0 to 599 if none are given, and prints a line for each number that is wrong or refused, and a summary. The second
method is the equations of the moments of even order, for other p and λ under one noise Fourier series
(`tests.oracles.planar`), under two noises, or where these series do not settle, the simulation. It ends with 1 if a
number is further off than 1.5 of the stated error and the doubt of the second method together, or than 4 standard
errors of the simulation, or if more than 2 % of the numbers are refused within 15 seconds of the processor each.

The drift is that of an oscillator, a saddle, a node, an overdamped or free motion, one whose matrix is far from normal,
or nilpotent; noise is weak to strong and slow to fast; the unit of time is 1e-4 to 1e4, and half of the systems are
stated in (x, dx/dt) of that unit. Two of three systems are under one noise. Half of them are solved for all p at once,
the others for each p alone. Of those under two noises every fourth has all numbers, the others those of even p.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from fpsolve import (
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    lyapunov_exponent,
    moment_lyapunov,
    simulate,
)
from fpsolve.arrays import FloatArray, identity
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent import Budget
from fpsolve.model import Bounded, CoefficientMatrix, Filter, MarkovChain, Noise, Poisson, SineWiener, Telegraph, White
from fpsolve.simulation.setup import default_step, transient
from tests.oracles import planar

SYSTEMS, SECONDS = 600, 15.0
RTOL = {0: 1e-8, 1: 1e-6, 2: 1e-4}
"""By the `dimensions` of the noise."""
MOST, DEVIATIONS, REFUSED = 1.5, 4.0, 0.02
EVEN, OTHERS = (2.0, 4.0, 6.0), (1.5, -0.5)
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
    unit: float
    is_single: bool

    @property
    def has_ray(self) -> bool:
        """Whether the phase never leaves a ray: an eigenvector of A₀ is one of what every noise drives."""
        known = self.known
        driven = [matrix for matrix, *_ in (*known.coloured, *known.impulses)] + list(known.white)
        values, rays = np.linalg.eig(known.drift)
        return np.isrealobj(values) and any(
            all(abs(np.linalg.det([each @ ray, ray])) < 1e-10 for each in driven) for ray in rays.T
        )


@dataclass(frozen=True)
class Number:
    """Λ(p) or λ by both methods; `seconds` are those of the processor for the first.

    Attributes:
        value, stated: by fpsolve; NaN where it is refused.
        truth, doubt: by the second method; NaN where that does not settle.
        allowed: how far they may be apart.
        reason: why it is refused.
    """

    name: str
    value: float
    stated: float
    truth: float
    doubt: float
    allowed: float
    seconds: float
    method: str
    reason: str = ""

    @property
    def is_wrong(self) -> bool:
        return abs(self.value - self.truth) > self.allowed

    def __str__(self) -> str:
        told = f"{self.value:.12g} ± {self.stated:.1e}, {self.method} {self.truth:.12g} ± {self.doubt:.1e}"
        return f"{self.name}: {f'refused: {self.reason}, {self.method} {self.truth:.9g}' if self.reason else told}"


def drawn(seed: int) -> Drawn:
    """A system of a seed: motions and noises in turn."""
    rng = np.random.default_rng([50, seed])
    motion, turn = MOTIONS[seed % len(MOTIONS)], seed // len(MOTIONS)
    count = len(SINGLE)
    kinds = PAIRS[turn // 3 % len(PAIRS)] if turn % 3 == 2 else (SINGLE[(2 * (turn // 3) + turn % 3) % count],)
    steady = _drift(motion, rng)
    scale = max(1.0, float(np.linalg.norm(steady, 2)) ** 0.5)
    unit = 10.0 ** rng.uniform(-4, 4)
    change = np.diag([1.0, 1 / unit]) if rng.random() < 0.5 else np.eye(2)  # v in the new unit is v/unit

    def restated(matrix: FloatArray) -> list[list[float]]:
        return (change @ matrix @ np.linalg.inv(change)).tolist()

    terms, noises = [CoefficientMatrix(0, restated(steady / unit))], dict[str, Noise]()
    coloured, white, impulses = [], [], []
    drift = steady.copy()
    for name, kind in zip("ab", kinds, strict=False):
        driven = _driven(motion, rng)
        strength = _between(0.03, 2.0 if len(kinds) == 1 else 1.0, rng)
        rate = scale * _between(0.3, 10.0, rng)
        noise, second = _noise(kind, min(strength, rate / scale) * scale, rate, unit, rng)
        if kind in ("white", "ito"):
            matrix = second * driven
            white.append(matrix)
            if kind == "ito":
                drift -= 0.5 * matrix @ matrix
        elif kind == "poisson":
            impulses.append((driven, *second))
        else:
            coloured.append((driven, second))
        # ξ is stated per unit of time by its own numbers, so that the matrix that it multiplies has no unit
        terms.append(CoefficientMatrix(1, restated(driven), identity, name if len(kinds) > 1 else ""))
        noises[name] = noise
    known = planar.Planar(drift, tuple(coloured), tuple(white), tuple(impulses))
    problem = Problem(PlaneSystem(terms), noises if len(kinds) > 1 else noises["a"])
    dimensions = sum(DIMENSIONS.get(kind, 0) for kind in kinds)
    return Drawn(f"{motion}, {' and '.join(kinds)}", problem, known, dimensions, unit, len(kinds) == 1)


def _drift(motion: str, rng: np.random.Generator) -> FloatArray:
    """A₀ of a kind; its rates are about 1, the fastest of overdamped motions up to 30."""
    match motion:
        case "oscillator":
            return np.array([[0.0, 1.0], [-1.0, -2 * _between(0.003, 0.9, rng)]])
        case "saddle" | "node":
            rates = rng.uniform(0.2, 2.0, 2) * ([1, -1] if motion == "saddle" else [-1, -1])
            if motion == "node" and rng.random() < 0.2:
                rates = -rates
            angle, between = rng.uniform(0, math.pi), rng.uniform(0.3, math.pi / 2)
            basis = np.array([[math.cos(each), math.sin(each)] for each in (angle, angle + between)]).T
            return np.asarray(basis @ np.diag(rates) @ np.linalg.inv(basis))
        case "overdamped":
            damping = _between(2.5, 30.0, rng)
            return np.array([[0.0, 1.0], [-1.0, -damping]])
        case "free":
            return np.array([[0.0, 1.0], [0.0, -_between(0.1, 5.0, rng)]])
        case "non-normal":
            large = _between(5.0, 50.0, rng) * rng.choice([-1, 1])
            matrix = np.array([[rng.uniform(-1, 0.3), large], [rng.uniform(-0.2, 0.2) / large, rng.uniform(-1, 0.3)]])
            return matrix if rng.random() < 0.5 else matrix.T
    return np.array([[0.0, 1.0], [0.0, 0.0]])


def _driven(motion: str, rng: np.random.Generator) -> FloatArray:
    """What ξ multiplies: the stiffness, the damping, or all entries, of the norm 1; sizes as in A₀."""
    kind = rng.integers(3)
    if kind == 2 or motion in ("saddle", "node", "non-normal"):
        matrix = rng.standard_normal((2, 2))
        return np.asarray(matrix / np.linalg.norm(matrix, 2))
    return np.array([[0.0, 0.0], [-1.0, 0.0]] if kind == 0 else [[0.0, 0.0], [0.0, -1.0]])


def _noise(kind: str, size: float, rate: float, unit: float, rng: np.random.Generator):
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
            sigma, nu = math.sqrt(2 * min(rate, 2.0)), _between(0.3, 4.0, rng)
            made = planar.circle(math.sqrt(2) * size, nu, sigma)
            return Bounded(mu=math.sqrt(2) * size / unit, nu=nu / unit, sigma=sigma / math.sqrt(unit)), made
        case "filter":
            omega, zeta = _between(0.5, 4.0, rng), _between(0.1, 1.5, rng)
            c0, c1 = ((1.0, 0.0), (0.0, 1.0 / omega), (1.0, 2 * zeta / omega))[rng.integers(3)]
            s = size * math.sqrt(4 * zeta * omega**3 / (c0**2 + (c1 * omega) ** 2))
            made = planar.filtered(omega, zeta, s, c0, c1)
            return Filter(omega / unit, zeta, s / unit**2.5, c0, c1 * unit).at({"s": s / unit**2.5}), made
        case "poisson":
            sizes, weights = rng.standard_normal(2), rng.uniform(0.2, 1.0, 2)
            shares, often = weights / weights.sum(), min(rate, 5.0)
            sizes *= min(size / math.sqrt(often * shares @ sizes**2), 1.2 / np.abs(sizes).max())
            made = often, sizes.tolist(), shares.tolist()
            return Poisson(often / unit, tuple(sizes.tolist()), tuple(weights.tolist())), made
    raise AssertionError(kind)


def _between(low: float, high: float, rng: np.random.Generator) -> float:
    """A number of these limits, log-uniform."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


Found = tuple[float, float, float, str]
"""A number by fpsolve, its error, the seconds, and why it is refused."""


def solved(problem: Problem, orders: tuple[float, ...], is_joint: bool, rtol: float) -> Iterator[Found]:
    """Λ(p), at all p at once or at each alone."""
    for group in [orders] if is_joint else [(p,) for p in orders]:
        started, reason = time.process_time(), ""
        try:
            found = moment_lyapunov(problem, list(group), rtol=rtol, budget=Budget(seconds=SECONDS))
        except NotConverged as failure:
            found, reason = failure.partial, str(failure)
        except FpsolveError as failure:
            found, reason = None, str(failure)
        seconds = (time.process_time() - started) / len(group)
        given = [] if found is None else found.p.tolist()
        for p in group:
            if p in given:
                at = given.index(p)
                yield float(found.value[at]), float(found.error_estimate[at]), seconds, ""
            else:
                yield math.nan, math.nan, seconds, _own(reason, p) or "not given"


def _own(reason: str, p: float) -> str:
    """Of the reasons for several p that for one."""
    lines = [line for line in reason.splitlines() if f"({p:g})" in line] or reason.splitlines()
    return lines[0] if lines else ""


def growth(problem: Problem, rtol: float) -> Found:
    """λ."""
    started, value, error, reason = time.process_time(), math.nan, math.nan, ""
    try:
        found = lyapunov_exponent(problem, rtol=rtol, budget=Budget(seconds=SECONDS))
        value, error = found.value, found.error_estimate
    except FpsolveError as failure:
        reason = str(failure)
    return value, error, time.process_time() - started, reason


def numbers(system: Drawn, seed: int, *, has_others: bool = True) -> Iterator[Number]:
    """All numbers of a system by both methods, exponents in its own unit of time, relative to `known`."""
    orders = (*EVEN, *OTHERS) if has_others else EVEN
    found = dict(zip(orders, solved(system.problem, orders, seed % 2 == 0, RTOL[system.dimensions]), strict=True))
    for p in EVEN:
        truth, doubt = planar.moment_exponent(system.known, p, system.dimensions)
        if not doubt < DOUBTED * abs(truth):  # as where the largest eigenvalues still grow with the functions
            truth = doubt = math.nan
        yield _number(f"Λ({p:g})", found[p], truth / system.unit, doubt / system.unit, "moments")
    if not has_others:
        return
    if system.has_ray:
        return  # where T is not smooth: `tests.random_systems` and the classes have tests of their own
    rate = growth(system.problem, RTOL[system.dimensions])
    names, own = (*(f"Λ({p:g})" for p in OTHERS), "λ"), (*map(found.__getitem__, OTHERS), rate)
    if system.is_single:
        values = [planar.fourier_exponent(system.known, p, system.dimensions) for p in OTHERS]
        values.append(planar.lyapunov_exponent(system.known, system.dimensions))
        if all(doubt < SETTLED * abs(truth) for truth, doubt in values):
            for name, each, (truth, doubt) in zip(names, own, values, strict=True):
                yield _number(name, each, truth / system.unit, doubt / system.unit, "Fourier")
            return
    for name, each, pair in zip(names, own, simulated(system.problem), strict=True):
        yield _number(name, each, *pair, "simulation", DEVIATIONS)


def _number(name, found, truth, doubt, method, deviations=1.0) -> Number:
    value, stated, seconds, reason = found
    own = 1e-13 * abs(truth)
    return Number(name, value, stated, truth, doubt, MOST * stated + deviations * doubt + own, seconds, method, reason)


SETTLED = 1e-3
"""Of a number, how far a Fourier series may be off; where it is further, as where bounded noise leaves the phase
between two rays, the simulation is the second method."""
DOUBTED = 0.1
"""Of an even moment, how far that of the second method may be off; where it is further, it is none."""
SOME = 4
"""Of the systems under two noises one of so many has Λ(p) of other p and λ, as paths take seconds."""
STEPS = 2e6
"""Path-steps of a simulation: some seconds."""


def simulated(problem: Problem) -> list[tuple[float, float]]:
    """Λ(1.5), Λ(−0.5) and λ with their standard errors; NaN where too few paths carry a moment."""
    length = transient(problem.system, problem.noise)
    steps = length / default_step(problem.system, problem.noise)
    paths = 2048
    time_ = length * max(2.0, min(8.0, STEPS / (steps * paths)))
    if steps * paths > 4 * STEPS:
        return [(math.nan, math.nan)] * 3  # so stiff that paths would take minutes
    try:
        made = simulate(problem, list(OTHERS), estimator="population", paths=paths, time=time_, seed=1)
    except (FpsolveError, ValueError):
        return [(math.nan, math.nan)] * 3
    moments = [(each.value or math.nan, each.standard_error or math.nan) for each in made.estimates]
    return [*moments, (made.lyapunov_exponent, made.lyapunov_exponent_error)]


def main() -> int:
    """Print what is wrong or refused, and the summary; 1 if that is more than the criterion allows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("first", type=int, nargs="?", default=0)
    parser.add_argument("last", type=int, nargs="?", default=SYSTEMS - 1)
    parser.add_argument("--even", action="store_true", help="the even p alone")
    parser.add_argument("--times", action="store_true", help="a line for each system")
    asked = parser.parse_args()
    count, wrong, refused, unknown = Counter(), Counter(), Counter(), Counter()
    seconds, oracle = [], 0.0
    for seed in range(asked.first, asked.last + 1):
        system, started = drawn(seed), time.process_time()
        for each in numbers(system, seed, has_others=not asked.even and (system.is_single or seed % SOME == 0)):
            count[each.method] += 1
            seconds.append(each.seconds)
            wrong[each.method] += each.is_wrong
            refused[each.method] += bool(each.reason)
            unknown[each.method] += not each.doubt < (1.0 if each.method == "simulation" else SETTLED) * abs(each.truth)
            if each.is_wrong or each.reason:
                print(f"{seed} {system.name}: {each}", flush=True)
        oracle += time.process_time() - started
        if asked.times:
            print(f"{seed} {system.name}: {time.process_time() - started:.1f} s", flush=True)
    for method in count:
        print(
            f"{method}: {count[method]} numbers, {wrong[method]} beyond the stated error, {refused[method]} refused, "
            f"{unknown[method]} without a second value"
        )
    total, spent = sum(count.values()), np.array(seconds)
    print(
        f"{sum(wrong.values())} of {total} wrong, {sum(refused.values())} refused; fpsolve {spent.sum():.0f} s, median "
        f"{np.median(spent):.2f} s, longest {spent.max():.1f} s; second methods {oracle - spent.sum():.0f} s"
    )
    return int(sum(wrong.values()) > 0 or sum(refused.values()) > REFUSED * total)


if __name__ == "__main__":
    sys.exit(main())
