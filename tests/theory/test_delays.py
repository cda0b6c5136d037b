"""Λ(2) with delays, beside closed forms, published numbers, and the moments of a discretised segment of the path."""

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import lambertw, wrightomega

from fpsolve import Problem, moment_lyapunov, sensitivities
from fpsolve.errors import NoHierarchy, NoSuchExponent
from fpsolve.model import OrnsteinUhlenbeck, Telegraph, White
from fpsolve.model.faults import TableError
from fpsolve.model.systems.equations import EquationSystem
from fpsolve.simulation import simulate
from fpsolve.simulation.setup import default_step, transient
from fpsolve.theory import even_moment
from tests.oracles.segments import Segment
from tests.random_delays import compared

ITO = White(s=1.0, interpretation="ito")
TURNING = "v", "-(1 + w)*x - 0.1*v + w*x(t - 2*pi/speed) - w*xi*(x - x(t - 2*pi/speed))"


def scalar(a: float, b: float, tau: float) -> Problem:
    """dx = ax dt + b x(t − τ) dW."""
    return Problem(EquationSystem(("x",), ("a*x + b*xi*x(t - tau)",), (("a", a), ("b", b), ("tau", tau))), ITO)


def turning(speed: float, w: float) -> Problem:
    return Problem(EquationSystem(("x", "v"), TURNING, (("speed", speed), ("w", w))), ITO)


def of_scalar(a: float, b: float, tau: float) -> float:
    """Λ = 2a + b² exp(−Λτ), by Wright's omega."""
    return float(2 * a + wrightomega(math.log(tau * b**2) - 2 * a * tau).real / tau)


def test_one_variable():
    assert even_moment(scalar(-6.0, 2.0, 1.0), 2).value == pytest.approx(-1.0106337404425, abs=1e-12)
    rng = np.random.default_rng(1)
    for _ in range(20):
        a, b = rng.uniform(-8, 2), rng.uniform(0.1, 4)
        found = even_moment(scalar(a, b, 1.0), 2)
        assert abs(found.value - of_scalar(a, b, 1.0)) <= 1e-14 * (found.scale + abs(a))
        assert found.error <= 1e-13 * (1 + abs(a))


@pytest.mark.parametrize(("a", "b"), [(-150.0, 1e-3), (-150.0, 30.0), (-20.0, 0.1), (0.5, 3.0), (50.0, 1.0)])
@pytest.mark.parametrize("tau", [1.0, 100.0])
def test_growth_by_many_orders_in_a_delay(a, b, tau):
    """Λτ from −300 to 100."""
    found = even_moment(scalar(a / tau, b / math.sqrt(tau), tau), 2)
    assert found.value * tau == pytest.approx(of_scalar(a, b, 1.0), rel=1e-12, abs=1e-12)


@pytest.mark.slow
def test_a_delay_of_two_periods_of_a_load():
    """By the renewal equation of the fundamental solution, with Chebyshev's polynomials in elements of time."""
    steady = "-1.957*x - 0.178*v + 0.109*x(t - tau) - 0.29*v(t - tau)"
    noisy = "-0.711*xi*x + 0.769*xi*x(t - tau) + 0.23*xi*v(t - tau)"
    nu = 4 * math.pi / 1.848
    loads = f"0.696*cos({nu!r}*t + 2.416)*x - 0.348*cos({nu!r}*t + 0.276)*x(t - tau)"
    system = EquationSystem(("x", "v"), ("v", f"{steady} + {noisy} + {loads}"), (("tau", 1.848),))
    found = moment_lyapunov(Problem(system, White(s=0.679, interpretation="stratonovich")), 2.0)
    assert found.value[0] == pytest.approx(0.179280376748, abs=5e-12)


