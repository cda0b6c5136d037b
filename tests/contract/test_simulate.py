"""`fpsolve simulate` and `fpsolve run --monte-carlo`: numbers, files, and what is kept where they are interrupted."""

import math
import signal
import subprocess
import sys
import time
from contextlib import nullcontext

import numpy as np
import pytest
import pyvista

from fpsolve import load_case, lyapunov_exponent
from fpsolve.commands import run_case, simulate_case
from fpsolve.tell import Watch
from tests.conftest import started
from tests.kit import case_in, case_text, put, read_csv, read_json, run

SECTIONS = "[moments]\np = [-1.0, 1.0]\n[monte_carlo]\npaths = 6400\ntime = 40.0\nseed = 7\n"
CASE = case_text(SECTIONS, epsilon=0.5)
QUICK = "--paths", "64", "--time", "20"
TWO = '--set=vary."noise.D0"=[0.1, 0.2]'
NONLINEAR = [f"--set={each}" for each in ("oscillator.c2=0.5", "oscillator.c1=0.8", "noise.D0=0.1")]


def simulated(folder, *options, text=CASE, command="simulate"):
    """What was done, and the files of the results but for records, with what monte_carlo.json has."""
    done = run(folder, command, "case.toml", *options, case=text)
    assert done.code == 0, done.err
    place = folder / "results/case"
    return done, names(place), read_json(place / "monte_carlo.json")


def names(place):
    return {path.name for path in place.iterdir()} - {"records"}


def interrupted(share):
    """Interrupts a simulation after this share of its progress."""

    def bar(phase):
        steps = iter(range(phase.total or 0))

        def advance(count=1, **_):
            for _ in range(count):
                if next(steps) == int(share * phase.total):
                    raise KeyboardInterrupt

        return nullcontext(advance if phase.name == "simulation" else lambda *_, **__: None)

    return Watch(bar=bar)


def test_simulated_numbers_agree_with_finite_elements_and_are_told_beside_them(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)  # which loads slowly, and is for responses
    done, written, found = simulated(tmp_path)
    assert written == {"monte_carlo.json"}
    assert "6400 paths" in done.out
    assert (found["paths"], found["seed"], found["response"]) == (6400, 7, None)
    assert found["time"] == pytest.approx(40, rel=0.1)
    assert found["impacts"] == pytest.approx(6400 * found["time"] / math.pi, rel=0.1)
    exponent = found["lyapunov_exponent"]
    known = lyapunov_exponent(load_case(tmp_path / "case.toml").problem).value
    assert abs(exponent["value"] - known) < 4 * exponent["standard_error"] < 0.1
    assert [each["p"] for each in found["estimates"]] == [-1.0, 1.0]
    for each in found["estimates"]:
        assert each.keys() == {"p", "value", "standard_error", "estimator", "effective_paths"}


def test_a_run_with_a_simulation_has_both_numbers_in_one_table(tmp_path):
    done, written, found = simulated(tmp_path, "--monte-carlo", "--set=output.eigenfunctions=[]", command="run")
    assert {"summary.json", "monte_carlo.json", "figure.png"} <= written
    [parameter_set] = read_json(tmp_path / "results/case/summary.json")["sets"]
    for one, other in zip(parameter_set["moments"], found["estimates"], strict=True):
        assert other["value"] is None or abs(one["moment"] - other["value"]) < 5 * other["standard_error"]
    assert all(words in done.out for words in ("finite elements", "s.e. away"))


def test_options_of_a_simulation_replace_those_of_the_case(tmp_path):
    options = "--paths", "640", "--time", "50", "--seed", "3", "--estimator", "population"
    *_, found = simulated(tmp_path, *options)
    assert (found["paths"], found["seed"]) == (640, 3)
    assert found["time"] == pytest.approx(50, rel=0.1)
    assert {each["estimator"] for each in found["estimates"]} == {"population"}


@pytest.mark.slow
def test_each_set_has_its_file_and_those_of_an_earlier_simulation_go(tmp_path):
    _, written, found = simulated(tmp_path, *QUICK, TWO)
    assert written == {"monte_carlo.json", "monte_carlo-2.json"}
    assert found["varied"] == {"noise.D0": 0.1}
    assert simulated(tmp_path, *QUICK)[1] == {"monte_carlo.json"}


def test_a_simulation_that_ends_before_it_has_anything_leaves_nothing_of_an_earlier_one(tmp_path):
    place = tmp_path / "results/test"
    put(place, "run", "monte_carlo.json", "monte_carlo_response.png", "summary.json", "density.vtu")
    (place / "notes.txt").touch()
    with pytest.raises(KeyboardInterrupt, match="interrupted after 0 of 1 parameter set; run it again to go on"):
        simulate_case(case_in(tmp_path, CASE), tmp_path / "results", watch=interrupted(0))
    assert {path.name for path in place.iterdir()} == {"notes.txt", "records"}


