"""Error estimates at coarse tolerances: Λ(p) and λ of random systems at rtol 1e-2 to 1e-4, and once more at 1e-8.

`python -m tests.random_tolerances [first last]` prints those whose error is beyond `MOST` stated ones, a table by kind
of noise, and how many there are; the exit code is 1 if there are any. The reference is the same problem at rtol
1e-8, whose own error is printed as doubt; of every fourth, and wherever a moment closes, a second method is asked, too.
"""

import math
import sys
import time
from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from fpsolve import ExponentSolver, NonGaussianNoise, OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.errors import FpsolveError
from fpsolve.exponent import Budget
from fpsolve.model import Bounded, CoefficientMatrix, Jump, Poisson, SineWiener, Telegraph, White
from tests.oracles import moment_hierarchy, phase_circle

MOST = 1.5
SYSTEMS = ("oscillator", "saddle", "overdamped")
NOISES = ("impulses", "ornstein-uhlenbeck", "white", "sine-wiener", "bounded", "telegraph", "Eq. (7)", "two", "wall")
MOMENTS = (-0.5, 0.0, 1.0, 1.5, 2.0, 3.0)
"""0 stands for λ."""
FINE = 1e-8
SIZES = (48, 72, 96), (16, 24, 32)
"""Harmonics in φ of the second method, for noise without and with functions of its own, of which there are half."""


@dataclass(frozen=True)
class Drawn:
    """A random system, its noise, a moment and a tolerance; `second` is Λ(p) by so many functions, None where unknown.

    Attributes:
        kind: what the system and the noise are.
    """

    kind: str
    problem: Problem
    p: float
    rtol: float
    second: object


