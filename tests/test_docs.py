"""What the pages of the site tell to type into Python runs, page by page, and their case files are read."""

import ast
import doctest
import inspect
import json
import math
import re
import runpy
import shutil
from contextlib import chdir, redirect_stdout
from datetime import UTC, datetime
from functools import cache
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import pytest

import fpsolve
from fpsolve import ExponentSolver
from fpsolve.exponent import INDICES, Budget
from fpsolve.output.records import entries_of, record_of_set
from fpsolve.output.tables import facts_of, write_results
from fpsolve.parts import PARTS, indices
from fpsolve.parts.part import Numerics
from fpsolve.study import columns, solve
from fpsolve.study.solve import everything, result_of, solve_curve

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")), *sorted((ROOT / "docs").glob("[!g]*/*.md"))]
PAGES += sorted((ROOT / "docs/guide").glob("*.md"))
LONG = "guide/response", "guide/charts", "guide/python"


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def named(pages, language):
    """Pages that have such blocks; those that take some seconds are slow."""
    known = {page: f"{page.parent.name}/{page.stem}" for page in pages if blocks(page, language)}
    return [pytest.param(page, id=name, marks=[pytest.mark.slow] * (name in LONG)) for page, name in known.items()]


@cache
def typed(page):
    """What the blocks of Python of a page name and print, in a folder of its own."""
    plt.switch_backend("Agg")
    names, printed = dict[str, object](), StringIO()
    with TemporaryDirectory() as folder, chdir(folder), redirect_stdout(printed):
        for block in blocks(page, "python"):
            if "results/fig1" in block:
                numbers = "output={ figure = false, quantities = ['moment', 'lyapunov_exponent', 'stability_index'] }"
                fpsolve.run(fpsolve.load_case(ROOT / "cases/fig1.toml", [numbers]))
            text = block.replace("paths=4096", "paths=64, time=100.0")
            text = text.replace("rtol=1e-2", "rtol=1e-1")
            text = re.sub(r"( = boundary\(.*)\)\n", r"\1, nodes=3)\n", text)  # which takes a tenth of the time
            exec(text, names)
    plt.close("all")
    return names, printed.getvalue()


@pytest.mark.parametrize("page", named(PAGES, "python"))
def test_blocks_of_python_run(page):
    """Each number that a comment says of what is printed is printed."""
    _, printed = typed(page)
    for block in blocks(page, "python"):
        for comment in re.findall(r"print\(.*\)  # (-?\d.*)", block):
            for number in re.findall(r"-?\d+\.\d{6,}", comment):
                assert number[:-2] in printed, number


@pytest.mark.parametrize("page", named(PAGES, "toml"))
def test_blocks_of_toml_are_cases(page, tmp_path):
    """A whole case is read; what is less is a part of one, with the matrices of a shipped case beside it."""
    shutil.copytree(ROOT / "cases/systems/beam", tmp_path / "beam")
    for number, block in enumerate(blocks(page, "toml")):
        parts = [block]
        for section, text in (
            ("title", 'title = "T"\n'),
            ("[moments]", "\n[moments]\np = [2.0]\n"),
            ("[noise", '\n[noise]\nkind = "ornstein-uhlenbeck"\nalpha = 1.0\nsigma = 1.0\n'),
        ):
            if section not in block:
                parts.insert(0 if section == "title" else len(parts), text)
        path = tmp_path / f"part{number}.toml"
        path.write_text("".join(parts), encoding="utf-8")
        fpsolve.load_case(path)


def test_the_page_of_keys_is_what_the_code_says():
    keys = runpy.run_path(str(ROOT / "docs/keys.py"))
    assert keys["PAGE"].read_text(encoding="utf-8") == keys["keys"](), "run python docs/keys.py"


def test_every_room_has_a_page_of_reference():
    """The pages list the public names of the rooms; that each has a docstring is a test of the architecture."""
    tree = ast.parse((ROOT / "docs/made.py").read_text(encoding="utf-8"))
    values = {each.targets[0].id: each.value for each in tree.body if isinstance(each, ast.Assign)}
    rooms = {path.parent.name for path in (ROOT / "fpsolve").glob("*/__init__.pyi")}
    assert set(ast.literal_eval(values["ROOMS"])) == rooms
    index = (ROOT / "docs/reference/index.md").read_text(encoding="utf-8")
    assert all(f"/generated/reference/{room}\n" in index for room in rooms)


