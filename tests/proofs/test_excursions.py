"""Bounds of excursions that are proven: near what finite elements find, and before two checkers."""

import copy
import functools
import json
import math
import re
from decimal import Decimal

import pytest

import fpsolve
from fpsolve import PlaneSystem, Problem
from fpsolve.analysis import excursion
from fpsolve.analysis.excursions import Crossing
from fpsolve.cli import main
from fpsolve.commands.options import BAD_INPUT, CHECK_FAILED
from fpsolve.model import OrnsteinUhlenbeck, ParametricOscillator, Telegraph, White
from fpsolve.proofs import prove_excursion, prove_lyapunov_exponent
from fpsolve.proofs.claims import ExcursionClaim
from tests.kit import read_json
from tests.oracles import certificate_checker as checker
from tests.oracles import certificate_excursion
from tests.proofs.test_systems import driven_velocity, wall

SKEW = PlaneSystem.of_equations(("x", "v"), ("0.3*x + v", "-1.5*x - 0.5*v - xi*x"))
PROBLEMS = {
    "telegraph": Problem(ParametricOscillator(1.0, 0.08, 1.0), Telegraph(0.8, 1.0)),
    "other coordinates": Problem(SKEW, Telegraph(0.9, 0.5)),
    "white": Problem(driven_velocity(wall(0.8)), White(0.8, interpretation="ito")),
    "bounded": Problem(fpsolve.VibroImpactOscillator(1.0, 0.8, -0.2, 0.7), fpsolve.NonGaussianNoise(0.3, 0.5, 0.9)),
}
QUICK = ("telegraph",)


@functools.cache
def proven(name):
    """Both bounds, and those on λ."""
    problem = PROBLEMS[name]
    return prove_excursion(problem), prove_lyapunov_exponent(problem, width=1e-3)


def moment(found):
    certificate = found.moment.certificate.model_dump(mode="json")
    return {"p": float(found.p), "lower": found.moment.lower, "upper": found.moment.upper, "certificate": certificate}


def claim_of(name, sense):
    """An entry of proof.json, and that of λ."""
    found, exponent = proven(name)
    side = getattr(found, sense)
    certificate = exponent.certificate.model_dump(mode="json")
    path = {"lower": exponent.lower, "upper": exponent.upper, "certificate": certificate}
    claim = {"sense": sense, "factor": side.factor, "moment": moment(side)}
    return tuple(json.loads(json.dumps(each)) for each in (claim, path))


def objections(claim):
    """Those of fpsolve itself."""
    numbers = {name: Decimal(repr(claim["moment"][name])) for name in ("p", "lower", "upper")}
    words = ("oscillator.impact", "noise.treatment", "noise.interpretation")
    parameters = {
        key: text if key in words else Decimal(text)
        for key, text in claim["moment"]["certificate"]["parameters"].items()
    }
    read = claim | {"factor": Decimal(repr(claim["factor"])), "moment": claim["moment"] | numbers}
    return list(ExcursionClaim.model_validate(read).objections(parameters))


def is_taken(claim, exponent):
    """By both checkers, which agree."""
    read, path = (checker.read(json.dumps(each)) for each in (claim, exponent))
    own, other = not objections(claim), not certificate_excursion.check(read, path)
    assert own == other
    return own


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK)) for name in PROBLEMS]
)
def test_bounds_are_those_of_finite_elements_and_both_checkers_take_them(name, monkeypatch):
    """c is T over its extremes at all phases, for the noise at the start that matters most."""
    problem, (found, exponent) = PROBLEMS[name], proven(name)
    monkeypatch.setattr(Crossing, "of", lambda problem: Crossing(1.0, False))
    noise = problem.noise
    starts = ["stationary"] if noise.is_white else noise.states if noise.has_states else [0.0, -0.9, 0.9]
    starts = [each * noise.half_width if isinstance(each, float) and not noise.has_states else each for each in starts]
    solved = [excursion(problem, xi=xi) for xi in starts]
    assert exponent.sign < 0
    delta = solved[0].stability_index.value
    assert float(found.upper.p) < delta < float(found.lower.p)
    assert float(found.lower.p) - float(found.upper.p) < 1e-3 * delta
    highest, lowest = max(each.upper.value for each in solved), min(each.lower.value for each in solved)
    slack = 1e-3  # as p is not δ_p
    assert highest * (1 - slack) <= found.upper.factor <= highest * 1.1
    assert lowest * 0.9 <= found.lower.factor <= lowest * (1 + slack)
    for sense in ("upper", "lower"):
        assert is_taken(*claim_of(name, sense))


