"""Whoever runs tasks, the results are the same; what dies costs its task only."""

import math
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future
from pathlib import Path

import pytest

from fpsolve import pool
from fpsolve.errors import FpsolveError, WorkersDied
from fpsolve.pool import PROCESSORS, Pool, cluster, limit_processors, parallel, processors, serial
from tests.conftest import heed_signals, sampled
from tests.pool_tasks import deadly, faulty, square, whereabouts

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")


class KilledWorker(Exception):
    """As Dask calls it."""


class Cluster(Executor):
    """Gives one task up, as Dask does where several workers died on it."""

    def submit(self, task, /, item):
        future = Future()
        if item == 7:
            future.set_exception(KilledWorker())
        else:
            future.set_result(task(item))
        return future


class Deserted(Executor):
    """Has no workers."""

    def submit(self, *_):
        return Future()


@pytest.mark.parametrize("count", [1, 2, None])
def test_map_keeps_the_order(count):
    with parallel(count) as workers:
        assert list(workers.map(square, range(300))) == [number**2 for number in range(300)]
        assert list(workers.map(square, ())) == []
        assert list(workers.map(square, [4])) == [16]  # the workers are still there


@pytest.mark.slow
def test_items_are_taken_when_they_are_needed():
    """They may be many."""
    taken = []

    def items():
        for number in range(1000):
            taken.append(number)
            yield number

    with parallel(2) as workers:
        found = workers.run(square, items())
        next(found)
        assert len(taken) <= pool.SUBMITTED
        found.close()


@pytest.mark.parametrize("workers", [Pool(Cluster), parallel(2)])
def test_a_dead_worker_ends_a_run(workers):
    with workers, pytest.raises(WorkersDied, match=r"a worker has died, .*; what was finished is kept"):
        list(workers.run(deadly, range(15)))


@pytest.mark.slow
def test_a_cluster_without_workers_is_given_up(monkeypatch):
    monkeypatch.setattr(pool, "CONNECT_SECONDS", 0.5)
    monkeypatch.setattr(pool, "LOOK_SECONDS", 0.1)
    there, begun = iter([True] * 5), time.monotonic()
    with (
        Pool(Deserted, has_workers=lambda: next(there, False)) as workers,
        pytest.raises(WorkersDied, match="no worker is left"),
    ):
        list(workers.run(square, range(3)))
    assert 1.0 < time.monotonic() - begun < 5.0


INTERRUPTED = """
import time
from fpsolve.pool import serial

def task(number):
    print("begun", flush=True)
    end = time.monotonic() + 20
    while time.monotonic() < end:
        pass

with serial() as workers:
    list(workers.run(task, [1]))
"""


def test_an_interrupt_reaches_a_task_of_this_process():
    process = subprocess.Popen(
        [sys.executable, "-c", INTERRUPTED], stdout=subprocess.PIPE, stderr=subprocess.PIPE, preexec_fn=heed_signals
    )
    assert process.stdout.readline() == b"begun\n"
    begun = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert b"KeyboardInterrupt" in said
    assert time.monotonic() - begun < 10


def test_a_map_of_this_process_is_as_lazy_as_the_builtin():
    """Who looks at the first result need not wait for others."""
    done = []
    with serial() as workers:
        next(workers.map(done.append, range(100)))
    assert done == [0]


@pytest.mark.parametrize("count", sampled(1, 2))
def test_exceptions_are_raised_here(count):
    with parallel(count) as workers, pytest.raises(OSError, match="No space"):
        list(workers.run(faulty, range(20)))


@pytest.mark.slow
def test_workers_are_other_processes_with_one_processor_each():
    with parallel(2) as workers:
        found = set(workers.map(whereabouts, range(20)))
    assert len(found) == 2
    assert {count for _, count in found} == {1}
    assert os.getpid() not in {number for number, _ in found}


@pytest.mark.slow
def test_little_work_is_done_here(monkeypatch):
    """Others would take as long to start."""
    monkeypatch.setattr(pool, "processors", lambda: 2)
    with parallel() as workers:
        assert {number for number, _ in workers.map(whereabouts, range(3))} == {os.getpid()}
    monkeypatch.setattr(pool, "START_SECONDS", 0.1)
    with parallel() as workers:
        found = [number for number, _ in workers.map(whereabouts, range(30))]
    assert found[0] == os.getpid()
    assert len(set(found)) == 3


