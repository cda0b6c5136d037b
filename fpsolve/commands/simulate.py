"""`fpsolve simulate`: the witness by paths."""

from __future__ import annotations

from pathlib import Path
from time import monotonic
from typing import Annotated, Any

from cyclopts import Parameter

from fpsolve.commands.errors import print_error
from fpsolve.commands.options import (
    Cases,
    Count,
    Fresh,
    Interactive,
    Out,
    Overrides,
    Quiet,
    Report,
    Scheduler,
    load_to_write,
    pool_of,
    reporter_of,
    watch_of,
)
from fpsolve.signals import INTERRUPTED


def simulate(
    cases: Cases,
    *,
    out: Out = Path("results"),
    paths: Annotated[Count | None, Parameter(help="Number of paths; 32768 if the case does not state it.")] = None,
    time: Annotated[
        float | None,
        Parameter(
            help="Length of the paths; if the case does not state it, 64 transients, or 16 for more than two variables."
        ),
    ] = None,
    seed: Annotated[
        Count | None, Parameter(help="Seed of the random numbers; 0 if the case does not state it.")
    ] = None,
    estimator: Annotated[
        str | None,
        Parameter(help="direct, or population for strong noise or large |p|; direct if the case does not state it."),
    ] = None,
    jobs: Annotated[Count | None, Parameter(help="Number of processors; all if omitted.")] = None,
    scheduler: Scheduler = "",
    fresh: Fresh = False,
    report: Report = False,
    interactive: Interactive = False,
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Simulate the system with its impacts and estimate the exponents; write monte_carlo.json into OUT/<case>/.

    Ctrl-C ends the simulation early and keeps what is done.
    Curves that an earlier simulation has finished are not simulated again.

    Example: fpsolve simulate cases/fig1.toml --paths 100000 --seed 1 --estimator population
    """
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.results import done_of, known_of, last_line
    from fpsolve.workflow.cases import simulate_case

    reporter = reporter_of(report, interactive)
    stated = {"paths": paths, "time": time, "seed": seed, "estimator": estimator}
    options = {
        f"--{name} {value:{'g' if name == 'time' else ''}}": f"monte_carlo.{name}={value}"
        for name, value in stated.items()
        if value is not None
    }
    loaded = load_to_write(cases, overrides, options, monte_carlo=True)
    pool = pool_of(jobs, scheduler)
    for case in loaded:
        start, watch = monotonic(), watch_of(is_quiet=quiet)
        how: dict[str, Any] = {"is_fresh": fresh, "reporter": reporter, "watch": watch}
        outcome = simulate_case(case, out, pool=pool if scheduler else None, **how)
        if outcome.interruption:
            print_error(outcome.interruption)
        what = done_of(case, sum(not each.interrupted for each in outcome.simulated))
        known = known_of(case, outcome.known, outcome.outdated)
        print_blocks([last_line(out / case.name, what, monotonic() - start, known)])
        if outcome.interruption:
            return INTERRUPTED
    return 0
