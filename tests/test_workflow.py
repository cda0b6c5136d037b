"""Running a case: what is written, that it agrees with what was computed, and that failures lose nothing."""

import json
import re
import shutil
import signal
import subprocess
import sys
from contextlib import nullcontext
from dataclasses import replace
from importlib.metadata import version
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista
import xarray

import fpsolve
from fpsolve.analysis import stationary_density, tilted_density
from fpsolve.case.remedies import CASE_WORDS
from fpsolve.errors import CaseError, FpsolveError, NotConverged, OutputError
from fpsolve.exponent import INDICES as KNOWN
from fpsolve.exponent.fields import UNRESOLVED
from fpsolve.exponent.solver import ExponentSolver
from fpsolve.files import alone
from fpsolve.output.tables import write_results
from fpsolve.parts import PARTS
from fpsolve.study import solve
from fpsolve.study.solve import solve_curve
from fpsolve.workflow import Watch, check_case, compare, run_case, sets, simulate_case
from tests.conftest import painted
from tests.kit import (
    COSTLY,
    DRAWN,
    HOPELESS,
    INDICES,
    LEAN,
    TABLES,
    TEXT,
    case_in,
    files,
    read_csv,
    read_json,
    solve_case,
    solve_sets,
)


@pytest.fixture
def case(tmp_path):
    return case_in(tmp_path, TEXT)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The results and the folder of a case that is run once, by the name of its file, for tests that only look."""
    folder = tmp_path_factory.mktemp("whole")
    case_in(folder, DRAWN)
    with painted():
        return SimpleNamespace(results=fpsolve.run(str(folder / "test.toml"), folder), folder=folder / "test")


def beside_records(folder):
    """All files but the records."""
    return {name for name in files(folder) if not name.startswith("records/")}


def test_summary_has_the_promised_form_and_the_computed_values(whole):
    results = whole.results
    summary = read_json(whole.folder / "summary.json")
    state = ["case", "title", "fpsolve_version", "units", "complete", "planned", "done"]
    facts = ["versions", "command", "host", "started", "wall_seconds", "overrides", "case_text"]
    assert list(summary) == [*state, *facts, "curves"]
    assert (summary["case"], summary["title"]) == ("test", "A test")
    assert summary["fpsolve_version"] == version("fpsolve")
    assert (summary["complete"], summary["planned"], summary["done"]) == (True, 2, 2)
    assert (summary["case_text"], summary["overrides"]) == (DRAWN, [])
    for curve, result, D0 in zip(summary["curves"], results, (0.1, 1.0), strict=True):
        assert curve["varied"] == {"noise.D0": D0}
        assert curve["parameters"]["noise.D0"] == D0
        assert curve["parameters"]["oscillator.impact"] == "delta"
        assert curve["parameters"]["noise.treatment"] == "ou-reduction"
        assert [row["p"] for row in curve["moments"]] == [2.0, 0.0, -1.0]
        keys = {"p", "residual", *(f"moment{each}" for each in ("", "_error", "_perturbation"))}
        keys |= {"moment_derivative", "moment_derivative_error"}
        assert all(set(row) == keys for row in curve["moments"])
        np.testing.assert_array_equal([row["moment"] for row in curve["moments"]], result.moments.value)
        assert curve["lyapunov_exponent"] == result.lyapunov_exponent.value
        assert {"stability_index", "stability_index_error", "stability_index_perturbation"} < set(curve)
        assert curve["variance_rate"] > 0
        for name in ("impact_rate", "critical_impact_factor", "critical_restitution"):
            assert curve[f"{name}_error"] == result.estimates[name].error_estimate
            assert curve[name] == result.estimates[name].value
            assert curve[name] == pytest.approx(curve[f"{name}_perturbation"], rel=5e-3)
        used = curve["discretisation"]
        assert used == result.discretisation
        assert used["xi"] == "polynomials"
        assert used["unknowns"] == used["xi_size"] * sum(degree + 1 for degree in used["phi_degrees"])
        assert len(used["phi_degrees"]) == used["phi_cells"]
        assert used["tilt"] > 0
        assert (curve["status"], curve["warnings"]) == ("converged", [])
        assert curve["seconds"] == pytest.approx(result.seconds, abs=1e-6)
    assert summary["curves"][1]["moments"][0]["moment"] == pytest.approx(0.0141631436533, rel=1e-10)
    assert summary["curves"][1]["moments"][0]["moment_perturbation"] == pytest.approx(0.014149421727, rel=1e-10)


def test_writing_tables_makes_no_curves(case, tmp_path, monkeypatch):
    """There may be many, and the tables are written again and again."""
    assert case.asked  # which looks at the first ones
    monkeypatch.setattr("fpsolve.case.case.Curve", None)
    write_results(case, [], tmp_path / "out", {})
    summary = read_json(tmp_path / "out/summary.json")
    assert (summary["complete"], summary["planned"], summary["done"]) == (False, 2, 0)


def test_table_holds_every_curve_and_moment(whole):
    rows = read_csv(whole.folder / "moments.csv")
    assert len(rows) == 6
    assert list(rows[0])[:3] == ["noise.D0", "p", "moment"]
    values = np.concatenate([result.moments.value for result in whole.results])
    np.testing.assert_array_equal([float(row["moment"]) for row in rows], values)


def test_all_files_are_there_and_no_temporary_ones(whole):
    names = files(whole.folder)
    expected = {*TABLES, "figure.png", "figure.pdf", "density.vtu", "show.py"}
    assert expected | {"eigenfunctions.pvd", "eigenfunctions-2.pvd"} <= names
    assert not [name for name in names if name.split("/")[-1].startswith(".")]
    assert (whole.folder / "figure.png").read_bytes().startswith(b"\x89PNG")
    assert (whole.folder / "figure.pdf").read_bytes().startswith(b"%PDF")


def without_times(folder):
    """The texts of all tables, without what tells one run from another of the same case."""
    summary, moments, curves = (
        (folder / name).read_text(encoding="utf-8") for name in ("summary.json", "moments.csv", "curves.csv")
    )
    for name in ("command", "started", "wall_seconds", "seconds"):
        summary, count = re.subn(rf'("{name}": ).*', r"\1", summary)
        assert count
    assert curves.splitlines()[0].endswith(",seconds")
    return summary, moments, [line.rpartition(",")[0] for line in curves.splitlines()]


@pytest.mark.slow
def test_tables_are_the_same_twice(whole, tmp_path):
    """Of a case, and of the name of its file."""
    case = case_in(tmp_path, DRAWN)
    assert [each.curve for each in fpsolve.run(case, tmp_path)] == [each.curve for each in whole.results]
    assert without_times(tmp_path / "test") == without_times(whole.folder)
    first, second = (xarray.load_dataset(folder / "results.nc") for folder in (whole.folder, tmp_path / "test"))
    assert first.drop_vars("seconds").equals(second.drop_vars("seconds"))
    with pytest.raises(CaseError, match=r"other\.toml"):
        fpsolve.run(tmp_path / "other.toml", tmp_path / "out")


def test_no_eigenfunctions_where_none_are_asked_for(tmp_path):
    case = case_in(tmp_path, TEXT.replace("[2.0]\n", "[]\n"))
    fpsolve.run(case, tmp_path / "out")
    assert not [name for name in files(tmp_path / "out") if "eigenfunctions" in name]


MANY = 'vary."noise.D0"={start=0.1, stop=1.0, num=11}'


def test_of_many_curves_only_an_eigenfunction_of_the_first_is_written(tmp_path):
    case, calls = case_in(tmp_path, TEXT.replace("eigenfunctions = [2.0]", ""), [MANY, "moments.p=[2.0]"]), []
    fpsolve.run(case, tmp_path / "out", progress=lambda: calls.append(1))
    assert len(calls) == 11
    written = {name for name in files(tmp_path / "out/test") if "vt" in name or "pv" in name}
    assert written == {"eigenfunctions/p+2.0.vtu", "eigenfunctions.pvd"}


def test_without_vary_there_is_one_curve(tmp_path):
    case = case_in(tmp_path, TEXT.replace('[vary]\n"noise.D0" = [0.1, 1.0]\n', ""), [LEAN])
    (result,) = fpsolve.run(case, tmp_path / "out")
    summary = read_json(tmp_path / "out/test/summary.json")
    assert summary["curves"][0]["varied"] == {}
    assert summary["curves"][0]["parameters"]["noise.D0"] == 0.5 == result.curve.parameters["noise.D0"]


def test_missing_stability_index_is_null_and_said(tmp_path):
    overrides = ["oscillator.omega=10.0", "oscillator.c1=-1.0", "oscillator.restitution=0.5"]
    overrides += ["output={ quantities = ['stability_index'] }"]
    case = case_in(tmp_path, TEXT, overrides)
    result = fpsolve.run(case, tmp_path / "out")[0]
    curve = read_json(tmp_path / "out/test/summary.json")["curves"][0]
    assert curve["stability_index"] is None
    assert curve["status"] == result.status.word == "no index"
    assert not result.status.fails
    assert ",no index," in (tmp_path / "out/test/curves.csv").read_text(encoding="utf-8").splitlines()[1]
    assert curve["warnings"] == ["no stability index: Λ(p) has no root p ≠ 0 in [-20, 20]"]


def test_a_failure_half_way_loses_nothing_that_was_finished(tmp_path):
    """The strong-noise curve fails at p = 2 and −1; the weak one and p = 0 are kept."""
    text = DRAWN.replace('"noise.D0" = [0.1, 1.0]', '"oscillator.epsilon" = [0.01, 1.5]')
    case = case_in(tmp_path, text, [HOPELESS])
    with pytest.raises(NotConverged, match="use more cells") as caught:
        fpsolve.run(case, tmp_path / "out")
    assert len(caught.value.partial) == 2
    summary = read_json(tmp_path / "out/test/summary.json")
    assert [row["p"] for row in summary["curves"][0]["moments"]] == [2.0, 0.0, -1.0]
    assert 0.0 in [row["p"] for row in summary["curves"][1]["moments"]]
    assert len(summary["curves"][1]["moments"]) < 3
    assert "use more cells" in summary["curves"][1]["warnings"][-1]
    assert {"figure.png", "moments.csv"} <= files(tmp_path / "out/test")


def test_failures_are_values(tmp_path):
    text = TEXT.replace('"noise.D0" = [0.1, 1.0]', '"oscillator.epsilon" = [0.01, 1.5]')
    text += '[[expect]]\nquantity = "moment"\np = 2.0\nvalue = 0.0\natol = 10.0\nsource = "any"\n'
    case = case_in(tmp_path, text, [HOPELESS])
    outcome, checked = run_case(case, tmp_path / "out"), check_case(case)
    for results, failed in ((outcome.results, [2.0, -1.0]), (checked.results, [2.0])):  # what is not expected is left
        found = [[each.p for each in result.failures if each.p is not None] for result in results]
        assert [sorted(each, reverse=True) for each in found] == [[], failed]
        assert not {failure.reason for failure in results[1].failures} & set(results[1].warnings)
    indices = [each.reason for each in outcome.results[0].failures]
    assert all(reason.startswith("no ") for reason in indices)  # whose p are all there
    assert (len(outcome.failures) - len(indices), len(checked.failures)) == (2, 1)
    assert not outcome.interruption
    curves = read_json(tmp_path / "out/test/summary.json")["curves"]
    told = [*outcome.results[1].warnings, *outcome.failures[len(indices) :]]
    assert curves[1]["warnings"] == [each.words(CASE_WORDS) for each in told]
    assert any("[mesh]" in text for text in curves[1]["warnings"])
    assert not any("[mesh]" in text for text in told)
    assert files(tmp_path) == {"test.toml", *(f"out/test/{name}" for name in files(tmp_path / "out/test"))}


@pytest.mark.parametrize("small", [0.0, 0.001])
def test_what_fails_for_small_p_is_said_once(tmp_path, small):
    """λ, Λ″(0) and δ_p need the same solve; Λ(0) = 0 needs none."""
    sets = [f"moments.p=[9.0, {small}]", "oscillator.epsilon=2.0", "budget.unknowns=100", "output.eigenfunctions=[]"]
    sets += [f"output.quantities={INDICES}"]
    outcome = run_case(case_in(tmp_path, TEXT, [*sets, 'vary={"noise.D0"=[1.0]}']), tmp_path / "out")
    (curve,) = read_json(tmp_path / "out/test/summary.json")["curves"]
    assert [failure.p for failure in outcome.results[0].failures] == [9.0, small][: 2 if small else 1]
    assert sum("the next mesh has" in text for text in curve["warnings"]) == 2
    row = {"p": 0.0, "moment": 0.0, "moment_perturbation": 0.0, "moment_error": 0.0}
    row |= dict.fromkeys(["moment_derivative", "moment_derivative_error", "residual"])
    assert curve["moments"] == ([] if small else [row])
    assert curve["warnings"][0].startswith("no λ, δ_p, Λ″(0), N, R_c, r_c: ")
    assert curve["warnings"][0].endswith("there is no Λ(0.001)") == bool(small)
    assert [row["moment_derivative"] for row in read_csv(tmp_path / "out/test/moments.csv")] == [""] * (not small)


@pytest.mark.parametrize(("p", "status"), [([], "failed"), ([0.0], "partly")])
def test_an_index_that_does_not_converge_is_a_failure(tmp_path, p, status):
    """Not only a warning: where no p is asked for, or all are there, nothing else tells of it."""
    quantities = ["lyapunov_exponent", *(["moment"] if p else [])]
    sets = [
        f"output.quantities={quantities}",
        "output.eigenfunctions=[]",
        "oscillator.epsilon=2.0",
        "budget.unknowns=100",
    ]
    text = TEXT.replace("eigenfunctions = [2.0]", "")
    case = case_in(
        tmp_path, text, [*(sets if p else sets[:1] + sets[2:]), f"moments.p={p or [1.0]}", 'vary={"noise.D0"=[1.0]}']
    )
    with pytest.raises(NotConverged, match=r"no λ: .*use a larger rtol"):
        fpsolve.run(case, tmp_path / "out")
    [curve] = read_json(tmp_path / "out/test/summary.json")["curves"]
    assert curve["status"] == status
    assert [text[:5] for text in curve["warnings"]] == ["no λ: "[:5]]


@pytest.mark.slow
def test_zero_has_no_sign(tmp_path):
    sets = [
        "moments.p=[-0.0, 2.0, -1.0]",
        "oscillator.c1=-0.0",
        "oscillator.restitution=1.0",
        "output.eigenfunctions=[-0.0]",
    ]
    run_case(case_in(tmp_path, TEXT, [*sets, "monte_carlo={ paths = 64, time = 40.0 }"]), tmp_path, monte_carlo=True)
    for name in ("summary.json", "moments.csv", "curves.csv", "monte_carlo.json", "eigenfunctions.pvd"):
        text = (tmp_path / "test" / name).read_text(encoding="utf-8")
        if name == "summary.json":  # what was written is kept as it was
            text = json.dumps(json.loads(text)["curves"])
        assert "-0.0" not in re.findall(r"-?[\d.e+-]+", text), name


def raising_at(count, exception):
    """What raises when it is called for the count-th time."""
    calls = []

    def called():
        calls.append(1)
        if len(calls) == count:
            raise exception

    return called


def interrupt_curve(monkeypatch, number, exception=KeyboardInterrupt):
    """The solving of a curve is interrupted, but not that only pictures of it are drawn."""

    def interrupted(curve, asked, numerics, progress, entries, *others):
        if curve.number == number and not entries:
            raise exception
        return solve_curve(curve, asked, numerics, progress, entries, *others)

    monkeypatch.setattr(solve, "solve_curve", interrupted)


def test_an_interruption_keeps_the_finished_curves(case, tmp_path, monkeypatch):
    interrupt_curve(monkeypatch, 2)
    with pytest.raises(KeyboardInterrupt, match=r"^interrupted after 1 of 2 curves; .*; run it again to go on$"):
        fpsolve.run(case, tmp_path / "out")
    summary = read_json(tmp_path / "out/test/summary.json")
    assert [curve["varied"]["noise.D0"] for curve in summary["curves"]] == [0.1]
    assert (summary["complete"], summary["planned"], summary["done"]) == (False, 2, 1)
    assert {*TABLES, "eigenfunctions.pvd"} <= files(tmp_path / "out/test")


@pytest.mark.parametrize("name", ["write_results", "write_curves", "write_dataset"])
def test_tables_are_whole_where_an_interruption_comes_as_they_are_written(case, tmp_path, monkeypatch, name):
    """All sets are solved, and the tables tell of them."""
    writes, signals = getattr(sets, name), [signal.SIGINT]

    def interrupted(*arguments):
        if signals and (name != "write_results" or arguments[4] == 2):  # there are tables of fewer finished sets
            signal.raise_signal(signals.pop())
        return writes(*arguments)

    monkeypatch.setattr(sets, name, interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt, match=r"^interrupted after 2 of 2 curves; what was done is kept in "):
            fpsolve.run(case, tmp_path / "out")
    finally:
        signal.signal(signal.SIGINT, before)
    summary = read_json(tmp_path / "out/test/summary.json")
    assert (summary["complete"], summary["planned"], summary["done"]) == (True, 2, 2)
    assert {*TABLES, "eigenfunctions.pvd"} <= files(tmp_path / "out/test")


def test_a_run_goes_on_where_it_was_interrupted(whole, tmp_path, monkeypatch):
    """With the numbers of a run that nobody interrupts; files but records are made anew."""
    case = case_in(tmp_path, DRAWN)
    interrupt_curve(monkeypatch, 2)
    with pytest.raises(KeyboardInterrupt):
        fpsolve.run(case, tmp_path / "out")
    interrupt_curve(monkeypatch, 1)  # which is not solved again
    fpsolve.run(case, tmp_path / "out")
    folder = tmp_path / "out/test"
    assert without_times(folder) == without_times(whole.folder)
    assert beside_records(folder) == beside_records(whole.folder)
    for name in beside_records(folder):
        (folder / name).unlink()
    interrupt_curve(monkeypatch, 0)
    fpsolve.run(case, tmp_path / "out")
    assert without_times(folder) == without_times(whole.folder)
    assert beside_records(folder) == beside_records(whole.folder)
    interrupt_curve(monkeypatch, 1)
    with pytest.raises(KeyboardInterrupt, match=r"^interrupted after 0 of 2 curves; run it again to go on$"):
        fpsolve.run(case, tmp_path / "out", fresh=True)
    assert files(folder) == TABLES


SIMULATED = {
    "monte_carlo.json",
    "monte_carlo-2.json",
    "monte_carlo_response.vti",
    "monte_carlo_response.csv",
    "monte_carlo_response-2.png",
}
"""Files of simulations."""


@pytest.mark.parametrize(
    ("exception", "raised", "left"),
    [(KeyboardInterrupt, KeyboardInterrupt, TABLES), (OSError, OutputError, TABLES - {"results.nc"})],
)
def test_a_run_that_ends_early_leaves_nothing_of_an_earlier_one(
    case, whole, tmp_path, monkeypatch, exception, raised, left
):
    """It begins anew and ends in the first curve: there are tables that say so, and the files of others."""
    folder = shutil.copytree(whole.folder, tmp_path / "test")
    others = {"monte_carlo.txt", "monte_carlo_response-a.vti", "eigenfunctions.png", "figure.svg", "notes/summary.json"}
    (folder / "notes").mkdir()
    for name in others | SIMULATED:
        (folder / name).write_text("mine", encoding="utf-8")
    interrupt_curve(monkeypatch, 1, exception)
    with pytest.raises(raised):
        fpsolve.run(case, tmp_path, fresh=True)
    assert files(folder) == left | others
    summary = read_json(folder / "summary.json")
    assert summary["curves"] == []
    assert (summary["complete"], summary["planned"], summary["done"]) == (False, 2, 0)


def test_a_run_with_simulation_that_ends_early_leaves_nothing_of_an_earlier_one(case, tmp_path, monkeypatch):
    (tmp_path / "test").mkdir()
    for name in SIMULATED:
        (tmp_path / "test" / name).write_text("{}", encoding="utf-8")
    interrupt_curve(monkeypatch, 1)
    with pytest.raises(KeyboardInterrupt):
        run_case(case, tmp_path, monte_carlo=True)
    assert files(tmp_path / "test") == TABLES


def test_a_run_and_a_simulation_of_the_same_parameters_stay_together(case, tmp_path):
    """Each keeps what the other wrote, unless that is of parameters that the case does not have; records stay."""
    folder = tmp_path / "test"
    first = fpsolve.load_case(case.path, [LEAN])
    second = fpsolve.load_case(case.path, [LEAN, "oscillator.omega=2.0"])
    fpsolve.run(first, tmp_path)
    solved = files(folder)
    parameters = dict(next(first.curves(1)).parameters)
    table = json.dumps({"parameters": parameters})
    (folder / "monte_carlo-2.json").write_text(table, encoding="utf-8")
    fpsolve.run(first, tmp_path)
    assert files(folder) == solved | {"monte_carlo-2.json"}
    fpsolve.run(second, tmp_path)
    assert files(folder) == solved
    watch = Watch(bar=lambda *_: nullcontext(raising_at(1, KeyboardInterrupt)))
    with pytest.raises(KeyboardInterrupt):
        simulate_case(second, tmp_path, watch=watch)
    assert files(folder) == solved
    with pytest.raises(KeyboardInterrupt):
        simulate_case(first, tmp_path, watch=watch)
    assert beside_records(folder) == set()


def test_infinite_moments_are_refused_before_anything_is_written(tmp_path):
    with pytest.raises(CaseError, match=r"test\.toml:\d+: moments: Λ\(2\) is not computed"):
        case_in(tmp_path, TEXT, ["noise.treatment='exact'", "noise.r0=1.1", "vary={}"])
    text = TEXT.replace('"noise.D0" = [0.1, 1.0]', '"noise.r0" = [0.9, 1.1]')
    case_in(tmp_path, text, ["noise.treatment='exact'"])  # of a sweep these sets alone fail
    case_in(
        tmp_path, TEXT.replace("r0 = 0.95", "r0 = 1.1").replace('"noise.D0" = [0.1, 1.0]', '"noise.r0" = [0.9, 0.8]')
    )


def test_a_value_that_vary_would_replace_is_refused(tmp_path):
    with pytest.raises(CaseError, match=r"--set noise\.D0=7: noise\.D0: has no effect, as the case varies noise\.D0"):
        case_in(tmp_path, TEXT, ["noise.D0=7"])


def test_a_second_run_leaves_no_eigenfunctions_of_the_first(whole, tmp_path):
    shutil.copytree(whole.folder, tmp_path / "out/test")
    fpsolve.run(case_in(tmp_path, TEXT, ["vary={}", "output.eigenfunctions=[-1.0]"]), tmp_path / "out")
    names = {name for name in files(tmp_path / "out/test") if name.startswith("eigenfunctions")}
    assert names == {"eigenfunctions.pvd", "eigenfunctions/p-1.0.vtu"}
    assert not (tmp_path / "out/test/eigenfunctions-2").exists()


def test_files_of_the_user_are_left_alone(case, tmp_path):
    folder = tmp_path / "out/test"
    mine = [
        folder / name
        for name in ("eigenfunctions-mine.pvd", "eigenfunctions_paper/paper.vtu", "eigenfunctions/paper.vtu")
    ]
    for path in mine:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("mine", encoding="utf-8")
    fpsolve.run(case, tmp_path / "out")
    assert all(path.read_text(encoding="utf-8") == "mine" for path in mine)


KILLED = """
import os, signal, sys
from pathlib import Path
from fpsolve.files import atomic
begun = [atomic(Path(name)) for name in sys.argv[1:]]
for each in begun:
    each.__enter__()
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("start", [fpsolve.run, simulate_case])
def test_what_a_killed_run_left_unfinished_is_removed(tmp_path, start):
    """Of the user's files none is, nor one that a run in a folder below is writing."""
    case = case_in(tmp_path, TEXT, [LEAN, "monte_carlo={ paths = 64, time = 40.0 }"])
    folder = tmp_path / "test"
    ours = [str(folder / name) for name in ("summary.json", "eigenfunctions-2/p+2.0.vtu", "lower/summary.json")]
    killed = subprocess.run([sys.executable, "-c", KILLED, *ours], check=False)
    assert killed.returncode == -signal.SIGKILL
    (folder / ".fpsolve-notes").write_text("mine", encoding="utf-8")
    (folder / ".notes").write_text("mine", encoding="utf-8")
    assert len(files(folder)) == 5
    start(case, tmp_path)
    left = [name for name in files(folder) if name.split("/")[-1].startswith(".")]
    assert sorted(name for name in left if "/" not in name) == [".fpsolve-notes", ".notes"]
    assert [name.split("/")[0] for name in left if "/" in name] == ["lower"]