SCRIPT = """
from fpsolve.pool import parallel
from tests.pool_tasks import square
with parallel(2) as workers:
    print(sum(result for _, result in workers.run(square, range(4))))
"""


@pytest.mark.slow
@pytest.mark.parametrize("is_file", [False, True])
def test_a_script_needs_no_guard(tmp_path, is_file):
    """Its processes do not run it again, nor look for it where it came through a pipe."""
    script = tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    command = [sys.executable, str(script) if is_file else "-"]
    done = subprocess.run(
        command,
        input="" if is_file else SCRIPT,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "14\n", "")


@pytest.mark.slow
def test_no_more_processes_than_tasks():
    with parallel(1000, 2) as workers:
        assert len(set(workers.map(whereabouts, range(20)))) == 2
    assert parallel(2, 1).own_seconds == math.inf


@pytest.mark.parametrize("count", [0, -1, 2.5, "2", True, 1001, 10**20])
def test_what_is_no_number_of_processes_is_refused(count):
    with pytest.raises(FpsolveError, match=r"jobs.*must be a whole number from 1 to 1000"):
        parallel(count)


def test_processes_that_cannot_be_started():
    """Each needs an open file."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (len(list(Path("/dev/fd").iterdir())) + 12, before[1]))
    try:
        with parallel(100) as workers, pytest.raises(FpsolveError, match=r"cannot be started: .*; use fewer jobs"):
            list(workers.map(square, range(300)))
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


@pytest.mark.parametrize("address", [None, "host", "tls://host:8786", "tcp://host", "host:port", "tcp://a b:1"])
def test_what_is_no_address_is_refused(address):
    pytest.importorskip("distributed")
    with pytest.raises(FpsolveError, match=r"must be an address such as tcp://host:8786"):
        cluster(address)


@pytest.mark.slow
def test_a_scheduler_that_does_not_answer(monkeypatch):
    pytest.importorskip("distributed")
    monkeypatch.setattr(pool, "CONNECT_SECONDS", 0.5)
    with pytest.raises(
        FpsolveError, match=r"no scheduler answers at tcp://127.0.0.1:9 .*start one with: dask scheduler"
    ):
        cluster("tcp://127.0.0.1:9")


def test_without_dask(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(FpsolveError, match=r"pip install 'fpsolve\[cluster\]'"):
        cluster("tcp://127.0.0.1:8786")


@pytest.fixture
def _four_processors(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2, 5}, raising=False)
    monkeypatch.setattr(pool, "_limits", [])
    monkeypatch.delenv(PROCESSORS, raising=False)


@pytest.mark.usefixtures("_four_processors")
def test_the_least_limit_of_processors_counts(monkeypatch):
    assert processors() == 4
    monkeypatch.setenv(PROCESSORS, " 3 ")
    assert processors() == 3
    limit_processors(2)
    assert processors() == 2
    limit_processors(9)
    assert processors() == 3
    monkeypatch.setenv(PROCESSORS, "")
    assert processors() == 4


@pytest.mark.usefixtures("_four_processors")
def test_without_affinities_all_processors_count(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 6)
    assert processors() == 6
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert processors() == 1


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system has no affinities")
def test_a_process_that_is_bound_to_one_processor_uses_one():
    code = "import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\nfrom fpsolve.pool import *"
    command = [sys.executable, "-c", f"{code}; print(processors())"]
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip() == "1"


@pytest.mark.usefixtures("_four_processors")
@pytest.mark.parametrize("text", ["0", "00", "-1", "two", "1.5", "²"])
def test_a_limit_that_is_no_number_is_refused(monkeypatch, text):
    monkeypatch.setenv(PROCESSORS, text)
    with pytest.raises(FpsolveError, match=f'^FPSOLVE_PROCESSORS, .*got "{text}"; must be a whole number >= 1; set it'):
        processors()
