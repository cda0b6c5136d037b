"""Densities, excursions, sensitivities, designs and uncertain parameters: closed forms, identities, differences."""

import math
import re

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import norm

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    NotConverged,
    OrnsteinUhlenbeck,
    Problem,
    VibroImpactOscillator,
    design,
    lyapunov_exponent,
    make_mesh,
    moment_lyapunov,
    sensitivities,
    stability_index,
    stationary_density,
    tilted_density,
)
from fpsolve.analysis import (
    Axis,
    Law,
    adjoint_density,
    excursion,
    latin_hypercube,
    laws_of,
    uncertainty,
)
from fpsolve.exponent import Budget, impact_rate
from fpsolve.model import Bounded, Telegraph, White
from tests.conftest import FIG1, FIG1_NOISE, sampled
from tests.kit import matrices, rates
from tests.numbers.rows.densities import UNITS, modes
from tests.numbers.rows.excursions import BOUNCING, spring, states
from tests.oracles.paths import chain_paths

STRONG = Problem(
    VibroImpactOscillator(omega=1.0, restitution=0.7, c1=-0.2, epsilon=1.0, impact="restitution"),
    OrnsteinUhlenbeck(alpha=1.0, sigma=0.7),
)
DENSITIES = {
    "weak": (Problem(FIG1, FIG1_NOISE.ou_reduction()), {}),
    "exact": (Problem(FIG1, FIG1_NOISE), {}),
    "full circle": (Problem(FIG1, FIG1_NOISE.ou_reduction()), {"full_circle": True}),
    "strong": (STRONG, {"phi_cells": 4}),
    "square-root ends": (
        Problem(
            VibroImpactOscillator(omega=2.0, restitution=0.6, c1=0.2, epsilon=0.5),
            NonGaussianNoise(D0=0.5, tau0=1.0, r0=-1.0),
        ),
        {},
    ),
}


@pytest.fixture(params=DENSITIES, scope="module")
def solver(request):
    problem, mesh = DENSITIES[request.param]
    return ExponentSolver(problem, make_mesh(**mesh))


def flows(problem):
    """φ̇ and the growth of ln a of the oscillator between impacts."""
    epsilon, system = problem.system.epsilon, problem.system
    turn = lambda phi, xi: system.omega + epsilon * system.terms[1].h(phi) * xi + epsilon**2 * system.terms[2].h(phi)  # noqa: E731
    grow = lambda phi, xi: epsilon * system.terms[1].q(phi) * xi + epsilon**2 * system.terms[2].q(phi)  # noqa: E731
    return turn, grow


def test_stationary_density_is_one_of_the_phase_and_of_the_noise(solver):
    density, noise = stationary_density(solver.pair(0.0)), solver.problem.noise
    assert density.mean(lambda phi, xi: 1.0) == pytest.approx(1, abs=1e-13)
    assert density.phi_marginal() @ density.phi_weights == pytest.approx(1, abs=1e-13)
    assert density.phi_weights.sum() == pytest.approx(2 * np.pi)
    assert density.phi_weights @ density.phi == pytest.approx(2 * np.pi**2)
    assert np.all(np.diff(density.phi) > 0)
    assert 0 <= density.phi[0] < 0.1 < 2 * np.pi - 0.1 < density.phi[-1] < 2 * np.pi
    expected = noise.density(density.xi)
    np.testing.assert_allclose(density.xi_marginal(), expected, rtol=0, atol=1e-10 * expected.max())
    assert density.mean(lambda phi, xi: xi**2) == pytest.approx(noise.standard_deviation**2, rel=1e-10)


