"""Proven bounds: close, around what is known otherwise, by certificates that two verifiers take, and no others."""

import copy
import functools
import json
import math
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from itertools import islice
from typing import Any

import numpy as np
import pytest

from fpsolve import (
    FpsolveError,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    moment_lyapunov,
    prove,
    stability_index,
)
from fpsolve.exponent import Budget
from fpsolve.model import (
    CoefficientMatrix,
    Jump,
    MarkovChain,
    ParametricOscillator,
    PlaneSystem,
    SineWiener,
    Telegraph,
    White,
)
from fpsolve.proofs import objection, prove_lyapunov_exponent, prove_stability_index
from tests.conftest import sampled
from tests.kit import chain_of_masses, itself, matrices
from tests.numbers.by_problem import by_moments
from tests.oracles import certificate_checker, closed_forms, kronecker, phase_circle
from tests.oracles.planar import series

STIFFNESS, VELOCITY, TURN = ((0.0, 0.0), (-1.0, 0.0)), ((0.0, 0.0), (0.0, 1.0)), ((0.0, -1.0), (1.0, 0.0))
SADDLE, SHEAR, NEGATIVE = ((1.0, 0.0), (0.0, -1.0)), ((-1.0, 0.0), (5.0, -1.0)), ((0.0, 1.0), (-1.0, 0.1))


def wall(factor: float) -> Jump:
    """x⁺ = R x⁻ at x = 0."""
    return Jump(math.pi / 2, math.log(factor))


def oscillating(b: float = 0.1, k: float = 1.0):
    return ((0.0, 1.0), (-k, -2 * b))


def spring(noise, b: float = 0.1, k: float = 1.0, factor: float = 1.0) -> Problem:
    """ẍ + 2bẋ + (k + ξ) x = 0, with a wall at x = 0."""
    return matrices(oscillating(b, k), STIFFNESS, noise, jumps=[wall(factor)] if factor != 1 else [])


def paper(
    noise, restitution: float = 0.8, c1: float = 0.1, epsilon: float = 0.1, omega: float = 1.0, **more
) -> Problem:
    """The oscillator of Eq. (3)."""
    return Problem(VibroImpactOscillator(omega, restitution, c1, epsilon, **more), noise)


def bounded(D0: float = 1.0, tau0: float = 0.5, r0: float = 0.95) -> NonGaussianNoise:
    return NonGaussianNoise(D0, tau0, r0)


def reduced(*args: float, **more: float):
    return bounded(*args, **more).ou_reduction()


def elements(problem: Problem, p: float | None) -> float:
    """Λ(p), or λ, by finite elements."""
    if p is None:
        return lyapunov_exponent(problem, rtol=1e-10).value
    return float(moment_lyapunov(problem, p, rtol=1e-10).value[0])


@dataclass(frozen=True)
class Proof:
    """Bounds of this width are asked for of Λ(p), or of λ, around a value that is known up to a doubt."""

    problem: Problem
    p: float | None
    value: Callable[[Problem, float | None], float]
    width: float = 1e-7
    doubt: float = 1e-11
    slow: bool = False


def white(drift, load, s: float, R: float = 1.0, sense: str = "stratonovich", modes: int = 40):
    """A function that finds Λ(p), or λ, by Fourier series of the phase."""
    made = phase_circle.white(drift, [s * np.array(load)], sense)
    return by_phase(made, modes, R)


def by_phase(made, modes: int = 40, R: float = 1.0):
    def value(_: Problem, p: float | None) -> float:
        if p is None:
            return phase_circle.lyapunov_exponent(made, modes, R)
        return phase_circle.moment_exponent(made, p, modes, R)

    return value


def known(value: float):
    return lambda *_: value


class Lopsided(Telegraph):
    """With other states."""

    @property
    def states(self):
        return 0.0, 3 * self.a


CHAIN = MarkovChain((-0.4, 0.1, 0.5), ((0, 1.0, 0.5), (0.3, 0, 0.7), (0.2, 0.9, 0)))
RATES = [[-1.5, 1.0, 0.5], [0.3, -1.0, 0.7], [0.2, 0.9, -1.1]]
FLIP, STATES = [[-1.0, 1.0], [1.0, -1.0]], (-0.5, 0.5)


def at(drift, states, load=STIFFNESS):
    return [np.array(drift) + xi * np.array(load) for xi in states]


