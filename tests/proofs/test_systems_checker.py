"""Certificates of systems by their matrices, under each noise, before this program's checker and another one."""

import copy
import functools
import json
import math
from decimal import Decimal
from itertools import islice

import numpy as np
import pytest

import fpsolve
from fpsolve import Problem, prove
from fpsolve.model import (
    Jump,
    MarkovChain,
    OrnsteinUhlenbeckByIntensity,
    ParametricOscillator,
    SineWiener,
    Telegraph,
    White,
)
from fpsolve.proofs import prove_lyapunov_exponent
from fpsolve.proofs.claims import Bound, MomentBound
from tests.conftest import sampled
from tests.oracles import certificate_checker as checker
from tests.oracles.certificate_statement import WORDS, Refused, model_of
from tests.proofs import mutations
from tests.proofs.test_systems import SADDLE, STIFFNESS, driven_velocity, spring, wall

CHAIN = MarkovChain((-0.4, 0.1, 0.5), ((0, 1.0, 0.5), (0.3, 0, 0.7), (0.2, 0.9, 0)))
OSCILLATOR = fpsolve.VibroImpactOscillator(1.2, 0.8, 0.1, 0.4, impact="restitution")
PROOFS = {
    "chain with a wall": (spring(0.05, 1.5, wall(0.85)), CHAIN, 1.5, 1e-7),
    "white with a wall": (driven_velocity(wall(0.8)), White(0.5, interpretation="ito"), -1.0, 1e-6),
    "paths, circle": (spring(0.1, 2.0), SineWiener(0.3, 1.0), None, 1e-6),
    "paths, white": (SADDLE, White(1.0), None, 1e-6),
    "paths, chain": (spring(0.05, 1.5, wall(0.85)), CHAIN, None, 1e-6),
    "circle with two rays": (driven_velocity(wall(0.8), Jump(0.0, 0.1)), SineWiener(0.3, 1.0), -1.0, 1e-6),
    "parametric, by its decimals": (ParametricOscillator(1.0, 0.1, 0.8), White(0.5), 3.0, 1e-7),
    "the paper's oscillator, telegraph": (OSCILLATOR, Telegraph(0.5, 1.0), 2.5, 1e-8),
    "Gaussian noise with a wall": (spring(0.1, 2.0, wall(0.8)), fpsolve.OrnsteinUhlenbeck(1.0, 0.2), 2.0, 1e-6),
    "paths, Gaussian noise": (spring(0.1, 2.0, wall(0.8)), fpsolve.OrnsteinUhlenbeck(1.0, 0.2), None, 1e-5),
    "bounded noise": (spring(0.1, 2.0, wall(1.1)), fpsolve.NonGaussianNoise(0.02, 0.6, 0.7), 1.0, 1e-6),
}
AHEAD = {"ray": [1.0, 0.0], "log_factor": 0.1}
QUICK = sampled(*list(PROOFS)[::2], keep=2)


@functools.cache
def proven(name):
    """A proof as an entry of proof.json."""
    system, noise, p, width = PROOFS[name]
    found = (
        prove_lyapunov_exponent(Problem(system, noise), width=width)
        if p is None
        else prove(Problem(system, noise), p, width=width)
    )
    assert found.is_met
    certificate = found.certificate.model_dump(mode="json")
    return json.dumps({"p": p, "lower": found.lower, "upper": found.upper, "certificate": certificate})


def entry_of(name):
    return json.loads(proven(name))


def is_taken(entry):
    """Whether fpsolve's own check takes an entry; what cannot be read at all is refused, too."""
    certificate = entry["certificate"]
    parameters = {name: text if name in WORDS else Decimal(text) for name, text in certificate["parameters"].items()}
    bounds = {name: Decimal(repr(entry[name])) for name in ("lower", "upper")} | {"certificate": certificate}
    try:
        if entry["p"] is None:
            return not list(Bound(**bounds).objections(parameters))
        return not list(MomentBound(**bounds, p=Decimal(repr(entry["p"]))).objections(parameters))
    except ValueError:
        return False


