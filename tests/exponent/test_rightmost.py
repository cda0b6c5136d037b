"""Λ(p) is the rightmost eigenvalue where others have T ≥ 0, too: saddles and nodes under noises of two dimensions.

Where the phase rests T is about |x|^(p−k) |v|^k for the k-th pair, x along the faster mode and v along the other, and
for even k its sign does not change.
"""

import pytest

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model import CoefficientMatrix, Filter
from tests.oracles import filtered
from tests.oracles.moment_hierarchy import gaussian, several_exponent

NODE = ((-1.0115024817178828, 0.027976596819670015), (3.2543543385618436, -2.1504180261123937))
LOWER, RIGHT = ((0.0, 0.0), (1.0, 0.0)), ((0.0, 0.0), (0.0, 1.0))
A = OrnsteinUhlenbeck(alpha=37.431388258716034, sigma=32.74906196496099)
B = OrnsteinUhlenbeck(alpha=32.63567554169098, sigma=8.536346218849552)
SADDLE = ((-0.5727022764659979, 0.03844029130717129), (-0.38124973260501926, 0.4070870137016061))
DRIVEN = ((0.4281962803847412, -0.8337860010391915), (-0.25061621100201587, -0.24215772694411056))
LAW = (1.4957362099052074, 0.3305436240665941, 0.05885385917131965, 2.237226809621595, 0.9888121349393983)


@pytest.mark.parametrize("p", [2, 4, 6])
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
    expected = filtered.moment_lyapunov(SADDLE, DRIVEN, LAW, p, 9)
    assert found.pair.value == pytest.approx(expected, abs=1.5 * found.error)
    assert found.error < 1e-7
