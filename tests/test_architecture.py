"""Imports inside fpsolve only point down: from room to room, and from file to file in a room. Files stay readable."""

import ast
import importlib
from pathlib import Path

import pytest

import fpsolve

ROOMS = {
    "": ["errors", "letters", "arrays", "files", "process", "pool", "pictures", "scenes", "data"],
    "model": [
        "parameters",
        "words",
        "faults",
        "plane",
        "noise",
        "markov_chain",
        "vibro_impact",
        "problem",
        "quantity",
        "direction",
    ],
    "theory": ["perturbation", "frozen", "far", "validity"],
    "fem": [
        *("reference", "line", "polynomials", "mesh", "mesh_file", "phase_space", "noise_space", "space"),
        *("kronecker", "factors", "terms", "generator"),
    ],
    "simulation": ["setup", "kernels", "step", "batches", "monte_carlo", "estimators", "response"],
    "exponent": [
        *(
            "rounding",
            "fields",
            "nodes",
            "pictured",
            "eigen",
            "bordered",
            "corners",
            "error",
            "rival",
            "refine",
            "adapt",
            "branch",
            "solver",
        ),
        *("impacts", "function", "moments", "quantities"),
    ],
    "analysis": [
        *("density", "slopes", "sensitivity", "curve", "scan", "continuation", "special_points", "zero", "stability"),
        "regions",
    ],
    "proofs": [
        *("balls", "statement", "basis", "cells", "phases", "factor", "bounds", "galerkin", "certificate", "verify"),
        *("enclosure", "search", "attempts", "questions", "claims"),
    ],
    "case": [
        *("reading", "toml", "messages", "sections", "vary", "set_file", "vary_table", "figure", "chart", "output"),
        *("curves", "remedies", "refusals", "case"),
    ],
    "study": ["results", "solve", "records", "sweep", "simulated", "simulate", "chart", "decimals", "prove"],
    "output": [
        *("vtk", "provenance", "records", "tables", "datasets", "frame", "series", "many", "plots", "maps"),
        *("charts", "figures", "screen", "remarks", "summary", "terminal", "proofs"),
    ],
    "workflow": ["watch", "folders", "sets", "simulations", "cases", "proofs"],
    "progress": [],
    "arguments": [],
    "commands": [],
    "cli": [],
}
"""Rooms from the ground up, each with its files from the lowest to the highest."""
STRANGERS = {
    "theory": {"fem"},
    "simulation": {"theory", "fem"},
    "exponent": {"simulation"},
}
"""Rooms below that a room must not know: the simulation is a witness of its own."""
STANDALONE = {"output/show.py"}  # runs in ParaView, without fpsolve
ROOT = Path(fpsolve.__file__).parent
SOURCES = sorted(path for path in ROOT.rglob("*.py") if path.name != "__init__.py")


def dotted(path):
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def floors():
    """Every module with its place in the order."""
    names = []
    for room, files in ROOMS.items():
        names += [f"{room}.{file}" if room else file for file in files] or [room]
    return names


def imported(path):
    """Modules of fpsolve that a source file imports, wherever the statement stands."""
    known = set(floors())
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} has a relative import"
            if (node.module or "").split(".")[0] == "fpsolve":
                base = node.module.removeprefix("fpsolve").lstrip(".")
                for alias in node.names:
                    name = f"{base}.{alias.name}".lstrip(".")
                    if name != "__version__":
                        yield name if name in known else base
        elif isinstance(node, ast.Import):
            yield from (a.name.removeprefix("fpsolve.") for a in node.names if a.name.startswith("fpsolve."))


def measured(path):
    """(name, length, is a class) of every function and class of a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
            yield node.name, node.end_lineno - first + 1, isinstance(node, ast.ClassDef)


def test_imports_only_point_down():
    order = floors()
    for path in SOURCES:
        if path.relative_to(ROOT).as_posix() in STANDALONE:
            assert not list(imported(path))
            continue
        below = set(order[: order.index(dotted(path))])
        above = set(imported(path)) - below
        assert not above, f"{dotted(path)} imports {above}"


@pytest.mark.parametrize("room", STRANGERS)
def test_rooms_that_must_not_know_each_other(room):
    for path in (ROOT / room).glob("*.py"):
        known = {name.partition(".")[0] for name in imported(path)}
        assert not known & STRANGERS[room], f"{dotted(path)} imports from {known & STRANGERS[room]}"


def test_the_simulation_knows_no_phase():
    for path in (ROOT / "simulation").glob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert not any(name in text for name in ("h1(", "q1(", ".h2(", ".q2("))


def test_every_file_has_a_place_and_a_docstring():
    placed = {dotted(path) for path in SOURCES if path.relative_to(ROOT).as_posix() not in STANDALONE}
    assert placed == set(floors())
    for path in ROOT.rglob("*.py"):
        assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))), dotted(path)


def test_files_functions_and_classes_fit_on_screens():
    for path in SOURCES:
        assert len(path.read_text(encoding="utf-8").splitlines()) <= 350, dotted(path)
        for name, length, is_class in measured(path):
            limit = 50 if not is_class else 200 if name == "ExponentSolver" else 150
            assert length <= limit, f"{dotted(path)}: {name} has {length} lines"


@pytest.mark.parametrize("room", ["fpsolve", *(f"fpsolve.{room}" for room in ROOMS if (ROOT / room).is_dir() and room)])
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


def test_public_surface():
    assert len(fpsolve.__all__) <= 24