@pytest.mark.parametrize("p", [0.0, 2.0])
def test_adjoint_density_is_an_eigenfunction_where_functions_vanish_at_walls(solver, p):
    """∫ T* (φ̇w′ + pqw) = Λ ∫ T* w for w = cos²φ f(φ), which no impact sees."""
    pair, (turn, grow) = solver.pair(p), flows(solver.problem)
    density = adjoint_density(pair)
    assert density.mean(lambda phi, xi: 1.0) == pytest.approx(1, abs=1e-13)
    for k, shift in ((0, 0.0), (2, 0.3)):
        w = lambda phi, k=k, s=shift: np.cos(phi) ** 2 * np.cos(k * phi + s)  # noqa: E731
        slope = lambda phi, k=k, s=shift: (  # noqa: E731
            -np.sin(2 * phi) * np.cos(k * phi + s) - k * np.cos(phi) ** 2 * np.sin(k * phi + s)
        )
        change = density.mean(lambda phi, xi, w=w, s=slope: turn(phi, xi) * s(phi) + p * grow(phi, xi) * w(phi))
        assert change == pytest.approx(pair.value * density.mean(lambda phi, xi, w=w: w(phi)), abs=2e-7)


def test_mean_growth_and_impacts_are_the_slope_at_zero(solver):
    """λ = ∫(ε q₁ξ + ε² q₂) ρ dφ dξ + N ln R, Eq. (2)."""
    pair, jump = solver.pair(0.0), solver.problem.linear.jumps[0].log_factor
    found = stationary_density(pair).mean(flows(solver.problem)[1]) + jump * impact_rate(solver).value
    scale = max(abs(pair.derivative), solver.problem.system.epsilon**2)
    assert found == pytest.approx(pair.derivative, abs=1e-10 * scale)


@pytest.mark.parametrize(("p", "mesh"), [(-1.0, {}), (2.0, {"full_circle": True})])
def test_tilted_mean_of_the_growth_is_the_slope(p, mesh):
    """Λ′(p) = E_tilted[ε q₁ξ + ε² q₂] without impacts."""
    system = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.1, epsilon=0.2)
    pair = ExponentSolver(Problem(system, FIG1_NOISE.ou_reduction()), make_mesh(**mesh)).pair(p)
    density = tilted_density(pair)
    assert density.mean(flows(pair.generator.problem)[1]) == pytest.approx(pair.derivative, rel=1e-10)
    assert density.mean(lambda phi, xi: 1.0) == pytest.approx(1, abs=1e-13)


def test_tilt_moves_the_noise_towards_the_sign_of_p():
    own = ExponentSolver(DENSITIES["weak"][0])
    means = [tilted_density(own.pair(p)).mean(lambda phi, xi: xi) for p in (-2.0, 0.0, 2.0)]
    assert means[0] < -0.01 < 0.01 < means[2]
    assert means[1] == pytest.approx(0, abs=1e-12)
    assert np.all(adjoint_density(own.pair(2.0)).values >= 0)


def turning(coordinates):
    """‖y‖ falls as exp(−0.1t) and its directions are uniform, in coordinates x = Gy."""
    turns = [each - each.T for each in np.random.default_rng(3).standard_normal((3, 3, 3))]
    turns[0] = turns[0] - 0.1 * np.eye(3)
    steady, *loads = ((coordinates @ each @ np.linalg.inv(coordinates)).tolist() for each in turns)
    return matrices(steady, loads, [White(s=1.0), White(s=0.5)])


@pytest.mark.slow
@pytest.mark.parametrize("p", [0.0, 1.5])
def test_densities_of_an_isotropic_system_are_uniform_in_its_own_coordinates(p):
    """T T* is 1/(|S| |det G| ‖G⁻¹e‖³) for any p, and T* goes as ‖G⁻¹e‖⁻³⁻ᵖ."""
    coordinates = np.eye(3) + 0.4 * np.random.default_rng(7).uniform(-1, 1, (3, 3))
    pair = ExponentSolver(turning(coordinates), rtol=1e-3).pair(p)
    for density, power in ((tilted_density(pair), 3), (adjoint_density(pair), 3 + p)):
        turn, height = density.grid.first[:, None], density.grid.second
        e = np.stack([np.cos(turn) * np.cos(height), np.sin(turn) * np.cos(height), 0 * turn + np.sin(height)])
        exact = np.linalg.norm(np.tensordot(np.linalg.inv(coordinates), e, 1), axis=0) ** -power
        exact = exact / density.grid.integral(exact)
        assert 0.5 * density.grid.integral(np.abs(density.values - exact)) < density.error + 1e-3 < 0.03
        assert density.mean(lambda x, y: 0 * (x + y) + 1) == pytest.approx(1, abs=1e-9)
        assert density.negative_share() == 0


