"""What the pages of the site tell to type into Python runs, page by page, and their case files are read."""

import ast
import re
import runpy
import shutil
from contextlib import chdir, redirect_stdout
from functools import cache
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib.pyplot as plt
import pytest
from cyclopts import App
from numpy.testing import assert_allclose

import fpsolve
from fpsolve import (
    Problem,
    boundary,
    explore,
    lyapunov_exponent,
    make_mesh,
    moment_lyapunov,
    sensitivities,
    simulate,
)
from fpsolve.analysis import Axis
from fpsolve.model import OrnsteinUhlenbeckByDeviation, ParametricOscillator
from tests.contract.test_cases import CASES, ROOT
from tests.kit import case_in, rates, solve_case
from tests.prose import CODE, PAGES, PRINTED, hard, texts

LONG = "guide/response", "guide/charts", "guide/python"


def blocks(page, language):
    return re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


def named(language):
    """Pages that have such blocks; those that take some seconds are slow."""
    known = {page: f"{page.parent.name}/{page.stem}" for page in PAGES if blocks(page, language)}
    return [
        pytest.param(page, id=name, marks=[pytest.mark.slow] * (name in LONG))
        for page, name in known.items()
        if "tutorials" not in name
    ]


@cache
def typed(page):
    """What the blocks of Python of a page name and print."""
    plt.switch_backend("Agg")
    names, printed = dict[str, object](), StringIO()
    with TemporaryDirectory() as folder, chdir(folder), redirect_stdout(printed):
        for block in blocks(page, "python"):
            if "results/fig1" in block:
                numbers = "output={ figure = false, quantities = ['moment', 'lyapunov_exponent', 'stability_index'] }"
                fpsolve.run(fpsolve.load_case(CASES / "fig1.toml", [numbers]))
            text = block.replace("paths=4096", "paths=64, time=100.0").replace("rtol=1e-2", "rtol=1e-1")
            exec(re.sub(r"( = boundary\(.*)\)\n", r"\1, nodes=3)\n", text), names)  # which takes a tenth of the time
    plt.close("all")
    return names, printed.getvalue()


@pytest.mark.parametrize("page", named("python"))
def test_python_of_a_page_runs_and_prints_the_numbers_of_its_comments(page):
    _, printed = typed(page)
    for block in blocks(page, "python"):
        for comment in re.findall(r"print\(.*\)  # (-?\d.*)", block):
            for number in re.findall(r"-?\d+\.\d{6,}", comment):
                assert number[:-2] in printed, number


@pytest.mark.parametrize("page", named("toml"))
def test_toml_of_a_page_is_a_case_or_a_part_of_one(page, tmp_path):
    shutil.copytree(CASES / "systems/beam", tmp_path / "beam")
    for block in blocks(page, "toml"):
        title = "" if "title" in block else 'title = "T"\n'
        moments = "" if "[moments]" in block else "\n[moments]\np = [2.0]\n"
        noise = "" if "[noise" in block else '\n[noise]\nkind = "ornstein-uhlenbeck"\nalpha = 1.0\nsigma = 1.0\n'
        assert case_in(tmp_path, title + block + moments + noise).planned


def test_page_of_keys_has_every_section_and_keeps_the_case_of_symbols():
    page = runpy.run_path(str(ROOT / "docs/keys.py"))["keys"]()
    for each in ("ẍ + 2·damping·ẋ + (", "The orders p,", "| `c2` | $c_2$: nonlinear"):
        assert f"\n{each}" in page


def test_every_room_has_a_page_of_reference():
    tree = ast.parse((ROOT / "docs/made.py").read_text(encoding="utf-8"))
    values = {each.targets[0].id: each.value for each in tree.body if isinstance(each, ast.Assign)}
    rooms = {path.parent.name for path in Path(fpsolve.__file__).parent.glob("*/__init__.pyi")}
    assert set(ast.literal_eval(values["ROOMS"])) == rooms != set()
    index = (ROOT / "docs/reference/index.md").read_text(encoding="utf-8")
    assert all(f"/generated/reference/{room}\n" in index for room in rooms)


