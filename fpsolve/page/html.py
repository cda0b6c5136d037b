"""Blocks as one page of HTML that opens from disk, with nothing fetched from elsewhere."""

from __future__ import annotations

import re
import tempfile
from base64 import b64encode
from collections.abc import Iterable, Iterator, Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from fpsolve.errors import FpsolveError
from fpsolve.messages import Code, Message
from fpsolve.page.page import TONES, WORDS, Block, Drawing

TEMPLATE = "report.html"
"""The file of this folder that is filled."""
_FURTHER = re.compile(r"<(metadata|style)\b.*?</\1>", re.DOTALL)
"""Elements of SVG that would be of the whole page, or that no page needs."""
_COMMENT = re.compile(r"<!--.*?-->", re.DOTALL)
"""A comment of XML."""
_ID = re.compile(r'\bid="')
"""The beginning of an id."""
_REFERENCE = re.compile(r'(href="#|url\(#)')
"""The beginning of a reference to an id."""


def page_of(blocks: Iterable[Block], *, is_interactive: bool = False, **head: Any) -> str:
    """The page.

    Args:
        blocks: what stands on it; notes come last, and of each only one.
        is_interactive: whether drawings that have a plot are scripts in addition.
        head: what else the template has: title, state, equations, about (blocks), facts, file, more.
    """
    from jinja2 import Environment, StrictUndefined

    with tempfile.TemporaryDirectory() as place:
        pieces = list(_pieces(blocks, Path(place), is_interactive=is_interactive))
    notes = dict.fromkeys(each for kind, each in pieces if kind == "Note")
    has_plots = any(kind == "plot" for kind, _ in pieces)
    head["about"] = [(type(each).__name__, each) for each in head["about"]]
    page = Environment(autoescape=True, undefined=StrictUndefined).from_string(
        files("fpsolve.page").joinpath(TEMPLATE).read_text(encoding="utf-8")
    )
    script = _plotly() if has_plots else ""
    return page.render(blocks=pieces, notes=notes, words=WORDS, tones=TONES, plotly=script, **head)


def _pieces(blocks: Iterable[Block], place: Path, *, is_interactive: bool) -> Iterator[tuple[str, Any]]:
    """What the template prints: blocks by the names of their classes, of drawings what was drawn."""
    for number, block in enumerate(blocks):
        if not isinstance(block, Drawing):
            yield type(block).__name__, block
            continue
        if is_interactive and block.plot is not None and (plot := block.plot()):
            yield "plot", plot
        if picture := _picture(block, place / f"{number}.{block.kind}", f"d{number}"):
            yield "picture", {"title": block.title, **picture}


def _picture(drawing: Drawing, path: Path, name: str) -> Mapping[str, str]:
    """SVG, or the content of a PNG file in base64, or why there is none; empty where there is nothing to draw."""
    nothing = {"svg": "", "png": "", "missing": ""}
    try:
        drawing.draw([path], "")
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


def _plotly() -> str:
    from plotly.offline import get_plotlyjs

    return str(get_plotlyjs())
