"""Certificates of systems by their matrices, under each noise, before this program's checker and another one."""

import copy
import functools
import json
import math
from itertools import islice

import numpy as np
import pytest

import fpsolve
from fpsolve import Problem, prove
from fpsolve.model import (
    Jump,
    MarkovChain,
    ParametricOscillator,
    SineWiener,
    Telegraph,
    White,
)
from fpsolve.proofs import prove_lyapunov_exponent
from fpsolve.proofs.claims import Bound
from tests.conftest import sampled
from tests.oracles import certificate_checker as checker
from tests.oracles.certificate_statement import Refused, model_of
from tests.proofs import mutations
from tests.proofs.test_systems import SADDLE, driven_velocity, spring, wall

CHAIN = MarkovChain((-0.4, 0.1, 0.5), ((0, 1.0, 0.5), (0.3, 0, 0.7), (0.2, 0.9, 0)))
OSCILLATOR = fpsolve.VibroImpactOscillator(1.2, 0.8, 0.1, 0.4, impact="restitution")
PROOFS = {
    "chain with a wall": (spring(0.05, 1.5, wall(0.85)), CHAIN, 1.5, 1e-7),
    "white with a wall": (driven_velocity(wall(0.8)), White(0.5, interpretation="ito"), -1.0, 1e-6),
    "paths, circle": (spring(0.1, 2.0), SineWiener(0.3, 1.0), None, 1e-6),
    "paths, white": (SADDLE, White(1.0), None, 1e-6),
    "paths, chain": (spring(0.05, 1.5, wall(0.85)), CHAIN, None, 1e-6),
    "circle with two rays": (driven_velocity(wall(0.8), Jump(0.0, 0.1)), SineWiener(0.3, 1.0), -1.0, 1e-6),
    "parametric": (ParametricOscillator(1.0, 0.1, 0.8), White(0.5), 3.0, 1e-7),
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
    try:
        return not list(Bound(**entry).objections())
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
    if certificate["p"] is not None:
        if (u <= 0).any():
            return True
        mismatch = mismatch / u
    above, below = (certificate[name]["delta"] for name in ("upper", "lower"))
    return bool(mismatch.max() > 1.001 * above + 1e-13 or -mismatch.min() > 1.001 * below + 1e-13)


def matrices(stated):
    """A₀ and A₁ in the coordinates in which a certificate speaks, in floats."""
    change = np.array(stated["coordinates"])
    return (np.linalg.inv(change) @ np.array(stated[name]) @ change for name in ("still", "driven"))


def sampled_plainly(certificate):
    """u and Lu − μu, or 1 and what is left of the drift, at points, from the motion in x."""
    stated, kappa = certificate["stated"], float(model_of(certificate).kappa.a)
    (still, driven), noise, p = matrices(stated), stated["noise"], certificate["p"]
    cosine, sine = np.array(certificate["cosine"]), np.array(certificate["sine"])
    phi = np.linspace(0, math.pi, 1000, endpoint=False)
    kind = certificate["basis"]["kind"]
    theta = np.linspace(0, math.pi, 99)
    if kind == "circle":
        table = np.cos(np.outer(np.arange(cosine.shape[1]), theta))
        xi = noise["unit"] * np.cos(theta)
    else:
        table, xi, rates = np.eye(cosine.shape[1]), np.array(noise["states"]), np.array(noise["rates"])
        rates = rates - np.diag(rates.sum(axis=1))

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
        squares = 0.5 * noise["nu"] * np.arange(cosine.shape[1]) ** 2
        value = value + (pushed @ table) * xi - (u(phi) * squares) @ table
    elif noise["kind"] == "white":
        h, q = polar(driven, phi)
        waves = np.fft.fftfreq(len(phi), 1 / len(phi))[:, None]
        slope = np.fft.ifft(2j * waves * np.fft.fft(pushed, axis=0), axis=0).real
        again = h * slope + (0 if p is None else p * (kappa * h + q) * pushed)
        value = value + 0.5 * noise["unit"] ** 2 * again
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
        return x * 1.01

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
        new["p"] = new["certificate"]["p"] = 1.01 * entry["p"]
        yield "p", new
    stated = certificate["stated"]
    for name in ("still", "driven"):
        for j, k in np.ndindex(2, 2):
            if stated[name][j][k]:
                yield changed("stated", name, j, k, by=larger)
    for i in range(len(stated["jumps"])):
        yield changed("stated", "jumps", i, "log_factor", by=larger)
    yield changed("stated", "jumps", by=lambda jumps: [*jumps, {"ray": [0.3, 1.0], "log_factor": 0.01}])
    yield changed("stated", "coordinates", 1, 1, by=larger)
    if stated["noise"]["kind"] == "chain":
        yield changed("stated", "noise", "states", 0, by=larger)
        yield changed("stated", "noise", "rates", 0, 1, by=larger)
    for name in ("unit", "nu"):
        if stated["noise"]["kind"] != "chain" and stated["noise"][name]:
            yield changed("stated", "noise", name, by=larger)


@pytest.mark.slow
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
        assert checker.check(entry) != "", change


@pytest.mark.parametrize(
    ("name", "change", "reason"),
    [
        ("chain with a wall", {"noise": {"rates": [[0.0, -1.0, 1.0]] * 3}}, "negative"),
        ("chain with a wall", {"noise": {"rates": [[0.0, 1.0]] * 3}}, "shape"),
        ("chain with a wall", {"": {"jumps": [AHEAD]}, "noise": {"states": [-9.0, 0.1, 0.5]}}, "one way"),
        ("chain with a wall", {"": {"coordinates": [[1.0, 1.0], [1.0, 1.0]]}}, "inverse"),
        ("chain with a wall", {"": {"jumps": [{"ray": [0.0, 0.0], "log_factor": 0.0}]}}, "direction"),
        ("white with a wall", {"": {"jumps": [{"ray": [1.0, -1.0], "log_factor": 0.1}]}}, "one way"),
        ("paths, circle", {"": {"jumps": [AHEAD]}, "noise": {"unit": 3.0}}, "one way"),
        ("paths, circle", {"basis": {"kind": "states"}}, "basis"),
        ("paths, circle", {"basis": {"kind": "core"}}, "basis"),
        ("paths, circle", {"upper": {"nodes": [0.0, 1.0], "values": [0.0, 0.0]}}, "no W"),
    ],
)
def test_statements_that_make_no_sense(name, change, reason):
    entry = entry_of(name)
    certificate = entry["certificate"]
    for part, values in change.items():
        inner = certificate if part in certificate else certificate["stated"]
        (inner[part] if part else inner).update(values)
    assert not is_taken(entry)
    assert reason in checker.check(entry)
