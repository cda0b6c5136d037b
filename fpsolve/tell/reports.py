"""Writing report.html, which comes last: where it fails all other files are there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime
from pathlib import Path

from fpsolve.case.case import Case
from fpsolve.errors import FpsolveError
from fpsolve.files import writable, write_text
from fpsolve.messages import Code, Message
from fpsolve.model.equation import equations_of
from fpsolve.results.csv_json import facts_of
from fpsolve.tell import problem
from fpsolve.tell.blocks import Block
from fpsolve.tell.html import page_of
from fpsolve.tell.notes import note_on
from fpsolve.tell.progress import Phase, Watch

REPORT = "report.html"
"""The file of a report."""
COMPLETE = "Complete."
"""The state of a run that did all."""
INCOMPLETE = "Not complete: the run ended early, and this is what was done."
"""The state of a run that ended early."""
_OTHERS = "summary.json", "monte_carlo.json", "chart.json", "design.json", "proof.json"
"""What a command says that it has done."""


def write_report(
    case: Case,
    folder: Path,
    watch: Watch,
    blocks: Iterable[Block],
    *,
    started: datetime,
    files: Sequence[str],
    complete: bool,
) -> None:
    """Write the report of what a command found into a folder, if one is wanted; a fault in that is said and no more.

    Args:
        blocks: what was found.
        started: when the command was.
        files: the names of those that hold all numbers.
        complete: whether all was done that was planned.

    Raises:
        OutputError: it cannot be written.
    """
    if not watch.has_report:
        return
    others = [name for name in _OTHERS if name not in files and (folder / name).is_file()]
    also = f" Other commands wrote {', '.join(others)} there; their own --report shows it." if others else ""
    with watch.bar(Phase(case.name, "report")), writable(folder):
        try:
            text = page_of(
                blocks,
                title=case.headline,
                state=COMPLETE if complete else INCOMPLETE,
                equations=equations_of(next(case.curves(0, 1)).problem.system),
                about=list(problem.show(case)),
                facts=facts_of(case, started),
                file=case.path.name,
                more=f"All numbers are in {', '.join(files)}, in the folder of the results, {folder.name}.{also}",
            )
        except OSError:
            raise
        except Exception as failure:  # what is finished is there already, and shall not be lost for its picture
            message = Message(Code.NO_REPORT, kind=type(failure).__name__, text=str(failure))
            watch.said([note_on(case.name, message)])
        else:
            write_text(folder / REPORT, text)


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
