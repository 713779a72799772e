"""Where shards run: in this process, on an executor of the standard library, on a cluster."""

from __future__ import annotations

import contextlib
import ctypes
import multiprocessing
import os
import queue
import signal
from collections.abc import Collection, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from dataclasses import dataclass

from .._core import InputError
from .shard import Outcome, Shard, run_shard


@dataclass(frozen=True)
class Gone:
    """The worker of a shard went before the shard was done."""

    is_blamed: bool
    """Whether the shard may be why."""


Done = tuple[int, Outcome | Gone]
"""The ticket of a shard that was submitted, and what came of it."""


def drained(done: queue.SimpleQueue[Done], seconds: float) -> list[Done]:
    """What a queue has: waited for, this long at the most, where it has nothing yet."""
    found = []
    with contextlib.suppress(queue.Empty):
        found.append(done.get(timeout=seconds))
        while True:
            found.append(done.get_nowait())
    return found


class WorkersGone(RuntimeError):
    """No worker is left, and none came back."""


class Workers:
    """Takes shards and hands back outcomes, in any order."""

    is_shared_fate = False
    """Whether one process that ends takes the shards of the others with it."""

    @property
    def slots(self) -> int:
        """Shards that run at the same time."""
        return 1

    def submit(
        self,
        ticket: int,
        shard: Shard,
        avoid: Collection[str] = (),
        beside: Collection[int] = (),
    ) -> None:
        """Have a shard run, by a worker that is none of those to avoid and runs no shard of the
        tickets beside it, if there is one. May raise `WorkersGone`.
        """
        raise NotImplementedError

    def wait(self, seconds: float) -> list[Done]:
        """What is done, after this time at the latest."""
        raise NotImplementedError

    def close(self) -> None:
        """Let go of what was opened; what still runs is not waited for."""


class InThisProcess(Workers):
    """One shard after the other, here."""

    def __init__(self) -> None:
        self._waiting: list[tuple[int, Shard]] = []

    def submit(
        self,
        ticket: int,
        shard: Shard,
        avoid: Collection[str] = (),
        beside: Collection[int] = (),
    ) -> None:
        self._waiting.append((ticket, shard))

    def wait(self, seconds: float) -> list[Done]:
        return [(t, run_shard(shard)) for t, shard in self._waiting[:1] if self._waiting.pop(0)]


class OnExecutor(Workers):
    """Any `concurrent.futures.Executor`, which stays its caller's to shut down.

    Parameters
    ----------
    executor
        Of processes or of machines; a shard holds the interpreter seldom, so that threads do too.
    slots
        How many of its workers to keep busy.
    """

    is_shared_fate = True

    def __init__(self, executor: Executor, slots: int) -> None:
        self._executor = executor
        self._slots = slots
        self._done: queue.SimpleQueue[Done] = queue.SimpleQueue()

    @property
    def slots(self) -> int:
        return self._slots

    def submit(
        self,
        ticket: int,
        shard: Shard,
        avoid: Collection[str] = (),
        beside: Collection[int] = (),
    ) -> None:
        try:
            future = self._executor.submit(run_shard, shard)
        except BrokenExecutor:
            self.renew()
            future = self._executor.submit(run_shard, shard)

        def note(ended: Future[Outcome]) -> None:
            if ended.cancelled():
                self._done.put((ticket, Gone(is_blamed=False)))
                return
            error = ended.exception()
            if error is None:
                self._done.put((ticket, ended.result()))
            elif isinstance(error, BrokenExecutor):
                self._done.put((ticket, Gone(is_blamed=True)))
            else:  # it did not get as far as to run
                failure = f"{type(error).__name__}: {error}"
                self._done.put((ticket, Outcome("?", 0.0, 0, {}, failure)))

        future.add_done_callback(note)

    def renew(self) -> None:
        """Replace an executor that broke."""
        raise WorkersGone("a worker of the executor ended, and the executor takes no more work")

    def wait(self, seconds: float) -> list[Done]:
        return drained(self._done, seconds)


class LocalProcesses(OnExecutor):
    """Processes of this machine; where one ends, all are started anew."""

    def __init__(self, count: int) -> None:
        super().__init__(_processes(count), count)

    def renew(self) -> None:
        self._executor.shutdown(wait=False)
        self._executor = _processes(self.slots)

    def close(self) -> None:
        processes = list((getattr(self._executor, "_processes", None) or {}).values())
        self._executor.shutdown(wait=False, cancel_futures=True)
        for process in processes:
            process.terminate()


def _processes(count: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(
        count, mp_context=multiprocessing.get_context("spawn"), initializer=_begin_process
    )


def _begin_process() -> None:
    """Leave interrupts to the parent, and end when it does, whatever ended it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


@contextlib.contextmanager
def open_workers(scheduler: str | None = None, count: int = 0) -> Iterator[Workers]:
    """The workers that ``--scheduler`` or ``--workers`` ask for; else this process."""
    workers: Workers
    if scheduler and count:
        raise InputError("--scheduler has workers of its own, expected no --workers with it")
    if scheduler:
        from .dask import DaskWorkers  # an extra

        workers = DaskWorkers(scheduler, quiet=True)
    else:
        workers = LocalProcesses(count) if count > 1 else InThisProcess()
    try:
        yield workers
    finally:
        workers.close()


def threads_of(workers: Workers, asked: int) -> int:
    """Native threads of one shard: as asked; else this machine's shared, and one on a cluster."""
    if asked:
        return asked
    if isinstance(workers, InThisProcess):
        return 0
    cores = len(os.sched_getaffinity(0))
    return max(1, cores // workers.slots) if isinstance(workers, OnExecutor) else 1
