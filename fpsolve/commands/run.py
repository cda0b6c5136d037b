"""Solve cases; write tables, figures and ParaView files."""

from __future__ import annotations

from functools import partial
from typing import Annotated

from cyclopts import Parameter

from fpsolve.case.case import Case
from fpsolve.commands.cases import refuse_no_numbers, run_case
from fpsolve.commands.errors import NOT_CONVERGED
from fpsolve.commands.options import FLAGS, Cases, Done, Flags, Fresh, on_cases
from fpsolve.pool import Pool
from fpsolve.results.csv_json import summary_line
from fpsolve.tell.notes import left_out
from fpsolve.tell.solved import done_of, known_of
from fpsolve.tell.terminal import print_blocks


def run(
    cases: Cases,
    *,
    monte_carlo: bool = False,
    fresh: Fresh = False,
    json: bool = False,
    everything: Annotated[bool, Parameter(name="--all")] = False,
    table: bool = False,
    flags: Flags = FLAGS,
) -> int:
    """Solve case files; write tables, figures and ParaView files into OUT/<case>/.

    A run does not repeat parameter sets that an earlier run has finished, even if that run was killed.

    Without [output] quantities a case computes moment, lyapunov_exponent,
    stability_index and one eigenfunction.
    A wall adds impact_rate and critical_impact_factor; terms of degree 3 add
    the response.
    Other quantities need their names in [output] quantities or a section, or
    --all: variance_rate, critical_restitution, sensitivities, all
    eigenfunctions with densities, rate_function, excursions, and a
    moment_derivative that takes long.

    Example: fpsolve run cases/fig1.toml --out results --set oscillator.omega=2.0

    Args:
        monte_carlo: Also simulate, as [monte_carlo] of the case says, and draw both.
        json: Print the summaries, one line of JSON for each case, instead of tables.
        everything: Compute everything, as quantities = "all" in [output].
        table: Print every number of up to ten parameter sets, also Λ(p) at more than 12 p.
    """

    def work(case: Case, pool: Pool) -> Done:
        watch = flags.watch(is_json=json, is_whole=table)
        outcome = run_case(case, flags.out, pool=pool, watch=watch, monte_carlo=monte_carlo, is_fresh=fresh)
        sweep, interruption = outcome.sweep, outcome.simulations.interruption
        if not (flags.options.quiet or interruption):
            is_first = case.path == cases[0] and not sweep.known
            print_blocks(left_out(case, monte_carlo=monte_carlo, is_first=is_first))
        if json:
            print(summary_line(sweep.results, sweep.facts))
        what = "" if json else done_of(case, len(sweep.results), sweep.failed)
        code = NOT_CONVERGED if sweep.failed or sweep.is_empty else 0
        return Done(what, code, known_of(case, sweep.known), interruption)

    typed = {"--all": 'output.quantities="all"'} if everything else {}
    refuse = partial(refuse_no_numbers, monte_carlo=monte_carlo)
    return on_cases(cases, flags.options, work, typed=typed, refuse=refuse, workers=flags.workers, out=flags.out)
