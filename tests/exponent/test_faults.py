"""What goes wrong is said once, in the right words, and what is right is not lost."""

import gc
import traceback
import weakref

import numpy as np
import pytest
from scipy.sparse import csc_matrix

from fpsolve import (
    ExponentSolver,
    MomentLyapunovFunction,
    NonGaussianNoise,
    Problem,
    VibroImpactOscillator,
    lyapunov_exponent,
    moment_lyapunov,
    stability_index,
    stationary_density,
)
from fpsolve.analysis import adjoint_density
from fpsolve.arrays import finite
from fpsolve.errors import MeshError, NotConverged, NumericalFailure, SingularMatrix
from fpsolve.exponent import Budget, adapt, eigen, starts
from fpsolve.exponent.adapt import Search, WholeProblem
from fpsolve.fem.factors import sparse_lu

FIG1 = Problem(
    VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.1),
    NonGaussianNoise(D0=1.0, tau0=0.5, r0=0.95).ou_reduction(),
)
SLOW = Problem(
    VibroImpactOscillator(omega=0.07252887, restitution=0.57982, c1=-0.338098, epsilon=1.0930367, impact="restitution"),
    NonGaussianNoise(D0=0.09531017, tau0=49.143166, r0=0.61455889),
)


def test_a_density_that_is_none_is_refused():
    """Slow, strong noise: a fifth of the adjoint eigenfunction at p = 0 is negative, though λ is right."""
    pair = ExponentSolver(SLOW, rtol=1e-4).pair(0.0)
    with pytest.raises(
        NotConverged, match=r"the stationary density at p = 0 is not resolved: 2\d% of it is negative"
    ) as e:
        stationary_density(pair)
    assert np.min(e.value.partial.values) < 0
    with pytest.raises(NotConverged, match="the adjoint density at p = 0 is not resolved"):
        adjoint_density(pair)


@pytest.mark.parametrize(
    ("failure", "words"),
    [
        (OverflowError("too large"), "beyond floating-point numbers"),
        (NumericalFailure("array must not contain infs or NaNs"), "beyond floating-point numbers"),
        (SingularMatrix("Factor is exactly singular"), "cannot be solved"),
        (np.linalg.LinAlgError("singular"), "cannot be solved"),
        (MeshError("P_s underflows"), "did not converge: P_s underflows"),
    ],
)
def test_what_numbers_do_is_not_converged(monkeypatch, failure, words):
    monkeypatch.setattr(Search, "solve_places", lambda *_: (_ for _ in ()).throw(failure))
    with pytest.raises(NotConverged, match=words):
        moment_lyapunov(FIG1, 2.0)


@pytest.mark.parametrize("kind", [SingularMatrix, np.linalg.LinAlgError, MeshError, NotConverged])
@pytest.mark.parametrize("place", ["alone", "after another p", "next to another problem", "on halved cells"])
def test_one_space_that_fails_is_passed_by(monkeypatch, kind, place):
    """Λ(2) does not depend on a space without a pair, whatever it is tried for."""
    alone, known, count = ExponentSolver(FIG1).solution(2.0), adapt.principal_pair, [0]
    close_by = {2.0: alone} if place == "next to another problem" else {}
    solver = ExponentSolver(FIG1, rtol=1e-5 if place == "on halved cells" else 1e-8, starts=close_by)
    if place == "after another p":
        solver.solution(2.2)

    def failing_once(*given, **named):
        count[0] += 1
        if count[0] == (2 if place == "on halved cells" else 1):
            raise kind("pivot")
        return known(*given, **named)

    for module in (adapt, starts):
        monkeypatch.setattr(module, "principal_pair", failing_once)
    found = solver.solution(2.0)
    assert count[0] > 1
    assert abs(found.pair.value - alone.pair.value) <= found.error + alone.error < 1e-6


def test_what_failed_is_kept_in_words_alone():
    """No solution stays alive with it, and its traceback does not grow from one time to the next."""
    solver = ExponentSolver(SLOW, budget=Budget(unknowns=510))

    def failed():
        with pytest.raises(NotConverged) as caught:
            solver.solution(2.0)
        return caught.value

    first = failed()
    best, text = weakref.ref(first.partial), str(first)
    del first
    gc.collect()
    assert best() is None
    again = [failed() for _ in range(3)]
    assert {str(each) for each in again} == {text}
    assert len({len(traceback.extract_tb(each.__traceback__)) for each in again}) == 1


