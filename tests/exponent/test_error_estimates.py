"""Error estimates are neither larger nor smaller than they were: half of one, or twice it, is told."""

from dataclasses import replace

import pytest

from fpsolve import ExponentSolver, NonGaussianNoise, Problem, VibroImpactOscillator, make_mesh
from fpsolve.exponent.root import nonzero_root
from tests.conftest import UNIT_NOISE
from tests.random_problems import Outcome, problems, solve

OSCILLATOR = VibroImpactOscillator(omega=1.0, restitution=0.8, c1=0.1, epsilon=0.8)
GAUSSIAN = Problem(OSCILLATOR, UNIT_NOISE)
BOUNDED = Problem(OSCILLATOR, NonGaussianNoise(D0=0.5, tau0=0.5, r0=0.9))
COARSE = make_mesh(phi_cells=2, phi_degree=5, xi_cells=4, xi_degree=4, xi_min=-5, xi_max=5)


@pytest.mark.parametrize(
    ("problem", "p", "chosen", "of_mesh", "by_modes"),
    [
        (GAUSSIAN, -1.0, 9.650e-6, 3.793e-6, 6.461e-5),
        (GAUSSIAN, 2.0, 3.951e-5, 1.102e-3, 1.026e-2),
        (BOUNDED, -1.0, 2.705e-6, 6.215e-6, 3.107e-5),
        (BOUNDED, 2.0, 1.529e-5, 7.826e-6, 7.807e-4),
    ],
)
def test_of_moments(problem, p, chosen, of_mesh, by_modes):
    """Of a discretisation that is chosen, by its highest modes; of a given mesh, by a finer one."""
    assert ExponentSolver(problem, rtol=1e-3).solution(p).error == pytest.approx(chosen, rel=0.2)
    given = ExponentSolver(problem, COARSE).solution(p)
    assert given.error == pytest.approx(of_mesh, rel=0.2)
    assert replace(given, measured=None).error == pytest.approx(by_modes, rel=0.2)


@pytest.mark.parametrize(
    ("problem", "exponent", "variance"), [(GAUSSIAN, 1.123e-6, 1.738e-7), (BOUNDED, 5.172e-6, 1.755e-7)]
)
def test_of_indices(problem, exponent, variance):
    solver = ExponentSolver(problem, rtol=1e-4)
    assert solver.lyapunov_exponent().error_estimate == pytest.approx(exponent, rel=0.2)
    assert solver.variance_rate().error_estimate == pytest.approx(variance, rel=0.2)


def test_of_a_root():
    assert nonzero_root(ExponentSolver(GAUSSIAN, rtol=1e-4)).error_estimate == pytest.approx(1.315e-5, rel=0.2)


@pytest.mark.parametrize(
    ("mesh", "rtol", "errors"), [(None, 1e-3, (4.009e-4, 6.928e-6)), (COARSE, 1e-8, (8.518e-4, 5.631e-6))]
)
def test_of_slopes(mesh, rtol, errors):
    """Of a discretisation that is chosen, by its highest modes; of a given mesh, by a finer one."""
    solver = ExponentSolver(GAUSSIAN, mesh, rtol=rtol)
    assert (solver.slope_error(2.0), solver.slope_error(-1.0)) == pytest.approx(errors, rel=0.2)


@pytest.mark.slow
def test_where_effects_fall_unevenly():
    """The two highest modes have 1/600 of the effect of four, but with two degrees more the error falls to 1/400."""
    found = solve(problems(429)[428])
    assert isinstance(found, Outcome)
    assert found.reference == "polynomials"
    assert 1e-9 < found.error < found.estimate


def test_where_the_effect_of_two_modes_is_less_than_that_of_one():
    """Parts of it cancel: at p = 0 that of one is 8 times as large."""
    drawn = problems(722)[721]
    found, exact = (ExponentSolver(drawn.solved, rtol=rtol).lyapunov_exponent() for rtol in (1e-6, 1e-10))
    assert 1e-8 < abs(found.value - exact.value) < found.error_estimate
    assert exact.error_estimate < 1e-10