STATES_OF_SPRING = at(oscillating(0.05), STATES)
ITO = White(s=0.5, interpretation="ito")
UNEVEN = PlaneSystem(
    [
        CoefficientMatrix(0, ((0.0, 1.0), (-1.69, 0.0))),
        CoefficientMatrix(1, VELOCITY, itself),
        CoefficientMatrix(2, ((0.0, 0.0), (0.0, 0.1))),
    ],
    [Jump(-math.pi / 2, math.log(1 - 0.2**2 * 0.2))],
    0.2,
)
"""The oscillator of Eq. (3) in (x, ẋ), where its phase is uneven."""


def even(problem: Problem, p: float) -> float:
    """Of `UNEVEN`, in (x, ẋ/ω)."""
    return series(paper(problem.noise, 0.8, 0.1, 0.2, 1.3, impact="restitution"), p)


VOLTS = White(s=0.5)
GAUSS, SINE = OrnsteinUhlenbeck(1.0, 0.2), SineWiener(0.3, 1.0)
PROOFS = {
    "bounded, weak": Proof(paper(bounded()), 2.0, series, 1.6e-7),
    "bounded, a core, negative p": Proof(paper(bounded()), -1.0, series, 1e-8, slow=True),
    "bounded, whole support": Proof(
        paper(bounded(0.4, 0.6, 0.9), 0.75, -0.1, 0.5, 1.3), -1.0, series, 1.84e-8, slow=True
    ),
    "bounded, law of impact": Proof(
        paper(bounded(0.4, 0.6, 0.7), 0.75, -0.1, 0.5, 1.3, impact="restitution"), 1.5, series, 1e-6, slow=True
    ),
    "bounded, paths": Proof(
        paper(bounded(0.4, 0.6, 0.7), 0.75, -0.1, 0.5, 1.3, impact="restitution"), None, elements, 1e-5, slow=True
    ),
    "bounded, ends that are reached": Proof(paper(bounded(r0=-1.0)), 2.0, series, 1e-8, slow=True),
    "bounded, strong, without loss": Proof(paper(bounded(), 1.0, epsilon=1.0), 2.0, series, 1e-5, slow=True),
    "bounded, gain at a wall": Proof(spring(bounded(0.02, 0.6, 0.7), 0.1, 2.0, 1.1), 1.0, elements, 1e-6, slow=True),
    "bounded, reversed": Proof(spring(bounded(0.05, 0.6, 0.8)), -2.0, known(0.2), slow=True),
    "bounded, uneven": Proof(Problem(UNEVEN, bounded(0.4, 0.6, 0.7)), 1.5, even, 1e-6, slow=True),
    "limit of bounded": Proof(
        paper(bounded(0.2, r0=1.0)), 1.0, lambda _, p: series(paper(reduced(0.2, r0=1.0)), p), slow=True
    ),
    "Gaussian": Proof(paper(reduced()), 2.0, series, 2e-9),
    "Gaussian, another": Proof(paper(OrnsteinUhlenbeck(1.7, 0.9)), -1.0, series, 1e-9),
    "Gaussian, paths": Proof(paper(reduced()), None, elements, 1e-7),
    "Gaussian, strong": Proof(
        paper(reduced(0.3), epsilon=1.0), 1.0, functools.partial(series, modes=20, size=60), 2e-5, slow=True
    ),
    "Gaussian, without loss, closed form": Proof(
        paper(reduced(0.2), 1.0, epsilon=0.2),
        -2.0,
        lambda found, _: 0.04 * (found.noise.sigma**2 / (2 * found.noise.alpha**2) - 0.1),
        slow=True,
    ),
    "Gaussian, uneven": Proof(Problem(UNEVEN, OrnsteinUhlenbeck(1.7, 0.9)), 1.5, even, 1e-6, slow=True),
    "Gaussian, reversed": Proof(spring(GAUSS), -2.0, known(0.2), slow=True),
    "Gaussian, a wall": Proof(
        spring(GAUSS, 0.1, 2.0, 0.8),
        2.0,
        by_phase(
            phase_circle.ornstein_uhlenbeck(oscillating(0.1, 2.0), STIFFNESS, 1.0, 0.2 / math.sqrt(2), 10), 16, 0.8
        ),
        1e-6,
        slow=True,
    ),
    "Gaussian, a wall, paths": Proof(spring(GAUSS, 0.1, 2.0, 0.8), None, elements, 1e-5, slow=True),
    **{
        f"Gaussian, stiffness {k}, deviation {deviation}": Proof(
            spring(OrnsteinUhlenbeck(1.0, deviation * math.sqrt(2)), 0.1, k),
            2,
            functools.partial(by_moments, count=80),
            width,
            slow=True,
        )
        for k, deviation, width in ((100.0, 2.0, 1e-8), (1.0, 0.2 / math.sqrt(2), 1e-8), (1.0, math.sqrt(0.5), 0.1))
    },
    **{f"white, p = {p}": Proof(spring(VOLTS), p, by_moments) for p in (2, 4)},
    "white, paths": Proof(spring(VOLTS), None, lambda *_: closed_forms.white_stiffness(1.0, 0.5, 0.1)),
    "white, a wall": Proof(spring(VOLTS, factor=0.8), 2.0, white(oscillating(), STIFFNESS, 0.5, 0.8)),
    "white, a wall, paths": Proof(
        spring(VOLTS, factor=0.8), None, lambda *_: closed_forms.white_stiffness(1.0, 0.5, 0.1, 0.8)
    ),
    "white, parametric": Proof(
        Problem(ParametricOscillator(1.0, 0.1, 0.8), VOLTS), 3.0, white(oscillating(), STIFFNESS, 0.5, 0.8)
    ),
    "white, no stiffness": Proof(spring(White(s=1.0), 0.0, 0.0), 4.0, known(42 ** (1 / 3))),
    "white, no stiffness, paths": Proof(
        spring(White(s=1.0), 0.0, 0.0), None, lambda *_: closed_forms.white_stiffness(0.0, 1.0)
    ),
    "white, inverted, paths": Proof(
        spring(White(s=1.0), 0.0, -1.0), None, lambda *_: closed_forms.white_stiffness(-1.0, 1.0)
    ),
    **{
        f"white in the velocity, {p}": Proof(
            matrices(NEGATIVE, VELOCITY, VOLTS, jumps=[wall(0.8)]), p, white(NEGATIVE, VELOCITY, 0.5, 0.8)
        )
        for p in (2.0, 1.0, None)
    },
    **{
        f"white, Itô, {p}": Proof(
            matrices(NEGATIVE, VELOCITY, ITO, jumps=[wall(0.8)]), p, white(NEGATIVE, VELOCITY, 0.5, 0.8, "ito")
        )
        for p in (-1.0, None)
    },
    **{
        f"saddle, {p}": Proof(
            matrices(SADDLE, TURN, White(s=1.0)), p, lambda *_, k=k: float(closed_forms.saddle_and_turning()[k])
        )
        for k, p in enumerate((None, 2.0, -1.0))
    },
    **{f"shear, {p}": Proof(matrices(SHEAR, TURN, White(s=1.0)), p, white(SHEAR, TURN, 1.0)) for p in (2.0, None)},
    "telegraph": Proof(spring(Telegraph(0.5, 1.0), 0.05), 2, by_moments),
    "telegraph, paths": Proof(
        spring(Telegraph(0.5, 1.0), 0.05), None, by_phase(phase_circle.chain(STATES_OF_SPRING, FLIP))
    ),
    "telegraph, reversed": Proof(spring(Telegraph(0.5, 1.0)), -2.0, known(0.2)),
    "telegraph, paper": Proof(
        paper(Telegraph(0.5, 1.0), 0.8, 0.1, 0.4, 1.2, impact="restitution"),
        2.5,
        by_phase(phase_circle.chain(at(((0.0, 1.2), (-1.2, 0.016)), (-0.2, 0.2), VELOCITY), FLIP), 20, 1 - 0.16 * 0.2),
        1e-8,
    ),
    "telegraph, backward": Proof(
        matrices(((0.0, -1.0), (1.0, -0.2)), ((0.0, 0.0), (1.0, 0.0)), Telegraph(0.5, 1.0), jumps=[wall(0.8)]),
        2.0,
        by_phase(phase_circle.chain(at(oscillating(), STATES), FLIP), 20, 0.8),
    ),
    "telegraph, two rays": Proof(
        matrices(NEGATIVE, VELOCITY, Telegraph(0.5, 1.0), jumps=[wall(0.9), Jump(0.0, math.log(0.8 / 0.9))]),
        2.0,
        by_phase(phase_circle.chain(at(NEGATIVE, STATES, VELOCITY), FLIP), 20, 0.8),
    ),
    "lopsided telegraph": Proof(
        spring(Lopsided(0.5, 1.0)),
        2,
        by_moments,
    ),
    **{
        f"chain, a wall, {p}": Proof(
            spring(CHAIN, 0.05, 1.5, 0.85),
            p,
            by_phase(phase_circle.chain(at(oscillating(0.05, 1.5), CHAIN.states), RATES), 14, 0.85),
        )
        for p in (1.5, None)
    },
    **{
        f"sine-Wiener, {p}": Proof(
            spring(SineWiener(1.0, 1.0)),
            p,
            by_moments,
            slow=p == 4,
        )
        for p in (2, 4)
    },
    "sine-Wiener, reversed": Proof(spring(SINE), -2.0, known(0.2)),
    "sine-Wiener, paths": Proof(
        spring(SINE, 0.1, 2.0),
        None,
        by_phase(phase_circle.bounded(oscillating(0.1, 2.0), STIFFNESS, 0.3, 0.0, 1.0, 10), 20),
        1e-6,
    ),
    "sine-Wiener, two rays": Proof(
        matrices(NEGATIVE, VELOCITY, SINE, jumps=[wall(0.8), Jump(0.0, 0.1)]),
        -1.0,
        elements,
        1e-6,
    ),
}
EACH = [pytest.param(name, id=name, marks=pytest.mark.slow if proof.slow else ()) for name, proof in PROOFS.items()]


