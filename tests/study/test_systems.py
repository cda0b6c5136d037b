"""The cases of other systems than the paper's: what they expect comes from the oracles, see tests/test_oracles.py."""

from pathlib import Path

import numpy as np
import pytest

from fpsolve.case.case import load_case
from fpsolve.study.solve import Numerics, solve_curve
from fpsolve.workflow import compare, expected
from fpsolve.workflow.chart import solve_chart
from tests.conftest import sampled

CASES = sorted((Path(__file__).parents[2] / "cases/systems").glob("*.toml"))
DIGITS = 2e-13
"""To which the expected values are known."""
FEWER = {"delayed_mathieu": 5e-11, "rattling": 3 * 7e-5}
"""Where they are known to fewer: by semi-discretisation, and to three standard errors by paths."""


@pytest.mark.parametrize("path", sampled(*CASES, keep=4), ids=lambda path: path.stem)
def test_every_case_meets_its_expectations_within_the_stated_error(path):
    case = load_case(path)
    results = [solve_curve(curve, expected(case, curve.varied), Numerics.of(case)).result for curve in case.curves()]
    comparisons = compare(case, results)
    assert len(comparisons) == len(case.expect)
    assert [item for item in comparisons if not item.met] == []
    assert not any(result.failures for result in results)
    for item in comparisons:
        [result] = [each for each in results if each.curve.varied == item.varied]
        if item.expectation.of_response:
            continue  # from paths, whose standard error is in its tolerance
        if item.expectation.p is None:
            error = result.estimates[item.expectation.quantity].error_estimate
        else:
            [error] = result.moments.error_estimate[result.moments.p == item.expectation.p]
        assert abs(item.value - item.expectation.value) <= error + FEWER.get(path.stem, DIGITS)


@pytest.mark.slow
def test_the_chart_of_white_noise(monkeypatch):
    """The mean square is neutral on s² = 4b."""
    monkeypatch.setattr("fpsolve.analysis.stability.NODES", 7)
    monkeypatch.setattr("fpsolve.workflow.chart.CLOSED_FORM_NODES", 7)
    path = next(path for path in CASES if path.stem == "white_noise_chart")
    *_, chart = solve_chart(load_case(path, ["chart.zero=[{ moment = 2.0 }]"]))
    [line] = chart.lines
    assert chart.complete
    assert not chart.failures
    for branch in line.branches:
        np.testing.assert_allclose(branch.x**2, 4 * branch.y, rtol=1e-6)
