"""∂/∂θ of Λ(p), λ, δ_p and Λ″(0) against central differences, closed forms and scaling laws."""

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    sensitivities,
)
from fpsolve.analysis.sensitivity import SMALL_P, Gradient, solve_sensitivities
from fpsolve.arrays import identity
from fpsolve.errors import NotConverged
from fpsolve.exponent import Budget
from fpsolve.exponent.root import nonzero_root
from fpsolve.fem import Generator
from fpsolve.model import CoefficientMatrix
from fpsolve.model.systems.vibro_impact import DAMPING
from tests.conftest import FIG1, FIG1_NOISE, sampled
from tests.oracles import moment_hierarchy, phase_fraction
from tests.random_sensitivities import RTOL, central, drawn, problem_of


@pytest.mark.parametrize("seed", sampled(*range(1, 5), keep=2))
def test_of_a_moment_are_central_differences(seed):
    """Many more: `python -m tests.random_sensitivities`."""
    theta, law, is_exact, p = drawn(seed)
    problem, _ = problem_of(theta, law, is_exact)
    [found] = sensitivities(problem, p, rtol=RTOL).moments
    assert found.keys() == theta.keys()
    value, scale = ExponentSolver(problem, rtol=RTOL).pair(p).value, ExponentSolver(problem).scale(p)
    for key, estimate in found.items():
        expected = central(
            theta, key, lambda at: ExponentSolver(problem_of(at, law, is_exact)[0], rtol=RTOL).pair(p).value
        )
        size = max(abs(value), scale) / max(abs(theta[key]), 0.1)
        assert estimate.value == pytest.approx(expected, rel=1e-6, abs=1e-7 * size), key
        assert estimate.error_estimate < 1e-6 * max(size, estimate.scale), key


@pytest.mark.parametrize("seed", sampled(53, 57, keep=0))
def test_of_the_indices_are_central_differences(seed):
    theta, law, is_exact, _ = drawn(seed)
    problem, _ = problem_of(theta, law, is_exact)
    found = sensitivities(problem, rtol=RTOL).indices

    def indices(at):
        solver = ExponentSolver(problem_of(at, law, is_exact)[0], rtol=RTOL)
        root = nonzero_root(solver)
        return np.array(
            [solver.lyapunov_exponent().value, root.value if root else np.nan, solver.variance_rate().value]
        )

    whole = indices(theta)
    for key in theta:
        expected = central(theta, key, indices)
        for i, name in enumerate(("lyapunov_exponent", "stability_index", "variance_rate")):
            if np.isfinite(whole[i]):
                size = max(abs(whole[i]), 1e-3 if i != 1 else 1.0) / max(abs(theta[key]), 0.1)
                assert found[name][key].value == pytest.approx(expected[i], rel=1e-6, abs=1e-6 * size), (key, name)


HEAVY = Problem(
    VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.3), NonGaussianNoise(D0=0.5, tau0=1.0, r0=1.2)
)


def test_a_finer_mesh_beyond_the_budget_costs_what_needs_it_alone(monkeypatch):
    """At p = 0 that is four times as wide as what Λ(p) takes; λ itself takes that, too."""
    rtol, made = 1e-3, list[int]()
    size = ExponentSolver(HEAVY, rtol=rtol).whole.solution(0.0).pair.generator.size
    monkeypatch.setattr(Generator, "at", lambda self, p, own=Generator.at: made.append(self.size) or own(self, p))
    found = sensitivities(HEAVY, [], rtol=rtol, budget=Budget(unknowns=size))
    assert max(made) <= 4 / 3 * size
    assert "lyapunov_exponent" not in found.indices
    assert any("p = 0 did not converge on a finer mesh: the next mesh has" in note for note in found.notes)
    with pytest.raises(NotConverged, match="p = 0 did not converge on a finer mesh"):
        lyapunov_exponent(HEAVY, rtol=rtol, budget=Budget(unknowns=size))


@pytest.mark.slow
def test_what_memory_does_not_suffice_for_costs_itself_alone(monkeypatch):
    def fail(*_):
        raise MemoryError

    monkeypatch.setattr(Gradient, "lyapunov_exponent", fail)
    found = sensitivities(Problem(HEAVY.system, NonGaussianNoise(D0=0.5, tau0=1.0, r0=0.8)), 2.0, rtol=1e-3)
    assert found.moments[0]
    assert "variance_rate" in found.indices
    assert any("no sensitivities of λ: not enough memory" in note for note in found.notes)