@pytest.mark.parametrize("failure", [ValueError("zip() argument 3 is longer"), TypeError("no"), RuntimeError("dict")])
def test_a_fault_of_the_program_is_no_failure_to_converge(monkeypatch, failure):
    monkeypatch.setattr(Search, "solve_places", lambda *_: (_ for _ in ()).throw(failure))
    with pytest.raises(type(failure), match=str(failure).split()[0][:3]):
        moment_lyapunov(FIG1, 2.0)


@pytest.mark.parametrize("size", [1, 4])
def test_what_libraries_raise_on_numbers_has_kinds_of_our_own(size):
    with pytest.raises(SingularMatrix, match="singular"):
        sparse_lu(csc_matrix((size, size)))
    with pytest.raises(NumericalFailure, match="infs or NaNs"):
        finite(np.full(size, np.nan))


def test_a_start_that_is_zero_is_a_failure_of_numbers():
    with pytest.raises(SingularMatrix, match=r"(?i)arpack|start"):
        eigen._nearest(lambda v: v, np.zeros(30), 1.0, 1.0)


def test_equal_moments_are_solved_once():
    result = moment_lyapunov(FIG1, [2.0] * 10)
    once = moment_lyapunov(FIG1, 2.0)
    np.testing.assert_array_equal(result.value, np.full(10, once.value[0]))
    assert result.p.size == result.error_estimate.size == result.derivative.size == 10
    mixed = moment_lyapunov(FIG1, [1.0, 2.0, 1.0, -0.0, 0.0])
    np.testing.assert_array_equal(mixed.p, [1, 2, 1, 0, 0])
    assert mixed.value[0] == mixed.value[2] != mixed.value[1]


def test_of_equal_moments_none_is_there_that_failed(monkeypatch):
    def solve_places(self, known):
        if self.p == 3.0:
            raise NotConverged("no")
        return search(self, known)

    search = Search.solve_places
    monkeypatch.setattr(Search, "solve_places", solve_places)
    monkeypatch.setattr(WholeProblem, "may_reuse", lambda *_: False)
    with pytest.raises(NotConverged, match=r"^no$") as e:
        moment_lyapunov(FIG1, [3.0, 0.5, 3.0, 1.0, 0.5])
    np.testing.assert_array_equal(e.value.partial.p, [0.5, 1.0, 0.5])


def test_at_zero_it_is_zero():
    result = moment_lyapunov(FIG1, [0.0, 2.0])
    assert result.value[0] == result.error_estimate[0] == 0.0
    assert not np.signbit(result.value[0])


def test_where_there_is_no_stability_index_the_reason_is_told():
    """Without damping by impacts but with weak bounded noise and much damping every moment up to 20 decays."""
    problem = Problem(
        VibroImpactOscillator(omega=1.0, restitution=0.5, c1=-3.0, epsilon=0.3),
        NonGaussianNoise(D0=0.01, tau0=0.5, r0=0.7),
    )
    found = stability_index(problem)
    assert not found
    assert "no root p ≠ 0 in [-20, 20]" in str(found)
    assert "with bounded noise P(sup ‖x‖ > A) may fall faster than any power of A" in found.reason
    assert str(MomentLyapunovFunction(problem, (0.5, 1.0)).stability_index()) == str(found)


def test_near_zero_the_reason_names_the_moment_that_stands_for_it():
    solver = ExponentSolver(SLOW, budget=Budget(unknowns=100))
    with pytest.raises(NotConverged, match=r"^Λ\(p\) near p = 0 follows from Λ\(0\.01\): Λ\(0\.01\) did not converge"):
        solver.lyapunov_exponent()


def test_near_zero_the_moment_is_named_whatever_the_reason(monkeypatch):
    monkeypatch.setattr(Search, "solve_places", lambda *_: (_ for _ in ()).throw(np.linalg.LinAlgError("singular")))
    with pytest.raises(NotConverged, match=r"^Λ\(p\) near p = 0 follows from Λ\(0\.01\): Λ\(0\.01\) cannot be solved"):
        lyapunov_exponent(FIG1)
