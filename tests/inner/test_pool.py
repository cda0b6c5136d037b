"""Internals of the pool: whoever runs tasks, the results are the same; what dies costs its task only."""

import math
import os
import signal
import time
from concurrent.futures import Executor, Future
from contextlib import suppress

import pytest

from fpsolve import pool
from fpsolve.budget import Meter, charge
from fpsolve.errors import WorkersDied
from fpsolve.pool import PROCESSORS, SERIAL, Pool, limit_processors, parallel, processors


def square(number):
    return number * number


def deadly(number):
    if number == 7:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def faulty(number):
    if number == 3:
        raise OSError(28, "No space left on device")
    return number


def whereabouts(_):
    time.sleep(0.05)
    return os.getpid(), processors()


@pytest.mark.parametrize("count", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_each_item_has_its_result_and_exceptions_are_raised_here(count):
    with parallel(count) as workers:
        assert dict(workers.run(square, range(300))) == {number: number**2 for number in range(300)}
        assert list(workers.run(square, ())) == []
        with pytest.raises(OSError, match="No space"):
            list(workers.run(faulty, range(20)))


def test_items_are_taken_and_done_when_they_are_needed():
    taken, done = iter(range(1000)), []
    with SERIAL as workers:
        next(workers.run(done.append, taken))
    assert (done, next(taken)) == ([0], 1)


class Deserted(Executor):
    """Has no workers, or gives one task up, as Dask does where several workers died on it."""

    def submit(self, task, /, item):
        future = Future()
        if task is deadly:
            future.set_exception(type("KilledWorker", (Exception,), {})())
        return future


@pytest.mark.parametrize(
    "workers", [pytest.param(Pool(Deserted), id="cluster"), pytest.param(parallel(2), marks=pytest.mark.slow)]
)
def test_dead_worker_ends_a_run(workers):
    with workers, pytest.raises(WorkersDied, match=r"a worker has died, .*; what was finished is kept"):
        list(workers.run(deadly, range(15)))


def test_cluster_without_workers_is_given_up_after_a_while(monkeypatch):
    monkeypatch.setattr(pool, "CONNECT_SECONDS", 0.1)
    monkeypatch.setattr(pool, "LOOK_SECONDS", 0.02)
    there, begun = iter([True] * 5), time.monotonic()
    with (
        Pool(Deserted, has_workers=lambda: next(there, False)) as workers,
        pytest.raises(WorkersDied, match="no worker is left"),
    ):
        list(workers.run(square, range(3)))
    assert time.monotonic() - begun > 0.2


@pytest.mark.slow
def test_workers_are_as_many_as_tasks_with_one_processor_each_after_own_work(monkeypatch):
    with parallel(2) as workers:
        found = set(dict(workers.run(whereabouts, range(20))).values())
    assert (len(found), {count for _, count in found}) == (2, {1})
    monkeypatch.setattr(pool, "START_SECONDS", 0.1)
    monkeypatch.setattr(pool, "processors", lambda: 2)
    with parallel() as workers:
        numbers = [number for _, (number, _) in workers.run(whereabouts, range(30))]
    assert numbers[0] == os.getpid()
    assert len(set(numbers)) == 3


def counting(number):
    """Counts until it is asked to end, but for the first two."""
    count = 0
    with suppress(KeyboardInterrupt), Meter(math.inf).running():
        while number > 1 or count < 3:
            charge(1)
            time.sleep(0.01)
            count += 1
    return count


@pytest.mark.slow
def test_interrupt_loses_neither_what_is_done_nor_what_tasks_under_way_have():
    found = {}
    with parallel(2) as workers:
        for item, count in workers.run(counting, range(40)):
            found[item] = count
            break
        time.sleep(1)
        rest = dict(workers.rest())
    assert {0, 1} <= {*found, *rest}
    assert [rest.get(item, 3) for item in (0, 1)] == [3, 3]
    assert len([item for item, count in rest.items() if item > 1 and count > 3]) == 2
    assert len(rest) < 40


def test_least_limit_of_processors_counts(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0, 1, 2, 5}, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 6)
    monkeypatch.setattr(pool, "_limits", [])
    monkeypatch.setenv(PROCESSORS, "")
    assert processors() == 4
    monkeypatch.setenv(PROCESSORS, " 3 ")
    assert processors() == 3
    limit_processors(2)
    assert processors() == 2
    monkeypatch.delattr(os, "sched_getaffinity")
    limit_processors(9)
    monkeypatch.setenv(PROCESSORS, "")
    assert processors() == 6
