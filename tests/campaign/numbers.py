"""What the families share: numbers beside second methods, what fpsolve finds, and what paths find."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fpsolve import FpsolveError, NotConverged, Problem, lyapunov_exponent, moment_lyapunov, simulate
from fpsolve.exponent import Budget

MOST = 1.5
"""Of the stated error, how far a number may be off beside the doubt of the second method."""
DEVIATIONS = {"simulation": 4.0, "spectrum": 4.5, "record": 4.5}
"""Standard errors, in place of the doubt, for methods that have these."""
SETTLED = 1e-3
"""Of a number, how far a second method may be off to tell anything."""
SECONDS = 15.0
"""Of the processor, for each number."""
STEPS = 2e6
"""Path-steps of a simulation: some seconds."""


def name(p: float) -> str:
    """Of Λ(p), or of λ, for which 0 stands."""
    return f"Λ({p:g})" if p else "λ"


def between(low: float, high: float, rng: np.random.Generator) -> float:
    """A number of these limits, log-uniform."""
    return float(np.exp(rng.uniform(math.log(low), math.log(high))))


class Solved(NamedTuple):
    """A number by fpsolve with its stated error, NaN where it is refused, why, and seconds of the processor."""

    value: float
    stated: float
    seconds: float = 0.0
    reason: str = ""


Known = tuple[float, float]
"""A number by a second method, and its doubt or standard error; NaN where it does not settle."""
UNKNOWN = math.nan, math.nan


@dataclass(frozen=True)
class Number:
    """A number by both methods."""

    name: str
    found: Solved
    known: Known
    method: str

    @property
    def off(self) -> float:
        return abs(self.found.value - self.known[0])

    @property
    def is_wrong(self) -> bool:
        own = MOST * self.found.stated + 1e-13 * abs(self.known[0])
        return self.off > own + DEVIATIONS.get(self.method, 1.0) * self.known[1]

    @property
    def is_unknown(self) -> bool:
        """Whether the second method tells nothing."""
        return not self.known[1] < (1.0 if self.method in (*DEVIATIONS, "segments") else SETTLED) * abs(self.known[0])

    def __str__(self) -> str:
        value, stated, _, reason = self.found
        told = f"refused: {reason}" if reason else f"{value:.12g} ± {stated:.1e}"
        return f"{self.name}: {told}, {self.method} {self.known[0]:.12g} ± {self.known[1]:.1e}"


def asked(solve: Callable[[], tuple[float, float]]) -> Solved:
    """What a function of fpsolve gives, or why it gives nothing."""
    started, value, stated, reason = time.process_time(), math.nan, math.nan, ""
    try:
        value, stated = map(float, solve())
    except FpsolveError as failure:
        reason = " ".join(str(failure).split())
    return Solved(value, stated, time.process_time() - started, reason)


def elements(
    problem: Problem, orders: Iterable[float], rtol: float | None = None, seconds: float = SECONDS
) -> list[Solved]:
    """Λ(p), each alone, and λ for 0."""

    def at(p: float) -> tuple[float, float]:
        how = {"rtol": rtol, "budget": Budget(seconds=seconds)}
        if p:
            made = moment_lyapunov(problem, p, **how)
            return made.value[0], made.error_estimate[0]
        rate = lyapunov_exponent(problem, **how)
        return rate.value, rate.error_estimate

    return [asked(lambda p=p: at(p)) for p in orders]  # type: ignore[misc]


def together(problem: Problem, orders: Sequence[float], rtol: float) -> list[Solved]:
    """Λ(p) at all p at once."""
    started, reason = time.process_time(), ""
    try:
        made = moment_lyapunov(problem, [*orders], rtol=rtol, budget=Budget(seconds=SECONDS))
    except NotConverged as failure:
        made, reason = failure.partial, str(failure)
    except FpsolveError as failure:
        made, reason = None, str(failure)
    seconds = (time.process_time() - started) / len(orders)
    rows = zip(made.p, made.value, made.error_estimate, strict=True) if made else ()
    given = {p: Solved(float(value), float(error), seconds) for p, value, error in rows}
    return [given.get(p) or Solved(*UNKNOWN, seconds, reason or "not given") for p in orders]


def limits(problem: Problem) -> tuple[float, float]:
    """The least time of a simulation, two transients, and its largest step, as the refusals of others state them."""
    found = []
    for wrong, what in ({"time": 1e-300}, r"must be >= (\S+), two"), ({"step": 1e300}, r"and <= (\S+);"):
        try:
            simulate(problem, 1.0, paths=32, **wrong)
        except ValueError as refusal:
            told = re.search(what, str(refusal))
            found.append(float(told[1]) if told else math.inf)
    return found[0] * 1.001, found[1]


def paths_of(
    problem: Problem,
    orders: Sequence[float],
    *,
    paths: int = 2048,
    lengths: float = 4.0,
    steps: float = STEPS,
    seed: int = 1,
) -> list[Known]:
    """Λ(p), and λ for 0, by populations of paths, of so many least times if there are steps enough; NaN where not.

    A number of which the simulation says that it still drifts is NaN, too, as its standard error then tells nothing.
    """
    try:
        least, step = limits(problem)
        taken = 2 * least / step * paths  # the step is about half the largest one
        if taken > 8 * steps:
            return [UNKNOWN for _ in orders]
        length = least * max(1.0, min(lengths, steps / taken))
        wanted = [p for p in orders if p] or [1.0]
        made = simulate(problem, wanted, estimator="population", paths=paths, time=length, seed=seed)
    except (FpsolveError, ValueError):
        return [UNKNOWN for _ in orders]
    drifting = {each.data["p"] for each in made.warnings if each.code.name == "DRIFTING"}
    found = {
        each.p: (each.value, each.standard_error) if each.value and each.p not in drifting else UNKNOWN
        for each in made.estimates
    }
    found[0.0] = made.lyapunov_exponent, made.lyapunov_exponent_error
    return [found[p] for p in orders]


def beside(
    orders: Sequence[float], found: Iterable[Solved], known: Iterable[Known], method: str = "simulation"
) -> Iterator[Number]:
    """A number for each p."""
    for p, solved, pair in zip(orders, found, known, strict=True):
        yield Number(name(p), solved, pair, method)
