"""Certificates of this program, and mutations of them, before its own checker and one that shares nothing with it.

That the independent checker asks for what the theorem asks for is tested by evaluations from the definitions.
"""

import copy
import functools
import json
import math
import os
from fractions import Fraction
from itertools import islice

import mpmath
import numpy as np
import pytest

import fpsolve
from fpsolve import prove
from fpsolve.arrays import identity
from fpsolve.model import CoefficientMatrix, Jump
from fpsolve.proofs import prove_lyapunov_exponent
from fpsolve.proofs.balls import precision
from fpsolve.proofs.claims import Bound
from fpsolve.proofs.search import Galerkin, bases, certificate_of
from fpsolve.proofs.statement import Statement, cylinder
from tests.conftest import sampled
from tests.oracles import certificate_checker as checker
from tests.oracles import certificate_condition as condition
from tests.oracles import certificate_statement as statement
from tests.proofs.by_definition import EXACT, PLAIN, REACHED, applied, bounded, gaussian, trial
from tests.proofs.mutations import mutations, violated

CORE = {"kind": "core", "centre": 0.0, "scale": 1.0, "gauge": 0.0}
WEAK = {"omega": 1.0, "restitution": 0.8, "c1": 0.1, "epsilon": 0.1}
MIDDLE = {"omega": 1.3, "restitution": 0.75, "c1": -0.1, "epsilon": 0.5, "impact": "restitution"}
PROOFS = {
    "plain Gaussian noise": (WEAK, (1.7, 0.9), "", -1.0, 1e-9),
    "ends that are reached": (WEAK, (1.0, 0.5, -1.0), "exact", 2.0, 1e-8),
    "path": (WEAK, (1.0, 0.5, 0.95), "reduced", None, 1e-7),
    "core of Gaussian noise": (WEAK, (1.0, 0.5, 0.95), "reduced", 2.0, 1e-9),
    "core of bounded noise": (WEAK, (1.0, 0.5, 0.95), "exact", -1.0, 1e-8),
    "whole support": (MIDDLE, (0.4, 0.6, 0.7), "exact", 1.5, 1e-6),
    "path, bounded noise": (MIDDLE, (0.4, 0.6, 0.7), "exact", None, 1e-5),
}
STEP = 1 if "FPSOLVE_ALL_MUTATIONS" in os.environ else 16
"""Of the slow tests through all mutations of a proof."""
SAMPLES = sampled(("path", min(9, STEP)), *((name, STEP) for name in PROOFS if name != "path"))


def problem_of(stated):
    """A problem from what a certificate states."""
    noise = stated["noise"]
    sigma = noise["unit"] * math.sqrt(noise["nu"])
    if noise["kind"] == "gaussian":
        made = fpsolve.OrnsteinUhlenbeck(noise["nu"] / 2, sigma)
    else:
        share = 1 / noise["slope"]
        tau = share / noise["nu"]
        made = fpsolve.NonGaussianNoise((sigma * tau) ** 2 / 2, tau, 1 - share)
    terms = CoefficientMatrix(0, stated["still"]), CoefficientMatrix(1, stated["driven"], identity)
    jumps = [Jump(math.pi / 2, jump["log_factor"]) for jump in stated["jumps"]]
    return fpsolve.Problem(fpsolve.PlaneSystem(terms, jumps), made)


def truth(stated, p):
    """Λ(p), or λ, by finite elements."""
    problem = problem_of(stated)
    if p is None:
        return fpsolve.lyapunov_exponent(problem, rtol=1e-10).value
    return float(fpsolve.moment_lyapunov(problem, [p], rtol=1e-10).value[0])


@functools.cache
def proven(name):
    """A proof as an entry of proof.json."""
    motion, numbers, treatment, p, width = PROOFS[name]
    noise = fpsolve.NonGaussianNoise(*numbers) if treatment else fpsolve.OrnsteinUhlenbeck(*numbers)
    noise = noise.ou_reduction() if treatment == "reduced" else noise
    problem = fpsolve.Problem(fpsolve.VibroImpactOscillator(**motion), noise)
    found = prove_lyapunov_exponent(problem, width=width) if p is None else prove(problem, p, width=width)
    assert found.is_met
    certificate = found.certificate.model_dump(mode="json")
    return json.dumps({"p": p, "lower": found.lower, "upper": found.upper, "certificate": certificate})