@pytest.mark.parametrize(
    ("values", "share", "written", "place", "warning"),
    [
        ([0.1, 0.2], 0.501, {"monte_carlo.json"}, "parameter set 2 of 2", "Λ"),
        ([0.1, 0.2, 0.3], 0.6, {"monte_carlo.json", "monte_carlo-2.json"}, "parameter set 2 of 3", "stopped early"),
    ],
)
def test_an_interrupted_simulation_keeps_what_is_done_and_goes_on(tmp_path, values, share, written, place, warning):
    overrides = [f'vary."noise.D0"={values}', "monte_carlo.paths=640", "monte_carlo.estimator=direct"]
    case = case_in(tmp_path, CASE, overrides)
    found = simulate_case(case, tmp_path / "results", watch=interrupted(share))
    folder = tmp_path / "results/test"
    assert found.interruption == (
        f"interrupted in the simulation of {place}; what was done is kept in {folder}; run it again to go on"
    )
    assert names(folder) == written
    whole, *cut = (read_json(folder / name) for name in sorted(written, key=len))
    assert not any("stopped early" in each for each in whole["warnings"])
    for each in cut:
        assert any(warning in each for each in each["warnings"])
        assert each["time"] < 0.9 * whole["time"]
    again = simulate_case(case, tmp_path / "results")
    assert (again.known, again.interruption) == (1, "")
    simulate_case(case, tmp_path / "anew")
    for path in (tmp_path / "anew/test").glob("*.json"):
        assert path.read_bytes() == (folder / path.name).read_bytes()
    for options, known in (({}, len(values)), ({"is_fresh": True}, 0)):
        assert simulate_case(case, tmp_path / "results", **options).known == known
    assert simulate_case(load_case(case.path, [*overrides, "monte_carlo.seed=1"]), tmp_path / "results").known == 0


def test_an_interrupted_simulation_of_a_run_keeps_what_is_solved(tmp_path):
    case = case_in(tmp_path, CASE, ["output.quantities=['moment']", "output.figure=false"])
    with pytest.raises(KeyboardInterrupt, match=r"interrupted; what was solved is kept in .*; run it again to go on"):
        run_case(case, tmp_path / "results", monte_carlo=True, watch=interrupted(0))
    assert read_json(tmp_path / "results/test/summary.json")["sets"][0]["moments"]


def test_a_response_that_is_interrupted_is_said_to_be_missing(tmp_path):
    overrides = ["oscillator.c2=0.5", "oscillator.c1=0.8"]
    found = simulate_case(case_in(tmp_path, CASE, overrides), tmp_path / "results", watch=interrupted(0.34))
    assert "parameter set 1 of 1; what was done is kept" in found.interruption
    told = read_json(tmp_path / "results/test/monte_carlo.json")
    assert any("no stationary response: stopped before it was reached" in each for each in told["warnings"])


def test_there_is_no_response_where_the_rest_is_stable(tmp_path):
    done, _, found = simulated(tmp_path, *QUICK, "--set=oscillator.c2=0.5", "--set=oscillator.c1=-0.5")
    assert found["response"] is None
    assert any("no stationary response: λ = -" in each and "not positive" in each for each in found["warnings"])
    assert "no stationary response" in done.err


@pytest.mark.slow
@pytest.mark.usefixtures("pictures")
def test_simulated_response_in_all_files_has_the_means_that_are_told(tmp_path):
    _, written, found = simulated(tmp_path, *NONLINEAR, "--paths", "4096")
    endings = ".csv", ".vti", ".png", ".pdf"
    assert written == {"monte_carlo.json", *(f"monte_carlo_response{ending}" for ending in endings)}
    folder, means = tmp_path / "results/case", found["response"]["means"]
    assert means.keys() == {"x", "x_squared", "v_squared", "amplitude", "energy"}
    rows = read_csv(folder / "monte_carlo_response.csv")
    first, last, density, _ = np.array([[float(cell) for cell in row.values()] for row in rows]).T
    assert np.sum((last - first) * density) == pytest.approx(1, abs=1e-3)
    assert np.sum((last**2 - first**2) / 2 * density) == pytest.approx(means["amplitude"]["value"], rel=1e-2)
    grid = pyvista.read(folder / "monte_carlo_response.vti")
    shares = grid.cell_data["density"] * grid.spacing[0] * grid.spacing[1]
    assert shares.sum() == pytest.approx(1, abs=1e-3)
    assert np.sum(shares * grid.cell_centers().points[:, 0]) == pytest.approx(means["x"]["value"], rel=1e-2)
    assert (folder / "monte_carlo_response.png").stat().st_size > 10_000


@pytest.mark.slow
def test_a_signal_ends_a_long_simulation_soon_with_a_whole_file_or_none(tmp_path):
    assert simulated(tmp_path, "--paths", "64")[1]  # compiles, and leaves a record
    code = "import sys; from fpsolve.cli import main; sys.exit(main(sys.argv[1:]))"
    options = "--out", str(tmp_path / "results"), "--paths", "400000", "--time", "4000"
    with started(code, "simulate", str(tmp_path / "case.toml"), *options) as process:
        while process.poll() is None and (tmp_path / "results/case/monte_carlo.json").exists():
            time.sleep(0.1)  # the earlier one is removed when this one begins
        time.sleep(4)
        begun = time.monotonic()
        process.send_signal(signal.SIGINT)
        try:
            _, err = process.communicate(timeout=60)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
    assert (process.returncode, time.monotonic() - begun < 20) == (130, True)
    is_kept = "what was done is kept" in err
    assert is_kept or "interrupted after 0 of 1 parameter set" in err
    assert names(tmp_path / "results/case") == ({"monte_carlo.json"} if is_kept else set())
    assert not is_kept or read_json(tmp_path / "results/case/monte_carlo.json")["paths"] == 400_000
