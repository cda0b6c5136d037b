"""Tasks in this process, in several of this machine, or on a cluster.

A task is a function of one item; both can be pickled. Its result must not depend on who runs it.
"""

from __future__ import annotations

import logging
import math
import multiprocessing
import os
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, CancelledError, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from multiprocessing import resource_tracker
from types import ModuleType
from typing import Any, Generic, TypeVar

from fpsolve.arrays import is_whole, shown
from fpsolve.budget import share_memory
from fpsolve.errors import FpsolveError

Item = TypeVar("Item")
Result = TypeVar("Result")
PROCESSORS = "FPSOLVE_PROCESSORS"
"""The environment variable that limits how many processors a process and its children use."""
AHEAD = 2
"""Tasks that are submitted for each worker, so that none waits for the next."""
LOOK_SECONDS = 0.2
"""How often the steps of tasks in other processes are looked at."""
SLOTS = 1021
"""For the counts of processes, whose numbers rarely agree but for multiples of it."""
AHEAD_IN_ORDER = 64
"""The same where results are wanted in order, so that no worker waits while the caller is busy with one result."""
START_SECONDS = 1.5
"""Of work that this process does itself before it starts others, as their start takes as long."""
CONNECT_SECONDS = 20
MOST_JOBS = 1000
"""Processes on this machine; each needs an open file."""
_TURN = threading.Lock()
_limits: list[int] = []
_counters: list[Any] = []
"""In a worker of this machine, where it counts the steps of its tasks."""


class Steps:
    """What a task calls for each of its steps; in another process it counts them there, for `Pool.map` to look at.

    Args:
        told: what it calls in this process.
    """

    def __init__(self, told: Callable[[], object]) -> None:
        self._told = told

    def __call__(self) -> bool:
        """Whether somebody is told of a step."""
        self._told()
        return True

    def __reduce__(self) -> tuple[Callable[[], Callable[[], bool]], tuple[()]]:
        return _elsewhere, ()


def _elsewhere() -> Callable[[], bool]:
    return _count_step


def _count_step() -> bool:
    """The same in another process; on another machine nobody is told."""
    for counter in _counters:
        counter[os.getpid() % SLOTS] += 1
    return bool(_counters)


def processors() -> int:
    """How many processors this process may use: those that the system gives it, or fewer if there is a limit.

    Raises:
        FpsolveError: the limit of the environment is not a whole number from 1 on.
    """
    given = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    text = os.environ.get(PROCESSORS, "").strip()
    try:
        limits = [int(text), *_limits] if text else _limits
    except ValueError:
        limits = [0]
    if min(limits, default=1) < 1:
        known = "must be a whole number >= 1; set it to one, or unset it"
        raise FpsolveError(f'{PROCESSORS}, in the environment: got "{text}"; {known}')
    return min([given, *limits])


def limit_processors(count: int) -> None:
    """Let this process use at most so many processors from now on. Raises `ValueError` if `count` is not ≥ 1."""
    if not is_whole(count, 1):
        raise ValueError(f"got count = {shown(count)}; must be a whole number >= 1")
    _limits[:] = [count]


@dataclass(frozen=True)
class Done(Generic[Item, Result]):
    """An item and what became of it.

    Attributes:
        number: of the item among those of a run, from 0 on.
        item: what the task was given.
        result: what it returned.
        is_lost: whether its worker died on it while no other task was under way that may have been the reason.
    """

    number: int
    item: Item
    result: Result | None
    is_lost: bool = False


