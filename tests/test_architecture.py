"""What every room of fpsolve promises; the order of imports between them is in pyproject.toml, for import-linter."""

import ast
import importlib
import io
import subprocess
import tokenize
import tomllib
from collections import Counter
from pathlib import Path

import pytest

import fpsolve

ROOT = Path(fpsolve.__file__).parent
ROOMS = sorted(path.parent.name for path in ROOT.glob("*/__init__.py"))


@pytest.mark.parametrize("room", ["fpsolve", *(f"fpsolve.{room}" for room in ROOMS)])
def test_public_names(room):
    """Each exists and says what it is; none is that of a module beside it, whose import would replace it."""
    package = importlib.import_module(room)
    folder = Path(package.__file__).parent
    assert package.__all__
    for name in package.__all__:
        assert not (folder / f"{name}.py").exists(), name
        assert not (folder / name).is_dir(), name
        assert getattr(package, name).__doc__, name
    assert not hasattr(package, "no_such_name")


CHECKOUT = Path(__file__).parents[1]
WEIGHT = Path(__file__).with_name("weight.toml")
NOT_SEEN = tokenize.COMMENT, tokenize.NL
NOT_COUNTED = tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER


def tokens(text: str) -> int:
    """Tokens of Python, but for comments and docstrings: no matter how lines are broken, or how long names are."""
    found = [each for each in tokenize.generate_tokens(io.StringIO(text).readline) if each.type not in NOT_SEEN]
    kinds = [tokenize.NEWLINE, *(each.type for each in found)]
    docs = sum(
        kind == tokenize.STRING and before in NOT_COUNTED and after == tokenize.NEWLINE
        for before, kind, after in zip(kinds, kinds[1:], kinds[2:], strict=False)
    )
    return sum(each not in NOT_COUNTED for each in kinds) - docs


def weights(top: str) -> dict[str, int]:
    """The tokens of each room of the package, or of the tests; "." is what lies in no folder."""
    found = Counter[str]()
    for path in (CHECKOUT / top).rglob("*.py"):
        within = path.relative_to(CHECKOUT / top)
        found[within.parts[0] if len(within.parts) > 1 else "."] += tokens(path.read_text(encoding="utf-8"))
    return dict(found)


@pytest.mark.parametrize("top", ["fpsolve", "tests"])
def test_no_room_is_heavier_than_its_row(top):
    """Take away as much as you add; a move between rooms changes two rows by one number."""
    rows, found = tomllib.loads(WEIGHT.read_text(encoding="utf-8"))[top], weights(top)
    assert found.keys() == rows.keys()
    assert not {room: f"{found[room]} tokens, its row says {row}" for room, row in rows.items() if found[room] > row}


@pytest.mark.slow
def test_rows_only_go_down():
    """Those of the package together, and those of the tests, against those of the main branch elsewhere."""
    shown = subprocess.run(
        ["git", "show", "origin/main:tests/weight.toml"], cwd=CHECKOUT, capture_output=True, text=True, check=False
    )
    if shown.returncode:
        pytest.skip("there is no origin/main with rows")
    before, now = (
        {top: sum(rows.values()) for top, rows in tomllib.loads(text).items()}
        for text in (shown.stdout, WEIGHT.read_text(encoding="utf-8"))
    )
    assert not {top: f"{now[top]} tokens, {most} before" for top, most in before.items() if now[top] > most}


TESTS = Path(__file__).parent
NOT_YET = {"oracles", "."}
"""Folders of tests that are older than the rules below."""
FEWEST_DIGITS = 9
"""Significant digits of a number that stands once."""


def rooms_of_tests(but: set[str]) -> list[Path]:
    """The files of tests in other folders than these."""
    found = sorted(TESTS.rglob("*.py"))
    return [each for each in found if (each.parts[len(TESTS.parts)] if each.parent != TESTS else ".") not in but]


@pytest.mark.parametrize("path", rooms_of_tests({"inner", *NOT_YET}), ids=lambda path: str(path.relative_to(TESTS)))
def test_only_inner_tests_import_internals(path):
    """Other tests outlive a redesign: they import what an `__init__.pyi` names alone, and patch nothing."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            assert not [each.name for each in node.names if each.name.startswith("fpsolve.")]
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "fpsolve":
            stub = ROOT.joinpath(*node.module.split(".")[1:], "__init__.pyi")
            assert stub.is_file(), node.module
            assert {each.name for each in node.names} <= set(importlib.import_module(node.module).__all__)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "monkeypatch":
            assert node.attr != "setattr", f"line {node.lineno}"


def test_no_number_stands_twice():
    """A value has one row, whether in a test or in a case."""
    places = Counter[str]()
    for path in rooms_of_tests(NOT_YET):
        found = tokenize.generate_tokens(io.StringIO(path.read_text(encoding="utf-8")).readline)
        numbers = {each.string for each in found if each.type == tokenize.NUMBER}
        digits = {text: text.partition("e")[0].replace(".", "").strip("0") for text in numbers}
        places.update(each for each in digits.values() if len(each) >= FEWEST_DIGITS)
    assert [each for each, count in places.items() if count > 1] == []
