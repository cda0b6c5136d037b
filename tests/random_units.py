"""Λ(1), Λ(2) and λ of random systems in random units of time and coordinates, against the same in their own.

`python -m tests.random_units [first last]` prints for each system what is largest of how far both are apart, over the
errors they state together; at the end how many numbers are given, beyond one and a half, and refused, and how many are
refused in random units alone. It exits with 1 if there is one of these, or one beyond.

A system of its own units has rates of about 1, and is one of two to four variables under any noise. In others its state
is Px, P a matrix of few binary digits, so that P A P⁻¹ is exact, its time is longer by a factor of 1e-9 to 1e12, the
noise stronger by one of 1e-3 to 1e3. Half of the states of positions and velocities change with the unit of time, too.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fpsolve import NonGaussianNoise, OrnsteinUhlenbeck, Problem, lyapunov_exponent, moment_lyapunov
from fpsolve.arrays import FloatArray, identity
from fpsolve.errors import FpsolveError
from fpsolve.exponent import Budget
from fpsolve.model import (
    Bounded,
    CoefficientMatrix,
    Filter,
    Jump,
    LinearSystem,
    MarkovChain,
    Noise,
    ParametricOscillator,
    Poisson,
    SineWiener,
    Telegraph,
    White,
)

SYSTEMS, MOST = 300, 1.5
ORDERS = (1.0, 2.0)
OWN_SECONDS, SECONDS = 10.0, 30.0
RTOL, RTOL_OF_MANY = 1e-7, 1e-3
"""In the plane, and where there are more than two variables, or two of a filter."""
DIGITS = 2.0**-12
"""What entries of matrices are multiples of."""
KINDS = ("oscillator", "plane", "wall", "node", "saddle", "three", "plane", "modes", "parametric", "free", "two noises")
NOISES = (
    "white",
    "ornstein-uhlenbeck",
    "telegraph",
    "ito",
    "filter",
    "sine-wiener",
    "chain",
    "bounded",
    "non-gaussian",
    "poisson",
)
BEYOND_PLANE = ("white", "ornstein-uhlenbeck", "telegraph", "ito", "filter", "sine-wiener")
CROSSING = ("telegraph", "chain", "sine-wiener", "bounded")


@dataclass(frozen=True)
class Units:
    """Units of time, of ξ and of the state, in its own units.

    Attributes:
        rate: how many units of its own one of time has, r: ẋ = r P A P⁻¹ x.
        strength: of ξ.
        basis: P.
    """

    rate: float
    strength: float
    basis: FloatArray

    def term(self, order: int, matrix: FloatArray, of: str = "") -> CoefficientMatrix:
        """The term of a matrix, of order 1 with the noise."""
        rate, g = (self.rate / self.strength, (identity,)) if order else (self.rate, ())
        inverse = np.linalg.inv(self.basis)
        return CoefficientMatrix(order, (rate * (self.basis @ matrix @ inverse)).tolist(), *g, noise=of)


def few_digits(numbers: FloatArray) -> FloatArray:
    """Numbers of which products are not rounded."""
    return np.asarray(np.round(np.asarray(numbers) / DIGITS) * DIGITS)


def some_noise(kind: str, rng: np.random.Generator) -> Callable[[Units], Noise]:
    """One of a standard deviation of 1, or so strong white noise, and a memory from 0.3 to 2, in any units."""
    memory, share = math.exp(rng.uniform(math.log(0.3), math.log(2.0))), rng.uniform(0.1, 0.9)
    jumps = rng.uniform(0.2, 1.0, (3, 3))
    jumps -= np.diag(np.sum(jumps, axis=1))
    states = np.array([-1.2, 0.2, 1.1]) + 0.1 * rng.normal(size=3)

    def made(units: Units) -> Noise:
        r, c = units.rate, units.strength
        match kind:
            case "white":
                return White(c / math.sqrt(r))
            case "ito":
                return White(c / math.sqrt(r), "ito")
            case "ornstein-uhlenbeck":
                return OrnsteinUhlenbeck(r / memory, c * math.sqrt(2 * r / memory))
            case "telegraph":
                return Telegraph(c, 0.5 * r / memory)
            case "chain":
                return MarkovChain(c * states, r * jumps)
            case "sine-wiener":
                return SineWiener(math.sqrt(2.0) * c, math.sqrt(2 * r / memory))
            case "bounded":
                return Bounded(math.sqrt(2.0) * c, 2 * r, math.sqrt(2 * share * r / memory))
            case "filter":
                return Filter(2 * r, share, 5 * math.sqrt(share) * c * r**0.75, r**0.75, share * r**-0.25)
            case "poisson":
                return Poisson(r / memory, (c / r * np.array([-0.9, 0.4, 1.0])).tolist())
        return NonGaussianNoise(c**2 * memory / r, memory / r, share)

    return made


def drawn(seed: int) -> tuple[str, Callable[[Units], Problem], Units]:
    """What it is called, the problem in any units, and some units."""
    rng = np.random.default_rng([2050, seed])
    kind = KINDS[seed % len(KINDS)]
    n = {"three": 3, "modes": 4}.get(kind, 2)
    known = BEYOND_PLANE if n > 2 else CROSSING if kind == "wall" else NOISES
    of_noise = known[seed // len(KINDS) % len(known)]
    noise, size = some_noise(of_noise, rng), math.exp(rng.uniform(math.log(0.1), math.log(1.5)))
    rate, strength = 10 ** rng.uniform(-9, 12), 10 ** rng.uniform(-3, 3)
    steady, driven, jumps = rng.uniform(-1, 1, (n, n)), size * rng.uniform(-1, 1, (n, n)), list[Jump]()
    basis, power = some_basis(rng, n), 2.0 ** round(math.log2(rate))
    damping = rng.uniform(0.01, 0.4)
    if kind in ("oscillator", "wall", "parametric"):
        steady, driven = np.array([[0.0, 1.0], [-1.0, -2 * damping]]), np.array([[0.0, 0.0], [-0.5 * size, 0.0]])
        if kind == "wall":
            jumps, basis = [Jump(math.pi / 2, math.log(rng.uniform(0.7, 0.95)))], np.tril(basis)
            basis += np.diag(np.diag(basis) == 0)  # else it has no inverse
    elif kind == "node":
        steady = np.array([[0.0, 1.0], [-0.2, -1.5]])
    elif kind == "saddle":
        steady = np.array([[0.0, 1.0], [1.0, -damping]])
    elif kind == "free":
        steady, driven = np.array([[0.0, 1.0], [0.0, -damping]]), np.array([[0.0, 0.0], [size, 0.0]])
    elif n > 2:
        omega = rng.uniform(1.3, 2.5)
        steady, driven = np.zeros((n, n)), 0.5 * driven
        steady[:2, :2] = [[0.0, 1.0], [-1.0, -2 * damping]]
        steady[2:, 2:] = [[-0.5]] if n == 3 else [[0.0, omega], [-omega, -damping]]
    if n != 3 and rng.integers(2):  # positions and velocities
        basis[1::2] *= power
    steady, driven = few_digits(steady), few_digits(driven)
    name = f"{kind}, {of_noise}"
    if kind == "parametric":  # ẍ + 2bẋ + (1 + ξ)x = 0, in the range of its parameters

        def oscillator(units: Units) -> Problem:
            own = Units(units.rate, float(-driven[1, 0]) * units.rate**2, units.basis)
            return Problem(ParametricOscillator(units.rate**2, damping * units.rate), noise(own))

        return name, oscillator, Units(10 ** rng.uniform(-5, 5), 1.0, np.eye(2))
    if kind == "two noises":
        other, more = some_noise("white", rng), few_digits(0.3 * rng.uniform(-1, 1, (2, 2)))

        def with_two(units: Units) -> Problem:
            terms = units.term(0, steady), units.term(1, driven, "one"), units.term(1, more, "two")
            return Problem(LinearSystem(terms), {"one": noise(units), "two": other(units)})

        return f"{name} and white", with_two, Units(rate, strength, basis)

    def with_one(units: Units) -> Problem:
        return Problem(LinearSystem([units.term(0, steady), units.term(1, driven)], jumps), noise(units))

    return name, with_one, Units(rate, strength, basis)


def some_basis(rng: np.random.Generator, n: int) -> FloatArray:
    """P, and P⁻¹ too, of few binary digits, with a condition to 1e3 times that of units of each variable."""
    lower, upper = (np.eye(n) + np.tril(rng.integers(-8, 9, (n, n)) / 4, -1) for _ in range(2))
    return np.asarray(np.diag(2.0 ** rng.integers(-20, 21, n)) @ lower @ upper.T)


def numbers_of(problem: Problem, rate: float, seconds: float) -> list[tuple[float, float] | str]:
    """λ and Λ(p) in its own units with the errors stated, or why there is none."""
    has_many = problem.dimension > 2 or problem.coloured.basis == "pairs"
    settings = {"rtol": RTOL_OF_MANY if has_many else RTOL, "budget": Budget(seconds=seconds)}
    found = list[tuple[float, float] | str]()
    for p in (0.0, *ORDERS):
        try:
            if p:
                made = moment_lyapunov(problem, p, **settings)
                found.append((made.value[0] / rate, made.error_estimate[0] / rate))
            else:
                known = lyapunov_exponent(problem, **settings)
                found.append((known.value / rate, known.error_estimate / rate))
        except FpsolveError as failure:
            found.append(str(failure))
    return found


@dataclass(frozen=True)
class Comparison:
    """λ and Λ(p) in two systems of units.

    Attributes:
        name: what it is.
        own, other: numbers with their errors, or why there are none.
        doubt: what the rounding of the entries of P A P⁻¹ changes.
    """

    name: str
    doubt: float
    own: list[tuple[float, float] | str]
    other: list[tuple[float, float] | str]

    @property
    def apart(self) -> list[float]:
        """How far the numbers that both give are apart, over what is stated."""
        pairs = [pair for pair in zip(self.own, self.other, strict=True) if not any(isinstance(e, str) for e in pair)]
        return [abs(own[0] - other[0]) / (own[1] + other[1] + self.doubt) for own, other in pairs]

    @property
    def refused(self) -> list[str]:
        """Why what is given in its own units is not in the others."""
        return [b for a, b in zip(self.own, self.other, strict=True) if not isinstance(a, str) and isinstance(b, str)]

    @property
    def is_good(self) -> bool:
        """Whether all numbers are alike, and none is lost."""
        return not self.refused and max(self.apart, default=0.0) <= MOST


def compared(seed: int) -> Comparison:
    """One system in both."""
    name, problem, units = drawn(seed)
    own = Units(1.0, 1.0, np.eye(len(units.basis)))
    others = numbers_of(problem(own), 1.0, OWN_SECONDS), numbers_of(problem(units), units.rate, SECONDS)
    scaled = units.basis / np.max(np.abs(units.basis), axis=1, keepdims=True)
    return Comparison(name, sys.float_info.epsilon * float(np.linalg.cond(scaled)), *others)


def main(first: int = 0, last: int = SYSTEMS - 1) -> int:
    """Print a line for each system, and how many numbers are given, beyond and refused; 1 where one of these is."""
    given = beyond = lost = refused = 0
    for seed in range(first, last + 1):
        started = time.process_time()
        each = compared(seed)
        given += len(each.apart)
        beyond += sum(size > MOST for size in each.apart)
        lost += len(each.refused)
        refused += sum(isinstance(number, str) for number in each.own)
        worst = max(each.apart, default=math.nan)
        sign = "" if each.is_good else " !"
        print(f"{seed:3d} {each.name:40s} {worst:8.3f} {time.process_time() - started:6.1f} s{sign}", flush=True)
        for reason in each.refused:
            print(f"      refused: {' '.join(reason.split())[:200]}", flush=True)
    print(
        f"of {given + lost + refused} numbers {given} are given in both, {beyond} beyond {MOST:g} of what is stated, "
        f"{lost} refused in other units, {refused} in its own"
    )
    return int(beyond + lost > 0)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