@dataclass
class Pool:
    """Runs tasks on an executor of `concurrent.futures`; as a context it ends the workers.

    Attributes:
        start: makes an executor; called again after a worker died, which breaks the executor.
        stop: ends an executor and its running tasks.
        ahead: how many tasks are submitted at once.
        own_seconds: how long this process works before the executor is made; with inf it does all.
        is_elsewhere: whether other machines work.
        counter: where workers count the steps of their tasks, see `Steps`; in a slot each, as a lock would stay locked
            where one dies.
    """

    start: Callable[[], Executor]
    stop: Callable[[Executor], None] = lambda executor: executor.shutdown(cancel_futures=True)
    ahead: int = 1
    own_seconds: float = 0.0
    is_elsewhere: bool = False
    counter: Any = None
    _told: int = field(default=0, init=False, repr=False)
    _executor: Executor | None = field(default=None, init=False, repr=False)

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def run(
        self,
        task: Callable[[Item], Result],
        items: Iterable[Item],
        ahead: int = 0,
        stepped: Callable[[int], object] | None = None,
    ) -> Iterator[Done[Item, Result]]:
        """The results as they come; an exception of a task is raised here, and ends the run.

        An item is taken when it can be given to a worker: there may be many, and they may follow from results.
        `stepped` is called with how many `Steps` other processes have done, before their results are there.
        """
        source = enumerate(items)
        until = time.monotonic() + self.own_seconds
        while self._executor is None and time.monotonic() < until:
            for number, item in islice(source, 1):
                yield Done(number, item, task(item))
                break
            else:
                return
        while True:
            waiting = {self._submit(task, each[1]): each for each in islice(source, ahead or self.ahead)}
            suspects: list[tuple[int, Item]] = []
            if not waiting:
                return
            while waiting:
                for future in self._finished(waiting, stepped):
                    number, item = waiting.pop(future)
                    try:
                        yield Done(number, item, future.result())
                    except BrokenProcessPool:
                        suspects.append((number, item))
                        continue
                    except CancelledError:
                        raise FpsolveError(
                            "the scheduler has stopped; the same command goes on where this one stopped"
                        ) from None
                    except Exception as failure:
                        if type(failure).__name__ != "KilledWorker":  # of Dask, where several workers died on the task
                            raise
                        yield Done(number, item, None, is_lost=True)
                    if not suspects:
                        waiting |= {self._submit(task, each[1]): each for each in islice(source, 1)}
            if suspects:  # under way as a worker died; one by one they show which one was the reason
                self._end()
            for number, item in suspects:
                try:
                    yield Done(number, item, self._submit(task, item).result())
                except BrokenProcessPool:
                    yield Done(number, item, None, is_lost=True)
                    self._end()

    def map(
        self,
        task: Callable[[Item], Result],
        items: Iterable[Item],
        stepped: Callable[[int], object] | None = None,
    ) -> Iterator[Result]:
        """The results in the order of the items, see `run`. Raises `FpsolveError` where a worker dies."""
        early: dict[int, Any] = {}
        due = 0
        for done in self.run(task, items, max(self.ahead, AHEAD_IN_ORDER), stepped):
            if done.is_lost:
                raise FpsolveError("a worker died, perhaps for lack of memory; use fewer workers, or a smaller budget")
            early[done.number] = done.result
            while due in early:
                yield early.pop(due)
                due += 1

    def _finished(
        self, waiting: Iterable[Future[Result]], stepped: Callable[[int], object] | None
    ) -> set[Future[Result]]:
        """Those that are done first; until then the steps of all are told."""
        while True:
            found = wait(waiting, LOOK_SECONDS if stepped and self.counter else None, FIRST_COMPLETED).done
            count = sum(self.counter or ()) - self._told
            if stepped and count:
                stepped(count)
            self._told += count
            if found:
                return found

    def _submit(self, task: Callable[[Item], Result], item: Item) -> Future[Result]:
        """Give a task to the executor; where that is broken the future says so."""
        try:
            with _signals_blocked(), _without_main():
                self._executor = self._executor or self.start()
                return self._executor.submit(_in_turn, task, item)
        except BrokenProcessPool as failure:
            broken: Future[Result] = Future()
            broken.set_exception(failure)
            return broken
        except OSError as failure:
            reason = failure.strerror or failure
            raise FpsolveError(f"the processes cannot be started: {reason}; use fewer jobs") from failure

    def _end(self) -> None:
        if self._executor is not None:
            executor, self._executor = self._executor, None
            self.stop(executor)


def serial() -> Pool:
    """This process alone, item by item."""
    return Pool(lambda: _processes(1), own_seconds=math.inf)


def parallel(count: int | None = None, tasks: int = MOST_JOBS) -> Pool:
    """Processes of this machine, but not more than there are tasks.

    Args:
        count: how many. None: one per processor, started after this process's first 1.5 s of work.
        tasks: how many tasks there will be, as far as that is known.

    Raises:
        FpsolveError: the count is not a number of processes.
    """
    if count is not None and not is_whole(count, 1, MOST_JOBS):
        known = f"must be a whole number from 1 to {MOST_JOBS}; leave it out for one process on each processor"
        raise FpsolveError(f"jobs: got {shown(count)}; {known}")
    size = min(count or processors(), tasks)
    if size == 1:
        return serial()
    counter = multiprocessing.get_context("spawn").RawArray("Q", SLOTS)
    start, own_seconds = partial(_processes, size, counter), START_SECONDS if count is None else 0.0
    return Pool(start, _kill, AHEAD * size, own_seconds, counter=counter)


