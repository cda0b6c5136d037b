"""Imports inside fpsolve only point down its floors, and the public surface is small."""

import ast
from pathlib import Path

import fpsolve

ORDER = [
    "errors", "files", "noise", "oscillator", "perturbation", "validity", "sampling", "kernels", "simulation",
    "batches", "montecarlo", "response", "mesh", "space", "kronecker", "generator", "eigen", "estimate", "frozen",
    "adapt", "exponent", "function", "density", "vtk", "plots", "document", "messages", "schema", "case", "curves",
    "simulated", "report", "tables", "cli",
]  # fmt: skip
SOURCES = sorted(Path(fpsolve.__file__).parent.glob("*.py"))


def imported(path):
    """Modules of fpsolve that a source file imports, wherever the statement stands."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("fpsolve"):
            names = [node.module.removeprefix("fpsolve").lstrip(".")]
            yield from names if names != [""] else [alias.name for alias in node.names]
        elif isinstance(node, ast.Import):
            yield from (a.name.removeprefix("fpsolve.") for a in node.names if a.name.startswith("fpsolve."))


def test_imports_only_point_down():
    for path in SOURCES:
        if path.stem in ("__init__", "show"):
            continue
        below = ORDER[: ORDER.index(path.stem)]
        assert set(imported(path)) <= set(below), f"{path.name} imports {set(imported(path)) - set(below)}"


def test_the_simulation_shares_nothing_with_the_generator():
    """Below it stand the parameters of noise and oscillator only, so that it is a witness of its own."""
    names = {"sampling", "kernels", "simulation", "batches", "montecarlo", "response"}
    for path in SOURCES:
        if path.stem in names:
            assert set(imported(path)) <= names | {"errors", "noise", "oscillator"}
            text = path.read_text(encoding="utf-8")
            assert not any(name in text for name in ("h1(", "q1(", ".h2(", ".q2("))


def test_every_module_has_a_place_and_a_docstring():
    assert {path.stem for path in SOURCES} - {"__init__", "show"} == set(ORDER)
    for path in SOURCES:
        assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))), path.name


def test_public_surface():
    assert len(fpsolve.__all__) <= 20
    for name in fpsolve.__all__:
        assert getattr(fpsolve, name).__doc__, name
    assert not hasattr(fpsolve, "no_such_name")
