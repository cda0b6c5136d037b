"""Intervals of cases by first order, against samples, on the command line and in files."""

import math

import numpy as np
import pytest
from scipy.stats import norm

from fpsolve.analysis import latin_hypercube
from fpsolve.case.vary import Vary
from fpsolve.cli import main
from fpsolve.parts.intervals import spreads_of
from fpsolve.study.solve import Numerics, everything, solve_curve
from tests.conftest import sampled
from tests.kit import case_in, read_csv, read_json

UNIFORM = """
title = "A uniform phase"
uncertain = {{ {uncertain} }}
[system]
variables = ["x", "y"]
drift = ["a*x + y + xi*x", "-x + a*y + xi*y"]
parameters = {{ a = -0.3 }}
[noise]
kind = "ornstein-uhlenbeck"
alpha = 0.8
sigma = 0.5
[moments]
p = [1.0, 2.0]
[output]
quantities = ["moment", "lyapunov_exponent", "stability_index"]
"""
WALL = """
title = "A wall"
[oscillator]
epsilon = 0.3
omega = 1.0
restitution = 0.9
c1 = -0.4
[noise]
D0 = 1.0
tau0 = 0.5
r0 = 0.9
treatment = "exact"
[moments]
p = [2.0]
[uncertain]
"noise.D0" = 0.05
oscillator.restitution = { sd = 0.02 }
[output]
quantities = ["moment", "lyapunov_exponent", "stability_index"]
"""


def case_of(folder, text, *overrides):
    return case_in(folder, text, overrides, name="case")


def solved(case):
    return [solve_curve(curve, everything(case, curve.number), Numerics.of(case)).result for curve in case.curves()]


def test_a_verdict_is_the_probability_of_the_normal_law(tmp_path):
    case = case_of(tmp_path, UNIFORM.format(uncertain='"system.a" = { sd = 0.05 }'))
    [result] = solved(case)
    spreads = spreads_of(case, result)
    value = -0.6 + 2 * 0.25 / 0.64
    assert spreads.moments[2.0].below == pytest.approx(norm.cdf(-value / 0.1), abs=1e-7)
    assert spreads.indices["stability_index"].deviation == pytest.approx(0.1 * 0.64 / 0.25, rel=1e-7)


CASES = [UNIFORM.format(uncertain='"system.a" = 0.1, "noise.sigma" = 0.03'), WALL]
CASES += [WALL.replace("c1 = -0.4", "c1 = -0.2").replace('"noise.D0" = 0.05', '"noise.tau0" = 0.1')]


@pytest.mark.parametrize("text", sampled(*CASES[2:], keep=0))
def test_samples_lie_in_the_intervals_as_stated(text, tmp_path):
    """Of 40 some 95 %: by more than four standard errors of chance, 14 %, they are no others."""
    case = case_of(tmp_path, text, "moments.p=[2.0]")
    sets = latin_hypercube(case.uncertain.laws(case.problem), 40)
    [result], drawn = solved(case), solved(case.model_copy(update={"vary": Vary(sets, "zip")}))
    spreads = spreads_of(case, result)
    for name, spread in spreads.indices.items():
        values = np.array([each.estimates[name].value for each in drawn])
        assert np.mean((values > spread.low) & (values < spread.high)) == pytest.approx(0.95, abs=0.14)
        assert np.std(values) == pytest.approx(spread.deviation, rel=0.15)
    values = np.array([each.moment(2.0).value for each in drawn])
    assert np.std(values) == pytest.approx(spreads.moments[2.0].deviation, rel=0.15)


def test_files_and_the_terminal_say_it(tmp_path, capsys):
    case_of(tmp_path, UNIFORM.format(uncertain='"system.a" = { sd = 0.05 }'))
    arguments = ["run", str(tmp_path / "case.toml"), "--out", str(tmp_path), "--jobs", "1"]
    assert main([*arguments, "--set", "output.figure=false"]) == 0
    said = capsys.readouterr().out
    assert "95% interval" in said
    sure = "almost every path decays with a probability of > 99.9 %; the mean square grows with a probability of 96.5 %"
    assert sure in said.lower()  # norm.cdf(1.8125)
    [curve] = read_json(tmp_path / "case/summary.json")["curves"]
    size = norm.ppf(0.975) * 0.05
    assert curve["uncertainty"]["lyapunov_exponent"]["high"] == pytest.approx(-0.3 + size, abs=1e-9)
    [row] = read_csv(tmp_path / "case/curves.csv")
    assert float(row["lyapunov_exponent_low"]) == pytest.approx(-0.3 - size, abs=1e-9)
    rows = read_csv(tmp_path / "case/moments.csv")
    assert float(rows[1]["moment_low"]) == pytest.approx(-0.6 + 0.5 / 0.64 - 2 * size, abs=1e-9)
    assert main([*arguments, "--report", "--set", "output.figure=false"]) == 0
    page = (tmp_path / "case/report.html").read_text(encoding="utf-8")
    assert "the mean square grows with a probability of 96.5 %." in page
    assert "1 of 1 known" in capsys.readouterr().out


def test_a_law_that_is_cut_moves_the_interval(tmp_path):
    """Of r = 1 − 0.01 ± 0.02 more than half is cut off: the mean is below 0.99."""
    case = case_of(tmp_path, WALL.replace("restitution = 0.9", "restitution = 0.99"))
    law = case.uncertain.laws(case.problem)["oscillator.restitution"]
    assert (law.low, law.high) == (0.0, 1.0)
    [result] = solved(case)
    spread = spreads_of(case, result).indices["lyapunov_exponent"]
    slope = result.sensitivities.indices["lyapunov_exponent"]["oscillator.restitution"].value
    assert spread.mean - spread.value == pytest.approx(slope * (law.mean - 0.99), rel=1e-9)
    assert spread.mean < spread.value  # less restitution, smaller λ
    assert math.isclose(law.value, 0.99)
