"""Sensitivities beyond the plane: against derivatives of the equations of the moments, and against differences."""

import numpy as np
import pytest

from fpsolve import ExponentSolver, Problem, lyapunov_exponent, moment_lyapunov
from fpsolve.analysis.sensitivity import solve_sensitivities
from fpsolve.model import LinearSystem, Telegraph, White
from tests.oracles import kronecker

VALUES = {"omega": 1.0, "zeta": 0.15, "kappa": 0.6, "share": 0.4}
RATES = ("v", "-omega**2*x - 2*zeta*omega*v + kappa*u - 0.7*xi*x - 0.3*xi*u", "-kappa*v - u + share*xi*v")
STEP = 1e-4


def matrices(omega, zeta, kappa, share):
    steady = np.array([[0, 1, 0], [-(omega**2), -2 * zeta * omega, kappa], [0, -kappa, -1]])
    return steady, np.array([[0, 0, 0], [-0.7, 0, -0.3], [0, share, 0]])


def problem(noise, **values):
    return Problem(LinearSystem.of_equations(("x", "v", "u"), RATES, {**VALUES, **values}), noise)


def slopes(problem, p, indices):
    solver = ExponentSolver(problem, rtol=1e-4)
    return solve_sensitivities(solver, np.array([p]), problem.derivatives(), indices=indices)


def growth_of_squares(noise, values):
    steady, driven = matrices(**values)
    if noise.is_white:
        return kronecker.white(steady, driven * noise.s, 2)
    return kronecker.chain(steady, driven, (-noise.a, noise.a), ((0, noise.k), (noise.k, 0)), 2)


@pytest.mark.parametrize("noise", [White(s=0.8), Telegraph(a=0.7, k=0.6)], ids=["white", "telegraph"])
def test_of_second_moments(noise):
    """By all parameters of the system, and by the strength of the noise."""
    name, size = ("s", noise.s) if noise.is_white else ("a", noise.a)
    [found] = slopes(problem(noise), 2.0, ()).moments
    for key in VALUES:
        beside = [growth_of_squares(noise, {**VALUES, key: VALUES[key] + side * STEP}) for side in (-1, 1)]
        expected = (beside[1] - beside[0]) / (2 * STEP)
        assert abs(found[f"system.{key}"].value - expected) <= found[f"system.{key}"].error_estimate + 1e-7
        assert found[f"system.{key}"].error_estimate < 1e-3
    beside = [
        growth_of_squares(problem(noise).at({f"noise.{name}": size + side * STEP}).noise, VALUES) for side in (-1, 1)
    ]
    expected = (beside[1] - beside[0]) / (2 * STEP)
    assert abs(found[f"noise.{name}"].value - expected) <= found[f"noise.{name}"].error_estimate + 1e-7


@pytest.mark.slow
def test_of_other_quantities_by_differences():
    noise, step = White(s=0.8), 1e-2
    found = slopes(problem(noise), 1.0, ("lyapunov_exponent",))
    for key, slope, solve in (
        ("zeta", found.moments[0], lambda each: moment_lyapunov(each, 1.0, rtol=1e-4).value[0]),
        ("kappa", found.indices["lyapunov_exponent"], lambda each: lyapunov_exponent(each, rtol=1e-4).value),
    ):
        low, high = (solve(problem(noise, **{key: VALUES[key] + side * step})) for side in (-1, 1))
        estimate = slope[f"system.{key}"]
        assert abs(estimate.value - (high - low) / (2 * step)) <= estimate.error_estimate + 1e-3
