"""LU factors of Kronecker sums, dense, by levels and sparse, against one dense solve."""

import os
import sys
from itertools import product
from subprocess import run

import numpy as np
import pytest
from scipy.sparse import csr_matrix, identity, kron, random

from fpsolve import ExponentSolver, NonGaussianNoise, OrnsteinUhlenbeck, Problem, VibroImpactOscillator
from fpsolve.errors import SingularMatrix
from fpsolve.fem import Generator
from fpsolve.fem.axis import KroneckerSum
from fpsolve.fem.factors import FEW_UNKNOWNS, DenseFactors, SparseFactors, candidates, factorised
from fpsolve.fem.levels import LevelFactors, multiples, neighbours, paired
from fpsolve.fem.noise_axes import PolynomialAxis, StateAxis
from fpsolve.fem.phase import PhaseAxis
from fpsolve.fem.refined import RefinedFactors
from fpsolve.fem.rings import RingFactors
from fpsolve.fem.space import Space
from fpsolve.model import Telegraph, White

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
    return LevelFactors(operator, neighbours(operator, axis, None), axis)


def made(factors):
    factors.make()
    return factors


@pytest.mark.parametrize("kind", [DenseFactors, by_levels, SparseFactors])
def test_all_kinds_solve_the_same_systems(operator, kind, rng):
    factors, matrix, b = made(kind(operator)), operator.toarray(), rng.standard_normal(operator.size)
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


def test_the_kind_follows_from_the_operations(rng):
    def sum_of(m, n, band):
        return KroneckerSum([(np.eye(m) + 0.1 * rng.standard_normal((m, m)), banded(rng, n, band) + 5 * np.eye(n))])

    assert isinstance(factorised(sum_of(10, 5, 4)), DenseFactors)
    m = FEW_UNKNOWNS // 10
    assert isinstance(factorised(sum_of(m, 12, 1)), LevelFactors)
    many = KroneckerSum([(identity(800, format="csr"), banded(rng, 5, 1) + 5 * np.eye(5))])
    assert isinstance(factorised(many), SparseFactors)


def test_operations_are_counted(rng):
    """A dense LU has ⅔N³; of n equal levels of m functions each but the last has two products of 2m³ beside its own."""
    m, n = 400, 10
    operator = KroneckerSum([(rng.standard_normal((m, m)), banded(rng, n, 1))])
    plain, chosen = DenseFactors(operator), by_levels(operator)
    assert plain.operations == pytest.approx(2 / 3 * (m * n) ** 3)
    assert chosen.operations == pytest.approx((2 / 3 * n + 4 * (n - 1)) * m**3, rel=0.01)
    found = list(candidates(operator, (), False, None))
    assert min(found, key=lambda each: each.operations).operations <= chosen.operations


def test_a_singular_matrix_gives_its_null_vector():
    phase = np.diag([0.0, 1.0, 2.0])
    for kind in (DenseFactors, by_levels, SparseFactors):
        found = made(kind(KroneckerSum([(phase, np.eye(2))]))).solve(np.ones(6))
        assert np.all(np.isfinite(found))
        assert abs(found[0]) > 1e10 * abs(found[-1])