def test_noise_of_its_own_parameters():
    """Λ(p) of Ornstein-Uhlenbeck noise by α₀ and σ₀; ε σ₀ is one parameter where c₁ = 0 and r = 1."""
    oscillator = VibroImpactOscillator(omega=1.3, restitution=1.0, c1=0.0, epsilon=0.8)
    noise = OrnsteinUhlenbeck(alpha=0.9, sigma=1.1)
    [found] = sensitivities(Problem(oscillator, noise), 2.0, rtol=RTOL).moments
    assert found.keys() >= {"noise.alpha", "noise.sigma"}
    by_epsilon = found["oscillator.epsilon"].value * oscillator.epsilon
    assert found["noise.sigma"].value * noise.sigma == pytest.approx(by_epsilon, rel=1e-8)


@pytest.mark.parametrize("is_exact", [False, True])
def test_time_has_no_unit(is_exact):
    """Λ(p; ω, c₁, D₀, τ₀) is homogeneous of degree 1 in rates: ω, c₁, D₀ are rates, and τ₀ is a time (Euler)."""
    theta, p = {"omega": 1.1, "c1": 0.2, "D0": 0.8, "tau0": 0.6}, 1.7
    oscillator = VibroImpactOscillator(omega=theta["omega"], restitution=0.7, c1=theta["c1"], epsilon=0.9)
    noise = NonGaussianNoise(D0=theta["D0"], tau0=theta["tau0"], r0=0.4)
    problem = Problem(oscillator, noise if is_exact else noise.ou_reduction())
    [found] = sensitivities(problem, p, rtol=RTOL).moments
    by = {key.partition(".")[2]: estimate.value for key, estimate in found.items()}
    total = theta["omega"] * by["omega"] + theta["c1"] * by["c1"] + theta["D0"] * by["D0"] - theta["tau0"] * by["tau0"]
    assert total == pytest.approx(ExponentSolver(problem, rtol=RTOL).pair(p).value, rel=1e-8)


def test_damping_of_the_exact_moment():
    """Without walls Λ(−2) = −ε²c₁ + ε²S(0)/2, exactly."""
    oscillator = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.3, epsilon=0.7)
    noise = OrnsteinUhlenbeck(alpha=0.8, sigma=0.9)
    [found] = sensitivities(Problem(oscillator, noise), -2.0, rtol=RTOL).moments
    at_rest = noise.spectral_density(0.0)
    expected = {
        "oscillator.omega": 0.0,
        "oscillator.c1": -(0.7**2),
        "oscillator.epsilon": 2 * 0.7 * (at_rest / 2 - 0.3),
        "noise.alpha": -(0.7**2) * at_rest / 0.8,
        "noise.sigma": 0.7**2 * at_rest / 0.9,
    }
    for key, value in expected.items():
        assert found[key].value == pytest.approx(value, abs=1e-9), key


@pytest.mark.slow
def test_against_the_moment_hierarchy():
    """Λ(2) without walls from equations without a phase, differentiated by differences of them."""
    theta = {"omega": 1.0, "c1": 0.1, "epsilon": 1.0, "D0": 1.0, "tau0": 0.5, "r0": 0.8}

    def parts(at):
        own = dict(at)
        noise = NonGaussianNoise(**{name: own.pop(name) for name in ("D0", "tau0", "r0")})
        return VibroImpactOscillator(restitution=1.0, **own), noise

    def known(at):
        oscillator, noise = parts(at)
        relaxation, force = phase_fraction._noise(oscillator, noise, 40, 0.0)
        free = moment_hierarchy.rates_of_monomials(oscillator.terms[0].matrix, 2)
        total = np.kron(relaxation, np.eye(3)) + np.kron(np.eye(40), free)
        total += np.kron(force, moment_hierarchy.rates_of_monomials(DAMPING, 2))
        return float(np.max(np.linalg.eigvals(total).real))

    [found] = sensitivities(Problem(*parts(theta)), 2.0, rtol=RTOL).moments
    for key, estimate in found.items():
        name = key.partition(".")[2]
        if name in theta:  # the restitution is not in these equations
            assert estimate.value == pytest.approx(central(theta, name, known, 1e-3), rel=1e-8), key


@pytest.mark.slow
def test_slopes_of_the_exponent_under_algebraic_tails():
    """Within the errors of a solve with a smaller tolerance, and as a difference in r₀."""
    theta = dict(zip(drawn(0)[0], (1.2, 0.8, 0.1, 0.7, 0.6, 0.8, 1.1), strict=True))
    found, finer = (
        sensitivities(problem_of(theta, "delta", True)[0], [], rtol=rtol).indices["lyapunov_exponent"]
        for rtol in (1e-7, 1e-8)
    )
    for key, estimate in found.items():
        off = abs(estimate.value - finer[key].value)
        assert off <= estimate.error_estimate + finer[key].error_estimate, key
    expected = central(theta, "noise.r0", lambda at: lyapunov_exponent(problem_of(at, "delta", True)[0]).value)
    assert found["noise.r0"].value == pytest.approx(expected, rel=1e-4)


