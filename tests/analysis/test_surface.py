"""λ and Λ(p) over one or two parameters by a reduced basis: against solves of their own, closed forms, differences."""

import numpy as np
import pytest

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, VibroImpactOscillator
from fpsolve.analysis import Surface
from fpsolve.arrays import identity
from fpsolve.errors import NotConverged
from fpsolve.model import Bounded, CoefficientMatrix, White
from fpsolve.model.noises.non_gaussian import ReducedNoise
from tests.conftest import sampled
from tests.random_planar import drawn

OSCILLATOR = Problem(
    VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.7), OrnsteinUhlenbeck(alpha=2.0, sigma=1.0)
)
MATHIEU = Problem(
    PlaneSystem.of_equations(
        ("x", "v"),
        ("v", "-2*b*v - (1 + load + shake)*x"),
        {"b": 0.1},
        noises={"load": "noise.load", "shake": "noise.shake"},
    ),
    {"load": Bounded(0.4, 2.0, 0.2), "shake": White(0.2)},
)
FRAMES = {
    "oscillator": (OSCILLATOR, {"oscillator.omega": (0.6, 2.0), "noise.sigma": (0.3, 1.5)}),
    "tilted and logarithmic": (OSCILLATOR, {"noise.alpha": (0.5, 5.0, "log"), "oscillator.c1": (-0.2, 0.4)}),
    "one": (OSCILLATOR, {"oscillator.restitution": (0.6, 1.0)}),
    "two noises": (MATHIEU, {"noise.load.nu": (1.5, 2.4), "system.b": (0.02, 0.2)}),
}


def points(surface, count):
    rng = np.random.default_rng(1)
    return [np.asarray(axis.value(rng.uniform(0, 1, count))) for axis in surface.axes]


@pytest.mark.parametrize("p", sampled(0.0, 2.0, -0.7, keep=2))
@pytest.mark.parametrize("name", sampled(*FRAMES, keep=2))
def test_between_the_nodes_against_solves(name, p):
    problem, ranges = FRAMES[name]
    surface = Surface(problem, ranges, p, rtol=1e-5)
    assert surface.is_converged
    values = points(surface, 5)
    for theta, value in zip(zip(*values, strict=True), surface(*values), strict=True):
        solver = ExponentSolver(problem.at(dict(zip(ranges, map(float, theta), strict=True))), rtol=1e-8)
        if p:
            solution = solver.solution(p)
            exact, doubt = solution.pair.value, solution.error
        else:
            exponent = solver.lyapunov_exponent()
            exact, doubt = exponent.value, exponent.error_estimate
        assert abs(value - exact) <= surface.error + doubt


def test_the_growth_rate_is_affine_in_the_logarithm_of_the_impact_factor():
    """λ = λ₀ + N ln R, whatever the noise: N is the slope at every R."""
    surface = Surface(OSCILLATOR, {"oscillator.restitution": (0.6, 1.0)}, rtol=1e-7)
    r = np.linspace(0.6, 1.0, 9)
    log_factor = np.array(
        [OSCILLATOR.at({"oscillator.restitution": float(each)}).system.jumps[0].log_factor for each in r]
    )
    steps = np.diff(surface(r)) / np.diff(log_factor)
    assert np.ptp(steps) <= 4 * surface.error / np.min(np.diff(log_factor))


@pytest.mark.parametrize("p", [0.0, pytest.param(1.3, marks=pytest.mark.slow)])
def test_the_gradient_is_that_of_the_values(p):
    surface = Surface(OSCILLATOR, {"noise.alpha": (0.5, 5.0, "log"), "oscillator.c1": (-0.2, 0.4)}, p, rtol=1e-6)
    alpha, c1, step = np.array([0.9, 3.0]), np.array([0.1, -0.1]), 1e-4
    gradient = surface.gradient(alpha, c1)
    by_alpha = (surface(alpha * (1 + step), c1) - surface(alpha * (1 - step), c1)) / (2 * step * alpha)
    by_c1 = (surface(alpha, c1 + step) - surface(alpha, c1 - step)) / (2 * step)
    np.testing.assert_allclose(gradient, np.stack([by_alpha, by_c1], axis=-1), rtol=1e-5, atol=1e-8)


def test_shapes_and_labels():
    surface = Surface(OSCILLATOR, {"oscillator.omega": (0.6, 2.0), "noise.sigma": (0.3, 1.5)}, 2.0, rtol=1e-4)
    assert surface(1.0, 1.0).shape == ()
    assert surface([[0.7, 0.8, 0.9]], [[0.5], [1.0]]).shape == (2, 3)
    grid = surface.to_xarray(11)
    assert grid["moment"].dims == ("oscillator.omega", "noise.sigma")
    assert float(grid["moment"].sel({"oscillator.omega": 0.6, "noise.sigma": 1.5})) == pytest.approx(
        float(surface(0.6, 1.5))
    )
    assert grid.attrs["error"] == surface.error


@pytest.mark.parametrize(
    ("ranges", "told"),
    [
        ({"oscillator.omega": (2.0, 0.6)}, "must be start < stop"),
        ({"oscillator.mass": (0.6, 2.0)}, "the parameters are oscillator.omega"),
        ({}, "must be one or two"),
    ],
)
def test_what_is_no_frame_is_refused(ranges, told):
    with pytest.raises(ValueError, match=told):
        Surface(OSCILLATOR, ranges)