@pytest.mark.parametrize("name", QUICK)
def test_both_checkers_take_a_proof(name):
    assert is_taken(entry_of(name))
    assert checker.check(checker.read(proven(name))) == ""
    assert not violated(entry_of(name)["certificate"])


def violated(certificate):
    """Whether a bound clearly fails at a sample."""
    try:
        if certificate["basis"]["kind"] in ("core", "whole"):
            return mutations.violated(certificate)
        u, mismatch = sampled_plainly(certificate)
    except Refused:
        return True
    if certificate["quantity"] == "moment":
        if (u <= 0).any():
            return True
        mismatch = mismatch / u
    above, below = (certificate[name]["delta"] for name in ("upper", "lower"))
    return bool(mismatch.max() > 1.001 * above + 1e-13 or -mismatch.min() > 1.001 * below + 1e-13)


def named(parameters):
    """Parameters by their keys, without the name of the noise."""
    return {f"{key.partition('.')[0]}.{key.rpartition('.')[2]}": value for key, value in parameters.items()}


def matrices(certificate):
    """A₀ and A₁ of a certificate in the coordinates in which it speaks, in floats, in the sense of Stratonovich."""
    stated, v = certificate.get("motion"), named(certificate["parameters"])
    if "system.stiffness" in v and stated is None:
        still = np.array([[0, 1], [-float(v["system.stiffness"]), -2 * float(v["system.damping"])]])
        driven = np.array(STIFFNESS)
    elif stated is None:
        omega, eps, c1 = (float(v[f"oscillator.{name}"]) for name in ("omega", "epsilon", "c1"))
        still, driven = np.array([[0, omega], [-omega, eps**2 * c1]]), np.array([[0, 0], [0, eps]])
    else:
        change, eps = np.array(stated["coordinates"]), stated["epsilon"]
        still, driven = (
            np.linalg.inv(change)
            @ sum(eps ** term["order"] * term[part] * np.array(term["matrix"]) for term in stated["terms"])
            @ change
            for part in ("offset", "slope")
        )
    if v.get("noise.interpretation") == "ito":
        still = still - float(v["noise.s"]) ** 2 * driven @ driven / 2
    return still, driven


def sampled_plainly(certificate):
    """u and Lu − μu, or 1 and what is left of the drift, at points, from the motion in x."""
    still, driven = matrices(certificate)
    v, kappa = named(certificate["parameters"]), float(model_of(certificate).kappa.a)
    p = None if certificate["p"] is None else float(certificate["p"])
    cosine, sine = np.array(certificate["cosine"]), np.array(certificate["sine"])
    phi = np.linspace(0, math.pi, 1000, endpoint=False)
    kind, stated = certificate["basis"]["kind"], certificate.get("chain")
    theta = np.linspace(0, math.pi, 99)
    if kind == "circle":
        table = np.cos(np.outer(np.arange(cosine.shape[1]), theta))
        xi = float(v["noise.amplitude"]) * np.cos(theta)
    else:
        table, xi = np.eye(cosine.shape[1]), np.zeros(1)
    if stated is not None:
        xi, rates = np.array(stated["states"]), np.array(stated["rates"])
    elif "noise.k" in v:
        xi, rates = float(v["noise.a"]) * np.array([-1, 1]), float(v["noise.k"]) * np.array([[-1, 1], [1, -1]])

    one = np.ones(len(table)) if kind == "states" else np.eye(len(table))[0]

    def u(x, order=0):
        """The derivative of an order by φ, with the coefficients of the functions of the noise."""
        turn, k = np.outer(x, 2 * np.arange(len(cosine))), 2 * np.arange(len(cosine))
        return (np.cos(turn + order * math.pi / 2) * k**order) @ cosine + (
            np.sin(turn + order * math.pi / 2) * k**order
        ) @ sine

    def polar(a, x):
        e, turned = np.array([np.cos(x), -np.sin(x)]), np.array([-np.sin(x), -np.cos(x)])
        return (turned * (a @ e)).sum(0)[:, None], (e * (a @ e)).sum(0)[:, None]

    def moved(a, x):
        """h(∂φ + pκ)u + p q u, or h(∂φ f + κ) + q."""
        h, q = polar(a, x)
        rest = one if p is None else p * u(x)
        return h * (u(x, 1) + kappa * rest) + q * rest

    value, pushed = moved(still, phi) @ table, moved(driven, phi)
    if kind == "circle":
        squares = 0.5 * float(v["noise.sigma"]) ** 2 * np.arange(cosine.shape[1]) ** 2
        value = value + (pushed @ table) * xi - (u(phi) * squares) @ table
    elif "noise.s" in v:
        h, q = polar(driven, phi)
        waves = np.fft.fftfreq(len(phi), 1 / len(phi))[:, None]
        slope = np.fft.ifft(2j * waves * np.fft.fft(pushed, axis=0), axis=0).real
        again = h * slope + (0 if p is None else p * (kappa * h + q) * pushed)
        value = value + 0.5 * float(v["noise.s"]) ** 2 * again
    else:
        value = value + pushed * xi + u(phi) @ rates.T
    mu = certificate["mu"]
    return u(phi) @ table, value - mu * (1.0 if p is None else u(phi) @ table)


