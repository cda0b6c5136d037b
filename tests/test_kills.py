"""A run that is killed, at any moment, leaves whole files, and the next one goes on where it was."""

import json
import os
import random
import signal
import time

import pytest

from fpsolve.pool import processors
from tests.conftest import started
from tests.kit import case_text, read_json

VARIED = '[vary]\n"noise.D0" = { start = 0.5, stop = 1.6, num = 4 }\n'
CASE = case_text(f"[moments]\np = [-1.0, 2.0]\n{VARIED}", "Killed", {"D0": 1.0}, epsilon=0.3)
KINDS = signal.SIGKILL, signal.SIGTERM
"""How runs are ended; each takes some seconds."""
CODE = "from fpsolve.cli import main; print('begun', flush=True); raise SystemExit(main())"


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "killed.toml"
    path.write_text(CASE, encoding="utf-8")
    return path


def begun(case, out):
    """A run in a process of its own that has begun."""
    process = started(CODE, "run", str(case), "--out", str(out))
    assert process.stdout.readline() == "begun\n"
    return process


def numbers(curves):
    """What a summary tells of its curves, but how long these took."""
    return [{name: value for name, value in curve.items() if name != "seconds"} for curve in curves]


def contents(folder):
    """The numbers of a summary, and the names of all files but records and hidden ones."""
    curves = read_json(folder / "summary.json")["curves"]
    names = {path.relative_to(folder).as_posix() for path in folder.rglob("[!.]*") if path.is_file()}
    return numbers(curves), {name for name in names if not name.startswith("records/")}


def kept(folder):
    """The keys of all whole records."""
    lines = [line for path in folder.glob("records/solved/*.jsonl") for line in path.read_bytes().splitlines(True)]
    return {json.loads(line)["key"] for line in lines if line.endswith(b"\n")}


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_killed_runs_leave_nothing_torn(case, tmp_path):
    process, start = begun(case, tmp_path / "whole"), time.monotonic()
    process.communicate(timeout=120)
    assert process.returncode == 0
    duration, whole = time.monotonic() - start, contents(tmp_path / "whole" / "killed")
    rng, out = random.Random(9), tmp_path / "out"
    for kind in KINDS:
        before = kept(out / "killed")
        process = begun(case, out)
        time.sleep(rng.uniform(0.05, 0.7) * duration)
        process.send_signal(kind)
        _, said = process.communicate(timeout=60)
        done = kept(out / "killed")
        assert before <= done
        assert process.returncode in (0, -kind, 129, 130, 143)  # -kind as Python itself begins or ends
        assert "Traceback" not in said
        summary = out / "killed" / "summary.json"
        if summary.exists():
            left = read_json(summary)
            assert left["complete"] == (left["done"] == left["planned"])
            assert len(left["curves"]) == left["done"]
            found = numbers(left["curves"])
            assert found == [curve for curve in whole[0] if curve in found]
            if kind != signal.SIGKILL and len(done) > len(before):  # what a worker finished last is told the next time
                assert left["done"] >= len(done) - processors()
    process = begun(case, out)
    process.communicate(timeout=120)
    assert process.returncode == 0
    assert contents(out / "killed") == whole
    assert len(kept(out / "killed")) == len(whole[0])
    assert not [path for path in (out / "killed").rglob(".*") if path.name.startswith(".fpsolve-")]
