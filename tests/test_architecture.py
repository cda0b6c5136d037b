"""What every room of fpsolve promises; the order of imports between them is in pyproject.toml, for import-linter."""

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


def test_the_simulation_knows_no_phase():
    for path in (ROOT / "simulation").glob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert not any(name in text for name in ("h1(", "q1(", ".h2(", ".q2("))


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
MENDED = 4000
"""What all rows together may rise by while wrong numbers are mended; 0 afterwards."""
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
    """All rows of the package and of the tests together, against those of the main branch elsewhere."""
    shown = subprocess.run(
        ["git", "show", "origin/main:tests/weight.toml"], cwd=CHECKOUT, capture_output=True, text=True, check=False
    )
    if shown.returncode:
        pytest.skip("there is no origin/main with rows")
    before, now = (
        sum(sum(rows.values()) for rows in tomllib.loads(text).values())
        for text in (shown.stdout, WEIGHT.read_text(encoding="utf-8"))
    )
    assert now <= before + MENDED