def mutated(entry):
    """Entries with one number changed, of the statement or of the proof, and what was changed."""

    def changed(*places, by):
        new = copy.deepcopy(entry)
        *above, last = places
        target = new["certificate"]
        for place in above:
            target = target[place]
        target[last] = by(target[last])
        return f"{places} {target[last]}", new

    def larger(x):
        return str(Decimal(x) * Decimal("1.01")) if isinstance(x, str) else x * 1.01

    certificate = entry["certificate"]
    deltas = [certificate[name]["delta"] for name in ("upper", "lower")]
    for name in ("upper", "lower"):
        for factor in (0.0, 0.3):
            yield changed(name, "delta", by=lambda x, factor=factor: factor * x)
    for row in (0, 1, len(certificate["cosine"]) - 1):
        yield changed("cosine", row, 0, by=lambda x: x + 100 * sum(deltas) + 1e-12)
    yield changed("mu", by=lambda x: x + 1.5 * sum(deltas))
    if certificate["p"] is not None:
        new = copy.deepcopy(entry)
        new["p"], new["certificate"]["p"] = 1.01 * entry["p"], repr(1.01 * entry["p"])
        yield "p", new
    for key in certificate["parameters"]:
        if key not in WORDS and ("motion" not in certificate or not key.startswith("system.")):
            yield changed("parameters", key, by=larger)
    if "noise.interpretation" in certificate["parameters"]:
        other = {"ito": "stratonovich", "stratonovich": "ito"}
        yield changed("parameters", "noise.interpretation", by=other.get)
    if "motion" in certificate:
        motion = certificate["motion"]
        for i, term in enumerate(motion["terms"]):
            for j, k in np.ndindex(2, 2):
                if term["matrix"][j][k]:
                    yield changed("motion", "terms", i, "matrix", j, k, by=larger)
            yield changed("motion", "terms", i, "offset", by=lambda x: x + 0.01)
        for i in range(len(motion["jumps"])):
            yield changed("motion", "jumps", i, "log_factor", by=larger)
        yield changed("motion", "jumps", by=lambda jumps: [*jumps, {"ray": [0.3, 1.0], "log_factor": 0.01}])
        yield changed("motion", "coordinates", 1, 1, by=larger)
    if "chain" in certificate:
        yield changed("chain", "states", 0, by=larger)
        yield changed("chain", "rates", 0, 1, by=larger)


