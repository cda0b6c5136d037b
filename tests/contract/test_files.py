"""The files of a run as people read them: the same numbers in each, what is kept between runs, and what is removed."""

import json
import math
import os
import re
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista
import xarray

import fpsolve
from fpsolve import NotConverged, load_case, open_results
from fpsolve.exponent import SUMMARY_NUMBERS
from tests.conftest import sampled
from tests.kit import DRAWN, HOPELESS, LEAN, TABLES, TEXT, case_in, files, put, read_csv, read_json, run

NUMBERS = "output={ figure=false, quantities=['moment', 'lyapunov_exponent'] }"
WHOLE = DRAWN.replace("figure = true", "figure = false")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The results and the folder of two parameter sets with all that is one number, run once."""
    case = case_in(tmp_path_factory.mktemp("whole"), WHOLE)
    results = fpsolve.run(case, case.path.parent)
    return SimpleNamespace(results=results, folder=case.path.parent / "test", case=case)


def test_numbers_of_all_files_are_those_of_python(whole):
    folder, results = whole.folder, whole.results
    summary, moments, rows = (
        read(folder / name)
        for read, name in ((read_json, "summary.json"), (read_csv, "moments.csv"), (read_csv, "sets.csv"))
    )
    names = {"p": "p", "moment": "value", "moment_error": "error_estimate", "moment_derivative": "derivative"}
    names |= {
        "moment_derivative_error": "derivative_error",
        "moment_perturbation": "perturbation",
        "residual": "residual",
    }
    with xarray.open_dataset(folder / "results.nc") as found:
        found = found.load()
    apart = open_results(folder)
    for k, (result, parameter_set, row) in enumerate(zip(results, summary["sets"], rows, strict=True)):
        here = found.sel(dict(result.parameter_set.varied))
        for name, attribute in names.items():
            values = getattr(result.moments, attribute)
            assert values.size == 3
            np.testing.assert_array_equal([each[name] for each in parameter_set["moments"]], values)
            np.testing.assert_array_equal([float(each[name]) for each in moments[3 * k : 3 * k + 3]], values)
            np.testing.assert_array_equal(here[name], values)
            np.testing.assert_array_equal(apart[name][3 * k : 3 * k + 3], values)
        for name, estimate in result.estimates.items():
            for end, value in {"": estimate.value, "_error": estimate.error_estimate}.items():
                assert value == parameter_set[name + end] == float(row[name + end]) == float(here[name + end])
            assert (
                parameter_set[f"{name}_perturbation"]
                == float(here[f"{name}_perturbation"])
                == SUMMARY_NUMBERS[name].theory(result.parameter_set.problem)
            )
        assert parameter_set["critical_restitution"] == pytest.approx(
            parameter_set["critical_restitution_perturbation"], rel=5e-3
        )
        D0 = (0.1, 1.0)[k]
        assert (
            D0
            == parameter_set["varied"]["noise.D0"]
            == parameter_set["parameters"]["noise.D0"]
            == float(row["noise.D0"])
            == float(here["noise.D0"])
        )
        assert parameter_set["parameters"] == dict(result.parameter_set.parameters)
        assert (parameter_set["status"], row["status"], int(here.status)) == ("converged", "converged", 0)
        assert parameter_set["seconds"] == float(row["seconds"]) == float(here.seconds) > 0
        assert parameter_set["discretisation"] == result.discretisation
        assert parameter_set["warnings"] == []
        [file] = (folder / ("eigenfunctions-2" if k else "eigenfunctions")).glob("*.vtu")
        facts = pyvista.read(file).field_data
        assert (facts["Lambda"][0], facts["noise.D0"][0], facts["set"][0]) == (result.moment(2.0).value, D0, k + 1)
    known = summary["sets"][1]["moments"][0]
    assert known["moment_perturbation"] == pytest.approx(0.014149421727, rel=1e-10)
    assert summary["sets"][1]["lyapunov_exponent"] != summary["sets"][0]["lyapunov_exponent"]


def test_summary_and_results_say_what_they_are_of(whole):
    summary, case = read_json(whole.folder / "summary.json"), whole.case
    state = ["case", "title", "fpsolve_version", "units", "complete", "planned", "done"]
    assert list(summary) == [
        *state,
        "versions",
        "command",
        "host",
        "started",
        "wall_seconds",
        "overrides",
        "case_text",
        "sets",
    ]
    assert [summary[name] for name in state] == ["test", "A test", fpsolve.__version__, {"time": "time"}, True, 2, 2]
    assert summary["case_text"] == case.text == WHOLE
    with xarray.open_dataset(whole.folder / "results.nc") as found:
        assert all(each.attrs["long_name"] and each.attrs["units"] for each in found.data_vars.values())
        equations = {
            name: found[name].attrs["equation"] for name in ("moment", "moment_perturbation", "lyapunov_exponent")
        }
        assert equations == {"moment": "(1), (19)", "moment_perturbation": "(37)", "lyapunov_exponent": "(2)"}
        assert found.stability_index_perturbation.attrs["equation"] == "(38)"
        assert found["noise.D0"].attrs == {"long_name": "noise intensity", "symbol": "$D_0$", "units": "1/time"}
        assert (found.attrs["oscillator.c1"], found.attrs["complete"]) == (0.1, 1)
        assert "noise.D0" not in found.attrs
        assert found.attrs["case_text"] == case.text
        assert json.loads(found.attrs["versions"])["fpsolve"] == fpsolve.__version__
        assert found.status.attrs["flag_values"].tolist() == [0, 1, 2, 3, 4, 5]
    drawn = {
        "density.vtu",
        "sets.pvd",
        *(f"eigenfunctions{k}" + end for k in ("", "-2") for end in (".pvd", "/p+2.0.vtu")),
    }
    assert {name for name in files(whole.folder) if not name.startswith("records/")} == TABLES | drawn


def without_times(folder):
    """All numbers of the tables, without what tells one run from another of the same case."""
    summary, rows = read_json(folder / "summary.json"), read_csv(folder / "sets.csv")
    for each in (*summary["sets"], *rows):
        assert each.pop("seconds", None)
    data = xarray.load_dataset(folder / "results.nc").drop_vars("seconds")
    return (
        summary["sets"],
        rows,
        read_csv(folder / "moments.csv"),
        data.to_dict(encoding=False)["data_vars"].keys(),
        data.moment.values.tolist(),
    )


def interrupt(case, out, after, **options):
    """A run that is interrupted when it has done so much."""
    calls = []

    def progress():
        calls.append(1)
        if len(calls) == after:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt) as raised:
        fpsolve.run(case, out, progress=progress, **options)
    return str(raised.value)


def test_an_interrupted_run_keeps_what_it_has_and_goes_on_to_the_same_numbers(whole, tmp_path):
    folder, others = (
        tmp_path / "test",
        {"eigenfunctions.png", "figure.svg", "notes/summary.json", "monte_carlo_response-a.vti"},
    )
    mine = {"eigenfunctions-mine.pvd", "eigenfunctions/paper.vtu", ".fpsolve-notes", *others}
    earlier = {
        "monte_carlo.json",
        "monte_carlo-2.json",
        "monte_carlo_response.vti",
        "monte_carlo_response-2.png",
        "report.html",
    }
    put(folder, "simulate", *earlier)
    for name in mine:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("{}", encoding="utf-8")
    told = interrupt(whole.case, tmp_path, 1)
    assert told == f"interrupted after 1 of 2 parameter sets; what was done is kept in {folder}; run it again to go on"
    summary = read_json(folder / "summary.json")
    assert (summary["complete"], summary["planned"], summary["done"], len(summary["sets"])) == (False, 2, 1, 1)
    assert TABLES | mine | {"eigenfunctions.pvd"} <= files(folder)
    assert not earlier & files(folder)
    assert round(fpsolve.run(whole.case, tmp_path)[0].seconds, 6) == summary["sets"][0]["seconds"]
    assert without_times(folder) == without_times(whole.folder)
    assert {each for each in files(folder) - files(whole.folder) if not each.startswith("records/")} == mine
    for name in files(folder):
        if not name.startswith("records/"):
            (folder / name).unlink()
    fpsolve.run(whole.case, tmp_path)
    assert without_times(folder) == without_times(whole.folder)
    interrupt(whole.case, tmp_path, 1, fresh=True)
    assert read_json(folder / "summary.json")["done"] == 1
    assert "eigenfunctions-2.pvd" not in files(folder)


@pytest.mark.parametrize("at", sampled(2, 1, 3))
def test_an_interrupted_set_keeps_its_moments_and_goes_on(tmp_path, at):
    sets = ["vary={}", NUMBERS, "moments.p=[-1.0, 0.5, 1.0, 2.0]"]
    case = case_in(tmp_path, TEXT, sets)
    assert interrupt(case, tmp_path, at).startswith("interrupted after 0 of 1 parameter set; what was done is kept in")
    summary, rows = read_json(tmp_path / "test/summary.json"), read_csv(tmp_path / "test/moments.csv")
    assert (summary["complete"], summary["done"], summary["sets"][0]["status"]) == (False, 0, "partly")
    assert "not everything is solved yet; run the same command again to go on" in summary["sets"][0]["warnings"]
    assert 0 < len(rows) < 4
    [result], [whole] = fpsolve.run(case, tmp_path), fpsolve.run(case, tmp_path / "whole")
    assert result.status is whole.status
    assert np.all(
        np.abs(result.moments.value - whole.moments.value)
        <= result.moments.error_estimate + whole.moments.error_estimate
    )
    for row in rows:  # found before, and not once more
        assert float(row["moment"]) == result.moment(float(row["p"])).value
    interrupt(case_in(tmp_path, TEXT, [*sets[:2], "moments.p=[0.7, 1.4]"]), tmp_path, 1)
    assert {float(row["p"]) for row in read_csv(tmp_path / "test/moments.csv")} <= {0.7, 1.4}


@pytest.mark.parametrize("sets", [[NUMBERS], [NUMBERS, "vary={}"], ["vary={}"]])
def test_progress_counts_sets_or_the_p_of_one(tmp_path, sets):
    """Also of what is known, and where pictures are drawn again."""
    case = case_in(tmp_path, TEXT, sets)
    for _ in range(2):
        calls = []
        fpsolve.run(case, tmp_path, progress=lambda calls=calls: calls.append(1))
        assert len(calls) == (2 if case.planned == 2 else 3)


def test_discretisation_is_that_of_the_moments_asked_for(tmp_path):
    """Also after a run of other moments, and where Λ(p) is known already."""
    found = {}
    for p, folder in (("0.5", "one"), ("40.0", "one"), ("40.0", "other"), ("0.5", "one")):
        [result] = fpsolve.run(case_in(tmp_path, TEXT, ["vary={}", NUMBERS, f"moments.p=[{p}]"]), tmp_path / folder)
        found[p, folder] = result.discretisation
    assert found["40.0", "one"] == found["40.0", "other"]
    assert found["40.0", "one"]["unknowns"] > found["0.5", "one"]["unknowns"]


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    folder = tmp_path_factory.mktemp("kept")
    assert run(folder, "run", "case.toml", "--set", NUMBERS, "--jobs", "1", case=TEXT).code == 0
    return folder


@pytest.mark.parametrize(
    ("sets", "known"),
    [
        ([], 2),
        (["title='another'"], 2),
        (["budget.unknowns=90000"], 2),
        (["output={ figure=false, quantities=['moment'] }"], 2),
        (["vary.noise.D0=[1.0, 0.1]"], 2),
        (["vary.noise.D0=[0.1, 2.0]"], 1),
        (["vary.noise.D0=[0.1, 0.2, 1.0]"], 2),
        (["oscillator.c1=0.2"], 0),
        (["noise.treatment=exact"], 0),
        (["moments.rtol=1e-7"], 0),
        (["moments.p=[2.0, 0.0, -1.0, 1.0]"], 0),
        (["mesh={ phi_cells=2, xi_cells=4, phi_degree=8, xi_degree=8 }"], 0),
        (["output={ figure=false, quantities=['moment', 'lyapunov_exponent', 'variance_rate'] }"], 0),
        (["--fresh"], 0),
    ],
)
def test_a_second_run_solves_what_has_changed_alone(kept, tmp_path, sets, known):
    """What is known has the numbers, and the seconds, of the first run."""
    shutil.copytree(kept, tmp_path, dirs_exist_ok=True)
    before = {row["noise.D0"]: row for row in read_csv(tmp_path / "results/case/sets.csv")}
    options = [each if each.startswith("--") else f"--set={each}" for each in sets]
    done = run(tmp_path, "run", "case.toml", "--quiet", "--jobs", "1", "--set", NUMBERS, *options)
    count = len(rows := read_csv(tmp_path / "results/case/sets.csv"))
    end = f"; {known} of {count} known from an earlier run" * bool(known)
    assert re.search(rf"written: results/case \({count} parameter sets, [^;]*{end}\)$", done.out.strip()), done
    same = [row["seconds"] == before[row["noise.D0"]]["seconds"] for row in rows if row["noise.D0"] in before]
    assert sum(same) == known or "quantities" in " ".join(sets)
    for row in rows:
        for name in {"lyapunov_exponent", "lyapunov_exponent_error"} & row.keys():
            if known and row["noise.D0"] in before:
                assert row[name] == before[row["noise.D0"]][name]


def flipped(line, at):
    return line[:at] + bytes([line[at] ^ 1]) + line[at + 1 :]


@pytest.mark.parametrize(
    "damage",
    [
        lambda line: line[: len(line) // 2],
        lambda line: b"\0" * len(line),
        *(lambda line, share=share: flipped(line, int(share * len(line))) for share in (0.5, 0.7, 0.9)),
        lambda line: line.replace(b'"record"', b'"other"'),
    ],
)
def test_a_damaged_record_is_solved_again(kept, tmp_path, damage):
    shutil.copytree(kept, tmp_path, dirs_exist_ok=True)
    [path] = (tmp_path / "results/case/records").glob("*.jsonl")
    before = read_csv(tmp_path / "results/case/moments.csv")
    first, second = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(first + damage(second))
    done = run(tmp_path, "run", "case.toml", "--quiet", "--jobs", "1", "--set", NUMBERS)
    assert "1 of 2 known from an earlier run" in done.out
    assert read_csv(tmp_path / "results/case/moments.csv") == before
    assert "2 of 2 known" in run(tmp_path, "run", "case.toml", "--quiet", "--set", NUMBERS).out


def test_a_budget_that_limits_a_number_is_part_of_what_is_known(tmp_path):
    """A larger one is tried, and then kept for the small one."""
    hard = ["vary={}", NUMBERS, "oscillator.epsilon=2.0", "moments.p=[2.0]", "moments.rtol=1e-4"]
    for unknowns, known in ((100, False), (100, True), (120, False), (90000, False), (100, True)):
        sets = [*hard, f"budget.unknowns={unknowns}"]
        done = run(tmp_path, "run", "case.toml", "--quiet", *(f"--set={each}" for each in sets), case=TEXT)
        assert ("1 of 1 known" in done.out) == known
    assert done.code == 0


def test_another_run_and_a_simulation_of_the_same_parameters_stay_together(tmp_path):
    """Each keeps what the other wrote, unless that is of parameters that the case does not have."""
    few = ["--set", NUMBERS, "--set", "vary={}", "--set", "monte_carlo={ paths=64, time=40.0 }", "--quiet"]
    other = [*few, "--set", "oscillator.omega=2.0"]
    folder = tmp_path / "results/case"
    for command, options, there in (
        ("run", few, {"summary.json"}),
        ("simulate", few, {"summary.json", "monte_carlo.json"}),
        ("run", few, {"summary.json", "monte_carlo.json"}),
        ("run", other, {"summary.json"}),
        ("simulate", few, {"monte_carlo.json"}),
    ):
        assert run(tmp_path, command, "case.toml", *options, case=TEXT).code == 0
        assert {"summary.json", "monte_carlo.json"} & files(folder) == there


def test_pictures_of_an_earlier_run_go(whole, tmp_path):
    shutil.copytree(whole.folder, tmp_path / "test")
    fpsolve.run(load_case(whole.case.path, ["vary={}", "output.eigenfunctions=[-1.0]"]), tmp_path)
    names = {name for name in files(tmp_path / "test") if name.endswith(("vtu", "pvd"))}
    assert names == {"eigenfunctions.pvd", "eigenfunctions/p-1.0.vtu", "density.vtu"}


def test_of_many_sets_an_eigenfunction_of_the_first_is_drawn_unasked(tmp_path):
    text = TEXT.replace("eigenfunctions = [2.0]", "")
    fpsolve.run(
        case_in(tmp_path, text, ["vary.noise.D0={start=0.1, stop=1.0, num=11}", "moments.p=[-1.0, 1.5]"]), tmp_path
    )
    assert {name for name in files(tmp_path / "test") if "vt" in name or "pv" in name} == {
        "eigenfunctions/p+1.5.vtu",
        "eigenfunctions.pvd",
    }


def test_what_fails_is_missing_in_every_file_and_said(tmp_path):
    """The strong-noise parameter set fails at p = 2 and −1; the weak one and p = 0 are kept."""
    text = TEXT.replace('"noise.D0" = [0.1, 1.0]', '"oscillator.epsilon" = [0.01, 1.5]').replace("[2.0]\n", "[]\n")
    with pytest.raises(NotConverged, match="use more cells") as caught:
        fpsolve.run(case_in(tmp_path, text, [HOPELESS]), tmp_path)
    good, bad = caught.value.partial
    assert [sorted(each.p for each in result.failures if each.p is not None) for result in (good, bad)] == [
        [],
        [-1.0, 2.0],
    ]
    folder = tmp_path / "test"
    first, second = read_json(folder / "summary.json")["sets"]
    assert [[row["p"] for row in each["moments"]] for each in (first, second)] == [[2.0, 0.0, -1.0], [0.0]]
    assert (second["status"], second["lyapunov_exponent"], second["p_failed"]) == ("partly", None, 2)
    assert any("[mesh]" in each for each in second["warnings"])
    assert [row["p"] for row in read_csv(folder / "moments.csv")] == ["2.0", "0.0", "-1.0", "0.0"]
    with xarray.open_dataset(folder / "results.nc") as found:
        assert found.status.values[1] == found.status.attrs["flag_meanings"].split().index("partly") == 1
        assert np.isnan(found.moment.values).tolist() == [[False] * 3, [True, False, True]]
        assert math.isnan(found.lyapunov_exponent[1])


@pytest.mark.parametrize(
    ("sets", "status", "warning", "missing"),
    [
        (
            [
                "oscillator.omega=10.0",
                "oscillator.c1=-1.0",
                "oscillator.restitution=0.5",
                "noise.D0=0.1",
                "output={quantities=['stability_index', 'lyapunov_exponent']}",
            ],
            "no stability index",
            "fpsolve found no stability index: Λ(p) has no root p ≠ 0 in [-20, 20]",
            "stability_index",
        ),
        (
            ["oscillator.epsilon=2.0", "budget.unknowns=100", "output={quantities=['lyapunov_exponent']}"],
            "failed",
            "fpsolve found no λ: ",
            "lyapunov_exponent",
        ),
        (
            [
                "oscillator.epsilon=2.0",
                "budget.unknowns=100",
                "moments.p=[0.0]",
                "output={quantities=['moment','lyapunov_exponent'],eigenfunctions=[]}",
            ],
            "partly",
            "fpsolve found no λ: ",
            "lyapunov_exponent",
        ),
        (
            [
                "oscillator.epsilon=2.0",
                "budget.unknowns=100",
                "moments.p=[0.001]",
                "output={quantities=['moment','lyapunov_exponent','stability_index','variance_rate'],eigenfunctions=[]}",
            ],
            "failed",
            "fpsolve found no λ, δ_p, Λ″(0): ",
            "variance_rate",
        ),
        (
            [
                "oscillator.epsilon=2.0",
                "noise.tau0=20.0",
                "noise.D0=4.0",
                "moments.p=[0.0]",
                "output.eigenfunctions=[0.0]",
                "mesh={phi_cells=1, xi_cells=2, phi_degree=8, xi_degree=8}",
            ],
            "partly",
            "fpsolve draws neither the stationary density nor eigenfunctions (λ",
            None,
        ),
    ],
)
def test_a_number_that_is_not_there_is_null_with_a_status_and_a_warning(tmp_path, sets, status, warning, missing):
    done = run(tmp_path, "run", "case.toml", "--set", "vary={}", *(f"--set={each}" for each in sets), case=TEXT)
    [parameter_set] = read_json(tmp_path / "results/case/summary.json")["sets"]
    assert (done.code, parameter_set["status"]) == (0 if status == "no stability index" else 3, status)
    assert ("none found" in done.out) == (status == "no stability index")
    assert sum(text.startswith(warning) for text in parameter_set["warnings"]) == 1
    [row] = read_csv(tmp_path / "results/case/sets.csv")
    assert row["status"] == status
    if missing:
        assert parameter_set[missing] is None
        assert row[missing] == ""
    else:
        assert not list(tmp_path.rglob("*.vtu"))


def test_what_is_not_asked_for_is_in_no_file(tmp_path):
    sets = [
        "output={ quantities=['lyapunov_exponent', 'stability_index'] }",
        "vary={ mode='zip', noise.D0=[0.1, 0.1, 0.2], oscillator.omega=[1.0, 2.0, 2.0] }",
    ]
    results = fpsolve.run(case_in(tmp_path, TEXT, sets), tmp_path)
    names = {"lyapunov_exponent", "stability_index"}
    with xarray.open_dataset(tmp_path / "test/results.nc") as found:
        wanted = {f"{name}{end}" for name in names for end in ("", "_error", "_perturbation")}
        assert set(found.data_vars) == wanted | {"p_solved", "p_failed", "status", "seconds", "messages"}
        assert dict(found.sizes) == {"set": 3}  # side by side
        assert found["oscillator.omega"].values.tolist() == [1.0, 2.0, 2.0]
        assert json.loads(found.attrs["overrides"]) == sets
        np.testing.assert_array_equal(found.lyapunov_exponent, [each.lyapunov_exponent.value for each in results])
    [parameter_set, *_] = read_json(tmp_path / "test/summary.json")["sets"]
    assert not {"moments", "variance_rate", "sensitivities"} & set(parameter_set)
    header = list(read_csv(tmp_path / "test/sets.csv")[0])
    assert header[2:5] == ["lyapunov_exponent", "lyapunov_exponent_error", "lyapunov_exponent_perturbation"]


@pytest.mark.slow
def test_zero_has_no_sign_in_any_file(tmp_path):
    sets = [
        "moments.p=[-0.0, 2.0, -1.0]",
        "oscillator.c1=-0.0",
        "oscillator.restitution=1.0",
        "output.eigenfunctions=[-0.0]",
        "monte_carlo={ paths=64, time=40.0 }",
    ]
    assert run(tmp_path, "run", "case.toml", "--monte-carlo", *(f"--set={each}" for each in sets), case=TEXT).code in (
        0,
        3,
    )
    for name in ("summary.json", "moments.csv", "sets.csv", "monte_carlo.json", "eigenfunctions.pvd"):
        text = (tmp_path / "results/case" / name).read_text(encoding="utf-8")
        text = json.dumps(json.loads(text)["sets"]) if name == "summary.json" else text  # what was typed is kept
        assert "-0.0" not in re.findall(r"-?[\d.e+-]+", text), name


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Runs over different keys, one of them without moments."""
    folder = tmp_path_factory.mktemp("runs")
    for name, *sets in (
        ("alone", "vary={}", "output={quantities=['moment']}"),
        ("noises", "vary={ noise.treatment=['exact', 'ou-reduction'] }", LEAN),
        ("product", "vary={ noise.D0=[1.0, 0.1], noise.treatment=['exact', 'ou-reduction'] }", NUMBERS),
        (
            "sets",
            "vary={ mode='zip', oscillator.omega=[1.0, 2.0, 2.0], noise.D0=[0.1, 0.1, 0.2] }",
            NUMBERS,
            "moments.p=[2.0, 4.0]",
        ),
    ):
        fpsolve.run(case_in(folder, TEXT, [*sets, "moments.rtol=1e-4"], name), folder / "out")
    return folder / "out"


