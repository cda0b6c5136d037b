"""Numbers of all cases and of 200 random problems, frozen with their truth, to compare after each step of a change.

`python -m tests.frozen [begin]` solves them again, of those alone whose name begins so if that is given, and prints
which have gone wrong: off the truth by more than what is stated, stated with an error above the tolerance or ten times
the frozen one, or not given any more within the default budget. In frozen.json is each number as its users got it, and
once at the smallest rtol that converged.

Every number is asked for alone, as a user would: Λ(p), λ, δ_p, Λ″(0), and Λ of some p of a curve of many.
"""

from __future__ import annotations

import json
import math
import multiprocessing
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem, load_case, moment_lyapunov
from fpsolve.errors import FpsolveError, NotConverged
from fpsolve.exponent import Budget, lyapunov_exponent, stability_index
from fpsolve.exponent.kinds import choose
from fpsolve.exponent.solver import solver_of
from fpsolve.messages import Code
from fpsolve.model import NonGaussianNoise, Telegraph, VibroImpactOscillator, White

ROOT = Path(__file__).parents[1]
FILE = Path(__file__).with_suffix(".json")
MOST_SECONDS = 30.0
"""Of a processor for one number; one that takes longer counts as not given."""
CURVE = 33
"""Number of p of a curve."""
WORSE = 10.0
"""Largest stated error, over the frozen one."""
ROUNDED = 1e-13
"""Share of a number or its scale that may be off in any case."""


@dataclass(frozen=True)
class Number:
    """What is asked of a problem.

    Attributes:
        name: "λ", "δ_p", "Λ″", "Λ(p)" or "curve(p)".
        p: the moment, NaN for those that have none.
        interval: of the curve.
        known: the right value where a second method gives it.
        rtol: that of a case.
        parameters: which set of a case it is of.
    """

    problem: Problem
    name: str
    p: float = math.nan
    interval: tuple[float, float] = (0.0, 0.0)
    known: float | None = None
    rtol: float | None = None
    parameters: int = 1

    @property
    def key(self) -> str:
        of = f"{self.name}({self.p:.6g})" if math.isfinite(self.p) else self.name
        return of if self.parameters == 1 else f"set {self.parameters}, {of}"

    def solved(self) -> tuple[float, float, bool]:
        """Value, stated error, and whether that meets the tolerance. Raises what fpsolve raises."""
        if self.name in ("Λ", "curve"):
            points = np.array([self.p])
            if self.name == "curve":
                points = np.union1d(np.linspace(*self.interval, CURVE), points)
            try:
                found = moment_lyapunov(self.problem, points, rtol=self.rtol)
            except NotConverged as failure:
                if self.name != "curve" or not hasattr(failure.partial, "p"):
                    raise
                found = failure.partial
            here = np.flatnonzero(found.p == self.p)
            if not here.size:
                raise NotConverged("not among those that converged")
            value, error = float(found.value[here[0]]), float(found.error_estimate[here[0]])
            size = max(abs(value), found.solver.method.scale(self.p))
            within = error <= max(found.solver.rtol * size, ROUNDED * size)
            return value, error, within or any(each.code is Code.RTOL_MISSED for each in found.warnings)
        if self.name == "Λ″":
            index = solver_of(self.problem, None, self.rtol, Budget()).variance_rate()
        else:
            index = {"λ": lyapunov_exponent, "δ_p": stability_index}[self.name](self.problem, rtol=self.rtol)
        if not index:
            raise NotConverged(str(index))
        return index.value, index.error_estimate, True


class Late(BaseException):
    """A number takes longer than `MOST_SECONDS`; nothing on the way may take it for a failure of its own."""


def _stop(*_: object) -> None:
    raise Late


