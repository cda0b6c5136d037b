"""Estimate the exponents from simulated paths."""

from __future__ import annotations

from time import monotonic

from fpsolve.commands.errors import print_error
from fpsolve.commands.options import ALL_OPTIONS, Cases, Count, Fresh, Reporting
from fpsolve.signals import INTERRUPTED


def simulate(
    cases: Cases,
    *,
    paths: Count | None = None,
    time: float | None = None,
    seed: Count | None = None,
    estimator: str | None = None,
    fresh: Fresh = False,
    options: Reporting = ALL_OPTIONS,
) -> int:
    """Simulate the system with its impacts and estimate the exponents; write monte_carlo.json into OUT/<case>/.

    Ctrl-C ends the simulation early and keeps what is done.
    Curves that an earlier simulation has finished are not simulated again.

    Example: fpsolve simulate cases/fig1.toml --paths 100000 --seed 1 --estimator population

    Args:
        paths: Number of paths; 32768 if the case does not state it.
        time: Length of the paths; if the case does not state it, 64 transients, or 16 for more than two variables.
        seed: Seed of the random numbers; 0 if the case does not state it.
        estimator: direct, or population for strong noise or large |p|; chosen if the case does not state it.
    """
    from fpsolve.show.results import done_of, known_of
    from fpsolve.workflow.simulate import refuse_obstacles, simulate_case

    stated = {"paths": paths, "time": time, "seed": seed, "estimator": estimator}
    typed = {
        f"--{name} {value:{'g' if name == 'time' else ''}}": f"monte_carlo.{name}={value}"
        for name, value in stated.items()
        if value is not None
    }
    loaded = options.load(cases, typed)
    for case in loaded:
        refuse_obstacles(case)
    pool = options.pool()
    for case in loaded:
        start = monotonic()
        outcome = simulate_case(case, options.out, pool=pool, is_fresh=fresh, watch=options.watch())
        if outcome.interruption:
            print_error(outcome.interruption)
        what = done_of(case, sum(not each.interrupted for each in outcome.simulated))
        options.print_written(case, what, monotonic() - start, known_of(case, outcome.known))
        if outcome.interruption:
            return INTERRUPTED
    return 0
