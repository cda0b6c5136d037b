"""Writing a report, which comes last: where it fails all other files are there."""

from __future__ import annotations

import math
import tempfile
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import datetime
from functools import cache
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, FunctionLoader, StrictUndefined

from fpsolve.case.case import Case
from fpsolve.data import written
from fpsolve.errors import FpsolveError
from fpsolve.files import writable, write_text
from fpsolve.messages import Code, Message
from fpsolve.model.equation import equations_of
from fpsolve.model.problem import Problem
from fpsolve.results.csv_json import facts_of
from fpsolve.tell.blocks import TONES, WORDS, Block, Column, Drawing, Sentence, filled
from fpsolve.tell.notes import note_on
from fpsolve.tell.progress import Phase, Watch
from fpsolve.tell.text import EACH

INCOMPLETE = "Not complete: the run ended early. The page shows the results up to then."
"""The state of a run that ended early."""


def write_report(
    case: Case,
    folder: Path,
    watch: Watch,
    blocks: Iterable[Block],
    *,
    started: datetime,
    files: Sequence[str],
    complete: bool,
    name: str = "report.html",
) -> None:
    """Write the report of what a command found into a folder, if one is wanted; a fault in that is said and no more.

    Args:
        blocks: what was found.
        started: when the command was.
        files: the names of those that hold all numbers.
        complete: whether all was done that was planned.
        name: of the file.

    Raises:
        OutputError: it cannot be written.
    """
    if not watch.has_report:
        return
    with watch.bar(Phase(case.name, "report")), writable(folder):
        try:
            more = f"All numbers are in {', '.join(files)}, in the folder of the results, {folder.name}."
            text = page_of(case, blocks, started, complete=complete, file=case.path.name, more=more)
        except OSError:
            raise
        except Exception as failure:  # what is finished is there already, and shall not be lost for its picture
            message = Message(Code.NO_REPORT, file=name, kind=type(failure).__name__, text=str(failure))
            watch.said([note_on(case.name, message)])
        else:
            write_text(folder / name, text)


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


def page_of(
    case: Case,
    blocks: Iterable[Block],
    started: datetime,
    *,
    file: str,
    more: str,
    complete: bool = True,
    **facts: object,
) -> str:
    """The page of a case.

    Args:
        blocks: what stands on it; notes come last, and of each only one.
        started: when the command was.
        file: the name of the case.
        more: where the numbers are.
        complete: whether all was done.
        facts: other than those of the case.
    """
    return _filled(
        "report.html",
        blocks,
        title=case.headline,
        state="Complete." if complete else INCOMPLETE,
        equations=equations_of(next(case.sets(0, 1)).problem.system),
        about=[*_pieces(about(case))],
        facts={**facts_of(case, started), **facts},
        file=file,
        more=more,
    )


def part_of_page(blocks: Iterable[Block]) -> str:
    """Blocks alone, for a page that is there already."""
    return _filled("part.html", blocks, title="")


def _filled(template: str, blocks: Iterable[Block], **head: object) -> str:
    pieces = list(_pieces(blocks))
    notes = dict.fromkeys(each for kind, each in pieces if kind == "Note")
    return str(_templates().get_template(template).render(blocks=pieces, notes=notes, **head))


@cache
def _templates() -> Environment:
    loader = FunctionLoader(lambda name: files("fpsolve.tell").joinpath(name).read_text(encoding="utf-8"))
    made = Environment(autoescape=True, undefined=StrictUndefined, loader=loader)
    made.globals |= {"words": WORDS, "tones": TONES}
    return made


def _pieces(blocks: Iterable[Block]) -> Iterator[tuple[str, object]]:
    """What the template prints: blocks by the names of their classes, of drawings what was drawn."""
    for block in blocks:
        if not isinstance(block, Drawing):
            yield type(block).__name__, block
        elif picture := _picture(block):
            yield "picture", {"title": block.title, **picture}


def _picture(drawing: Drawing) -> Mapping[str, str]:
    """The address that is a picture itself, or why there is none; empty where there is nothing to draw."""
    try:
        with tempfile.TemporaryDirectory() as place:
            drawing.draw([path := Path(place, "picture.svg")], "")
            if not path.exists():
                return {}
            return {"source": f"data:image/svg+xml;base64,{b64encode(path.read_bytes()).decode()}"}
    except Exception as failure:  # the numbers shall not be lost for a picture
        reason = str(failure) if isinstance(failure, FpsolveError) else f"{type(failure).__name__}: {failure}"
        return {"source": "", "missing": str(Message(Code.NO_PICTURE, reason=reason))}


def about(case: Case) -> Iterator[Block]:
    """The noises, what the equation leaves out, and the parameters."""
    problem = next(case.sets(0, 1)).problem
    yield from map(Sentence, noise_sentences(problem))
    if problem.linear.cubic:
        yield Sentence(
            "Terms of degree 3 act on the stationary response only: Λ(p), λ and δ_p are of the linear system."
        )
    if case.planned > 1:
        keys = ", ".join(case.vary.keys)
        yield Sentence(f"{case.planned} parameter sets, over {keys}; the equation above is that of the first one.")
    rows = []
    for key, each in problem.parameters.items():
        quantity = each.quantity.timed(case.units.time)
        values = dict.fromkeys(case.vary.values(key)) if key in case.vary.keys else [each.value]
        shown = ", ".join(map(written, values)) if len(values) <= EACH else f"{len(values)} values"
        words = "" if quantity.words == key else quantity.words
        rows.append([key, shown, quantity.unit_in_words, words])
    headings = "key", "value", "unit", "what it is"
    yield filled("", [Column(each, is_text=each != "value") for each in headings], rows)


def noise_sentences(problem: Problem) -> list[str]:
    """Each noise in a sentence: its kind, and how strong and how slow it is."""
    lines = list[str]()
    for section, noise in zip(problem.system.noise_sections, problem.noise.parts.values(), strict=False):
        size, time = noise.standard_deviation, noise.correlation_time
        numbers = [f"standard deviation {size:.6g}"] if 0 < size < math.inf else []
        numbers += [f"correlation time {time:.6g}"] if 0 < time < math.inf else []
        name = f"ξ of [{section}]" if len(problem.noise.parts) > 1 else "ξ"
        lines.append(f"{name} is noise of the kind {noise.kind}{', with ' if numbers else ''}{' and '.join(numbers)}.")
        lines[-1] += f" The equation is meant in {noise.sense} sense." if noise.sense else ""
    return lines