def test_no_value_outside_of_the_ranges():
    surface = Surface(OSCILLATOR, {"oscillator.omega": (0.9, 1.1)}, rtol=1e-4)
    with pytest.raises(ValueError, match=r"oscillator\.omega must lie in \[0\.9, 1\.1\]; make a wider surface"):
        surface(1.2)


def test_three_variables_have_no_surface():
    problem = Problem(
        PlaneSystem.of_equations(("x", "v"), ("-x + xi*v", "v*(-0.5 + xi)"), {}),
        OrnsteinUhlenbeck(alpha=1.0, sigma=1.0),
    )
    with pytest.raises(NotConverged, match=r"there is no surface over noise\.sigma"):
        Surface(problem, {"noise.sigma": (0.5, 1.0)})


def assert_right(surface, count=6):
    """Values within the error, against solves of their own."""
    values = points(surface, count)
    for theta, value in zip(zip(*values, strict=True), surface(*values), strict=True):
        keys = [axis.key for axis in surface.axes]
        problem = surface.problem.at(dict(zip(keys, map(float, theta), strict=True)))
        solution = ExponentSolver(problem).solution(surface.p)
        assert abs(value - solution.pair.value) <= surface.error + solution.error


def mathieu(b, s):
    equation = "-2*b*v - (1 + load + shake)*x"
    names = {"load": "noise.load", "shake": "noise.shake"}
    system = PlaneSystem.of_equations(("x", "v"), ("v", equation), {"b": b}, noises=names)
    return Problem(system, {"load": Bounded(0.4, 2.0, 0.0), "shake": White(s)})


def test_in_a_tongue_two_of_three_real_eigenvalues_of_the_mean_square_are_none():
    """There E x², E xv, E v² have three real multipliers, of which those of the basis are close to all."""
    surface = Surface(mathieu(0.03, 0.1), {"noise.load.nu": (0.6, 2.6), "noise.load.mu": (0.05, 0.5)}, 2.0, rtol=1e-4)
    nu, mu = (1.8916666666666666, 1.8916666666666666, 1.9125, 1.9229166666666666), (0.246875, 0.25625, 0.36640625, 0.35)
    for one, other, value in zip(nu, mu, surface(nu, mu), strict=True):
        problem = surface.problem.at({"noise.load.nu": one, "noise.load.mu": other})
        solution = ExponentSolver(problem, rtol=1e-6).solution(2.0)
        assert abs(value - solution.pair.value) <= surface.error + solution.error


def test_coordinates_are_held():
    """Those in which a saddle moves least change from one strength of the noise to another."""
    terms = [
        CoefficientMatrix(0, ((-6.1e-4, -0.55), (7e-7, 3.7e-3))),
        CoefficientMatrix(1, ((0.36, 166.0), (2.2e-3, -0.085)), identity),
    ]
    problem = Problem(PlaneSystem(terms), White(0.07))
    surface = Surface(problem, {"noise.s": (0.03, 0.15), "system.epsilon": (0.4, 2.7)}, 2.0, rtol=1e-5)
    assert len(surface.nodes) < 20
    assert_right(surface)


def test_an_operator_that_is_no_product_in_few_lines():
    """R^p with a restitution that moves with ε."""
    ranges = {"oscillator.restitution": (0.4, 1.0), "oscillator.epsilon": (0.2, 0.6)}
    assert_right(Surface(OSCILLATOR, ranges, 3.0, rtol=1e-6))


def test_a_basis_of_the_whole_space():
    """White noise alone has few functions: what they make already is not taken again."""
    system = PlaneSystem.of_equations(("x", "v"), ("v", "-x - 0.1*v + n*x"), noises={"n": "noise"})
    assert_right(Surface(Problem(system, White(0.3)), {"noise.s": (0.05, 3.0)}, 1.0, rtol=1e-9))


@pytest.mark.parametrize(
    ("seed", "p", "ranges", "shares"),
    [
        pytest.param(
            204,
            3.0,
            {"noise.b.nu": (2.946, 23.14), "noise.b.sigma": (2.165, 11.18)},
            [(0.001, 0.42), (0.701, 0.315)],
            marks=pytest.mark.slow,
        ),
        (
            212,
            1.0,
            {"system.epsilon": (0.511, 1.957), "noise.sigma": (0.0943, 0.5384)},
            [(0.236, 0.32), (0.049, 0.217), (0.06, 0.277)],
        ),
    ],
)
def test_larger_real_eigenvalues_of_the_small_pencil_are_left_out(seed, p, ranges, shares):
    """Also those with T > 0 whose residuals are small."""
    surface = Surface(drawn(seed).problem, ranges, p, rtol=1e-5)
    for at in shares:
        theta = {axis.key: float(axis.value(share)) for axis, share in zip(surface.axes, at, strict=True)}
        solution = ExponentSolver(surface.problem.at(theta), rtol=1e-7).solution(p)
        assert abs(surface(*theta.values()) - solution.pair.value) <= surface.error + solution.error


def test_the_most_is_left_at_an_edge():
    """Between two corners, more than anywhere inside."""
    system = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.5)
    problem = Problem(system, ReducedNoise(D0=0.5, tau0=0.5, r0=0.95))
    ranges = {"noise.D0": (0.1, 1.0, "log"), "oscillator.omega": (0.5, 3.0)}
    surface = Surface(problem, ranges, 4.0, rtol=5e-7)
    solution = ExponentSolver(problem.at({"noise.D0": 0.63, "oscillator.omega": 0.5})).solution(4.0)
    assert abs(surface(0.63, 0.5) - solution.pair.value) <= surface.error + solution.error
