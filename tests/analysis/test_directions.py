"""Densities of directions of three and four variables: closed forms, moment equations, a simulation, coordinates."""

import math

import numpy as np
import pytest
import scipy.linalg

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, Problem, stationary_density, tilted_density
from fpsolve.analysis import furstenberg_khasminskii
from fpsolve.analysis.directions import settled_directions
from fpsolve.arrays import identity
from fpsolve.exponent import principal_pair
from fpsolve.exponent.directions import DirectionGrid, Directions, oscillators, pair_names
from fpsolve.fem import Generator
from fpsolve.fem.sphere import SphereAxis
from fpsolve.model import CoefficientMatrix, LinearSystem, ModalSystem, Telegraph, White
from fpsolve.output import draw_eigenfunction
from tests.conftest import sampled
from tests.exponent.test_modes import COUPLED, FREE, problem

OMEGA = 1.6
RATES = np.diag([1.0, 1.0, 1.0, 1 / OMEGA])
"""z of x for `FREE`, whose modes have the frequencies 1 and 1.6."""

TURNED = problem(White(s=1.0), RATES @ FREE @ np.linalg.inv(RATES), RATES @ COUPLED @ np.linalg.inv(RATES))


@pytest.fixture(scope="module")
def white():
    return ExponentSolver(problem(White(s=1.0)), rtol=1e-3)


def turning(n, coordinates):
    """A damped system that independent white noises turn every way, alike in all directions, in coordinates x = Gy."""
    rng = np.random.default_rng(n)
    inverse = np.linalg.inv(coordinates)

    def term(order, matrix, *noise):
        return CoefficientMatrix(order, (coordinates @ matrix @ inverse).tolist(), *noise)

    turns = [each - each.T for each in rng.standard_normal((3, n, n))]
    terms = [term(0, -0.1 * np.eye(n) + turns[0])]
    terms += [term(1, turn, identity, name) for name, turn in zip("ab", turns[1:], strict=True)]
    return Problem(LinearSystem(tuple(terms)), {"a": White(s=1.0), "b": White(s=0.5)})


def enriched(pair):
    """The pair on the next finer functions of directions."""
    generator = pair.generator
    finer = generator.chosen.with_axis(0, generator.chosen.phi.enriched())
    return principal_pair(type(generator)(generator.problem, finer), pair.p, start=pair)


@pytest.mark.parametrize(("n", "p"), sampled((3, 0.0), (4, 1.5)))
def test_isotropic_systems_in_any_coordinates(n, p):
    """‖y‖ falls as exp(−0.1t) and its directions are uniform, so that those of x = Gy have 1/(|S| |det G| ‖G⁻¹e‖ⁿ)."""
    coordinates = np.eye(n) + 0.4 * np.random.default_rng(7).uniform(-1, 1, (n, n))
    problem = turning(n, coordinates)
    own = ExponentSolver(problem, rtol=1e-8).pair(p)  # in coordinates in which it is alike in all directions, too
    near = coordinates @ (np.eye(n) + 0.05 * np.random.default_rng(9).uniform(-1, 1, (n, n)))
    axis = SphereAxis(tuple(map(tuple, near.tolist())), np.linspace(0, math.pi / 2, 3), 8, 8)
    pair = principal_pair(Generator(problem, own.generator.chosen.with_axis(0, axis)), p)
    assert abs(own.value + 0.1 * p) <= 1e-14 + own.rounding
    assert pair.value == pytest.approx(-0.1 * p, abs=1e-4)
    points = np.random.default_rng(8).standard_normal((n, 40))
    points /= np.linalg.norm(points, axis=0)
    length = np.linalg.norm(np.linalg.solve(coordinates, points), axis=0)
    size = math.gamma(n / 2) / (2 * math.pi ** (n / 2)) / abs(np.linalg.det(coordinates))

    def error(pair):
        right, adjoint, product = Directions(pair).at(points)
        ratios = product / (size * length**-n), right * length**-p, adjoint * length ** (n + p)
        return max(np.max(np.abs(each / np.mean(each) - 1)) for each in ratios) + abs(np.mean(ratios[0]) - 1)

    assert error(own) < 1e-12
    assert (first := error(pair)) < 1e-3
    assert error(enriched(pair)) < 0.1 * first


@pytest.mark.slow
def test_uniform_densities_of_the_pictures():
    """1/(4π) per unit of the sphere, and sin 2η/(2π) over η and θ₁ − θ₂."""
    three, four = (stationary_density(ExponentSolver(turning(n, np.eye(n))).pair(0.0)) for n in (3, 4))
    np.testing.assert_allclose(three.values, 1 / (4 * math.pi), atol=1e-4)
    np.testing.assert_allclose(
        four.values, np.sin(2 * four.grid.first)[:, None] / (2 * math.pi) + 0 * four.values, atol=1e-4
    )
    for found in (three, four):
        assert found.mean(lambda x, y: np.ones_like(x + y)) == pytest.approx(1, abs=1e-9)
        assert found.negative_share() == 0
        assert found.error < 1e-3
    assert four.to_xarray().mean_share == pytest.approx(0.5, abs=1e-4)


