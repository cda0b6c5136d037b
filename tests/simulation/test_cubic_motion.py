"""The motion of systems with terms of degree 3: against SciPy's integrator, and against that of the oscillator."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem, VibroImpactOscillator
from fpsolve.errors import FpsolveError
from fpsolve.simulation import simulated_response
from fpsolve.simulation.bounces import FREE, CubicMotion, DampedMotion, motion_of, move

RATES = "v", "-omega**2*x + epsilon**2*v*(c1 - c2*x**2 - c3*v**2) + epsilon*xi*v"
NUMBERS = {"omega": 1.3, "epsilon": 0.5, "c1": 0.4, "c2": 0.5, "c3": 0.2}
WALL = [{"at": "x = 0", "restitution": "exp(-epsilon**2*(1 - r))"}]
GENERAL = "v + 0.1*x - 0.2*x**3 - 0.1*x*v**2 + 0.3*xi*x", "-2*x + 0.2*v - 0.3*x**3 - 0.2*x**2*v - 0.1*v**3 - xi*x"
NOISE = OrnsteinUhlenbeck(alpha=2.0, sigma=1.5)


def moved(m, h, x, u, mean, rise, steps=1):
    x, u = np.array([float(x)]), np.array([float(u)])
    for _ in range(steps):
        move(m, h, x, u, np.array([mean]), np.array([rise]), np.empty(1), np.empty(1), np.empty(1, np.bool_))
    return float(x[0]), float(u[0])


@pytest.mark.parametrize("variables", [("x", "v"), ("v", "x")])
def test_equations_of_the_oscillator_have_its_motion(variables):
    rates = dict(zip(("x", "v"), RATES, strict=True))
    written = PlaneSystem.of_equations(
        variables, [rates[each] for each in variables], {**NUMBERS, "r": 0.9}, walls=WALL
    )
    motion, first = motion_of(written)
    oscillator, _ = motion_of(VibroImpactOscillator(**NUMBERS, restitution=0.9))
    assert isinstance(motion, DampedMotion)
    assert variables[first] == "x"
    unit = (1.0, 1.3)[first]  # amplitudes are in the unit of the first variable
    scales = np.array([1, 1, 1, 1 / unit**2, 1 / unit**2, 1])
    np.testing.assert_allclose(motion, scales * oscillator, rtol=1e-13)


@pytest.mark.slow
def test_both_forms_move_alike():
    """A force that is damping alone, as one and as the other; bounces are found to rounding."""
    damped, _ = motion_of(VibroImpactOscillator(**NUMBERS, restitution=0.9))
    linear, cubic = (0.0, 0.0, 0.0, damped.linear), (0.0, 0.0, 0.0, 0.0, 0.0, -damped.cubic, 0.0, -damped.rayleigh)
    sizes = damped.linear, damped.strength, math.hypot(damped.cubic, damped.rayleigh)
    general = CubicMotion(1.3, linear, (0.0, 0.0, 0.0, damped.strength), cubic, sizes, damped.bounce)
    states = [moved(each, 0.05, 0.7, -0.9, 0.4, 0.1, steps=200) for each in (damped, general)]
    np.testing.assert_allclose(*states, rtol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("names", [("x", "v"), ("v", "x")])
def test_without_a_wall_it_has_order_four(names):
    """Against SciPy's integrator with constant noise; (x, u) and (−x, −u) are one."""
    rates = dict(zip(("x", "v"), GENERAL, strict=True))
    system = PlaneSystem.of_equations(names, [rates[name] for name in names], {})
    motion, first = motion_of(system)
    assert (motion.bounce, names[first]) == (FREE, "x")

    def field(_, state):
        known = dict(zip(("x", "v"), state, strict=True), xi=0.7)
        return [eval(rate, {}, known) for rate in GENERAL]  # the texts are ours

    units = np.array([1.0, system.aspect])[[first, 1 - first]]
    start = np.array([0.5, 0.8])
    exact = solve_ivp(field, (0, 2), start, rtol=1e-12, atol=1e-12).y[:, -1]
    assert exact[0] < 0  # beyond x = 0
    errors = []
    for steps in (40, 80, 160):
        found = np.array(moved(motion, 2 / steps, *(start / units), 0.7, 0.0, steps)) * units
        errors.append(np.linalg.norm(found + exact))
    assert errors[-1] < 1e-6
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 3.7)


@pytest.mark.slow
def test_a_large_step_is_taken_in_parts():
    """At an amplitude where a whole step would be unstable."""
    motion, _ = motion_of(PlaneSystem.of_equations(("x", "v"), GENERAL, {}))
    whole, parts = moved(motion, 0.5, 30.0, 40.0, 0.0, 0.0), moved(motion, 0.5 / 64, 30.0, 40.0, 0.0, 0.0, 64)
    np.testing.assert_allclose(whole, parts, rtol=1e-3)


@pytest.fixture(scope="module")
def sides():
    """The responses with either order of the variables."""
    rates = dict(zip(("x", "v"), ("v", "-2*x + 0.2*v - 0.3*x**3 - 0.2*x**2*v - xi*x"), strict=True))
    systems = [
        PlaneSystem.of_equations(names, [rates[each] for each in names], {}) for names in (("x", "v"), ("v", "x"))
    ]
    setting = {"exponent": 0.2, "variance_rate": 0.1, "paths": 32, "time": 100.0, "step": 0.05, "seed": 1}
    return [simulated_response(Problem(system, NOISE), **setting) for system in systems]


@pytest.mark.slow
def test_densities_are_over_both_variables(sides):
    """Without a wall on both sides of 0, where it is one in all; the names are those of the variables."""
    for response, names in zip(sides, ("xv", "vx"), strict=True):
        first, second = names
        assert [*response.means] == [f"{first}_squared", f"{second}_squared", "amplitude"]
        assert response.impact_rate is None
        assert (response.x_edges[0], response.v_edges[0]) == (-response.x_edges[-1], -response.v_edges[-1])
        np.testing.assert_array_equal(response.density, response.density[::-1, ::-1])
        cell = np.diff(response.x_edges)[0] * np.diff(response.v_edges)[0]
        assert response.density.sum() * cell == pytest.approx(1 - response.outside, rel=1e-12)
        middle = (response.x_edges[1:] + response.x_edges[:-1]) / 2
        square = np.sum(response.density * middle[:, None] ** 2) * cell
        assert square == pytest.approx(response.means[f"{first}_squared"][0], rel=5e-3)
        found = response.to_xarray()
        assert found.density.dims == (first, second)
    (one, _), (other, error) = (response.means["x_squared"] for response in sides)
    assert one == pytest.approx(other, abs=4 * math.sqrt(2) * error)


def test_what_grows_is_refused():
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x + 0.2*v - 0.1*x**3 - xi*x"), {})
    with pytest.raises(FpsolveError, match="do not bring large amplitudes down"):
        simulated_response(Problem(system, NOISE), 0.1, 0.1, paths=32, time=1.0, step=0.1, seed=0)