def limited(number: Number) -> tuple[float, float, bool]:
    """`Number.solved` within `MOST_SECONDS`. Raises `NotConverged` where that is not enough."""
    signal.signal(signal.SIGPROF, _stop)
    signal.setitimer(signal.ITIMER_PROF, MOST_SECONDS)
    try:
        return number.solved()
    except Late:
        raise NotConverged("it takes too long") from None
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def of_problem(problem: Problem, p: tuple[float, ...], interval: tuple[float, float] | None = None) -> Iterator[Number]:
    """Single Λ(p), λ, δ_p and Λ″ of two variables, λ of more, and some p of a curve."""
    method = choose(problem)
    low, high = method.interval
    yield from (Number(problem, "Λ", each) for each in p if not method.reason(each))
    if not method.has_pairs:
        return
    yield Number(problem, "λ")
    if problem.dimension > 2:
        return
    yield from (Number(problem, "δ_p"), Number(problem, "Λ″"))
    if interval:
        ends = max(interval[0], low), min(interval[1], high)
        inner = np.linspace(*ends, CURVE)[[1, 7, 16, 21, 30]]
        if ends[0] < ends[1]:
            yield from (
                Number(problem, "curve", float(each), ends) for each in (*inner, ends[0] + 0.037 * np.ptp(ends))
            )


def of_case(path: Path) -> Iterator[Number]:
    """Those of the first set and of the last, at the rtol of the case."""
    case = load_case(path)
    for number in sorted({1, case.planned}):
        [parameter_set] = case.sets(number - 1, number)
        wanted = {-0.5, 1.0, 2.0, 3.5, *(each.p for each in case.expect if each.p is not None)}
        if not choose(parameter_set.problem).has_pairs:
            wanted = {2.0}
        drawn = (-0.9, 4.0) if parameter_set.problem.dimension == 2 else None
        for each in of_problem(parameter_set.problem, tuple(sorted(wanted)), drawn):
            yield replace(each, rtol=case.rtol, parameters=number)


def of_random(family: str, seed: int) -> Iterator[Number]:
    """Those of a random problem; its family and seed draw it."""
    from tests.campaign import planar, same, spaces

    match family:
        case "problem":
            drawn, p = planar.oscillator(seed)
            return of_problem(drawn.problem, (p,), (-0.9, 3.0) if seed % 4 == 0 else None)
        case "planar":
            curve = (-0.8, 4.0) if seed % 3 == 0 else None
            return of_problem(planar.drawn(seed).problem, (1.0, 2.0), curve)
        case "wall":
            return of_problem(planar.walled(seed).problem, (-0.5, 1.0, 2.0))
        case "unit":
            return of_problem(same.restated(*same.in_units(seed)), (1.0, 2.0))
        case "modes":
            return of_problem(spaces.modes(seed), (-1.0, 1.0, 2.0))
        case "many":
            return of_problem(spaces.many(seed)[0], (2.0,))
        case "delay":
            return of_problem(spaces.delayed(seed)[0], (2.0,))
    return of_problem(spaces.stopped(seed), (1.0,))


COUNTS = {
    "problem": 40,
    "planar": 72,
    "wall": 40,
    "unit": 20,
    "many": 12,
    "delay": 8,
    "modes": 6,
    "stop": 2,
}
"""Of random problems of each family."""


