"""Choosing the discretisation: noise interval, tilt, cells and degrees, until Λ(p) meets a tolerance.

Each stage is solved on a mesh and on a finer one. How fast the effect of a cell's modes falls with their degree is how
fast the cell converges, and decides between a higher degree and smaller cells. The noise interval is cut where the
tilted density leaves too little for the tolerance, and the functions are tilted towards where it lies.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Annotated

import numpy as np
from pydantic.dataclasses import dataclass as pydantic_dataclass

from fpsolve.arrays import FloatArray
from fpsolve.errors import MeshError, NotConverged, Remedy
from fpsolve.exponent.eigen import PrincipalPair, principal_pair
from fpsolve.exponent.error import ModeEffects, Solution, Stage, mode_effects, noise_marginal, truncation
from fpsolve.exponent.rival import rival
from fpsolve.fem.mesh import CylinderMesh, halved
from fpsolve.fem.space import unknowns
from fpsolve.model.markov_chain import MarkovChain
from fpsolve.model.noise import has_algebraic_tails
from fpsolve.model.parameters import STRICT, parameter
from fpsolve.model.plane import System, phase_speed
from fpsolve.model.problem import AnyNoise, Problem
from fpsolve.theory.frozen import growth_without_turning, likely_center

MAX_PHI_DEGREE, MAX_XI_DEGREE = 14, 10
MAX_STAGES, MOST_CANCELLED = 40, 30.0
LEAST_TILT = 2.5
"""Distance of the tilted density from z = 0 from which on the functions carry an exponential factor."""
SAFETY = 3.0
"""An estimate may be too small by this factor; it must lie below the tolerance by as much."""
TRUNCATION_SHARE, DIRECTION_SHARE = 1e-4, 0.2
"""Shares of the tolerance for the ends of the noise interval, and for each direction."""
SECONDS_PER_UNKNOWN = 3e-7
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


def fits(stage: Stage, problem: Problem, old: float, new: float) -> bool:
    """Whether a stage that serves one p is likely to reach where the tilted density of another lies."""
    tilt = stage.coarse.space.xi.tilt
    way = abs(likely_center(problem, new) - likely_center(problem, old))
    return way <= 3.0 and (new != 0 or tilt == 0)


def resolve(
    problem: Problem,
    p: float,
    *,
    tolerance: Callable[[float], float],
    rtol: float,
    budget: Budget,
) -> tuple[Stage, Solution]:
    """A stage on which the error of Λ(p) is within a tolerance, and the solution there.

    Args:
        p: the moment, not 0, where Λ has no scale.
        tolerance: the largest error allowed, from a value of Λ(p).
        rtol: about what that is relative to the size of Λ(p), for a first mesh.

    Raises:
        NotConverged: the budget does not suffice, or rounding is larger than the tolerance; `partial` is the best
            `Solution`, or None.
    """
    meter = _Meter(problem.noise, p, budget)
    found = _search(problem, likely_center(problem, p), tolerance, rtol, meter)
    elsewhere = rival(found[1].pair)
    if elsewhere is not None:
        other = _search(problem, elsewhere, tolerance, rtol, meter)
        found = max(found, other, key=lambda item: item[1].pair.value)
    return found


def _search(
    problem: Problem,
    center: float,
    tolerance: Callable[[float], float],
    rtol: float,
    meter: _Meter,
) -> tuple[Stage, Solution]:
    """What `resolve` promises, with the tilted density sought around some z."""
    p, start = meter.p, None
    mesh_and_tilt = _affordable(problem, center, rtol, meter.budget)
    guess = growth_without_turning(problem, p, center)
    while True:
        mesh, tilt = mesh_and_tilt
        meter.check(mesh)
        try:
            stage = Stage.on(problem, mesh, tilt)
            pair = principal_pair(stage.coarse, p, start=start, guess=guess)
            allowed = tolerance(pair.value)
            moved = _moved(pair, TRUNCATION_SHARE * allowed)
            if moved is not None and meter.obstacle(moved[0]) is None:
                mesh_and_tilt, start = moved, pair
                continue
            solution = Solution(pair, principal_pair(stage.fine, p, start=pair, guess=guess))
        except (MeshError, NotConverged, RuntimeError, np.linalg.LinAlgError) as failure:
            meter.failure, start = failure, None
            mesh_and_tilt = _halved(mesh), tilt
            continue
        if SAFETY * solution.error <= allowed:
            return stage, solution
        meter.note(solution, allowed)
        mesh_and_tilt, start = (_refined(solution, allowed), tilt), solution.finer


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
    cost: float = SECONDS_PER_UNKNOWN
    last: tuple[float, int] = (0.0, 0)

    def check(self, mesh: CylinderMesh) -> None:
        """Refuse a stage beyond the budget, and count it."""
        if self.last[1]:
            self.cost = max(SECONDS_PER_UNKNOWN, (self.elapsed - self.last[0]) / self.last[1] ** 1.5)
        obstacle = self.obstacle(mesh)
        if obstacle:
            self.stop(obstacle)
        self.last, self.stages = (self.elapsed, unknowns(mesh.enriched(1.0), self.noise)), self.stages + 1

    def obstacle(self, mesh: CylinderMesh) -> str | None:
        """Why the budget does not suffice for a stage, or None."""
        size = unknowns(mesh.enriched(1.0), self.noise)
        seconds = self.elapsed + self.cost * size**1.5
        if size > self.budget.unknowns:
            return f"the next mesh has {size} unknowns, more than budget.unknowns = {self.budget.unknowns}"
        if seconds > self.budget.seconds:
            return f"the next mesh needs some {seconds:.2g} s, more than budget.seconds = {self.budget.seconds:g}"
        return f"{MAX_STAGES} meshes were tried" if self.stages >= MAX_STAGES else None

    @property
    def elapsed(self) -> float:
        return time.thread_time() - self.started

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


def _halved(mesh: CylinderMesh) -> CylinderMesh:
    """Twice the cells each way, where nothing is known yet."""
    return replace(mesh, phi_lines=halved(mesh.phi_lines), z_lines=halved(mesh.z_lines))


def _affordable(problem: Problem, center: float, rtol: float, budget: Budget) -> tuple[CylinderMesh, float]:
    """The first mesh and tilt, for a larger rtol where the budget allows no more: it gives at least a partial value."""
    most = min(budget.unknowns, (budget.seconds / SECONDS_PER_UNKNOWN) ** (2 / 3))
    while True:
        mesh, tilt = _initial(problem, center, rtol)
        if unknowns(mesh.enriched(1.0), problem.noise) <= most or rtol > 1e-3:
            return mesh, tilt
        rtol *= 10


def _initial(problem: Problem, center: float, rtol: float) -> tuple[CylinderMesh, float]:
    """A first mesh and tilt for a tilted density around some z."""
    noise, degree = problem.noise, round(3 - math.log10(rtol))
    phi_degree, xi_degree = min(max(degree - 2, 4), MAX_PHI_DEGREE), min(max(degree - 4, 3), MAX_XI_DEGREE)
    if isinstance(noise, MarkovChain):
        cells = _phi_cells(problem.system, np.array(noise.states), np.array(noise.states))
        return CylinderMesh(_phi_lines(problem.system, cells), np.zeros(0), phi_degree, xi_degree), 0.0
    unit, reach = noise.standard_deviation, math.sqrt(2 * math.log(1e5 / rtol))
    lower, upper = (center, center) if abs(center) > LEAST_TILT else (min(center, 0.0), max(center, 0.0))
    end = noise.half_width / unit
    lower, upper = max(lower - reach, -end), min(upper + reach, end)
    if not upper - lower > 0.1:  # the center lies beyond the support
        lower, upper = (end - 1, end) if center > 0 else (-end, 1 - end)
    cells = _phi_cells(problem.system, unit * np.array([lower, upper]), unit * reach * np.array([-1.0, 1.0]))
    z_lines = _xi_lines(lower, upper, has_algebraic_tails(noise))
    return CylinderMesh(_phi_lines(problem.system, cells), z_lines, phi_degree, xi_degree), _tilt(center)


def _phi_cells(system: System, ends: FloatArray, reach: FloatArray) -> int:
    """More where the phase turns back for a ξ at one of the ends, or its speed changes much within the reach of ξ."""
    widest, usual = (
        float(np.max(speed.amplitude / np.maximum(np.abs(speed.mean), 1e-300)))
        for speed in (phase_speed(system, ends), phase_speed(system, reach))
    )
    return 6 if widest > 1 else 2 if usual > 0.25 else 1


def _phi_lines(system: System, cells: int) -> FloatArray:
    """Equal cells on a half circle from one kick to where it comes again, and a line at every other kick."""
    rays = [kick.phase for kick in system.kicks] or [math.pi / 2]
    lines = rays[0] + np.linspace(0, math.pi, cells + 1)
    others = rays[0] + np.mod(np.array(rays[1:]) - rays[0], math.pi)
    near = np.min(np.abs(lines[1:-1, None] - others[None]), axis=1, initial=math.inf) < 0.3 * math.pi / cells
    return np.sort(np.concatenate([lines[:1], lines[1:-1][~near], lines[-1:], others]))


def _tilt(center: float) -> float:
    return 0.5 * center if abs(center) > LEAST_TILT else 0.0


def _xi_lines(lower: float, upper: float, algebraic: bool) -> FloatArray:
    """Lines at most 3.6 noise units apart, further out for algebraic tails."""
    if algebraic:
        steps = np.concatenate([[0.0], 3.0 * 1.5 ** np.arange(60)])
        above, below = (np.append(steps[steps < 0.8 * end], end) for end in (upper, -lower))
        return np.concatenate([-below[:0:-1], above])
    return np.linspace(lower, upper, max(2, math.ceil((upper - lower) / 3.6)) + 1)


def _refined(solution: Solution, tolerance: float) -> CylinderMesh:
    """A mesh on which every cell's effect should be its share of the tolerance.

    The effects are calibrated by the error measured, as their parts cancel, or what a cell lacks harms others.
    """
    mesh = solution.pair.generator.space.mesh
    effects = [mode_effects(solution.finer, axis) for axis in range(len(solution.pair.generator.space.axes))]
    seen = sum(each.above(degree) for each, degree in zip(effects, (mesh.phi_degree, mesh.xi_degree), strict=False))
    share = DIRECTION_SHARE * tolerance * min(MOST_CANCELLED, seen / solution.error)
    phi_lines, phi_degree = _split(mesh.phi_lines, MAX_PHI_DEGREE, effects[0], share)
    new = replace(mesh, phi_lines=phi_lines, phi_degree=phi_degree)
    if len(effects) > 1:
        z_lines, xi_degree = _split(mesh.z_lines, MAX_XI_DEGREE, effects[1], share)
        new = replace(new, z_lines=z_lines, xi_degree=xi_degree)
    noise = solution.pair.generator.problem.noise
    return new if unknowns(new, noise) > unknowns(mesh, noise) else mesh.enriched(1.0)


def _split(lines: FloatArray, most: int, effects: ModeEffects, tolerance: float) -> tuple[FloatArray, int]:
    """Lines and a degree, at most `most`, with which every cell's effect should meet the tolerance."""
    needed = effects.needed(max(tolerance, 1e-290) / math.sqrt(lines.size - 1))
    parts = np.where(needed > 3 * most, 3, np.where(needed > most, 2, 1))
    new = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(lines[:-1], lines[1:], parts, strict=True)]
    wanted = math.ceil(np.max(needed / parts + (parts > 1)) + 0.3)  # parts of a cell need about as much less
    return np.concatenate([*new, lines[-1:]]), int(np.clip(wanted, 4, most))


