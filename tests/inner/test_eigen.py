"""The principal pair: what it does not depend on, and what would tell that it is another one."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse.linalg import eigs

from fpsolve import ExponentSolver, NonGaussianNoise, NotConverged, OrnsteinUhlenbeck, Problem, VibroImpactOscillator
from fpsolve.errors import MeshError, SingularMatrix
from fpsolve.exponent import elements, principal_pair, starts
from fpsolve.model import Telegraph
from tests.kit import matrices, rates

OSCILLATOR = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1)
WEAK = Problem(OSCILLATOR, NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction())


@pytest.mark.parametrize("kind", [SingularMatrix, np.linalg.LinAlgError, MeshError, NotConverged])
@pytest.mark.parametrize("place", ["alone", "after another p", "on halved cells"])
def test_one_space_that_fails_is_passed_by(monkeypatch, kind, place):
    alone, known, count = ExponentSolver(WEAK).solution(2.0), elements.principal_pair, [0]
    solver = ExponentSolver(WEAK, rtol=1e-5 if place == "on halved cells" else 1e-8)
    if place == "after another p":
        solver.solution(2.2)

    def failing_once(*given, **named):
        count[0] += 1
        if count[0] == (2 if place == "on halved cells" else 1):
            raise kind("pivot")
        return known(*given, **named)

    for module in (elements, starts):
        monkeypatch.setattr(module, "principal_pair", failing_once)
    found = solver.solution(2.0)
    assert count[0] > 1
    assert abs(found.pair.value - alone.pair.value) <= found.error + alone.error < 1e-6


def test_vectors_of_another_pair_do_not_lead_to_it():
    """From a p beside it, with the vectors of |x|²|v|², which seem positive: the value misses the tangent of Λ."""
    noise = OrnsteinUhlenbeck(alpha=0.1, sigma=0.01 * 0.2**0.5)
    beside = ExponentSolver(matrices(np.diag([1.0, -1.0]), [[0.0, -1.0], [1.0, 0.0]], noise)).pair(3.9)
    matrix, mass = beside.generator.matrix(4.0).tocsc(), beside.generator.space(4.0).mass.tocsc()
    vectors = [eigs(each, k=1, M=mass, sigma=1e-4, v0=np.ones(beside.right.size))[1] for each in (matrix, matrix.T)]
    right, left = (each[:, 0].real for each in vectors)
    found = principal_pair(beside.generator, 4.0, start=replace(beside, right=right, left=left))
    assert found.value == pytest.approx(4.0, abs=0.01)


def test_value_that_contradicts_the_even_moment_is_refused(monkeypatch):
    moment = SimpleNamespace(value=0.79, error=1e-9)
    monkeypatch.setattr("fpsolve.exponent.elements.even_moment", lambda *_, **__: moment)
    problem = rates("x' = v; v' = -x - 0.1*v - xi*x", Telegraph(a=0.5, k=1.0))
    with pytest.raises(NotConverged, match=r"p = 2 is not the principal one\. .* the moment equations give"):
        ExponentSolver(problem).solution(2.0)
