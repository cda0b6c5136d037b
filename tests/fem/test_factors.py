"""LU factors of Kronecker sums, dense, by levels and sparse, against one dense solve."""

import os
import sys
from subprocess import run

import numpy as np
import pytest
from scipy.sparse import identity, kron, random

from fpsolve.errors import SingularMatrix
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.factors import FEW_UNKNOWNS, ArrayFactors, LevelFactors, SparseFactors, factorised, neighbours

OVERLAP = """
from threading import Event, Thread
from threadpoolctl import threadpool_info
import fpsolve, scipy.linalg
from fpsolve.fem.factors import one_thread

def count():
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}

def first():
    with one_thread(), one_thread():
        assert count() == {1}
        entered[0].set()
        entered[1].wait()
    left.set()

def second():
    entered[0].wait()
    with one_thread():
        entered[1].set()
        left.wait()

entered, left, before = (Event(), Event()), Event(), count()
threads = [Thread(target=each) for each in (first, second)]
for each in threads:
    each.start()
for each in threads:
    each.join()
assert count() == before
print(before)
"""


@pytest.mark.slow
def test_bodies_that_overlap_in_two_threads_leave_blas_as_it_was():
    """The first one begins and ends before the second one."""
    threads = dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"), "2")
    done = run([sys.executable, "-c", OVERLAP], env=os.environ | threads, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert done.stdout in ("{2}\n", "{1}\n")  # 1 on a machine of one processor


def banded(rng, n, band):
    full = rng.standard_normal((n, n))
    i, j = np.indices((n, n))
    return np.where(abs(i - j) <= band, full, 0.0)


@pytest.fixture(params=[(7, 5, 1), (9, 8, 3), (4, 12, 2), (6, 1, 0)])
def operator(request, rng):
    m, n, band = request.param
    terms = [(rng.standard_normal((m, m)) + 4 * k * np.eye(m), banded(rng, n, band) + 3 * np.eye(n)) for k in range(3)]
    return KroneckerSum(terms)


def by_levels(operator, axis=1):
    return LevelFactors(operator, neighbours(operator, axis), axis)


def of_array(operator):
    return ArrayFactors(operator.toarray())


@pytest.mark.parametrize("kind", [of_array, by_levels, SparseFactors])
def test_all_kinds_solve_the_same_systems(operator, kind, rng):
    factors, matrix, b = kind(operator), operator.toarray(), rng.standard_normal(operator.size)
    np.testing.assert_allclose(factors.solve(b), np.linalg.solve(matrix, b), rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(factors.solve(b, transposed=True), np.linalg.solve(matrix.T, b), rtol=1e-8, atol=1e-10)
    several = rng.standard_normal((operator.size, 3))
    np.testing.assert_allclose(factors.solve(several), np.linalg.solve(matrix, several), rtol=1e-8, atol=1e-10)


def test_products_transposes_and_bounds(operator, rng):
    matrix, v = operator.toarray(), rng.standard_normal(operator.size)
    np.testing.assert_allclose(operator @ v, matrix @ v, atol=1e-12 * np.abs(matrix).max() * operator.size)
    np.testing.assert_allclose(operator.T @ v, matrix.T @ v, atol=1e-12 * np.abs(matrix).max() * operator.size)
    np.testing.assert_allclose(operator.tocsc().toarray(), matrix, atol=1e-12)
    assert np.all(abs(operator) @ abs(v) >= np.abs(matrix) @ abs(v) - 1e-9)
    assert operator.norm >= np.abs(matrix).sum(axis=0).max() - 1e-9
    first = np.kron(np.eye(operator.shape[0]), operator.terms[0][1])
    np.testing.assert_allclose(operator.shifted(0.3).toarray(), matrix - 0.3 * first, atol=1e-12)


def test_the_sparse_matrix_is_that_of_the_products(rng):
    """Whatever entries the factors have, and where columns have none."""
    terms = [tuple(random(n, n, 0.2, "csr", random_state=rng) for n in (9, 6)) for _ in range(3)]
    terms.append((np.eye(9), banded(rng, 6, 1)))
    for some in (terms, terms[:2]):
        found = KroneckerSum(some).tocsc()
        expected = sum(kron(phase, noise) for phase, noise in some).toarray()
        assert found.has_canonical_format
        np.testing.assert_allclose(found.toarray(), expected, atol=1e-14)


def test_the_kind_follows_from_the_size_and_from_a_chain(rng):
    def sum_of(m, n, band):
        return KroneckerSum([(np.eye(m) + 0.1 * rng.standard_normal((m, m)), banded(rng, n, band) + 5 * np.eye(n))])

    assert isinstance(factorised(sum_of(10, 5, 4), 1), ArrayFactors)
    m = FEW_UNKNOWNS // 10
    assert isinstance(factorised(sum_of(m, 12, 1), 1), LevelFactors)
    assert isinstance(factorised(sum_of(m, 12, 1), None), SparseFactors)
    many = KroneckerSum([(identity(800, format="csr"), banded(rng, 5, 1) + 5 * np.eye(5))])
    assert isinstance(factorised(many, None), SparseFactors)


def test_a_singular_matrix_gives_its_null_vector():
    phase = np.diag([0.0, 1.0, 2.0])
    for kind in (of_array, by_levels, SparseFactors):
        found = kind(KroneckerSum([(phase, np.eye(2))])).solve(np.ones(6))
        assert np.all(np.isfinite(found))
        assert abs(found[0]) > 1e10 * abs(found[-1])


def test_both_waves_of_a_noise_without_damping_are_one_level(rng):
    """Of 1, cos kθ, sin kθ a turn takes one to the other: the pivot of one alone would be as singular as ξ = 0."""
    count = 13
    turn = np.zeros((2 * count + 1, 2 * count + 1))
    for k in range(1, count + 1):
        turn[2 * k - 1, 2 * k], turn[2 * k, 2 * k - 1] = k, -k
    xi = np.diag(np.ones(2 * count - 1), 2) + np.diag(np.ones(2 * count - 1), -2)
    phase = rng.standard_normal((30, 30))
    phase[0] = 0.3 * np.eye(30)[0]
    operator = KroneckerSum([(phase, np.eye(2 * count + 1)), (np.eye(30), turn), (0.1 * np.eye(30), xi)])
    with pytest.raises(SingularMatrix):
        LevelFactors(KroneckerSum([(0.0 * phase, np.eye(27)), (np.eye(30), turn)]), [np.array([k]) for k in range(27)])
    found, b, matrix = by_levels(operator), rng.standard_normal(operator.size), operator.toarray()
    assert [group.size for group in neighbours(operator, 1)] == [1, *[2] * count]
    np.testing.assert_allclose(found.solve(b), np.linalg.solve(matrix, b), rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found.solve(b, transposed=True), np.linalg.solve(matrix.T, b), rtol=1e-8, atol=1e-10)
