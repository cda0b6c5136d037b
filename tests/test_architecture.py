"""What every room of fpsolve promises; the order of imports between them is in pyproject.toml, for import-linter."""

import importlib
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
