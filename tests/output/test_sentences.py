"""What the terminal, summary.json and the report say of excursions, and in one sentence of a curve."""

import html
import re
from types import SimpleNamespace

import pytest

from fpsolve.cli import main
from fpsolve.parts.excursions import bounds_text
from fpsolve.show.verdict import meaning, verdict
from tests.kit import case_in, read_json, solve_case

TEXT = """
title = "Telegraph"
[system]
variables = ["x", "v"]
drift = ["v", "-x - 2*zeta*v - xi*x"]
parameters = { zeta = 0.08 }
[noise]
kind = "telegraph"
a = 0.8
k = 1.0
[moments]
p = [1.0, 2.0]
[output]
quantities = ["moment", "lyapunov_exponent", "stability_index", "excursions"]
figure = false
[excursions]
levels = [2, 4, 8]
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The folder of a run with a report, and what a second run, which reads records, prints."""
    folder = tmp_path_factory.mktemp("excursions")
    (folder / "mine.toml").write_text(TEXT)
    arguments = ["run", str(folder / "mine.toml"), "--out", str(folder), "--report"]
    assert main(arguments) == 0
    return folder / "mine", arguments


def test_a_run_states_bounds_and_their_meaning(written, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "400")
    folder, arguments = written
    assert main(arguments) == 0
    shown = capsys.readouterr().out
    assert (
        "Start with φ₀ = 0, stationary noise: P(sup ‖x‖ ≥ 2) between 0.288 and 0.436, P(sup ‖x‖ ≥ 4) between 0.117 and "
        "0.177, P(sup ‖x‖ ≥ 8) between 0.0474 and 0.0717; ‖x‖ is the length of (x, v), and ‖x₀‖ = 1." in shown
    )
    for text in (
        "Almost every path decays, halving in a time of 23.4; the mean square grows, doubling in a time of 24.7.",
        "rare paths carry it in bursts",
        "P(sup ‖x‖ ≥ 8) between 0.0474 and 0.0717",
    ):
        assert text in shown
        assert text in html.unescape((folder / "report.html").read_text(encoding="utf-8"))


def test_the_summary_holds_them(written):
    folder, _ = written
    [curve] = read_json(folder / "summary.json")["curves"]
    found = curve["excursions"]
    assert found["start"] == {"phi": 0.0, "xi": "stationary"}
    assert found["stability_index"] == pytest.approx(1.302367339, abs=1e-8)
    assert found["lower"] == pytest.approx(0.712, abs=5e-4)
    assert found["upcrossings"] == pytest.approx(4.10, abs=5e-3)
    assert [each["level"] for each in found["levels"]] == [2.0, 4.0, 8.0]
    assert all(0 < each["least_probable"] < each["most_probable"] < 1 for each in found["levels"])


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["noise.a=0.3"], "the mean square decays, halving"),
        (["system.zeta=0.01"], "passes every level in the end;"),
        (["moments.p=[1.0]"], "those of p > δ_p grow"),
        (["moments.p=[1.0]"], "P(sup ‖x‖ ≥ A), falls as A^-1.302."),
        (["output.quantities=['lyapunov_exponent']", "excursions={}"], "Almost every path decays"),
        (["output.quantities=['stability_index']", "excursions={}"], "δ_p = 1.302367 > 0"),
        (["output.quantities=['moment']", "moments.p=[1.0]", "excursions={}"], ""),
    ],
)
def test_a_sentence_says_what_there_is(tmp_path, changes, words):
    case = case_in(tmp_path, TEXT, changes)
    [result] = solve_case(case)
    told = " ".join(filter(None, (verdict(case, result), *(each.text for each in meaning(result)))))
    assert words in told
    assert bool(words) == bool(told)


def test_no_path_passes_every_level_where_a_stationary_response_is_not_known(tmp_path):
    """Here none is computed, as the noise is a chain."""
    case = case_in(tmp_path, TEXT, ["system.zeta=0.01", "system.drift=['v', '-x - 2*zeta*v - v**3 - xi*x']"])
    [result] = solve_case(case)
    told = verdict(case, result)
    assert re.fullmatch(r"Almost every path grows, doubling in a time of \S+ near rest; the mean square.*", told)


def test_a_table_over_a_parameter_has_a_column(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    path.write_text(
        TEXT + '[vary]\n"system.zeta" = [0.02, 0.08]\n[figure]\nx = "system.zeta"\ny = "lyapunov_exponent"\n'
    )
    assert main(["run", str(path), "--out", str(tmp_path)]) == 0
    shown = capsys.readouterr().out
    assert "P(sup ‖x‖ ≥ 8)" in shown
    assert "0.0474-0.0717" in shown


def test_bounds_are_rounded_outwards():
    def shown(low, high):
        found = SimpleNamespace(is_certain=False, bounds=lambda level: (low, high))
        return [float(each) for each in bounds_text(found, 2.0).replace("e-", "e_").split("-") if "e_" not in each]

    for low, high in ((0.12345, 0.67891), (0.0999999, 0.9999), (0.01, 0.02)):
        down, up = shown(low, high)
        assert down <= low <= high <= up
        assert up - down <= (high - low) + 0.011 * (low + high)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (["excursions.levels=[1.0]"], "must be a finite number > 1 "),
        (["excursions.phi='first'"], 'must be a finite number or "uniform"'),
        (["excursions.xi=0.7"], "must be one of the states, -0.8, 0.8"),
        (["excursions.xi=0.8", "vary={'noise.a'=[0.7, 0.8]}"], "with noise.a = 0.7: got xi = 0.8; must be one of"),
        (["output.quantities=['moment']"], 'output.quantities has no "excursions"'),
    ],
)
def test_what_is_no_excursion_is_refused(tmp_path, capsys, changes, words):
    path = tmp_path / "mine.toml"
    path.write_text(TEXT)
    options = [each for change in changes for each in ("--set", change)]
    assert main(["run", str(path), "--out", str(tmp_path), *options]) == 2
    assert words in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "mine").exists()


def test_a_set_without_the_start_of_an_excursion_is_told_beside_the_others(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    path.write_text(TEXT)
    options = ["--set", "excursions.xi=0.8", "--set", "vary={'noise.a'=[0.8, 0.7]}"]
    assert main(["run", str(path), "--out", str(tmp_path), *options]) == 3
    told = " ".join(capsys.readouterr().err.split())
    assert "noise.a = 0.7: no P(sup ‖x‖ ≥ A): got xi = 0.8; must be one of the states, -0.7, 0.7" in told