def test_many_runs_are_one_dataset(runs):
    found = open_results(runs / "*")
    assert dict(found.sizes) == {"row": 3 + 2 + 4 * 3 + 3 * 2}
    assert found["run"].values.tolist() == [*["alone"] * 3, *["noises"] * 2, *["product"] * 12, *["sets"] * 6]
    first = found.to_dataframe().groupby("set").first()
    assert first["oscillator.omega"].tolist() == [1.0] * 8 + [2.0] * 2
    assert first["noise.treatment"].tolist() == ["ou-reduction", *["exact", "ou-reduction"] * 3, *["ou-reduction"] * 3]
    assert np.isnan(first.lyapunov_exponent).tolist() == [True, *[False] * 9]
    for p, number in {2.0: 8, 4.0: 3, 0.0: 5}.items():
        assert dict(found.sel(p=p).sizes) == {"set": number}
        assert np.isfinite(found.sel(p=p).moment).all()
    for name in ("alone", "product", "sets"):
        with xarray.open_dataset(runs / name / "results.nc") as file:
            own = found.isel(row=found.run == name)
            np.testing.assert_array_equal(own.moment, file.moment.values.ravel())
            assert own.moment.attrs == file.moment.attrs
    with xarray.open_dataset(runs / "product/results.nc") as file:
        assert dict(file.sizes) == {"noise.D0": 2, "noise.treatment": 2, "p": 3}
        reduced = file.sel({"noise.treatment": "ou-reduction"})
        exact = file.sel({"noise.treatment": "exact"})
        np.testing.assert_array_equal(
            reduced.moment_perturbation, exact.moment_perturbation
        )  # the theory is of the reduced one
        assert abs(float(reduced.moment[0, 0] / exact.moment[0, 0]) - 1) > 1e-3
    assert np.isnan(open_results(runs / "noises").p).all()