def test_a_quantity_of_the_walk_through_is_solved_and_tabulated(monkeypatch, tmp_path):
    """As the page on contributing says: once it is one of the `INDICES`, tables are loops over these."""
    names, _ = typed(ROOT / "docs/contributing.md")
    index = names["index"]
    part = indices.part_of(index)
    monkeypatch.setitem(INDICES, index.name, index)
    for module in (solve, columns):
        monkeypatch.setattr(module, "PARTS", (*PARTS, part))
    monkeypatch.setitem(solve.BY_NAME, part.name, part)
    case = fpsolve.load_case(ROOT / "cases/theorem.toml", ["expect=[]", "figure={}"])
    asked_for = case.model_copy(update={"output": case.output.model_copy(update={"quantities": (index.name,)})})
    wanted = everything(asked_for)
    assert index.name in wanted
    result = solve_curve(next(case.curves()), wanted, Numerics.of(case)).result
    found, finer = result.estimates[index.name], index.solve(ExponentSolver(case.problem, rtol=1e-9), None)
    assert abs(found.value - finer.value) <= found.error_estimate + finer.error_estimate
    write_results(asked_for, [result], tmp_path, facts_of(asked_for, datetime.now(UTC), 0.0))
    heads = (tmp_path / "curves.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert {index.name, f"{index.name}_error"} <= set(heads)


def test_the_part_of_the_walk_through_is_solved_recorded_and_tabulated(monkeypatch):
    """The chance that Gaussian noise is above a level, as the complementary error function has it."""
    names, _ = typed(ROOT / "docs/contributing.md")
    part, case = names["part"], fpsolve.load_case(ROOT / "cases/minimal.toml")
    monkeypatch.setattr(solve, "PARTS", (*PARTS, part))
    monkeypatch.setitem(solve.BY_NAME, part.name, part)
    [curve], asked = case.curves(), {"moment": {"p": [], "slopes": True}, part.name: {"level": 1.0}}
    solved = solve_curve(curve, asked, Numerics.of(case))
    record = json.loads(json.dumps(record_of_set(curve, asked, Numerics.of(case), solved.entries)))
    entries, _ = entries_of(record, asked, Numerics.of(case))
    expected = 0.5 * math.erfc(1.0 / (math.sqrt(2) * curve.noise.standard_deviation))
    for found in (solved.result, result_of(curve, asked, Numerics.of(case), entries)):
        assert found.parts[part.name].value == pytest.approx(expected, rel=1e-8)
        row = part.row(case, found)
        assert row.keys() == {each.name for each in (names["chance"], names["chance"].error())}


def test_the_format_and_the_command_of_the_walk_through(tmp_path, capsys):
    """A line for each number of a curve, and a command that takes the options of others."""
    names, _ = typed(ROOT / "docs/contributing.md")
    case = fpsolve.load_case(ROOT / "cases/minimal.toml")
    names["write_lines"](
        case, [solve_curve(next(case.curves()), everything(case), Numerics.of(case)).result], tmp_path / "lines.txt"
    )
    assert "curve 1, lyapunov_exponent = " in (tmp_path / "lines.txt").read_text(encoding="utf-8")
    minimal = str(ROOT / "cases/minimal.toml")
    assert names["app"](["variance", minimal, "--set", "noise.D0=2.0"], result_action="return_value") == 0
    said = capsys.readouterr().out
    assert float(said.rpartition(": ")[2]) == pytest.approx(
        case.problem.at({"noise.D0": 2.0}).noise.standard_deviation ** 2, rel=1e-5
    )


@pytest.mark.slow
def test_every_name_at_the_top_has_an_example_that_runs(tmp_path, monkeypatch):
    """One after another, as the problem of the first one is that of the others."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(ROOT / "cases/minimal.toml", tmp_path)
    known = {name: getattr(fpsolve, name) for name in fpsolve.__all__} | {"Budget": Budget}
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.IGNORE_EXCEPTION_DETAIL)
    for name in sorted(fpsolve.__all__, key=lambda name: (name != "Problem", name == "open_results", name)):
        text = inspect.getdoc(known[name])
        examples = doctest.DocTestParser().get_doctest(text, known, name, None, 0)
        assert examples.examples, name
        assert runner.run(examples, clear_globs=False).failed == 0, name
        known |= examples.globs
