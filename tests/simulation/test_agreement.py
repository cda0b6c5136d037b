"""Estimates by simulation against the finite elements, and whether their standard errors mean what they say."""

import math

import numpy as np
import pytest

from fpsolve.exponent.solver import ExponentSolver
from fpsolve.model.problem import Problem
from fpsolve.simulation.estimators import simulate
from tests.agreement import cheap_step, rows
from tests.conftest import sampled
from tests.simulation.problems import MODERATE, REDUCED, exact


@pytest.mark.parametrize(
    ("epsilon", "restitution", "noise"), sampled((1.0, 0.8, "reduced"), (0.5, 0.6, "exact"), (0.1, 1.0, "exact"))
)
def test_agrees_with_finite_elements(epsilon, restitution, noise):
    """Strong noise that is reduced, and weaker noise as it stands; all 18 by `python -m tests.agreement`."""
    table = list(rows([(epsilon, restitution, noise)], paths=4096, transients=8, step=cheap_step))
    given = [row for row in table if row.simulated.value is not None]
    assert sum(row.simulated.estimator == "population" for row in given) >= 4
    assert sum(row.simulated.estimator == "direct" for row in given) >= 1
    assert np.max(np.abs([row.deviation for row in given])) <= 4
    assert np.max([row.simulated.standard_error for row in given]) < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize(("estimator", "paths", "time"), [("direct", 2048, 100.0), ("population", 2048, 50.0)])
def test_standard_errors_are_honest(estimator, paths, time):
    """Over 64 seeds the estimates deviate by their standard error, within 35 %, and their mean is Λ(p)."""
    orders = [1.0] if estimator == "population" else [-1.0, 0.5, 1.0]
    reference = exact(MODERATE, REDUCED, orders)
    runs = [
        simulate(MODERATE, REDUCED, orders, estimator=estimator, paths=paths, time=time, seed=seed)
        for seed in range(64)
    ]
    exponent = ExponentSolver(Problem(MODERATE, REDUCED)).lyapunov_exponent().value
    check_standard_errors([(run.lyapunov_exponent, run.lyapunov_exponent_error) for run in runs], exponent)
    for k, value in enumerate(reference):
        check_standard_errors([(run.estimates[k].value, run.estimates[k].standard_error) for run in runs], value)


def check_standard_errors(pairs, reference):
    values, errors = np.array(pairs, dtype=float).T
    deviation = np.std(values, ddof=1)
    assert deviation / math.sqrt(np.mean(errors**2)) == pytest.approx(1, abs=0.2 * math.sqrt(200 / len(pairs)))
    assert abs(values.mean() - reference) < 4 * deviation / math.sqrt(len(pairs)) + 0.1 * deviation