@pytest.mark.parametrize("name", QUICK)
def test_both_checkers_refuse_what_does_not_follow(name):
    """Nearly all mutations fail at some sample; and these are refused. Of lines of ξ, which take long, every third."""
    entry = entry_of(name)
    every = list(
        islice(mutated(entry), 0, None, 3 if entry["certificate"]["basis"]["kind"] in ("core", "whole") else 1)
    )
    broken = [(change, entry) for change, entry in every if violated(entry["certificate"])]
    assert len(broken) > 0.6 * len(every)
    for change, entry in broken:
        for key, sign in (("lower", -1), ("upper", 1)):  # claims no more than mu and delta
            entry[key] = entry["certificate"]["mu"] + sign * 1.1 * entry["certificate"][key]["delta"] + sign * 1e-12
        assert not is_taken(entry), change
        assert checker.check(json.loads(json.dumps(entry), parse_float=Decimal)) != "", change


@pytest.mark.parametrize(
    ("name", "change", "reason"),
    [
        ("chain with a wall", {"chain": {"numbers": "decimal"}}, "binary"),
        ("chain with a wall", {"chain": {"rates": [[0.0, -1.0, 1.0]] * 3}}, "negative"),
        ("chain with a wall", {"motion": {"jumps": [AHEAD]}, "chain": {"states": [-9.0, 0.1, 0.5]}}, "one way"),
        ("chain with a wall", {"motion": {"coordinates": [[1.0, 1.0], [1.0, 1.0]]}}, "inverse"),
        ("chain with a wall", {"motion": {"epsilon": 0.0}}, "positive"),
        ("chain with a wall", {"motion": {"jumps": [{"ray": [0.0, 0.0], "log_factor": 0.0}]}}, "direction"),
        ("white with a wall", {"motion": {"jumps": [{"ray": [1.0, -1.0], "log_factor": 0.1}]}}, "one way"),
        ("paths, circle", {"motion": {"jumps": [AHEAD]}, "parameters": {"noise.amplitude": "3"}}, "one way"),
        ("paths, circle", {"basis": {"kind": "states"}}, "basis"),
        ("paths, circle", {"basis": {"kind": "core"}}, "basis"),
        ("paths, circle", {"upper": {"nodes": [0.0, 1.0], "values": [0.0, 0.0]}}, "no W"),
    ],
)
def test_statements_that_make_no_sense(name, change, reason):
    entry = entry_of(name)
    for part, values in change.items():
        entry["certificate"][part].update(values)
    assert not is_taken(entry)
    assert reason in checker.check(entry)


@pytest.mark.slow
def test_gaussian_noise_by_its_intensity():
    """The parameters D₀ and τ₀ tell α = 1/τ₀ and the standard deviation √(D₀/τ₀)."""
    found = prove(Problem(spring(0.1, 2.0), OrnsteinUhlenbeckByIntensity(D0=0.005, tau0=0.5)), 2.0, width=1e-3)
    certificate = found.certificate.model_dump(mode="json")
    entry = {"p": 2.0, "lower": found.lower, "upper": found.upper, "certificate": certificate}
    assert is_taken(entry)
    assert checker.check(entry) == ""
    certificate["parameters"] |= {"noise.tau0": "0.7"}
    assert not is_taken(entry)
    assert checker.check(entry) != ""


@pytest.mark.parametrize(
    "labels",
    [
        {"system.stiffness": "1", "system.damping": "0.1", "system.restitution": "1"},
        {"system.epsilon": "1.0", "noise.a": "0.4", "noise.k": "1"},
        {"system.epsilon": "1.0", "noise.s": "0.4", "noise.interpretation": "ito"},
    ],
)
def test_labels_that_tell_another_system_or_noise(labels):
    """Beside matrices and rates; a reader would take the bounds for those of the parameters."""
    entry = entry_of("chain with a wall")
    entry["certificate"]["parameters"] = labels
    assert not is_taken(entry)
    assert "labels" in checker.check(entry)
    entry["certificate"]["parameters"] = labels | {"system.mass": "2.0", "noise.colour": "3.0"}
    assert is_taken(entry)
    assert checker.check(entry) == ""
