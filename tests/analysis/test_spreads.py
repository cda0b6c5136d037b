"""Uncertain parameters against normal laws in closed form, scipy's cut normal law, and samples."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import kstest, norm, truncnorm

from fpsolve import OrnsteinUhlenbeck, PlaneSystem, Problem
from fpsolve.analysis import Law, latin_hypercube, laws_of, uncertainty
from fpsolve.analysis.spreads import deviation_of

A, SIGMA, ALPHA = -0.3, 0.5, 0.8
"""Of ẋ = (J + a + ξ) x, whose Λ(p) is pa + p² S(0)/2 with S(0) = σ²/α², and δ_p = −2a/S(0)."""
PROBLEM = Problem(
    PlaneSystem.of_equations(("x", "y"), ("a*x + y + xi*x", "-x + a*y + xi*y"), {"a": A}),
    OrnsteinUhlenbeck(alpha=ALPHA, sigma=SIGMA),
)


def test_what_is_linear_has_the_normal_law():
    """In a all but δ_p are exact, and δ_p is linear, too."""
    found = uncertainty(PROBLEM, {"system.a": {"sd": 0.02}}, [2.0, 3.0])
    rest, size = SIGMA**2 / ALPHA**2, norm.ppf(0.975) * 0.02
    exact = {2.0: 2 * A + 2 * rest, 3.0: 3 * A + 4.5 * rest}
    for (p, value), spread in zip(exact.items(), found.moments, strict=True):
        assert [spread.low, spread.high] == pytest.approx([value - p * size, value + p * size], abs=1e-9)
        assert spread.below == pytest.approx(norm.cdf(-value / (p * 0.02)), abs=1e-7)
    exponent, index = found.indices["lyapunov_exponent"], found.indices["stability_index"]
    assert [exponent.low, exponent.high] == pytest.approx([A - size, A + size], abs=1e-9)
    assert index.deviation == pytest.approx(2 * 0.02 / rest, rel=1e-7)
    assert exponent.below > 0.999


def test_independent_parameters_add_their_variances():
    """∂Λ/∂a = p, ∂Λ/∂σ = p²σ/α², ∂Λ/∂α = −p²σ²/α³; a number is a share of the value."""
    found = uncertainty(PROBLEM, {"system.a": 0.1, "noise.sigma": 0.04, "noise.alpha": {"sd": 0.03}}, 2.0)
    parts = 2 * 0.1 * A, 4 * SIGMA / ALPHA**2 * 0.04 * SIGMA, 4 * SIGMA**2 / ALPHA**3 * 0.03
    assert found.moments[0].deviation == pytest.approx(math.hypot(*parts), rel=1e-7)
    data = found.to_xarray()
    assert float(data.moment_high[0] - data.moment_low[0]) == pytest.approx(2 * norm.ppf(0.975) * math.hypot(*parts))
    assert "95%" in repr(found)


@pytest.mark.parametrize(
    ("value", "sd", "low", "high"), [(0.99, 0.02, 0.0, 1.0), (0.5, 0.4, 0.0, 1.0), (2.0, 3.0, 0.0, math.inf)]
)
def test_a_cut_law_has_the_integrals_of_a_normal_density(value, sd, low, high):
    law = Law(value, sd, low, high)

    def integral(power, end):
        return quad(lambda x: x**power * norm.pdf(x, value, sd), low, min(end, value + 12 * sd), epsabs=1e-13)[0]

    whole, first, second = (integral(power, high) for power in (0, 1, 2))
    assert law.mean == pytest.approx(first / whole, rel=1e-9)
    assert law.deviation == pytest.approx(math.sqrt(second / whole - (first / whole) ** 2), rel=1e-7)
    for share in (0.1, 0.5, 0.9):
        assert integral(0, float(law.quantile(np.array([share]))[0])) / whole == pytest.approx(share, rel=1e-9)


def test_a_hypercube_has_a_value_in_each_part_of_each_law():
    laws = laws_of(PROBLEM, {"noise.sigma": 0.4, "system.a": {"sd": 0.1}})
    drawn = latin_hypercube(laws, 200, seed=3)
    for key, law in laws.items():
        other = truncnorm((law.low - law.value) / law.sd, (law.high - law.value) / law.sd, law.value, law.sd)
        parts = np.sort(np.floor(other.cdf(drawn[key]) * 200 - 1e-9))
        assert parts.tolist() == list(range(200))
        assert kstest(drawn[key], other.cdf).statistic <= 1 / 200 + 1e-9
    assert abs(np.corrcoef(*drawn.values())[0, 1]) < 4 / math.sqrt(200)
    again = latin_hypercube(laws, 200, seed=3)
    assert all(np.array_equal(drawn[key], again[key]) for key in laws)
    assert not np.array_equal(drawn["system.a"], latin_hypercube(laws, 200, seed=4)["system.a"])


@pytest.mark.parametrize("value", [0, -0.1, True, "x", {"sd": 0}, {"s": 1.0}, math.inf, math.nan, None])
def test_a_deviation_that_is_none_is_refused(value):
    with pytest.raises(ValueError, match="must be a share of the value"):
        deviation_of(value)


def test_parameters_that_are_none_are_refused():
    with pytest.raises(ValueError, match=r"must be one of system.a"):
        laws_of(PROBLEM, {"system.b": 0.1})
    with pytest.raises(ValueError, match="is 0, and so is a share"):
        laws_of(PROBLEM.at({"system.a": 0.0}), {"system.a": 0.1})
    with pytest.raises(ValueError, match="must be a whole number from 2"):
        latin_hypercube(laws_of(PROBLEM, {"system.a": 0.1}), 1)
