"""`fpsolve chart`: where stability ends in a plane."""

from __future__ import annotations

from pathlib import Path
from time import monotonic

from fpsolve.commands.options import (
    NOT_CONVERGED,
    Cases,
    Interactive,
    Jobs,
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


def chart(
    cases: Cases,
    *,
    out: Out = Path("results"),
    jobs: Jobs = None,
    scheduler: Scheduler = "",
    report: Report = False,
    interactive: Interactive = False,
    quiet: Quiet = False,
    overrides: Overrides = None,
) -> int:
    """Trace where stability ends in a plane of two parameters; write chart.csv, .json, .png and .pdf into OUT/<case>/.

    [budget] line_seconds limits a line: what is traced by then is kept, and the exit code is 3.
    [budget] seconds limits a row of points of the grid; a point may take half of the time that is left for its row.
    Both limits are processor time.

    Example: fpsolve chart cases/chart.toml --set chart.x.stop=3.0
    """
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.chart import show as show_chart
    from fpsolve.show.chart import traced
    from fpsolve.show.notes import note_on
    from fpsolve.show.results import last_line
    from fpsolve.study.chart import refuse_no_chart
    from fpsolve.workflow.cases import chart_case

    code, reporter = 0, reporter_of(report, interactive)
    loaded = load_to_write(cases, overrides)
    for case in loaded:
        refuse_no_chart(case)
    pool = pool_of(jobs, scheduler)
    for case in loaded:
        start = monotonic()
        found = chart_case(case, out, pool=pool, reporter=reporter, watch=watch_of(is_quiet=quiet))
        if quiet:
            print_blocks(note_on(case.name, each) for each in dict.fromkeys(found.failures))
        else:
            print_blocks(show_chart(case, found, out / case.name))
        print_blocks([last_line(out / case.name, traced(found), monotonic() - start)])
        if found.failures:
            code = NOT_CONVERGED
    return code
