"""Tasks in this process, in several of this machine, or on a cluster, by the interface of `concurrent.futures`.

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
from concurrent import futures
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import islice
from multiprocessing import resource_tracker
from types import ModuleType
from typing import Any, TypeVar

from fpsolve import __version__
from fpsolve.arrays import is_whole, require, shown
from fpsolve.budget import Meter, watched
from fpsolve.errors import FpsolveError, WorkersDied

Item = TypeVar("Item")
Result = TypeVar("Result")
PROCESSORS = "FPSOLVE_PROCESSORS"
"""The environment variable that limits how many processors a process and its children use."""
SUBMITTED = 64
"""Least number of tasks that are submitted at once, so that no worker waits while the caller is busy with a result."""
START_SECONDS = 1.5
"""Seconds of work that this process does itself before it starts others, as their start takes as long."""
CONNECT_SECONDS = 20
"""Seconds after which a scheduler that does not answer, or that has no worker any more, is given up."""
LOOK_SECONDS = 1.0
"""Seconds after which one looks whether a scheduler has workers, as long as no result comes."""
MOST_JOBS = 1000
"""Largest number of processes on this machine; each needs an open file."""
_limits: list[int] = []
_of_worker = ExitStack()
"""What holds in a worker as long as it lives."""
ANEW = "what was finished is kept, and the same command goes on"
"""What is said where workers have died."""
STOPPED = "the scheduler has stopped; the same command goes on where this one stopped"
"""What is said where nobody gives tasks to workers any more."""


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
    """Let this process use at most so many processors from now on."""
    _limits[:] = [count]


@dataclass
class Pool:
    """Runs tasks on an executor of `concurrent.futures`; as a context it ends the workers.

    Attributes:
        start: makes the executor.
        stop: ends it, and the tasks that run there.
        size: how many tasks run at once.
        own_seconds: how long this process works before the executor is made; with inf it does all.
        has_workers: whether there are still workers, where they come and go.
        is_elsewhere: whether other machines work.
    """

    start: Callable[[], Executor]
    stop: Callable[[Executor], None] = lambda executor: executor.shutdown(cancel_futures=True)
    size: int = 1
    own_seconds: float = 0.0
    has_workers: Callable[[], bool] = lambda: True
    is_elsewhere: bool = False
    _executor: Any = field(default=None, init=False, repr=False)
    _waiting: dict[Future[Any], Any] = field(default_factory=dict, init=False, repr=False)

    def __enter__(self) -> Pool:
        return self

    def __exit__(self, *_: object) -> None:
        if self._executor is not None:
            executor, self._executor = self._executor, None
            self.stop(executor)

    def run(self, task: Callable[[Item], Result], items: Iterable[Item]) -> Iterator[tuple[Item, Result]]:
        """Each item with its result, as they come; an exception of a task is raised here, and ends the run.

        An item is taken when it can be given to a worker, as there may be many.

        Raises:
            WorkersDied: a worker has died, or none is left.
        """
        source, until = iter(items), time.monotonic() + self.own_seconds
        for item in source if self.own_seconds and self._executor is None else ():
            yield item, task(item)
            if time.monotonic() >= until:
                break
        waiting: dict[Future[Result], Item] = {}
        self._waiting = waiting
        try:
            while True:
                for item in islice(source, max(SUBMITTED, 2 * self.size) - len(waiting)):
                    waiting[self._submit(task, item)] = item
                if not waiting:
                    return
                for future in self._done(waiting):
                    yield waiting[future], future.result()
                    del waiting[future]
        except CancelledError:
            raise WorkersDied(STOPPED) from None
        except Exception as failure:
            if isinstance(failure, BrokenExecutor) or type(failure).__name__ == "KilledWorker":  # as Dask calls it
                raise WorkersDied(f"a worker has died, perhaps for lack of memory; {ANEW}") from None
            raise

    def rest(self) -> Iterator[tuple[Any, Any]]:
        """After an interrupt of `run` what the workers have: what is done, and what tasks on processes here end with.

        These are asked to end, and raise `KeyboardInterrupt` before their next factorisation; who catches it may give
        what is done by then. What is not begun, and what a cluster works on, is given up.
        """
        ending: Iterable[Future[Any]] = [future for future in self._waiting if future.done()]
        if isinstance(self._executor, Processes):
            self._executor.end.value = True
            ending = futures.as_completed([future for future in self._waiting if not future.cancel()])
        for future in ending:
            if not future.cancelled() and future.exception() is None:
                yield self._waiting[future], future.result()

    def _done(self, waiting: Iterable[Future[Result]]) -> set[Future[Result]]:
        """Those that are done first."""
        until = math.inf
        while not (found := futures.wait(waiting, LOOK_SECONDS, futures.FIRST_COMPLETED).done):
            until = math.inf if self.has_workers() else min(until, time.monotonic() + CONNECT_SECONDS)
            if time.monotonic() >= until:
                raise WorkersDied(f"no worker is left at the scheduler; {ANEW}")
        return found

    def _submit(self, task: Callable[[Item], Result], item: Item) -> Future[Result]:
        """Give a task to the executor."""
        try:
            with _for_workers():
                self._executor = self._executor or self.start()
                return self._executor.submit(task, item)
        except OSError as failure:
            reason = failure.strerror or failure
            raise FpsolveError(f"the processes cannot be started: {reason}; use fewer jobs") from failure


def parallel(count: int | None = None) -> Pool:
    """Processes of this machine, each of which is started when there is a task for it.

    Args:
        count: how many at most. None: one per processor, started after this process's first 1.5 s of work.

    Raises:
        TypeError: the count is no whole number.
        FpsolveError: it is not a number of processes.
    """
    known = f"a whole number from 1 to {MOST_JOBS}; leave it out for one process on each processor"
    require(count, int | None, "jobs", known)
    if count is not None and not is_whole(count, 1, MOST_JOBS):
        raise FpsolveError(f"jobs: got {shown(count)}; must be {known}")
    size = count or processors()
    return (
        Pool(partial(Processes, size), size=size, own_seconds=0.0 if count else START_SECONDS) if size > 1 else SERIAL
    )


def cluster(address: str) -> Pool:
    """The workers of a Dask scheduler, such as "tcp://host:8786", with this version of fpsolve and one thread each.

    Raises:
        FpsolveError: Dask is not installed, nothing answers, or the workers cannot run fpsolve.
    """
    client = _client(address)
    size = len(client.nthreads())
    client.close()

    def start() -> Any:
        nonlocal client
        client = _client(address)
        return client.get_executor(pure=False)

    def stop(executor: Any) -> None:
        executor.shutdown(wait=False)  # cancels what is not done
        client.close()

    def has_workers() -> bool:
        try:
            return bool(client.nthreads())
        except OSError:  # it stopped while it was asked
            raise WorkersDied(STOPPED) from None

    return Pool(start, stop, size, has_workers=has_workers, is_elsewhere=True)


def _client(address: str) -> Any:
    """A client of a scheduler whose workers have this version of fpsolve."""
    try:
        import distributed  # 240 ms, for a cluster alone
    except ImportError:
        raise FpsolveError("Dask is not installed; install it with: pip install 'fpsolve[cluster]'") from None
    for name in ("distributed", "distributed.client", "tornado.application"):  # they report workers that come and go
        logging.getLogger(name).setLevel(logging.CRITICAL)
    known = "an address such as tcp://host:8786"
    require(address, str, "scheduler", known)
    if not re.fullmatch(r"(tcp://)?[^/\s:]+:\d+", address):
        raise FpsolveError(f"scheduler: got {shown(address)}; must be {known}")
    connect: Any = distributed.Client
    try:
        client = connect(address, timeout=CONNECT_SECONDS, set_as_default=False)
    except OSError as failure:
        remedy = "start one with: dask scheduler"
        raise FpsolveError(f"no scheduler answers at {address} ({failure}); {remedy}") from failure
    try:
        versions, threads = {*client.run(_version).values()}, {*client.nthreads().values()}
    except Exception as failure:
        client.close()
        raise FpsolveError(f"the workers of {address} cannot run fpsolve: {failure}; install it there") from failure
    if versions == {__version__} and threads == {1}:
        return client
    client.close()
    found = f"fpsolve {', '.join(versions)} and up to {max(threads)} threads" if versions else "no workers"
    must = f"must be workers with fpsolve {__version__} and one thread each"
    remedy = f"start them with: dask worker {address} --nworkers -1 --nthreads 1"
    raise FpsolveError(f"scheduler: {address} has {found}; {must}; {remedy}")


def _version() -> str:
    """That of fpsolve in a worker, which uses one processor from now on."""
    limit_processors(1)
    return __version__


class Processes(futures.ProcessPoolExecutor):
    """New processes, in which nothing of this one is copied, neither its locks nor its threads.

    Attributes:
        end: memory that they share, true once they shall end what they do; without a lock, as they may be killed.
    """

    def __init__(self, count: int) -> None:
        context = multiprocessing.get_context("spawn")
        self.end: Any = context.RawValue("b", False)
        super().__init__(count, mp_context=context, initializer=_begin_worker, initargs=(self.end,))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes, and what they do."""
        for process in list((self._processes or {}).values()):
            process.kill()
        super().shutdown(wait, cancel_futures=cancel_futures)


SERIAL = Pool(partial(Processes, 1), own_seconds=math.inf)
"""This process alone, item by item."""


def _begin_worker(end: Any) -> None:
    """A worker has one processor, one share of the memory, and ends when what started it does, however that ends."""
    limit_processors(1)
    parent = multiprocessing.parent_process()

    def look(_: Meter) -> None:
        if end.value:
            raise KeyboardInterrupt

    def end_with_parent() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    _of_worker.enter_context(watched(look))
    threading.Thread(target=end_with_parent, daemon=True).start()


@contextmanager
def _for_workers() -> Iterator[None]:
    """Processes that are started in the body neither run the script of this one nor get Ctrl-C from a terminal.

    No task needs anything of the script, which `multiprocessing` looks for in `sys.modules` without an option that says
    otherwise.
    """
    main = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    if sys.platform != "win32":  # which has no masks
        resource_tracker.ensure_running()  # whose start would let signals through again
        before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        sys.modules["__main__"] = main
        if sys.platform != "win32":
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