@pytest.mark.slow
def test_gaussian_noise_is_met_from_below():
    """∂/∂r₀ at r₀ = 1 is that from r₀ < 1, and a note says so."""
    theta = dict(zip(drawn(0)[0], (1.2, 0.8, 0.1, 0.7, 0.6, 0.8, 1.0), strict=True))
    problem, _ = problem_of(theta, "delta", True)
    found = sensitivities(problem, 1.0, rtol=RTOL)
    h = 1e-4
    values = [
        ExponentSolver(problem_of(theta | {"noise.r0": 1.0 - k * h}, "delta", True)[0], rtol=1e-12).pair(1.0).value
        for k in range(4)
    ]
    backward = (11 * values[0] - 18 * values[1] + 9 * values[2] - 2 * values[3]) / (6 * h)
    assert found.moments[0]["noise.r0"].value == pytest.approx(backward, rel=1e-5)
    assert any("from below" in note for note in found.notes)


def test_moments_of_order_zero_do_not_change():
    theta, law, is_exact, _ = drawn(3)
    problem, _ = problem_of(theta, law, is_exact)
    [found] = sensitivities(problem, 0.0).moments
    assert {estimate.value for estimate in found.values()} == {0.0}


def test_a_small_stability_index():
    """δ_p near 0 takes ∂Λ/∂θ / p from its derivatives at p = 0."""
    noise = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
    c1 = -0.25 * noise.spectral_density(2.0)  # where the λ of Eq. (39) is 0
    theta = {"omega": 1.0, "c1": c1, "epsilon": 0.01, "restitution": 1.0}

    def index(at):
        return nonzero_root(ExponentSolver(Problem(VibroImpactOscillator(**at), noise), rtol=1e-10)).value

    found = sensitivities(Problem(VibroImpactOscillator(**theta), noise), rtol=1e-10).indices["stability_index"]
    assert abs(index(theta)) < SMALL_P
    h = 1e-4 * abs(c1)
    expected = (index(theta | {"c1": c1 + h}) - index(theta | {"c1": c1 - h})) / (2 * h)
    assert found["oscillator.c1"].value == pytest.approx(expected, rel=1e-5)


def test_a_motion_of_ones_own():
    rotation, stiffness = ((0.0, 1.0), (-1.0, 0.0)), ((0.0, 0.0), (-1.0, 0.0))
    noise = OrnsteinUhlenbeck(alpha=1.0, sigma=0.8)

    def value(epsilon):
        system = PlaneSystem(
            [CoefficientMatrix(0, rotation), CoefficientMatrix(1, stiffness, identity)], epsilon=epsilon
        )
        return ExponentSolver(Problem(system, noise), rtol=RTOL).pair(2.0).value

    system = PlaneSystem([CoefficientMatrix(0, rotation), CoefficientMatrix(1, stiffness, identity)], epsilon=0.6)
    [found] = sensitivities(Problem(system, noise), 2.0, rtol=RTOL).moments
    expected = (value(0.6 + 1e-4) - value(0.6 - 1e-4)) / 2e-4
    assert found["system.epsilon"].value == pytest.approx(expected, rel=1e-6)


def test_progress_is_told_of_each_p_and_index():
    told, (theta, law, is_exact, _) = [], drawn(1)
    problem, _ = problem_of(theta, law, is_exact)
    sensitivities(problem, [1.0, 2.0], rtol=1e-4, progress=lambda: told.append(1))
    assert len(told) == 2 + 3


def test_the_error_of_a_derivative_does_not_depend_on_others():
    """It is an estimate from what was computed for it, not from those of other parameters."""
    problem = Problem(FIG1, FIG1_NOISE)
    along = problem.derivatives()

    def solved(keys):
        solver = ExponentSolver(problem)
        return solve_sensitivities(solver, np.array([1.5]), {key: along[key] for key in keys})

    everything = solved(along)
    for key in list(along)[::3]:
        alone = solved([key])
        for some, of_all in zip(
            (*alone.moments, *alone.indices.values()), (*everything.moments, *everything.indices.values()), strict=True
        ):
            assert some[key].error_estimate == pytest.approx(of_all[key].error_estimate, rel=1e-3)
