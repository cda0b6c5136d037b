"""Tasks in this process, in several of this machine, or on a cluster: one way to run them, whoever works.

A task is a function of one item, both of which pickle. What it finds must not depend on who runs it.
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
from types import ModuleType
from typing import Any, Generic, TypeVar

from fpsolve.errors import FpsolveError
from fpsolve.process import limit_processors, processors

Item = TypeVar("Item")
Result = TypeVar("Result")
AHEAD = 2
"""Tasks that wait for each worker, so that none waits for the next."""
AHEAD_IN_ORDER = 64
"""The same where results are wanted in order, so that none waits while the caller is busy with one."""
START_SECONDS = 1.5
"""Of work that this process does itself before it starts others, as that takes as long."""
CONNECT_SECONDS = 20
MOST_JOBS = 1000
"""Processes of this machine; each needs an open file."""
_TURN = threading.Lock()


@dataclass(frozen=True)
class Done(Generic[Item, Result]):
    """An item and what became of it.

    Attributes:
        item: what the task was given.
        result: what it returned; None where its worker died on it, with no other task under way that may have been the
            reason.
    """

    item: Item
    result: Result | None

    @property
    def is_lost(self) -> bool:
        """Whether its worker died on it."""
        return self.result is None


@dataclass
class Pool:
    """Runs tasks on an executor of `concurrent.futures`; use it as a context, which ends the workers.

    Attributes:
        start: makes an executor; again after one has broken, because a worker died.
        stop: ends an executor, and what it is at.
        ahead: how many tasks it is given at once.
        own_seconds: of work that this process does before the executor is made; with inf it does all.
        is_elsewhere: whether other machines work.
    """

    start: Callable[[], Executor]
    stop: Callable[[Executor], None] = lambda executor: executor.shutdown(cancel_futures=True)
    ahead: int = 1
    own_seconds: float = 0.0
    is_elsewhere: bool = False
    _executor: Executor | None = field(default=None, init=False, repr=False)

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def run(
        self, task: Callable[[Item], Result], items: Iterable[Item], ahead: int = 0
    ) -> Iterator[Done[Item, Result]]:
        """The results as they come; an exception of a task is raised here, and ends it all.

        Items are taken when they can be given to a worker, so that they may be many, and may follow from results.
        """
        source = iter(items)
        yield from self._own(task, source)
        suspects: list[Item] = []
        while True:
            waiting: dict[Future[Result], Item] = {}
            for item in islice(source, ahead or self.ahead):
                waiting[self._submit(task, item)] = item
            if not waiting:
                return
            while waiting:
                for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                    item = waiting.pop(future)
                    try:
                        yield Done(item, future.result())
                    except BrokenProcessPool:
                        suspects.append(item)
                        continue
                    except CancelledError:
                        raise FpsolveError("the scheduler is gone; the same command goes on where it was") from None
                    except Exception as failure:
                        if not _is_killed_worker(failure):
                            raise
                        yield Done(item, None)
                    if not suspects:
                        waiting |= {self._submit(task, each): each for each in islice(source, 1)}
            if suspects:
                yield from self._one_by_one(task, suspects)
                suspects.clear()

    def map(self, task: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Result]:
        """The results in the order of the items. Raises `FpsolveError` where a worker dies."""
        numbered = ((number, item) for number, item in enumerate(items))
        early: dict[int, Result] = {}
        due = 0
        for done in self.run(partial(_numbered, task), numbered, max(self.ahead, AHEAD_IN_ORDER)):
            if done.result is None:
                raise FpsolveError("a worker died, perhaps for lack of memory; use fewer workers, or a smaller budget")
            number, result = done.result
            early[number] = result
            while due in early:
                yield early.pop(due)
                due += 1

    def _own(self, task: Callable[[Item], Result], source: Iterator[Item]) -> Iterator[Done[Item, Result]]:
        """What this process does itself, as long as others need to start."""
        until = time.monotonic() + self.own_seconds
        while self._executor is None and time.monotonic() < until:
            try:
                item = next(source)
            except StopIteration:
                return
            yield Done(item, task(item))

    def _submit(self, task: Callable[[Item], Result], item: Item) -> Future[Result]:
        if self._executor is None:
            with _signals_blocked():
                self._executor = self.start()
        try:
            with _signals_blocked(), _without_main():
                return self._executor.submit(_alone, task, item)
        except BrokenProcessPool as failure:
            broken: Future[Result] = Future()
            broken.set_exception(failure)
            return broken
        except OSError as failure:
            reason = failure.strerror or failure
            raise FpsolveError(f"the processes cannot be started: {reason}; use fewer jobs") from failure

    def _one_by_one(self, task: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[Done[Item, Result]]:
        """The items that were under way as a worker died, again, so that it shows which one was the reason."""
        self._end()
        for item in items:
            try:
                yield Done(item, self._submit(task, item).result())
            except BrokenProcessPool:
                yield Done(item, None)
                self._end()

    def _end(self) -> None:
        if self._executor is not None:
            executor, self._executor = self._executor, None
            self.stop(executor)


def here() -> Pool:
    """This process alone, item by item."""
    return Pool(lambda: _processes(1), own_seconds=math.inf)


def several(count: int | None = None, tasks: int = MOST_JOBS) -> Pool:
    """Processes of this machine, but not more than there are tasks.

    Args:
        count: how many; None for as many as there are processors, once this one has begun.
        tasks: how many tasks there will be, as far as that is known.

    Raises:
        FpsolveError: that is no number of processes.
    """
    if count is not None and (isinstance(count, bool) or not isinstance(count, int) or not 1 <= count <= MOST_JOBS):
        known = f"must be a whole number from 1 to {MOST_JOBS}; leave it out for one process on each processor"
        raise FpsolveError(f"jobs: got {count!r}; {known}")
    size = min(count or processors(), tasks)
    if size == 1:
        return here()
    return Pool(lambda: _processes(size), _kill, AHEAD * size, START_SECONDS if count is None else 0.0)


def cluster(address: str) -> Pool:
    """The workers of a Dask scheduler, such as "tcp://host:8786"; they need this version of fpsolve.

    Raises:
        FpsolveError: Dask is not installed, nothing answers, or the workers cannot do it.
    """
    clients: list[Any] = []
    with _client(address) as client:
        threads = sum(client.nthreads().values())

    def start() -> Executor:
        clients.append(_client(address))
        clients[-1].run(_limit_to_threads)
        executor: Executor = clients[-1].get_executor(pure=False)
        return executor

    def stop(executor: Executor) -> None:
        executor.shutdown(wait=False)  # what is not done is cancelled
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
    for name in ("distributed", "distributed.client", "tornado.application"):  # they tell of who comes and goes
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if not re.fullmatch(r"(tcp://)?[^/\s:]+:\d+", address):
        raise FpsolveError(f'got "{address}" as the address of a scheduler; must be one such as tcp://host:8786')
    try:
        client = connect(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except OSError as failure:
        raise FpsolveError(
            f"no scheduler answers at {address} ({failure}); start one with: dask scheduler"
        ) from failure
    try:
        versions = client.run(_version)
    except Exception as failure:
        client.close()
        raise FpsolveError(f"the workers of {address} cannot run fpsolve: {failure}; install it there") from failure
    others = {version for version in versions.values() if version != __version__}
    if others or not versions:
        client.close()
        remedy = f"dask worker {address} --nworkers -1 --nthreads 1"
        state = f"have fpsolve {', '.join(others)}, not {__version__}" if others else "are not there"
        raise FpsolveError(f"workers of {address} {state}; start them with: {remedy}")
    return client


def _version() -> str:
    from fpsolve import __version__

    return __version__


def _limit_to_threads(dask_worker: Any) -> None:
    """A worker uses as many processors as it has threads, and leaves the others to others."""
    limit_processors(dask_worker.state.nthreads)


def _is_killed_worker(failure: Exception) -> bool:
    """Whether Dask gave a task up, as several workers in turn died on it."""
    return type(failure).__name__ == "KilledWorker"


def _alone(task: Callable[[Item], Result], item: Item) -> Result:
    """One task at a time in a process: a worker of a cluster may have several threads."""
    with _TURN:
        return task(item)


def _numbered(task: Callable[[Item], Result], numbered: tuple[int, Item]) -> tuple[int, Result]:
    number, item = numbered
    return number, task(item)


def _processes(count: int) -> Executor:
    """New processes, in which nothing of this one is copied, so that neither its locks nor its threads are."""
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(count, mp_context=context, initializer=_begin_worker)


def _begin_worker() -> None:
    """A worker has one processor, and ends when the process that started it does, however that ends."""
    limit_processors(1)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_after, args=(parent,), daemon=True).start()


def _end_after(parent: Any) -> None:
    parent.join()
    os._exit(1)


def _kill(executor: Executor) -> None:
    """End the workers at once; what they had finished is kept."""
    for process in list((getattr(executor, "_processes", None) or {}).values()):
        process.kill()
    executor.shutdown(cancel_futures=True)


@contextmanager
def _without_main() -> Iterator[None]:
    """Processes that are started in the body do not run the script of this one, of which no task needs anything."""
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = main


@contextmanager
def _signals_blocked() -> Iterator[None]:
    """What is started in the body never gets the signals of a terminal, which are for the process that started it."""
    if not hasattr(signal, "pthread_sigmask"):  # on Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGHUP))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