@pytest.mark.parametrize("name", ["other coordinates", pytest.param("telegraph", marks=pytest.mark.slow)])
def test_bounds_that_claim_too_much_are_refused(name):
    for sense, less in (("upper", 0.97), ("lower", 1.03)):
        claim, exponent = claim_of(name, sense)
        changed = copy.deepcopy(claim)
        changed["factor"] *= less
        assert not is_taken(changed, exponent)
        changed = copy.deepcopy(claim)
        changed["moment"]["upper" if sense == "upper" else "lower"] = 1e-3 if sense == "upper" else -1e-3
        assert not is_taken(changed, exponent)
        assert not is_taken(claim | {"sense": "lower" if sense == "upper" else "upper"}, exponent)
        changed = copy.deepcopy(claim)
        changed["moment"]["certificate"]["cosine"][1][0] += 0.5
        assert not is_taken(changed, exponent)


def test_a_lower_bound_needs_paths_that_decay():
    claim, exponent = (checker.read(json.dumps(each)) for each in claim_of("telegraph", "lower"))
    assert certificate_excursion.check(claim) == "No Lyapunov exponent is proven."
    exponent["upper"] = Decimal("0.1")
    assert certificate_excursion.check(claim, exponent) == "Almost every path must decay."


def test_what_has_no_bounds():
    for problem in (
        Problem(ParametricOscillator(1.0, 0.1, 1.0), OrnsteinUhlenbeck(1.0, 0.8)),
        Problem(ParametricOscillator(1.0, 0.01, 1.0), Telegraph(0.8, 1.0)),  # λ > 0
    ):
        assert not prove_excursion(problem).is_proven


def test_the_command_proves_and_checks(tmp_path, capsys):
    path = tmp_path / "mine.toml"
    path.write_text(
        """
title = "Telegraph"
[system]
kind = "parametric"
stiffness = 1.0
damping = 0.08
[noise]
kind = "telegraph"
a = 0.8
k = 1.0
[moments]
p = [2.0]
[output]
quantities = ["moment", "lyapunov_exponent", "excursions"]
"""
    )
    assert main(["prove", str(path), "--out", str(tmp_path)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    found = re.search(r"Proven: (\S+) A\^-(\S+) ≤ P\(sup ‖x‖ ≥ A\) ≤ (\S+) A\^-(\S+) for every A > 1", told)
    least, more, most, less = map(float, found.groups())
    assert 1.3020 < less < 1.302367339 < more < 1.3027
    exact = [excursion(PROBLEMS["telegraph"], xi=xi) for xi in (-0.8, 0.8)]
    assert 0.99 * min(each.lower.value for each in exact) < least < min(each.lower.value for each in exact) * 1.001
    assert max(each.upper.value for each in exact) < most
    proof = tmp_path / "mine/proof.json"
    assert main(["prove", "--check", str(proof)]) == 0
    data = read_json(proof)
    [curve] = data["curves"]
    lower = next(each for each in curve["excursions"] if each["sense"] == "lower")
    exponent = checker.read(json.dumps(curve["lyapunov_exponent"]))
    assert certificate_excursion.check(checker.read(json.dumps(lower)), exponent) == ""
    curve["lyapunov_exponent"] = None
    curve["verdicts"] = []
    proof.write_text(json.dumps(data), encoding="utf-8")
    capsys.readouterr()
    assert main(["prove", "--check", str(proof)]) == CHECK_FAILED
    assert "a lower bound needs λ < 0" in " ".join(capsys.readouterr().err.split())
    curve["excursions"][0]["factor"] = math.nan
    proof.write_text(json.dumps(data), encoding="utf-8")
    assert main(["prove", "--check", str(proof)]) == BAD_INPUT