def objections(entry):
    """What fpsolve's own check says of an entry."""
    return list(Bound(**entry).objections())


def entry_of(name):
    """The same as a table of floats."""
    return json.loads(proven(name))


@pytest.fixture(scope="module", params=sampled("plain Gaussian noise", "path", "core of Gaussian noise", keep=2))
def entry(request):
    return entry_of(request.param)


@pytest.fixture(scope="module")
def plain():
    return entry_of("plain Gaussian noise")


@pytest.mark.parametrize("name", sampled(*PROOFS, keep=3))
def test_both_checkers_take_a_proof(name):
    entry = checker.read(proven(name))
    assert not objections(entry)
    assert checker.check(entry) == ""
    assert not violated(entry["certificate"])
    value = truth(entry["certificate"]["stated"], entry["p"])
    assert Fraction(entry["lower"]) < Fraction(value) < Fraction(entry["upper"])


@pytest.mark.slow
@pytest.mark.parametrize(("name", "step"), SAMPLES)
def test_both_checkers_refuse_mutations_that_do_not_follow(name, step):
    """All whose claim cannot follow, and these are most; or a sample of them."""
    changed = list(islice(mutations(checker.read(proven(name)), truth), 0, None, step))
    broken = [each for each in changed if not each.may_follow()]
    assert len(broken) > 0.6 * len(changed)
    assert [each.change for each in broken if not objections(each.entry)] == []
    assert [each.change for each in broken if checker.check(each.entry) == ""] == []


@pytest.mark.parametrize("p", sampled(2.0, -1.0))
def test_w_levels_a_rough_trial_function(p, rng):
    """Few harmonics and degrees: |Lu/u − μ| is far greater than either δ; and neither W serves the other bound."""
    with precision():
        stated = Statement(**PLAIN)
        noise = cylinder(stated)
        basis = next(bases(noise, p))
        pair = Galerkin(noise, basis, p, 2, 3).pair(truth(PLAIN, p))
        rough = certificate_of(stated, noise, basis, p, pair)
    certificate = rough.model_dump(mode="json")
    entry = {"p": p, "lower": -1, "upper": 1, "certificate": certificate}
    assert checker.check(entry) == ""
    points = zip(rng.uniform(0, math.pi, 60), rng.uniform(-4, 4, 60), strict=True)
    worst = max(abs(applied(certificate, phi, z) / trial(certificate, phi, z)) for phi, z in points)
    for name, other in (("upper", "lower"), ("lower", "upper")):
        side = certificate[name]
        assert side["delta"] < 0.5 * worst
        reason = checker.check(altered(entry, {other: side | {"delta": certificate[other]["delta"]}}))
        assert reason.startswith(f"The {other} ")


def psi(side, z, sign):
    """qψ about z, zero there, from W in its cell."""
    nodes, values = np.array(side["nodes"]), np.array(side["values"])
    j = int(np.searchsorted(nodes, z)) - 1
    slope = (mpmath.mpf(values[j + 1]) - values[j]) / (mpmath.mpf(nodes[j + 1]) - nodes[j])
    w = values[j] + slope * (z - nodes[j])
    return lambda y: sign * (w * (y - z) + slope * (y - z) ** 2 / 2)


