"""`fpsolve simulate` and `fpsolve run --monte-carlo`: files, exit codes, interrupts, bad input."""

import signal
import subprocess
import sys
import time
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np
import pytest
import pyvista

from fpsolve.cli import main
from fpsolve.errors import NotConverged
from fpsolve.files import LOCK
from fpsolve.output import figures
from fpsolve.simulation import response
from fpsolve.workflow import simulate as simulated
from tests.conftest import heed_signals
from tests.kit import case_text, read_csv, read_json
from tests.oracles import closed_forms

SECTIONS = "[moments]\np = [-1.0, 1.0]\n[monte_carlo]\npaths = 6400\ntime = 40.0\nseed = 7\n"
CASE = case_text(SECTIONS, epsilon=0.5)
QUICK = ["--paths", "64", "--time", "20"]
TWO = ["--set", 'vary."noise.D0"=[0.1, 0.2]']
LONG = [*TWO, "--set=monte_carlo.time=100.0"]


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "quick.toml"
    path.write_text(CASE, encoding="utf-8")
    return path


@pytest.fixture
def out(tmp_path):
    return tmp_path / "results"


def simulate(*arguments):
    return main(["simulate", *map(str, arguments)])


@pytest.fixture
def fails(monkeypatch):
    """Makes the simulation of a curve raise something."""
    original = simulated.simulate_curve

    def at(number, failure=KeyboardInterrupt):
        def failing(curve, *others):
            if curve.number == number:
                raise failure
            return original(curve, *others)

        monkeypatch.setattr(simulated, "simulate_curve", failing)

    return at


@pytest.fixture
def drawn(monkeypatch):
    """The series of the figures, which are not drawn."""
    found = []
    monkeypatch.setattr(figures, "draw_series", lambda axes, case, series, *_: found.append(series))
    return found


def names(folder):
    """Of all in a folder of results but the records."""
    return {path.name for path in folder.iterdir()} - {"records"}


def records(out):
    """How many simulations are kept."""
    return sum(len(path.read_bytes().splitlines()) for path in out.glob("quick/records/simulated/*.jsonl"))


def read(path):
    return read_json(Path(path))


def test_monte_carlo_json(case, out, capsys):
    assert simulate(case, "--out", out) == 0
    found = read(out / "quick/monte_carlo.json")
    assert [estimate["p"] for estimate in found["estimates"]] == [-1.0, 1.0]
    for estimate in found["estimates"]:
        assert estimate.keys() == {"p", "value", "standard_error", "estimator", "effective_paths"}
        assert estimate["estimator"] == "direct"
    assert found["lyapunov_exponent"].keys() == {"value", "standard_error"}
    assert (found["paths"], found["seed"]) == (6400, 7)
    assert found["time"] == pytest.approx(40, rel=0.1)
    assert found["step"] > 0
    assert found["impacts"] == pytest.approx(6400 * found["time"] / np.pi, rel=0.1)
    assert found["warnings"] == [text for text in found["warnings"] if "no estimate" in text]
    assert found["response"] is None
    printed = capsys.readouterr()
    assert "6400 paths" in printed.out
    assert "λ =" in printed.out
    assert names(out / "quick") == {"monte_carlo.json"}
    assert records(out) == 1


