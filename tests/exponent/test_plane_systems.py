"""Λ(p) of motions and noises that the paper does not have, against exact moment equations and other identities."""

import math
import pickle

import numpy as np
import pytest

from fpsolve import (
    CylinderMesh,
    ExponentSolver,
    NonGaussianNoise,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    VibroImpactOscillator,
    make_mesh,
    moment_lyapunov,
    stationary_density,
)
from fpsolve.analysis import furstenberg_khasminskii
from fpsolve.arrays import identity
from fpsolve.errors import MeshError, NotConverged
from fpsolve.exponent import impact_rate, principal_pair, spectrum
from fpsolve.fem import Generator
from fpsolve.model import CoefficientMatrix, Jump, MarkovChain, Poisson, White
from fpsolve.model.plane import matrix_at
from tests.conftest import UNIT_NOISE
from tests.oracles import moment_hierarchy

ROTATION, MODEST = ((0.0, 1.0), (-1.0, 0.0)), ((0.0, 0.0), (-0.1, 0.0))


def oscillator(omega=1.0, b=0.05, jumps=(), epsilon=1.0):
    """ẍ + 2bẋ + (ω² + ε ξ) x = 0 in (x, ẋ/ω)."""
    rotation, stiffness = ((0.0, omega), (-omega, 0.0)), ((0.0, 0.0), (-1 / omega, 0.0))
    damping = ((0.0, 0.0), (0.0, -2 * b))
    return PlaneSystem(
        [CoefficientMatrix(0, rotation), CoefficientMatrix(1, stiffness, identity), CoefficientMatrix(0, damping)],
        jumps,
        epsilon,
    )


TELEGRAPH = MarkovChain.telegraph(amplitude=0.5, rate=1.0)


def exact(problem, p):
    matrices = matrix_at(problem.system, np.array(problem.noise.states))
    return moment_hierarchy.moment_lyapunov(matrices, problem.noise.rates, p)


def test_telegraph_noise_in_the_stiffness():
    """Reference values by an independent computation; Λ(2) is also the root of a 6×6 system."""
    problem = Problem(oscillator(), TELEGRAPH)
    result = moment_lyapunov(problem, [2.0], rtol=1e-11)
    assert result.value[0] == pytest.approx(-0.0332610990213, abs=1e-12)
    assert result.value[0] == pytest.approx(exact(problem, 2), abs=1e-12)
    assert ExponentSolver(problem, rtol=1e-11).lyapunov_exponent().value == pytest.approx(-0.0329794566817, abs=1e-12)


def test_telegraph_noise_with_a_wall():
    """A wall that keeps 0.9 of the speed; λ = λ₀ + N ln R, N the impacts per time."""
    walled = Problem(oscillator(jumps=[Jump(math.pi / 2, math.log(0.9))]), TELEGRAPH)
    solver = ExponentSolver(walled, rtol=1e-11)
    assert solver.lyapunov_exponent().value == pytest.approx(-0.0659526129896, abs=1e-12)
    assert furstenberg_khasminskii(solver.pair(0.0)) == pytest.approx(-0.0659526129896, abs=1e-10)


def random_problem(rng):
    """Two or three states, any matrices, noise in all of them, weak or strong, slow or fast."""
    count = int(rng.integers(2, 4))
    rates = 10 ** rng.uniform(-1, 1) * rng.uniform(0.1, 1, (count, count))
    np.fill_diagonal(rates, 0)
    noise = MarkovChain(rng.uniform(-1, 1, count), rates)
    turn = rng.uniform(0.5, 3)
    rotation = np.array([[0, turn], [-turn, 0]]) + rng.uniform(-0.3, 0.3, (2, 2))
    return Problem(
        PlaneSystem(
            [CoefficientMatrix(0, rotation), CoefficientMatrix(1, rng.uniform(-1, 1, (2, 2)), identity)],
            epsilon=rng.uniform(0.1, 1),
        ),
        noise,
    )


@pytest.mark.parametrize("seed", range(20))
def test_random_chains_against_their_exact_moment_equations(seed):
    problem = random_problem(np.random.default_rng(seed))
    result = moment_lyapunov(problem, [2.0, 4.0], rtol=1e-11)
    for p, value, error in zip((2, 4), result.value, result.error_estimate, strict=True):
        assert value == pytest.approx(exact(problem, p), abs=1e-10 * max(abs(value), 1))
        assert error < 1e-10


@pytest.mark.parametrize("seed", range(20, 26))
def test_motions_that_do_not_turn(seed):
    """Order 0 is any matrix, so that the phase may rest where nothing drives it."""
    rng = np.random.default_rng(seed)
    system = PlaneSystem(
        [CoefficientMatrix(0, rng.uniform(-1, 1, (2, 2))), CoefficientMatrix(1, rng.uniform(-1, 1, (2, 2)), identity)]
    )
    problem = Problem(system, MarkovChain.telegraph(rng.uniform(0.3, 1), rng.uniform(0.5, 3)))
    result = moment_lyapunov(problem, [2.0], rtol=1e-9)
    assert result.value[0] == pytest.approx(exact(problem, 2), abs=max(3 * result.error_estimate[0], 1e-10))


