"""Proofs of this program, and mutations of them, before its own checker and before one that shares nothing with it."""

import functools
import json
from decimal import Decimal
from fractions import Fraction

import pytest

import fpsolve
from fpsolve.proofs import prove, prove_lyapunov_exponent
from fpsolve.proofs.claims import Bound
from tests.conftest import sampled
from tests.oracles import certificate_checker
from tests.proofs.mutations import mutations

WEAK = {"omega": 1.0, "restitution": 0.8, "c1": 0.1, "epsilon": 0.1}
MIDDLE = {"omega": 1.3, "restitution": 0.75, "c1": -0.1, "epsilon": 0.5, "impact": "restitution"}
PROOFS = {
    "core of Gaussian noise": (WEAK, (1.0, 0.5, 0.95), "reduced", 2.0, 1e-9),
    "core of bounded noise": (WEAK, (1.0, 0.5, 0.95), "exact", -1.0, 1e-8),
    "whole support": (MIDDLE, (0.4, 0.6, 0.7), "exact", 1.5, 1e-6),
    "ends that are reached": (WEAK, (1.0, 0.5, -1.0), "exact", 2.0, 1e-8),
    "path": (WEAK, (1.0, 0.5, 0.95), "reduced", None, 1e-7),
    "path, bounded noise": (MIDDLE, (0.4, 0.6, 0.7), "exact", None, 1e-5),
}


def problem_of(parameters):
    """A problem from the decimals of a certificate."""
    words = {name.partition(".")[2]: value for name, value in parameters.items()}
    oscillator = fpsolve.VibroImpactOscillator(
        **{name: float(words[name]) for name in ("omega", "restitution", "c1", "epsilon")}, impact=words["impact"]
    )
    if "alpha" in words:
        noise = fpsolve.OrnsteinUhlenbeck(float(words["alpha"]), float(words["sigma"]))
    else:
        noise = fpsolve.NonGaussianNoise(*(float(words[name]) for name in ("D0", "tau0", "r0")))
    return fpsolve.Problem(oscillator, noise)


def truth(parameters, p):
    """Λ(p), or λ, by finite elements."""
    problem = problem_of(parameters)
    if p is None:
        return fpsolve.lyapunov_exponent(problem, rtol=1e-11).value
    return float(fpsolve.moment_lyapunov(problem, [float(p)], rtol=1e-11).value[0])


@functools.cache
def proven(name):
    """A proof as an entry of proof.json."""
    motion, numbers, treatment, p, width = PROOFS[name]
    noise = fpsolve.NonGaussianNoise(*numbers)
    problem = fpsolve.VibroImpactOscillator(**motion), noise.ou_reduction() if treatment == "reduced" else noise
    found = prove_lyapunov_exponent(*problem, width=width) if p is None else prove(*problem, p, width=width)
    assert found.is_met
    certificate = found.certificate.model_dump(mode="json")
    return json.dumps({"p": p, "lower": found.lower, "upper": found.upper, "certificate": certificate})


def objections(entry):
    """What fpsolve's own check says of an entry."""
    certificate = json.loads(json.dumps(entry["certificate"], default=float))
    bound = Bound.model_validate(
        {"lower": Decimal(entry["lower"]), "upper": Decimal(entry["upper"]), "certificate": certificate}
    )
    parameters = {
        name: value if name.endswith(("impact", "treatment")) else Decimal(value)
        for name, value in certificate["parameters"].items()
    }
    p = None if entry["p"] is None else Decimal(entry["p"])
    return list(bound.objections(certificate["quantity"], p, parameters))


@pytest.mark.parametrize("name", PROOFS)
def test_both_checkers_take_a_proof(name):
    entry = certificate_checker.read(proven(name))
    assert not objections(entry)
    assert certificate_checker.check(entry) == ""
    value = truth(entry["certificate"]["parameters"], entry["p"])
    assert Fraction(entry["lower"]) < Fraction(value) < Fraction(entry["upper"])


@pytest.mark.parametrize(
    ("name", "every"),
    sampled(("core of Gaussian noise", 5), ("whole support", 5), *((name, 1) for name in PROOFS), keep=2),
)
def test_both_checkers_refuse_mutations_that_do_not_follow(name, every):
    changed = list(mutations(certificate_checker.read(proven(name)), truth))[::every]
    broken = [each for each in changed if not each.may_follow]
    assert len(broken) > 0.6 * len(changed)
    assert [each.change for each in broken if not objections(each.entry)] == []
    assert [each.change for each in broken if certificate_checker.check(each.entry) == ""] == []