@functools.cache
def proven(name: str):
    proof = PROOFS[name]
    if proof.p is None:
        return prove_lyapunov_exponent(proof.problem, width=proof.width)
    return prove(proof.problem, proof.p, width=proof.width)


def entry_of(name: str) -> dict[str, Any]:
    """As in a proof.json."""
    found = proven(name)
    certificate = json.loads(found.certificate.model_dump_json())
    return {"p": PROOFS[name].p, "lower": found.lower, "upper": found.upper, "certificate": certificate}


@pytest.mark.parametrize("name", EACH)
def test_bounds_are_as_close_as_wanted_and_hold_a_known_value(name):
    """And both verifiers take the certificate."""
    proof, found = PROOFS[name], proven(name)
    assert found.is_met
    assert found.width <= proof.width
    value = proof.value(proof.problem, proof.p)
    assert found.lower - proof.doubt <= value <= found.upper + proof.doubt
    assert objection(found.certificate) == ""
    assert certificate_checker.check(entry_of(name)) == ""


Change = tuple[tuple[Any, ...], Callable[[Any], Any]]


def changes(certificate: dict[str, Any]) -> Iterator[Change]:
    """Places in a certificate, and what becomes of what stands there."""
    deltas = sum(certificate[side]["delta"] for side in ("upper", "lower"))
    for side, sign in (("upper", 1), ("lower", -1)):
        yield from (((side, "delta"), lambda x, factor=factor: factor * x) for factor in (0.0, 0.3))
        yield ("mu",), lambda x, sign=sign: x + 1.5 * sign * deltas
        if certificate[side]["nodes"]:
            for factor in (-1.0, 2.0):
                yield (side, "values"), lambda x, factor=factor: [factor * each for each in x]
        if certificate[side]["tails"]:
            yield from (((side, "tails", k), lambda x, k=k: x + (2 * k - 1) * 10.0) for k in (0, 1))
    for wave in ("cosine", "sine"):
        for row in (1, len(certificate["cosine"]) - 1):
            yield (wave, row, 0), lambda x: x + 1000 * deltas + 1e-12
    stated, noise = certificate["stated"], certificate["stated"]["noise"]
    places = [(name, j, k) for name in ("still", "driven") for j, k in np.ndindex(2, 2) if stated[name][j][k]]
    places += [("jumps", k, "log_factor") for k, _ in enumerate(stated["jumps"])] + [("coordinates", 1, 1)]
    names = [("states", 0), ("rates", 0, 1)] if noise["kind"] == "chain" else [("unit",), ("nu",)]
    places += [("noise", *name) for name in names if name != ("nu",) or noise["nu"]]
    yield from ((("stated", *place), lambda x: 1.01 * x) for place in places)
    yield ("stated", "jumps"), lambda x: [*x, {"ray": [0.3, 1.0], "log_factor": 0.01}]
    if certificate["p"] is not None:
        yield ("p",), lambda x: 1.01 * x


