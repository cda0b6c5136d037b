"""First cases as a new user writes them, every default: each ends soon, with Λ(2) right, and at once after a signal."""

import csv
import os
import random
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.oracles import clocked, filtered
from tests.oracles.moment_hierarchy import ornstein_uhlenbeck_exponent

HERE = Path(__file__).parent
SECONDS, GIGABYTES, PATIENCE, MOMENTS = 60.0, 1.5, 2.0, 20
"""What a run may take, how long it may go on after a signal, and how often it is ended."""
SOME_MISSING = 3
"""The exit code where a number that the case did not name was not resolved."""
DRIVEN = ((0.0, 0.0), (-1.0, 0.0))
MEASURED = ["--of", "height", "--gm", "0.8", "--sided", "one", "--averages", "20"]
MEASURED += ["--frequency", "0.05", "--damping-ratio", "0.03", "--kind", "filter"]

pytestmark = [pytest.mark.slow, pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")]


def gaussian(steady):
    """Λ(2) under the noise of the pendulum and of the Duffing-Rayleigh oscillator, α = 2 and σ = 1.5."""
    return ornstein_uhlenbeck_exponent(steady, DRIVEN, 2.0, 0.75, 2, 40)


def of_modes(_):
    steady, driven = np.zeros((4, 4)), np.zeros((4, 4))
    steady[[0, 2], [1, 3]] = 1.0
    steady[1, :2], steady[3, 2:] = (-1.0, -0.1), (-2.56, -0.16)
    driven[1, ::2], driven[3, ::2] = (-0.5, -0.3), (-0.3, -0.5)
    return filtered.second_moment(steady, driven, (2.0, 0.1, 0.3, 1.0, 0.0), 6)


def of_roll(case):
    system, noise = case["system"], case["noise"]
    law = noise["omega"], noise["zeta"], noise["s"], *noise["output"]
    steady = ((0.0, 1.0), (-system["stiffness"], -2 * system["damping"]))
    return filtered.moment_lyapunov(steady, DRIVEN, law, 2, 8)


SECOND = {
    "mathieu": lambda _: clocked.moment_lyapunov(2.0, 0.05, 0.2, 2.0, 1.0, 0.3, 0.9, -0.07),
    "modes": of_modes,
    "pendulum": lambda _: gaussian(((0.0, 1.0), (1.0, -0.4))),
    "duffing": lambda _: gaussian(((0.0, 1.0), (-1.0, 0.04))),
    "roll": of_roll,
}
"""Λ(2) of each case by a second method, from what the case states."""


MEASURED_RUN = """
import pathlib, sys
from fpsolve.cli import main
from tests.benchmarks.measure import peak_memory
code = main()
pathlib.Path("peak").write_text(str(peak_memory()))
sys.exit(code)
"""


def begun(*arguments, folder, program=("-m", "fpsolve")):
    command, paths = [sys.executable, *program, *map(str, arguments)], os.environ.get("PYTHONPATH", "")
    known = {**os.environ, "PYTHONPATH": os.pathsep.join([str(HERE.parent.parent), *filter(None, [paths])])}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    return subprocess.Popen(command, cwd=folder, env=known, **pipes, text=True)


@pytest.fixture
def case(name, tmp_path):
    """The case file, of a ship's roll from the spectrum that was measured."""
    if name != "roll":
        return shutil.copy(HERE / f"{name}.toml", tmp_path)
    subprocess.run([sys.executable, HERE / "roll.py", tmp_path / "roll.csv"], check=True)
    process = begun("noise", "roll.csv", *MEASURED, folder=tmp_path)
    said, _ = process.communicate(timeout=SECONDS)
    assert process.returncode == 0, said
    return shutil.copy(tmp_path / "results/roll.csv/noise.toml", tmp_path / "roll.toml")


def second_moment(folder, name):
    """Λ(2) and its error, as moments.csv has them; None where it has none."""
    try:
        text = (folder / f"results/{name}/moments.csv").read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    rows = [row for row in csv.DictReader(text.splitlines()) if float(row["p"]) == 2.0 and row["moment"]]
    return (float(rows[0]["moment"]), float(rows[0]["moment_error"])) if rows else None


@pytest.mark.parametrize("name", SECOND)
def test_a_first_case_ends_soon_and_right(name, case, tmp_path):
    start = time.monotonic()
    process = begun("run", case, folder=tmp_path, program=("-c", MEASURED_RUN))
    said, _ = process.communicate(timeout=3 * SECONDS)
    assert process.returncode in (0, SOME_MISSING), said
    assert time.monotonic() - start < SECONDS
    assert float((tmp_path / "peak").read_text(encoding="utf-8")) / 1e3 < GIGABYTES
    value, error = second_moment(tmp_path, name)
    expected = SECOND[name](tomllib.loads(Path(case).read_text(encoding="utf-8")))
    assert value == pytest.approx(expected, abs=1.5 * error + 1e-8)


@pytest.mark.parametrize("name", SECOND)
def test_a_first_case_can_be_ended_at_any_time(name, case, tmp_path):
    """What was solved is kept, and the same command goes on from there, to the same Λ(2) within a tenth of its error.

    The moments begin where Python itself has started: before, there is no program yet that a signal could end.
    """
    draw = random.Random(name)
    process = begun("run", case, folder=tmp_path)
    start = time.monotonic()
    process.communicate(timeout=3 * SECONDS)
    whole, value = time.monotonic() - start, second_moment(tmp_path, name)
    shutil.rmtree(tmp_path / "results")
    known = 0
    for _ in range(MOMENTS):
        process = begun("run", case, folder=tmp_path)
        started = time.monotonic()
        begun(folder=tmp_path, program=("-c", "import runpy, fpsolve.__main__")).communicate()  # beside it, and later
        time.sleep(max(0.0, draw.uniform(0, min(whole, 5.0)) + started - time.monotonic()))
        process.send_signal(signal.SIGINT)
        sent = time.monotonic()
        said, _ = process.communicate(timeout=60)
        assert time.monotonic() - sent < PATIENCE, said
        assert "Traceback" not in said, said
        records = sum(path.stat().st_size for path in tmp_path.glob("results/*/records/**/*") if path.is_file())
        assert records >= known
        known = records
    process = begun("run", case, folder=tmp_path)
    said, _ = process.communicate(timeout=3 * SECONDS)
    assert process.returncode in (0, SOME_MISSING), said
    again = second_moment(tmp_path, name)
    assert (again is None) == (value is None)
    assert value is None or again[0] == pytest.approx(value[0], abs=0.1 * max(value[1], again[1]))
