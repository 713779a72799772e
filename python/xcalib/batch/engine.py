"""Shards through workers: so many at a time, each until it is done or given up.

A worker that ends takes nothing with it but time: its shard runs again elsewhere. A shard that ends
its workers is cut in halves until the frame that does it is alone, and that one is left out.
"""

from __future__ import annotations

import statistics
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from .shard import Outcome, Shard
from .workers import Gone, Workers, WorkersGone

FAILURES = 3
"""After which a shard is given up."""
LOSSES = 2
"""Workers that a shard may take with it before it is cut in halves."""
AHEAD = 2
"""Shards that are at the workers for each that runs: the next one waits there already, and what the
scheduler holds does not grow with the work."""
SLOW = 4.0
"""A shard that takes so many times the median is run a second time where a worker has nothing else
to do."""
PATIENCE = 10.0
"""Below which no shard is slow [s]."""
LOOK = 0.5
"""How long to wait before looking at what runs [s]."""


@dataclass(frozen=True)
class Lost:
    """A shard that was given up."""

    reason: str
    is_input: bool = False
    """Whether it fails for what the user gave: trying again would not do."""


@dataclass
class _Tried:
    """A shard under way, with what became of it so far."""

    shard: Shard
    failures: int = 0
    losses: int = 0
    avoid: set[str] = field(default_factory=set)
    tickets: set[int] = field(default_factory=set)
    since: float = 0.0
    is_over: bool = False


def run_shards(
    shards: Iterable[Shard | None], workers: Workers
) -> Iterator[tuple[Shard, Outcome | Lost]]:
    """Run shards and hand each back with its outcome, in the order in which they end.

    The shards are taken one by one as workers become free; None in place of one: what comes next
    is not known before others have ended. Of a shard that was cut the parts come back.

    Raises
    ------
    WorkersGone
        No worker is left.
    """
    run = _Run(iter(shards), workers)
    while run.fill():
        yield from run.finished()


class _Run:
    def __init__(self, shards: Iterator[Shard | None], workers: Workers) -> None:
        self._shards = shards
        self._workers = workers
        self._again: deque[_Tried] = deque()
        self._under_way: dict[int, _Tried] = {}
        self._tickets = 0
        self._seconds: list[float] = []
        self._is_out = False

    def fill(self) -> bool:
        """Keep the workers busy; False where all is done."""
        most = AHEAD * max(self._workers.slots, 1)
        while len(self._under_way) < most:
            if self._again and self._is_suspect(self._again[0]) and self._under_way:
                break  # it runs alone, so that it takes no other with it
            tried = self._next()
            if tried is None:
                break
            self._submit(tried)
            if self._is_suspect(tried):
                break
        if len(self._under_way) < most and self._is_out and not self._again:
            self._double()
        return bool(self._under_way) or not self._is_out

    def _is_suspect(self, tried: _Tried) -> bool:
        return self._workers.is_shared_fate and tried.losses > 0

    def _next(self) -> _Tried | None:
        if self._again:
            return self._again.popleft()
        alone = self._workers.is_shared_fate
        if alone and any(map(self._is_suspect, self._under_way.values())):
            return None
        try:
            shard = next(self._shards)
        except StopIteration:
            self._is_out = True
            return None
        return None if shard is None else _Tried(shard)

    def _submit(self, tried: _Tried) -> None:
        self._tickets += 1
        beside = list(tried.tickets)
        tried.tickets.add(self._tickets)
        tried.since = time.monotonic()
        self._under_way[self._tickets] = tried
        self._workers.submit(self._tickets, tried.shard, tried.avoid, beside)

    def _double(self) -> None:
        """Run the slowest shard a second time; whichever ends first counts."""
        if not self._seconds:
            return
        limit = max(PATIENCE, SLOW * statistics.median(self._seconds))
        single = [tried for tried in self._under_way.values() if len(tried.tickets) == 1]
        slowest = min(single, key=lambda tried: tried.since, default=None)
        if slowest is not None and time.monotonic() - slowest.since > limit:
            self._submit(slowest)

    def finished(self) -> Iterator[tuple[Shard, Outcome | Lost]]:
        for ticket, outcome in self._workers.wait(LOOK):
            tried = self._under_way.pop(ticket, None)
            if tried is None:
                continue
            tried.tickets.discard(ticket)
            if tried.is_over:
                continue
            result = self._judged(tried, outcome)
            if result is None:
                continue
            self._end(tried)
            yield tried.shard, result

    def _end(self, tried: _Tried) -> None:
        """What still runs of it is of no interest any more."""
        tried.is_over = True
        for ticket in tried.tickets:
            self._under_way.pop(ticket, None)

    def _judged(self, tried: _Tried, outcome: Outcome | Gone) -> Outcome | Lost | None:
        """The end of a shard, or None where it is to run again."""
        if isinstance(outcome, Gone):
            tried.losses += outcome.is_blamed
            if tried.losses >= LOSSES:
                parts = tried.shard.halves()
                if not parts:
                    return Lost("the worker that ran it ended, each time")
                self._again.extend(_Tried(part, losses=1) for part in parts)
                self._end(tried)
                return None
        elif not outcome.failure:
            self._seconds.append(outcome.seconds)
            del self._seconds[:-100]
            return outcome
        elif outcome.is_input:
            return Lost(outcome.failure, is_input=True)
        else:
            tried.failures += 1
            tried.avoid.add(outcome.worker)
            if tried.failures >= FAILURES:
                return Lost(f"{outcome.failure} (on {outcome.worker}, {FAILURES} times in all)")
        if not tried.tickets:
            self._again.append(tried)
        return None


__all__ = ["Lost", "WorkersGone", "run_shards"]
