"""Harmonics of the sphere of directions: identities of the components, of flows, and the elements as another code."""

import numpy as np
import pytest

from fpsolve import Problem
from fpsolve.arrays import identity
from fpsolve.exponent import principal_pair
from fpsolve.fem import Generator
from fpsolve.fem.harmonics import HarmonicAxis, Harmonics
from fpsolve.fem.noise_axes import StateAxis
from fpsolve.fem.space import Space, first_axis
from fpsolve.fem.sphere import SphereAxis
from fpsolve.model import CoefficientMatrix, LinearSystem, Telegraph, White


def axis(n, most=6):
    return HarmonicAxis(tuple(map(tuple, np.eye(n).tolist())), most)


@pytest.mark.parametrize("n", [3, 4])
def test_their_number_and_the_components(n):
    """Polynomials of even degree ≤ 6 of a unit vector, Σ e_i² = 1, and a mean of 1/n of each e_i²."""
    found = Harmonics.of(n, 6)
    assert np.count_nonzero(found.own) == {3: 28, 4: 84}[n]
    total = sum(found.products[i, i] for i in range(n)).toarray()
    np.testing.assert_allclose(total[:, found.own], np.eye(len(total))[:, found.own], atol=1e-12)
    assert [found.products[i, i][0, 0] for i in range(n)] == pytest.approx([1 / n] * n)


@pytest.mark.parametrize("n", [3, 4])
def test_what_a_matrix_does(n):
    """h·∇ 1 = 0; ∫ h·∇(uv) = −∫ uv div h, div h = tr X − n q; a rotation has no growth and is antisymmetric."""
    x = np.random.default_rng(n).standard_normal((n, n))
    functions = axis(n)
    moved, growth = functions.driven(x)
    unit = np.eye(functions.size)
    np.testing.assert_allclose(moved @ functions.constant, 0, atol=1e-12)
    np.testing.assert_allclose(moved + moved.T, n * growth - np.trace(x) * unit, atol=1e-11)
    turning, none = functions.driven(x - x.T)
    np.testing.assert_allclose(turning + turning.T, 0, atol=1e-11)
    np.testing.assert_allclose(none, 0, atol=1e-12)


@pytest.mark.parametrize("n", [3, 4])
def test_a_quadratic_form(n):
    """u = eᵀQe is a polynomial: h·∇u + 2 q u = eᵀ(XᵀQ + QX)e, as of E‖x‖²; and twice so for white noise."""
    rng = np.random.default_rng(10 + n)
    x, half = rng.standard_normal((2, n, n))
    q = half + half.T
    functions = axis(n)

    def form(matrix):
        return functions.driven(0.5 * (matrix + matrix.T))[1] @ functions.constant

    moved, growth = functions.driven(x)
    driven = x.T @ q + q @ x
    np.testing.assert_allclose((moved + 2 * growth) @ form(q), form(driven), atol=1e-11)
    free, linear, square = functions.diffusion(x, x)
    np.testing.assert_allclose((free + 2 * linear + 4 * square) @ form(q), form(x.T @ driven + driven @ x), atol=1e-10)


@pytest.mark.parametrize("n", [3, 4])
def test_a_space_grows(n):
    own, finer = axis(n), axis(n).enriched()
    assert finer.size == axis(n, 8).size
    assert Space((own, StateAxis(Telegraph(a=1.0, k=1.0)))).size == 2 * own.size
    assert finer.projection(own) @ own.constant == pytest.approx(finer.constant)


@pytest.mark.parametrize(
    ("n", "harmonics", "waves", "tolerance"), [(3, 20, 14, 1e-6), pytest.param(4, 12, 10, 5e-6, marks=pytest.mark.slow)]
)
def test_another_code(n, harmonics, waves, tolerance):
    """Λ(1) by continuous elements and waves, in strong white noise."""
    rng = np.random.default_rng(n)
    turn, driven = rng.standard_normal((2, n, n))
    terms = (
        CoefficientMatrix(0, (turn - turn.T - 0.3 * np.eye(n)).tolist()),
        CoefficientMatrix(1, (0.5 * driven).tolist(), identity),
    )
    problem = Problem(LinearSystem(terms), White(s=1.0))
    coordinates = axis(n).coordinates
    noises = tuple(first_axis(noise, 8.0) for noise in problem.coloured.parts.values())
    values = []
    for cells in (
        HarmonicAxis(coordinates, harmonics),
        SphereAxis(coordinates, np.linspace(0, np.pi / 2, 3), 8, waves),
    ):
        generator = Generator(problem, Space((cells, *noises)))
        pair = principal_pair(generator, 1.0, start=principal_pair(generator, 0.0))
        values.append(pair.value)
        assert np.min(generator.phi.inner_values @ pair.space.table(pair.right)[:, 0]) > 0
    assert values[0] == pytest.approx(values[1], abs=tolerance)
