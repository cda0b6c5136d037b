"""The moment hierarchy of fpsolve against that of the oracles, and the command that compares with it."""

from pathlib import Path

import numpy as np
import pytest

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.cli import BAD_INPUT, CHECK_FAILED, main
from fpsolve.errors import NoHierarchy
from fpsolve.model import CoefficientMatrix, LinearSystem, MarkovChain, ParametricOscillator, Telegraph, White
from fpsolve.theory.hierarchy import hierarchy_exponent
from tests.oracles import moment_hierarchy


@pytest.mark.parametrize("p", [2, 4, 10])
def test_any_matrices_with_any_chain(rng, p):
    steady, driven = rng.uniform(-1, 1, (2, 2, 2))
    states, rates = rng.uniform(-1, 1, 3), rng.uniform(0.2, 2, (3, 3))
    chain = MarkovChain(states, rates - np.diag(np.diagonal(rates)))
    terms = [CoefficientMatrix(0, steady), CoefficientMatrix(1, driven, identity)]
    expected = moment_hierarchy.moment_lyapunov([steady + 0.4 * xi * driven for xi in states], chain.rates, p)
    value, error = hierarchy_exponent(Problem(PlaneSystem(terms, epsilon=0.4), chain), p)
    assert abs(value - expected) <= error + 1e-14 * abs(expected)
    assert error < 1e-10


@pytest.mark.parametrize("sense", ["stratonovich", "ito"])
def test_any_matrices_with_white_noise(rng, sense):
    steady, driven = rng.uniform(-1, 1, (2, 2, 2))
    terms = [CoefficientMatrix(0, steady), CoefficientMatrix(1, driven, identity)]
    problem = Problem(PlaneSystem(terms, epsilon=0.4), White(s=1.3, interpretation=sense))
    for p in (2, 6):
        expected = moment_hierarchy.white_noise_exponent(steady, [0.4 * 1.3 * driven], p, sense)
        assert hierarchy_exponent(problem, p)[0] == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize(
    ("system", "noise", "p", "words"),
    [
        (ParametricOscillator(1.0, 0.1), White(0.5), 3.0, "even p > 0 only"),
        (ParametricOscillator(1.0, 0.1), White(0.5), 0.0, "even p > 0 only"),
        (ParametricOscillator(1.0, 0.1, 0.9), White(0.5), 2.0, "where a wall changes the state"),
        (ParametricOscillator(1.0, 0.1), OrnsteinUhlenbeck(1.0, 1.0), 2.0, "but not for ornstein-uhlenbeck noise"),
        (ParametricOscillator(1.0, 0.1), Telegraph(0.5, 1.0), 1e6, "2000002 equations are more than 2000"),
        (LinearSystem([CoefficientMatrix(0, np.eye(3).tolist(), identity)]), White(0.5), 2.0, "got 3 variables"),
    ],
)
def test_what_does_not_close_is_refused(system, noise, p, words):
    with pytest.raises(NoHierarchy, match=words):
        hierarchy_exponent(Problem(system, noise), p)


CASE = """\
title = "hierarchy"
[system]
kind = "parametric"
stiffness = 1.0
damping = 0.05
[noise]
kind = "telegraph"
a = 0.5
k = 1.0
[moments]
p = [-1.0, 1.0, 2.0, 4.0]
[vary]
"noise.k" = [0.5, 1.0]
"""


def test_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "hierarchy.toml"
    path.write_text(CASE, encoding="utf-8")
    command = ["check", "--hierarchy", str(path), "--jobs", "1"]
    assert main(command) == 0
    said = capsys.readouterr().out
    assert "4 of 4 ok" in said
    assert "moment, p = 4" in said
    assert "-0.0332610990213" in said
    monkeypatch.setattr("fpsolve.study.hierarchy.hierarchy_exponent", lambda problem, p: (0.1, 1e-12))
    assert main([*command, "--quiet"]) == CHECK_FAILED
    assert capsys.readouterr().out == "hierarchy: 0 of 4 ok\n"


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("system.restitution=0.9", "with noise.k = 0.5: the equations of the moments do not close where a wall"),
        ("moments.p=[1.0, 3.0]", "moments.p: has no even p > 0, and the hierarchy is for these; add 2.0"),
    ],
)
def test_the_command_refuses_what_does_not_close(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], override: str, words: str
) -> None:
    path = tmp_path / "hierarchy.toml"
    path.write_text(CASE, encoding="utf-8")
    assert main(["check", "--hierarchy", str(path), "--set", override]) == BAD_INPUT
    assert words in " ".join(capsys.readouterr().err.split())
