"""Proofs of cases whose systems are matrices or equations: what files state, and that it is checked as one."""

import json

import pytest

from fpsolve.cli import main
from fpsolve.proofs.claims import claims_from
from fpsolve.workflow.prove import check_proof, prove_case
from tests.kit import case_in, read_json
from tests.oracles import certificate_checker as checker

EQUATIONS = """
[system]
variables = ["x", "v"]
drift = ["v", "-omega**2 * x - 2*zeta*omega * v - load * x"]
parameters = { omega = 1.0, zeta = 0.05 }
noises = { load = "noise.axial" }
walls = [{ at = "x = 0", restitution = 0.8 }]
[noise.axial]
kind = "NOISE"
[moments]
p = [0.0, 2.0]
[output]
quantities = ["moment", "lyapunov_exponent"]
"""
TELEGRAPH = EQUATIONS.replace("NOISE", 'telegraph"\na = 0.5\nk = 1.0 #')
CHAIN = EQUATIONS.replace("NOISE", 'markov-chain"\nstates = [-0.5, 0.5]\nrates = [[0.0, 1.0], [1.0, 0.0]] #')
GAUSSIAN = EQUATIONS.replace("NOISE", 'ornstein-uhlenbeck"\nalpha = 1.0\nstandard_deviation = 0.1 #')


def proof_of(text, folder):
    """What proof.json holds, and where it is."""
    prove_case(case_in(folder, f'title = "beam"\n{text}', name="beam"), folder, width=1e-3)
    return read_json(folder / "beam/proof.json"), folder / "beam/proof.json"


@pytest.mark.parametrize(
    "text", [TELEGRAPH, CHAIN, pytest.param(GAUSSIAN, marks=pytest.mark.slow)], ids=["telegraph", "chain", "Gaussian"]
)
def test_equations(text, tmp_path):
    """Λ(2), λ and Λ(0) = 0, which both checkers accept."""
    data, path = proof_of(text, tmp_path)
    (curve,) = data["curves"]
    assert curve["parameters"]["system.zeta"] == 0.05
    assert curve["verdicts"] == ["almost every path decays", "the moment of order 2 decays"]
    assert check_proof(path).objections == ()
    entries = [*curve["moments"], {**curve["lyapunov_exponent"], "p": None}]
    assert [checker.check(checker.read(json.dumps(entry))) for entry in entries] == 3 * [""]


def test_certificates_of_a_curve_are_of_one_system(tmp_path):
    """A curve has one."""
    data, _ = proof_of(CHAIN, tmp_path)
    (curve,) = data["curves"]
    other = json.loads(json.dumps(data).replace("-0.1]", "-0.2]"))["curves"][0]
    curve["moments"][0] = other["moments"][0]
    assert list(claims_from(json.dumps(data)).objections()) == ["curves.0.its certificates are of several systems"]


def test_the_check_says_that_parameters_are_labels(tmp_path, capsys):
    """Another ω changes no bound, as certificates state matrices."""
    data, path = proof_of(TELEGRAPH, tmp_path)
    path.write_text(json.dumps(data).replace('"system.omega": 1.0', '"system.omega": 2.0'), encoding="utf-8")
    capsys.readouterr()
    assert main(["prove", "--check", str(path)]) == 0
    said = capsys.readouterr().out
    assert "accepted: " in said
    assert "note: parameters are labels; the bounds are of the matrices and rates" in said
