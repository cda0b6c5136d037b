"""Λ(p) is the rightmost eigenvalue of a mesh, and the spectrum of the full circle is that of Fourier series."""

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
)
from fpsolve.exponent import principal_pair, spectrum
from fpsolve.fem import Generator
from fpsolve.model import Noises, Telegraph
from tests.oracles import planar

UNIT = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
EXACT = NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95)


def oscillator(epsilon: float) -> VibroImpactOscillator:
    return VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=epsilon)


def drawn(rng: np.random.Generator) -> CylinderMesh:
    """Irregular lines, degrees 1 to 8, half or full circle, intervals of unequal ends."""
    ends = [0, np.pi / 2, 3 * np.pi / 2, 2 * np.pi] if rng.random() < 0.3 else [np.pi / 2, 3 * np.pi / 2]
    phi = np.concatenate([ends, rng.uniform(ends[0], ends[-1], rng.integers(0, 4))])
    z = np.concatenate([[-rng.uniform(4, 9), rng.uniform(4, 9)], rng.uniform(-4, 4, rng.integers(0, 4))])
    return CylinderMesh(np.sort(phi), np.sort(z), int(rng.integers(1, 9)), int(rng.integers(1, 9)))


def check(generator: Generator, p: float) -> None:
    rightmost, pair = spectrum(generator, p, 1)[0], principal_pair(generator, p)
    assert abs(rightmost.imag) < 1e-10
    assert rightmost.real == pytest.approx(pair.value, abs=1e-10)
    assert pair.residual < 1e-13


@pytest.mark.parametrize("count", [20, pytest.param(100, marks=pytest.mark.slow)])
def test_nothing_lies_right_of_the_principal_eigenvalue_on_random_meshes(rng, count):
    """Continuous elements in φ fail this: their zigzag mode, mixed in by the impact, lies to the right."""
    parities = []
    while len(parities) < count:
        generator = Generator(
            Problem(oscillator(0.1), EXACT if rng.random() < 0.3 else EXACT.ou_reduction()), drawn(rng)
        )
        if generator.size <= 350:
            check(generator, rng.uniform(-2, 6))
            parities.append(generator.size % 2)
    assert 0.1 * count < sum(parities) < 0.9 * count  # even and odd numbers of unknowns


@pytest.mark.slow
@pytest.mark.parametrize(("epsilon", "p"), [(1.0, 1.0), (0.5, -2.0), (0.5, 3.0)])
def test_nothing_lies_right_of_the_principal_eigenvalue_in_strong_noise(epsilon, p):
    mesh = make_mesh(phi_cells=4, phi_degree=6, xi_cells=5, xi_degree=6, xi_min=-6, xi_max=7)
    check(Generator(Problem(oscillator(epsilon), UNIT), mesh), p)


@pytest.mark.parametrize(
    "problem",
    [
        Problem(oscillator(0.1), EXACT.ou_reduction()),
        Problem(oscillator(1.0), EXACT),
        Problem(oscillator(0.1), NonGaussianNoise(D0=1.0, tau0=20.0, r0=1.0).ou_reduction()),
    ],
    ids=["weak", "strong", "slow"],
)
@pytest.mark.parametrize("rtol", [1e-1, 1e-2, 1e-3])
def test_nothing_lies_right_of_the_principal_eigenvalue_of_what_is_chosen(problem, rtol):
    for p in (-1.5, 0.7, 2.0):
        pair = ExponentSolver(problem, rtol=rtol).pair(p)
        assert spectrum(pair.generator, p, 1)[0].real <= pair.value + 1e-8 * max(1.0, abs(pair.value))


def test_spectrum_beside_the_principal_pair_is_that_without_another_weak_noise():
    """Without upwinding by the chain beside the Gaussian noise a pair that no path has stood at -3e-4."""
    turned = PlaneSystem.of_equations(
        ("x", "v"), ("3*a*v + 0.5*x + b*x", "-3*a*x - 0.5*v - b*v"), noises={"a": "noise.a", "b": "noise.b"}
    )
    alone = PlaneSystem.of_equations(("x", "v"), ("3*xi*v + 0.5*x", "-3*xi*x - 0.5*v"))
    chain = Telegraph(1.0, 0.05)
    both = Noises({"a": chain, "b": OrnsteinUhlenbeck(1.0, 0.02)})
    pairs = [ExponentSolver(each, rtol=1e-4).pair(2.0) for each in (Problem(turned, both), Problem(alone, chain))]
    ours, right = (spectrum(each.generator, 2.0, 3) for each in pairs)
    np.testing.assert_allclose(ours, right, atol=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("p", [-1.0, 2.0])
def test_spectrum_of_the_full_circle_is_that_of_fourier_series(p):
    mesh = make_mesh(full_circle=True, phi_degree=11, xi_cells=2, xi_degree=11)
    own = Problem(oscillator(0.3), OrnsteinUhlenbeck(alpha=1.2, sigma=0.9))
    values = spectrum(Generator(own, mesh), p, 7)
    right = []
    for turn in (0.0, 1j * np.pi / p):  # exp(iφ) times what has the period π
        matrix, *_ = planar.of_paper(own.system, own.noise, turn).generator(p, 12, 14)
        right += [*np.linalg.eigvals(matrix.toarray())]
    right = sorted(right, key=lambda each: -each.real)[:7]
    by_frequency = [np.sort_complex(1j * np.array(each)) for each in (values, right)]
    np.testing.assert_allclose(*by_frequency, atol=1e-8)
    assert np.all(np.diff(values.real) < 1e-10)


def test_pair_of_a_mesh_solves_both_eigenproblems_and_is_normalised():
    generator = Generator(Problem(oscillator(0.1), UNIT), make_mesh())
    pair, again = (principal_pair(generator, 2.0) for _ in range(2))
    operator, space = generator.matrix(2.0), generator.space(2.0)
    assert np.linalg.norm(operator @ pair.right - pair.value * (space.mass @ pair.right)) < 1e-12
    assert np.linalg.norm(operator.T @ pair.left - pair.value * (space.mass @ pair.left)) < 1e-12
    assert pair.left @ (space.mass @ pair.right) * 2 == pytest.approx(1, rel=1e-13)  # twice the half circle
    one = space.constant
    assert one @ (space.mass @ pair.right) == pytest.approx(one @ (space.mass @ one), rel=1e-13)
    assert pair.sign_defects == (0, 0)
    np.testing.assert_array_equal(again.right, pair.right)