@pytest.mark.slow
def test_share_of_a_mode_is_the_same_in_all_coordinates_of_a_user():
    """In modes, and where the rates are divided by their frequencies already."""
    found = [tilted_density(ExponentSolver(modes(White(s=1.0), *each), rtol=1e-3).pair(1.0)) for each in ((), (UNITS,))]
    shares = [float(each.to_xarray().mean_share) for each in found]
    np.testing.assert_allclose(shares, shares[0], rtol=1e-2)
    data = found[0].to_xarray()
    assert data.density.dims == ("eta", "phase_difference")
    assert found[0].plot().viewLim.extents == pytest.approx(np.array([0, 0, 0.5, 2]) * np.pi)
    assert data.attrs["total_variation_error"] == found[0].error


LEVELS = np.array([2.0, 4.0, 8.0, 16.0, 32.0])


def test_bounds_of_excursions_enclose_a_finer_solve():
    system = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=-1.0, epsilon=0.3)
    problem = Problem(system, NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.9))
    rough, fine = (excursion(problem, rtol=rtol) for rtol in (1e-5, 1e-10))
    for name in ("lower", "upper", "upcrossings"):
        one, other = getattr(rough, name), getattr(fine, name)
        assert abs(one.value - other.value) <= one.error_estimate + other.error_estimate
    widest, narrow = rough.bounds(LEVELS), fine.bounds(LEVELS)
    assert np.all(widest[0] <= narrow[0] * (1 + 1e-9))
    assert np.all(narrow[1] <= widest[1] * (1 + 1e-9))
    assert np.all(narrow[0] <= fine.lower.value * LEVELS**-fine.stability_index.value)
    assert fine.expected_upcrossings(3.0) == pytest.approx(fine.upcrossings.value * 3.0**-fine.stability_index.value)
    assert fine.to_xarray([2.0, 3.0]).least_probable.dims == ("level",)


@pytest.mark.parametrize(
    ("problem", "words", "bounds"),
    [
        (spring(0.01), "", (1, 1)),  # it grows
        (spring(noise=White(s=0.02)), "", (0, 1)),
        (rates("x' = -0.5*x + xi*x; y' = -y + xi*y", Telegraph(a=0.8, k=1.0)), "phase", (0, 1)),
        (rates("x' = y - 0.2*x + xi*x; y' = -x - 0.2*y + xi*y", OrnsteinUhlenbeck(1.3, 0.8)), "bound", (0, 1)),
        pytest.param(modes(White(s=0.5)), "variables", (0, 1), marks=pytest.mark.slow),
    ],
)  # fmt: skip
def test_excursions_say_what_is_not_known(problem, words, bounds):
    found = excursion(problem, rtol=1e-2 if problem.dimension > 2 else 1e-8)
    assert found.is_certain == (bounds[0] == 1)
    assert all(re.search(words, each) for each in found.notes)
    assert bool(found.notes) == (not found.is_certain)
    for value, bound in zip(bounds, found.bounds(LEVELS), strict=True):
        assert np.all(bound == value)


def test_excursions_at_a_border_of_stability_are_left_open():
    border = brentq(lambda zeta: lyapunov_exponent(spring(zeta)).value, 0.04, 0.06, xtol=1e-15)
    found = excursion(spring(border))
    assert len(found.notes) == 1
    assert not found.is_certain
    with pytest.raises(NotConverged, match="budget"):
        excursion(spring(noise=Bounded(mu=1.0, nu=0.0, sigma=1.0)), budget=Budget(unknowns=100))


