"""Choosing the discretisation: functions of the noise, cells and degrees in φ, until Λ(p) meets a tolerance.

How fast the effect of a cell's modes falls with their degree is how fast the cell converges, and decides between a
higher degree and smaller cells. Polynomials of the noise are tilted towards where the tilted density lies.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

import numpy as np
from pydantic.dataclasses import dataclass as pydantic_dataclass

from fpsolve.arrays import FloatArray
from fpsolve.errors import MeshError, NotConverged, Remedy
from fpsolve.exponent.eigen import principal_pair
from fpsolve.exponent.error import ModeEffects, Solution
from fpsolve.exponent.rival import rival
from fpsolve.fem.factors import MAX_DENSE_UNKNOWNS
from fpsolve.fem.generator import Generator
from fpsolve.fem.mesh import MAX_DEGREE, halved
from fpsolve.fem.space import Discretisation
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.noise import has_algebraic_tails
from fpsolve.model.parameters import STRICT, parameter
from fpsolve.model.plane import System, phase_speed
from fpsolve.model.problem import AnyNoise, Problem
from fpsolve.theory.frozen import frozen_noise

HALVING = 2 * math.log(2)
"""By how much more the logarithm of an effect falls with each degree in half a cell."""
MAX_POLYNOMIALS = 200
MAX_STAGES, FREE_STAGES = 30, 4
"""From the second number of stages on, no cell is made coarser."""
SHARE = 0.05
"""Share of the tolerance that a new discretisation is made for in each direction, so that it serves other p too."""
LEAST_DEGREE, SPLIT_DEGREE, MOST_DEGREE = 4, 6, 14
WORTH_A_TRY = MAX_DENSE_UNKNOWNS
"""Unknowns of a system that takes less time than finding another one."""
MOST_TILT_AWAY = 0.7
"""How far the tilt of a space may be from the best one at another p."""
SECONDS_PER_UNKNOWN = 3e-8
"""A solve takes about this times the power 1.5 of the number of unknowns; it is corrected by the last one."""


@pydantic_dataclass(frozen=True, config=STRICT)
class Budget:
    """What one Λ(p) may cost.

    Args:
        unknowns: of the largest system; memory grows with it, some 10 kB each.
        seconds: for one p; foreseen before every solve from the one before.

    Raises:
        pydantic.ValidationError: a number is out of its range.
    """

    unknowns: Annotated[int, parameter("unknowns of the largest system", "unknowns = 60000", ge=100)] = 60_000
    seconds: Annotated[float, parameter("time for one p", "seconds = 60.0", gt=0)] = 60.0


def resolve(
    problem: Problem,
    p: float,
    *,
    tolerance: Callable[[float], float],
    rtol: float,
    budget: Budget,
    start: Solution | None = None,
) -> Solution:
    """A solution whose error of Λ(p) is within a tolerance.

    Args:
        p: the moment, not 0, where Λ has no scale.
        tolerance: the largest error allowed, from a value of Λ(p).
        rtol: about what that is relative to the size of Λ(p), for a first discretisation.
        start: a solution at p that does not suffice, to go on from.

    Raises:
        NotConverged: the budget does not suffice, or rounding is larger than the tolerance; `partial` is the best
            `Solution`, or None.
    """
    meter = _Meter(problem.noise, p, budget)
    frozen = frozen_noise(problem)
    found = _search(problem, frozen.center(p) if frozen else 0.0, tolerance, rtol, meter, start)
    elsewhere = rival(found.pair)
    if elsewhere is not None:
        other = _search(problem, elsewhere, tolerance, rtol, meter)
        found = max(found, other, key=lambda each: each.pair.value)
    return found


def _search(
    problem: Problem,
    center: float,
    tolerance: Callable[[float], float],
    rtol: float,
    meter: _Meter,
    start: Solution | None = None,
) -> Solution:
    """What `resolve` promises, with the tilted density sought around some z."""
    p, pair = meter.p, None
    if start is None:
        chosen = first(problem, p, center, rtol)
    else:
        chosen, pair = refined(start, tolerance(start.pair.value), 0), start.pair
    while True:
        meter.check(chosen)
        try:
            pair = principal_pair(Generator(problem, chosen), p, start=pair)
        except (MeshError, NotConverged, RuntimeError, np.linalg.LinAlgError) as failure:
            meter.failure, pair = failure, None
            chosen = _doubled(chosen)
            continue
        solution = Solution(pair)
        allowed = tolerance(pair.value)
        if solution.error <= allowed:
            return solution
        meter.note(solution, allowed)
        chosen = refined(solution, allowed, meter.stages)


@dataclass
class _Meter:
    """What a search for a discretisation has cost, and the best it has found."""

    noise: AnyNoise
    p: float
    budget: Budget
    started: float = field(default_factory=time.thread_time)
    stages: int = 0
    best: Solution | None = None
    share: float = math.inf
    failure: Exception | None = None
    last: tuple[float, int] = (0.0, 0)

    def check(self, chosen: Discretisation) -> None:
        """Refuse a stage beyond the budget, and count it."""
        size, elapsed = chosen.unknowns(self.noise), time.thread_time() - self.started
        cost = max(SECONDS_PER_UNKNOWN, (elapsed - self.last[0]) / max(self.last[1], 1) ** 1.5 if self.last[1] else 0.0)
        seconds = elapsed + cost * size**1.5
        if size > self.budget.unknowns:
            self.stop(f"the next mesh has {size} unknowns, more than budget.unknowns = {self.budget.unknowns}")
        if seconds > self.budget.seconds:
            self.stop(f"the next mesh needs some {seconds:.2g} s, more than budget.seconds = {self.budget.seconds:g}")
        if self.stages >= MAX_STAGES:
            self.stop(f"{MAX_STAGES} meshes were tried")
        self.last, self.stages = (elapsed, size), self.stages + 1

    def note(self, solution: Solution, allowed: float) -> None:
        """Keep the best solution; stop where only rounding is left."""
        if solution.error / allowed < self.share:
            self.best, self.share = solution, solution.error / allowed
        if solution.pair.rounding > allowed:
            self.stop(f"rounding alone may change it by {solution.pair.rounding:.1e}: use a larger rtol")

    def stop(self, reason: str) -> None:
        if self.best is None:
            text = "no mesh resolved it"
            if isinstance(self.failure, NotConverged):
                text += ", as the layers of slow, strong noise are too thin"
            if self.failure:
                text += f" ({self.failure})"
            raise NotConverged(f"Λ({self.p:g}) did not converge: {reason}; {text}; {Remedy.BUDGET}")
        best = self.best
        raise NotConverged(
            f"Λ({self.p:g}) did not converge: {reason}; best value {best.pair.value:.6g} with an estimated error of "
            f"{best.error:.1e}, {self.share:.1e} times the tolerance; {Remedy.BUDGET}",
            best,
        )


def fits(generator: Generator, q: float, p: float) -> bool:
    """Whether what serves q is likely to serve p, or so small that it is worth a try."""
    frozen = frozen_noise(generator.problem)
    if generator.size > WORTH_A_TRY and abs(p - q) > max(0.5, 0.4 * min(abs(p), abs(q))):
        return False
    if frozen is None or not generator.chosen.polynomials:
        return True
    return abs(frozen.tilt(frozen.center(p)) - generator.chosen.slope * p) <= MOST_TILT_AWAY


def first(problem: Problem, p: float, center: float, rtol: float) -> Discretisation:
    """A first discretisation, small, for a tilted density around some z."""
    noise, system, digits = problem.noise, problem.system, -math.log10(rtol)
    if isinstance(noise, MarkovChain):
        states = np.array(noise.states)
        return _with_phi(Discretisation(np.zeros(0), None), system, states, digits)
    unit = noise.standard_deviation
    end = noise.half_width / unit
    reach = np.clip(center + np.array([-2.0, 2.0]), -end, end)
    if has_algebraic_tails(noise):
        chosen = Discretisation(np.zeros(0), None, z_lines=_graded(12.0 + abs(center)), xi_degree=round(2 + digits / 2))
    else:
        frozen = frozen_noise(problem)
        slope = frozen.tilt(center) / p if frozen else 0.0
        count = round(digits / 2) + (3 if math.isinf(end) else 5)
        chosen = Discretisation(np.zeros(0), None, polynomials=count, slope=slope)
    return _with_phi(chosen, system, unit * reach, digits)


def _with_phi(chosen: Discretisation, system: System, xi: FloatArray, digits: float) -> Discretisation:
    """With cells in φ, more where its speed changes much for some of the ξ."""
    speed = phase_speed(system, xi)
    widest = float(np.max(speed.amplitude / np.maximum(np.abs(speed.mean), 1e-300)))
    lines = _phi_lines(system, 8 if widest > 1 else 4 if widest > 0.5 else 2)
    degrees = np.full(lines.size - 1, round(np.clip(digits + 2 - (widest > 0.5) * 4, 4, MOST_DEGREE)))
    return replace(chosen, phi_lines=lines, phi_degrees=degrees)


def _phi_lines(system: System, cells: int) -> FloatArray:
    """Equal cells on a half circle from one kick to where it comes again, and a line at every other kick."""
    rays = [kick.phase for kick in system.kicks] or [math.pi / 2]
    lines = rays[0] + np.linspace(0, math.pi, cells + 1)
    others = rays[0] + np.mod(np.array(rays[1:]) - rays[0], math.pi)
    near = np.min(np.abs(lines[1:-1, None] - others[None]), axis=1, initial=math.inf) < 0.3 * math.pi / cells
    return np.sort(np.concatenate([lines[:1], lines[1:-1][~near], lines[-1:], others]))


def _graded(end: float) -> FloatArray:
    """Lines on both sides, further apart further out."""
    steps = np.concatenate([[0.0], 3.0 * 1.5 ** np.arange(60)])
    side = np.append(steps[steps < 0.8 * end], end)
    return np.concatenate([-side[:0:-1], side])


def _doubled(chosen: Discretisation) -> Discretisation:
    """Twice as many functions each way, where nothing is known yet."""
    fine = replace(chosen, phi_lines=halved(chosen.phi_lines), phi_degrees=np.repeat(chosen.phi_degrees, 2))
    if chosen.polynomials:
        return replace(fine, polynomials=min(2 * chosen.polynomials, MAX_POLYNOMIALS))
    return replace(fine, z_lines=halved(chosen.z_lines)) if chosen.z_lines.size else fine


def refined(solution: Solution, tolerance: float, stages: int) -> Discretisation:
    """A discretisation on which every cell should lack no more than its share of the tolerance."""
    chosen, noise = solution.pair.generator.chosen, solution.pair.generator.problem.noise
    share, may_coarsen = SHARE * tolerance, stages < FREE_STAGES
    phi, xi = solution.effects
    lines, degrees = _split(chosen.phi_lines, phi, share, may_coarsen)
    new = replace(chosen, phi_lines=lines, phi_degrees=degrees)
    if xi and chosen.polynomials:
        needed = math.ceil(float(xi.needed(share)[0]) + 1.3)
        least = max(chosen.polynomials // 2, 3) if may_coarsen else chosen.polynomials
        most = min(3 * chosen.polynomials // 2 + 3, MAX_POLYNOMIALS)
        new = replace(new, polynomials=max(least, min(needed, most)))
    elif xi:
        lines, degrees = _split(chosen.z_lines, xi, share, may_coarsen)
        new = replace(new, z_lines=_reaching(lines, solution, share), xi_degree=int(np.max(degrees)))
    grows = new.unknowns(noise) > chosen.unknowns(noise)
    return new if grows or solution.error <= tolerance else _raised(new)


def _split(lines: FloatArray, effects: ModeEffects, share: float, may_coarsen: bool) -> tuple[FloatArray, Any]:
    """Lines and a degree for each cell with which all together should lack no more than a share.

    A cell is halved where that takes fewer unknowns: in a smaller cell the effects fall faster.
    """
    rate, needed = effects.fall, effects.needed(max(share, 1e-290) / math.sqrt(effects.degrees.size))
    if not may_coarsen:
        needed = np.maximum(needed, effects.degrees)
    in_half = needed * rate / (rate + HALVING)
    is_split = (2 * in_half + 2 < needed + 1) & (effects.degrees >= SPLIT_DEGREE) & (needed > effects.degrees)
    is_split |= needed > MOST_DEGREE
    degrees = np.ceil(np.where(is_split, in_half, needed) + 0.2)
    degrees = np.clip(degrees, np.maximum(LEAST_DEGREE, effects.degrees - 4), effects.degrees + 4)
    new = [np.linspace(a, b, n + 2)[:-1] for a, b, n in zip(lines[:-1], lines[1:], is_split, strict=True)]
    return np.concatenate([*new, lines[-1:]]), np.repeat(np.minimum(degrees, MOST_DEGREE).astype(int), is_split + 1)


def _raised(chosen: Discretisation) -> Discretisation:
    """One more function each way, where what a cell lacks harms others."""
    if chosen.polynomials:
        chosen = replace(chosen, polynomials=min(chosen.polynomials + 2, MAX_POLYNOMIALS))
    elif chosen.xi_degree:
        chosen = replace(chosen, xi_degree=min(chosen.xi_degree + 1, MAX_DEGREE))
    return replace(chosen, phi_degrees=np.minimum(chosen.phi_degrees + 1, MAX_DEGREE))


def _reaching(lines: FloatArray, solution: Solution, share: float) -> FloatArray:
    """Lines with a further cell at each end whose effect is more than a share of the tolerance."""
    lower, upper = solution.truncation
    below = [1.6 * lines[0]] if lower > share else []
    above = [1.6 * lines[-1]] if upper > share else []
    return np.concatenate([below, lines, above])
