"""Compare results with the values that cases expect."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from fpsolve.commands.options import CHECK_FAILED, NOT_CONVERGED, OPTIONS_OF_WORK, Cases, Working
from fpsolve.messages import Severity


def check(
    cases: Cases,
    *,
    hierarchy: Annotated[
        bool,
        Parameter(
            help="Compare Λ of the even p of [moments] with the moment hierarchy instead, the equations of moments; "
            "without walls, under all noise but that with algebraic tails."
        ),
    ] = False,
    options: Working = OPTIONS_OF_WORK,
) -> int:
    """Solve case files and compare the results with the values that they expect; write nothing.

    Example: fpsolve check cases/fig1.toml cases/minimal.toml
    """
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.notes import notes
    from fpsolve.workflow.check import agreement, check_case, refuse_no_hierarchy, show

    code, loaded = 0, options.load(cases)
    for case in loaded if hierarchy else ():
        refuse_no_hierarchy(case)
    pool = options.pool(loaded)
    for case in loaded:
        outcome = check_case(case, by_hierarchy=hierarchy, pool=pool, watch=options.watch())
        if options.quiet:
            print(f"{case.name}: {agreement(outcome.comparisons)}")
        else:
            print_blocks(show(case, outcome.comparisons))
        print_blocks(notes(case, outcome.results, ""), [Severity.FAILURE] if options.quiet else list(Severity))
        if outcome.failures:
            code = NOT_CONVERGED
        elif not all(comparison.met for comparison in outcome.comparisons):
            code = max(code, CHECK_FAILED)
    return code