@pytest.mark.slow
def test_simulated_paths_exceed_a_level_within_the_bounds():
    """With impacts; the number of upcrossings is near C A^−δ_p."""
    found, system = excursion(BOUNCING), BOUNCING.system
    delta = found.stability_index.value
    factor = math.exp(system.jumps[0].log_factor)
    tops, mean, error = chain_paths(states(BOUNCING, 0.9), 0.6, delta, LEVELS, paths=10_000, factor=factor)
    low, high = found.bounds(LEVELS)
    share = np.mean(tops[:, None] >= np.log(LEVELS), axis=0)
    doubt = np.sqrt(share * (1 - share) / tops.size)
    assert np.all((low - 4 * doubt <= share) & (share <= high + 4 * doubt))
    assert np.all(np.abs(mean - found.expected_upcrossings(LEVELS))[1:] <= 4 * error[1:])


HIGH = 1e-11


def oscillator(noise, **values):
    own = {"omega": 1.1, "restitution": 0.7, "c1": 0.2, "epsilon": 0.9}
    return Problem(VibroImpactOscillator(**{**own, **values}), noise)


FREE_OF_WALLS = oscillator(OrnsteinUhlenbeck(0.8, 0.9), omega=1.0, restitution=1.0, c1=0.3, epsilon=0.7)
EXACT = NonGaussianNoise(D0=0.8, tau0=0.6, r0=0.4)


def of_moment(p):
    return lambda problem: float(moment_lyapunov(problem, p, rtol=HIGH).value[0])


SUMMARY_NUMBERS = {
    "lyapunov_exponent": lambda problem: lyapunov_exponent(problem, rtol=HIGH).value,
    "stability_index": lambda problem: stability_index(problem, rtol=HIGH).value,
    "variance_rate": lambda problem: ExponentSolver(problem, rtol=HIGH).variance_rate().value,
}


def difference(problem, key, value):
    """A central difference of fourth order."""
    h = 1e-4 * max(abs(problem.values[key]), 0.1)
    values = [value(problem.at({key: problem.values[key] + k * h})) for k in (-2, -1, 1, 2)]
    return np.dot(values, [1, -8, 8, -1]) / (12 * h)


def test_index_of_two_parts_that_do_not_mix_has_no_sensitivities():
    """ẋ = v, v̇ = −ξv: Λ(p) = max(0, ½ p² s²), of which δ_p = 0 is where both parts have λ = 0."""
    found = sensitivities(rates("x' = v; v' = -xi*v", White(s=0.2)), 2.0, rtol=1e-4)
    assert "stability_index" not in {name for name, slopes in found.summary_numbers.items() if slopes}
    assert any("δ_p" in str(note) and "do not mix" in str(note) for note in found.notes)


@pytest.mark.parametrize(
    ("problem", "keys"),
    [
        *sampled(
            (oscillator(EXACT.ou_reduction(), c1=-0.4), ("noise.tau0",)),
            (oscillator(EXACT, c1=-0.4, epsilon=0.3), ("oscillator.restitution", "noise.r0")),
            (
                oscillator(OrnsteinUhlenbeck(1.0, 1.0), omega=1.0, restitution=1.0, c1=-0.05, epsilon=0.01),
                ("oscillator.c1",),
            ),
            keep=0,
        ),
    ],
)  # fmt: skip
def test_sensitivities_of_indices_are_differences(problem, keys):
    """The last has δ_p near 0, which takes ∂Λ/∂θ / p from its derivatives at p = 0."""
    told = []
    found = sensitivities(problem, rtol=HIGH, progress=lambda: told.append(1)).summary_numbers
    assert len(told) == len(found) == 3
    for name, value in SUMMARY_NUMBERS.items():
        for key in keys:
            assert found[name][key].value == pytest.approx(difference(problem, key, value), rel=1e-5, abs=1e-9), (
                name,
                key,
            )