def changed(entry: dict[str, Any], change: Change) -> dict[str, Any]:
    """Another entry, which claims what its certificate does."""
    new, (places, by) = copy.deepcopy(entry), change
    *above, last = places
    target = certificate = new["certificate"]
    for place in above:
        target = target[place]
    target[last] = by(target[last])
    for key, sign in (("lower", -1), ("upper", 1)):
        new[key] = certificate["mu"] + sign * (1.1 * certificate[key]["delta"] + 1e-12)
    return new | {"p": certificate["p"]}


def is_taken(entry: dict[str, Any]) -> bool:
    """Whether fpsolve's own verifier takes a certificate; what cannot be read is refused, too."""
    try:
        return not objection(type(proven("white, paths").certificate)(**entry["certificate"]))
    except ValueError:
        return False


@pytest.mark.parametrize(
    ("name", "step"),
    sampled(
        *(("chain, a wall, None", 1), ("white, Itô, -1.0", 1), ("sine-Wiener, paths", 2)),
        *(("Gaussian, paths", 5), ("Gaussian, another", 7), ("bounded, law of impact", 7)),
        *((name, 1) for name in ("telegraph, paper", "white, parametric", "saddle, None", "sine-Wiener, two rays")),
        ("bounded, paths", 1),
        keep=3,
    ),
)
def test_certificates_with_a_change_are_refused_by_both_verifiers(name, step):
    """Of the statement, of the function, of a bound, or of the function W that levels its mismatch."""
    entry = entry_of(name)
    for change in islice(changes(entry["certificate"]), 0, None, step):
        new = changed(entry, change)
        assert not is_taken(new), change[0]
        assert certificate_checker.check(new) != "", change[0]