def test_vtk_is_not_loaded_where_there_is_no_response(case, out, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyvista", None)
    assert simulate(case, "--out", out, *QUICK) == 0
    assert names(out / "quick") == {"monte_carlo.json"}


def test_options_replace_those_of_the_case(case, out):
    options = ["--paths", "640", "--time", "50", "--seed", "3", "--estimator", "population"]
    assert simulate(case, "--out", out, *options) == 0
    found = read(out / "quick/monte_carlo.json")
    assert (found["paths"], found["seed"]) == (640, 3)
    assert found["time"] == pytest.approx(50, rel=0.1)
    assert {estimate["estimator"] for estimate in found["estimates"]} == {"population"}


def test_a_seed_gives_the_same_bytes(case, out):
    for folder, seed in (("a", 5), ("b", 5), ("c", 6)):
        assert simulate(case, "--out", out / folder, "--seed", seed) == 0
    contents = [(out / folder / "quick/monte_carlo.json").read_bytes() for folder in "abc"]
    assert contents[0] == contents[1] != contents[2]


@pytest.mark.slow
def test_each_curve_has_its_file_and_stale_ones_go(case, out):
    assert simulate(case, "--out", out, *QUICK, *TWO) == 0
    assert [read(out / f"quick/{name}")["varied"] for name in ("monte_carlo.json", "monte_carlo-2.json")] == [
        {"noise.D0": 0.1}, {"noise.D0": 0.2},
    ]  # fmt: skip
    assert simulate(case, "--out", out, *QUICK) == 0
    assert names(out / "quick") == {"monte_carlo.json"}


def test_a_simulation_that_ends_early_leaves_nothing_of_an_earlier_one(case, out, capsys, fails):
    """Nor of a run, whose figure may have its dots."""
    (out / "quick").mkdir(parents=True)
    earlier = {
        "monte_carlo.json",
        "monte_carlo-2.json",
        "monte_carlo_response.png",
        "summary.json",
        "figure.png",
        "density.vtu",
    }
    for name in (*earlier, "notes.txt"):
        (out / "quick" / name).write_text("{}", encoding="utf-8")
    fails(1)
    assert simulate(case, "--out", out) == 130
    assert {path.name for path in (out / "quick").iterdir()} == {"notes.txt"}
    assert capsys.readouterr().err.strip() == "interrupted after 0 of 1 curve; run it again to go on"


@pytest.mark.slow
def test_the_nonlinear_response_is_written(case, out):
    nonlinear = [
        f"--set={setting}"
        for setting in ("oscillator.c2=0.5", "oscillator.c1=0.8", "noise.D0=0.1", "monte_carlo.paths=4096")
    ]
    assert simulate(case, "--out", out, *nonlinear) == 0
    folder = out / "quick"
    written = {
        "monte_carlo.json",
        "monte_carlo_response.csv",
        "monte_carlo_response.vti",
        "monte_carlo_response.png",
        "monte_carlo_response.pdf",
    }
    assert names(folder) == written
    response = read(folder / "monte_carlo.json")["response"]
    assert response["means"].keys() == {"x", "x_squared", "v_squared", "amplitude", "energy"}
    rows = np.array([[float(cell) for cell in row.values()] for row in read_csv(folder / "monte_carlo_response.csv")])
    width, density = rows[:, 1] - rows[:, 0], rows[:, 2]
    assert np.sum(width * density) == pytest.approx(1, abs=1e-3)
    middle = (rows[:, 0] + rows[:, 1]) / 2
    assert np.sum(width * density * middle) == pytest.approx(response["means"]["amplitude"]["value"], rel=1e-2)
    grid = pyvista.read(folder / "monte_carlo_response.vti")
    spacing = grid.spacing
    assert np.sum(grid.cell_data["density"]) * spacing[0] * spacing[1] == pytest.approx(1, abs=1e-3)
    x = grid.cell_centers().points[:, 0]
    mean = np.sum(grid.cell_data["density"] * x) * spacing[0] * spacing[1]
    assert mean == pytest.approx(response["means"]["x"]["value"], rel=1e-2)


def test_no_response_where_the_rest_is_stable(case, out, capsys):
    stable = [f"--set={setting}" for setting in ("oscillator.c2=0.5", "oscillator.c1=-0.5")]
    assert simulate(case, "--out", out, *QUICK, *stable) == 0
    found = read(out / "quick/monte_carlo.json")
    assert found["response"] is None
    assert any("no stationary response: λ = -" in text and "not positive" in text for text in found["warnings"])
    assert "no stationary response" in capsys.readouterr().err


def test_run_adds_markers(case, out, capsys, drawn):
    assert main(["run", str(case), "--out", str(out), "--monte-carlo"]) == 0
    assert (out / "quick/summary.json").exists()
    found = read(out / "quick/monte_carlo.json")["estimates"]
    with_value = [estimate for estimate in found if estimate["value"] is not None]
    ((series,),) = drawn
    samples = series.simulated
    np.testing.assert_array_equal(samples[1], [estimate["value"] for estimate in with_value])
    np.testing.assert_array_equal(samples[2], [estimate["standard_error"] for estimate in with_value])
    assert "finite elements" in capsys.readouterr().out


@pytest.mark.slow
def test_run_adds_markers_over_a_parameter(pictures, case, out):
    arguments = [*TWO, "--set", 'figure={x="noise.D0", y="lyapunov_exponent"}']
    assert main(["run", str(case), "--out", str(out), "--monte-carlo", *arguments]) == 0
    assert (out / "quick/figure.png").stat().st_size > 10_000
    assert (out / "quick/monte_carlo-2.json").exists()


def test_an_interrupt_before_anything_is_simulated_keeps_what_is_solved(case, out, capsys, fails, drawn):
    fails(1)
    assert main(["run", str(case), "--out", str(out), "--monte-carlo"]) == 130
    ((series,),) = drawn
    assert series.simulated is None
    assert (out / "quick/summary.json").exists()
    printed = capsys.readouterr()
    assert "δ_p" in printed.out
    message = f"interrupted; what was solved is kept in {out / 'quick'}; run it again to go on"
    assert printed.err.strip() == message


def test_a_simulation_that_fails_keeps_the_curves_before_it(case, out, capsys, fails, drawn):
    fails(2, NotConverged("the simulation overflowed"))
    assert main(["run", str(case), "--out", str(out), "--monte-carlo", *LONG]) == 3
    (series,) = drawn
    assert [item.simulated is not None for item in series] == [True, False]
    assert (out / "quick/monte_carlo.json").exists()
    assert "the simulation overflowed" in capsys.readouterr().err


def kept(out, curve, planned):
    """The message of a simulation that was interrupted when something was done."""
    place = f"in the simulation of curve {curve} of {planned}"
    return f"interrupted {place}; what was done is kept in {out / 'quick'}; run it again to go on"


@pytest.mark.slow
def test_an_interrupted_simulation_of_a_run_says_how_to_go_on(case, out, capsys, fails):
    fails(2)
    assert main(["run", str(case), "--out", str(out), "--monte-carlo", *LONG]) == 130
    assert capsys.readouterr().err.strip() == kept(out, 2, 2)
    assert {"summary.json", "monte_carlo.json", "figure.png"} <= {path.name for path in (out / "quick").iterdir()}


def test_an_interrupt_before_the_response_ends_the_simulation(case, out, capsys, monkeypatch):
    monkeypatch.setattr(response, "simulated_response", MagicMock(side_effect=KeyboardInterrupt))
    assert simulate(case, "--out", out, "--set=oscillator.c2=0.5", "--set=oscillator.c1=0.8", *TWO) == 130
    assert names(out / "quick") == {"monte_carlo.json"}
    found = read(out / "quick/monte_carlo.json")
    assert "no stationary response: stopped before it was reached" in found["warnings"]
    assert kept(out, 1, 2) in capsys.readouterr().err


def test_ctrl_c_before_a_curve_has_anything(case, out, capsys, fails):
    """What is finished stays, and the message says so."""
    fails(2)
    assert simulate(case, "--out", out, *QUICK, *TWO) == 130
    assert names(out / "quick") == {"monte_carlo.json"}
    printed = capsys.readouterr()
    assert kept(out, 2, 2) in printed.err
    assert "64 paths" in printed.out


@pytest.mark.slow
def test_simulations_that_are_finished_are_not_made_again(case, out, monkeypatch):
    """Nor where they were interrupted later; what is written then is what an undisturbed simulation writes."""
    original, made, fails = simulated.simulate_curve, [], [0.2]

    def counted(curve, *others):
        made.append(curve.varied["noise.D0"])
        if made[-1] in fails:
            raise KeyboardInterrupt
        return original(curve, *others)

    monkeypatch.setattr(simulated, "simulate_curve", counted)
    command = [case, *QUICK, *TWO, "--out"]
    assert simulate(*command, out) == 130
    fails.clear()
    assert simulate(*command, out) == 0
    assert made == [0.1, 0.2, 0.2]
    assert simulate(*command, out, "--seed", "1") == 0
    assert made[3:] == [0.1, 0.2]
    assert simulate(*command, out) == 0
    assert len(made) == 5
    assert simulate(*command, out.parent / "anew") == 0
    assert simulate(*command, out, "--fresh") == 0
    assert made[5:] == [0.1, 0.2] * 2
    for name in ("monte_carlo.json", "monte_carlo-2.json"):
        assert (out / "quick" / name).read_bytes() == (out.parent / "anew/quick" / name).read_bytes()


def wait_for(path):
    """Until a process has begun to write."""
    end = time.monotonic() + 60
    while not path.exists():
        assert time.monotonic() < end
        time.sleep(0.05)


@pytest.mark.slow
def test_a_real_interrupt(case, out):
    """SIGINT in the middle of a long slice ends the process soon, with the exit code 130 and no file or a whole one."""
    command = [sys.executable, "-m", "fpsolve.cli", "simulate", str(case), "--out", str(out), "--paths", "64"]
    subprocess.run(command, check=True, capture_output=True)  # compiles
    command[-1] = "400000"
    with subprocess.Popen(
        [*command, "--time", "4000"],
        stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, preexec_fn=heed_signals,
    ) as process:  # fmt: skip
        try:
            wait_for(out / "quick" / LOCK)
            time.sleep(4)
            begun = time.monotonic()
            process.send_signal(signal.SIGINT)
            _, err = process.communicate(timeout=60)
        finally:
            process.kill()
        assert process.returncode == 130
        assert time.monotonic() - begun < 20
    is_kept = "what was done is kept" in err
    assert is_kept or "interrupted after 0 of 1 curve" in err
    assert names(out / "quick") == ({"monte_carlo.json"} if is_kept else set())
    assert records(out) == 1  # the first one
    assert not is_kept or read(out / "quick/monte_carlo.json")["paths"] == 400_000


def test_ctrl_c_keeps_what_is_done(case, out, capsys, monkeypatch):
    """An interrupt in the second of three curves: the first is whole, the second is marked, the third is not begun."""
    original, calls = simulated.simulate_curve, []

    def interrupted_later(curve, orders, setting, progress):
        def counted():
            calls.append(1)
            if len(calls) == 150:
                raise KeyboardInterrupt
            progress()

        return original(curve, orders, setting, counted)

    monkeypatch.setattr(simulated, "simulate_curve", interrupted_later)
    vary = ["--set", 'vary."noise.D0"=[0.1, 0.2, 0.3]', "--time", "200", "--estimator", "direct"]
    (out / "quick").mkdir(parents=True)
    (out / "quick/monte_carlo-3.json").write_text("{}", encoding="utf-8")
    assert simulate(case, "--out", out, *vary) == 130
    first, second = (read(out / f"quick/{name}") for name in ("monte_carlo.json", "monte_carlo-2.json"))
    assert not any("stopped early" in text for text in first["warnings"])
    assert any("stopped early" in text for text in second["warnings"])
    assert second["time"] < 0.7 * first["time"]
    assert names(out / "quick") == {"monte_carlo.json", "monte_carlo-2.json"}  # an earlier third one is gone
    assert records(out) == 1
    assert kept(out, 2, 3) in capsys.readouterr().err


def test_paths_that_are_no_whole_number(case, out, capsys):
    assert simulate(case, "--out", out, "--paths", "2.5") == 2
    assert "--paths" in capsys.readouterr().err
    assert not out.exists()


def test_run_with_simulation_refuses_before_it_solves(case, out):
    assert main(["run", str(case), "--out", str(out), "--monte-carlo", "--set", "noise.tau0=1e-8"]) == 2
    assert not out.exists()


def test_a_number_of_processors_that_is_none_is_refused(case, out, capsys, monkeypatch):
    monkeypatch.setenv("FPSOLVE_PROCESSORS", "many")
    assert simulate(case, "--out", out) == 2
    expected = (
        'FPSOLVE_PROCESSORS, in the environment: got "many"; must be a whole number >= 1; set it to one, or unset it'
    )
    assert capsys.readouterr().err.strip() == expected
    assert not out.exists()


def test_a_folder_that_cannot_be_made(case, tmp_path, capsys):
    blocker = tmp_path / "file"
    blocker.write_text("", encoding="utf-8")
    assert simulate(case, "--out", blocker) == 2
    assert "choose another --out" in capsys.readouterr().err


@pytest.mark.parametrize("noise", ['kind = "white"\ns = 0.5'])
def test_any_system_is_simulated(tmp_path, out, noise):
    """λ by `tests.oracles`; white noise has that of Airy functions."""
    system = '[system]\nkind = "parametric"\nstiffness = 1.0\ndamping = 0.05\n'
    (tmp_path / "quick.toml").write_text(f'title = "Mathieu"\n{system}[noise]\n{noise}\n{SECTIONS}', encoding="utf-8")
    assert simulate(tmp_path / "quick.toml", "--out", out) == 0
    found = read(out / "quick/monte_carlo.json")["lyapunov_exponent"]
    value = -0.0329794566817157 if "telegraph" in noise else closed_forms.white_stiffness(1.0, 0.5, damping=0.05)
    assert abs(found["value"] - value) < 4 * found["standard_error"] < 4e-3
