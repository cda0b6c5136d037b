"""300 random problems over the whole range: each meets its tolerance, with an honest error, or is refused."""

import numpy as np
import pytest

from tests.random_problems import RTOL, Outcome, problems, solve


@pytest.fixture(scope="module")
def outcomes():
    return [solve(problem) for problem in problems(300)]


@pytest.fixture(scope="module")
def solved(outcomes):
    return [outcome for outcome in outcomes if isinstance(outcome, Outcome)]


def test_at_most_3_percent_are_refused_with_a_reason(outcomes):
    refusals = [outcome for outcome in outcomes if isinstance(outcome, str)]
    assert len(refusals) <= 9
    assert all("did not converge: " in refusal and "use a larger rtol" in refusal for refusal in refusals)


def test_all_true_errors_meet_the_tolerance(solved):
    assert all(outcome.error <= RTOL + outcome.doubt for outcome in solved)
    assert all(outcome.doubt <= 0.3 * RTOL for outcome in solved)


def test_error_estimates_are_honest(solved):
    """Never below a third of the error, nor a hundred times above it, where the reference can tell."""
    for outcome in solved:
        assert outcome.estimate >= (outcome.error - 3 * outcome.doubt) / 3, outcome
        assert outcome.estimate <= 100 * max(outcome.error, 3 * outcome.doubt, 1e-14), outcome


def test_none_takes_a_minute_and_most_are_quick(solved):
    seconds = np.array([outcome.seconds for outcome in solved])
    assert seconds.max() < 60
    assert np.median(seconds) < 1