AHEAD = {"ray": [1.0, 0.0], "log_factor": 0.1}


@pytest.mark.parametrize(
    ("name", "change", "reason"),
    [
        ("chain, a wall, 1.5", {"noise": {"rates": [[0.0, -1.0, 1.0]] * 3}}, "negative"),
        ("chain, a wall, 1.5", {"noise": {"rates": [[0.0, 1.0]] * 3}}, "shape"),
        ("chain, a wall, 1.5", {"": {"jumps": [AHEAD]}, "noise": {"states": [-9.0, 0.1, 0.5]}}, "one way"),
        ("chain, a wall, 1.5", {"": {"coordinates": [[1.0, 1.0], [1.0, 1.0]]}}, "inverse"),
        ("chain, a wall, 1.5", {"": {"jumps": [{"ray": [0.0, 0.0], "log_factor": 0.0}]}}, "direction"),
        ("white, Itô, -1.0", {"": {"jumps": [{"ray": [1.0, -1.0], "log_factor": 0.1}]}}, "one way"),
        ("sine-Wiener, paths", {"": {"jumps": [AHEAD]}, "noise": {"unit": 3.0}}, "one way"),
        ("sine-Wiener, paths", {"basis": {"kind": "states"}}, "basis"),
        ("sine-Wiener, paths", {"basis": {"kind": "core"}}, "basis"),
        ("sine-Wiener, paths", {"upper": {"nodes": [0.0, 1.0], "values": [0.0, 0.0]}}, "no W"),
        ("Gaussian, paths", {"noise": {"kind": "else"}}, "called"),
        ("Gaussian, paths", {"noise": {"slope": 0.0}}, "rate of the noise"),
        ("Gaussian, paths", {"noise": {"unit": -1.0}}, "negative"),
        ("Gaussian, paths", {"noise": {"states": [0.0]}}, "states"),
        ("Gaussian, paths", {"upper": {"delta": -1e-9}}, "delta"),
        ("Gaussian, paths", {"upper": {"tails": None}}, "tails"),
        ("Gaussian, paths", {"upper": {"tails": [-0.3, 70.0]}}, "jumps"),
        ("Gaussian, paths", {"lower": {"tails": [-0.3, 1e-9]}}, "too slowly"),
        ("Gaussian, paths", {"basis": {"scale": 0.0}}, "scale"),
        ("Gaussian, paths", {"basis": {"gauge": 0.5}}, "gauge"),
        ("Gaussian, paths", {"basis": {"kind": "whole"}}, "bounded noise"),
    ],
)
def test_certificates_that_make_no_sense_are_refused_by_both_verifiers(name, change, reason):
    entry = entry_of(name)
    certificate = entry["certificate"]
    for part, values in change.items():
        inner = certificate if part in certificate else certificate["stated"]
        (inner[part] if part else inner).update(values)
    assert not is_taken(entry)
    assert reason in certificate_checker.check(entry)


