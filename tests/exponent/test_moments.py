"""Λ at several p: failures and the root are values, and progress is reported once for each p."""

from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest

from fpsolve import ExponentSolver, Problem, VibroImpactOscillator, make_mesh, moment_lyapunov
from fpsolve.errors import NotConverged
from fpsolve.exponent import Budget, solve_moments, solver
from fpsolve.exponent.solver import FEW_MOMENTS
from tests.conftest import FIG1, FIG1_NOISE

WEAK_NOISE = FIG1_NOISE.ou_reduction()
STRONG = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=1.0)
HOPELESS = make_mesh(phi_cells=1, phi_degree=2, xi_cells=2, xi_degree=3)


def test_a_failed_moment_is_a_value():
    found = solve_moments(ExponentSolver(Problem(STRONG, WEAK_NOISE), HOPELESS), [6.0, 0.0])
    np.testing.assert_array_equal(found.p, [0.0])
    assert found.value.shape == found.error_estimate.shape == (1,)
    (failure,) = found.failures
    assert failure.p == 6.0
    assert "use more cells" in failure.reason


def test_the_moment_zero_needs_no_solve():
    """Its slope λ does, and is not known here."""
    stronger = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=2.0)
    solver = ExponentSolver(Problem(stronger, WEAK_NOISE), budget=Budget(unknowns=100))
    for p, kept in (([6.0, 0.0, 5.0], [0.0]), ([0.0], [0.0]), ([0.0, 6.0, 0.0], [0.0, 0.0])):
        found = solve_moments(solver, p)
        np.testing.assert_array_equal(found.p, kept)
        assert not np.any(found.value)
        assert not np.any(found.error_estimate)
        assert np.all(np.isnan(found.derivative))
        assert np.all(np.isnan(found.residual))
        assert [failure.p for failure in found.failures] == [each for each in p if each]


def test_what_is_raised_is_the_result_with_its_failures():
    with pytest.raises(NotConverged) as caught:
        moment_lyapunov(Problem(STRONG, WEAK_NOISE), [6.0, -5.0, 0.0], mesh=HOPELESS)
    failures = caught.value.partial.failures
    assert [failure.p for failure in failures] == [6.0, -5.0]
    assert str(caught.value) == "\n".join(failure.reason for failure in failures)


def test_a_curve_that_is_not_convex_is_a_failure_of_all(monkeypatch):
    monkeypatch.setattr(solver, "broken_convexity", lambda *columns: "not convex")
    found = solve_moments(ExponentSolver(Problem(FIG1, WEAK_NOISE)), [1.0, 2.0])
    np.testing.assert_array_equal(found.p, [1.0, 2.0])
    assert [(failure.p, failure.reason) for failure in found.failures] == [(None, "not convex; use a smaller rtol")]


@pytest.mark.parametrize("count", [2, FEW_MOMENTS, FEW_MOMENTS + 1, 40])
def test_progress_is_reported_once_for_each_moment(count):
    calls = []
    solver = ExponentSolver(Problem(FIG1, WEAK_NOISE), rtol=1e-4)
    found = solve_moments(solver, np.linspace(-1, 2, count), progress=lambda: calls.append(1))
    assert len(calls) == found.p.size == count
    assert not found.failures


def test_the_root_is_known_where_many_moments_are_interpolated(fig1_solver):
    many = solve_moments(fig1_solver, np.linspace(-2, 6, 33))
    assert many.root == pytest.approx(-0.3629121344, rel=1e-3)
    for pair, value in zip(many.pairs[::8], many.value[::8], strict=True):
        assert pair.value == pytest.approx(value, rel=1e-8)
    assert solve_moments(fig1_solver, np.linspace(1, 6, 33)).root is None
    assert solve_moments(fig1_solver, [-1.0, 1.0]).root is None


NO_NUMBERS = [
    *("2", b"2", ["2"], 2j, [1, 2j], True, [True, 2], np.array([True]), None, [None], {1.0}, len, 10**400),
    *([], [[1.0, 2.0]], [[1], [1, 2]], np.inf, [np.nan], np.timedelta64(3), np.datetime64("2020-01-01")),
    np.ma.array([1.0, 2.0], mask=[False, True]),
]


@pytest.mark.parametrize("p", NO_NUMBERS, ids=repr)
def test_what_is_no_order_of_a_moment_is_refused_in_one_sentence(p):
    with pytest.raises(ValueError, match=r"^p must be a finite number or a non-empty list of finite numbers, got .+$"):
        moment_lyapunov(Problem(FIG1, WEAK_NOISE), p)


@pytest.mark.parametrize("p", [[[1], [1, 2]], "2", [[1.0, 2.0]]], ids=repr)
def test_what_is_no_order_is_refused_also_where_there_may_be_none(p):
    solver = ExponentSolver(Problem(FIG1, WEAK_NOISE))
    for solve in (solver.moments, lambda p: solve_moments(solver, p)):
        assert solve([]).p.shape == (0,)
        with pytest.raises(ValueError, match=r"^p must be a finite number or a list of finite numbers, got .+$"):
            solve(p)


@pytest.mark.parametrize("p", ["1", True, 1j, None, [1.0], [[1], [1, 2]], np.nan], ids=repr)
def test_a_pair_is_of_one_number(p):
    with pytest.raises(ValueError, match=r"^p must be a finite number, got .+$"):
        ExponentSolver(Problem(FIG1, WEAK_NOISE)).pair(p)


@pytest.mark.parametrize("p", [1, (1.0,), np.float32(1), np.array(1), range(1, 2), [Fraction(1)], Decimal(1)], ids=repr)
def test_all_real_numbers_are_orders_of_moments(p):
    assert moment_lyapunov(Problem(FIG1, WEAK_NOISE), p).value == moment_lyapunov(Problem(FIG1, WEAK_NOISE), 1.0).value


@pytest.mark.parametrize("p", [[2.0, -1.0, 2.0, 0.5], np.resize([3.0, -2.0, 0.5, 1.5, -0.5, 2.5, 1.0], 40)])
def test_numbers_stand_at_their_p(fig1_solver, p):
    """In whatever order these come, and however often; the second array is interpolated."""
    found = solve_moments(fig1_solver, p)
    np.testing.assert_array_equal(found.p, p)
    for i, each in enumerate(p):
        pair = fig1_solver.pair(float(each))
        assert found.value[i] == pytest.approx(pair.value, rel=1e-8)
        assert found.derivative[i] == pytest.approx(pair.derivative, rel=1e-8)
