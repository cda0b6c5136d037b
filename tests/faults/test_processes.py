"""Processes: those that cannot begin, signals in the first second, what is no number of them, and what travels."""

import os
import pickle
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import fpsolve
from fpsolve import CaseError, FpsolveError, MomentLyapunovFunction, NotConverged, load_case, make_mesh, moment_lyapunov
from fpsolve.model import White
from tests.conftest import heed_signals, sampled, started
from tests.kit import case_text, rates

CASE = case_text('[moments]\np = [2.0]\n[output]\nfigure = false\nquantities = ["lyapunov_exponent"]\n')
RUN = "from fpsolve.__main__ import main; print('begun', flush=True); main()"
EXPLORED = Path(__file__).parents[2] / "cases/fig1.toml"


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(CASE, encoding="utf-8")
    return path


@pytest.mark.parametrize("delay", sampled(0.2, 0.02, *(0.1 * k for k in range(3, 12))))
def test_interrupt_of_the_first_second_says_no_more_than_that(delay, tmp_path):
    """While modules are imported."""
    process = started(RUN, "design", "--help", cwd=tmp_path)
    assert process.stdout.readline() == "begun\n"
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said) in {(130, "interrupted\n"), (0, "")}


ADDRESS = "must be an address such as tcp://host:8786"
REFUSED = [
    # jobs, scheduler, FPSOLVE_PROCESSORS, what is said
    *[(jobs, "", "", "jobs.*must be a whole number from 1 to 1000") for jobs in (0, -1, 2.5, "2", True, 1001, 10**20)],
    *[(1, host, "", ADDRESS) for host in ("host", "tls://host:8786", "tcp://host", "host:port", "tcp://a b:1")],
    *[
        (None, "", text, f'^FPSOLVE_PROCESSORS, .*got "{text}"; must be a whole number >= 1; set it')
        for text in ("0", "00", "-1", "two", "1.5", "²")
    ],
    pytest.param(1, "tcp://127.0.0.1:9", "", "no scheduler answers at .*start one with", marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("jobs", "scheduler", "limit", "said"), REFUSED)
def test_what_is_no_number_of_processes_is_refused(case, tmp_path, monkeypatch, jobs, scheduler, limit, said):
    if scheduler:
        pytest.importorskip("distributed")
    monkeypatch.setenv("FPSOLVE_PROCESSORS", limit)
    varied = load_case(case, ['vary={"noise.D0"=[0.1,0.2,0.3]}'])
    kind = FpsolveError if isinstance(jobs, int | None) and jobs is not True else TypeError
    with pytest.raises(kind, match=said):
        fpsolve.run(varied, tmp_path / "out", jobs=jobs, scheduler=scheduler)


def test_scheduler_without_dask_says_how_it_is_installed(case, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(FpsolveError, match=r"pip install 'fpsolve\[cluster\]'"):
        fpsolve.run(case, tmp_path, scheduler="tcp://127.0.0.1:8786")


def few_files():
    """Each process needs some."""
    heed_signals()
    resource.setrlimit(resource.RLIMIT_NOFILE, (40, 40))


@pytest.mark.slow
def test_more_processes_than_can_be_started_are_refused(case):
    varied = "vary={'noise.D0'={start=0.1, stop=1.0, num=200}}"
    process = started(RUN, "run", "case.toml", "--jobs", "100", "--set", varied, before=few_files, cwd=case.parent)
    _, said = process.communicate(timeout=120)
    assert process.returncode == 2
    assert re.search("cannot be started: .*; use fewer jobs\n$", said), said


@pytest.mark.slow
@pytest.mark.parametrize("is_file", [False, True])
def test_script_with_processes_needs_no_guard(case, is_file):
    """Its processes do not run it again, nor look for it where it came through a pipe."""
    varied = "[\"vary={'noise.D0'=[0.1, 0.2, 0.3]}\"]"
    code = f"import fpsolve\nprint(len(fpsolve.run(fpsolve.load_case('case.toml', {varied}), jobs=2)))\n"
    (case.parent / "script.py").write_text(code, encoding="utf-8")
    command = [sys.executable, "script.py" if is_file else "-"]
    path = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(command, input=code, env=path, cwd=case.parent, capture_output=True, text=True, timeout=200)
    assert (done.returncode, done.stdout, done.stderr) == (0, "3\n", "")


def copied(thing):
    return pickle.loads(pickle.dumps(thing))


def test_results_and_errors_that_travel_to_other_processes_are_the_same(case):
    problem = rates("x' = v; v' = -x - 0.4*v - xi*x", White(s=0.2))
    result, function = moment_lyapunov(problem, [1.0, 2.0]), MomentLyapunovFunction(problem, (-1.0, 2.0))
    assert np.array_equal(copied(result).value, result.value)
    assert copied(result).pairs[0].generator is not None
    assert copied(function)(0.7) == function(0.7)
    solver = copied(fpsolve.ExponentSolver(problem))
    assert solver.solution(2.0).pair.value == pytest.approx(result.value[1], rel=1e-10)
    with pytest.raises(CaseError) as refused:
        load_case(case, ["noise.D0=-1"])
    strong, coarse = load_case(case, ["oscillator.epsilon=1.5"]).problem, make_mesh(phi_degree=6, xi_degree=6)
    with pytest.raises(NotConverged) as failed:
        moment_lyapunov(strong, [1.0, 40.0], mesh=coarse)
    for error in (refused.value, failed.value):
        assert str(copied(error)) == str(error)
    assert copied(refused.value).faults == refused.value.faults != ()
    assert np.array_equal(copied(failed.value).partial.p, failed.value.partial.p)
