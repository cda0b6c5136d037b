"""Proven bounds of systems that are given by their matrices, under every kind of noise for which a proof is known."""

import math
import re

import pytest
from scipy.special import i0, i1

import fpsolve
from fpsolve import Problem, prove
from fpsolve.arrays import identity
from fpsolve.errors import NoSuchExponent
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, ParametricOscillator, SineWiener, Telegraph, White
from fpsolve.proofs import Certificate, objection, prove_lyapunov_exponent, search
from fpsolve.proofs.statement import statement_of
from tests import random_proofs
from tests.conftest import sampled
from tests.oracles.harmonics import moment_exponent
from tests.oracles.moment_hierarchy import ornstein_uhlenbeck_exponent

STIFFNESS, VELOCITY, TURN = ((0.0, 0.0), (-1.0, 0.0)), ((0.0, 0.0), (0.0, 1.0)), ((0.0, -1.0), (1.0, 0.0))


def plane(free, driven, *jumps):
    """ẋ = (A₀ + ξ A₁) x with jumps."""
    return fpsolve.PlaneSystem([CoefficientMatrix(0, free), CoefficientMatrix(1, driven, identity)], jumps)


def wall(factor):
    """x⁺ = R x⁻ at x = 0."""
    return Jump(math.pi / 2, math.log(factor))


def spring(b=0.1, k=1.0, *jumps):
    """ẍ + 2bẋ + (k + ξ) x = 0."""
    return plane(((0.0, 1.0), (-k, -2 * b)), STIFFNESS, *jumps)


def driven_velocity(*jumps):
    """ẍ − 0.1ẋ + x = ξẋ."""
    return plane(((0.0, 1.0), (-1.0, 0.1)), VELOCITY, *jumps)


def bounds(system, noise, p, **options):
    """Bounds of Λ(p), or of λ, which are verified once more."""
    found = (
        prove_lyapunov_exponent(Problem(system, noise), **options)
        if p is None
        else prove(Problem(system, noise), p, **options)
    )
    assert not objection(found.certificate)
    return found


SADDLE = plane(((1.0, 0.0), (0.0, -1.0)), TURN)
SHEAR = plane(((-1.0, 0.0), (5.0, -1.0)), TURN)
KNOWN = {
    "white": (spring(), White(s=0.5), 2.0, -0.0742396424254463),
    "parametric": (ParametricOscillator(1.0, 0.1), White(s=0.5), 2.0, -0.0742396424254463),
    "parametric, wall": (ParametricOscillator(1.0, 0.1, 0.8), White(s=0.5), None, -0.13970934720001),
    "white, fourth": (spring(), White(s=0.5), 4.0, -0.0145544380585),
    "white, paths": (spring(), White(s=0.5), None, -0.0688672519733493),
    "white, wall": (spring(0.1, 1.0, wall(0.8)), White(s=0.5), 2.0, -0.212437199),
    "white, wall, paths": (spring(0.1, 1.0, wall(0.8)), White(s=0.5), None, -0.13970934720001),
    "white, no stiffness": (spring(0.0, 0.0), White(s=1.0), 4.0, 42 ** (1 / 3)),
    "white, no stiffness, paths": (spring(0.0, 0.0), White(s=1.0), None, 0.289308259834239),
    "white, inverted, paths": (spring(0.0, -1.0), White(s=1.0), None, 0.829060894212746),
    "white in the velocity": (driven_velocity(wall(0.8)), White(s=0.5), 2.0, 0.2147187990541),
    "white in the velocity, first": (driven_velocity(wall(0.8)), White(s=0.5), 1.0, 0.0582175109649),
    "white in the velocity, paths": (driven_velocity(wall(0.8)), White(s=0.5), None, 0.0103221483130),
    "white, Itô": (driven_velocity(wall(0.8)), White(s=0.5, interpretation="ito"), None, -0.0523330808550),
    "saddle": (SADDLE, White(s=1.0), 2.0, math.sqrt(5) - 1),
    "saddle, negative": (SADDLE, White(s=1.0), -1.0, -0.2460954174313),
    "saddle, paths": (SADDLE, White(s=1.0), None, i1(1) / i0(1)),
    "shear": (SHEAR, White(s=1.0), 2.0, 0.4853222371891),
    "shear, paths": (SHEAR, White(s=1.0), None, -0.352315956524213),
    "telegraph": (spring(0.05), Telegraph(a=0.5, k=1.0), 2.0, -0.0332610990213474),
    "telegraph, paths": (spring(0.05), Telegraph(a=0.5, k=1.0), None, -0.0329794566817157),
    "chain": (spring(0.05), MarkovChain.telegraph(0.5, 1.0), 2.0, -0.0332610990213474),
    "sine-Wiener": (spring(0.1), SineWiener(1.0, 1.0), 2.0, moment_exponent(2, 0.2, 1.0, 1.0, 1.0)),
    "sine-Wiener, fourth": (spring(0.1), SineWiener(1.0, 1.0), 4.0, moment_exponent(4, 0.2, 1.0, 1.0, 1.0)),
}