def test_format_command_and_picture_of_the_pages_are_of_a_case(tmp_path, capsys):
    names, _ = typed(ROOT / "docs/contributing.md")
    case = fpsolve.load_case(CASES / "minimal.toml")
    results = solve_case(case)
    typed(ROOT / "docs/extending.md")[0]["write_lines"](case, results, tmp_path / "lines.txt")
    assert "parameter set 1, lyapunov_exponent = " in (tmp_path / "lines.txt").read_text(encoding="utf-8")
    for each in names["law"](case, results[0], tmp_path, None):
        each.write(tmp_path)
    assert (tmp_path / "law.png").exists()
    app = App()
    app.command(names["variance"])
    arguments = ["variance", str(case.path), "--set", "noise.D0=2.0"]
    assert app(arguments, result_action="return_value") == 0
    variance = case.problem.at({"noise.D0": 2.0}).noise.standard_deviation ** 2
    assert float(capsys.readouterr().out.rpartition(": ")[2]) == pytest.approx(variance, rel=1e-5)


@pytest.mark.parametrize("mesh", [None, make_mesh(phi_cells=4, xi_cells=4)], ids=["polynomials", "cells"])
def test_slope_by_the_size_of_a_noise_of_the_page_is_that_by_its_factor_in_the_equation(mesh):
    names, _ = typed(ROOT / "docs/guide/noises.md")
    problem = rates("x' = v; v' = -x - 0.2*v - k*xi*x", names["Uniform"](a=0.8, alpha=1.0), k=1.0)
    [slopes] = sensitivities(problem, 1.0, mesh=mesh).moments
    assert 0.8 * slopes["noise.a"].value == pytest.approx(slopes["system.k"].value, rel=1e-9)


def test_population_of_the_noise_of_the_page_has_the_number_of_the_elements():
    """Its σ depends on ξ, so that no bias of its drift is weighed."""
    problem = typed(ROOT / "docs/guide/noises.md")[0]["problem"]
    found = simulate(problem, [4.0], estimator="population", paths=4096, time=30.0, seed=1).estimates[0]
    assert abs(found.value - moment_lyapunov(problem, 4.0).value) <= 3 * found.standard_error < 0.01


def test_noise_and_system_of_the_page_on_extending_are_what_those_that_ship_are():
    names, _ = typed(ROOT / "docs/extending.md")
    own = Problem(names["Pendulum"](length=1.0, damping=0.1), names["Wind"](size=0.5**0.5, duration=1.0))
    known = Problem(ParametricOscillator(1.0, 0.1), OrnsteinUhlenbeckByDeviation(1.0, 0.5**0.5))
    damping = Axis("system.damping", 0.1, 0.6)
    for found in (
        lambda each, _: moment_lyapunov(each, [1.0, 2.0]).value,
        lambda each, _: lyapunov_exponent(each).value,
        lambda each, _: simulate(each, [1.0], paths=64, time=100.0).lyapunov_exponent,
        lambda each, size: [sensitivities(each, 2.0).moments[0][key].value for key in ("system.damping", size)],
        lambda each, size: boundary(each, "moment(2) = 0", damping, Axis(size, 0.5, 2.0), nodes=3).branches[0].y,
    ):
        assert_allclose(found(own, "noise.size"), found(known, "noise.standard_deviation"), rtol=1e-9)
    explore(own).close()


@pytest.mark.parametrize("page", [*PAGES, *PRINTED], ids=str)
def test_no_sentence_is_hard(page):
    assert hard(page) == []


def test_messages_that_the_page_of_words_quotes_are_printed():
    quoted = re.findall(r'"([^"\n]+)"', (ROOT / "docs/guide/words.md").read_text(encoding="utf-8"))
    printed = "\n".join(text for path in CODE.rglob("*.py") for text in texts(path))
    assert [each for each in quoted if each not in printed] == [] != quoted


def test_tutorials_in_markdown_are_those_of_the_site():
    made = runpy.run_path(str(ROOT / "docs/tutorial_pages.py"))
    for script in made["SCRIPTS"]:
        page = re.sub(
            r"```text\n.*?```\n\n", "", script.with_suffix(".md").read_text(encoding="utf-8"), flags=re.DOTALL
        )
        assert page == made["page"](script), "type `python docs/tutorial_pages.py`"