@pytest.mark.parametrize("rate", [1e-6, 1e-3, 30.0, 100.0, 1e6])
@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_units_of_time_and_of_a_variable(rate, unit):
    """A turned workpiece with times in 1/rate, and v in a unit: Λ(2)/rate is that of the delay Lyapunov equation."""
    turned = f"{rate * unit!r}*(-x - 0.1*(1 + xi)*(x - x(t - {2 * math.pi / rate!r})))"
    drift = f"{rate / unit!r}*v", f"{turned} - {0.1 * rate!r}*v"
    noise = White(s=1 / math.sqrt(rate), interpretation="ito")
    problem = Problem(EquationSystem(("x", "v"), drift), noise)
    assert even_moment(problem, 2).value / rate == pytest.approx(-0.0856994783178, abs=2e-13)
    assert transient(problem.system, noise) / default_step(problem.system, noise) == pytest.approx(888, abs=1)


def test_an_oscillator():
    drift = "v", "-x - 0.2*v + 0.1*x(t - 2*pi) + 0.1*xi*(x + x(t - 2*pi))"
    found = even_moment(Problem(EquationSystem(("x", "v"), drift), ITO), 2)
    assert math.exp(2 * math.pi * found.value) == pytest.approx(0.50268959725324, abs=2e-14)


@pytest.mark.parametrize(("w", "expected"), [(0.1, -0.0856994783178), (0.55, 0.0179434662942)])
def test_a_tool_that_turns(w, expected):
    assert even_moment(turning(1.0, w), 2).value == pytest.approx(expected, abs=1e-13)


@pytest.mark.parametrize(("speed", "w"), [(0.5, 0.2904437388), (1.0, 0.5257713774), (2.0, 0.1662835280)])
def test_where_stability_of_turning_ends(speed, w):
    found = even_moment(turning(speed, w), 2)
    assert abs(found.value) <= 5e-11 * abs(found.slope("system.w")[0]) + found.error


@pytest.mark.parametrize(("noise", "allowed"), [("xi", 1e-8), ("1e-20*xi*x", 1e-5)])
@pytest.mark.parametrize(("a", "b", "tau"), [(0.0, -1.0, 1.0), (-1.0, 0.5, 1.0), (-0.2, -1.0, 1.0), (-0.5, 2.0, 3.0)])
def test_without_noise_it_is_twice_the_rightmost_root(noise, allowed, a, b, tau):
    """s = a + b exp(−sτ), whose solution is Lambert's W; it has slopes, too, and hardly any noise changes nothing."""
    drift = (f"a*x + b*x(t - tau) + {noise}",)
    found = even_moment(Problem(EquationSystem(("x",), drift, (("a", a), ("b", b), ("tau", tau))), ITO), 2)
    s = max((a + lambertw(b * tau * math.exp(-a * tau), k) / tau for k in (-1, 0)), key=lambda each: each.real)
    fall = np.exp(-s * tau)
    assert abs(found.value - 2 * s.real) <= found.error <= allowed
    for key, slope in (("a", 1.0), ("b", fall), ("tau", -b * s * fall)):
        value, error = found.slope(f"system.{key}")
        assert abs(value - 2 * (slope / (1 + b * tau * fall)).real) <= error


@pytest.mark.parametrize("seed", [1, 2, 8, 10, 12, 14, 16, 18])
def test_a_discretised_segment_comes_nearer(seed):
    """At the order 1 under white noise, of up to four variables, and at a higher one under a chain."""
    is_near, line = compared(seed, (4, 8, 16))
    assert is_near, line


def test_several_delays_are_one_chain_of_parts():
    """x(t − 1), x(t − 2) and a delay of a part: the same with each of them alone, and as if they were one."""

    def value(rate: str) -> float:
        return even_moment(Problem(EquationSystem(("x",), (rate,)), ITO), 2).value

    one = value("-x + 0.3*x(t - 1) + 0.4*xi*x(t - 1)")
    assert value("-x + 0.3*x(t - 1) + 0.4*xi*x(t - 1) + 1e-18*x(t - 1/3)") == pytest.approx(one, abs=1e-13)
    two = value("-x + 0.3*x(t - 2) + 0.4*xi*x(t - 1)")
    assert two == pytest.approx(value("-2*x/2 + 0.3*x(t - 2) + 0.4*xi*x(t - 1) + 1e-18*x(t - 3)"), abs=1e-13)
    # without noise in common: Λ = 2a + b² exp(−Λτ) holds with two independent noises and two delays, too
    system = EquationSystem(
        ("x",), ("-2*x + eta*x(t - 1) + zeta*x(t - 1.5)",), noises=(("eta", "noise.eta"), ("zeta", "noise.zeta"))
    )
    found = even_moment(Problem(system, {"eta": ITO, "zeta": ITO}), 2).value
    assert found == pytest.approx(-4 + math.exp(-found) + math.exp(-1.5 * found), abs=1e-12)


