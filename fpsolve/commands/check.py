"""Compare results with the values that cases expect."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

from cyclopts import Parameter

from fpsolve.case.case import Case, ParameterSet
from fpsolve.commands.errors import CHECK_FAILED, NOT_CONVERGED
from fpsolve.commands.options import (
    ANEW,
    OPTIONS,
    WORKERS,
    Cases,
    Done,
    Options,
    Workers,
    kept,
    of_sets,
    on_cases,
    saying_if_interrupted,
)
from fpsolve.messages import Severity
from fpsolve.pool import SERIAL, Pool
from fpsolve.solve.check import (
    Checked,
    compare,
    compare_with_hierarchy,
    compared,
    even_moments,
    expected,
    refuse_no_hierarchy,
)
from fpsolve.solve.moments import QUESTION as MOMENTS
from fpsolve.solve.question import Job, Numerics, refuse_mesh
from fpsolve.solve.set_result import SetResult
from fpsolve.tell.check import agreement, show
from fpsolve.tell.notes import notes
from fpsolve.tell.progress import SETS, SILENT, Phase, Watch
from fpsolve.tell.terminal import print_blocks


def check_case(case: Case, *, by_hierarchy: bool = False, pool: Pool = SERIAL, watch: Watch = SILENT) -> Checked:
    """Solve what a case expects, and compare; nothing is written.

    With `by_hierarchy` Λ of its even p is compared with the moment hierarchy.
    """
    found: list[SetResult] = []
    numerics = replace(Numerics.of(case), is_stated=True)

    def job(parameter_set: ParameterSet) -> Job:
        even = {MOMENTS.name: {"p": even_moments(case).tolist(), "slopes": True}}
        asked = even if by_hierarchy else expected(case, parameter_set.varied)
        return Job(parameter_set, asked, numerics, case.vary.line_of(parameter_set.number))

    with (
        saying_if_interrupted(lambda: kept(len(found), of_sets(case)), ANEW),
        watch.bar(Phase(case.name, "solving", case.planned, SETS)) as progress,
        pool,
    ):
        for _, result in pool.run(compared, map(job, case.sets())):
            found.append(result)
            progress(failed=result.status.fails)
    found.sort(key=lambda result: result.parameter_set.number)
    comparisons = compare_with_hierarchy(case, found) if by_hierarchy else compare(case, found)
    return Checked(found, comparisons)


def check(
    cases: Cases,
    *,
    hierarchy: Annotated[
        bool,
        Parameter(
            help="Compare Λ at the even p of [moments] with the moment equations instead. The system must have no "
            "wall, and its noise no algebraic tails."
        ),
    ] = False,
    options: Options = OPTIONS,
    workers: Workers = WORKERS,
) -> int:
    """Solve case files and compare the results with the values that they expect; write nothing.

    Example: fpsolve check cases/fig1.toml cases/minimal.toml
    """

    def work(case: Case, pool: Pool) -> Done:
        outcome = check_case(case, by_hierarchy=hierarchy, pool=pool, watch=options.watch())
        if options.quiet:
            print(f"{case.name}: {agreement(outcome.comparisons)}")
        else:
            print_blocks(show(case, outcome.comparisons))
        print_blocks(notes(case, outcome.results, ""), [Severity.FAILURE] if options.quiet else list(Severity))
        is_met = all(comparison.met for comparison in outcome.comparisons)
        return Done(code=NOT_CONVERGED if outcome.failures else 0 if is_met else CHECK_FAILED)

    def refuse(case: Case) -> None:
        refuse_mesh(case)
        if hierarchy:
            refuse_no_hierarchy(case)

    return on_cases(cases, options, work, refuse=refuse, workers=workers)