@pytest.mark.parametrize("of", sampled("path", "plain Gaussian noise"))
@pytest.mark.parametrize(("name", "sign"), [("upper", 1), ("lower", -1)])
def test_what_a_proof_says_of_the_generator(of, name, sign, rng):
    """LT ≤ (μ + δ)T or LT ≥ (μ − δ)T at random points of the core and of both tails, by derivatives of T itself."""
    certificate = entry_of(of)["certificate"]
    side, p = certificate[name], certificate["p"]
    nodes = side["nodes"]
    beyond = [nodes[-1] + 1e-9, nodes[-1] + 3, nodes[-1] + 30, nodes[0] - 0.1, nodes[0] - 5]
    for z in (*rng.uniform(nodes[0], nodes[-1], size=6), *beyond):
        phi, z = mpmath.mpf(rng.uniform(0, math.pi)), mpmath.mpf(z)
        end = min(max(z, mpmath.mpf(nodes[0])), mpmath.mpf(nodes[-1]))
        kappa = mpmath.mpf(side["tails"][int(z > 0)])
        extra = psi(side, z, sign) if z == end else lambda y, z=z, s=sign * kappa: s * (y - z)

        def held(c, x, y, z=z, end=end):
            return trial(c, x, y if z == end else end)

        with mpmath.workdps(40):
            value = applied(certificate, phi, z, held, extra)
            value /= held(certificate, phi, z) if p is not None else 1
        assert sign * value <= side["delta"]


@pytest.mark.parametrize("stated", [PLAIN, EXACT, REACHED])
@pytest.mark.parametrize(("toward", "end"), sampled((1, 0.6), (-1, 0.5), (-1, -0.6), (1, -0.5), keep=2))
@pytest.mark.parametrize(("sign", "kappa"), [(1, 1.2), (-1, 1.2), (1, -0.3)])
def test_tails_of_any_sign(stated, toward, end, sign, kappa, rng):
    """A tail may begin beyond the middle of the noise, and be flatter than u: the least δ taken bounds it all."""
    certificate = {
        **{"p": 0.5, "stated": stated, "mu": 0.3},
        "basis": CORE | {"scale": 0.5, "gauge": 0.7 * toward},
        "cosine": [[1.0, 0.02], [0.01, 0.01]],
        "sine": [[0.0, 0.0], [0.03, -0.01]],
    }
    model = statement.model_of(certificate)
    found, kappa, low, high = statement.read_trial(model, certificate), kappa * toward, 0.0, 50.0
    nodes, ones = np.sort([end, end - 0.1 * toward]), np.ones(2)

    def taken(delta):
        side = statement.Side("upper", sign, delta, nodes, 2.0 * toward * ones, kappa * ones)
        try:
            checker._check_tail(model, found, side, toward)
        except statement.Refused:
            return False
        return True

    assert taken(high)
    while high - low > 1e-3 and high > 1e-6:
        low, high = (low, (low + high) / 2) if taken((low + high) / 2) else ((low + high) / 2, high)
    far = 1 if stated is not PLAIN else 20
    for z in end + (toward * far - end) * np.array([1e-12, 0.02, 0.1, 0.4, 0.7, 0.95]):
        for phi in rng.uniform(0, math.pi, size=3):
            value = applied(
                certificate,
                mpmath.mpf(phi),
                mpmath.mpf(z),
                lambda c, x, y: trial(c, x, mpmath.mpf(end)),
                lambda y, z=z: sign * kappa * (y - z),
            )
            assert sign * value / trial(certificate, mpmath.mpf(phi), mpmath.mpf(end)) <= high


@pytest.mark.parametrize(("toward", "sign"), [(1, 1), (1, -1), (-1, 1), (-1, -1)])
def test_the_slope_at_an_end_of_the_core(toward, sign):
    """q times the slope of ln T falls there: W may jump to κ by the least, over the phase, of q u_z/u and no more."""
    certificate = {
        **{"p": 0.5, "stated": PLAIN, "mu": 0.0},
        "basis": CORE,
        **{"cosine": [[1.0, 0.02], [0.0, 0.01]], "sine": [[0.0, 0.0], [0.0, 0.01]]},
    }
    model, end = statement.model_of(certificate), 0.5 * toward
    found, nodes = statement.read_trial(model, certificate), np.sort([end, 0.0])
    phi = np.linspace(0, np.pi, 5000)
    wave = 0.02 + 0.01 * (np.cos(2 * phi) + np.sin(2 * phi))
    kappa = toward * (1 + np.min(sign * toward * wave / (1 + end * wave)))
    for flatter, reason in ((1 - 1e-5, ""), (1 + 1e-5, "jumps")):
        side = statement.Side("upper", sign, 9.0, nodes, np.full(2, 1.0 * toward), np.full(2, kappa * flatter))
        if reason:
            with pytest.raises(statement.Refused, match=reason):
                checker._check_tail(model, found, side, toward)
        else:
            checker._check_tail(model, found, side, toward)