def cluster(address: str) -> Pool:
    """The workers of a Dask scheduler, such as "tcp://host:8786"; they need this version of fpsolve.

    Raises:
        FpsolveError: Dask is not installed, nothing answers, or the workers cannot run fpsolve.
    """
    if type(address) is not str:
        raise FpsolveError(f'scheduler: got {shown(address)}; must be an address, such as "tcp://host:8786"')
    clients: list[Any] = []
    with _client(address) as client:
        threads = sum(client.nthreads().values())

    def start() -> Executor:
        clients.append(_client(address))
        clients[-1].run(_limit_to_threads)
        executor: Executor = clients[-1].get_executor(pure=False)
        return executor

    def stop(executor: Executor) -> None:
        executor.shutdown(wait=False)  # cancels what is not done
        clients.pop().close()

    return Pool(start, stop, max(AHEAD * threads, 32), is_elsewhere=True)


def _client(address: str) -> Any:
    """A client of a scheduler whose workers have this version of fpsolve."""
    from fpsolve import __version__

    try:
        import distributed
    except ImportError:
        raise FpsolveError("Dask is not installed; install it with: pip install 'fpsolve[cluster]'") from None
    connect: Callable[..., Any] = distributed.Client
    for name in ("distributed", "distributed.client", "tornado.application"):  # they report workers that come and go
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if not re.fullmatch(r"(tcp://)?[^/\s:]+:\d+", address):
        raise FpsolveError(f'got "{address}" as the address of a scheduler; must be one such as tcp://host:8786')
    try:
        client: Any = connect(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except OSError as failure:
        remedy = "start one with: dask scheduler"
        raise FpsolveError(f"no scheduler answers at {address} ({failure}); {remedy}") from failure
    try:
        versions = set(client.run(_version).values())
    except Exception as failure:
        client.close()
        raise FpsolveError(f"the workers of {address} cannot run fpsolve: {failure}; install it there") from failure
    if versions != {__version__}:
        client.close()
        others = ", ".join(versions - {__version__})
        state = f"have fpsolve {others}, not {__version__}" if others else "are not there"
        remedy = f"dask worker {address} --nworkers -1 --nthreads 1"
        raise FpsolveError(f"workers of {address} {state}; start them with: {remedy}")
    return client


def _version() -> str:
    from fpsolve import __version__

    return __version__


def _limit_to_threads(dask_worker: Any) -> None:
    """A worker uses as many processors as it has threads, and leaves the others to others."""
    limit_processors(dask_worker.state.nthreads)


def _in_turn(task: Callable[[Item], Result], item: Item) -> Result:
    """One task at a time in a process: a worker of a cluster may have several threads."""
    with _TURN:
        return task(item)


def _processes(count: int, *counters: Any) -> Executor:
    """New processes, in which nothing of this one is copied, neither its locks nor its threads."""
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(count, mp_context=context, initializer=_begin_worker, initargs=(count, *counters))


def _begin_worker(count: int, *counters: Any) -> None:
    """A worker has one processor, one share of the memory, and ends when what started it does, however that ends."""
    limit_processors(1)
    share_memory(count)
    _counters[:] = counters
    parent = multiprocessing.parent_process()

    def end_with_parent() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=end_with_parent, daemon=True).start()


def _kill(executor: Executor) -> None:
    for process in list((getattr(executor, "_processes", None) or {}).values()):
        process.kill()
    executor.shutdown(cancel_futures=True)


@contextmanager
def _without_main() -> Iterator[None]:
    """Processes that are started in the body do not run the script of this one, of which no task needs anything.

    `multiprocessing` looks for the script in `sys.modules` and has no option that says otherwise.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """Processes that are started in the body never get the signals of a terminal, which are for this process."""
    if not hasattr(signal, "pthread_sigmask"):  # on Windows
        yield
        return
    resource_tracker.ensure_running()  # whose start would let them through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
