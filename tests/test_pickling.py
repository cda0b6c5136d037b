"""Results travel to other processes: they pickle small, and what they solve again is the same."""

import gc
import pickle
import tracemalloc

import numpy as np
import pytest

from fpsolve import ExponentSolver, MomentLyapunovFunction, Problem, VibroImpactOscillator, make_mesh, moment_lyapunov
from fpsolve.errors import CaseError, Fault, NotConverged
from fpsolve.exponent import principal_pair
from fpsolve.fem import Generator
from tests.conftest import FIG1, FIG1_NOISE, UNIT_NOISE

STRONG = VibroImpactOscillator(omega=1.0, restitution=0.9, c1=0.0, epsilon=1.5)


def copied(thing):
    return pickle.loads(pickle.dumps(thing))


@pytest.fixture(scope="module")
def strong_pair():
    """On a mesh where the phase runs backwards at some vertices for some ξ."""
    mesh = make_mesh(phi_cells=12, phi_degree=10, xi_cells=6, xi_degree=9, xi_min=-8, xi_max=10)
    return principal_pair(Generator(Problem(STRONG, UNIT_NOISE), mesh), 1.0)


@pytest.mark.slow
def test_a_pair_of_strong_noise_is_little_more_than_its_vectors(strong_pair):
    assert len(pickle.dumps(strong_pair)) < strong_pair.right.nbytes + strong_pair.left.nbytes + 5000 < 200_000
    pair = copied(strong_pair)
    assert np.array_equal(pair.right, strong_pair.right)
    residual = pair.generator.matrix(1.0) @ pair.right - pair.value * (pair.generator.space(1.0).mass @ pair.right)
    assert np.linalg.norm(residual) < 1e-9 * np.linalg.norm(pair.right)


@pytest.mark.slow
def test_assembling_again_keeps_no_memory(strong_pair):
    def assembled(times):
        for _ in range(times):
            Generator(Problem(STRONG, UNIT_NOISE), strong_pair.generator.chosen).matrix(1.0)
        gc.collect()
        return tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    before, after = assembled(6), assembled(6)
    tracemalloc.stop()
    assert after - before <= 0.1 * 6 * strong_pair.right.nbytes  # not even a tenth of a vector each time


def test_results_pickle():
    noise = FIG1_NOISE.ou_reduction()
    result = moment_lyapunov(Problem(FIG1, noise), [1.0, 2.0])
    again = copied(result)
    assert np.array_equal(again.value, result.value)
    assert again.pairs[0].generator is again.pairs[1].generator
    solver = copied(ExponentSolver(Problem(FIG1, noise)))
    assert solver.solution(2.0).pair.value == pytest.approx(result.value[1], rel=1e-10)
    function = MomentLyapunovFunction(Problem(FIG1, noise), (-1.0, 2.0))
    assert copied(function)(0.7) == function(0.7)


def test_errors_pickle():
    error = copied(CaseError("a.toml", [Fault("noise.D0", 3, "missing")]))
    assert str(error) == "a.toml:3: noise.D0: missing"
    assert error.faults == (Fault("noise.D0", 3, "missing"),)
    with pytest.raises(NotConverged) as caught:
        moment_lyapunov(Problem(STRONG, UNIT_NOISE), [1.0, 40.0], mesh=make_mesh(phi_degree=6, xi_degree=6))
    error = copied(caught.value)
    assert str(error) == str(caught.value)
    assert np.array_equal(error.partial.p, caught.value.partial.p)