@pytest.mark.parametrize(("system", "noise", "p", "value"), KNOWN.values(), ids=KNOWN)
def test_values_that_are_known_otherwise(system, noise, p, value):
    """Closed forms, moment hierarchies, Airy and Bessel functions."""
    found = bounds(system, noise, p)
    assert found.is_met
    assert found.lower - 6e-11 <= value <= found.upper + 6e-11
    assert found.width < 2e-7


@pytest.mark.parametrize(
    "noise",
    sampled(
        Telegraph(0.5, 1.0),
        SineWiener(0.3, 1.0),
        fpsolve.OrnsteinUhlenbeck(1.0, 0.2),
        fpsolve.NonGaussianNoise(0.05, 0.6, 0.8),
        keep=2,
    ),
)
def test_reversed_paths(noise):
    """With tr A = −2b all the time and noise that is the same backwards, Λ(p) + bp is even about p = −1: Λ(−2) = 2b."""
    found = bounds(spring(0.1), noise, -2.0)
    assert found.is_met
    assert found.lower <= 0.2 <= found.upper
    assert found.width < 1e-6


@pytest.mark.parametrize(
    ("stiffness", "deviation", "width"),
    sampled((100.0, 2.0, 1e-8), (1.0, 0.2 / math.sqrt(2), 1e-8), (1.0, math.sqrt(0.5), 0.1)),
)
def test_gaussian_noise_in_the_stiffness(stiffness, deviation, width):
    """Against the moment hierarchy; in (x, ẋ) with ω = 10 the phase is uneven, and a proof is in other coordinates."""
    free = ((0.0, 1.0), (-stiffness, -0.2))
    found = bounds(spring(0.1, stiffness), fpsolve.OrnsteinUhlenbeck(1.0, deviation * math.sqrt(2)), 2.0, width=width)
    value = ornstein_uhlenbeck_exponent(free, STIFFNESS, 1.0, deviation, 2, 80)
    assert found.lower - 1e-13 <= value <= found.upper + 1e-13
    assert found.is_met


@pytest.mark.parametrize("noise", sampled(fpsolve.OrnsteinUhlenbeck(1.7, 0.9), fpsolve.NonGaussianNoise(0.4, 0.6, 0.7)))
def test_the_papers_oscillator_by_its_matrices(noise):
    """In (x, ẋ), where its phase is uneven, and in (x, ẋ/ω)."""
    omega, epsilon = 1.3, 0.2
    terms = [
        CoefficientMatrix(0, ((0.0, 1.0), (-(omega**2), 0.0))),
        CoefficientMatrix(1, VELOCITY, identity),
        CoefficientMatrix(2, ((0.0, 0.0), (0.0, 0.1))),
    ]
    system = fpsolve.PlaneSystem(terms, [Jump(-math.pi / 2, math.log(1 - epsilon**2 * 0.2))], epsilon)
    oscillator = fpsolve.VibroImpactOscillator(omega, 0.8, 0.1, epsilon, impact="restitution")
    one, other = (bounds(each, noise, 1.5, width=1e-6) for each in (system, oscillator))
    assert one.is_met
    assert other.is_met
    assert max(one.lower, other.lower) < min(one.upper, other.upper) + 1e-15


def test_rays_that_are_passed_backward_and_several():
    """A mirror turns the phase back; and factors at several rays count as their product."""
    noise = Telegraph(0.5, 1.0)
    forward = bounds(spring(0.1, 1.0, wall(0.8)), noise, 2.0)
    mirrored = plane(((0.0, -1.0), (1.0, -0.2)), ((0.0, 0.0), (1.0, 0.0)), wall(0.8))  # (−x, ẋ)
    backward = bounds(mirrored, noise, 2.0)
    once = bounds(driven_velocity(wall(0.8)), noise, 2.0)
    several = bounds(driven_velocity(wall(0.9), Jump(0.0, math.log(0.8 / 0.9))), noise, 2.0)
    for found, other in ((backward, forward), (several, once)):
        assert found.is_met
        assert max(found.lower, other.lower) < min(found.upper, other.upper)


def cubic(xi):
    return xi**3


class Mystery(SineWiener):
    """A noise of which no proof is known."""


class Lopsided(Telegraph):
    """With other states."""

    @property
    def states(self):
        return 0.0, 3 * self.a


def test_a_derived_class_is_proven_by_its_own_rates():
    noise, chain = Lopsided(0.5, 1.0), MarkovChain((0.0, 1.5), ((0.0, 1.0), (1.0, 0.0)))
    found, other = (bounds(spring(), each, 2.0) for each in (noise, chain))
    assert found.certificate.stated == other.certificate.stated


ALONG = Jump(math.pi / 2, math.log(0.8))


