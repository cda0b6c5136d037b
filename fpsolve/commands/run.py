"""Solve cases; write tables, figures and ParaView files."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from cyclopts import Parameter

from fpsolve.commands.errors import print_error
from fpsolve.commands.options import ALL_OPTIONS, NOT_CONVERGED, Cases, Fresh, Reporting
from fpsolve.signals import INTERRUPTED


def run(
    cases: Cases,
    *,
    monte_carlo: bool = False,
    fresh: Fresh = False,
    json: bool = False,
    everything: Annotated[bool, Parameter(name="--all")] = False,
    table: bool = False,
    options: Reporting = ALL_OPTIONS,
) -> int:
    """Solve case files; write tables, figures and ParaView files into OUT/<case>/.

    Curves that an earlier run has finished are not solved again, even if that run was killed.

    Without [output] quantities a case computes moment, lyapunov_exponent, stability_index, of walls impact_rate and
    critical_impact_factor, of terms of degree 3 the response, one of the eigenfunctions, and what other sections name.
    Only where they are named, or with --all, it computes variance_rate, critical_restitution, sensitivities, all
    eigenfunctions with densities, rate_function, excursions, and moment_derivative where it takes long, too.

    Example: fpsolve run cases/fig1.toml --out results --set oscillator.omega=2.0

    Args:
        monte_carlo: Also simulate, as [monte_carlo] of the case says, and draw both.
        json: Print the summaries, one line of JSON for each case, instead of tables.
        everything: Compute everything, as quantities = "all" in [output].
        table: Print every number of up to ten curves, also Λ(p) at more than 12 p.
    """
    from fpsolve.commands.cases import run_case
    from fpsolve.results.csv_json import summary_line
    from fpsolve.solve.question import refuse_mesh
    from fpsolve.solve.simulate import refuse_obstacles
    from fpsolve.tell.notes import left_out
    from fpsolve.tell.solved import done_of, known_of
    from fpsolve.tell.terminal import print_blocks

    code = 0
    loaded = options.load(cases, {"--all": 'output.quantities="all"'} if everything else {})
    for case in loaded:
        refuse_mesh(case)
        if monte_carlo:
            refuse_obstacles(case)
    pool = options.pool(loaded)
    for case in loaded:
        watch = replace(options.watch(is_json=json), is_whole=table)
        outcome = run_case(case, options.out, pool=pool, watch=watch, monte_carlo=monte_carlo, is_fresh=fresh)
        sweep, interruption = outcome.sweep, outcome.simulations.interruption
        if interruption:
            print_error(interruption)
        if not (options.quiet or interruption):
            print_blocks(left_out(case, monte_carlo=monte_carlo))
        if json:
            print(summary_line(sweep.results, sweep.facts))
        else:
            what = done_of(case, len(sweep.results), sweep.failed)
            options.print_written(case, what, sweep.facts["wall_seconds"], known_of(case, sweep.known))
        if interruption:
            return INTERRUPTED
        if sweep.fails:
            code = NOT_CONVERGED
    return code
