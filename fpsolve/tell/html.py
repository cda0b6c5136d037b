"""Blocks as one page of HTML that opens from disk, with nothing fetched from elsewhere."""

from __future__ import annotations

import tempfile
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from fpsolve.errors import FpsolveError
from fpsolve.messages import Code, Message
from fpsolve.tell.blocks import TONES, WORDS, Block, Drawing


def page_of(blocks: Iterable[Block], **head: Any) -> str:
    """The page.

    Args:
        blocks: what stands on it; notes come last, and of each only one.
        head: what else the template has: title, state, equations, about (blocks), facts, file, more.
    """
    head["about"] = [(type(each).__name__, each) for each in head["about"]]
    return _filled("report.html", blocks, **head)


def part_of_page(blocks: Iterable[Block]) -> str:
    """Blocks alone, for a page that is there already."""
    return _filled("part.html", blocks, title="")


def _filled(template: str, blocks: Iterable[Block], **head: Any) -> str:
    pieces = list(_pieces(blocks))
    notes = dict.fromkeys(each for kind, each in pieces if kind == "Note")
    return str(_templates().get_template(template).render(blocks=pieces, notes=notes, **head))


@cache
def _templates() -> Any:
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    loader = FunctionLoader(lambda name: files("fpsolve.tell").joinpath(name).read_text(encoding="utf-8"))
    made = Environment(autoescape=True, undefined=StrictUndefined, loader=loader)
    made.globals |= {"words": WORDS, "tones": TONES}
    return made


def _pieces(blocks: Iterable[Block]) -> Iterator[tuple[str, Any]]:
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
            drawing.draw([path := Path(place, f"picture.{drawing.kind}")], "")
            if not path.exists():
                return {}
            kind = "svg+xml" if drawing.kind == "svg" else drawing.kind
            return {"source": f"data:image/{kind};base64,{b64encode(path.read_bytes()).decode()}"}
    except Exception as failure:  # the numbers shall not be lost for a picture
        reason = str(failure) if isinstance(failure, FpsolveError) else f"{type(failure).__name__}: {failure}"
        return {"source": "", "missing": str(Message(Code.NO_PICTURE, reason=reason))}