@pytest.mark.parametrize("key", ["system.a", "system.b", "system.tau", "noise.s"])
def test_derivatives_of_one_variable(key):
    a, b, tau = -3.0, 1.5, 0.7
    problem = scalar(a, b, tau)
    estimate = sensitivities(problem, 2.0).moments[0][key]
    grown = of_scalar(a, b, tau)
    fall = math.exp(-grown * tau)
    by = {"a": 2.0, "b": 2 * b * fall, "tau": -(b**2) * grown * fall, "s": 2 * b**2 * fall}
    expected = by[key.partition(".")[2]] / (1 + tau * b**2 * fall)
    assert abs(estimate.value - expected) <= estimate.error_estimate
    assert estimate.error_estimate <= 1e-6 * abs(expected)


def test_stratonovich_is_another_drift():
    """A + ½α², B + ½αβ."""
    drift = "-x + 0.2*x(t - 1) + xi*(0.5*x + 0.3*x(t - 1))"
    found = even_moment(Problem(EquationSystem(("x",), (drift,)), White(s=1.0)), 2).value
    ito = f"{drift} + 0.125*x + 0.075*x(t - 1)"
    assert found == pytest.approx(even_moment(Problem(EquationSystem(("x",), (ito,)), ITO), 2).value, abs=1e-13)


def test_coloured_noise():
    drift = "v", "-(1 + 0.5*xi)*x - 0.2*v + 0.1*x(t - 2*pi)"
    problem = Problem(EquationSystem(("x", "v"), drift), OrnsteinUhlenbeck(alpha=1.0, sigma=0.8))
    found = even_moment(problem, 2, rtol=1e-7)
    assert abs(found.value + 0.1108973920228) <= found.error + 1e-13


def test_a_telegraph_signal():
    """Beside a discretised segment for each state."""
    noise, one = Telegraph(a=0.5, k=0.7), np.ones((1, 1))
    found = even_moment(Problem(EquationSystem(("x",), ("(-1 + xi)*x + 0.4*x(t - 1)",)), noise), 2)
    own = Segment([(0.0, -one), (1.0, 0.4 * one)], [(0.0, one)], [], noise.states, noise.rates, 12)
    assert abs(own.exponent(found.value + 0.5) - found.value) <= 1e-8


@pytest.mark.parametrize(("tau", "later"), [(0.5, 1.0), (0.5, 1.5), (2.0, 2.0)])
def test_a_telegraph_signal_relaxes_between_two_delays(tau, later):
    """dx = (−1 + ξ)x dt + (0.7x(t − τ₁) + 0.6x(t − τ₂))dW: E x² 1_i at three times is that at one, as dW is new."""
    noise, a, b, c = Telegraph(a=0.8, k=0.7), -1.0, 0.7, 0.6
    system = EquationSystem(
        ("x",),
        (f"(-1 + z)*x + w*({b}*x(t - {tau}) + {c}*x(t - {later}))",),
        noises=(("z", "noise.z"), ("w", "noise.w")),
    )
    xi, rates = np.diag(noise.states), np.array(noise.rates).T
    mean = expm((a * np.eye(2) + xi + rates) * (later - tau))

    def left(sigma):
        first, second = (math.exp(-sigma * each) * expm(rates * each) for each in (tau, later))
        both = math.exp(-sigma * later) * expm(rates * tau) @ mean
        steady = 2 * a * np.eye(2) + 2 * xi + rates
        return np.linalg.eigvals(steady + b**2 * first + c**2 * second + 2 * b * c * both).real.max() - sigma

    found = even_moment(Problem(system, {"z": noise, "w": ITO}), 2)
    assert abs(found.value - brentq(left, -5, 5, xtol=1e-14)) <= found.error + 1e-13


