"""Where the only noise has strength 0, Λ(p) is p times the growth rate: a sweep from no noise runs."""

import math

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    load_case,
    moment_lyapunov,
    sensitivities,
)
from fpsolve.arrays import identity
from fpsolve.cli import main
from fpsolve.exponent import critical_impact_factor, impact_rate
from fpsolve.exponent.root import nonzero_root
from fpsolve.messages import Code
from fpsolve.model import (
    Bounded,
    CoefficientMatrix,
    Filter,
    Jump,
    LinearSystem,
    MarkovChain,
    ModalSystem,
    Poisson,
    SineWiener,
    White,
)

NOISES = {
    "OU": OrnsteinUhlenbeck(alpha=1.0, sigma=1.0),
    "chain": MarkovChain((-1.0, 0.0, 2.0), ((0, 1, 1), (1, 0, 1), (1, 1, 0))),
    "white": White(s=0.5),
    "Itô": White(s=0.5, interpretation="ito"),
    "impulses": Poisson(rate=1.0, sizes=(-1.0, 1.0)),
    "bounded": Bounded(mu=0.5, nu=2.0, sigma=0.5),
    "sine-Wiener": SineWiener(amplitude=1.0, sigma=1.0),
    "Eq. (7)": NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.8),
    "tails": NonGaussianNoise(D0=1.0, tau0=0.5, r0=1.2),
    "filter": Filter(omega=2.0, zeta=0.3, s=1.0, c0=1.0, c1=0.2),
}
DAMPED = ((0.0, 1.0), (-1.0, -0.2))
FREE = {
    "damped": DAMPED,
    "undamped": ((0.0, 1.0), (-1.0, 0.0)),
    "saddle": ((0.0, 1.0), (1.0, -0.2)),
    "overdamped": ((0.0, 1.0), (-1.0, -3.0)),
    "critical": ((0.0, 1.0), (-1.0, -2.0)),
    "nilpotent": ((0.0, 1.0), (0.0, 0.0)),
    "growth alone": ((-0.1, 0.0), (0.0, -0.1)),
    "at rest": ((0.0, 0.0), (0.0, 0.0)),
}


def undriven(free, noise, jumps=()):
    n = len(free)
    terms = CoefficientMatrix(0, free), CoefficientMatrix(1, np.zeros((n, n)).tolist(), identity)
    return Problem(PlaneSystem(terms, jumps) if n == 2 else LinearSystem(terms), noise)


def check(problem, rate, p=(2.0, 1.0, -0.5)):
    found, solver = moment_lyapunov(problem, p), ExponentSolver(problem)
    assert np.all(np.abs(found.value - rate * found.p) <= found.error_estimate + 1e-15)
    assert np.all(found.error_estimate <= 1e-8)
    exponent = solver.lyapunov_exponent()
    assert abs(exponent.value - rate) <= exponent.error_estimate + 1e-15 < 1e-8
    assert solver.variance_rate().value == 0
    assert nonzero_root(solver).reason.code == Code.NOT_DRIVEN


@pytest.mark.parametrize("free", FREE.values(), ids=FREE)
@pytest.mark.parametrize("noise", list(NOISES.values())[:9:3], ids=list(NOISES)[:9:3])
def test_two_variables(free, noise):
    check(undriven(free, noise), float(np.max(np.linalg.eigvals(free).real)))


@pytest.mark.parametrize("noise", [NOISES["OU"], NOISES["white"], NOISES["chain"]], ids=["OU", "white", "chain"])
@pytest.mark.parametrize("n", [3, 4])
def test_more_variables(n, noise):
    free = np.random.default_rng(n).normal(size=(n, n)) - np.eye(n)
    problem, rate = undriven(free.tolist(), noise), float(np.max(np.linalg.eigvals(free).real))
    found = moment_lyapunov(problem, [2.0, 1.0])
    assert np.all(np.abs(found.value - rate * found.p) <= found.error_estimate + 1e-15)


