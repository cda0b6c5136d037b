"""How accurate simulations are: digits, and what they tell apart; for orders of steps `python -m tests.agreement`."""

import pytest

from fpsolve import Problem, simulate
from tests.simulation.problems import REDUCED, STRONG, exact


@pytest.mark.slow
def test_population_succeeds_where_the_direct_estimator_fails():
    """Λ(4) at ε = 1 to 1 %."""
    reference = exact(STRONG, REDUCED, [4.0])[0]
    direct = simulate(Problem(STRONG, REDUCED), [4.0], estimator="direct", paths=1024, seed=1)
    assert direct.estimates[0].value is None
    assert any("no estimate of Λ(p) at p = 4:" in text and "where 5000 are needed" in text for text in direct.warnings)
    population = simulate(Problem(STRONG, REDUCED), [4.0], estimator="population", paths=4096, seed=1)
    assert not population.warnings
    assert population.estimates[0].value == pytest.approx(reference, rel=1e-2)
    assert population.estimates[0].standard_error < 2e-3 * reference
