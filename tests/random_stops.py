"""λ, Λ(1) and Λ(2) of random pairs of modes with a stop for the first one: finite elements against the simulation.

`python -m tests.random_stops [first last]` prints what `tests.random_modes` does. R is 0.5 to 1, damping 0.5 % to 20 %,
couplings and noise are weak to strong: white, telegraph, Ornstein-Uhlenbeck. From the number `ELASTIC` on R is 1, white
noise of its own drives the couplings, and elements without a stop take the place of the simulation: an impact turns the
sign of q₁, and so that of a noise which has no memory.
"""

from __future__ import annotations

import math
import sys

import numpy as np

from fpsolve import Problem
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, LinearSystem, OrnsteinUhlenbeck, Telegraph, White
from fpsolve.model.plane import Stop
from tests.random_modes import by_elements, compare, numbered, outcomes
from tests.random_simulations import Outcome

ORDERS = (1.0, 2.0)
RTOL, ELASTIC, SYSTEMS, PATH_STEPS = 1e-3, 20, 30, 3e6


def drawn(seed: int) -> tuple[str, Problem]:
    """What it is called, and the problem: kinds of noise in turn."""
    rng = np.random.default_rng([2060, seed])
    is_elastic, memory = seed >= ELASTIC, _between(0.3, 2.0, rng)
    noise = (
        White(s=1.0),
        Telegraph(a=1.0, k=0.5 / memory),
        OrnsteinUhlenbeck(alpha=1 / memory, sigma=math.sqrt(2 / memory)),
    )[seed % 3]
    restitution = 1.0 if is_elastic else rng.uniform(0.5, 1.0)
    frequencies, dampings = np.cumprod([1.0, rng.uniform(1.1, 3.0)]), [_between(5e-3, 0.2, rng) for _ in range(2)]
    steady, driven = np.zeros((4, 4)), np.zeros((4, 4))
    steady[[0, 2], [1, 3]] = 1.0
    steady[[1, 3], [0, 2]], steady[[1, 3], [1, 3]] = -(frequencies**2), -2 * np.array(dampings) * frequencies
    steady[[1, 3], [2, 0]] = 0.0 if is_elastic else rng.choice([-1, 1]) * _between(0.02, 0.7, rng)
    driven[np.ix_((1, 3), (0, 2))] = rng.normal(size=(2, 2))
    driven[np.ix_((1, 3), (1, 3))] = rng.normal(size=(2, 2)) / 4
    driven *= _between(0.05, 0.8, rng) / np.linalg.norm(driven, 2)
    stop = Stop(np.eye(4).tolist(), restitution)
    terms = [CoefficientMatrix(0, steady.tolist())]
    if not is_elastic:
        terms.append(CoefficientMatrix(1, driven.tolist(), identity))
        return f"{noise.kind}, R = {restitution:.2f}", Problem(LinearSystem(terms, stop=stop), noise)
    within = np.kron(np.eye(2), np.ones((2, 2)))
    parts = {"own": (within * driven, noise), "cross": ((1 - within) * driven, White(s=1.0))}
    terms += [CoefficientMatrix(1, each.tolist(), identity, name) for name, (each, _) in parts.items()]
    noises = {name: of for name, (_, of) in parts.items()}
    return f"{noise.kind}, R = 1", Problem(LinearSystem(terms, stop=stop), noises)


def _between(low: float, high: float, rng: np.random.Generator) -> float:
    """A number of these limits, log-uniform."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


def both(problem: Problem) -> list[Outcome | str]:
    """λ and Λ(p) by elements, and by the simulation, or elements without a stop that is elastic."""
    if getattr(problem.system.stop, "restitution", 1.0) < 1:
        return outcomes(problem, ORDERS, RTOL, path_steps=PATH_STEPS, fewest=1024)
    free = Problem(LinearSystem(problem.system.terms), problem.noise)
    pairs = zip(by_elements(problem, ORDERS, RTOL), by_elements(free, ORDERS, RTOL), strict=True)
    return [
        next((each for each in pair if isinstance(each, str)), None) or Outcome(*pair[0], *pair[1]) for pair in pairs
    ]


if __name__ == "__main__":
    compare(numbered(drawn, *map(int, sys.argv[1:] or (0, SYSTEMS - 1))), ORDERS, both)