@pytest.mark.parametrize(
    ("noise", "law"),
    [
        (OrnsteinUhlenbeck(1.5, 0.6), ("gaussian", 0.6 / math.sqrt(3), 3.0, 0.5)),
        (bounded(0.4, 0.5, 1.0), ("gaussian", math.sqrt(0.8), 4.0, 0.5)),
        (bounded(0.4, 0.5, 0.75), ("bounded", math.sqrt(6.4), 0.5, 4.0)),
        (SineWiener(0.3, 2.0), ("circle", 0.3, 4.0, 0.0)),
        (VOLTS, ("white", 0.5, 0.0, 0.0)),
        (Telegraph(0.5, 1.0), ("chain", 1.0, 0.0, 0.0)),
    ],
)
def test_a_certificate_states_the_oscillator_and_the_law_of_its_noise(noise, law):
    """Eqs. (3), (7) and (15), in (x, ẋ/ω), of Λ(0) = 0, which needs no search."""
    found = prove(paper(noise, 0.75, 0.2, 0.5, 1.5), 0.0)
    assert (found.lower, found.upper, found.width, objection(found.certificate)) == (0.0, 0.0, 0.0, "")
    stated = found.certificate.model_dump()["stated"]
    assert (stated["still"], stated["driven"]) == ([[0.0, 1.5], [-1.5, 0.05]], [[0.0, 0.0], [0.0, 0.5]])
    assert stated["jumps"] == [{"ray": [0.0, -1.0], "log_factor": -0.0625}]
    assert stated["coordinates"] == [[1.0, 0.0], [0.0, 1.0]]
    of_noise = stated["noise"]
    assert of_noise["kind"] == law[0]
    assert [of_noise[name] for name in ("unit", "nu", "slope")] == pytest.approx(law[1:], rel=1e-15)
    if noise.has_states and not noise.is_white:
        assert (of_noise["states"], of_noise["rates"]) == ([-0.5, 0.5], FLIP)


def test_a_certificate_states_noise_in_the_sense_of_ito_with_its_drift():
    stated = prove(matrices(NEGATIVE, VELOCITY, ITO), 0.0).certificate.stated
    assert stated.still == [[0.0, 1.0], [-1.0, 0.1 - 0.125]]


class Mystery(SineWiener):
    """A noise of which no proof is known."""


def cubic(xi):
    return xi**3


MANY = MarkovChain(tuple(range(401)), [[float(abs(i - j) == 1) for i in range(401)] for j in range(401)])
BENT = Problem(PlaneSystem([CoefficientMatrix(0, TURN), CoefficientMatrix(1, STIFFNESS, cubic)]), Telegraph(0.5, 1.0))


@pytest.mark.parametrize(
    ("problem", "p", "width", "failure", "words"),
    [
        (BENT, 1.0, None, TypeError, "got the coefficient cubic(ξ); proofs are for coefficients a + b ξ"),
        (spring(Mystery(1.0, 1.0)), 1.0, None, TypeError, "got Mystery; proofs are for OrnsteinUhlenbeck, NonGauss"),
        (spring(bounded(1.0, 1.0, 1.2)), -0.5, None, FpsolveError, "algebraic tails"),
        (spring(MANY), 1.0, None, TypeError, "got a chain of 401 states; proofs are for 400 at most"),
        *((paper(bounded()), p, None, ValueError, "must be a finite number") for p in (math.nan, math.inf)),
        *((paper(bounded()), 1.0, width, ValueError, "must be a positive number") for width in (0.0, -1e-9, math.nan)),
    ],
)
def test_problems_and_widths_that_cannot_be_proven_are_refused(problem, p, width, failure, words):
    with pytest.raises(failure, match=re.escape(words)):
        prove(problem, p, width=width)