def test_titles_are_plain_text(tmp_path):
    case = case_in(tmp_path, TEXT.replace('"A test"', r"'see [/b] and $\foo$ of [vary]'"))
    fpsolve.run(case, tmp_path / "out")


def test_a_place_that_cannot_be_written_is_an_output_error(case, tmp_path):
    (tmp_path / "out/test/summary.json").mkdir(parents=True)
    with pytest.raises(OutputError, match=r"out/test/summary\.json cannot be written: Is a directory; choose another"):
        fpsolve.run(case, tmp_path / "out")


def test_exact_noise_is_compared_with_the_theory_of_its_reduction(tmp_path):
    case = case_in(tmp_path, TEXT, ["noise.treatment='exact'"])
    result, reduced = solve_case(case)[0], solve_case(case_in(tmp_path, TEXT))[0]
    np.testing.assert_array_equal(result.moments.perturbation, reduced.moments.perturbation)
    assert result.curve.theory_reduces_noise
    assert not reduced.curve.theory_reduces_noise


def test_a_text_is_varied_in_every_file(tmp_path):
    """Of curves with either noise the theory is that of the reduced one."""
    sets = ['vary={ noise.treatment = ["ou-reduction", "exact"] }', "output={ figure = false, eigenfunctions = [2.0] }"]
    case = case_in(tmp_path, TEXT, sets)
    fpsolve.run(case, tmp_path / "out")
    folder = tmp_path / "out/test"
    rows = read_csv(folder / "moments.csv")
    assert [row["noise.treatment"] for row in rows] == ["ou-reduction"] * 3 + ["exact"] * 3
    reduced, exact = rows[:3], rows[3:]
    assert [row["moment_perturbation"] for row in reduced] == [row["moment_perturbation"] for row in exact]
    assert float(reduced[0]["moment"]) != pytest.approx(float(exact[0]["moment"]), rel=1e-3)
    summary = read_json(folder / "summary.json")
    assert [curve["varied"] for curve in summary["curves"]] == [
        {"noise.treatment": "ou-reduction"},
        {"noise.treatment": "exact"},
    ]
    for stem, treatment in (("eigenfunctions", "ou-reduction"), ("eigenfunctions-2", "exact")):
        (file,) = (folder / stem).glob("*.vtu")
        assert pyvista.read(file).field_data[f"noise.treatment = {treatment}"][0] == 1
    written = files(folder)
    with pytest.raises(KeyboardInterrupt):
        simulate_case(case, tmp_path / "out", watch=Watch(bar=lambda *_: nullcontext(raising_at(1, KeyboardInterrupt))))
    assert files(folder) == written


