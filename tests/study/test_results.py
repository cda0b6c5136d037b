"""Results of cases are plain values: they travel to other processes."""

import pickle
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

from fpsolve.cli import main
from fpsolve.workflow import compare
from tests.kit import ALL, INDICES, case_in, case_text, from_record, simulate_curves, solve_sets

SECTIONS = """[moments]
p = [1.0]
[monte_carlo]
paths = 640
time = 40.0
[response]
off = true
[[expect]]
quantity = "lyapunov_exponent"
value = 0.0
atol = 1.0
source = "a guess"
"""
CASE = case_text(SECTIONS, noise={"D0": 0.1}, epsilon=0.5, c1=0.8, c2=0.5)
SLOW = {"epsilon": 1.0930367, "omega": 0.07252887, "restitution": 0.57982, "c1": -0.338098, "impact": "restitution"}
SLOW_NOISE = {"D0": 0.09531017, "tau0": 49.143166, "r0": 0.61455889, "treatment": "exact"}


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    return case_in(tmp_path_factory.mktemp("case"), CASE, [ALL])


@pytest.fixture(scope="module")
def solved(case):
    (found,) = solve_sets(case)
    return found


@pytest.fixture(scope="module")
def result(solved):
    return solved.result


@pytest.mark.slow
def test_results_pickle(case, solved, result):
    """Also solved curves with their eigenpairs, comparisons, and simulated curves."""
    [simulated], [comparison] = simulate_curves(case), compare(case, [result])
    again, whole, other, sample = pickle.loads(pickle.dumps((result, solved, comparison, simulated)))
    for each in (again, whole.result):
        np.testing.assert_array_equal(each.moments.value, result.moments.value)
        assert each.estimates == result.estimates
        assert each.curve == result.curve
        assert compare(case, [each]) == [comparison] == [other]
    assert comparison.met
    drawn, first = (each.pictures["eigenfunctions"] for each in (whole, solved))
    [pair], [original] = drawn.pairs, first.pairs
    assert pair.p == original.p == 1.0
    for one, two in ((pair, original), (drawn.stationary, first.stationary)):
        np.testing.assert_array_equal(one.right, two.right)
        np.testing.assert_array_equal(one.left, two.left)
    assert (sample.result, sample.estimates) == (simulated.result, simulated.estimates)
    np.testing.assert_array_equal(sample.response.density, simulated.response.density)


def test_results_are_frozen(result):
    with pytest.raises(FrozenInstanceError):
        result.failures = ()


def test_what_did_not_converge_is_printed_once(case, tmp_path, capsys):
    """No empty table, and one sentence for all indices, which fail for one reason."""
    tight = ["--set", "budget.unknowns=100", "--set", "oscillator.epsilon=2.0", "--set", "moments.p=[9.0]"]
    tight += ["--set", f"output.quantities={INDICES}"]
    assert main(["run", str(case.path), "--out", str(tmp_path), *tight]) == 3
    printed = capsys.readouterr()
    assert "┃" not in printed.out
    said = " ".join(printed.err.split())
    assert said.count("Λ(p) near p = 0 follows from Λ(0.01)") == 1
    assert "no λ, δ_p, Λ″(0), N, R_c, r_c: Λ(p) near p = 0 follows from Λ(0.01): Λ(0.01) did not converge" in said
    assert "[mesh]" not in said  # there is none


@pytest.mark.slow
def test_a_density_that_is_none_is_not_written(tmp_path, capsys):
    path = tmp_path / "slow.toml"
    sections = SECTIONS.replace("[moments]", "[moments]\nrtol = 1e-4").replace("time = 40.0", "time = 4000.0")
    path.write_text(case_text(sections, noise=SLOW_NOISE, **SLOW), encoding="utf-8")
    assert main(["run", str(path), "--out", str(tmp_path)]) == 0
    assert "the stationary density at p = 0 is not resolved" in " ".join(capsys.readouterr().err.split())
    assert (tmp_path / "slow" / "summary.json").exists()
    assert not list((tmp_path / "slow").rglob("*.vtu"))


def test_results_from_records_are_data_as_those_that_are_solved(case, solved):
    """Also what comparisons leave out: the names and units of numbers, which pictures and arrays tell."""
    found = from_record(case, solved)
    for name, estimate in solved.result.estimates.items():
        again = found.estimates[name]
        assert repr(again) == repr(estimate)
        if estimate is not None:
            assert again.quantity == estimate.quantity
            assert again.to_xarray().identical(estimate.to_xarray())
    assert found.sensitivities.to_xarray().identical(solved.result.sensitivities.to_xarray())
