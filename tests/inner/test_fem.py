"""Factors of Kronecker sums, and functions on spheres of directions."""

import os
import sys
from dataclasses import replace
from subprocess import run

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.sparse import csr_matrix

from fpsolve.arrays import identity, one
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.directions import HalfSphereAxis
from fpsolve.fem.factors import ArrayFactors, LevelFactors, SparseFactors
from fpsolve.fem.noise_axes import StateAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.space import Space, first_axis
from fpsolve.model import Bounded, NonGaussianNoise, OrnsteinUhlenbeck, Telegraph

TWO_THREADS = """
from threading import Event, Thread
from threadpoolctl import threadpool_info
import fpsolve, scipy.linalg
from fpsolve.fem.factors import one_thread

def count():
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

def body(own, other, first):
    if not first:
        other.wait()
    with one_thread(), one_thread():
        assert count() == {1}
        own.set()
        other.wait()

events, before = (Event(), Event()), count()
threads = [Thread(target=body, args=(events[k], events[1 - k], k == 0)) for k in (0, 1)]
for each in threads:
    each.start()
for each in threads:
    each.join()
assert count() == before
"""


@pytest.mark.slow
def test_one_thread_of_blas_in_two_threads_at_once_is_undone():
    several = dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"), "2")
    run([sys.executable, "-c", TWO_THREADS], env=os.environ | several, check=True)


def random_sum(rng, *sizes):
    """Each term has a band of neighbours in all axes but the first."""

    def banded(n):
        apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
        return np.where(apart <= 1, rng.standard_normal((n, n)), 0.0) + 3 * np.eye(n)

    def some(first, *others):
        return [rng.standard_normal((first, first)) + 4 * np.eye(first), *map(banded, others)]

    return KroneckerSum([some(*sizes) for _ in range(3)])


def undamped(rng, count=13):
    """Of 1, cos kθ, sin kθ a turn takes one to the other: the pivot of one alone would be as singular as ξ = 0."""
    size = 2 * count + 1
    turn = np.zeros((size, size))
    for k in range(1, count + 1):
        turn[2 * k - 1, 2 * k], turn[2 * k, 2 * k - 1] = k, -k
    xi, phase = np.diag(np.ones(size - 2), 2) + np.diag(np.ones(size - 2), -2), rng.standard_normal((30, 30))
    phase[0] = 0.3 * np.eye(30)[0]
    return KroneckerSum([(phase, np.eye(size)), (np.eye(30), turn), (0.1 * np.eye(30), xi)])


@pytest.mark.parametrize("sizes", [(7, 5), (4, 3, 5), None], ids=str)
def test_all_kinds_of_factors_solve_the_same_equations(rng, sizes):
    operator = random_sum(rng, *sizes) if sizes else undamped(rng)
    b, several = rng.standard_normal(operator.size), rng.standard_normal((operator.size, 3))
    matrix = sum(np.kron(term[0], np.kron(*term[1:]) if len(term) > 2 else term[1]) for term in operator.terms)
    by_levels = [LevelFactors(operator, axis) for axis in range(1, len(operator.shape))]
    mixed = KroneckerSum([(csr_matrix(first), *others) for first, *others in operator.terms])
    for each in (operator, mixed):
        assert_allclose(each.tocsc().toarray(), matrix, atol=1e-12)
        assert_allclose(each.T @ b, matrix.T @ b, atol=1e-9)
    for factors in (ArrayFactors(matrix.copy()), *by_levels, SparseFactors(operator)):
        assert_allclose(factors.solve(several), np.linalg.solve(matrix, several), rtol=1e-8, atol=1e-10)
        assert_allclose(factors.solve(b, transposed=True), np.linalg.solve(matrix.T, b), rtol=1e-8, atol=1e-10)


def test_share_of_what_is_negative_is_that_of_phi_and_not_of_thin_cells():
    lines = np.pi / 2 + np.array([0.0, 0.01, 0.02, 0.03, np.pi])
    phi = PhaseAxis(lines, np.full(4, 2))
    space = Space([phi, StateAxis(Telegraph(1.0, 1.0))])
    below = np.where(phi.cells < 3, -phi.constant, phi.constant)
    measure, values = space.on_grid(space.product([below, np.ones(2)]))
    assert measure[values < 0].sum() / measure.sum() == pytest.approx(0.03 / np.pi)


@pytest.mark.parametrize(
    "noise", [OrnsteinUhlenbeck(1.0, 1.0), NonGaussianNoise(1.0, 0.5, 0.9), Bounded(1.0, 1.0, 1.0)]
)
def test_axis_has_the_band_of_its_matrices_by_which_memory_is_foreseen(noise):
    axis = replace(first_axis(noise, 8.0), **({"slope": 0.3} if noise.basis == "polynomials" else {}))
    places = [np.nonzero(axis.matrix(g)) for g in (one, identity, None)]
    assert axis.band == max(int(np.abs(rows - columns).max(initial=0)) for rows, columns in places)


HALF = HalfSphereAxis(np.eye(4), np.array([0, np.pi / 2]), 10, 2, np.array([-0.5, 0.5]) * np.pi, 12)


def fitted(axis, *forms):
    """Coefficients of functions with the values eᵀQe, shape (size, forms)."""
    points = np.random.default_rng(1).standard_normal((4, 4 * axis.size))
    points[0] = np.abs(points[0])
    points /= np.linalg.norm(points, axis=0)
    table = axis.at(points)
    return np.linalg.lstsq(table, np.stack([np.einsum("ix,ij,jx->x", points, form, points) for form in forms], 1))[0]


def test_impact_on_the_half_sphere_keeps_the_other_mode():
    """T = ‖x₂‖² has no load, so that ‖x₁‖² has that of ‖x‖²; by p and by ln R it has the slopes of its values."""
    log, step = np.log(0.7), 1e-5
    load, (first, second) = HALF.struck(log, 2.0, 0), fitted(HALF, np.diag([1, 1, 0, 0]), np.diag([0, 0, 1, 1])).T
    assert_allclose(load @ second, 0, atol=1e-7)
    assert_allclose(load @ first, load @ HALF.constant, atol=1e-7)
    for k in (0, 1):
        by_p = HALF.struck(log, 1.3 + step, k) - HALF.struck(log, 1.3 - step, k)
        by_log = HALF.struck(log + step, 1.3, k) - HALF.struck(log - step, 1.3, k)
        for rise, slope in ((by_p, HALF.struck(log, 1.3, k + 1)), (by_log, HALF.changed_impacts(log, 1.3, k))):
            assert_allclose(rise.toarray() / (2 * step), slope.toarray(), atol=1e-7)
