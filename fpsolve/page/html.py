"""Blocks as one page of HTML that opens from disk, with nothing fetched from elsewhere."""

from __future__ import annotations

import re
import tempfile
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from fpsolve.errors import FpsolveError
from fpsolve.messages import Code, Message
from fpsolve.page.page import TONES, WORDS, Block, Drawing

_FURTHER = re.compile(r"<(metadata|style)\b.*?</\1>", re.DOTALL)
"""Elements of SVG that would be of the whole page, or that no page needs."""
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
"""A comment of XML."""
_ID = re.compile(r'\bid="')
"""The beginning of an id."""
_REFERENCE = re.compile(r'(href="#|url\(#)')
"""The beginning of a reference to an id."""


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

    loader = FunctionLoader(lambda name: files("fpsolve.page").joinpath(name).read_text(encoding="utf-8"))
    made = Environment(autoescape=True, undefined=StrictUndefined, loader=loader)
    made.globals |= {"words": WORDS, "tones": TONES}
    return made


def _pieces(blocks: Iterable[Block]) -> Iterator[tuple[str, Any]]:
    """What the template prints: blocks by the names of their classes, of drawings what was drawn."""
    for number, block in enumerate(blocks):
        if not isinstance(block, Drawing):
            yield type(block).__name__, block
        elif picture := _picture(block, f"d{number}"):
            yield "picture", {"title": block.title, **picture}


def _picture(drawing: Drawing, name: str) -> Mapping[str, str]:
    """SVG, or the content of a PNG file in base64, or why there is none; empty where there is nothing to draw."""
    nothing = {"svg": "", "png": "", "missing": ""}
    try:
        with tempfile.TemporaryDirectory() as place:
            drawing.draw([path := Path(place, f"{name}.{drawing.kind}")], "")
            if not path.exists():
                return {}
            if drawing.kind == "png":
                return nothing | {"png": b64encode(path.read_bytes()).decode()}
            return nothing | {"svg": _inlined(path.read_text(encoding="utf-8"), name)}
    except Exception as failure:  # the numbers shall not be lost for a picture
        reason = str(failure) if isinstance(failure, FpsolveError) else f"{type(failure).__name__}: {failure}"
        return nothing | {"missing": str(Message(Code.NO_PICTURE, reason=reason))}


def _inlined(svg: str, name: str) -> str:
    """SVG that stands in a page beside others: without its prologue, size and comments, its ids with a name."""
    head, rest = _COMMENT.sub("", svg[svg.index("<svg") :]).split(">", 1)
    head = re.sub(r' (width|height)="[^"]*"', "", head)
    rest = _REFERENCE.sub(rf"\1{name}-", _ID.sub(f'id="{name}-', _FURTHER.sub("", rest)))
    return f'{head} aria-hidden="true">{rest}'
