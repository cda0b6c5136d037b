"""Numbers of all cases and of random problems with their errors, to compare after each step of a change of the code.

`python -m tests.frozen` solves them again and prints those that have moved: by more than the stated errors of both
together, or, on a space of as many unknowns, by more than 1e-11 of their scale. `python -m tests.frozen write` writes
them to frozen.json.
"""

from __future__ import annotations

import json
import multiprocessing
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np

from fpsolve import ExponentSolver, Problem, load_case
from fpsolve.errors import FpsolveError
from fpsolve.exponent import INDICES, Budget, solve_moments
from fpsolve.parts.response import solve_response
from tests import random_modes, random_planar, random_problems, random_systems, random_units

ROOT = Path(__file__).parents[1]
FILE = Path(__file__).with_suffix(".json")
SAME_SPACE = 1e-11
MOMENTS = -0.5, 0.0, 1.0, 2.0, 3.5
SECONDS = 20.0
Number = tuple[float, float, float, int]
"""Value, error, scale, and unknowns; the last is 0 where several spaces have a part in it."""


def of_problem(problem: Problem, rtol: float, p: tuple[float, ...], indices: tuple[str, ...]) -> dict[str, Number]:
    """Λ(p) at each p alone, and indices; what is refused is left out."""
    found, budget = dict[str, Number](), Budget(seconds=SECONDS)
    for each in p:
        solver = ExponentSolver(problem, rtol=rtol, budget=budget)
        with suppress(FpsolveError):
            moments = solve_moments(solver, [each])
            if moments.failures:
                continue
            sizes = [solution.pair.generator.size for solution in solver.whole.known.values()]
            value, error = float(moments.value[0]), float(moments.error_estimate[0])
            found[f"Λ({each:g})"] = value, error, solver.scale(each), sizes[0] if len(sizes) == 1 else 0
    for name in indices:
        solver = ExponentSolver(problem, rtol=rtol, budget=budget)
        with suppress(FpsolveError):
            if not (index := INDICES[name].solve(solver, None)):
                continue
            found[name] = index.value, index.error_estimate, index.scale, 0
    return found


def of_case(path: Path) -> dict[str, Number]:
    """Of the first set and the last."""
    case = load_case(path)
    indices = "lyapunov_exponent", "stability_index", "impact_rate"
    found = dict[str, Number]()
    for number in sorted({1, case.planned}):
        [curve] = case.curves(number - 1, number)
        p = tuple(sorted({*MOMENTS, *(each.p for each in case.expect if each.p is not None)}))
        has_walls = bool(curve.problem.system.jumps)
        numbers = of_problem(curve.problem, case.rtol, p, indices if has_walls else indices[:2])
        if case.has_response:
            response = solve_response(curve.problem, case.response.rtol, None, case.budget)
            numbers |= {
                name: (each.value, each.error_estimate, abs(each.value), 0) for name, each in response.numbers.items()
            }
        found |= {f"set {number}, {name}": each for name, each in numbers.items()}
    return found


def of_random(seed: int) -> dict[str, Number]:
    drawn = random_problems.problems(seed + 1)[seed]
    return of_problem(drawn.solved, 1e-8, (drawn.p,), ("lyapunov_exponent",))


def of_system(seed: int) -> dict[str, Number]:
    return of_problem(random_systems.drawn(seed)[0], 1e-8, (-0.5, 1.0, 2.0), ("lyapunov_exponent",))


def of_planar(seed: int) -> dict[str, Number]:
    return of_problem(random_planar.drawn(seed).problem, 1e-7, (1.0, 2.0), ("lyapunov_exponent",))


def of_modes(seed: int) -> dict[str, Number]:
    return of_problem(random_modes.drawn(seed)[1], 1e-4, (-1.0, 1.0, 2.0), ("lyapunov_exponent",))


def of_units(seed: int) -> dict[str, Number]:
    _, made, units = random_units.drawn(seed)
    return of_problem(made(units), 1e-5, (1.0, 2.0), ())


def tasks() -> Iterator[tuple[str, Callable[[], dict[str, Number]]]]:
    """By name."""
    paths = sorted((ROOT / "cases").glob("**/*.toml"))
    yield from ((path.stem, partial(of_case, path)) for path in paths if path.stem not in ("flutter", "minimal"))
    for make, count in ((of_random, 40), (of_system, 32), (of_planar, 21), (of_modes, 8), (of_units, 10)):
        yield from ((f"{make.__name__[3:]} {seed}", partial(make, seed)) for seed in range(count))


def solved(task: tuple[str, Callable[[], dict[str, Number]]]) -> tuple[str, dict[str, Number], float]:
    start = time.process_time()
    return task[0], task[1](), time.process_time() - start


def moved(before: Number, now: Number) -> str:
    """How a number has moved further than it may; empty where it has not."""
    off, stated = abs(before[0] - now[0]), before[1] + now[1]
    if off > stated + 1e-15 * abs(before[0]):
        return f"{off:.1e} apart, {stated:.1e} stated"
    if before[3] == now[3] > 0 and off > SAME_SPACE * max(before[2], abs(before[0])):
        return f"{off / before[2]:.1e} of the scale apart on {now[3]} unknowns"
    return ""


def main(word: str = "", name: str = "") -> int:
    """Write, or compare; of those alone whose name begins with the second word, if it is given."""
    wanted = [task for task in tasks() if task[0].startswith(name)]
    known = {} if word == "write" else json.loads(FILE.read_text(encoding="utf-8"))
    found, worse, growth = dict[str, dict[str, Number]](), 0, list[float]()
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        for each, numbers, seconds in pool.imap_unordered(solved, wanted):
            found[each] = numbers
            if word == "write":
                print(f"{each}: {len(numbers)} numbers, {seconds:.1f} s", flush=True)
                continue
            before = {key: tuple(number) for key, number in known[each].items()}
            growth += [now[1] / before[key][1] for key, now in numbers.items() if before.get(key, (0, 0))[1] > 0]
            for key, number in before.items():
                told = moved(number, numbers[key]) if key in numbers else "refused now"
                worse += bool(told)
                if told:
                    print(f"{each}, {key}: {told} ({number[0]:.12g} ± {number[1]:.1e} before)", flush=True)
    count = sum(map(len, found.values()))
    if word == "write":
        FILE.write_text(json.dumps(dict(sorted(found.items())), indent=1) + "\n", encoding="utf-8")
        print(f"{count} numbers")
        return 0
    print(
        f"{count} numbers, {worse} moved or refused; errors are {np.median(growth):.3g} times those of before (median)"
    )
    return int(worse > 0)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
