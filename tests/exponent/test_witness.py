"""The equations of even moments beside the elements: a wrong eigenvalue is seen, whatever its sign."""

from types import SimpleNamespace

import numpy as np
import pytest

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.arrays import identity
from fpsolve.errors import NotConverged
from fpsolve.exponent.solver import contradiction
from fpsolve.messages import Code, Message
from fpsolve.model import CoefficientMatrix, Filter, LinearSystem, Telegraph, White
from tests.theory.test_moments import NODE, NODE_FILTER, NODE_NOISE, driven, second_moment


@pytest.fixture(scope="module")
def node():
    return ExponentSolver(driven(NODE, NODE_NOISE, Filter(*NODE_FILTER)))


def test_a_lower_eigenvalue_is_seen(node, monkeypatch):
    """That of |x|^(p − 2) |v|², which was given for Λ(4), lies below the chord of Λ(2) and its own even moment."""
    at, slope, error = np.array([4.0]), np.array([0.2]), np.array([5e-10])

    def exact():
        return np.zeros(1)

    found = contradiction(node, at, np.array([-0.32793]), slope, error, exact)
    assert found.code is Code.NOT_PRINCIPAL
    assert found.data["expected"] == pytest.approx(0.78527655968609, abs=1e-11)
    assert contradiction(node, at, np.array([1.570632172319]), slope + 0.19265, error, exact) is None
    low = contradiction(
        node, np.array([1.0]), np.array([0.39]), np.array([0.5]), error, exact
    )  # its tangent is above Λ(2)
    assert low.code is Code.NOT_PRINCIPAL
    moment = SimpleNamespace(value=0.79, error=1e-9)
    monkeypatch.setattr("fpsolve.exponent.solver.even_moment", lambda *_, **__: moment)
    with pytest.raises(NotConverged, match="p = 2 is not the principal one: by the equations of the moments"):
        ExponentSolver(node.problem).solution(2.0)


def test_a_lower_best_value_is_seen(node):
    """What a budget leaves is a value, too: one that contradicts the even moment is not told as the best."""
    known = node.even(4.0).value
    for value, code in ((known - 0.3, Code.NOT_PRINCIPAL), (known + 1e-5, Code.BUDGET_SPENT)):
        told = Message(Code.BUDGET_SPENT, p=4.0, reason="", value=value, error=1e-4, size=2.0)
        solver = ExponentSolver(node.problem)
        object.__setattr__(
            solver, "whole", SimpleNamespace(solution=lambda *_, told=told: _fail(told), refinement=None)
        )
        with pytest.raises(NotConverged) as raised:
            solver.solution(4.0)
        assert raised.value.reason.code is code


def test_where_the_witness_is_called():
    """Where one positive function is no proof, and beyond the plane; not where it takes as long as elements."""
    drift, load = ((0.0, 1.0), (-1.0, -0.1)), ((0.0, 0.0), (-1.0, 0.0))
    one = OrnsteinUhlenbeck(1.0, 0.5)
    both = PlaneSystem([CoefficientMatrix(0, drift), *(CoefficientMatrix(0, load, identity, name) for name in "ab")])
    assert ExponentSolver(driven(drift, load, one)).even(2.0) is None
    assert ExponentSolver(driven(drift, load, White(1.0))).even(2.0) is None
    assert ExponentSolver(driven(drift, load, Telegraph(0.5, 1.0))).even(2.0)
    assert ExponentSolver(Problem(both, {"a": one, "b": one})).even(2.0)
    assert ExponentSolver(Problem(both, {"a": one, "b": one})).even(3.0) is None


def test_values_beyond_the_plane(rng):
    """Λ(2) of three variables has all digits, and Λ′(2) is that of the elements; Λ(2) stands where these fail."""
    free, matrix = rng.standard_normal((2, 3, 3))
    problem = driven(free, matrix, White(s=0.5, interpretation="stratonovich"))
    expected = second_moment(free, [0.5 * matrix])
    found = ExponentSolver(problem, rtol=1e-3).moments([2.0])
    assert found.value[0] == pytest.approx(expected, abs=1e-11)
    assert found.error_estimate[0] < 1e-10
    assert np.isfinite(found.derivative[0])
    system = LinearSystem([CoefficientMatrix(0, free), CoefficientMatrix(0, matrix, identity)])
    solver = ExponentSolver(Problem(system, White(s=0.5, interpretation="stratonovich")), rtol=1e-3)
    object.__setattr__(solver, "whole", SimpleNamespace(solution=lambda *_: _fail(), refinement=None))
    found = solver.moments([1.0, 2.0])
    assert found.value.tolist() == [pytest.approx(expected, abs=1e-11)]
    assert np.isnan(found.derivative[0])
    assert [each.p for each in found.failures] == [1.0]


def _fail(reason="it fails"):
    raise NotConverged(reason)