def test_sensitivities_of_the_exact_moment_and_of_units():
    """Without walls Λ(−2) = ε²(S(0)/2 − c₁); Λ is homogeneous in rates, of which τ₀ is one over a time (Euler)."""
    [found] = sensitivities(FREE_OF_WALLS, -2.0, rtol=HIGH).moments
    at_rest, square = (0.9 / 0.8) ** 2, 0.7**2
    exact = {
        "oscillator.omega": 0.0,
        "oscillator.c1": -square,
        "oscillator.epsilon": 1.4 * (at_rest / 2 - 0.3),
        "noise.alpha": -square * at_rest / 0.8,
        "noise.sigma": square * at_rest / 0.9,
    }
    for key, value in exact.items():
        assert found[key].value == pytest.approx(value, abs=1e-9), key
    [none, found] = sensitivities(oscillator(EXACT), [0.0, 1.7], rtol=HIGH).moments
    assert {each.value for each in none.values()} == {0.0}
    theta = oscillator(EXACT).values
    keys = {"oscillator.omega": 1, "oscillator.c1": 1, "noise.D0": 1, "noise.tau0": -1}
    total = sum(sign * theta[key] * found[key].value for key, sign in keys.items())
    assert total == pytest.approx(of_moment(1.7)(oscillator(EXACT)), rel=1e-8)


@pytest.mark.slow
def test_sensitivities_of_the_exponent_under_algebraic_tails_are_within_their_errors():
    problem = oscillator(NonGaussianNoise(D0=0.6, tau0=0.8, r0=1.1), restitution=0.8)
    found, finer = (sensitivities(problem, [], rtol=rtol).summary_numbers["lyapunov_exponent"] for rtol in (1e-7, 1e-8))
    for key, estimate in found.items():
        assert abs(estimate.value - finer[key].value) <= estimate.error_estimate + finer[key].error_estimate, key
    expected = difference(problem, "noise.r0", lambda each: lyapunov_exponent(each).value)
    assert found["noise.r0"].value == pytest.approx(expected, rel=1e-4)


def test_a_finer_mesh_beyond_the_budget_costs_the_sensitivities_that_need_it_alone():
    problem = oscillator(NonGaussianNoise(D0=0.5, tau0=1.0, r0=1.2), omega=1.0, restitution=0.8, c1=0.1, epsilon=0.3)
    budget = Budget(unknowns=ExponentSolver(problem, rtol=1e-3).pair(0.0).generator.size)
    found = sensitivities(problem, [], rtol=1e-3, budget=budget)
    assert "lyapunov_exponent" not in found.summary_numbers
    assert any("Λ(0) was not found on a finer mesh: it needs" in note for note in found.notes)


UNIFORM = "x' = a*x + y + xi*x; y' = -x + a*y + xi*y"


def uniform(a=-0.3, sigma=0.5, alpha=0.8):
    """ẋ = (J + a + ξ) x: the phase turns uniformly, and Λ(p) = pa + p² S(0)/2 with S(0) = σ²/α²."""
    return rates(UNIFORM, OrnsteinUhlenbeck(alpha, sigma), a=a)


REST = 0.5**2 / 0.8**2
SQUARE = rates("x' = b**2*x + y + xi*x; y' = -x + b**2*y + xi*y", OrnsteinUhlenbeck(1.0, 0.4), b=0.9)


