"""Writing report.html, which comes last: where it fails all other files are there."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fpsolve.case.case import Case
from fpsolve.errors import FpsolveError
from fpsolve.files import writable
from fpsolve.output.tables import facts_of
from fpsolve.workflow.progress import Phase, Watch

if TYPE_CHECKING:
    from fpsolve.output.report import Reporter


def write_report(reporter: Reporter, case: Case, folder: Path, watch: Watch, **found: Any) -> None:
    """Write the report of what was found, as for `Found`; a fault in that is said and nothing more.

    Raises:
        OutputError: it cannot be written.
    """
    from fpsolve.output.report import Found

    with watch.bar(Phase(case.name, "report")), writable(folder):
        message = reporter.write(case, Found(**found), folder)
    if message is not None:
        watch.said(case, message)


@contextmanager
def shown_at_the_end(show: Callable[[], None]) -> Iterator[None]:
    """Show what was done in the end, also where the body ends early; a fault in that does not hide why it did."""
    try:
        yield
    except BaseException:
        with suppress(FpsolveError):
            show()
        raise
    show()


def facts_since(case: Case, started: datetime) -> dict[str, Any]:
    """On a run that began then, see `facts_of`."""
    return facts_of(case, started, (datetime.now(UTC) - started).total_seconds())