def moments_of(p_matrix):
    """The eigenvector of a matrix with the largest real part."""
    values, vectors = np.linalg.eig(p_matrix)
    return vectors[:, np.argmax(values.real)].real


@pytest.mark.slow
def test_second_moments_of_both_eigenfunctions():
    """At p = 2 T is zᵀQz, and ∫ T* eeᵀ dσ is proportional to E zzᵀ/‖E zzᵀ‖; both from Kronecker squares."""
    pair = enriched(ExponentSolver(problem(White(s=1.0)), rtol=1e-8).pair(2.0))
    free, driven = (RATES @ each @ np.linalg.inv(RATES) for each in (FREE, COUPLED))
    both = [np.kron(each, np.eye(4)) + np.kron(np.eye(4), each) for each in (free, driven)]
    whole = both[0] + 0.5 * both[1] @ both[1]
    q, second = (moments_of(each).reshape(4, 4) for each in (whole.T, whole))
    points = np.random.default_rng(3).standard_normal((4, 30))
    points /= np.linalg.norm(points, axis=0)
    right, _, _ = Directions(pair).at(points)
    expected = np.einsum("im,ij,jm->m", points, q, points)
    np.testing.assert_allclose(right / right[0], expected / expected[0], rtol=1e-7)
    fields = Directions(pair).fields
    assert fields.grid.share(fields.adjoint) == pytest.approx(np.trace(second[2:, 2:]) / np.trace(second), rel=1e-4)
    assert fields.is_resolved


@pytest.mark.slow
def test_coordinates_of_a_user():
    """The frequencies are found of two modes, of matrices, and where the rates are divided by them already."""
    modes = ModalSystem.of(
        np.eye(2).tolist(), np.diag([1, 2.56]).tolist(), np.diag([0.1, 0.16]).tolist(),
        stiffness_noise=[[0.5, 0.3], [0.3, 0.5]], modes=["heave", "pitch"],
    )  # fmt: skip
    assert oscillators(Problem(modes, White(s=1.0))) == pytest.approx({0: 1.0, 2: OMEGA})
    assert pair_names(Problem(modes, White(s=1.0))) == ("heave", "pitch")
    assert pair_names(problem(White(s=1.0))) == ("x₁", "x₃")
    assert oscillators(TURNED) == pytest.approx({0: 1.0, 2: 1.0})
    assert oscillators(turning(4, np.eye(4))) == {}
    assert pair_names(turning(4, np.eye(4))) == ("(x₁, x₂)", "(x₃, x₄)")
    shares = []
    for each in (problem(White(s=1.0)), Problem(modes, White(s=1.0)), TURNED):
        fields = Directions(ExponentSolver(each, rtol=1e-3).pair(1.0)).on(DirectionGrid.of(each, 24))
        shares.append(fields.grid.share(fields.product))
    np.testing.assert_allclose(shares, shares[0], rtol=1e-2)


@pytest.mark.slow
def test_the_same_densities_in_other_units(white):
    """Those of the motion in z are those of the motion in x, within the errors that both state."""
    one, two = (settled_directions(each.pair(1.0)) for each in (white, ExponentSolver(TURNED, rtol=1e-3)))
    grid = one.fields.grid
    for name in ("adjoint", "product"):
        variation = 0.5 * grid.integral(np.abs(getattr(one.fields, name) - getattr(two.on(grid).fields, name)))
        assert variation < one.error + two.error
    np.testing.assert_allclose(two.on(grid).fields.right, one.fields.right, rtol=1e-2)


def simulated(paths=3000, step=0.05, burn=100.0, time=150.0):
    """z of dx = Ax dt + Bx ∘ dW by Strang's splitting, of which both halves are exact, at every unit of time."""
    rng, half = np.random.default_rng(11), scipy.linalg.expm(0.5 * step * FREE)
    x = rng.standard_normal((4, paths))
    for k in range(round((burn + time) / step)):
        x = half @ x
        x = half @ (x + COUPLED @ x * (math.sqrt(step) * rng.standard_normal(paths)))  # B² = 0
        if k % round(1 / step) == 0:
            x = x / np.linalg.norm(x, axis=0)
            if k * step >= burn:
                yield RATES @ x