def test_states_that_hardly_mix_give_the_larger_exponent():
    """Each state alone would do, with a positive eigenfunction of its own as far as rounding can tell."""
    for order in (1, -1):
        chain = MarkovChain((0.4 * order, -0.2 * order), ((0, 1e-9), (1e-9, 0)))
        growth = PlaneSystem(
            [CoefficientMatrix(0, ((0.0, 1.0), (-1.0, 0.0))), CoefficientMatrix(1, ((1.0, 0.0), (0.0, 1.0)), identity)]
        )
        assert moment_lyapunov(Problem(growth, chain), [2.0]).value[0] == pytest.approx(0.8 if order > 0 else 0.4, 1e-6)


def test_a_chain_tends_to_the_ornstein_uhlenbeck_process():
    """A sum of n telegraphs is a chain with binomial law, whose Λ(2) tends to that of Gaussian noise like 1/n."""
    system = oscillator(epsilon=0.3)
    gauss = moment_lyapunov(Problem(system, OrnsteinUhlenbeck(alpha=2.0, sigma=2.0)), [2.0], rtol=1e-10).value[0]
    errors = []
    for n in (4, 8, 16):
        up = np.arange(n + 1)
        rates = np.diag((n - up[:-1]) * 1.0, 1) + np.diag(up[1:] * 1.0, -1)
        chain = MarkovChain((2 * up - n) / math.sqrt(n), rates)
        assert chain.correlation_time == pytest.approx(0.5)
        errors.append(moment_lyapunov(Problem(system, chain), [2.0], rtol=1e-10).value[0] - gauss)
    assert errors[0] / errors[1] == pytest.approx(2, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(2, rel=0.08)


def test_gaussian_noise_in_the_stiffness_against_its_moment_equations():
    """Hermite polynomials of ξ times monomials: E‖x‖² of ẍ + 2bẋ + (ω² + ξ)x = 0."""
    noise, order = OrnsteinUhlenbeck(alpha=1.0, sigma=0.6), 40
    problem = Problem(oscillator(omega=1.3, b=0.1), noise)
    free, driven = (matrix_at(problem.system, xi) for xi in (0.0, 1.0))
    std, n = noise.standard_deviation, np.arange(order)
    z = np.diag(np.sqrt(n[1:]), 1) + np.diag(np.sqrt(n[1:]), -1)
    rates = moment_hierarchy.rates_of_monomials
    total = np.kron(np.eye(order), rates(free, 2)) + np.kron(std * z, rates(driven - free, 2))
    total -= np.kron(np.diag(noise.alpha * n), np.eye(3))
    oracle = np.max(np.linalg.eigvals(total).real)
    assert moment_lyapunov(problem, [2.0], rtol=1e-10).value[0] == pytest.approx(oracle, abs=1e-10)


def test_the_choice_of_coordinates_does_not_matter():
    """x → S x changes h and q, the mesh and the wall's ray, but not Λ."""
    base = Problem(oscillator(jumps=[Jump(math.pi / 2, math.log(0.9))]), TELEGRAPH)
    change = np.array([[1.0, 0.3], [-0.4, 1.2]])
    inverse = np.linalg.inv(change)
    terms = [
        CoefficientMatrix(term.order, change @ np.array(term.matrix) @ inverse, term.g) for term in base.system.terms
    ]
    ray = change @ np.array([math.cos(math.pi / 2), -math.sin(math.pi / 2)])
    jumps = [Jump(math.atan2(-ray[1], ray[0]), math.log(0.9))]
    other = Problem(PlaneSystem(terms, jumps), TELEGRAPH)
    values = [moment_lyapunov(problem, [-1.0, 2.0], rtol=1e-10).value for problem in (base, other)]
    np.testing.assert_allclose(values[0], values[1], atol=1e-10)


@pytest.mark.parametrize(
    ("g", "matrix", "noise"),
    [
        (lambda xi: xi**2, ((0.0, 0.3), (0.0, 0.0)), OrnsteinUhlenbeck(alpha=1.0, sigma=0.5)),
        (np.cos, ((0.0, 0.3), (0.0, 0.0)), NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.8)),
        (np.cos, ((0.0, 0.3), (0.0, 0.0)), MarkovChain((-1.0, 0.0, 1.0), ((0, 1, 0), (1, 0, 1), (0, 1, 0)))),
        (identity, ((0.0, 0.3), (0.0, 0.0)), White(s=0.5)),
        (identity, ((0.0, 0.3), (0.0, 0.0)), Poisson(rate=1.0, sizes=(0.5,))),
        (identity, ROTATION, MarkovChain.telegraph(1.0, 5.0)),
    ],
    ids=["x**2", "bounded", "chain", "white", "impulses", "turning"],
)
@pytest.mark.parametrize("log", [-0.2, 0.0])
def test_a_wall_is_a_ray_that_no_noise_turns(g, matrix, noise, log):
    """x = 0 is passed with ẋ = (1 + 0.3 g(ξ))v, g the same at both ends of the noise: λ was -6.68 in place of -0.17."""
    terms = [CoefficientMatrix(0, ((0.0, 1.0), (-1.0, -0.2))), CoefficientMatrix(1, matrix, g)]
    with pytest.raises(ValueError, match=f"{noise.kind} noise moves the phase across the ray of a jump, phi = 1.5708"):
        Problem(PlaneSystem(terms, [Jump(math.pi / 2, log)]), noise)
    named = [terms[0], CoefficientMatrix(1, matrix, g, "gust"), CoefficientMatrix(1, MODEST, identity, "sea")]
    with pytest.raises(ValueError, match='the noise "gust" moves the phase across'):
        Problem(PlaneSystem(named, [Jump(math.pi / 2, log)]), {"gust": noise, "sea": TELEGRAPH})


