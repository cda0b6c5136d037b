"""Random problems over the whole range: each is solved within its tolerance, with an honest error, and fast."""

import numpy as np
import pytest

from tests.random_problems import RTOL, Outcome, problems, solve


@pytest.fixture(scope="module")
def outcomes():
    """Of 30; `python -m tests.random_problems` solves 300."""
    return [solve(problem) for problem in problems(30)]


@pytest.fixture(scope="module")
def solved(outcomes):
    return [outcome for outcome in outcomes if isinstance(outcome, Outcome)]


@pytest.mark.slow
def test_none_is_refused(outcomes):
    assert not [outcome for outcome in outcomes if isinstance(outcome, str)]


@pytest.mark.slow
def test_all_true_errors_meet_the_tolerance(solved):
    assert all(outcome.error <= RTOL + outcome.doubt for outcome in solved)
    assert all(outcome.doubt <= 0.3 * RTOL for outcome in solved)


@pytest.mark.slow
def test_error_estimates_are_honest(solved):
    """Never below the error, and mostly less than 300 times above it, where the reference can tell."""
    for outcome in solved:
        assert outcome.estimate >= outcome.error - 3 * outcome.doubt, outcome
    telling = [outcome.estimate / outcome.error for outcome in solved if outcome.error > 3 * outcome.doubt]
    assert np.median(telling) < 300


def test_each_takes_milliseconds(solved):
    seconds = np.array([outcome.seconds for outcome in solved])
    assert seconds.max() < 2
    assert np.median(seconds) < 0.05
