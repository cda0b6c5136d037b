"""`fpsolve check`: compare with what cases expect."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from fpsolve.commands.options import (
    CHECK_FAILED,
    NOT_CONVERGED,
    Cases,
    Jobs,
    Overrides,
    Quiet,
    Scheduler,
    load,
    pool_of,
    watch_of,
)
from fpsolve.messages import Severity


def check(
    cases: Cases,
    *,
    hierarchy: Annotated[
        bool,
        Parameter(
            help="Compare Λ of the even p of [moments] with the moment hierarchy instead, the equations of moments; "
            "without walls, under all noise but that with algebraic tails.",
            negative="",
        ),
    ] = False,
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Solve case files and compare the results with the values that they expect; write nothing.

    If another package registers the noise, each member of its class is compared with what follows from the others.

    Example: fpsolve check cases/fig1.toml cases/minimal.toml
    """
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.comparison import agreement
    from fpsolve.show.comparison import show as show_comparisons
    from fpsolve.show.notes import note_on, notes
    from fpsolve.study.hierarchy import refuse_no_hierarchy
    from fpsolve.workflow.cases import check_case

    code, loaded = 0, load(cases, overrides)
    for case in loaded if hierarchy else ():
        refuse_no_hierarchy(case)
    pool = pool_of(jobs, scheduler, loaded)
    for case in loaded:
        outcome = check_case(case, by_hierarchy=hierarchy, pool=pool, watch=watch_of(is_quiet=quiet))
        if quiet:
            print(f"{case.name}: {agreement(outcome.comparisons)}")
        else:
            print_blocks(show_comparisons(case, outcome.comparisons))
        print_blocks(notes(case, outcome.results, ""), [Severity.FAILURE] if quiet else list(Severity))
        print_blocks(note_on(case.name, fault) for fault in outcome.faults)
        if outcome.failures:
            code = NOT_CONVERGED
        elif outcome.faults or not all(comparison.met for comparison in outcome.comparisons):
            code = max(code, CHECK_FAILED)
    return code
