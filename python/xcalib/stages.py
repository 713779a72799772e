"""Frames through stages that work at the same time, each on threads of its own.

numpy, OpenCV, FFmpeg, ONNX Runtime and the core let go of Python's lock while they compute, so
that threads are enough. A frame's place in a stage is a task that waits for the frame's task in
the stage before; a stage takes its tasks in the order of the frames. So a stage with one worker
sees the frames one by one and in order, and nothing can lock up: what is waited for never waits
for what comes later.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any


@dataclass
class Stage:
    """One step that every frame passes."""

    name: str
    run: Callable[[Any], Any]
    """From what the stage before returned to what the next one takes."""
    workers: int = 1
    """Threads; with one, frames come in order, which what remembers the last frame needs."""
    busy: float = field(default=0.0, init=False)
    """Time spent in `run` by all workers [s]."""
    _failure: BaseException | None = field(default=None, init=False)
    _lock: threading.Lock = field(default_factory=threading.Lock, init=False)

    def __call__(self, before: Future[Any] | None, item: Any) -> Any:
        """The task of one frame: ``item`` itself in the first stage, else what comes ``before``."""
        try:
            if self.workers == 1 and self._failure is not None:
                raise self._failure  # as one by one, nothing is done after a frame that failed
            value = item if before is None else before.result()
            start = time.perf_counter()
            try:
                return self.run(value)
            finally:
                with self._lock:
                    self.busy += time.perf_counter() - start
        except BaseException as error:
            self._failure = error
            raise


def stream(
    items: Iterable[Any], stages: Sequence[Stage], ahead: int = 0, overlapped: bool = True
) -> Generator[Any, None, None]:
    """What the last stage returns for each item, in the order of the items.

    Take it ``with contextlib.closing(stream(...))``: an error in the loop over it then ends it too.
    An error in a stage ends all of them: tasks that have begun are waited for, the others dropped,
    and no thread is left. Of several errors that of the earliest frame is raised; no frame after it
    gets past a stage with one worker.

    Parameters
    ----------
    items
        Taken as there is room for them.
    stages
        In order; each is for one stream.
    ahead
        Frames under way at most, which bounds the memory; 0 means two more than workers.
    overlapped
        False: the same on one thread, frame after frame and stage after stage.
    """
    if overlapped:
        pools = [ThreadPoolExecutor(stage.workers, stage.name) for stage in stages]
        ahead = ahead or sum(stage.workers for stage in stages) + 2
    else:
        pools = [ThreadPoolExecutor(1, "stages")] * len(stages)
        ahead = 1
    under_way: deque[Future[Any]] = deque()
    try:
        for item in items:
            before: Future[Any] | None = None
            for stage, pool in zip(stages, pools, strict=True):
                before = pool.submit(stage, before, None if before else item)
            assert before is not None
            under_way.append(before)
            del before  # the frame's memory is the stages', not ours
            if len(under_way) >= ahead:
                yield under_way.popleft().result()
        while under_way:
            yield under_way.popleft().result()
    finally:
        for pool in pools:
            pool.shutdown(wait=False, cancel_futures=True)
        for pool in pools:
            pool.shutdown()


def busy_shares(stages: Sequence[Stage], elapsed: float) -> dict[str, float]:
    """Share of the time that stages were at work, [0, 1], by name; the busiest of one name.

    A stage near 1 is the one that the others wait for.
    """
    shares: dict[str, float] = {}
    for stage in stages:
        share = stage.busy / max(elapsed * stage.workers, 1e-9)
        shares[stage.name] = max(shares.get(stage.name, 0.0), min(share, 1.0))
    return shares