@pytest.mark.slow
def test_runs_of_other_noises_are_one_dataset(runs, tmp_path):
    noise = (
        TEXT.partition("[noise]")[0]
        + '[noise]\nkind = "sine-wiener"\namplitude = 1.0\nsigma = 1.0\n[moments]\np = [2.0]\n'
    )
    fpsolve.run(case_in(tmp_path, noise, [LEAN], "sine"), tmp_path)
    found = open_results(runs / "alone", tmp_path / "sine")
    assert np.isnan(found["noise.sigma"]).values.tolist() == [True] * 3 + [False]
    assert found["noise.treatment"].values.tolist() == ["ou-reduction"] * 3 + [""]


@pytest.mark.parametrize("places", [("nowhere",), ("out/*.toml", "none*"), ()])
def test_where_there_are_no_results_it_is_said(tmp_path, monkeypatch, places):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(fpsolve.FpsolveError, match=r"no results.nc in .*(nowhere|none\*|nothing); run a case first"):
        open_results(*places)


def test_the_unit_of_time_labels_files_and_tables_and_changes_no_number(tmp_path):
    found = {}
    for unit, line in {"time": "", "s": '[units]\ntime = "s"\n'}.items():
        done = run(tmp_path, "run", "case.toml", "--table", "--set", NUMBERS, "--out", unit, case=TEXT + line)
        data = open_results(tmp_path / unit / "case")
        assert data.moment.units == f"1/{unit}"
        assert ("Λ(p) in 1/s" in done.out) is (unit == "s")
        assert read_json(tmp_path / unit / "case/summary.json")["units"] == {"time": unit}
        found[unit] = data.moment.values.tolist()
    assert found["s"] == found["time"]


@pytest.mark.skipif(os.name == "nt", reason="permissions of POSIX")
@pytest.mark.parametrize(("mask", "mode"), sampled((0o077, 0o600), (0o022, 0o644), (0o002, 0o664)))
def test_the_umask_says_who_may_read_a_file(tmp_path, mask, mode):
    former = os.umask(mask)
    try:
        fpsolve.run(case_in(tmp_path, TEXT, [LEAN, "vary={}"]), tmp_path)
    finally:
        os.umask(former)
    assert {(tmp_path / "test" / name).stat().st_mode & 0o777 for name in files(tmp_path / "test")} == {mode}
