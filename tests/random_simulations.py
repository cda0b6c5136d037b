"""Λ(2) and λ of random linear systems in the plane by simulation, under every kind of noise, with and without a wall.

`python -m tests.random_simulations [first last]` prints for each system how far the simulation is from the finite
elements, in standard errors; `tests.random_systems` compares these with oracles. Systems 0 to 199 are under noises that
are functions of ξ alone, 200 to 299 under bounded and filtered noise, impulses, and two noises at once.
"""

from __future__ import annotations

import math
import sys
import time
from dataclasses import dataclass

import numpy as np

from fpsolve import ExponentSolver, NonGaussianNoise, OrnsteinUhlenbeck, PlaneSystem, Problem, simulate
from fpsolve.arrays import FloatArray, identity
from fpsolve.errors import FpsolveError
from fpsolve.model import Bounded, CoefficientMatrix, Filter, Jump, MarkovChain, Noise, Poisson, SineWiener, White
from fpsolve.simulation.setup import transient

P, RTOL, SYSTEMS = 2.0, 1e-6, 300
KINDS = ("white", "telegraph", "chain", "ornstein-uhlenbeck", "reduced", "sine-wiener", "non-gaussian")
LATER, MORE_KINDS = 200, (
    *("bounded", "filter y", "filter y'", "Kanai-Tajimi", "poisson") * 2,
    "telegraph and ornstein-uhlenbeck",
    "ornstein-uhlenbeck and ornstein-uhlenbeck",
    "white and ornstein-uhlenbeck",
    "poisson and ornstein-uhlenbeck",
    "white and white",
    "white and poisson",
    "white and bounded",
    "white and harmonic",
    "white and Kanai-Tajimi",
    "telegraph and bounded",
)  # fmt: skip
"""From the system of this number on."""
PATHS, TRANSIENTS = 8192, 24
SHORTER = {"paths": 4096, "transients": 8}
"""For the later systems: paths under two noises take ten times as long."""
MOST, USUAL = 4.0, 3.0
"""Standard errors within which all shall be, and those beyond which 2 % may be."""


def drawn(seed: int) -> tuple[str, Problem]:
    """The kind of noise and the system: every kind in turn; half of the A₀ turn, half of the systems have a wall.

    Noise leaves the phase alone at a wall.
    """
    rng = np.random.default_rng([2027, seed])
    kind = KINDS[seed % len(KINDS)] if seed < LATER else MORE_KINDS[seed % len(MORE_KINDS)]
    kinds = kind.split(" and ")
    steady = rng.standard_normal((2, 2))
    if rng.random() < 0.5:
        steady = 0.3 * steady + rng.uniform(0.5, 3.0) * np.array([[0.0, 1.0], [-1.0, 0.0]])
    driven = [_driven(rng) for _ in kinds]
    jumps: tuple[Jump, ...] = ()
    if rng.random() < 0.5:
        phase = rng.uniform(0, math.pi)
        jumps = (Jump(phase, math.log(rng.uniform(0.6, 1.0))),)
        along = np.array([math.cos(phase), -math.sin(phase)])
        across = np.array([along[1], -along[0]])
        for each in driven:
            each -= np.outer(across, along) * (across @ each @ along)
    terms = [CoefficientMatrix(0, steady.tolist())]
    if len(kinds) == 1:
        terms.append(CoefficientMatrix(1, driven[0].tolist(), identity))
        return kind, Problem(PlaneSystem(terms, jumps), _noise(kind, rng))
    names = "ab"
    terms += [CoefficientMatrix(1, each.tolist(), identity, name) for name, each in zip(names, driven, strict=True)]
    return kind, Problem(
        PlaneSystem(terms, jumps), {name: _noise(k, rng) for name, k in zip(names, kinds, strict=True)}
    )


def _driven(rng: np.random.Generator) -> FloatArray:
    """A₁, of the norm 0.1 to 1."""
    driven = rng.standard_normal((2, 2))
    return np.asarray(driven * (rng.uniform(0.1, 1.0) / np.linalg.norm(driven, 2)))