def drawn(seed: int) -> Drawn:
    """The system of a seed: noise in a random matrix, every other one in the stiffness or the damping alone."""
    rng = np.random.default_rng([50, seed])
    kind, noise = SYSTEMS[seed % 3], NOISES[seed // 3 % len(NOISES)]
    p, rtol = MOMENTS[int(rng.integers(len(MOMENTS)))], float(10 ** rng.uniform(-4, -2))
    damping = float(np.exp(rng.uniform(math.log(0.02), math.log(0.6))))
    stiffness = float(np.exp(rng.uniform(-1.5, 1.5)))
    if kind == "saddle":
        stiffness *= -1
    elif kind == "overdamped":
        damping = math.sqrt(stiffness) * float(rng.uniform(2.1, 6.0))
    steady, driven = np.array([[0.0, 1.0], [-stiffness, -damping]]), rng.uniform(-1, 1, (2, 2))
    if rng.random() < 0.5 or noise == "wall":
        driven = np.array([[0.0, 0.0], [-1.0, 0.0] if rng.random() < 0.6 else [0.0, -1.0]])
    size, rate = (float(each) for each in np.exp(rng.uniform((-1.2, -1.6), (1.6, 1.6))))
    terms = [CoefficientMatrix(0, steady), CoefficientMatrix(1, driven, identity, "first")]
    jumps, law, made, moment = [], None, None, None  # the last two are second methods, functions of a number of waves
    plain, order = (steady, driven), int(p)
    if noise == "impulses":
        weights = (size * rng.uniform(-1.5, 1.5, int(rng.integers(1, 4)))).tolist()
        law, own = Poisson(rate=rate, sizes=weights), (*plain, rate, weights, [1 / len(weights)] * len(weights))
        made, moment = (
            lambda _: phase_circle.impulses(*own),
            lambda _: moment_hierarchy.impulses_exponent(*own, order),
        )
    elif noise in ("ornstein-uhlenbeck", "wall"):
        law, own = OrnsteinUhlenbeck(alpha=rate, sigma=size * math.sqrt(2 * rate)), (*plain, rate, size)
        made, moment = (
            lambda count: phase_circle.ornstein_uhlenbeck(*own, count),
            lambda count: moment_hierarchy.ornstein_uhlenbeck_exponent(*own, order, 2 * count),
        )
        if noise == "wall":
            jumps, moment = [Jump(math.pi / 2, math.log(rng.uniform(0.5, 0.95)))], None
    elif noise == "white":
        law, own = White(s=size), (steady, [size * driven])
        made, moment = (
            lambda _: phase_circle.white(*own),
            lambda _: moment_hierarchy.white_noise_exponent(*own, order),
        )
    elif noise in ("sine-wiener", "bounded"):
        nu, sigma = (0.0, math.sqrt(2 * rate)) if noise == "sine-wiener" else (rate, float(rng.uniform(0.2, 1.2)))
        law = Bounded(mu=size, nu=nu, sigma=sigma) if nu else SineWiener(amplitude=size, sigma=sigma)
        own = *plain, size, nu, sigma
        made, moment = (
            lambda count: phase_circle.bounded(*own, count),
            lambda count: moment_hierarchy.bounded_exponent(*own, order, count),
        )
    elif noise == "telegraph":
        law = Telegraph(a=size, k=rate)
        own = [steady + xi * driven for xi in law.states], law.rates
        made, moment = (
            lambda _: phase_circle.chain(*own),
            lambda _: moment_hierarchy.moment_lyapunov(*own, order),
        )
    elif noise == "Eq. (7)":
        r0 = float(rng.uniform(0.5, 0.95))
        law = NonGaussianNoise(D0=0.5 * size**2 / rate * (5 - 3 * r0), tau0=1 / rate, r0=r0)
    else:
        terms.append(CoefficientMatrix(1, rng.uniform(-1, 1, (2, 2)), identity, "second"))
        law = {"first": Telegraph(a=size, k=rate), "second": White(s=float(rng.uniform(0.2, 0.8)))}
    problem = Problem(PlaneSystem(terms, jumps), law)
    factor = math.exp(jumps[0].log_factor) if jumps else 1.0

    def second(harmonics: int, count: int, near: float) -> float:
        if moment is not None and p == 2:
            return moment(count)
        if p == 0:
            return phase_circle.lyapunov_exponent(made(count), harmonics, factor)
        return phase_circle.moment_exponent(made(count), p, harmonics, factor, near)

    is_asked = made is not None and (seed % 4 == 0 or (moment is not None and p == 2))
    return Drawn(f"{kind}, {noise}", problem, p, rtol, second if is_asked else None)


@dataclass(frozen=True)
class Outcome:
    """How far a number is off, by itself at a tighter tolerance and by a second method, beside what it states.

    Attributes:
        off, doubt: from the reference, and the error of that.
        other, other_doubt: the same of the second method; NaN without one that has converged.
        seconds: of the processor.
    """

    kind: str
    p: float
    rtol: float
    value: float
    stated: float
    off: float
    doubt: float
    other: float
    other_doubt: float
    seconds: float

    @property
    def share(self) -> float:
        """The error over what is stated, less what the references leave open."""
        shares = [max(self.off - self.doubt, 0.0) / self.stated]
        if not math.isnan(self.other):
            shares.append(max(self.other - self.other_doubt, 0.0) / self.stated)
        return max(shares)

    def __str__(self) -> str:
        told = f"{self.value:14.8g} ± {self.stated:.1e} off {self.off:.1e}, {self.other:.1e} ({self.share:.2f})"
        return f"{self.kind:32} p = {self.p:4g} rtol {self.rtol:.1e} {told} {self.seconds:.2f} s"


def solved(problem: Problem, p: float, rtol: float, seconds: float = 60.0) -> tuple[float, float]:
    """Λ(p), or λ for p = 0, and its stated error."""
    solver = ExponentSolver(problem, rtol=rtol, budget=Budget(seconds=seconds))
    if p == 0:
        found = solver.lyapunov_exponent()
        return found.value, found.error_estimate
    solution = solver.solution(p)
    return solution.pair.value, max(solution.error, 0.5 * math.ulp(solution.pair.value))


def compared(seed: int) -> Outcome:
    """By all. Raises `FpsolveError` where a number is refused."""
    case, started = drawn(seed), time.process_time()
    value, stated = solved(case.problem, case.p, case.rtol)
    seconds = time.process_time() - started
    for fine in (FINE, 30 * FINE, 1e-3 * case.rtol, 0.03 * case.rtol, 0.2 * case.rtol):
        try:
            known, doubt = solved(case.problem, case.p, fine, seconds=2.0)
            break
        except FpsolveError:
            continue
    else:
        raise FpsolveError("no reference")
    other, other_doubt = math.nan, math.nan
    if case.second is not None:
        sizes = SIZES[not case.kind.endswith(("impulses", "white", "telegraph"))]
        *coarse, last = (case.second(harmonics, harmonics // 2, known + 1e-6) for harmonics in sizes)
        if (change := max(abs(last - each) for each in coarse)) < 0.3 * stated:
            other, other_doubt = abs(value - last), change
    return Outcome(case.kind, case.p, case.rtol, value, stated, abs(value - known), doubt, other, other_doubt, seconds)


def main(first: int = 1, last: int = 2000) -> int:
    """Print what each system gives; the number of those beyond."""
    found, refused = defaultdict(list), 0
    for seed in range(first, last + 1):
        try:
            each = compared(seed)
        except FpsolveError as failure:
            refused += 1
            print(f"{seed:4} refused: {drawn(seed).kind}: {failure}", flush=True)
            continue
        found[each.kind].append(each)
        if each.share > MOST:
            print(f"{seed:4} {each} !", flush=True)
    print(f"{'':32} count  second  median  largest error over what is stated")
    for kind, outcomes in sorted(found.items()):
        shares, others = [each.share for each in outcomes], sum(not math.isnan(each.other) for each in outcomes)
        print(f"{kind:32} {len(shares):5}  {others:6}  {np.median(shares):6.2f}  {max(shares):7.2f}")
    every = [each for outcomes in found.values() for each in outcomes]
    beyond = sum(each.share > MOST for each in every)
    seconds = sum(each.seconds for each in every)
    print(f"{beyond} of {len(every)} beyond {MOST} of what is stated, {refused} refused; {seconds:.0f} s for all")
    return beyond


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])) > 0)
