"""A case of equations with terms of degree 3: its numbers and files have the names of its variables."""

import math

import numpy as np
import pytest
import pyvista

import fpsolve
from fpsolve.cli import main
from fpsolve.messages import Code
from fpsolve.results.curve import Status
from fpsolve.study.solve import Numerics, everything, solve_curve
from fpsolve.workflow import simulate_case
from tests.kit import case_in, read_csv, read_json

CASE = """title = "test"
[system]
variables = ["q", "w"]
drift = ["w", "-omega**2 * q + 0.04*omega * w - k * q**3 - c * q**2 * w - xi * q"]
parameters = { omega = 2.0, k = 0.3, c = 0.4 }
[noise]
kind = "ornstein-uhlenbeck"
alpha = 2.0
sigma = 3.0
[moments]
p = [1.0]
[output]
quantities = ["moment", "response"]
figure = false
[response]
rtol = 0.1
grid = { amplitude = 40, phi = 25, xi = 8 }
[monte_carlo]
paths = 256
time = 100.0
[[expect]]
quantity = "response.q_squared"
value = 1.0
rtol = 10.0
source = "a guess"
"""
NUMBERS = ["amplitude", "amplitude_squared", "amplitude_fourth", "q_squared", "w_squared"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    case = case_in(tmp_path_factory.mktemp("case"), CASE)
    out = tmp_path_factory.mktemp("results")
    fpsolve.run(case, out)
    simulate_case(case, out)
    return out / "test"


@pytest.mark.slow
def test_names_are_those_of_the_variables(folder):
    [curve] = read_json(folder / "summary.json")["curves"]
    found = curve["response"]
    assert [*found["means"]] == [f"{name}{end}" for name in NUMBERS for end in ("", "_error")]
    assert "impact_rate" not in found
    amplitude, q, w = (found["means"][name] for name in ("amplitude_squared", "q_squared", "w_squared"))
    assert amplitude == pytest.approx(q + w / 4, rel=1e-12)
    [row] = read_csv(folder / "curves.csv")
    assert {name for name in row if name.startswith("response") and not name.endswith("error")} == {
        f"response_{name}" for name in NUMBERS
    }
    assert float(row["response_q_squared"]) == q
    simulated = read_json(folder / "monte_carlo.json")["response"]
    assert [*simulated["means"]] == ["q_squared", "w_squared", "amplitude"]
    mean = simulated["means"]["q_squared"]
    assert abs(mean["value"] - q) < 5 * mean["standard_error"]


@pytest.mark.slow
def test_the_plane_is_whole(folder):
    """Without a wall the density is on both sides, alike, and 1 in all."""
    plane = pyvista.read(folder / "response.vtu")
    a, phi = plane["amplitude"].reshape(40, -1), plane["phi"].reshape(40, -1)
    np.testing.assert_allclose(plane.points[:, 0], (a * np.cos(phi)).ravel(), atol=1e-12)
    np.testing.assert_allclose(plane.points[:, 1], (-2 * a * np.sin(phi)).ravel(), atol=1e-12)
    assert phi[0, -1] - phi[0, 0] == pytest.approx(2 * math.pi)
    density = plane["density"].reshape(a.shape)
    np.testing.assert_array_equal(density[:, 1:25], density[:, 25:])
    share = 2 * np.trapezoid(density * a, dx=2 * math.pi / 48, axis=1).sum() * (a[1, 0] - a[0, 0])
    assert share == pytest.approx(1, abs=5e-3)


@pytest.mark.slow
def test_it_is_read_from_its_record_and_compared(folder, tmp_path, capsys):
    case = case_in(tmp_path, CASE)
    [result] = fpsolve.run(case, folder.parent)
    assert [*result.response.numbers] == NUMBERS
    assert main(["check", str(case.path)]) == 0
    assert "response.q_squared" in capsys.readouterr().out


def test_why_there_is_none_is_told(tmp_path):
    case = case_in(tmp_path, CASE.replace("c = 0.4", "c = 0.0"))
    [curve] = case.curves()
    found = solve_curve(curve, everything(case), Numerics.of(case)).result
    assert found.response is None
    assert [each.code for each in found.notes if each.code is Code.RESPONSE_GROWS]
    assert found.status is not Status.PARTLY
