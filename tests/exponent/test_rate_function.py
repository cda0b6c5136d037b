"""The rate function I(s) = ps − Λ(p), s = Λ′(p): published bounds, a normal law, and the files of a case."""

import numpy as np
import pytest

from fpsolve import ExponentSolver, OrnsteinUhlenbeck, PlaneSystem, Problem, open_results, run
from fpsolve.arrays import identity
from fpsolve.errors import CaseError
from fpsolve.exponent import second_derivative
from fpsolve.model import CoefficientMatrix, White
from tests.kit import case_in, read_json

UNIT = OrnsteinUhlenbeck(alpha=1.0, sigma=1.0)
SHEAR = Problem(
    PlaneSystem(
        [
            CoefficientMatrix(0, ((-1.0, 0.0), (5.0, -1.0))),
            CoefficientMatrix(1, ((0.0, -1.0), (1.0, 0.0)), identity),
        ]
    ),
    White(s=1.0),
)
"""dx = [[−1, 0], [5, −1]]x dt + Jx ∘ dW."""
CASE = """
title = "T"
[oscillator]
epsilon = 0.1
omega = 1.0
restitution = 0.8
c1 = 0.1
[noise]
kind = "ornstein-uhlenbeck"
alpha = 1.0
sigma = 1.0
[moments]
p = [-1.0, 0.0, 2.0]
[output]
quantities = ["moment", "rate_function"]
"""


def uniform(a=-0.1, noise=UNIT):
    """ẋ = (J + aI + ξI)x: ln ‖x(t)‖ = at + ∫ξ is normal."""
    return Problem(
        PlaneSystem([CoefficientMatrix(0, ((a, 1.0), (-1.0, a))), CoefficientMatrix(1, np.eye(2), identity)]), noise
    )


def test_published_enclosures_hold():
    """arXiv 2408.12556 encloses I(0) = −min Λ and Λ″(0)."""
    solver, p = ExponentSolver(SHEAR, rtol=1e-10), 0.3
    centre = solver.variance_rate()
    assert 0.657787 < centre.value < 0.657789
    assert abs(centre.value - 0.6577880800662) <= centre.error_estimate + 5e-14
    for _ in range(5):
        pair = solver.pair(p)
        p -= pair.derivative / second_derivative(pair)
    least = solver.estimate(p, solver.solution(p))
    assert abs(solver.pair(p).derivative) < 1e-10
    assert 0.0947750 < -least.value < 0.0947753
    assert abs(least.value + 0.0947751140996) <= least.error_estimate + 5e-14


def test_a_case_writes_the_rate_function(tmp_path):
    path = tmp_path / "rates.toml"
    path.write_text(CASE, encoding="utf-8")
    [result] = run(path, tmp_path)
    folder, done = tmp_path / "rates", result.moments
    np.testing.assert_allclose(done.rate_function, done.p * done.derivative - done.value, atol=1e-12)
    assert done.rate_function[1] == 0
    assert done.rate_function[[0, 2]].min() > 0
    rows = read_json(folder / "summary.json")["curves"][0]["moments"]
    assert [row["rate_function"] for row in rows] == done.rate_function.tolist()
    head, first, *_ = (folder / "moments.csv").read_text(encoding="utf-8").splitlines()
    assert dict(zip(head.split(","), first.split(","), strict=True))["rate_function"] == str(done.rate_function[0])
    assert open_results(folder).rate_function.sel(p=2.0).item() == done.rate_function[2]
    assert {path.name for path in folder.glob("rate_function.*")} == {"rate_function.png", "rate_function.pdf"}


def test_a_case_needs_the_moments_for_it(tmp_path):
    with pytest.raises(CaseError, match=r'output.quantities\[0\]: got "rate_function", which follows'):
        case_in(tmp_path, CASE.replace('"moment", ', ""), name="rates")
