"""Numbers that are asked for twice: at a coarse tolerance and a fine one, in units of their own and in others."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fpsolve import Problem
from fpsolve.model import CoefficientMatrix, LinearSystem, OrnsteinUhlenbeck, Poisson
from tests.campaign import planar, spaces
from tests.campaign.numbers import MOST, UNKNOWN, Number, beside, elements
from tests.oracles import planar as oracle

# Coarse tolerances

MOMENTS = (-0.5, 0.0, 1.0, 1.5, 2.0, 3.0)
FINE = 1e-8
LAYERS = (
    ([[0, 1], [-0.607, -1.822]], [[0.6207, -0.9938], [-0.5294, -0.6908]], (0.4246, (-2.7308, 0.7748)), 0.0, 4.4e-3),
    ([[0, 1], [-1.466, -4.001]], [[0, 0], [-1, 0]], (0.652, (1.4933, 0.8462, 0.9591)), -0.5, 3.1e-4),
    (
        [[0, 1], [2.911, -0.0266]],
        [[-0.0032, 0.6102], [-0.9257, 0.763]],
        (2.072, (-2.1734, -1.3969, -1.8584)),
        1.5,
        2.4e-4,
    ),
    ([[0, 1], [-1.059, -4.0436]], [[-0.567, 0.6251], [0.997, 0.351]], (0.4986, 3.894), 1.0, 3.7e-4),
)
"""A₀, A₁, impulses or α and σ, p and `rtol` of systems with a layer within a cell of φ: errors were too small."""


def coarse(seed: int) -> tuple[planar.Drawn, float, float]:
    """A system, every fourth with a wall, p and `rtol`, from 1e-4 to 1e-2."""
    if seed < len(LAYERS):
        steady, driven, (rate, more), p, rtol = LAYERS[seed]
        if isinstance(more, tuple):
            law = rate, more, [1 / len(more)] * len(more)
            part = np.array(driven), "poisson", Poisson(rate=rate, sizes=more), law
        else:
            noise = OrnsteinUhlenbeck(alpha=rate, sigma=more)
            part = np.array(driven), "ou", noise, oracle.ornstein_uhlenbeck(rate, noise.standard_deviation)
        return planar.system_of("a layer", np.array(steady), [part]), p, rtol
    rng = np.random.default_rng([52, seed])
    system = planar.walled(seed // 4) if seed % 4 == 3 else planar.drawn(seed)
    return system, float(rng.choice(MOMENTS)), float(10 ** rng.uniform(-4, -2))


def numbers_of_tolerances(seed: int) -> Iterator[Number]:
    """Λ(p) or λ at a coarse `rtol` beside the same at a fine one, and every fourth beside a second method."""
    system, p, rtol = coarse(seed)
    [found], known = elements(system.problem, [p], rtol, 60.0), UNKNOWN
    for fine in (FINE, 30 * FINE, 1e-3 * rtol, 0.03 * rtol, 0.2 * rtol):
        [each] = elements(system.problem, [p], fine, 2.0)
        if not each.reason:
            known = each[:2]
            break
    yield from beside([p], [found], [known], "a fine tolerance")
    if system.is_single and not system.has_ray and seed % 4 == 0:
        value, doubt = system.by_fourier(p)
        yield from beside([p], [found], [(value, doubt) if doubt < 0.3 * found.stated else UNKNOWN], "Fourier")


# Units

POWERS = {
    "White": {"s": (-0.5, 1)},
    "OrnsteinUhlenbeck": {"alpha": (1, 0), "sigma": (0.5, 1)},
    "Telegraph": {"a": (0, 1), "k": (1, 0)},
    "MarkovChain": {"states": (0, 1), "rates": (1, 0)},
    "SineWiener": {"amplitude": (0, 1), "sigma": (0.5, 0)},
    "Bounded": {"mu": (0, 1), "nu": (1, 0), "sigma": (0.5, 0)},
    "Filter": {"omega": (1, 0), "s": (1.5, 0), "c0": (0, 1), "c1": (-1, 1)},
    "Poisson": {"rate": (1, 0), "sizes": (-1, 1)},
    "NonGaussianNoise": {"D0": (-1, 2), "tau0": (-1, 0)},
}
"""Powers of the unit of time and of ξ that the parameters of a noise have."""
DIGITS = 2.0**-12
"""What entries of matrices are multiples of, so that P A P⁻¹ is exact."""


def restated(problem: Problem, rate: float, strength: float, basis: np.ndarray) -> Problem:
    """The same of Px, with ξ and a unit of time that are so much larger: ẋ = r P A P⁻¹ x."""
    inverse, terms, noises = np.linalg.inv(basis), [], {}
    for term in problem.system.terms:
        own = basis @ (np.round(np.array(term.matrix) / DIGITS) * DIGITS) @ inverse
        factor = rate / strength if term.order else rate
        terms.append(CoefficientMatrix(term.order, (factor * own).tolist(), term.g, term.noise))
    for name, noise in problem.noise.parts.items():
        powers = POWERS[type(noise).__name__].items()
        values = {key: rate**r * strength**c * np.array(getattr(noise, key)) for key, (r, c) in powers}
        noises[name] = replace(noise, **{key: each.tolist() for key, each in values.items()})
    one = len(noises) == 1
    return Problem(LinearSystem(terms, problem.system.jumps), next(iter(noises.values())) if one else noises)


def in_units(seed: int) -> tuple[Problem, float, float, np.ndarray]:
    """A system of two to four variables, and units: of time 1e-9 to 1e12, of ξ 1e-3 to 1e3, and P with its exact P⁻¹.

    Half of the states of positions and velocities change with the unit of time, too.
    """
    rng, turn = np.random.default_rng([2050, seed]), seed // 5
    problem = (planar.walled(turn) if seed % 5 == 4 else planar.drawn(turn + 7 * (seed % 5), is_own=True)).problem
    if seed % 5 == 3:
        problem = spaces.modes(turn)
    n, rate, strength = problem.dimension, 10 ** rng.uniform(-9, 12), 10 ** rng.uniform(-3, 3)
    lower, upper = (np.eye(n) + np.tril(rng.integers(-8, 9, (n, n)) / 4, -1) for _ in range(2))
    basis = np.diag(2.0 ** rng.integers(-20, 21, n)) @ lower @ (np.eye(n) if problem.system.jumps else upper.T)
    if n != 3 and rng.integers(2):
        basis[1::2] *= 2.0 ** round(np.log2(rate))
    return problem, rate, strength, basis


def numbers_of_units(seed: int) -> Iterator[Number]:
    """λ, Λ(1) and Λ(2) in units beside the same in units of its own."""
    problem, rate, strength, basis = in_units(seed)
    has_many = problem.dimension > 2 or problem.valued.basis == "pairs" or len(problem.noise.parts) > 1
    orders, rtol, one = (0.0, 1.0, 2.0), 1e-3 if has_many else 1e-7, np.eye(problem.dimension)
    own = elements(restated(problem, 1.0, 1.0, one), orders, rtol, 10.0)
    other = elements(restated(problem, rate, strength, basis), orders, rtol, 30.0)
    scaled = basis / np.max(np.abs(basis), axis=1, keepdims=True)
    rounding = sys.float_info.epsilon * float(np.linalg.cond(scaled))
    for each in beside(
        orders, other, [(known.value, MOST * (known.stated + rounding)) for known in own], "its own units"
    ):
        if np.isfinite(each.known[0]):  # else it is refused in both
            scaled_number = each.found._replace(value=each.found.value / rate, stated=each.found.stated / rate)
            yield replace(each, found=scaled_number)
