"""What is printed, drawn and written of noise with algebraic tails says what the numbers mean."""

import json

import numpy as np
import pytest

from fpsolve.case.case import load_case
from fpsolve.cli import main
from fpsolve.output.figures import _moment_series
from tests.solving import case_in, case_text, solve_case

SECTIONS = "[moments]\np = [-0.4, -0.1, 0.0]\n[monte_carlo]\npaths = 64\ntime = 40.0\np = [-0.4]\n"
TAILS = {"tau0": 1.0, "r0": 1.1, "treatment": "exact"}


def text(c1):
    return case_text(SECTIONS, "Heavy tails", TAILS, epsilon=0.5, restitution=1.0, c1=c1)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("heavy") / "heavy.toml"
    path.write_text(text(0.0), encoding="utf-8")
    return path


@pytest.mark.slow
def test_every_result_says_it(path, tmp_path, capsys):
    assert main(["run", str(path), "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr()
    assert "δ_p = none\n" in printed.out
    said = " ".join(printed.err.split())
    assert "Λ(p) > 0 for every p ≠ 0" in said
    assert "λ is the growth rate of almost every path" in said
    (curve,) = json.loads((tmp_path / "heavy" / "summary.json").read_text(encoding="utf-8"))["curves"]
    assert curve["stability_index"] is None
    assert "there is no stability index" in curve["notes"][0]
    assert "at p = -0.1 rare paths carry the moment" in curve["notes"][1]
    assert not any("no stability index" in text for text in curve["warnings"])  # it is no failure


def test_a_positive_exponent_is_no_slope(path, tmp_path):
    for c1, is_slope in ((0.0, False), (-0.5, True)):
        (result,) = solve_case(case_in(tmp_path, text(c1), ["output.quantities=['lyapunov_exponent']"]))
        assert (result.lyapunov_exponent.value < 0) == is_slope
        assert ("not Λ′(0)" in result.notes[0]) != is_slope


def test_the_figure_tells_rare_paths_apart(path):
    case = load_case(path, ["output.quantities=['moment']"])
    (result,) = solve_case(case)
    series = _moment_series(case, result, None, with_theory=True)
    np.testing.assert_array_equal(series.rare, [False, True, False])


def test_a_simulation_does_not_see_them(path, tmp_path, capsys):
    assert main(["simulate", str(path), "--out", str(tmp_path)]) == 0
    assert "a simulation shows Λ(p) without these paths" in " ".join(capsys.readouterr().err.split())


@pytest.mark.slow
def test_pictures_of_a_place_far_out_are_small(path, tmp_path):
    """The interval is hundreds of noise units long: cells of the picture grow with the distance."""
    shown = 'output={quantities=["moment", "eigenfunctions"], eigenfunctions=[-0.1]}'
    assert main(["run", str(path), "--out", str(tmp_path), "--set", shown]) == 0
    assert (tmp_path / "heavy" / "eigenfunctions" / "p-0.1.vtu").stat().st_size < 5e6