@pytest.mark.slow
def test_stationary_density_of_two_modes_against_paths(white):
    density = stationary_density(white.pair(0.0))
    edges = np.linspace(0, 1, 6)
    shares, phases = [], []
    for z in simulated():
        first, second = np.sum(z[:2] ** 2, axis=0), np.sum(z[2:] ** 2, axis=0)
        shares.append(np.floor(5 * second / (first + second)).astype(int))
        turn = np.arctan2(z[1], z[0]) - np.arctan2(z[3], z[2])
        phases.append(np.floor(4 * np.mod(turn, 2 * np.pi) / (2 * np.pi)).astype(int))
    shares, phases = np.minimum(shares, 4), np.minimum(phases, 3)

    def of_first(low, high):
        """∫ over η between two shares, by a spline through the nodes."""
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(density.grid.first, density.first_marginal())
        return spline.integrate(*np.arcsin(np.sqrt([low, high])))

    def of_second(k):
        from scipy.interpolate import CubicSpline

        marginal = density.second_marginal()
        marginal[-1] = marginal[0]
        return CubicSpline(density.grid.second, marginal, bc_type="periodic").integrate(
            k * np.pi / 2, (k + 1) * np.pi / 2
        )

    pairs = [(np.mean(shares == k, axis=0), of_first(edges[k], edges[k + 1])) for k in range(5)]
    pairs += [(np.mean(phases == k, axis=0), of_second(k)) for k in range(4)]
    for by_path, expected in pairs:
        error = np.std(by_path) / math.sqrt(by_path.size)
        assert abs(np.mean(by_path) - expected) < 4 * error + 0.5 * density.error


@pytest.mark.slow
def test_noise_is_integrated_over():
    """At p = 2 ∫ T* eeᵀ dσ dξ of OU noise has the second moments of its Hermite hierarchy."""
    pair = ExponentSolver(problem(OrnsteinUhlenbeck(alpha=1.0, sigma=0.5 * math.sqrt(2))), rtol=1e-6).pair(2.0)
    fields = Directions(pair).on(DirectionGrid.of(pair.generator.problem, 96))
    count = 14
    x = np.diag(np.sqrt(np.arange(1.0, count)), 1)
    free, driven = (RATES @ each @ np.linalg.inv(RATES) for each in (FREE, COUPLED))
    both = [np.kron(each, np.eye(4)) + np.kron(np.eye(4), each) for each in (free, driven)]
    whole = (
        np.kron(np.eye(count), both[0])
        - np.kron(np.diag(np.arange(count)), np.eye(16))
        + 0.5 * np.kron(x + x.T, both[1])
    )
    second = moments_of(whole)[:16].reshape(4, 4)
    assert fields.grid.share(fields.adjoint) == pytest.approx(np.trace(second[2:, 2:]) / np.trace(second), rel=1e-4)
    assert fields.total == pytest.approx(1, abs=1e-3)


@pytest.mark.slow
def test_what_densities_say():
    solver = ExponentSolver(turning(4, np.eye(4)), rtol=1e-3)
    pair = solver.pair(1.0)
    density = tilted_density(pair)
    assert repr(density).startswith("DirectionDensity(tilted density at p = 1, ± ")
    found = density.to_xarray()
    assert found.density.dims == ("eta", "phase_difference")
    assert found.attrs["total_variation_error"] == density.error
    assert density.error < 0.02
    assert float(found.eta_weights @ found.density @ found.phase_difference_weights) == pytest.approx(1, abs=1e-12)
    axes = density.plot()
    assert axes.get_xlabel().startswith("share of (x₃, x₄) in the sum of squares")
    assert axes.get_ylabel().startswith("phase of (x₁, x₂) less that")
    assert draw_eigenfunction(pair, "T_adjoint").png.startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="field"):
        draw_eigenfunction(pair, "U")
    with pytest.raises(ValueError, match="p = 0, but the pair has p = 1"):
        stationary_density(pair)
    with pytest.raises(ValueError, match="two variables"):
        furstenberg_khasminskii(solver.pair(0.0))


@pytest.mark.slow
def test_at_a_stop_directions_are_those_between_impacts():
    """T(z) = T(Jz), as many paths come back as leave, and ∫T T* = 1, at a sum of displacements, on coarse functions."""
    system = ModalSystem.of(
        mass=[[1.0, 0.1], [0.1, 1.0]],
        stiffness=[[100.0, 10.0], [10.0, 256.0]],
        damping=[[1.0, 0.0], [0.0, 3.6]],
        stiffness_noise=[[100.0, 10.0], [10.0, 100.0]],
        walls=[{"at": "q1 - 0.1*q2 = 0", "restitution": 0.7}],
    )
    solver = ExponentSolver(Problem(system, Telegraph(a=0.3, k=7.0)), rtol=1e-2)
    grid = DirectionGrid.of(solver.problem, 32)
    eta, theta = np.meshgrid([0.2, 0.7, 1.2], [0.3, 2.0, 4.0])
    before = np.stack([0 * eta, -np.cos(eta), np.sin(eta) * np.cos(theta), np.sin(eta) * np.sin(theta)]).reshape(4, -1)
    directions = Directions(solver.pair(2.0))
    (right, *_), (there, *_) = directions.at(before), directions.at(before * [[1], [-0.7], [1], [1]])
    np.testing.assert_allclose(right, there, rtol=0.02)
    assert directions.on(grid).is_resolved
    stationary = Directions(solver.pair(0.0)).on(grid)
    leaves, comes = grid.first_weights @ stationary.adjoint[:, [0, -1]]
    assert leaves == pytest.approx(comes, rel=0.02)