@pytest.mark.slow
def test_the_stability_index_lies_between_two_proven_signs():
    problem = paper(bounded())
    found, estimate = prove_stability_index(problem), stability_index(problem)
    assert found.lower < estimate.value < found.upper < found.lower + 2e-6
    assert [each.sign for _, each in found.moments] in ([1, -1], [-1, 1])
    assert not any(objection(each.certificate) for _, each in found.moments)


@pytest.mark.slow
@pytest.mark.parametrize("p", [1e6, "delta"])
def test_a_bound_that_cannot_be_proven_ends_with_its_budget(p):
    """An index has twice the time, for both of its bounds."""
    hard, started, budget = paper(reduced(), epsilon=1.0), time.process_time(), Budget(seconds=0.4)
    found = prove_stability_index(hard, budget=budget) if p == "delta" else prove(hard, p, budget=budget)
    assert not found.is_proven
    assert time.process_time() - started < (3.0 if p == "delta" else 1.5)


@pytest.mark.slow
def test_a_width_beyond_reach_is_told_and_its_bounds_hold():
    """At p = 1e-300 the matrix shifted by Λ(p) is singular but for what underflows."""
    found = prove(paper(reduced(0.1), epsilon=0.05), 1e-300, width=1e-30)
    assert found.lower < 0 < found.upper
    assert found.width < 1e-12
    assert (found.is_proven, found.is_met) == (True, False)


fractions = np.vectorize(Fraction, otypes=[object])


def is_positive(matrix) -> bool:
    """By pivots, in fractions."""
    left = matrix.copy()
    for k in range(len(left)):
        if left[k, k] <= 0:
            return False
        left[k + 1 :, k + 1 :] -= np.outer(left[k + 1 :, k] / left[k, k], left[k, k + 1 :])
    return True


@pytest.mark.parametrize("n", [3, 6])
def test_bounds_on_the_second_moment_of_several_variables_hold_in_fractions(n, rng):
    """From a quadratic form, under two white noises on all of n variables, one in Itô's sense."""
    free, *driven = rng.standard_normal((3, n, n)) / np.sqrt(n)
    first, second = 0.5 * driven[0], 0.35 * driven[1]
    laws = [White(s=1.0), White(s=0.7, interpretation="ito")]
    found = prove(matrices((free - np.eye(n)).tolist(), [first.tolist(), (second / 0.7).tolist()], laws), 2.0)
    certificate = found.certificate
    total = kronecker.power(free - np.eye(n) - second @ second / 2, 2)
    total = total + sum(kronecker.power(each, 2) @ kronecker.power(each, 2) for each in (first, second)) / 2
    value = float(np.max(np.linalg.eigvals(total).real))
    assert found.width < 1e-7
    assert found.lower - 1e-13 <= value <= found.upper + 1e-13
    factor, drift = fractions(certificate.factor), fractions(certificate.stated.drift)
    form, noisy = factor.T @ factor, [fractions(each) for each in certificate.stated.diffusions]
    drift = drift + sum(each @ each for each in noisy) / 2
    image = drift.T @ form + form @ drift + sum(each.T @ form @ each for each in noisy)
    low, high = (
        Fraction(certificate.mu) + sign * Fraction(side.delta)
        for sign, side in ((-1, certificate.lower), (1, certificate.upper))
    )
    assert all(map(is_positive, (form, high * form - image, image - low * form)))
    assert objection(certificate) == ""
    for mu in (certificate.mu - 1e-6, certificate.mu + 1e-6):
        assert "is not certain" in objection(certificate.model_copy(update={"mu": mu}))
    singular = [[0.0] * n, *certificate.factor[1:]]
    assert objection(certificate.model_copy(update={"factor": singular})) == "G need not have an inverse"
    with pytest.raises(ValueError, match="factor must be a matrix of the size"):
        type(certificate)(**certificate.model_dump() | {"factor": certificate.factor[1:]})


def test_the_second_moment_of_twenty_variables_alone_is_proven_and_under_white_noise_alone():
    free, driven, _ = chain_of_masses(10, 0.2)
    problem = matrices(free, driven, White(s=0.2))
    found = prove(problem, 2.0)
    assert found.width < 1e-7
    assert found.lower < moment_lyapunov(problem, 2.0).value[0] < found.upper
    assert not prove(problem, 4.0).is_proven
    with pytest.raises(TypeError, match="20 variables under other noise than white"):
        prove(matrices(free, driven, OrnsteinUhlenbeck(1.0, 1.0)), 2.0)
