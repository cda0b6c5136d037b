"""Designs of cases: what is written, what is said, and the exit codes."""

import json

import pytest

from fpsolve.cli import main
from tests.kit import read_json

TEXT = """\
title = "The old oscillator"

[oscillator]
epsilon = 0.1
omega = 1.0
restitution = 0.8
c1 = 0.1  # to be designed

[noise]
D0 = 1.0
tau0 = 0.5
r0 = 0.95
treatment = "exact"

[moments]
p = [2.0]
"""
BY_DAMPING = ("--for", "stability_index = 1", "--by", "oscillator.c1", "--from", "-2", "--to", "0")


@pytest.fixture
def design(tmp_path, capsys):
    def run(*arguments):
        path = tmp_path / "old.toml"
        path.write_text(TEXT, encoding="utf-8")
        code = main(["design", str(path), "--out", str(tmp_path), *arguments])
        return (code, *capsys.readouterr())

    return run


def test_the_answer_is_a_case_that_meets_what_it_expects(design, tmp_path, capsys):
    code, out, _ = design(*BY_DAMPING)
    assert code == 0
    assert "-0.65415415855" in out
    assert "written: " in out
    text = (tmp_path / "old/design.toml").read_text(encoding="utf-8")
    assert "  # to be designed" in text
    assert main(["check", str(tmp_path / "old/design.toml")]) == 0
    assert "1 of 1 ok" in capsys.readouterr().out
    told = read_json(tmp_path / "old/design.json")
    assert told["complete"]
    assert told["solves"] <= 8
    assert told["by"][0]["before"] == 0.1
    assert told["by"][0]["after"] == pytest.approx(-0.65415415855, abs=5e-12)


def test_what_cannot_be_reached_exits_1_and_leaves_no_case(design, tmp_path):
    design(*BY_DAMPING)
    code, out, err = design("--for", "moment(2) = 5", *BY_DAMPING[2:], "--quiet")
    assert code == 1
    assert "Λ(2) = 5 cannot be reached with oscillator.c1 from -2 to 0" in err
    assert "no design" in out
    assert not (tmp_path / "old/design.toml").exists()
    assert not read_json(tmp_path / "old/design.json")["complete"]


def test_several_parameters_state_their_metric(design, tmp_path):
    several = "--by", "oscillator.restitution", "--by", "noise.D0"
    code, out, _ = design("--for", "stability_index = 0.2", *several)
    assert code == 0
    assert "the nearest such point" in out
    assert "oscillator.restitution / 0.8, noise.D0 / 1" in out
    code, out, _ = design("--for", "stability_index = 0.2", *several, "--json")
    assert code == 0
    told = json.loads(out)
    changes = [(each["after"] - each["before"]) / each["unit"] for each in told["by"]]
    assert told["distance"] == pytest.approx(sum(each**2 for each in changes) ** 0.5, rel=1e-12)
    assert [(each["start"], each["stop"]) for each in told["by"]] == [(0.4, 1.0), (0.5, 2.0)]


def test_what_is_not_solved_exits_3(design):
    code, _, err = design(*BY_DAMPING, "--set", "budget={ unknowns = 100 }")
    assert code == 3
    assert "not converged: old: " in err