def of_rows() -> Iterator[Number]:
    """Numbers that were wrong, with values of second methods."""
    law = NonGaussianNoise(D0=1.0, tau0=0.5, r0=1.3)
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.7)
    yield Number(Problem(oscillator, law), "λ", known=0.1391733289)
    noisy = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.1*v - 0.6*xi*v"), {})
    tails = Problem(noisy, NonGaussianNoise(D0=0.5, tau0=0.4, r0=1.35))
    yield Number(tails, "λ", known=0.0232753920, rtol=1e-7)
    for noise, factor, p, known in (
        (Telegraph(a=0.5, k=0.5), 0.2, 20.0, -7.72612714453),
        (White(s=0.05), 0.2, 20.0, -11.1134497872),
        (White(s=0.05), 0.3, 12.0, -5.15661785699),
        (Telegraph(a=0.2, k=0.3), 0.2, -2.0, 1.13647671684),
    ):
        wall = {"at": "x = 0", "restitution": factor}
        walled = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.1*v - xi*x"), {}, walls=[wall])
        yield Number(Problem(walled, noise), "Λ", p, known=known)
    saddle = PlaneSystem.of_equations(("x", "v"), ("0.5*x + xi*v", "-0.5*v + xi*x"), {})
    for p, known in ((-1.1, -0.454458439307), (-0.95, None), (1.3, None), (5.7, None)):
        yield Number(Problem(saddle, White(s=0.1)), "curve", p, (-1.1, 6.0), known=known)
    slow = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.1*v - xi*x"), {})
    for p in (-1e-3, -0.5, 1e-3):
        yield Number(Problem(slow, Telegraph(a=0.3, k=0.05)), "curve", p, (-1.0, 1e-2 if p > 0 else -1e-4))
    for p in (-1e-3, 1e-3, 2.5):
        yield Number(Problem(slow, OrnsteinUhlenbeck(alpha=0.05, sigma=0.1)), "curve", p, (-0.9, 3.0))


def tasks() -> Iterator[tuple[str, Callable[[], Iterator[Number]]]]:
    """By name."""
    for path in sorted((ROOT / "cases").glob("**/*.toml")):
        if path.stem not in ("flutter", "minimal", "rattling", "theorem"):  # minutes, or nothing of their own
            yield f"case {path.stem}", partial(of_case, path)
    for family, count in COUNTS.items():
        yield from ((f"{family} {seed}", partial(of_random, family, seed)) for seed in range(count))
    for place, row in enumerate(of_rows()):
        yield f"row {place:02}", partial(iter, [row])


def frozen(task: tuple[str, Callable[[], Iterator[Number]]]) -> tuple[str, dict[str, Any]]:
    """Each number as its users get it: value, error, whether it meets the tolerance, seconds; or why there is none."""
    name, numbers = task
    found = dict[str, Any]()
    for number in numbers():
        start = time.process_time()
        try:
            found[number.key] = [*limited(number), time.process_time() - start]
        except (FpsolveError, ArithmeticError, ValueError) as failure:
            found[number.key] = [str(failure)[:120], time.process_time() - start]
    return name, found


def wrong(before: dict[str, Any] | None, now: list[Any], true: list[float] | None) -> str:
    """How a number has gone wrong; empty where it has not."""
    known = before["user"] if before else None
    was_given = bool(known) and isinstance(known[0], float)
    if isinstance(now[0], str):
        return f"not given any more: {now[0]}" if was_given else ""
    value, error, within = now[:3]
    told = []
    if true and abs(value - true[0]) > error + true[1] + ROUNDED * abs(value):
        told.append(f"{abs(value - true[0]):.1e} off, {error:.1e} stated, {true[1]:.1e} of the truth")
    if was_given and known[2] and not within:
        told.append(f"stated {error:.1e} is above the tolerance")
    if was_given and error > WORSE * max(known[1], ROUNDED * abs(value)):
        told.append(f"stated {error:.1e}, {known[1]:.1e} before")
    return "; ".join(told)


def main(begin: str = "") -> int:
    """Compare."""
    wanted = [task for task in tasks() if task[0].startswith(begin)]
    stored = json.loads(FILE.read_text(encoding="utf-8"))
    count, worse, seconds = 0, 0, [0.0, 0.0]
    with multiprocessing.get_context("spawn").Pool(2, maxtasksperchild=8) as pool:
        for each, numbers in pool.imap_unordered(frozen, wanted):
            count += len(numbers)
            for key, number in numbers.items():
                before = stored.get(each, {}).get(key)
                seconds[0] += before["user"][-1] if before else 0.0
                seconds[1] += number[-1]
                if told := wrong(before, number, before and before.get("truth")):
                    worse += 1
                    print(f"{each}, {key}: {told}", flush=True)
    print(f"{count} numbers, {worse} wrong; {seconds[0]:.0f} s before, {seconds[1]:.0f} s now")
    return int(worse > 0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