def at_rest(stated):
    """The same without what ε multiplies."""
    wall = {"ray": [0.0, -1.0], "log_factor": 0.0}
    return stated | {"still": [[0.0, 1.3], [-1.3, 0.0]], "driven": [[0.0, 0.0], [0.0, 0.0]], "jumps": [wall]}


def constant(stated, kind):
    """Λ(p) = 0 of an oscillator without damping, noise and loss, ε = 0, with u = 1 and W next to 0."""
    whole = kind == "whole"
    certificate = {
        **{"p": 1.5, "mu": 0.0, "phases": 8},
        "basis": {"kind": "whole"} if whole else CORE,
        "stated": at_rest(stated),
        **{"cosine": [[1.0, 0.0]], "sine": [[0.0, 0.0]]},
    }
    for name in ("upper", "lower"):
        certificate[name] = {
            "delta": 1e-12,
            "nodes": [-1.0, 0.25, 1.0] if whole else [-0.5, 0.75],
            "values": [0.0, 0.0, 0.0] if whole else [-1e-59, 1e-59],
            "tails": None if whole else [-1e-60, 1e-60],
        }
    return {"p": 1.5, "lower": -1e-9, "upper": 1e-9, "certificate": certificate}


CONSTANTS = [(PLAIN, "core"), (EXACT, "core"), (EXACT, "whole"), (REACHED, "whole"), (REACHED, "core")]


@pytest.mark.parametrize(("stated", "kind"), CONSTANTS)
def test_a_system_at_rest(stated, kind):
    """Λ = 0; and nothing else."""
    entry = constant(stated, kind)
    assert checker.check(entry) == ""
    for mu, name in ((1e-10, "lower"), (-1e-10, "upper")):
        reason = checker.check(altered(entry, {"mu": mu}))
        assert reason.startswith(f"The {name}")
        assert "fails" in reason


def test_the_moment_of_order_zero(entry):
    """Λ(0) = 0 needs no trial function."""
    zero = {"p": 0.0, "mu": 1e-9, "upper": {"delta": 0.0}, "lower": {"delta": 1e-9}, "cosine": []}
    new = altered(entry, zero) | {"p": 0.0, "lower": 0, "upper": 1.1e-9}
    assert checker.check(new) == ""
    assert "order 0" in checker.check(altered(new, {"mu": 1.1e-9}))
    assert "order 0" in checker.check(altered(new, {"mu": -1e-11}) | {"lower": -2e-9})


@pytest.mark.parametrize("name", ["upper", "lower"])
def test_a_positive_slope_needs_room(name):
    """W = 1e-12 z about the middle: ½W′ ≤ δ/ν there, and not a little more."""
    entry, nu = constant(EXACT, "whole"), 0.3 / 0.6
    side = entry["certificate"][name]
    side["nodes"], side["values"] = [-1.0, 0.0, 1.0], [-1e-12, 0.0, 1e-12]
    side["delta"] = 0.501e-12 * nu
    assert checker.check(entry) == ""
    side["delta"] = 0.499e-12 * nu
    assert f"{name} condition fails between z = -1 and 0" in checker.check(entry)
    side["delta"], side["values"] = 1e-10, [1e-12, 0.0, 1e-12]
    assert "pushes out" in checker.check(entry)


