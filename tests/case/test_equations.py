"""Cases whose system is written as equations: keys, names of noises, symbols, walls, and the commands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from fpsolve.case.case import load_case
from fpsolve.case.vary import legend
from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT
from fpsolve.exponent.solver import moment_lyapunov
from fpsolve.model.problem import RTOL_BEYOND_PLANE
from fpsolve.model.systems import EquationSystem, VibroImpactOscillator
from fpsolve.output.records import set_key
from tests import snapshots
from tests.oracles import kronecker

SYSTEM = """\
title = "mine"
[system]
variables = ["x", "v"]
drift = ["v", "-omega**2 * x - 2*zeta*omega * v - load * x"]
parameters = { omega = 1.0, zeta = { value = 0.1, symbol = "\\\\zeta", unit = "1", words = "damping ratio" } }
noises = { load = "noise.axial" }
[noise.axial]
kind = "ornstein-uhlenbeck"
alpha = 1.0
sigma = 1.0
"""
MOMENTS = "[moments]\np = [2.0]\n"
ONLY = '[output]\nquantities = ["moment"]\nfigure = false\n'
LAMBDA_2 = 0.0940860185210208
"""Of the system as it stands, by its moment hierarchy."""
NOISE = """\
[noise]
kind = "ornstein-uhlenbeck"
alpha = 1.0
sigma = 0.5
"""
OSCILLATOR = """\
title = "paper"
[oscillator]
omega = 1.0
restitution = 0.8
c1 = 0.1
epsilon = 0.1
impact = "LAW"
"""
EQUATIONS = """\
title = "paper"
[system]
variables = ["x", "v"]
drift = ["omega*v", "-omega*x + epsilon**2*c1*v + epsilon*xi*v"]
parameters = { omega = 1.0, r = 0.8, c1 = 0.1, epsilon = 0.1 }
walls = [{ at = "x = 0", restitution = "LAW" }]
"""
LAWS = {"delta": "exp(-epsilon**2*(1 - r))", "restitution": "1 - epsilon**2*(1 - r)"}


def write(folder: Path, *parts: str) -> Path:
    path = folder / "mine.toml"
    path.write_text("".join(parts), encoding="utf-8")
    return path


def curves_of(path: Path, *options: str) -> list[dict[str, float]]:
    assert main(["run", str(path), "--out", str(path.parent), *options]) == 0
    summary = json.loads((path.parent / "mine/summary.json").read_text(encoding="utf-8"))
    return [{**curve["parameters"], "moment": curve["moments"][0]["moment"]} for curve in summary["curves"]]


def test_a_case_of_ones_own_equation(tmp_path: Path) -> None:
    """Its number, and its keys in [vary], in --set and in [figure]."""
    path = write(
        tmp_path,
        SYSTEM,
        MOMENTS,
        "rtol = 1e-6\n",
        ONLY,
        '[vary]\n"system.zeta" = [0.1, 0.2]\nnoise.axial.alpha = [1.0]\n',
    )
    first, second = curves_of(path)
    assert first["moment"] == pytest.approx(LAMBDA_2, abs=1e-6)
    assert second["moment"] < first["moment"]
    assert [*first][:4] == ["system.omega", "system.zeta", "noise.axial.alpha", "noise.axial.sigma"]
    options = ("--set", "vary={}", "--set", "system.zeta=0.2", "--set", "noise.axial.alpha=1.0")
    assert curves_of(path, *options) == [second]
    assert curves_of(path, "--set", "vary={}", "--set", "system.parameters.zeta=0.2") == [second]


def test_a_noise_has_its_name_or_none(tmp_path: Path) -> None:
    named = load_case(write(tmp_path, SYSTEM, MOMENTS))
    plain = SYSTEM.replace("noise.axial", "noise").replace("load", "xi").replace('noises = { xi = "noise" }\n', "")
    other = load_case(write(tmp_path, plain, MOMENTS))
    assert [*other.parameters] == ["system.omega", "system.zeta", "noise.alpha", "noise.sigma"]
    assert other.system.terms == named.system.terms
    keys = {set_key(case.curve({})) for case in (named, other)}
    assert len(keys) == 2


def test_symbols_and_words(tmp_path: Path) -> None:
    """They name axes and legends, and leave what is solved alone."""
    case = load_case(write(tmp_path, SYSTEM, MOMENTS))
    assert case.about("system.zeta").title == r"damping ratio $\zeta$"
    assert legend({"system.zeta": 0.1, "system.omega": 2.0}, case.about) == r"$\zeta$ = 0.1, $\omega$ = 2"
    assert load_case(write(tmp_path, SYSTEM, MOMENTS), ["system.zeta=0.2"]).about("system.zeta").latex == r"$\zeta$"
    other = load_case(write(tmp_path, SYSTEM.replace("damping ratio", "damping"), MOMENTS))
    keys = {set_key(each.curve({})) for each in (case, other)}
    assert len(keys) == 1


@pytest.mark.parametrize("law", LAWS)
def test_the_oscillator_of_the_paper(tmp_path: Path, law: str) -> None:
    """The same numbers, and the same reasons, all written out."""
    ours, mine = (
        load_case(write(tmp_path, text.replace("LAW", words), NOISE, MOMENTS)).problem
        for text, words in ((OSCILLATOR, law), (EQUATIONS, LAWS[law]))
    )
    assert isinstance(ours.system, VibroImpactOscillator)
    assert isinstance(mine.system, EquationSystem)
    values = [moment_lyapunov(problem, 2.0).value[0] for problem in (ours, mine)]
    assert values[0] == pytest.approx(values[1], rel=1e-12)


def test_check_and_chart(tmp_path: Path) -> None:
    expect = f'[[expect]]\nquantity = "moment"\np = 2.0\nvalue = {LAMBDA_2}\nrtol = 1e-8\nsource = "moment hierarchy"\n'
    assert main(["check", str(write(tmp_path, SYSTEM, MOMENTS, expect))]) == 0
    frame = '[chart]\nzero = [{ moment = 2.0 }]\nx = { key = "system.zeta", start = 0.1, stop = 0.3 }\n'
    case = load_case(
        write(
            tmp_path,
            SYSTEM,
            MOMENTS,
            frame,
            'y = { key = "noise.axial.sigma", start = 0.5, stop = 1.0 }\n',
        )
    )
    assert case.chart is not None


VOLTAGE = """title = "An oscillator with a voltage"

