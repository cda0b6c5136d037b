"""Two noises at once: φ ⊗ ξ₁ ⊗ ξ₂ by the same axes, terms and factors, against moment equations without a phase."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.exponent.eigen import rayleigh_iteration
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.factors import ArrayFactors, LevelFactors, SparseFactors, neighbours
from fpsolve.fem.generator import Pencil
from fpsolve.fem.noise_axes import PolynomialAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.space import Space
from fpsolve.fem.terms import Terms, TermSum
from fpsolve.model import CoefficientMatrix
from tests.oracles import two_noises

ROTATION, STIFFNESS, DAMPING = ((0.0, 1.0), (-1.0, -0.1)), ((0.0, 0.0), (-1.0, 0.0)), ((0.0, 0.0), (0.0, -1.0))
NOISES = OrnsteinUhlenbeck(alpha=1.0, sigma=0.3), OrnsteinUhlenbeck(alpha=0.7, sigma=0.2)


def pencil(p, cells=4, degree=8, count=11):
    """L(p) of ẍ + (0.1 + ξ₂)ẋ + (1 + ξ₁)x = 0."""
    lines = np.linspace(np.pi / 2, 3 * np.pi / 2, cells + 1)
    phase = PhaseAxis(lines, np.full(cells, degree))
    space = Space((phase, *(PolynomialAxis(noise, count) for noise in NOISES)))
    terms = [
        CoefficientMatrix(0, ((0.0, 1.0), (-1.0, 0.0))),
        CoefficientMatrix(1, ((0.0, 0.0), (0.0, -0.1))),
        CoefficientMatrix(1, STIFFNESS, identity, "axial"),
        CoefficientMatrix(1, DAMPING, identity, "lateral"),
    ]
    problem = Problem(PlaneSystem(terms), dict(zip(("axial", "lateral"), NOISES, strict=True)))
    matrix = TermSum(Terms(problem, space).whole()).matrix(space, p)
    return Pencil(p, space, matrix, space.chain)


@pytest.mark.slow
def test_two_noises_against_the_moment_hierarchy():
    deviations, alphas = [noise.standard_deviation for noise in NOISES], [noise.alpha for noise in NOISES]
    x = y = pencil(2.0).space.constant
    for p in (2.0, 3.0, 4.0):
        at = pencil(p)
        found = rayleigh_iteration(at, x, y)
        x, y = found.x, found.y
        assert found.residual < 1e-13
        if p % 2 == 0:
            exact = two_noises.moment_lyapunov((ROTATION, STIFFNESS, DAMPING), alphas, deviations, int(p), 14)
            assert found.value == pytest.approx(exact, abs=1e-10)
        values = at.space.evaluate(x, at.space.phi.inner_values, *(axis.values for axis in at.space.axes[1:]))
        measure = np.multiply.outer(*(axis.measure for axis in at.space.axes[1:]))
        signs = [np.sum(np.abs(values) * measure * (sign * values > 0)) for sign in (1, -1)]
        assert min(signs) < 1e-3 * max(signs)


def test_constants_are_in_the_kernel():
    at = pencil(0.0, cells=2, degree=4, count=4)
    assert np.max(np.abs(at.matrix @ at.space.constant)) < 1e-13


@pytest.fixture
def operator(rng):
    def some(n, k):
        full = rng.standard_normal((n, n)) + 4 * k * np.eye(n)
        return np.where(np.abs(np.subtract.outer(np.arange(n), np.arange(n))) <= 1, full, 0.0)

    return KroneckerSum([(some(4, k), some(3, k + 1), some(5, k + 1)) for k in range(3)])


def test_sums_of_three_factors(operator, rng):
    matrix = sum(np.kron(np.kron(a, b), c) for a, b, c in operator.terms)
    v = rng.standard_normal(operator.size)
    assert operator.shape == (4, 3, 5)
    np.testing.assert_allclose(operator.toarray(), matrix, atol=1e-12)
    np.testing.assert_allclose(operator.tocsc().toarray(), matrix, atol=1e-12)
    np.testing.assert_allclose(operator @ v, matrix @ v, atol=1e-10)
    np.testing.assert_allclose(operator.T @ v, matrix.T @ v, atol=1e-10)
    assert np.all(abs(operator) @ abs(v) >= np.abs(matrix) @ abs(v) - 1e-9)
    assert operator.norm >= np.abs(matrix).sum(axis=0).max() - 1e-9
    rest = np.kron(*operator.terms[0][1:])
    np.testing.assert_allclose(operator.shifted(0.3).toarray(), matrix - 0.3 * np.kron(np.eye(4), rest), atol=1e-12)
    by_levels = [LevelFactors(operator, neighbours(operator, axis), axis) for axis in (1, 2)]
    for factors in (ArrayFactors(matrix.copy()), *by_levels, SparseFactors(operator)):
        np.testing.assert_allclose(factors.solve(v), np.linalg.solve(matrix, v), rtol=1e-8, atol=1e-10)
        np.testing.assert_allclose(
            factors.solve(v, transposed=True), np.linalg.solve(matrix.T, v), rtol=1e-8, atol=1e-10
        )


def test_sparse_factors_among_dense_ones(operator, rng):
    mixed = KroneckerSum([(csr_matrix(a), b, c) for a, b, c in operator.terms])
    v = rng.standard_normal(operator.size)
    np.testing.assert_allclose(mixed.tocsc().toarray(), operator.toarray(), atol=1e-12)
    np.testing.assert_allclose(mixed @ v, operator @ v, atol=1e-10)
    np.testing.assert_allclose(mixed.shifted(0.3).tocsc().toarray(), operator.shifted(0.3).toarray(), atol=1e-12)
