"""The stationary response of equations with terms of degree 3, against the oscillator, identities and a closed form."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from scipy.integrate import quad

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem, VibroImpactOscillator
from fpsolve.arrays import identity
from fpsolve.errors import FpsolveError
from fpsolve.model import CoefficientMatrix, CubicTerms, Jump, System
from fpsolve.model.settling import comes_down
from fpsolve.nonlinear import stationary_response
from fpsolve.simulation import simulated_response

OSCILLATOR = {"omega": 1.3, "epsilon": 0.5, "c1": 0.4, "c2": 0.5, "c3": 0.2}
RATES = "v", "-omega**2*x + epsilon**2*v*(c1 - c2*x**2 - c3*v**2) + epsilon*xi*v"
NOISE = OrnsteinUhlenbeck(alpha=2.0, sigma=1.5)
BOUNCE = {"delta": "exp(-epsilon**2*(1 - r))", "restitution": "1 - epsilon**2*(1 - r)"}
DUFFING = {"omega": 1.4, "zeta": 0.02, "k": 0.3, "c": 0.2, "d": 0.1}


def written(law="", names=("x", "v")):
    """The oscillator as equations, with a wall or without."""
    parameters = {**OSCILLATOR, **({"r": 0.9} if law else {})}
    walls = [{"at": "x = 0", "restitution": BOUNCE[law]}] if law else []
    rates = dict(zip(("x", "v"), RATES, strict=True))
    return PlaneSystem.of_equations(names, [rates[name] for name in names], parameters, walls=walls)


def equations(force, **parameters):
    return PlaneSystem.of_equations(("x", "v"), ("v", force), parameters)


def duffing(**changes):
    return equations("-omega**2*x + 2*zeta*omega*v - k*x**3 - c*x**2*v - d*v**3 - xi*x", **{**DUFFING, **changes})


def closeness(mean, value):
    return abs(mean.value / value - 1)


@pytest.fixture(scope="module")
def bouncing():
    return stationary_response(Problem(VibroImpactOscillator(**OSCILLATOR, restitution=0.9), NOISE), rtol=0.1)


@pytest.fixture(scope="module")
def swinging():
    return stationary_response(Problem(duffing(), NOISE), rtol=0.1)


@pytest.mark.slow
def test_equations_have_the_response_of_the_oscillator(bouncing):
    found = stationary_response(Problem(written("delta"), NOISE), rtol=0.1)
    assert [*found.means] == ["amplitude", "amplitude_squared", "amplitude_fourth", "x_squared", "v_squared"]
    for name, mean in found.means.items():
        assert closeness(mean, bouncing.means[name].value) < 1e-9
    assert closeness(found.impact_rate, bouncing.impact_rate.value) < 1e-9


@pytest.mark.slow
def test_the_order_of_the_variables_is_free(bouncing):
    """With (v, x) the wall is at the second variable, and the phase falls; the functions are the same."""
    found = stationary_response(Problem(written("delta", ("v", "x")), NOISE), rtol=0.1)
    for name in ("x_squared", "v_squared"):
        assert closeness(found.means[name], bouncing.means[name].value) < 1e-9
    assert closeness(found.impact_rate, bouncing.impact_rate.value) < 1e-9
    x, v = np.array([-0.5, 0.0, 0.2, 0.7, 1.0]), np.array([0.6, 0.3, -0.5, 0.0, 0.9])
    np.testing.assert_allclose(found.joint_density(v, x), bouncing.joint_density(x, v), rtol=1e-9)
    assert found.joint_density(0.6, -0.5) == 0


@pytest.mark.slow
def test_without_a_wall_it_is_that_of_an_elastic_one():
    """With R = 1 the wall only turns the side on which x is."""
    elastic = stationary_response(Problem(VibroImpactOscillator(**OSCILLATOR, restitution=1.0), NOISE), rtol=0.1)
    found = stationary_response(Problem(written(), NOISE), rtol=0.1)
    for name, mean in found.means.items():
        assert closeness(mean, elastic.means[name].value) < 1e-9
    x, v = np.array([0.2, 0.7, 1.0]), np.array([-0.5, 0.0, 0.9])
    np.testing.assert_allclose(2 * found.joint_density(x, v), elastic.joint_density(x, v), rtol=1e-9)


@pytest.mark.slow
def test_without_a_wall_both_sides_are_alike(swinging):
    assert swinging.impact_rate is None
    assert (swinging.moment(1, 0).value, swinging.moment(2, 1).value) == (0, 0)
    x, v = np.array([0.2, 0.7, 1.0]), np.array([-0.5, 0.0, 0.9])
    np.testing.assert_allclose(swinging.joint_density(-x, -v), swinging.joint_density(x, v), rtol=1e-12)
    x, v = (np.linspace(-most, most, 81) for most in (3.0, 3.0 * swinging.problem.system.aspect))
    density, cell = swinging.joint_density(x[:, None], v), (x[1] - x[0]) * (v[1] - v[0])
    density[40, 40] = 0  # at rest, where it vanishes
    assert density.sum() * cell == pytest.approx(1, abs=2e-3)
    assert np.sum(density * x[:, None] ** 2) * cell == pytest.approx(swinging.means["x_squared"].value, rel=5e-3)


@pytest.mark.slow
def test_rates_of_change_of_moments_vanish(swinging):
    """Those of E x², E x⁴, E xv and E H, H the energy with k x⁴/4; the discrete equations do not imply it."""
    solution, flow = swinging.solution, swinging.flow
    omega, zeta, k, c, d = DUFFING.values()
    phi = solution.plane.circle.points
    cos, sin = np.cos(phi), -swinging.problem.system.aspect * np.sin(phi)
    square = np.exp(2 * flow.gauge(phi))  # a² over e^{2u}
    of_noise = [solution.mean(2, square * cos * each, identity) for each in (cos, sin)]  # E ξx² and E ξxv

    def balance(of_noise, *terms):
        sizes = [(size, swinging.moment(n, m)) for size, n, m in terms]
        total = of_noise + sum(size * each.value for size, each in sizes)
        scale = sum(abs(size) * each.scale for size, each in sizes)
        assert abs(total) <= sum(abs(size) * each.error_estimate for size, each in sizes) + 1e-3 * abs(of_noise)
        assert abs(total) < 1e-3 * scale

    balance(0.0, (1, 1, 1))
    balance(0.0, (1, 3, 1))
    balance(-of_noise[0], (1, 0, 2), (-(omega**2), 2, 0), (2 * zeta * omega, 1, 1), (-k, 4, 0), (-c, 3, 1), (-d, 1, 3))
    balance(-of_noise[1], (2 * zeta * omega, 0, 2), (-c, 2, 2), (-d, 0, 4))


@pytest.mark.slow
@pytest.mark.parametrize("s", [1e25])
def test_units_of_the_amplitude(swinging, s):
    """With x = sy terms of degree 3 are multiplied by s², and means divided by powers of s."""
    found = stationary_response(Problem(duffing(**{name: s**2 * DUFFING[name] for name in "kcd"}), NOISE), rtol=0.1)
    for name, power in (("amplitude", 1), ("amplitude_squared", 2), ("amplitude_fourth", 4), ("x_squared", 2)):
        assert found.means[name].value * s**power == pytest.approx(swinging.means[name].value, rel=1e-10)
    a = np.array([0.5, 1.5])
    np.testing.assert_allclose(found.amplitude_density(a / s) / s, swinging.amplitude_density(a), rtol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("k", [0.5])
def test_white_noise_is_approached(k):
    """v̇ = −ω²x − kx³ + Dv − dv³ + ξv has ρ ∝ exp(−dH/D) in white noise, H = v²/2 + ω²x²/2 + kx⁴/4."""
    D, d, omega = 0.3, 0.5, 1.3

    def law(x):
        return math.exp(-d / D * (omega**2 * x**2 / 2 + k * x**4 / 4))

    square = quad(lambda x: x**2 * law(x), 0, 10)[0] / quad(law, 0, 10)[0]
    system = equations("-omega**2*x - k*x**3 + D*v - d*v**3 + xi*v", omega=omega, k=k, D=D, d=d)
    far = []
    for tau in (0.02, 0.01):
        means = stationary_response(
            Problem(system, OrnsteinUhlenbeck(1 / tau, math.sqrt(2 * D) / tau)), rtol=1e-3
        ).means
        far.append([means["x_squared"].value - square, means["v_squared"].value - D / d])
    assert np.log2(np.divide(*far)) == pytest.approx([1, 2], abs=0.12)


@pytest.mark.slow
def test_a_slow_tail_is_in_the_error():
    """Damping −v³ alone leaves large x where the noise moves them: E a⁴ is carried far out. Values of tests.oracles."""
    means = stationary_response(Problem(equations("-x + 0.1*v - v**3 - xi*x"), NOISE), rtol=0.1).means
    for name, value, deviation in (
        ("x_squared", 0.158042, 1.8e-4),
        ("v_squared", 0.125910, 9e-5),
        ("amplitude_fourth", 0.19632, 1.2e-3),
    ):
        assert abs(means[name].value - value) < means[name].error_estimate + 4 * deviation


@pytest.mark.parametrize(
    ("force", "parameters", "words"),
    [
        ("-x + 0.1*v - k*x**3 - xi*x", {"k": 0.5}, "do not bring large amplitudes down"),
        ("-x + 0.1*v + k*x**3 - v**3 - xi*x", {"k": 1e-3}, "do not bring large amplitudes down"),  # softening
        ("-x + 0.1*v + d*v**3 - xi*x", {"d": 0.1}, "do not bring large amplitudes down"),
        ("-x - v - d*v**3 - xi*x", {"d": 0.1}, "comes to rest"),
        ("-x + 0.1*v - d*v**3 - xi*x", {"d": 0.0}, "nothing limits the amplitude"),
    ],
)
def test_what_has_no_response_is_refused(force, parameters, words):
    with pytest.raises(FpsolveError, match=words):
        stationary_response(Problem(equations(force, **parameters), NOISE), rtol=0.1)


@pytest.mark.parametrize(
    ("force", "falls"),
    [
        ("-x + 0.2*v - 0.1*x**2*v", True),
        ("-x + 0.2*v - 0.1*v**3", True),
        ("-x + 0.2*v - 0.1*x**3 - 1e-3*x**2*v", True),
        ("x - 0.1*v - 0.1*x**3 - 0.1*x**2*v", True),  # two wells
        ("x - 0.1*v - 0.1*x**2*v", False),  # ẋ ~ 1/x
        ("-x - 0.1*v + 0.1*x**3 - v**3", False),  # escapes over the top of the potential
        ("-x + 0.2*v - 0.1*x**3", False),
        ("-x - 0.1*v - 0.1*x**3", False),  # not by terms of degree 3
    ],
)
def test_whether_large_amplitudes_come_down(force, falls):
    """Closed forms: by the energy, or by v that follows x at large amplitudes."""
    assert comes_down(Problem(equations(f"{force} - xi*x"), NOISE)) is falls


def test_rays_that_are_never_left():
    system = PlaneSystem.of_equations(("x", "y"), ("x + xi*x - x**3", "-y + xi*y - y**3"))
    with pytest.raises(FpsolveError, match="the phase never leaves φ = 0"):
        stationary_response(Problem(system, NOISE), rtol=0.1)


@dataclass(frozen=True)
class Walled(System):
    """ẋ = v, v̇ = −x + 0.1 v − x²v − ξx, stretched at some rays."""

    jumps: tuple[Jump, ...]
    epsilon: ClassVar[float] = 1.0
    terms: ClassVar[tuple[CoefficientMatrix, ...]] = (
        CoefficientMatrix(0, ((0.0, 1.0), (-1.0, 0.1))),
        CoefficientMatrix(1, ((0.0, 0.0), (-1.0, 0.0)), identity),
    )
    cubic: ClassVar[CubicTerms] = CubicTerms(((0.0, 0.0, 0.0, 0.0), (0.0, -1.0, 0.0, 0.0)))


@pytest.mark.parametrize("cubic", ["x**3", "0.1*x**2*y"])
def test_noise_may_be_the_only_linear_term(cubic):
    """It is refused by name, not by a fault: no phase of it is left, or large amplitudes grow."""
    system = PlaneSystem.of_equations(("x", "y"), (f"xi*x - {cubic}", "-xi*y - y**3"))
    with pytest.raises(FpsolveError, match=r"never leaves|do not bring"):
        stationary_response(Problem(system, NOISE), rtol=0.1)


@dataclass(frozen=True)
class Stiff(Walled):
    """The same with ξẋ in the place of ξx, and −x³ too."""

    terms: ClassVar[tuple[CoefficientMatrix, ...]] = (
        CoefficientMatrix(0, ((0.0, 1.0), (-1.0, 0.1))),
        CoefficientMatrix(1, ((0.0, 0.0), (0.0, -1.0)), identity),
    )
    cubic: ClassVar[CubicTerms] = CubicTerms(((0.0, 0.0, 0.0, 0.0), (-1.0, -1.0, 0.0, 0.0)))


@pytest.mark.parametrize("phases", [(0.0, math.pi / 2), (0.0,)])
def test_other_walls_are_refused(phases):
    """Two of them, and one that the cubic terms move the phase across."""
    system = Stiff(tuple(Jump(phase, -0.1) for phase in phases))
    with pytest.raises(FpsolveError, match="for one wall at most"):
        stationary_response(Problem(system, NOISE), rtol=0.1)
    with pytest.raises(FpsolveError, match="for one wall at most"):
        simulated_response(Problem(system, NOISE), 0.1, 0.1, paths=32, time=1.0, step=0.1, seed=0)


@pytest.mark.slow
def test_a_system_of_its_own_kind_has_a_response():
    """A class that states cubic terms, and the same as equations."""
    own = stationary_response(Problem(Walled((Jump(math.pi / 2, -0.1),)), NOISE), rtol=0.1)
    wall = {"at": "x = 0", "restitution": "exp(-0.1)"}
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x + 0.1*v - x**2*v - xi*x"), walls=[wall])
    written = stationary_response(Problem(system, NOISE), rtol=0.1)
    assert [*own.means][-2:] == ["x₁_squared", "x₂_squared"]
    for one, other in zip(own.means.values(), written.means.values(), strict=True):
        assert closeness(one, other.value) < 1e-12