def test_the_unit_of_time_does_not_matter_at_a_wall():
    """ẋ = (1 + aξ²)v, v̇ = −ω²x − 0.2ωv − ω²ξx − 0.1ωξv: refused for a = 1e-6 alone."""
    found = []
    for omega in (1e-6, 1.0, 1e7):
        free = CoefficientMatrix(0, ((0.0, 1.0), (-(omega**2), -0.2 * omega)))
        driven = CoefficientMatrix(1, ((0.0, 0.0), (-(omega**2), -0.1 * omega)), identity)
        bent = CoefficientMatrix(1, ((0.0, 1e-6), (0.0, 0.0)), np.square)
        noise, wall = OrnsteinUhlenbeck(alpha=omega, sigma=0.5 * math.sqrt(omega)), [Jump(math.pi / 2, -0.2)]
        solver = ExponentSolver(Problem(PlaneSystem([free, driven], wall), noise))
        found.append(solver.solution(2.0).pair.value / omega)
        with pytest.raises(ValueError, match="moves the phase across the ray"):
            Problem(PlaneSystem([free, driven, bent], wall), noise)
    assert found == pytest.approx([found[1]] * 3, rel=1e-8)


@pytest.mark.parametrize("second", [((0.0, -0.3), (0.0, -0.1)), ((0.0, 0.0), (-0.5, 0.0))])
def test_a_function_that_a_noise_does_not_change_leaves_a_wall_alone(second):
    """ξ² is 1 in both states, and what two terms of one noise do to x = 0 together is nothing: λ = λ₀ + N ln R."""
    chain = MarkovChain.telegraph(1.0, 0.7)
    one, other = CoefficientMatrix(1, ((0.0, 0.3), (-0.4, 0.0)), np.square), CoefficientMatrix(1, second, identity)
    rest = CoefficientMatrix(1, ((0.0, 0.3), (0.0, 0.0)), identity)
    terms = [CoefficientMatrix(0, ((0.0, 1.0), (-1.0, -0.2))), one, *([other, rest] if second[0][1] else [other])]
    still, walled = (
        ExponentSolver(Problem(PlaneSystem(terms, [Jump(math.pi / 2, log)]), chain), rtol=1e-10) for log in (0.0, -0.2)
    )
    rate = impact_rate(walled)
    change = walled.lyapunov_exponent().value - still.lyapunov_exponent().value
    assert change == pytest.approx(-0.2 * rate.value, abs=1e-9)
    assert furstenberg_khasminskii(walled.pair(0.0)) == pytest.approx(walled.lyapunov_exponent().value, abs=1e-9)


def test_several_kicks():
    """With a rotation alone every half-turn passes each ray once: Λ = p ω Σ ln R/π."""
    jumps = [Jump(phase, math.log(R)) for phase, R in ((0.3, 0.9), (1.1, 0.7), (2.9, 1.2))]
    system = PlaneSystem(
        [CoefficientMatrix(0, ((0.0, 2.0), (-2.0, 0.0))), CoefficientMatrix(1, np.zeros((2, 2)), identity)], jumps
    )
    result = moment_lyapunov(Problem(system, TELEGRAPH), [-1.0, 2.0], rtol=1e-10)
    wanted = np.array([-1.0, 2.0]) * 2.0 * math.log(0.9 * 0.7 * 1.2) / math.pi
    np.testing.assert_allclose(result.value, wanted, rtol=1e-10)


