"""Functions on the half sphere: the impact as a point load, its derivatives, and spaces within each other."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fpsolve.fem.half_sphere import HalfSphereAxis

IDENTITY = tuple(map(tuple, np.eye(4).tolist()))
LOG = np.log(0.7)


@pytest.fixture(scope="module")
def axis():
    return HalfSphereAxis(IDENTITY, np.array([0, 0.8, np.pi / 2]), 4, np.array([-0.5, 0, 0.5]) * np.pi, 4, 2)


def directions(count):
    found = np.random.default_rng(1).standard_normal((4, count))
    found[0] = np.abs(found[0])
    return found / np.linalg.norm(found, axis=0)


def test_functions_of_one_space_are_in_finer_ones(axis):
    points, u = directions(40), np.random.default_rng(0).standard_normal(axis.size)
    assert_allclose(axis.at(points) @ axis.constant, 1, atol=1e-12)
    assert_allclose(axis.inner_values @ axis.constant, 1, atol=1e-12)
    for finer in (*axis.finer, axis.enriched()):
        assert_allclose(finer.at(points) @ (finer.projection(axis) @ u), axis.at(points) @ u, atol=1e-10)
        assert np.count_nonzero(finer.new_in(axis)) == finer.size - axis.size


def fitted(axis, *forms):
    """Coefficients of functions with the values eᵀQe, shape (size, forms)."""
    points = directions(4 * axis.size)
    table = axis.at(points).toarray()
    values = np.stack([np.einsum("ix,ij,jx->x", points, form, points) for form in forms], axis=1)
    return np.linalg.solve(table.T @ table, table.T @ values)


def test_quadratic_forms_move_as_they_do():
    """L xᵀQx = xᵀ(AᵀQ + QA)x of ẋ = Ax, and twice that of white noise, beside another form; the fit errs by 1e-6."""
    axis = HalfSphereAxis(IDENTITY, np.array([0, np.pi / 2]), 10, np.array([-0.5, 0.5]) * np.pi, 12, 2)
    rng = np.random.default_rng(3)
    q, a, b, test = rng.standard_normal((4, 4, 4))
    a[0], b[0] = (0, 1.3, 0, 0), 0

    def moved(by, form):
        return by.T @ form + form @ by

    u, driven, diffused, v = fitted(axis, q, moved(a, q), moved(b, moved(b, q)), test).T
    (free, growth), parts = axis.driven(a), axis.diffusion(b, b)
    assert v @ (free + 2 * growth) @ u == pytest.approx(v @ axis.identity @ driven, rel=1e-5)
    assert v @ sum(2**k * each for k, each in enumerate(parts)) @ u == pytest.approx(
        v @ axis.identity @ diffused, rel=1e-5
    )


def test_an_impact_has_exact_derivatives(axis):
    step = 1e-5
    for k in (0, 1):
        slope = (axis.struck(LOG, 1.3 + step, k) - axis.struck(LOG, 1.3 - step, k)) / (2 * step)
        assert_allclose(slope.toarray(), axis.struck(LOG, 1.3, k + 1).toarray(), atol=1e-8)
        slope = (axis.struck(LOG + step, 1.3, k) - axis.struck(LOG - step, 1.3, k)) / (2 * step)
        assert_allclose(slope.toarray(), axis.changed_impacts(LOG, 1.3, k).toarray(), atol=1e-7)


def test_an_impact_keeps_the_other_mode():
    """T = ‖x₂‖² has no load, so that ‖x₁‖² has that of ‖x‖²."""
    fine = HalfSphereAxis(IDENTITY, np.linspace(0, np.pi / 2, 3), 10, np.array([-0.5, 0.5]) * np.pi, 2, 0)
    first, second = fitted(fine, np.diag([1, 1, 0, 0]), np.diag([0, 0, 1, 1])).T
    assert_allclose(fine.struck(LOG, 2.0) @ second, 0, atol=1e-7)
    assert_allclose(fine.struck(LOG, 2.0) @ first, fine.struck(LOG, 2.0) @ fine.constant, atol=1e-7)


def test_nothing_moves_nothing(axis):
    for each in (*axis.driven(np.zeros((4, 4))), *axis.diffusion(np.zeros((4, 4)), np.eye(4))):
        assert each.shape == (axis.size, axis.size)
        assert abs(each).max() == 0