@pytest.mark.parametrize("noise", NOISES.values(), ids=NOISES)
def test_a_wall(noise):
    """Once in a half-turn of the damped motion."""
    turns = math.sqrt(0.99) / math.pi
    problem = undriven(DAMPED, noise, [Jump(math.pi / 2, math.log(0.8))])
    check(problem, -0.1 + turns * math.log(0.8))
    assert impact_rate(ExponentSolver(problem)).value == pytest.approx(turns, rel=1e-12)
    assert critical_impact_factor(ExponentSolver(problem)).value == pytest.approx(math.exp(0.1 / turns), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("second", ["OU", "white", "chain", "filter"])
def test_two_noises(second):
    still = [CoefficientMatrix(1, ((0.0, 0.0), (0.0, 0.0)), identity, name) for name in "ab"]
    noises = {"a": NOISES["OU"], "b": NOISES[second]}
    check(Problem(PlaneSystem([CoefficientMatrix(0, DAMPED), *still]), noises), -0.1)
    driven = CoefficientMatrix(1, ((0.0, 0.0), (-1.0, 0.0)), identity, "a")
    both = moment_lyapunov(Problem(PlaneSystem([CoefficientMatrix(0, DAMPED), driven, still[1]]), noises), 2.0)
    alone = moment_lyapunov(Problem(PlaneSystem([CoefficientMatrix(0, DAMPED), driven]), NOISES["OU"]), 2.0)
    assert abs(both.value[0] - alone.value[0]) <= both.error_estimate[0] + alone.error_estimate[0]


def test_modes_whose_noise_has_a_strength_of_zero():
    system = ModalSystem.of([[1.0]], [[1.0]], [[0.2]], stiffness_noise=[["g"]], parameters={"g": 0.0})
    check(Problem(system, NOISES["OU"]), -0.1)


def test_an_exponent_that_is_zero_exactly():
    """ẋ = ξx, v̇ = ξv: λ = 0, whose error has a meaning, and Λ(p) = ½s²p²."""
    one = CoefficientMatrix(1, ((1.0, 0.0), (0.0, 1.0)), identity)
    for noise, square in ((NOISES["white"], 0.25), (NOISES["OU"], 1.0)):
        problem = Problem(PlaneSystem([CoefficientMatrix(0, ((0.0, 0.0), (0.0, 0.0))), one]), noise)
        exponent, found = ExponentSolver(problem).lyapunov_exponent(), moment_lyapunov(problem, [1.0, 2.0])
        assert abs(exponent.value) <= exponent.error_estimate < 1e-10
        assert np.all(np.abs(found.value - 0.5 * square * found.p**2) <= found.error_estimate + 1e-15)


def test_the_slope_by_the_strength():
    """∂Λ/∂g at g = 0 is that of the mean of the noise: of ẍ + 0.2ẋ + (1 + gm)x, whose growth rate m does not change."""
    chain = MarkovChain((0.5, 1.5), ((0, 1.0), (1.0, 0)))
    for rates, slope in ((("v", "-x - 0.2*v - g*xi*x"), 0.0), (("v", "-x - 0.2*v - g*xi*v"), -1.0)):
        system = PlaneSystem.of_equations(("x", "v"), rates, {"g": 0.0})
        found = sensitivities(Problem(system, chain), 2.0)
        assert found.moments[0]["system.g"].value == pytest.approx(slope, abs=1e-12)
        assert found.moments[0]["system.g"].error_estimate < 1e-10


CASE = """title = "From no noise"

[system]
kind = "equations"
variables = ["x", "v"]
drift = ["v", "-x - 0.2*v - g*xi*x"]
parameters = { g = 0.0 }

[noise]
kind = "ornstein-uhlenbeck"
alpha = 1.0
sigma = 1.0

[vary]
"system.g" = [0.0, 0.1]

[moments]
p = [2.0, 1.0, -1.0]

[output]
quantities = ["moment", "lyapunov_exponent", "stability_index", "variance_rate", "rate_function", "excursions"]
"""


@pytest.mark.parametrize("term", ["g*xi*x", "0*xi*x"])
def test_a_sweep_from_no_noise(term, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    text = CASE.replace("g*xi*x", term)
    if term != "g*xi*x":
        text = text.replace("parameters = { g = 0.0 }\n", "").replace('[vary]\n"system.g" = [0.0, 0.1]\n', "")
    (tmp_path / "mine.toml").write_text(text)
    assert load_case("mine.toml").p.size == 3
    assert main(["run", "mine.toml"]) == 0
    said = capfd.readouterr()
    assert "Λ(p) is λ p and has no other root" in said.out + said.err
    assert "Warning" not in said.out + said.err