def test_the_paper_from_its_parts():
    """A `PlaneSystem` of the oscillator's terms and jumps is the oscillator, to the last bit."""
    paper = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.5)
    parts = PlaneSystem(paper.terms, paper.jumps, paper.epsilon)
    values = [moment_lyapunov(Problem(system, UNIT_NOISE), [1.0, 2.0]).value for system in (paper, parts)]
    assert np.array_equal(*values)


def test_nothing_lies_right_of_the_principal_eigenvalue_of_chains():
    rng, found = np.random.default_rng(5), 0
    for _ in range(20):
        problem = random_problem(rng)
        mesh = CylinderMesh(np.linspace(0, np.pi, int(rng.integers(2, 7))), [], int(rng.integers(1, 8)), 1)
        generator, p = Generator(problem, mesh), rng.uniform(-2, 5)
        try:
            value = principal_pair(generator, p).value
        except NotConverged:
            continue  # a mesh too coarse for a positive T
        assert spectrum(generator, p, 1)[0].real == pytest.approx(value, abs=1e-9)
        found += 1
    assert found >= 15


def test_densities_of_a_chain():
    problem = Problem(oscillator(), MarkovChain((-0.6, 0.3), ((0, 1.0), (0.5, 0))))
    density = stationary_density(ExponentSolver(problem).pair(0.0))
    np.testing.assert_allclose(density.xi_marginal(), [1 / 3, 2 / 3], rtol=1e-10)
    assert density.mean(lambda phi, xi: xi) == pytest.approx(0.0, abs=1e-12)


def test_problems_of_chains_pickle():
    result = moment_lyapunov(Problem(oscillator(), TELEGRAPH), [2.0])
    again = pickle.loads(pickle.dumps(result))
    assert again.pairs[0].generator.problem == result.pairs[0].generator.problem


def test_a_chain_refuses_a_mesh_with_lines():
    with pytest.raises(MeshError, match="noise with states, with an angle or of a filter needs a mesh without z_lines"):
        Generator(Problem(oscillator(), TELEGRAPH), make_mesh())


@pytest.mark.slow
def test_slow_noise_is_sought_on_both_sides():
    """Symmetric noise does not know the sign of its term: the far place may lie at ξ < 0 although p > 0."""
    noise = OrnsteinUhlenbeck(alpha=0.05, sigma=0.05)
    values = []
    for sign in (1, -1):
        driven = CoefficientMatrix(1, ((0.0, 0.0), (0.0, sign * 1.0)), identity)
        terms = [CoefficientMatrix(0, ROTATION), driven, CoefficientMatrix(2, ((0.0, 0.0), (0.0, 0.1)))]
        system = PlaneSystem(terms, [Jump(math.pi / 2, math.log(0.8))])
        values.append(moment_lyapunov(Problem(system, noise), [2.0]).value[0])
    assert values[0] == pytest.approx(values[1], rel=1e-7)
    assert values[0] == pytest.approx(1.12906, rel=1e-4)  # populations: 1.12902 ± 2e-5


@pytest.mark.parametrize("rtol", [1e-6, 1e-8])
def test_a_ray_that_all_matrices_keep(rtol):
    """On x₂ = 0 the growth is 0.3 for ever, and no other motion grows faster in the mean."""
    system = PlaneSystem(
        [CoefficientMatrix(0, ((0.3, 1.0), (0.0, -0.5))), CoefficientMatrix(1, ((0.0, 0.0), (0.0, 1.0)), identity)]
    )
    result = moment_lyapunov(Problem(system, MarkovChain.telegraph(1.0, 1.0)), [1.0], rtol=rtol)
    assert result.value[0] == pytest.approx(0.3, abs=1e-6)


def square(xi):
    return xi**2


def cube(xi):
    return xi**3


def test_fast_elliptic_rotation_does_not_hide_the_principal_eigenvalue():
    """A wrong eigenvalue has eigenfunctions of nearly one sign on a coarse mesh and on a finer one."""
    terms = [
        CoefficientMatrix(0, ((0.742, -1.834), (-0.300, 1.384))),
        CoefficientMatrix(0, ((0.0, -1.5), (1.0, 0.3))),
        CoefficientMatrix(0, ((-1.719, -0.581), (-1.235, -1.086)), square),
        CoefficientMatrix(3, ((-1.172, 1.896), (-1.741, 1.163)), cube),
    ]
    chain = MarkovChain((-2.466, -1.282, -3.378), ((0, 3.053, 0), (0, 0, 1.328), (1.661, 0, 0)))
    problem = Problem(PlaneSystem(terms, epsilon=1.5), chain)
    for rtol in (1e-7, 1e-8):
        assert moment_lyapunov(problem, [4.0], rtol=rtol).value[0] == pytest.approx(exact(problem, 4), rel=1e-6)