@pytest.mark.slow
@pytest.mark.parametrize(
    ("drift", "noise", "paths"),
    [
        ("-x + 0.4*x(t - 1) + 0.2*xi*(x + x(t - 0.5))", ITO, 8192),
        ("-x + 0.2*xi*x + 0.4*x(t - 1)", OrnsteinUhlenbeck(alpha=1.0, sigma=0.8), 5120),
    ],
)
def test_simulated_paths(drift, noise, paths):
    problem = Problem(EquationSystem(("x",), (drift,)), noise)
    (found,) = simulate(problem, 2.0, estimator="population", paths=paths, time=30.0).estimates
    assert abs(found.value - even_moment(problem, 2, rtol=1e-9).value) <= 4 * found.standard_error
    assert found.standard_error <= 5e-3


@pytest.mark.slow
def test_simulated_paths_lack_the_bias_of_their_step():
    """Of hardly any noise λ is the root of s = −1 + 0.4 e^(−s): a step alone is off by 3e-5."""
    problem = Problem(EquationSystem(("x",), ("-x + 0.4*x(t - 1) + 0.0001*xi*x",)), ITO)
    found = simulate(problem, (), estimator="direct", paths=1024, time=64.0, step=1 / 24)
    off = found.lyapunov_exponent - (lambertw(0.4 * math.e).real - 1)
    assert abs(off) <= 4 * found.lyapunov_exponent_error
    assert found.lyapunov_exponent_error <= 1e-5


def test_a_wave_that_forces_leaves_growth_alone():
    """Its angle repeats each root s of E x as s + iνk."""
    rates = ["-x - 0.3*v + 0.2*xi*x + 0.1*x(t - 2)" + more for more in ("", " + 0.3*cos(t)")]
    values = [even_moment(Problem(EquationSystem(("x", "v"), ("v", each)), ITO), 2).value for each in rates]
    assert values[1] == pytest.approx(values[0], abs=1e-12)


def test_steps_of_paths_divide_a_delay():
    with pytest.raises(ValueError, match=r"a third, a sixth, … of the delay, such as 0\.0098"):
        simulate(scalar(-2.0, 0.5, 1.0), 2.0, step=0.0101)


@pytest.mark.parametrize(
    ("drift", "told"),
    [
        ("-x + xi*x(t - x)", "may not depend on the state"),
        ("-x + xi*x(t - xi)", "may not depend on the state"),
        ("-x + xi*x(2*t)", "may not depend on the state"),
        ("-x + xi*x(t + 1)", "the delay is -1; must be > 0"),
        ("-x + xi*y(t - 1)", "y is none of the variables x"),
        ("-x**3 + xi*x(t - 1)", "must be of degree 1"),
    ],
)
def test_what_is_no_delay(drift, told):
    with pytest.raises(TableError, match=told):
        EquationSystem(("x",), (drift,))


def test_what_is_refused():
    with pytest.raises(NoSuchExponent, match=r"with a delay Λ\(2\) alone is found"):
        moment_lyapunov(scalar(-1.0, 1.0, 1.0), 4.0)
    with pytest.raises(NoHierarchy, match="must be multiples of one number"):
        even_moment(Problem(EquationSystem(("x",), ("-x + xi*x(t - 1) + x(t - pi)",)), ITO), 2)
    wall = {"at": "x = 0", "restitution": 0.8}
    from fpsolve.model import PlaneSystem

    with pytest.raises(TableError, match="none with a delay"):
        PlaneSystem.of_equations(("x", "v"), ("v", "-x + xi*x(t - 1)"), walls=[wall])