@pytest.mark.parametrize(("name", "sign"), [("upper", 1), ("lower", -1)])
def test_the_square_of_w(name, sign):
    """W = W₀ all over counts −½qW² and bW against it at z = 0: δ = ½νW₀² for the upper bound, −δ for the lower."""
    w, nu = 0.5, 0.3 / 0.6
    certificate = {
        **{"p": 1.5, "mu": 0.0, "stated": at_rest(EXACT)},
        "basis": CORE,
        **{"cosine": [[1.0, 0.0]], "sine": [[0.0, 0.0]]},
    }
    model = statement.model_of(certificate)
    found = statement.read_trial(model, certificate)
    for slack in (-1e-6, 1e-6):
        delta = sign * nu * w**2 / 2 + slack
        side = statement.Side(name, sign, delta, np.array([0.0, 1e-9]), np.array([w, w]), np.zeros(2))
        if slack > 0:
            condition.check(model, found, side, 16)
        else:
            with pytest.raises(statement.Refused, match="fails"):
                condition.check(model, found, side, 16)


def altered(entry, changes):
    """An entry with other members of its certificate, of a side of it ("upper.delta") or of what it states."""
    new = copy.deepcopy(entry)
    for name, value in changes.items():
        head, _, tail = name.partition(".")
        certificate = new["certificate"]
        if head in ("upper", "lower") and tail:
            certificate[head][tail] = value(certificate[head][tail]) if callable(value) else value
        else:
            (certificate["stated"] if tail else certificate)[tail or name] = value
    return new


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"stated.noise": {"kind": "else", "unit": 1.0, "nu": 1.0, "slope": 1.0, "states": [], "rates": []}}, "called"),
        ({"stated.noise": bounded(0.4, 0.6, 0.7) | {"slope": 0.0}}, "rate of the noise"),
        ({"stated.noise": gaussian(1.7, 0.9) | {"nu": 1e300}}, "range"),
        ({"stated.noise": gaussian(1.7, 0.9) | {"unit": -1.0}}, "negative"),
        ({"stated.noise": gaussian(1.7, 0.9) | {"states": [0.0]}}, "states"),
        ({"mu": math.nan}, "finite"),
        ({"upper.delta": -1e-9}, "delta"),
        ({"lower.delta": -1e-9}, "delta"),
        ({"lower": None}, "read"),
        ({"mu": "0.1"}, "number"),
        ({"p": 2.5}, "another p"),
        ({"stated.driven": [[0.0, 0.1], [0.0, 0.1]]}, "one way"),
        ({"basis": {"kind": "whole"}}, "bounded noise"),
        ({"upper.tails": None}, "tails"),
        ({"lower.tails": [1.0]}, "tails"),
        ({"basis": {"kind": "core"}}, "read"),
        ({"basis": CORE | {"scale": 0.0}}, "scale"),
        ({"upper.tails": lambda old: [0.3, old[1]]}, "flatter"),
        ({"lower.tails": lambda old: [0.3, old[1]]}, "lower tail beyond -7.48704 is flatter"),
        ({"upper.tails": [-0.3, 0.7]}, "jumps"),
        ({"lower.tails": [-0.3, 1e-9]}, "too slowly"),
        ({"upper.nodes": [0.0, 0.0], "upper.values": [0.0, 0.0]}, "rise"),
        ({"lower.nodes": [0.0, 1.0], "lower.values": [0.0]}, "match"),
        ({"cosine": [[-1.0, 0.0]], "sine": [[0.0, 0.0]]}, "positive"),
        ({"cosine": [[1.0, 0.0]], "sine": [[0.0]]}, "read"),
    ],
)
def test_reasons(changes, reason, plain):
    assert reason in checker.check(altered(plain, changes))


def test_gauge_needs_a_moment_and_steep_tails(plain):
    gauge = CORE | {"gauge": 0.5}
    assert "gauge" in checker.check(altered(entry_of("path"), {"basis": gauge}))
    assert "flatter" in checker.check(altered(plain, {"basis": gauge}))


def test_a_claim_is_compared_exactly(entry):
    """Not with what floats make of mu − delta."""
    certificate = entry["certificate"]
    exact = Fraction(certificate["mu"]) - Fraction(certificate["lower"]["delta"])
    near = float(exact)
    below, above = (near, math.nextafter(near, 1)) if near <= exact else (math.nextafter(near, -1), near)
    assert checker.check({**entry, "lower": below}) == ""
    assert "lower" in checker.check({**entry, "lower": above})