@pytest.mark.parametrize(
    ("system", "noise", "failure", "words"),
    [
        (
            fpsolve.PlaneSystem([CoefficientMatrix(0, TURN), CoefficientMatrix(1, STIFFNESS, cubic)]),
            Telegraph(0.5, 1.0),
            TypeError,
            "got the coefficient cubic(ξ); proofs are for coefficients a + b ξ",
        ),
        (spring(), Mystery(1.0, 1.0), TypeError, "got Mystery; proofs are for OrnsteinUhlenbeck, NonGaussianNoise"),
        (plane(((0.0, 1.0), (-1.0, 0.0)), TURN, ALONG), Telegraph(1.5, 1.0), ValueError, "across the ray of a jump"),
        (plane(((0.0, 1.0), (-1.0, 0.0)), TURN, ALONG), White(0.1), ValueError, "across the ray of a jump"),
        (spring(), fpsolve.NonGaussianNoise(1.0, 1.0, 1.2), NoSuchExponent, "algebraic tails"),
        (
            spring(),
            MarkovChain(tuple(range(401)), [[float(abs(i - j) == 1) for i in range(401)] for j in range(401)]),
            TypeError,
            "got a chain of 401 states; proofs are for 400 at most",
        ),
    ],
)
def test_what_cannot_be_proven_is_refused_by_name(system, noise, failure, words):
    with pytest.raises(failure, match=re.escape(words)):
        prove(Problem(system, noise), 1.0)


@pytest.mark.parametrize(
    "noise",
    [SineWiener(0.8, 1.0), MarkovChain.telegraph(0.5, 1.0), White(0.5), fpsolve.OrnsteinUhlenbeck(1.0, 1.0)],
)
def test_nothing_moves_at_p_zero(noise):
    found = bounds(spring(), noise, 0.0)
    assert (found.lower, found.upper) == (0.0, 0.0)


def test_a_certificate_states_floats():
    """Those of the system, with the powers of ε, and of the noise."""
    found = bounds(spring(0.1, 3.0, wall(0.8)), MarkovChain.telegraph(0.5, 1.0), 2.0).certificate
    written = found.model_dump(mode="json")
    stated = written["stated"]
    assert (stated["still"], stated["driven"]) == ([[0.0, 1.0], [-3.0, -0.2]], [[0.0, 0.0], [-1.0, 0.0]])
    assert stated["jumps"] == [{"ray": [0.0, -1.0], "log_factor": math.log(0.8)}]
    assert stated["noise"]["states"] == [-0.5, 0.5]
    assert stated["noise"]["rates"] == [[-1.0, 1.0], [1.0, -1.0]]
    assert Certificate.model_validate(written) == found


@pytest.mark.parametrize(
    ("noise", "law"),
    [
        (fpsolve.OrnsteinUhlenbeck(1.5, 0.6), ("gaussian", 0.6 / math.sqrt(3), 3.0, 0.5)),
        (fpsolve.NonGaussianNoise(0.4, 0.5, 1.0), ("gaussian", math.sqrt(0.8), 4.0, 0.5)),
        (fpsolve.NonGaussianNoise(0.4, 0.5, 0.75), ("bounded", math.sqrt(6.4), 0.5, 4.0)),
        (SineWiener(0.3, 2.0), ("circle", 0.3, 4.0, 0.0)),
        (White(0.5), ("white", 0.5, 0.0, 0.0)),
    ],
)
def test_the_papers_oscillator_and_its_noise_are_stated(noise, law):
    """Eqs. (3), (7) and (15), in (x, ẋ/ω)."""
    stated = statement_of(Problem(fpsolve.VibroImpactOscillator(1.5, 0.75, 0.2, 0.5), noise))
    assert (stated.still, stated.driven) == ([[0.0, 1.5], [-1.5, 0.05]], [[0.0, 0.0], [0.0, 0.5]])
    assert [(jump.ray, jump.log_factor) for jump in stated.jumps] == [([0.0, -1.0], -0.0625)]
    assert stated.coordinates == [[1.0, 0.0], [0.0, 1.0]]
    found = stated.noise
    assert found.kind == law[0]
    assert (found.unit, found.nu, found.slope) == pytest.approx(law[1:], rel=1e-15)


def test_noise_in_the_sense_of_ito_moves_the_drift():
    stated = statement_of(Problem(driven_velocity(), White(0.5, interpretation="ito")))
    assert stated.still == [[0.0, 1.0], [-1.0, 0.1 - 0.125]]


@pytest.mark.parametrize("seed", sampled(0, 1, 4, 2, 8, keep=3))
def test_random_systems(seed):
    """A hundred others: `python -m tests.random_proofs 100 systems`."""
    found = random_proofs.outcome(seed, is_system=True)
    assert found.width < 1e-6
    assert found.off <= 1


def test_trials_stay_below_a_size(monkeypatch):
    """The phase stands still in either state: functions of it are not smooth, and no number of waves suffices."""
    monkeypatch.setattr(search, "MOST", 39)
    found = bounds(SADDLE, Telegraph(0.5, 2.0), None)
    assert len(found.certificate.cosine) <= 40
    assert not found.is_met
    assert found.lower < fpsolve.lyapunov_exponent(Problem(SADDLE, Telegraph(0.5, 2.0))).value < found.upper
