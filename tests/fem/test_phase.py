"""Functions of the phase: a degree for each cell, orthonormal polynomials, traces at the vertices."""

import numpy as np
import pytest

from fpsolve.fem.axis import MAX_DENSE_UNKNOWNS
from fpsolve.fem.phase import PhaseAxis
from fpsolve.model.plane import Harmonics

LINES = np.array([np.pi / 2, 2.0, 3.1, 4.0, 3 * np.pi / 2])
WAVE = Harmonics(0.3, -0.4, 0.7)


@pytest.fixture
def space():
    return PhaseAxis(LINES, np.array([3, 7, 1, 2]))


def fine_rule(lines):
    x, w = np.polynomial.legendre.leggauss(40)
    half = np.diff(lines)[:, None] / 2
    return (lines[:-1, None] + half * (1 + x)).ravel(), (half * w).ravel()


def slopes(space, phi, h=1e-5):
    return (space.at(phi + h, phi) - space.at(phi - h, phi)) / (2 * h)


def test_each_cell_has_its_own_degree(space):
    assert space.size == 4 + 8 + 2 + 3
    for cell, degree in enumerate([3, 7, 1, 2]):
        np.testing.assert_array_equal(space.modes[space.cells == cell], np.arange(degree + 1))


def test_the_basis_is_orthonormal_and_spans_the_polynomials(space):
    phi, weights = fine_rule(LINES)
    values = space.at(phi)
    np.testing.assert_allclose((values * weights[:, None]).T @ values, np.eye(space.size), atol=1e-13)
    np.testing.assert_allclose(values @ space.constant, 1, atol=1e-13)
    for cell, degree in enumerate(space.degrees):
        inside = (phi > LINES[cell]) & (phi < LINES[cell + 1])
        power = np.where(inside, (phi - 3) ** degree, 0.0)
        np.testing.assert_allclose(values @ (values.T @ (weights * power)), power, atol=1e-11)


def test_masses_and_convections_of_waves(space):
    phi, weights = fine_rule(LINES)
    values, weighed = space.at(phi), (weights * WAVE(phi))[:, None]
    np.testing.assert_allclose(space.mass(WAVE), (values * weighed).T @ values, atol=1e-13)
    np.testing.assert_allclose(space.convection(WAVE), (values * weighed).T @ slopes(space, phi), atol=1e-6)


def test_convection_is_exact_where_parts_integrate(space):
    """∫ u′v + ∫ u v′ is what the ends of the cells leave."""
    both = space.convection(Harmonics(1.0, 0.0, 0.0))
    upper = np.roll(space.left_trace, -1, axis=0)
    np.testing.assert_allclose(both + both.T, upper.T @ upper - space.right_trace.T @ space.right_trace, atol=1e-12)


def test_traces_are_limits_from_either_side(space):
    vertices = LINES[:-1]
    np.testing.assert_allclose(space.right_trace, space.at(vertices, vertices + 0.1), atol=1e-13)
    ends = LINES[[-1, 1, 2, 3]]
    np.testing.assert_allclose(space.left_trace, space.at(ends, ends - 0.1), atol=1e-13)


def test_projection_keeps_what_both_hold(space):
    coarse = PhaseAxis(LINES[[0, 2, 4]], np.array([1, 1]))
    there, back = space.projection(coarse), coarse.projection(space)
    np.testing.assert_allclose(back @ there, np.eye(coarse.size), atol=1e-13)


def test_large_spaces_are_sparse_and_the_same():
    lines = np.linspace(np.pi / 2, 3 * np.pi / 2, 61)
    large = PhaseAxis(lines, np.full(60, 10))
    assert large.size > MAX_DENSE_UNKNOWNS
    phi, weights = fine_rule(lines)
    values = large.at(phi).toarray()
    expected = (values * (weights * WAVE(phi))[:, None]).T @ values
    np.testing.assert_allclose(large.mass(WAVE).toarray(), expected, atol=1e-12)
    np.testing.assert_allclose(large.right_trace.toarray(), large.at(lines[:-1]).toarray(), atol=1e-12)


def test_sparse_and_dense_spaces_are_carried_into_each_other():
    large = PhaseAxis(np.linspace(np.pi / 2, 3 * np.pi / 2, 61), np.full(60, 10))
    small = PhaseAxis(LINES, np.array([3, 4, 1, 2]))
    u = np.linspace(-1, 1, small.size)
    phi, _ = fine_rule(LINES)
    there = large.projection(PhaseAxis(LINES[[0, -1]], np.array([6]))) @ np.arange(7.0)
    expected = PhaseAxis(LINES[[0, -1]], np.array([6])).at(phi) @ np.arange(7.0)
    np.testing.assert_allclose(large.at(phi) @ there, expected, atol=1e-10)
    assert (small.projection(large) @ (large.projection(small) @ u)).shape == u.shape
