"""A kind of problem of one's own: two scalars, whose closed forms are a method that stands before the others."""

from types import SimpleNamespace

import numpy as np
import pytest

import fpsolve
from fpsolve import lyapunov_exponent, moment_lyapunov, stability_index
from fpsolve.analysis import Axis, boundary, design
from fpsolve.exponent import METHODS, Method
from fpsolve.model import White
from tests.kit import rates

TEXT = "x' = a*x + b*xi*x; v' = c*v - b*xi*v"
PROBLEM = rates(TEXT, White(s=0.6), a=-0.2, b=1.0, c=-0.5)
CASE = """
title = "Two scalars"
[system]
variables = ["x", "v"]
drift = ["a*x + b*xi*x", "c*v - b*xi*v"]
parameters = { a = -0.2, b = 1.0, c = -0.5 }
[noise]
kind = "white"
s = 0.6
[moments]
p = [1.0, 2.0]
[vary]
"system.c" = [-0.5, 0.1]
[output]
quantities = ["moment", "lyapunov_exponent", "stability_index"]
"""


class TwoScalars(Method):
    """Λ(p) is the larger of a p + ½(b s p)² and c p + ½(b s p)²."""

    name = "closed forms of two scalars"
    no_picture = "closed forms have no eigenfunctions"

    @classmethod
    def takes(cls, problem):
        return {"system.a", "system.c"} <= problem.values.keys()

    def solution(self, p, tolerance=None):
        at = self.problem.values
        rate, size = max(at["system.a"], at["system.c"]), (at["system.b"] * at["noise.s"]) ** 2
        return SimpleNamespace(value=rate * p + 0.5 * size * p * p, derivative=rate + size * p, error=0.0)

    def gradient(self, p, keys):
        at = self.problem.values
        is_first = at["system.a"] > at["system.c"]
        slopes = {"system.a": float(is_first), "system.c": float(not is_first)}
        slopes |= {
            "system.b": p * at["system.b"] * at["noise.s"] ** 2,
            "noise.s": p * at["system.b"] ** 2 * at["noise.s"],
        }
        return np.array([slopes[key] for key in keys])


@pytest.fixture
def own():
    METHODS.insert(0, TwoScalars)
    yield
    if TwoScalars in METHODS:
        METHODS.remove(TwoScalars)


def test_moments_index_and_exponent_are_those_of_the_blocks(own):
    found = moment_lyapunov(PROBLEM, [1.0, 2.0, 3.5])
    rate, index = lyapunov_exponent(PROBLEM), stability_index(PROBLEM)
    assert found.to_xarray().attrs["method"] == TwoScalars.name
    METHODS.remove(TwoScalars)
    np.testing.assert_allclose(found.value, moment_lyapunov(PROBLEM, [1.0, 2.0, 3.5]).value, atol=1e-10)
    assert rate.value == pytest.approx(lyapunov_exponent(PROBLEM).value, abs=1e-10)
    assert index.value == pytest.approx(stability_index(PROBLEM).value, abs=1e-8) == pytest.approx(0.4 / 0.36)


def test_line_and_design_meet_closed_forms(own):
    slower = PROBLEM.at({"system.c": -0.9})
    line = boundary(slower, "moment(2) = 0", Axis("system.a", -0.6, -0.1), Axis("noise.s", 0.2, 0.9), nodes=5)
    [branch] = line.branches
    np.testing.assert_allclose(branch.y**2, -branch.x, rtol=1e-9)
    found = design(PROBLEM, "stability_index = 2", "noise.s")
    assert found.values["noise.s"].value == pytest.approx(0.2**0.5, rel=1e-9)


def test_sweep_is_solved_by_it(own, tmp_path):
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    results = fpsolve.run(fpsolve.load_case(tmp_path / "case.toml"))
    assert [float(each.moment(2.0).value) for each in results] == pytest.approx([-0.4 + 0.72, 0.2 + 0.72], rel=1e-12)
    assert [each.estimates["lyapunov_exponent"].value for each in results] == pytest.approx([-0.2, 0.1], rel=1e-12)
