"""The principal pair and the spectrum: nothing lies to the right of Λ, and both eigenfunctions are positive."""

import numpy as np
import pytest

from fpsolve import CylinderMesh, OrnsteinUhlenbeck, Problem, VibroImpactOscillator, make_mesh
from fpsolve.errors import MeshError, NotConverged
from fpsolve.exponent import principal_pair, spectrum
from fpsolve.fem import Generator
from tests.conftest import FIG1, FIG1_NOISE, UNIT_NOISE, oracle_arguments, sampled
from tests.oracles import fourier_hermite


def random_mesh(rng: np.random.Generator) -> CylinderMesh:
    """Irregular lines, degrees 1 to 8, half or full circle, intervals of unequal ends."""
    ends = [0, np.pi / 2, 3 * np.pi / 2, 2 * np.pi] if rng.random() < 0.3 else [np.pi / 2, 3 * np.pi / 2]
    phi = np.concatenate([ends, rng.uniform(ends[0], ends[-1], rng.integers(0, 4))])
    z = np.concatenate([[-rng.uniform(4, 9), rng.uniform(4, 9)], rng.uniform(-4, 4, rng.integers(0, 4))])
    return CylinderMesh(np.sort(phi), np.sort(z), int(rng.integers(1, 9)), int(rng.integers(1, 9)))


@pytest.mark.parametrize("count", sampled(20, 100))
def test_nothing_lies_right_of_the_principal_eigenvalue_on_random_meshes(rng, count):
    """Continuous elements in φ fail this: their zigzag mode, mixed in by the impact, lies to the right."""
    parities = []
    while len(parities) < count:
        mesh = random_mesh(rng)
        noise = FIG1_NOISE if rng.random() < 0.3 else FIG1_NOISE.ou_reduction()
        generator = Generator(Problem(FIG1, noise), mesh)
        if generator.size > 350:
            continue
        p = rng.uniform(-2, 6)
        rightmost = spectrum(generator, p, 1)[0]
        pair = principal_pair(generator, p)
        assert abs(rightmost.imag) < 1e-10
        assert rightmost.real == pytest.approx(pair.value, abs=1e-10)
        assert pair.residual < 1e-13
        parities.append(generator.size % 2)
    assert 0.1 * count < sum(parities) < 0.9 * count  # even and odd numbers of unknowns


@pytest.mark.parametrize(("epsilon", "p"), sampled((1.0, 1.0), (0.5, -2.0), (0.5, 3.0)))
def test_nothing_lies_right_of_the_principal_eigenvalue_in_strong_noise(epsilon, p):
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=epsilon)
    mesh = make_mesh(phi_cells=4, phi_degree=6, xi_cells=5, xi_degree=6, xi_min=-6, xi_max=7)
    generator = Generator(Problem(oscillator, UNIT_NOISE), mesh)
    rightmost = spectrum(generator, p, 1)[0]
    assert rightmost.real == pytest.approx(principal_pair(generator, p).value, abs=1e-10)
    assert abs(rightmost.imag) < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("p", sampled(-1.0, 2.0))
def test_spectrum_of_the_full_circle_against_fourier_hermite(p):
    oscillator = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.3)
    noise = OrnsteinUhlenbeck(alpha=1.2, sigma=0.9)
    mesh = make_mesh(full_circle=True, phi_degree=11, xi_cells=2, xi_degree=11)
    values = spectrum(Generator(Problem(oscillator, noise), mesh), p, 7)
    oracle = fourier_hermite.spectrum(**oracle_arguments(oscillator, noise), p=p, harmonics=20, hermite=14)[:7]
    np.testing.assert_allclose(np.sort_complex(values), np.sort_complex(oracle), atol=1e-8)
    assert np.all(np.diff(values.real) < 1e-10)


def test_pair_solves_both_eigenproblems_and_is_normalised(fig1_solver):
    pair = fig1_solver.pair(2.0)
    operator, mass = pair.generator.matrix(2.0), pair.generator.space(2.0).mass
    assert np.linalg.norm(operator @ pair.right - pair.value * (mass @ pair.right)) < 1e-12
    assert np.linalg.norm(operator.T @ pair.left - pair.value * (mass @ pair.left)) < 1e-12
    assert pair.left @ (mass @ pair.right) * 2 == pytest.approx(1, rel=1e-13)  # twice the half circle
    one = pair.space.constant
    assert one @ (mass @ pair.right) == pytest.approx(one @ (mass @ one), rel=1e-13)
    assert pair.sign_defects == (0, 0)


def test_repeated_solves_are_identical():
    generator = Generator(Problem(FIG1, FIG1_NOISE.ou_reduction()), make_mesh())
    first, second = (principal_pair(generator, 3.0) for _ in range(2))
    np.testing.assert_array_equal(first.right, second.right)
    assert first.value == second.value


def test_a_mesh_that_resolves_nothing_raises_with_the_partial_pair():
    oscillator = VibroImpactOscillator(omega=1.0, restitution=1.0, c1=0.0, epsilon=2.0)
    mesh = make_mesh(phi_cells=1, phi_degree=3, xi_cells=1, xi_degree=4, xi_min=-6, xi_max=6)
    with pytest.raises(NotConverged, match=r"was not found on this mesh.*use more cells") as caught:
        principal_pair(Generator(Problem(oscillator, UNIT_NOISE), mesh), 6.0)
    assert caught.value.partial.p == 6.0


def test_dependent_elements_are_refused():
    with pytest.raises(MeshError, match=r"linearly dependent up to rounding.*use more or lower-degree cells"):
        Generator(Problem(FIG1, UNIT_NOISE), make_mesh(xi_cells=2, xi_degree=20, xi_min=-30, xi_max=30))


@pytest.mark.parametrize("k", [0, 10_000])
def test_spectrum_refuses_impossible_counts(k):
    with pytest.raises(ValueError, match="it must be from 1 to the number of unknowns, 12"):
        spectrum(
            Generator(Problem(FIG1, UNIT_NOISE), make_mesh(phi_cells=1, phi_degree=3, xi_cells=1, xi_degree=2)), 1.0, k
        )


def test_spectrum_refuses_meshes_too_large_for_dense_algebra():
    generator = Generator(Problem(FIG1, UNIT_NOISE), make_mesh(phi_cells=8, xi_cells=8))
    with pytest.raises(ValueError, match="use a coarser mesh"):
        spectrum(generator, 1.0)