def _noise(kind: str, rng: np.random.Generator) -> Noise:
    """Of a standard deviation about 1, or S about 1, and correlation times from 0.2 to 3, of filters to 10."""
    time = float(np.exp(rng.uniform(math.log(0.2), math.log(3.0))))
    match kind:
        case "white":
            return White(s=1.0, interpretation=("stratonovich", "ito")[rng.integers(2)])
        case "telegraph":
            return MarkovChain.telegraph(1.0, 0.5 / time)
        case "chain":
            count = int(rng.integers(3, 6))
            rates = rng.exponential(1 / (count * time), (count, count)) * (1 - np.eye(count))
            return MarkovChain(rng.standard_normal(count).tolist(), rates.tolist())
        case "ornstein-uhlenbeck":
            return OrnsteinUhlenbeck(alpha=1 / time, sigma=math.sqrt(2 / time))
        case "sine-wiener":
            return SineWiener(amplitude=math.sqrt(2.0), sigma=math.sqrt(2 / time))
        case "bounded" | "harmonic":
            sigma = math.sqrt(2 / time) if kind == "bounded" else 0.0
            return Bounded(mu=math.sqrt(2.0), nu=_between(0.3, 5.0, rng), sigma=sigma)
        case "filter y" | "filter y'" | "Kanai-Tajimi":
            omega, zeta = _between(0.7, 4.0, rng), _between(0.15, 1.0, rng)
            output = {"filter y": (1.0, 0.0), "filter y'": (0.0, 1.0)}.get(kind, (omega**2, 2 * zeta * omega))
            return Filter(omega, zeta, 1 / Filter(omega, zeta, 1.0, *output).standard_deviation, *output)
        case "poisson":
            sizes, weights = rng.standard_normal((2, int(rng.integers(1, 4))))
            made = Poisson(1 / time, tuple(sizes.tolist()), tuple(np.abs(weights).tolist()))
            return made.at({"sizes": tuple((sizes / math.sqrt(made.spectral_density(0.0))).tolist())})
    known = NonGaussianNoise(D0=time, tau0=time, r0=float(rng.uniform(0.6, 0.95)))
    return known if kind == "non-gaussian" else known.ou_reduction()


def _between(low: float, high: float, rng: np.random.Generator) -> float:
    """A number of these limits, log-uniform."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


@dataclass(frozen=True)
class Outcome:
    """What was found of an exponent; NaN where there is none, or where too few paths carry the moment.

    Attributes:
        value, stated: by the finite elements, and its error estimate.
        simulated, standard_error: by simulation.
    """

    value: float
    stated: float
    simulated: float = math.nan
    standard_error: float = math.nan

    @property
    def deviation(self) -> float:
        """Of the simulation from the finite elements, in standard errors."""
        return (self.simulated - self.value) / math.hypot(self.standard_error, self.stated)

    def __str__(self) -> str:
        both = f"{self.value:11.6g}, simulated {self.simulated:11.6g} ± {self.standard_error:.1e}"
        return f"{both}, {self.deviation:+.1f} standard errors"


def outcomes(problem: Problem, *, paths: int = PATHS, transients: int = TRANSIENTS, seed: int = 1) -> list[Outcome]:
    """Λ(2) and λ by both; Λ(2) with four times the paths where too few carry it. Raises `FpsolveError`."""
    solver = ExponentSolver(problem, rtol=RTOL)
    moment = solver.solution(P)
    try:
        rate = solver.lyapunov_exponent()
        exponent = rate.value, rate.error_estimate
    except FpsolveError:
        exponent = math.nan, math.nan
    length = transients * transient(problem.system, problem.noise)
    for more in (1, 4):
        made = simulate(problem, [P], estimator="population", paths=more * paths, time=length, seed=seed)
        estimate = made.estimates[0]
        if estimate.value is not None and estimate.standard_error is not None:
            break
    return [
        Outcome(moment.pair.value, moment.error, estimate.value or math.nan, estimate.standard_error or math.nan),
        Outcome(*exponent, made.lyapunov_exponent, made.lyapunov_exponent_error),
    ]


def main(first: int = 0, last: int = SYSTEMS - 1) -> None:
    """Print a line for each system, and how many agree."""
    deviations = []
    for seed in range(first, last + 1):
        kind, problem = drawn(seed)
        started = time.process_time()
        head = f"{seed:4d} {kind:41s} {'wall' if problem.system.jumps else '    '}"
        try:
            found = outcomes(problem, **({} if seed < LATER else SHORTER))
        except FpsolveError as failure:
            print(f"{head} {str(failure)[:150]}", flush=True)
            continue
        seconds = time.process_time() - started
        deviations.append([each.deviation for each in found])
        print(f"{head} Λ(2) {found[0]}; λ {found[1]}; {seconds:.1f} s", flush=True)
    for name, sizes in zip(("Λ(2)", "λ"), np.abs(np.reshape(deviations, (-1, 2)).T), strict=True):
        sizes = sizes[np.isfinite(sizes)]
        print(
            f"{name}: {sizes.size} of {last - first + 1} have both; beyond {USUAL:g} standard errors: "
            f"{np.count_nonzero(sizes > USUAL)}, beyond {MOST:g}: {np.count_nonzero(sizes > MOST)}"
        )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