def _moved(pair: PrincipalPair, tolerance: float) -> tuple[CylinderMesh, float] | None:
    """A mesh whose ends, and a tilt, follow the tilted density; None where they already do."""
    space, noise = pair.generator.space, pair.generator.problem.noise
    if isinstance(noise, MarkovChain):
        return None
    mesh, end = space.mesh, noise.half_width / noise.standard_deviation
    effects, is_algebraic = truncation(pair), has_algebraic_tails(noise)
    z, density = noise_marginal(pair)
    ends = []
    for sign, line, effect in zip((-1, 1), mesh.z_lines[[0, -1]], effects, strict=True):
        is_short = effect > tolerance and abs(line) < end * (1 - 1e-12)
        way = _extension(sign * (z - line), density, effect / tolerance, abs(line) * is_algebraic) if is_short else 0.0
        ends.append(float(np.clip(line + sign * way, -end, end)))
    tilt = _tilt(float(z @ density / density.sum()))
    if abs(tilt - space.xi.tilt) <= 1.0:
        tilt = space.xi.tilt
    if tilt == space.xi.tilt and ends == [*mesh.z_lines[[0, -1]]]:
        return None
    new = _xi_lines(ends[0], ends[1], is_algebraic)
    step = 0.3 * np.min(np.diff(new))
    kept = mesh.z_lines[(mesh.z_lines > ends[0] + step) & (mesh.z_lines < ends[1] - step)]
    if tilt == space.xi.tilt and kept.size:
        outer = new[(new < kept[0] - step) | (new > kept[-1] + step)]
        new = np.sort(np.concatenate([kept, outer]))
    return replace(mesh, z_lines=new), tilt


def _extension(outward: FloatArray, density: FloatArray, excess: float, algebraic_at: float) -> float:
    """How far an end must move out to lessen its effect by a factor, from how the density falls towards it.

    Args:
        outward: distances from the end, negative, with the `density` there.
        excess: the factor.
        algebraic_at: |z| of the end where the tail is algebraic, 0 where it is like a Gaussian.
    """
    near, width = outward >= min(-2.0, float(np.sort(outward)[-6])), float(np.ptp(outward))
    fall = -np.polyfit(outward[near], np.log(np.maximum(density[near], 1e-300)), 1)[0]
    if algebraic_at and fall * algebraic_at > 2:
        return algebraic_at * math.expm1(min(math.log(excess) / (fall * algebraic_at - 1), 1.2))
    if algebraic_at or fall < 0.3:
        return 0.7 * width
    return min(0.3 - fall + math.sqrt(fall**2 + 2 * math.log(excess)), 1.5 * width)