def test_an_unwritable_folder_is_refused_before_solving(case, tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    calls = []
    with pytest.raises(OutputError, match=r"file/test cannot be made: .*choose another folder"):
        fpsolve.run(case, tmp_path / "file", progress=lambda: calls.append(1))
    assert calls == []


@pytest.mark.parametrize("start", [fpsolve.run, simulate_case])
def test_a_folder_that_another_run_writes_into_is_refused(case, tmp_path, start):
    (tmp_path / "test").mkdir()
    for name in ("summary.json", "monte_carlo.json"):
        (tmp_path / "test" / name).write_text("of the other", encoding="utf-8")
    with alone(tmp_path / "test"):
        before = files(tmp_path)
        with pytest.raises(OutputError, match=r"test is being written by another run; wait for it"):
            start(case, tmp_path)
        assert files(tmp_path) == before
    assert files(tmp_path / "test") == {"summary.json", "monte_carlo.json"}


@pytest.mark.parametrize(
    "sets",
    [
        pytest.param([], marks=pytest.mark.slow),
        ["vary={}"],
        [LEAN],
        pytest.param(["vary={}", "output.eigenfunctions=[]"], marks=pytest.mark.slow),
    ],
)
def test_progress_is_called_once_for_each_set_or_for_each_p_of_one(tmp_path, sets):
    """Also of what is known, and of a single curve whose eigenfunctions are drawn again."""
    case = case_in(tmp_path, TEXT, sets)
    for _ in range(2):
        calls = []
        fpsolve.run(case, tmp_path, progress=lambda calls=calls: calls.append(1))
        assert len(calls) == (case.planned if case.planned > 1 else 3)


def test_expectations_are_compared_where_they_select(tmp_path):
    expect = """
[[expect]]
quantity = "moment"
p = 2.0
value = 0.0141631436533
rtol = 1e-9
source = "reference"
where = { "noise.D0" = 1.0 }
[[expect]]
quantity = "lyapunov_exponent"
value = 0.5
atol = 1e-3
source = "wrong on purpose"
"""
    case = case_in(tmp_path, TEXT + expect)
    comparisons = compare(case, solve_case(case))
    assert [(item.varied["noise.D0"], item.met) for item in comparisons] == [(1.0, True), (0.1, False), (1.0, False)]


def test_tilted_densities_that_python_refuses_are_warned_of(tmp_path):
    """Each shown p is judged, by the measure of `tilted_density`."""
    overrides = ["oscillator.epsilon=1.0", "oscillator.restitution=1.0", "noise.r0=1.0", "noise.tau0=1.0"]
    overrides += ["moments={p=[1.0, 3.0, 4.0], rtol=1e-5}", "output.eigenfunctions=[1.0, 3.0, 4.0]", "vary={}"]
    [solved] = solve_sets(case_in(tmp_path, TEXT.replace("c1 = 0.1", "c1 = 0.0"), overrides))
    refused = []
    for pair in solved.pictures["eigenfunctions"].pairs:
        try:
            tilted_density(pair)
        except NotConverged:
            refused.append(pair.p)
    assert refused == [3.0, 4.0]
    told = [text for text in solved.result.warnings if text.startswith("tilted_density at p = ")]
    assert [float(text.split()[4]) for text in told] == refused


def test_unresolved_eigenfunctions_are_warned_of(tmp_path):
    sets = [
        "oscillator.epsilon=1.0",
        "oscillator.restitution=1.0",
        "oscillator.c1=0.0",
        "noise.tau0=1.0",
        "noise.r0=1.0",
    ]
    case = case_in(
        tmp_path,
        TEXT,
        [*sets, "moments.p=[4.0]", "output.eigenfunctions=[4.0]", "moments.rtol=1e-5", 'vary={"noise.D0"=[0.5]}'],
    )
    (solved,) = solve_sets(case)
    pair = solved.pictures["eigenfunctions"].pairs[0]
    told = [
        text for text in solved.result.warnings if text.startswith("T") and "do not rely on a picture of it" in text
    ]
    assert len(told) == sum(defect > UNRESOLVED for defect in pair.sign_defects) == 1
    assert min(pair.sign_defects) < 1e-4


def test_no_cells_are_asked_for_without_a_mesh(tmp_path, monkeypatch):
    monkeypatch.setattr("fpsolve.analysis.density.MOST_NEGATIVE", -1.0)
    for result in fpsolve.run(case_in(tmp_path, TEXT, ["vary={}"]), tmp_path):
        assert result.warnings[-1].endswith("0% of it is negative; use a smaller rtol")


@pytest.mark.parametrize("intensity", [4.0, 15.0])
def test_a_density_that_python_refuses_is_not_written(tmp_path, intensity):
    """Of files that are not written nothing else is said."""
    sets = ["oscillator.epsilon=2.0", "noise.tau0=20.0", f'vary={{"noise.D0"=[{intensity}]}}', "moments.p=[0.0]"]
    mesh = "mesh={phi_cells=1, xi_cells=2, phi_degree=8, xi_degree=8}"
    case = case_in(tmp_path, TEXT, [*sets, "output.eigenfunctions=[0.0]", mesh])
    (curve,) = case.curves()
    with pytest.raises(NotConverged, match=r"\d% of it is negative") as refused:
        stationary_density(ExponentSolver(curve.problem, case.cylinder_mesh()).pair(0.0))
    (result,) = run_case(case, tmp_path / "out").results  # whose λ does not converge either
    told = f"neither the stationary density nor eigenfunctions are written: {refused.value.reason}; use more cells"
    assert any(warning.startswith(told) for warning in result.warnings)
    assert "do not rely on a picture of it" not in " ".join(result.warnings)
    assert not list((tmp_path / "out").rglob("*.vtu"))


@pytest.mark.slow
def test_sensitivities_are_written(tmp_path):
    """At nine p or all, and of the indices, each with its error; those of the Python function."""
    sets = [
        "moments.p={start=-2.0, stop=6.0, num=17}",
        "vary={}",
        "output.sensitivities=true",
        "output.quantities='all'",
    ]
    case = case_in(tmp_path, TEXT, sets)
    fpsolve.run(case, tmp_path)
    [curve] = read_json(tmp_path / "test/summary.json")["curves"]
    found, errors = curve["sensitivities"], curve["sensitivities"]["errors"]
    assert [row["p"] for row in found["moments"]] == [-2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    [solved] = case.curves()
    known = fpsolve.sensitivities(solved.problem, 2.0)
    keys = {"oscillator.omega", "oscillator.restitution", "oscillator.c1", "oscillator.epsilon"}
    keys |= {"noise.D0", "noise.tau0", "noise.r0"}
    pairs = [(known.moments[0], found["moments"][4], errors["moments"][4])]
    pairs += [(known.indices[name], found[name], errors[name]) for name in known.indices]
    assert len(pairs) == 4
    for expected, row, error in pairs:
        assert keys == set(row) - {"p"} == set(error) - {"p"} == set(expected)
        for key in keys:
            assert row[key] == pytest.approx(expected[key].value, rel=1e-6)
            assert 0 <= error[key] < 1e-6 * max(abs(row[key]), expected[key].scale)
    assert {"test/sensitivities.png", "test/sensitivities.pdf"} <= files(tmp_path)


GROWING = ["vary={}", "output.eigenfunctions=[]", "moments.p=[-1.0, 0.5, 1.0, 1.5, 2.0, 3.0]"]


def table(folder):
    return {float(row["p"]): row for row in read_csv(folder / "moments.csv")}


@pytest.mark.parametrize("at", [1, 2, 3])
def test_an_interrupted_curve_keeps_its_moments_and_goes_on(tmp_path, monkeypatch, at):
    """Those that are solved are in the table, and no p is solved twice."""
    case = case_in(tmp_path, TEXT, GROWING)
    whole = fpsolve.run(case, tmp_path / "whole")[0]
    solution, asked = ExponentSolver.solution, list[float]()

    def interrupted(self, p, tolerance=None):
        if p not in asked:
            if len(asked) == at:
                raise KeyboardInterrupt
            asked.append(p)
        return solution(self, p, tolerance)

    monkeypatch.setattr(ExponentSolver, "solution", interrupted)
    with pytest.raises(KeyboardInterrupt, match="after 0 of 1 curve; what was done is kept in"):
        fpsolve.run(case, tmp_path / "out")
    folder = tmp_path / "out/test"
    kept = table(folder)
    assert kept.keys() == set(asked)
    summary = read_json(folder / "summary.json")
    assert (summary["complete"], summary["done"]) == (False, 0)
    assert summary["curves"][0]["status"] == "partly"
    assert "not everything is solved yet; the same command goes on" in summary["curves"][0]["warnings"]
    again = list[float]()
    monkeypatch.setattr(ExponentSolver, "solution", lambda self, p, t=None: again.append(p) or solution(self, p, t))
    [result] = fpsolve.run(case, tmp_path / "out")
    assert not (set(again) - {0.0}) & set(asked)
    np.testing.assert_array_equal(result.moments.p, whole.moments.p)
    apart = np.abs(result.moments.value - whole.moments.value)
    assert np.all(apart <= result.moments.error_estimate + whole.moments.error_estimate)
    assert np.all(np.isfinite(result.moments.derivative_error))
    assert (result.failures, result.status) == ((), whole.status)
    assert read_json(folder / "summary.json")["complete"]


def test_of_an_interrupted_curve_only_the_p_that_are_asked_for_are_in_tables(tmp_path, monkeypatch):
    """Where it was begun with others, too, which are kept for the next time."""
    solution, asked = ExponentSolver.solution, set[float]()

    def interrupted(self, p, tolerance=None):
        asked.add(p)
        if len(asked) > 2:
            raise KeyboardInterrupt
        return solution(self, p, tolerance)

    monkeypatch.setattr(ExponentSolver, "solution", interrupted)
    for p, count in (([-1.0, 2.0, 3.0], 2), ([0.5, 1.5], 0), ([-1.0, 2.0, 3.0], 2)):
        with pytest.raises(KeyboardInterrupt):
            fpsolve.run(case_in(tmp_path, TEXT, [*GROWING, f"moments.p={p}"]), tmp_path / "out")
        found = table(tmp_path / "out/test").keys()
        assert len(found) == count
        assert found <= set(p)


@pytest.mark.parametrize("name", ["stability_index", "critical_impact_factor"])
def test_an_interrupted_curve_keeps_its_indices(tmp_path, monkeypatch, name):
    """λ comes before δ_p, and what was found is not sought again."""
    case, order = case_in(tmp_path, TEXT, [*GROWING, "moments.p=[2.0]"]), list[str]()

    def interrupting(*_):
        raise KeyboardInterrupt

    def noting(part):
        if part.name not in KNOWN:
            return part
        return replace(part, solve=lambda *arguments: order.append(part.name) or part.solve(*arguments))

    parts = tuple(map(noting, PARTS))
    changed = (replace(each, solve=interrupting) if each.name == name else each for each in parts)
    monkeypatch.setattr(solve, "PARTS", tuple(changed))
    with pytest.raises(KeyboardInterrupt):
        fpsolve.run(case, tmp_path / "out")
    before = order.copy()
    assert before[0] == "lyapunov_exponent"
    [row] = read_csv(tmp_path / "out/test/curves.csv")
    assert all(row[each] for each in before)
    assert not row[name]
    order.clear()
    monkeypatch.setattr(solve, "PARTS", parts)
    [result] = fpsolve.run(case, tmp_path / "out")
    assert order[0] == name
    assert not set(order) & set(before)
    assert all(result.estimates[each] for each in (*before, *order))


@pytest.mark.parametrize("failure", [ZeroDivisionError("x"), MemoryError(), FpsolveError("no")])
def test_a_quantity_that_fails_takes_no_other_with_it(tmp_path, monkeypatch, failure):
    def fails(*_, **__):
        raise failure

    case = case_in(tmp_path, TEXT, [*GROWING, "moments.p=[2.0]", 'output.quantities="all"'])
    for place in COSTLY:
        monkeypatch.setattr(place, fails)
    monkeypatch.setattr(ExponentSolver, "variance_rate", fails)
    monkeypatch.setattr(ExponentSolver, "by_class", fails)
    with pytest.raises(NotConverged) as caught:
        fpsolve.run(case, tmp_path / "out")
    [result] = caught.value.partial
    assert result.moments.p.tolist() == [2.0]
    found = {name for name, each in result.estimates.items() if each}
    assert found == {*result.estimates} - {"variance_rate"}
    assert result.status.name == "PARTLY"


def test_each_moment_is_in_the_table_as_soon_as_it_is_solved(tmp_path, monkeypatch):
    """With nothing waiting for a second."""
    monkeypatch.setattr("fpsolve.parts.part.SOON", 0.0)
    monkeypatch.setattr("fpsolve.workflow.sets.REST", 0)
    case, seen = case_in(tmp_path, TEXT, GROWING), list[int]()

    def progress():
        seen.append(len(table(tmp_path / "out/test")))

    fpsolve.run(case, tmp_path / "out", progress=progress)
    assert seen == [0, 1, 2, 3, 4, 5]
