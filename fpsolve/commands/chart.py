"""Trace where stability ends in a plane of two parameters."""

from __future__ import annotations

from time import monotonic

from fpsolve.commands.options import ALL_OPTIONS, NOT_CONVERGED, Cases, Reporting


def chart(
    cases: Cases,
    *,
    options: Reporting = ALL_OPTIONS,
) -> int:
    """Trace where stability ends in a plane of two parameters; write chart.csv, .json, .png and .pdf into OUT/<case>/.

    [budget] line_seconds limits a line: what is traced by then is kept, and the exit code is 3.
    [budget] seconds limits a row of points of the grid; a point may take half of the time that is left for its row.
    Both limits are processor time.

    Example: fpsolve chart cases/chart.toml --set chart.x.stop=3.0
    """
    from fpsolve.page.terminal import print_blocks
    from fpsolve.show.notes import note_on
    from fpsolve.workflow.chart import chart_case, dear_lines, refuse_no_chart, show, traced

    code, loaded = 0, options.load(cases)
    for case in loaded:
        refuse_no_chart(case)
    pool = options.pool()
    for case in loaded:
        start = monotonic()
        if not options.quiet and (dear := dear_lines(case)):
            print_blocks([note_on(case.name, dear)])
        found = chart_case(case, options.out, pool=pool, watch=options.watch())
        if options.quiet:
            print_blocks(note_on(case.name, each) for each in dict.fromkeys(found.failures))
        else:
            print_blocks(show(case, found))
        options.print_written(case, traced(found), monotonic() - start)
        if found.fails:
            code = NOT_CONVERGED
    return code
