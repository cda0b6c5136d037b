"""What a sweep costs beside its solves, and what a second process saves; for an idle machine."""

import os
import subprocess
import sys
import time

import pytest

from fpsolve import load_case, moment_lyapunov
from tests.kit import case_text
from tests.test_sweeps import CASE, MAIN, SIZE, dask_cluster

WEAK = case_text(
    """[moments]
p = [2.0]
[vary]
"noise.D0" = { start = 0.1, stop = 1.0, num = 50 }
"oscillator.omega" = { start = 0.5, stop = 3.0, num = 50 }
[output]
quantities = ["moment"]
""",
    "Weak noise",
)


def seconds(folder, *options):
    """How long a whole run takes, start-up included."""
    begun = time.monotonic()
    command = [
        sys.executable,
        "-c",
        MAIN,
        "run",
        "sweep.toml",
        "--out",
        f"out{len(options)}{options[-1][-1]}",
        *options,
    ]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return time.monotonic() - begun


def test_a_sweep_beside_a_loop(tmp_path):
    """2,500 sets of weak noise, one p, all tables and figures included, beside `moment_lyapunov` in a loop."""
    (tmp_path / "sweep.toml").write_text(WEAK, encoding="utf-8")
    problems = [curve.problem for curve in load_case(tmp_path / "sweep.toml").curves()]
    moment_lyapunov(problems[0], 2.0)
    begun = time.monotonic()
    for problem in problems:
        moment_lyapunov(problem, 2.0)
    loop, sweep = time.monotonic() - begun, seconds(tmp_path, "--jobs", "1")
    print(f"\n{1e3 * sweep / len(problems):.2f} ms a set, {sweep / loop:.2f} times a loop")
    assert sweep < 2 * loop


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one processor")
def test_two_processes_beside_one(tmp_path):
    """A minute of work by one process, by two, and by two workers of a Dask cluster on this machine."""
    changes = {"stop = 4.0, num = 4": "stop = 4.0, num = 33", f"num = {SIZE}": "num = 26", "n = 0.5": "n = 0.85"}
    text = CASE
    for old, new in changes.items():
        text = text.replace(old, new)
    (tmp_path / "sweep.toml").write_text(text, encoding="utf-8")
    one, two = seconds(tmp_path, "--jobs", "1"), seconds(tmp_path, "--jobs", "2")
    with dask_cluster() as (address, *_):
        cluster = seconds(tmp_path, "--scheduler", address)
    print(f"\n{one:.1f} s by one, {two:.1f} s by two ({one / two:.2f} times), {cluster:.1f} s by a cluster")
    assert one > 60
    assert one > 1.8 * two
    assert cluster < 1.2 * two
