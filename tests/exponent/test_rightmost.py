"""Λ(p) is the rightmost eigenvalue where others have T ≥ 0, too: saddles and nodes under noises of two dimensions.

Where the phase rests T is about |x|^(p−k) |v|^k for the k-th pair, x along the faster mode and v along the other, and
for even k its sign does not change.
"""

import math

import numpy as np
import pytest

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, moment_lyapunov
from fpsolve.arrays import identity
from fpsolve.errors import NotConverged
from fpsolve.exponent import Budget
from fpsolve.exponent.eigen import LEAST_OF_MOST, principal_pair, spectrum
from fpsolve.fem.generator import Pencil
from fpsolve.model import CoefficientMatrix, Filter, MarkovChain
from fpsolve.theory.frozen import swing
from tests.conftest import sampled
from tests.oracles import filtered
from tests.oracles.moment_hierarchy import gaussian, several_exponent

NODE = ((-1.0115024817178828, 0.027976596819670015), (3.2543543385618436, -2.1504180261123937))
LOWER, RIGHT = ((0.0, 0.0), (1.0, 0.0)), ((0.0, 0.0), (0.0, 1.0))
A = OrnsteinUhlenbeck(alpha=37.431388258716034, sigma=32.74906196496099)
B = OrnsteinUhlenbeck(alpha=32.63567554169098, sigma=8.536346218849552)
SADDLE = ((-0.5727022764659979, 0.03844029130717129), (-0.38124973260501926, 0.4070870137016061))
DRIVEN = ((0.4281962803847412, -0.8337860010391915), (-0.25061621100201587, -0.24215772694411056))
LAW = (1.4957362099052074, 0.3305436240665941, 0.05885385917131965, 2.237226809621595, 0.9888121349393983)


@pytest.mark.parametrize("p", sampled(2, 4, 6, keep=2))
def test_a_node_under_two_noises(p):
    terms = [CoefficientMatrix(0, NODE)]
    terms += [CoefficientMatrix(0, matrix, identity, name) for matrix, name in ((LOWER, "a"), (RIGHT, "b"))]
    coloured = [gaussian(each, noise.alpha, noise.standard_deviation, 12) for each, noise in ((LOWER, A), (RIGHT, B))]
    expected = several_exponent(NODE, coloured, [], p, 0.0)
    found = ExponentSolver(Problem(PlaneSystem(terms), {"a": A, "b": B})).solution(p)
    assert found.pair.value == pytest.approx(expected, abs=1.5 * found.error)
    assert found.error < 1e-7


@pytest.mark.parametrize("p", [2, 4, 6])
def test_a_saddle_under_a_filter(p):
    terms = [CoefficientMatrix(0, SADDLE), CoefficientMatrix(0, DRIVEN, identity)]
    noise = Filter(**dict(zip(("omega", "zeta", "s", "c0", "c1"), LAW, strict=True)))
    found = ExponentSolver(Problem(PlaneSystem(terms), noise)).solution(p)
    expected, other = (filtered.moment_lyapunov(SADDLE, DRIVEN, LAW, p, degree) for degree in (9, 10))
    assert found.pair.value == pytest.approx(expected, abs=1.5 * found.error + abs(expected - other))
    assert found.error < 1e-7


def test_moments_are_given_where_elements_fail():
    terms = [CoefficientMatrix(0, SADDLE), CoefficientMatrix(0, DRIVEN, identity)]
    noise = Filter(**dict(zip(("omega", "zeta", "s", "c0", "c1"), LAW, strict=True)))
    with pytest.raises(NotConverged) as failure:
        moment_lyapunov(Problem(PlaneSystem(terms), noise), [3.0, 4.0], budget=Budget(unknowns=100))
    found = failure.value.partial
    assert found.p.tolist() == [4.0]
    assert found.value[0] == pytest.approx(filtered.moment_lyapunov(SADDLE, DRIVEN, LAW, 4, 9), abs=1e-10)
    assert math.isnan(found.derivative[0])
    assert [each.p for each in found.failures] == [3.0]


def test_growth_while_noise_swings():
    """G = |ξ|: the mean over a turn is 2a/π, and the best of 2pa/π − a²/4S is 4p²S/π²; S at the peak of the filter."""
    omega, zeta, s = 1.3, 0.2, 0.7
    problem = Problem(PlaneSystem([CoefficientMatrix(0, ((0, 1), (1, 0)), identity)]), Filter(omega, zeta, s))
    spectrum = s**2 / (4 * zeta**2 * omega**4 * (1 - zeta**2))
    amplitude, rate = swing(problem, 3.0)
    assert rate == pytest.approx(36 * spectrum / math.pi**2, rel=1e-3)
    assert amplitude * problem.noise.standard_deviation == pytest.approx(12 * spectrum / math.pi, rel=1e-2)


@pytest.mark.slow
def test_a_swing_to_both_sides_outdoes_a_steady_value():
    """By moments of orders 2 and 4 Λ(5) is above their chord, and the growth with a steady value of the noise below it.

    The noise is slow and strong, and its spectrum larger where it swings than at 0.
    """
    steady = ((0.0, 0.029), (-0.029, -0.041))
    driven = ((0.041, 0.9), (0.95, 0.1))
    law = 0.018, 0.7, 4e-5, 1.0, 78.0
    problem = Problem(PlaneSystem([CoefficientMatrix(0, steady), CoefficientMatrix(0, driven, identity)]), Filter(*law))
    second, fourth = (filtered.moment_lyapunov(steady, driven, law, q, 26) for q in (2, 4))
    chord = fourth + (fourth - second) / 2
    assert 0.083 < chord < 0.085
    try:
        found = moment_lyapunov(problem, 5.0, rtol=1e-3, budget=Budget(unknowns=5000))
    except NotConverged:
        return
    assert found.value[0] + found.error_estimate[0] > chord


@pytest.mark.parametrize("seed", sampled(*range(6), keep=2))
def test_t_between_positive_bounds_takes_no_other_factors(seed, monkeypatch):
    """No real eigenvalue is to the right of its own."""
    rng, count = np.random.default_rng(seed), []
    rates = 10 ** rng.uniform(-2, 1, (2, 2)) * (1 - np.eye(2))
    drift, driven = np.array([[0, 1], [-1, 0]]) + rng.normal(0, 0.3, (2, 2)), rng.normal(0, 0.6, (2, 2))
    terms = [CoefficientMatrix(0, drift), CoefficientMatrix(0, driven, identity)]
    problem = Problem(PlaneSystem(terms), MarkovChain(tuple(np.sort(rng.normal(size=2))), rates))
    pair, factorised = ExponentSolver(problem).solution(0.02).pair, Pencil.factorised
    values, all_values = pair.space.on_grid(pair.right), spectrum(pair.generator, 0.02, pair.right.size)
    assert np.min(values) > LEAST_OF_MOST * np.max(values)
    assert np.max(all_values.real[all_values.imag == 0]) <= pair.eigenvalue + 1e-9
    monkeypatch.setattr(Pencil, "factorised", lambda *each: count.append(1) or factorised(*each))
    principal_pair(pair.generator, 0.02, start=pair)
    assert len(count) == 1
