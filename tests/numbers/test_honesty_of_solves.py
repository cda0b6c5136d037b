"""What an error estimate and a warning promise, and what is said where there is no number."""

import math
import re
import time

import numpy as np
import pytest

from fpsolve import (
    ExponentSolver,
    NonGaussianNoise,
    NotConverged,
    OrnsteinUhlenbeck,
    PlaneSystem,
    Problem,
    make_mesh,
    moment_lyapunov,
    stability_index,
)
from fpsolve.exponent import (
    SUMMARY_NUMBERS,
    Budget,
    Estimate,
    critical_impact_factor,
    critical_restitution,
    impact_rate,
)
from fpsolve.model import Jump, ParametricOscillator, White
from tests.kit import rates
from tests.numbers.rows.modes import random_system
from tests.numbers.rows.oscillator import PAPER, UNIT, WEAK, elastic, paper, series, slow

COARSE = make_mesh(phi_cells=1, phi_degree=4, xi_cells=2, xi_degree=5)
HALF = OrnsteinUhlenbeck(alpha=1.0, sigma=0.5)


def test_tighter_tolerances_cost_more_unknowns_but_not_many_more():
    problem, tolerances = Problem(paper(), WEAK), (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
    sizes = [ExponentSolver(problem, rtol=rtol).pair(2.0).space.size for rtol in tolerances]
    assert sizes == sorted(sizes)
    assert sizes[-1] < 20 * sizes[0]


def test_a_coarse_mesh_states_its_error_and_warns():
    found = moment_lyapunov(Problem(paper(0.3), WEAK), [0.0, 2.0], mesh=COARSE)
    assert abs(found.value[1] - series(Problem(paper(0.3), WEAK), 2.0, 12, 40)) <= 2 * found.error_estimate[1]
    assert "rtol = 1e-08 is not met at 1 of 2 moments. The worst, p = 2" in found.warnings[0]


def test_error_of_an_interval_of_the_noise_that_is_cut_is_stated():
    problem = Problem(paper(0.3), WEAK)
    full = moment_lyapunov(problem, 3.0, rtol=1e-12).value[0]
    for end in (4.0, 6.0):
        mesh = make_mesh(phi_cells=2, phi_degree=10, xi_cells=6, xi_degree=10, xi_min=-8.0, xi_max=end)
        cut = moment_lyapunov(problem, 3.0, mesh=mesh)
        error = abs(cut.value[0] - full)
        assert 1e-10 < error <= 3 * cut.error_estimate[0] <= 1e3 * error


@pytest.mark.slow
def test_a_mesh_that_leaves_out_where_slow_noise_carries_the_moment_is_warned_of():
    mesh = make_mesh(phi_cells=4, phi_degree=10, xi_cells=12, xi_degree=12, xi_min=-6, xi_max=18)
    found = moment_lyapunov(slow(20.0), 9.0, mesh=mesh)
    assert found.value[0] < 3
    assert any("Λ(9) may be larger: slow noise may carry the moment near 3" in text for text in found.warnings)
    assert moment_lyapunov(slow(20.0), 9.0).warnings == ()


@pytest.mark.parametrize("budget", [Budget(unknowns=900), Budget(unknowns=1500), Budget(seconds=0.02)])
def test_a_budget_ends_a_search_with_the_best_value(budget):
    solver, started = ExponentSolver(elastic(1.0, UNIT), rtol=1e-12, budget=budget), time.perf_counter()
    with pytest.raises(NotConverged, match=r"Λ\(2\) was not found: .* \(try --set budget\.") as caught:
        solver.solution(2.0)
    assert time.perf_counter() - started < 5
    best = caught.value.partial
    assert best is not None or budget.seconds < 1
    if best is not None:
        assert f"best value {best.pair.value:.6g} has an estimated error of {best.error:.1e}" in str(caught.value)
        assert abs(best.pair.value - moment_lyapunov(elastic(1.0, UNIT), 2.0).value[0]) <= 3 * best.error
    with pytest.raises(NotConverged) as again:
        solver.solution(2.0)
    assert str(again.value) == str(caught.value)


def test_moment_at_a_corner_is_solved_once():
    """Its error is beyond the tolerance."""
    solver = ExponentSolver(rates("x' = 0.5*x + xi*v; v' = -0.5*v + xi*x", White(s=0.2)))
    assert solver.pair(-1.0) is solver.pair(-1.0)


def test_slope_of_a_block_has_its_own_error():
    first = "x' = v; v' = -x - 0.2*v - xi*x"
    found, alone = (
        moment_lyapunov(rates(text, HALF), 1.0, rtol=1e-5)
        for text in (f"{first}; y' = w; w' = -2*y - 0.9*w - 0.9*xi*y + x", first)
    )
    assert found.derivative_error == pytest.approx(alone.derivative_error)


def test_error_of_the_largest_part_covers_one_that_is_nearly_as_large():
    text, noise = "x' = v; v' = -x - 0.2*v - xi*x", OrnsteinUhlenbeck(alpha=0.5, sigma=0.7)
    exact = moment_lyapunov(rates(text, noise), 1.0).value
    found = moment_lyapunov(rates(f"{text}; z' = a*z", noise, a=float(exact[0]) - 5e-6), 1.0, rtol=5e-3)
    assert abs(found.value - exact) <= found.error_estimate


def test_errors_next_to_p_0_fall_as_p():
    problem = random_system(1, 3, OrnsteinUhlenbeck(alpha=1.0, sigma=0.3))
    error = ExponentSolver(problem, rtol=0.1).moments([0.005, 0.01]).error_estimate
    assert error[0] == pytest.approx(0.5 * error[1], rel=0.01)


def test_a_tolerance_out_of_reach_harms_no_other():
    solver = ExponentSolver(Problem(paper(), WEAK))
    with pytest.raises(NotConverged, match="rounding alone"):
        solver.solution(2.0, lambda p, value: 1e-22)
    assert solver.pair(2.0).value == pytest.approx(series(Problem(paper(), WEAK), 2.0), rel=1e-10)


def test_lambda_that_is_asked_again_after_a_tighter_moment_beside_it_has_its_own_error():
    problem = Problem(paper(0.5), UNIT)
    solver, exact = ExponentSolver(problem, rtol=0.01), ExponentSolver(problem, rtol=1e-11).lyapunov_exponent()
    before = solver.lyapunov_exponent()
    solver.solution(0.01, lambda p, value: 1e-12)
    for found in (before, solver.lyapunov_exponent()):
        assert abs(found.value - exact.value) <= found.error_estimate + exact.error_estimate


def test_lambda_after_a_moment_far_away_is_found_without_a_warning():
    """The eigenfunctions of slow noise at p = 8, carried to those near p = 0, are next to orthogonal."""
    noise = NonGaussianNoise(D0=2.0, tau0=50.0, r0=0.95).ou_reduction()
    solver = ExponentSolver(Problem(paper(1.0), noise), rtol=1e-4)
    found = solver.moments([-3.0, 8.0])
    assert np.all(found.value > 0)
    assert not found.warnings
    assert solver.lyapunov_exponent().value < 0


def test_a_mesh_that_resolves_nothing_keeps_what_was_finished():
    mesh = make_mesh(phi_cells=1, phi_degree=2, xi_cells=2, xi_degree=3)
    with pytest.raises(NotConverged, match=r"(?s)p = 6|Λ\(6\).*use more cells") as caught:
        moment_lyapunov(Problem(paper(1.0), WEAK), [6.0, 0.0], mesh=mesh)
    assert caught.value.partial.p.tolist() == [0.0]


@pytest.mark.parametrize("number", [0.00637, -1.44561121e-05, 1e300, 0.5])
def test_no_error_is_below_the_rounding_of_its_number(number):
    found = Estimate(number, 1e-30 * abs(number), 1.0)
    assert found.error_estimate == 0.5 * math.ulp(number)
    text, error = str(found).split(" ± ")
    assert abs(float(text) - number) <= 2 * float(error)


def test_errors_that_are_printed_have_one_digit():
    assert str(Estimate(-0.37345849855446, 1.04e-12, 1.0)) == "-0.373458498554 ± 1e-12"
    assert str(Estimate(math.nan, math.nan, 1.0)) == "nan ± nan"
    assert not Estimate(0.0, 0.0, 1.0).error_estimate


@pytest.mark.parametrize("unknowns", [600, 1200, 4000])
def test_stability_index_is_looked_for_as_far_as_moments_are_resolved(unknowns):
    """Beyond, no failure of Λ(p) is one of δ_p, and no root is made up."""
    problem = Problem(ParametricOscillator(stiffness=1.0, damping=0.2), HALF)
    found = stability_index(problem, budget=Budget(unknowns=unknowns))
    if found:
        assert found.value == pytest.approx(8.70683239, abs=1e-6)
        return
    assert 0 <= found.reason.data["high"] <= 8.70683
    assert f"no δ_p was found in [-20, {found.reason.data['high']:g}]; beyond, Λ(" in found.reason


def rigid(c1: float, noise=HALF, r: float = 0.8, impact: str = "delta", rtol: float = 1e-9) -> ExponentSolver:
    return ExponentSolver(Problem(paper(1.0, r, c1, impact=impact), noise), rtol=rtol)


def told(words: str, found) -> float:
    """The number in a reason."""
    return float(re.fullmatch(words, found.reason)[1])


@pytest.mark.parametrize("law", ["delta", "restitution"])
def test_without_a_critical_restitution_lambda_without_loss_is_told(law):
    """And the factor of a gain, at which λ is 0."""
    stable = rigid(-0.5, impact=law)
    words = r"almost surely stable for every r in \(0, 1\], as λ without loss is (-0\.\d+)"
    lossless = rigid(-0.5, r=1.0).lyapunov_exponent().value
    assert told(words, critical_restitution(stable)) == pytest.approx(lossless, rel=5e-3)
    gain, motion = critical_impact_factor(stable).value, stable.problem.system
    gaining = PlaneSystem(motion.terms, [Jump(math.pi / 2, math.log(gain))], motion.epsilon)
    assert gain > 1
    assert ExponentSolver(Problem(gaining, HALF)).lyapunov_exponent().value == pytest.approx(0, abs=1e-7)


def test_where_no_loss_is_enough_the_restitution_that_would_be_is_told():
    """The delta law is affine in r."""
    least, most = (rigid(1.5, r=r).lyapunov_exponent().value for r in (1e-6, 1.0))
    assert 0 < least < most
    found = told(r"unstable for every r in \(0, 1\]: λ = 0 would need r = (-\d\.\d+)", critical_restitution(rigid(1.5)))
    assert found == pytest.approx(-least / (most - least), rel=5e-3)


def test_rare_impacts_give_no_number_that_means_nothing():
    """Overdamped, the phase hardly ever turns; in noise so weak the impacts drown in rounding, or do not."""
    drowned, rare = (
        rigid(-3.0, NonGaussianNoise(D0=D0, tau0=0.5, r0=1.0).ou_reduction(), rtol=1e-8) for D0 in (0.05, 0.1)
    )
    rate = impact_rate(drowned)
    assert abs(rate.value) <= rate.error_estimate < 1e-10
    for solve in (critical_impact_factor, critical_restitution):
        assert "cannot be distinguished from 0" in solve(drowned).reason
    factor = 0.405 / impact_rate(rare).value  # λ₀ is about that without any impact
    assert factor > 500
    assert told(r"its logarithm is (\S+), beyond ±500", critical_impact_factor(rare)) == pytest.approx(factor, rel=0.05)
    assert "stable for every r" in critical_restitution(rare).reason
    for name in ("critical_impact_factor", "critical_restitution"):
        assert not math.isnan(SUMMARY_NUMBERS[name].theory(Problem(paper(1.0, c1=-1e4), PAPER.ou_reduction())))