[system]
variables = ["x", "v", "u"]
drift = ["v", "-omega**2 * x - 2*zeta*omega * v + kappa * u - xi * x", "-kappa * v - u"]
parameters = { omega = 1.0, zeta = 0.05, kappa = 0.5 }

[noise]
kind = "white"
s = 0.8

[output]
quantities = ["moment"]

[moments]
p = [2.0]
"""
STEADY = np.array([[0, 1, 0], [-1, -0.1, 0.5], [0, -0.5, -1]])
DRIVEN = 0.8 * np.array([[0, 0, 0], [-1, 0, 0], [0, 0, 0]])


@pytest.mark.slow
def test_a_case_of_three_variables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its number is that of the second moments; what is for the phase alone is left out or refused in words."""
    path = write(tmp_path, VOLTAGE)
    assert load_case(path).rtol == RTOL_BEYOND_PLANE
    assert main(["run", str(path), "--out", str(tmp_path), "--report"]) == 0
    [curve] = json.loads((tmp_path / "mine/summary.json").read_text(encoding="utf-8"))["curves"]
    expected, [found] = kronecker.white(STEADY, DRIVEN, 2), curve["moments"]
    assert abs(found["moment"] - expected) <= found["moment_error"] <= 1e-5
    assert curve["discretisation"]["waves"] >= 2
    assert "du/dt = −0.5 v − u" in (tmp_path / "mine/report.html").read_text(encoding="utf-8")
    assert main(["prove", str(path), "--out", str(tmp_path)]) == 0
    assert main(["prove", "--check", str(tmp_path / "mine/proof.json")]) == 0
    white = 'kind = "white"\ns = 0.8'
    path = write(tmp_path, VOLTAGE.replace(white, 'kind = "ornstein-uhlenbeck"\nalpha = 1.0\nsigma = 0.5'))
    assert main(["prove", str(path), "--out", str(tmp_path)]) == BAD_INPUT
    assert "3 variables under other noise than white, or with a delay" in capsys.readouterr().err


def test_a_hundred_thousand_signs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = SYSTEM.replace("-omega**2", "-" * 100_000 + "omega**2")
    assert main(["run", str(write(tmp_path, text, MOMENTS)), "--out", str(tmp_path)]) == BAD_INPUT
    said = capsys.readouterr().err
    assert "mine.toml:4: system.drift[1]: has 100042 characters; must be at most 20000" in said
    assert not (tmp_path / "mine").exists()


def test_thirty_faulty_systems_have_one_sentence_each() -> None:
    """Word by word they stand in refusals/equations.txt, where each has exit code 2 and nothing is written."""
    found = [each for each in snapshots.entries() if each.name == "mine.toml" and each.changes[0].kind != "$"]
    assert len(found) >= 30
    assert sum(len(each.said) == 1 for each in found) >= len(found) - 1  # a wall without a place has two faults