@pytest.mark.parametrize(
    ("problem", "target", "axis", "value"),
    [
        (uniform(), "stability_index = 1", Axis("system.a", -2.0, 0.0), -0.5 * REST),
        (uniform(), "stability_index = 3", Axis("noise.sigma", 0.01, 4.0), math.sqrt(0.2) * 0.8),
        (uniform(), "stability_index = 3", Axis("noise.alpha", 0.05, 40.0, "log"), 0.5 / math.sqrt(0.2)),
        (uniform(), "stability_index = -0.5", Axis("system.a", -2.0, 2.0), 0.25 * REST),
        (uniform(), "moment(2) = 0", Axis("noise.sigma", 0.01, 4.0), math.sqrt(0.3) * 0.8),
        (uniform(), "moment(-1.5) = 0.7", Axis("system.a", -2.0, 2.0), -(0.7 - 1.125 * REST) / 1.5),
        (uniform(), "lyapunov_exponent = 0.25", Axis("system.a", -2.0, 2.0), 0.25),
        (uniform(), "stability_index = 0", Axis("system.a", -2.0, 1.0), 0.0),
        (uniform(), "moment(2) = 0", "system.a", -REST),  # half to twice its value
        (  # between two points of a scan
            SQUARE, f"moment(2) = {2 * 0.4**2 + 2e-4}", Axis("system.b", -0.93, 1.0), 1e-2
        ),
        (  # a phase that stays on a ray
            rates("x' = a*x + xi*x; y' = 0.3*x - y + xi*y", OrnsteinUhlenbeck(1.0, 1.0), a=0.1),
            "moment(2) = 1", Axis("system.a", -1.0, 1.0), -0.5,
        ),
        (  # three variables
            rates(f"{UNIFORM}; z' = (a - 1)*z + xi*z", OrnsteinUhlenbeck(0.8, 0.5), a=-0.3),
            "moment(2) = 0", Axis("system.a", -1.0, 0.0), -REST,
        ),
    ],
)  # fmt: skip
def test_design_of_one_parameter_has_the_value_of_the_closed_form(problem, target, axis, value):
    found = design(problem, target, axis)
    [(key, estimate)] = found.values.items()
    found_there = abs(estimate.value) if problem is SQUARE else estimate.value
    assert found_there == pytest.approx(value, abs=1e-8)
    assert abs(found_there - value) <= 10 * estimate.error_estimate + 1e-8
    assert found.found.value == pytest.approx(found.target.value, abs=1e-9)
    assert (found.found.scale == 1) == target.startswith("stability_index")  # other numbers have a unit
    assert found.problem.values[key] == estimate.value
    assert found.solves <= (12 if problem is not SQUARE else 60)


@pytest.mark.parametrize(
    ("problem", "target", "axis", "data"),
    [
        (uniform(), "stability_index = 9", Axis("system.a", -1.0, 0.0), {"side": "δ_p < 9"}),
        (uniform(), "moment(2) = 9", Axis("system.a", -1.0, 0.0), {"least": 2 * REST - 2, "most": 2 * REST}),
        pytest.param(
            SQUARE, f"moment(2) = {2 * 0.4**2 - 1e-3}", Axis("system.b", -0.93, 1.0), {"least": 0.32, "most": 2.32},
            marks=pytest.mark.slow,
        ),
    ],
)  # fmt: skip
def test_design_tells_what_is_not_reached(problem, target, axis, data):
    found = design(problem, target, axis)
    assert not found
    assert "nearest at system." in found.reason
    for name, value in data.items():
        assert found.reason.data[name] == (value if name == "side" else pytest.approx(value, abs=1e-6))


@pytest.mark.parametrize("a", sampled(-0.3, -0.05))
def test_design_of_two_parameters_is_the_nearest_point(a):
    """δ_p = 1 is a = −σ²/(2α²), along which the distance is minimised."""
    found = design(uniform(a=a), "stability_index = 1", [Axis("system.a", -2.0, 2.0), Axis("noise.sigma", 0.01, 4.0)])
    distance = lambda sigma: math.hypot((-(sigma**2) / (2 * 0.8**2) - a) / a, (sigma - 0.5) / 0.5)  # noqa: E731
    best = minimize_scalar(distance, bounds=(0.01, 4.0), method="bounded", options={"xatol": 1e-10})
    assert found.distance == pytest.approx(best.fun, rel=1e-9)
    assert found.values["noise.sigma"].value == pytest.approx(best.x, rel=1e-6)
    assert found.found.value == pytest.approx(1.0, abs=1e-9)


