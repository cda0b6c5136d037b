"""Sweeps by few solves: against solves of their own, where there is no surface, and from the records."""

import numpy as np
import pytest
import xarray as xr

from fpsolve.case.case import load_case
from fpsolve.cli import main
from fpsolve.study import reduced
from tests.kit import case_text, read_json

TEXT = case_text(
    """
[moments]
p = [2.0]
[vary]
reduced = true
"noise.D0" = { start = 0.2, stop = 0.8, num = 5, scale = "log" }
[output]
figure = false
""",
    "Few solves",
    epsilon=0.5,
)
NAMES = "moment", "lyapunov_exponent", "stability_index"


def solved(folder, name, text):
    """The results of a case, by the command."""
    (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    assert main(["run", str(folder / f"{name}.toml"), "--jobs", "1", "--out", str(folder)]) == 0
    with xr.open_dataset(folder / name / "results.nc") as found:
        return found.load()


@pytest.mark.slow
def test_sets_of_few_solves_and_of_their_own(tmp_path, monkeypatch, capsys):
    """Both agree within their errors; what no surface tells is solved, and records keep what one tells."""
    whole = solved(tmp_path, "whole", TEXT.replace("reduced = true", "").replace("p = [2.0]", "p = [2.0]\nrtol = 1e-9"))
    few = solved(tmp_path, "few", TEXT)
    assert "solves tell 5 curves" in capsys.readouterr().err
    kept = reduced.solved_sets

    def half(case, what):
        found = kept(case, what)
        if what[0] == "stability_index":
            found.values[1:3] = np.nan
        return found

    monkeypatch.setattr("fpsolve.workflow.sets.solved_sets", half)
    both = solved(tmp_path, "both", TEXT)
    assert "tell 3 curves, each of the other 2 its own" in " ".join(capsys.readouterr().err.split())
    for found in (few, both):
        for name in NAMES:
            difference = np.abs(found[name] - whole[name])
            assert np.all(difference <= found[f"{name}_error"] + whole[f"{name}_error"])
    monkeypatch.setattr("fpsolve.workflow.sets.solved_sets", None)  # as the records know
    again = solved(tmp_path, "few", TEXT)
    assert np.array_equal(again.moment, few.moment)
    summary = read_json(tmp_path / "few" / "summary.json")
    assert [curve["status"] for curve in summary["curves"]] == ["converged"] * 5
    with pytest.raises(TypeError):  # another range solves again
        solved(tmp_path, "few", TEXT.replace("stop = 0.8", "stop = 0.7"))


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("reduced = true", "reduced = 1", "vary.reduced: got 1 (a number); must be true or false"),
        (
            '"noise.D0"',
            '"oscillator.epsilon" = [0.1, 0.2]\n"oscillator.c1" = [0.1, 0.2]\n"noise.D0"',
            "must be one or two",
        ),
        ("figure = false", 'figure = false\nquantities = ["variance_rate"]', "is not there with vary.reduced = true"),
    ],
)
def test_what_few_solves_do_not_tell_is_refused(tmp_path, capsys, old, new, told):
    (tmp_path / "bad.toml").write_text(TEXT.replace(old, new), encoding="utf-8")
    assert main(["run", str(tmp_path / "bad.toml"), "--out", str(tmp_path)]) == 2
    assert told in " ".join(capsys.readouterr().err.split())


def test_what_is_asked_by_default(tmp_path):
    (tmp_path / "case.toml").write_text(TEXT, encoding="utf-8")
    assert load_case(tmp_path / "case.toml").asked == NAMES
