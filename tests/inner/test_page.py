"""Blocks on a terminal of any width."""

import io
import re
from contextlib import redirect_stderr, redirect_stdout

import pytest

from fpsolve.messages import Severity
from fpsolve.page.page import Column, Grid, Note
from fpsolve.page.terminal import print_blocks


class Terminal(io.StringIO):
    def isatty(self):
        return True


def printed(monkeypatch, width, *blocks, to=Terminal):
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.setenv("TERM", "dumb")
    out, err = to(), to()
    with redirect_stdout(out), redirect_stderr(err):
        print_blocks(blocks)
    return out.getvalue(), err.getvalue()


@pytest.mark.parametrize(
    ("width", "headings"),
    [
        (36, "a ┃ rank one ┃ rank two"),
        (29, "a ┃ one ┃ two"),
        (25, "a ┃ rank one"),
        (22, "a ┃ one"),
        (14, "a"),
        (13, ""),
    ],
)
def test_headings_are_folded_and_columns_left_out_in_their_order(monkeypatch, width, headings):
    """Where no table fits rows are lists."""
    grid = Grid("", [Column("a"), Column("rank one", 1), Column("rank two", 2)], [["1234567890", "12345", "1"]])
    out, _ = printed(monkeypatch, width, grid)
    lines = [line for line in out.splitlines() if line.startswith("┃")] or [""]
    assert " ┃ ".join(part.strip() for part in lines[-1].strip("┃").split("┃")) == headings
    if headings:
        assert max(map(len, re.findall("[┏│].*", out))) <= width
        left_out = ["rank one"] * ("one" not in headings) + ["rank two"] * ("two" not in headings)
        assert " ".join(out.partition("no room for: ")[2].split()) == ", ".join(left_out)
    else:
        assert out.split()[:3] == ["a", "=", "1234567890"]


@pytest.mark.parametrize("width", [50, 80])
def test_notes_are_wrapped_on_a_terminal_and_whole_in_a_file(monkeypatch, width):
    text = "case: " + "Λ(2) may be 1e-10 or [less] than " * 10 + "a_word_as_long_as_a_path/" * 6
    _, err = printed(monkeypatch, width, Note(Severity.NOTE, text))
    first, *others = err.splitlines()
    assert all(line.startswith("  ") for line in others)
    assert " ".join([first, *(line.strip() for line in others)]) == f"note: {text}"
    assert all(len(line) < width for line in [first, *others[:-1]])
    assert printed(monkeypatch, width, Note(Severity.NOTE, text), to=io.StringIO)[1] == f"note: {text}\n"