def test_design_heeds_the_ends_of_ranges():
    """δ_p = 1 is a = −σ²/(2α²): where σ may not fall as far as it should, a does the rest."""
    found = design(uniform(), "stability_index = 1", [Axis("system.a", -1.0, 0.0), Axis("noise.sigma", 0.6, 2.0)])
    assert found.values["noise.sigma"].value == 0.6
    assert found.values["system.a"].value == pytest.approx(-0.5 * 0.6**2 / 0.8**2, abs=1e-9)


@pytest.mark.slow
def test_design_stays_where_there_is_a_moment():
    """For r₀ > 1 there is no Λ(2), where the first step leads: the nearest point is that of a narrower range."""
    system = VibroImpactOscillator(epsilon=0.3, omega=1.0, restitution=0.9, c1=0.1)
    problem = Problem(system, NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.9))
    other = Axis("noise.tau0", 0.3, 0.8)
    wide, narrow = (design(problem, "moment(2) = 0.0708", [Axis("noise.r0", 0.5, end), other]) for end in (1.3, 1.0))
    assert wide.distance == pytest.approx(narrow.distance, rel=1e-7)
    assert wide.solves <= 30


def test_uncertainty_of_independent_parameters():
    """∂Λ/∂a = p, ∂Λ/∂σ = p²σ/α², ∂Λ/∂α = −p²σ²/α³; a number is a share of the value."""
    found = uncertainty(uniform(), {"system.a": 0.1, "noise.sigma": 0.04, "noise.alpha": {"sd": 0.03}}, 2.0)
    deviation = math.hypot(2 * 0.1 * 0.3, 4 * REST * 0.04, 4 * REST / 0.8 * 0.03)
    assert found.moments[0].deviation == pytest.approx(deviation, rel=1e-7)
    assert found.moments[0].below == pytest.approx(norm.cdf((0.6 - 2 * REST) / deviation), abs=1e-7)
    data = found.to_xarray()
    assert float(data.moment_high[0] - data.moment_low[0]) == pytest.approx(2 * norm.ppf(0.975) * deviation)
    assert "95%" in repr(found)


def test_a_latin_hypercube_has_a_value_in_each_part_of_each_cut_normal_law():
    laws = laws_of(uniform(), {"noise.sigma": 0.4, "system.a": {"sd": 0.1}})
    assert laws["system.a"] == Law(-0.3, 0.1)
    assert (laws["noise.sigma"].sd, laws["noise.sigma"].low) == pytest.approx((0.2, 0.0))
    drawn, again, other = (latin_hypercube(laws, 200, seed=seed) for seed in (3, 3, 4))
    for key, law in laws.items():
        ends = norm.cdf([law.low, law.high], law.value, law.sd)
        shares = (norm.cdf(drawn[key], law.value, law.sd) - ends[0]) / (ends[1] - ends[0])
        assert np.sort(np.floor(shares * 200 - 1e-9)).tolist() == list(range(200))
        assert np.array_equal(drawn[key], again[key])
    assert abs(np.corrcoef(*drawn.values())[0, 1]) < 4 / math.sqrt(200)
    assert not np.array_equal(drawn["system.a"], other["system.a"])
    law = Law(0.5, 0.4, 0.0, 1.0)
    whole, first, second = (quad(lambda x, n=n: x**n * norm.pdf(x, 0.5, 0.4), 0, 1)[0] for n in range(3))
    assert law.mean == pytest.approx(first / whole, rel=1e-9)
    assert law.deviation == pytest.approx(math.sqrt(second / whole - (first / whole) ** 2), rel=1e-7)
    assert Law(0.99, 0.02, 0.0, 1.0).mean < 0.99
