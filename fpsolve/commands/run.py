"""`fpsolve run`: solve cases."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any

from cyclopts import Parameter

from fpsolve.commands.errors import print_error
from fpsolve.commands.options import ALL_OPTIONS, NOT_CONVERGED, Cases, Fresh, Reporting
from fpsolve.signals import INTERRUPTED


def run(
    cases: Cases,
    *,
    monte_carlo: Annotated[
        bool, Parameter(help="Also simulate, as [monte_carlo] of the case says, and draw both.", negative="")
    ] = False,
    fresh: Fresh = False,
    json: Annotated[
        bool, Parameter(help="Print the summaries, one line of JSON for each case, instead of tables.", negative="")
    ] = False,
    everything: Annotated[
        bool, Parameter(name="--all", help='Compute everything, as quantities = "all" in [output].', negative="")
    ] = False,
    table: Annotated[
        bool, Parameter(help="Print every number of up to ten curves, also Λ(p) at more than 12 p.", negative="")
    ] = False,
    options: Reporting = ALL_OPTIONS,
) -> int:
    """Solve case files; write tables, figures and ParaView files into OUT/<case>/.

    Curves that an earlier run has finished are not solved again, even if that run was killed.

    Without [output] quantities a case computes moment, lyapunov_exponent, stability_index, of walls impact_rate and
    critical_impact_factor, of terms of degree 3 the response, one of the eigenfunctions, and what other sections name.
    Only where they are named, or with --all, it computes variance_rate, critical_restitution, sensitivities, all
    eigenfunctions with densities, rate_function, excursions, and moment_derivative where it takes long, too.

    Example: fpsolve run cases/fig1.toml --out results --set oscillator.omega=2.0
    """
    from fpsolve.output.tables import whole_summary
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.notes import left_out
    from fpsolve.show.results import done_of, known_of
    from fpsolve.workflow.cases import run_case
    from fpsolve.workflow.simulate import refuse_obstacles

    code = 0
    loaded = options.load(cases, {"--all": 'output.quantities="all"'} if everything else {})
    if monte_carlo:
        for case in loaded:
            refuse_obstacles(case)
    pool = options.pool(loaded)
    for case in loaded:
        watch = replace(options.watch(is_json=json), is_whole=table)
        how: dict[str, Any] = {"monte_carlo": monte_carlo, "is_fresh": fresh}
        outcome = run_case(case, options.out, pool=pool, watch=watch, **how)
        if outcome.interruption:
            print_error(outcome.interruption)
        if not (options.quiet or outcome.interruption):
            print_blocks(left_out(case, monte_carlo=monte_carlo))
        if json:
            print(whole_summary(case, outcome.results, outcome.facts))
        else:
            what = done_of(case, len(outcome.results), outcome.failed)
            options.print_written(case, what, outcome.facts["wall_seconds"], known_of(case, outcome.known))
        if outcome.interruption:
            return INTERRUPTED
        if outcome.fails:
            code = NOT_CONVERGED
    return code