def test_levels_that_are_singular_alone_go_in_pairs(rng):
    """As those of a filter do: noise damps one of two functions, and turns them into each other."""
    count = 40
    noise = np.diag(np.arange(count) % 2 - 1.0) + np.diag(np.sqrt(np.arange(1.0, count)), 1)
    noise -= np.diag(np.sqrt(np.arange(1.0, count)), -1)
    phase = rng.standard_normal((12, 12)) - 8.0 * np.eye(12)
    phase[0] = 0.0
    operator = KroneckerSum([(phase, np.eye(count)), (np.eye(12), noise)])
    levels = [np.array([k]) for k in range(count)]
    with pytest.raises(SingularMatrix):
        LevelFactors(operator, levels).make()
    found, b = made(LevelFactors(operator, paired(levels))), rng.standard_normal(operator.size)
    matrix = operator.toarray()
    np.testing.assert_allclose(found.solve(b), np.linalg.solve(matrix, b), rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(found.solve(b, transposed=True), np.linalg.solve(matrix.T, b), rtol=1e-9, atol=1e-11)


def test_single_precision_is_refined(rng):
    """The solution by levels of a noise is that of the matrix, also next to an eigenvalue, whose vector it is."""
    noise = banded(rng, 7, 1)
    phase = csr_matrix(rng.standard_normal((60, 60)))
    operator = KroneckerSum(
        [(phase - 30 * identity(60), np.eye(7)), (csr_matrix(rng.standard_normal((60, 60))), noise)]
    )
    value = np.max(np.linalg.eigvals(operator.toarray()).real)
    b = rng.standard_normal(operator.size)
    for shift in (0.0, value + 1e-3, value + 1e-9):
        shifted = operator.shifted(shift)
        matrix = shifted.toarray()
        rough = LevelFactors(shifted, neighbours(shifted, 1, None), precision=np.float32)
        factors = made(RefinedFactors(shifted, rough))
        for transposed, expected in ((False, matrix), (True, matrix.T)):
            x = factors.solve(b, transposed=transposed)
            error = np.linalg.norm(expected @ x - b) / (np.linalg.norm(expected) * np.linalg.norm(x))
            assert error < 1e-15
            plain = rough.solve(b, transposed=transposed)
            assert np.linalg.norm(expected @ plain - b) > 1e4 * error * np.linalg.norm(expected) * np.linalg.norm(plain)


@pytest.mark.parametrize("farthest", [3, 20])
def test_levels_of_the_first_axis(farthest, rng):
    """A thin band of the first axis, each of its functions with all of the noise's; impacts lead farther upwards."""
    first = [banded(rng, 90, 3) + 9 * np.eye(90) for _ in range(2)]
    row, column = np.indices((90, 90))
    is_hit = (row % 3 == 1) & (column - row > 3) & (column - row <= farthest)
    first[1] += np.where(is_hit, rng.standard_normal((90, 90)), 0.0)
    noises = [np.eye(6), banded(rng, 6, 1)]
    operator = KroneckerSum([(csr_matrix(phase), noise) for phase, noise in zip(first, noises, strict=True)])
    levels = np.split(np.arange(90), range(3, 90, 3))
    found, matrix = made(LevelFactors(operator, levels, 0)), operator.toarray()
    assert found.operations in [each.operations for each in candidates(operator, [levels, None], False, None)]
    b = rng.standard_normal(operator.size)
    np.testing.assert_allclose(found.solve(b), np.linalg.solve(matrix, b), rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(found.solve(b, transposed=True), np.linalg.solve(matrix.T, b), rtol=1e-8, atol=1e-10)


@pytest.mark.parametrize(
    "noise",
    [OrnsteinUhlenbeck(alpha=0.8, sigma=0.9), NonGaussianNoise(D0=0.5, tau0=0.6, r0=0.6), Telegraph(0.7, 1.1)],
    ids=["one diagonal", "three", "states"],
)
@pytest.mark.parametrize("degrees", [[4, 4, 4], [7, 2, 5, 5, 3, 1]])
def test_cells_of_a_ring_one_after_the_other(noise, degrees, rng):
    """Any number of cells, of unequal degrees, whose phase turns both ways for some ξ."""
    problem = Problem(VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.9), noise)
    lines = 0.5 * np.pi + np.pi * np.linspace(0, 1, len(degrees) + 1) ** 1.2
    axis = StateAxis(noise) if noise.has_states else PolynomialAxis(noise, 9, 0.2)
    pencil = Generator(problem, Space((PhaseAxis(lines, np.array(degrees)), axis))).at(1.3)
    operator, b = pencil.matrix.shifted(0.7), rng.standard_normal(pencil.space.size)
    factors, matrix = made(RefinedFactors(operator, RingFactors(operator, pencil.ring))), operator.toarray()
    for transposed, expected in ((False, matrix), (True, matrix.T)):
        np.testing.assert_allclose(factors.solve(b, transposed=transposed), np.linalg.solve(expected, b), rtol=1e-9)


def test_a_ring_next_to_an_eigenvalue():
    """Slow, strong noise: elimination alone leaves a residual of 1e-13 ‖A‖‖x‖, and refining that does not help."""
    noise = NonGaussianNoise(D0=520.0, tau0=100.0, r0=0.8).ou_reduction()
    problem = Problem(VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0), noise)
    pair = ExponentSolver(problem, rtol=1e-6).solution(-3.0).pair
    pencil = pair.generator.at(-3.0)
    for off, (b, transposed) in product((0.0, 1e-9), ((pair.right, False), (pair.left, True))):
        operator = pencil.matrix.shifted(pair.eigenvalue * (1 + off))
        factors = made(RefinedFactors(operator, RingFactors(operator, pencil.ring)))
        x = factors.solve(pair.space.weighed(b), transposed=transposed)
        rest = (operator.T if transposed else operator) @ x - pair.space.weighed(b)
        assert np.linalg.norm(rest) < 1e-15 * operator.norm * np.linalg.norm(x)
        assert abs(x @ b) == pytest.approx(np.linalg.norm(x) * np.linalg.norm(b), rel=1e-9)


def test_white_noise_couples_more_than_the_ends_of_cells():
    problem = Problem(VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.9), White(0.4))
    lines = 0.5 * np.pi + np.pi * np.linspace(0, 1, 4)
    assert Generator(problem, Space((PhaseAxis(lines, np.full(3, 5)), StateAxis(White(0.4))))).at(1.0).ring is None


def test_few_rows_tell_all_others(rng):
    """Of twelve rows three are their own, one is 0, and one has zeros alone."""
    own, factors = rng.standard_normal((3, 9)), rng.standard_normal((12, 3)) * np.eye(3)[np.arange(12) % 3]
    table = factors @ own
    table[4] = table[7] = 0.0
    matrix = csr_matrix(np.where(np.arange(12)[:, None] == 7, 1.0, table))
    matrix.data[matrix.indptr[7] : matrix.indptr[8]] = 0.0
    rows, found = multiples(matrix)
    assert rows.size == 3
    np.testing.assert_allclose((found @ matrix[rows]).toarray(), table, atol=1e-13)
    plain = csr_matrix(rng.standard_normal((5, 4)))
    rows, found = multiples(plain)
    assert rows.size == 5
    np.testing.assert_array_equal((found @ plain[rows]).toarray(), plain.toarray())
