"""Workers of a Dask cluster: the extra ``xcalib-rgbt[dask]``."""

from __future__ import annotations

import contextlib
import importlib
import logging
import queue
import time
import uuid
from collections.abc import Collection
from typing import Any

from .._core import InputError
from .shard import VERSION, Outcome, Shard, run_shard
from .workers import Done, Gone, Workers, WorkersGone, drained

ANSWER = 6.0
"""For a scheduler to answer, and for a worker to be there [s]."""
RETURN = 60.0
"""For both to come back after they were lost [s]."""
COUNT_EVERY = 1.0
"""How old the number of workers may be [s]."""


class DaskWorkers(Workers):
    """The workers of a scheduler, ``tcp://host:port``.

    Parameters
    ----------
    quiet
        Whether to keep the package from logging what connections it has lost.

    Raises
    ------
    InputError
        It does not answer, has no worker, or has workers that are not ours.
    """

    def __init__(self, address: str, quiet: bool = False) -> None:
        try:
            self._distributed = importlib.import_module("distributed")
        except ImportError:
            raise InputError(
                f"--scheduler {address}: the package distributed is missing, expected"
                " `pip install xcalib-rgbt[dask]`"
            ) from None
        if quiet:
            hush()
        self._address = address
        self._done: queue.SimpleQueue[Done] = queue.SimpleQueue()
        self._futures: dict[int, Any] = {}
        self._slots, self._counted = 0, -COUNT_EVERY
        try:
            self._client = self._connected(ANSWER)
        except (OSError, ValueError) as error:
            raise InputError(
                f"--scheduler {address}: no Dask scheduler answers ({_brief(error)}); expected the"
                " address that `dask scheduler` prints, tcp://HOST:PORT"
            ) from None
        try:
            if not self._await_worker(ANSWER):
                raise InputError(
                    f"--scheduler {address}: it has no worker, expected `dask worker {address}` on"
                    " the machines that are to work"
                )
            self._check_workers()
        except BaseException:
            self.close()
            raise

    def _connected(self, seconds: float) -> Any:
        return self._distributed.Client(
            self._address, timeout=seconds, set_as_default=False, name="xcalib"
        )

    def _await_worker(self, seconds: float) -> bool:
        end = time.monotonic() + seconds
        while True:
            self._counted = -COUNT_EVERY
            if self.slots or time.monotonic() > end:
                return self._slots > 0
            time.sleep(0.1)

    def _check_workers(self) -> None:
        """Refuse workers that lack the package, or have another version of it."""
        for worker, found in self._client.run(_version, on_error="return").items():
            if isinstance(found, BaseException):
                raise InputError(
                    f"worker {worker} cannot import xcalib ({_brief(found)}); expected xcalib-rgbt"
                    f" {VERSION} on all workers"
                )
            if found != VERSION:
                raise InputError(
                    f"worker {worker} has xcalib {found}, expected {VERSION} as here, on all"
                    " workers"
                )

    @property
    def slots(self) -> int:
        now = time.monotonic()
        if now > self._counted + COUNT_EVERY:
            self._counted = now
            self._slots = 0
            if self._client.status == "running":
                with contextlib.suppress(Exception):  # the connection is lost at this moment
                    self._slots = sum(self._client.nthreads().values())
        return self._slots

    def submit(
        self,
        ticket: int,
        shard: Shard,
        avoid: Collection[str] = (),
        beside: Collection[int] = (),
    ) -> None:
        if self._client.status != "running":
            self._reconnect()
        others = self._others(avoid, beside) if avoid or beside else []
        future = self._client.submit(
            run_shard,
            shard,
            key=f"xcalib-{shard.id}-{uuid.uuid4().hex[:8]}",
            pure=False,
            workers=others or None,
            # Strictly: a worker that fails at once is idle, and would steal it back.
            allow_other_workers=False,
        )
        self._futures[ticket] = future
        future.add_done_callback(lambda ended: self._note(ticket, ended))

    def _others(self, avoid: Collection[str], beside: Collection[int]) -> list[str]:
        keys = {self._futures[ticket].key for ticket in beside if ticket in self._futures}
        at_it = {w for w, running in self._client.processing().items() if keys & set(running)}
        return [w for w in self._client.nthreads() if w not in at_it and w not in avoid]

    def _note(self, ticket: int, future: Any) -> None:
        outcome: Outcome | Gone = Gone(is_blamed=False)
        try:
            if future.status == "finished":
                outcome = future.result(timeout=ANSWER)
            elif future.status == "error":
                error = future.exception(timeout=ANSWER)
                if type(error).__name__ == "KilledWorker":
                    outcome = Gone(is_blamed=True)
                else:  # it did not get as far as to run
                    outcome = Outcome("?", 0.0, 0, {}, f"{type(error).__name__}: {_brief(error)}")
        except Exception:  # the scheduler went between the two
            outcome = Gone(is_blamed=False)
        self._done.put((ticket, outcome))

    def _reconnect(self) -> None:
        """To a scheduler that was started again, which knows of nothing that ran."""
        end = time.monotonic() + RETURN
        lost, self._futures = self._futures, {}
        while time.monotonic() < end:
            with contextlib.suppress(Exception):
                self._client.close(timeout=1)
            try:
                self._client = self._connected(2.0)
            except (OSError, ValueError):
                time.sleep(0.2)
                continue
            if self._await_worker(end - time.monotonic()):
                for ticket in lost:
                    self._done.put((ticket, Gone(is_blamed=False)))
                return
        raise WorkersGone(f"{self._address}: no scheduler with workers came back in {RETURN:.0f} s")

    def wait(self, seconds: float) -> list[Done]:
        done = drained(self._done, seconds)
        for ticket, _ in done:
            self._futures.pop(ticket, None)  # the scheduler forgets it then
        if not done and self._client.status != "running":
            self._reconnect()
        elif not done and not self.slots and not self._await_worker(RETURN):
            raise WorkersGone(f"{self._address}: no worker came back in {RETURN:.0f} s")
        return done

    def close(self) -> None:
        with contextlib.suppress(Exception):
            self._client.cancel(list(self._futures.values()), force=True)
        with contextlib.suppress(Exception):
            self._client.close(timeout=2)


def hush() -> None:
    """Keep the package from printing lines of its own between ours."""
    for name in list(logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL)


def _version() -> str:
    """What a worker is asked for before it gets work."""
    return VERSION


def _brief(error: BaseException) -> str:
    return " ".join(str(error).split())[:200] or type(error).__name__
