"""A thousand workers and ten million frames, simulated: what the manifest does when things fail.

The engine is the real one; workers and clock are simulated. Times of shards are drawn about what
was measured, workers die and come back, some are slow, one has a full disk, frames are poisoned,
and the driver itself is killed a few times and started again from the manifest alone. In the end
every frame is noted once, or left out and named.
"""

import argparse
import heapq
import json
import math
import random
import time
from collections import Counter
from dataclasses import dataclass
from typing import Any

from common import machine
from figures import figure

from xcalib.batch import Lost, Outcome, Shard, Workers, engine, run_shards
from xcalib.batch.drive import ranges_of
from xcalib.batch.workers import Gone


@dataclass(frozen=True)
class Frames(Shard):
    """Frames that are only counted."""

    first: int
    stop: int

    def halves(self):
        middle = (self.first + self.stop) // 2
        return () if middle == self.first else (of(self.first, middle), of(middle, self.stop))


def of(first: int, stop: int) -> Frames:
    return Frames(str(first), f"{first} to {stop}", first, stop)


class Killed(Exception):
    """The driver's own end."""


class Simulated(Workers):
    """Workers whose clock is that of the simulation."""

    def __init__(self, given: argparse.Namespace, rng: random.Random, clock: list[float]) -> None:
        self.given, self.rng, self.clock = given, rng, clock
        self.idle = list(range(given.workers))
        self.queue: list[tuple[int, Frames]] = []
        self.events: list[tuple[float, int, int, Frames, Any]] = []
        self.busy = 0.0
        self.wasted = 0.0
        self.driver = 0.0
        self.ends: float = math.inf
        self.count = 0

    @property
    def slots(self) -> int:
        return self.given.workers

    def submit(self, ticket, shard, avoid=(), beside=()) -> None:
        self.driver += self.given.overhead / 1e3
        self.queue.append((ticket, shard))
        self._start()

    def _start(self) -> None:
        while self.queue and self.idle:
            ticket, shard = self.queue.pop(0)
            worker = self.idle.pop(self.rng.randrange(len(self.idle)))
            n = shard.stop - shard.first
            seconds = n / self.given.speed * self.rng.lognormvariate(0, self.given.spread)
            if worker < self.given.slow * self.given.workers:
                seconds *= 10
            poison = any(frame in self.given.poison for frame in range(shard.first, shard.stop))
            result: Any = None
            if poison:
                seconds *= self.rng.random()
                result = Gone(is_blamed=True)
            elif worker == self.given.workers - 1:
                result = Outcome("full", seconds, 0, {}, "no space left on device")
            elif self.rng.random() > math.exp(-seconds / (3600 * self.given.mtbf)):
                seconds *= self.rng.random()
                result = Gone(is_blamed=False)
            else:
                result = Outcome(str(worker), seconds, 0, {})
            self.count += 1
            end = self.clock[0] + seconds
            back = end + (self.given.restart if isinstance(result, Gone) else 0)
            heapq.heappush(self.events, (end, self.count, ticket, shard, result))
            heapq.heappush(self.events, (back, -self.count, worker, shard, None))
            self.busy += seconds
            if not isinstance(result, Outcome) or result.failure:
                self.wasted += seconds

    def wait(self, seconds: float):
        limit = self.clock[0] + seconds
        while self.events:
            end, order, number, _, result = self.events[0]
            if end > self.ends:
                self.clock[0] = self.ends
                raise Killed
            if order > 0 or end <= limit:
                heapq.heappop(self.events)
                self.clock[0] = max(self.clock[0], end)
            else:
                break
            if order < 0:
                self.idle.append(number)
                self._start()
                continue
            return [(number, result)]
        self.clock[0] = limit
        return []


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=10_000_000)
    parser.add_argument("--shard", type=int, default=250)
    parser.add_argument("--workers", type=int, default=1000)
    parser.add_argument("--speed", type=float, default=80.0, help="of a worker [frames/s]")
    parser.add_argument("--spread", type=float, default=0.2, help="of the logarithm of its times")
    parser.add_argument("--overhead", type=float, default=3.0, help="of a shard [ms]")
    parser.add_argument("--mtbf", type=float, default=24.0, help="of a worker [h]")
    parser.add_argument("--restart", type=float, default=30.0, help="of a worker [s]")
    parser.add_argument(
        "--slow", type=float, default=0.01, help="share of workers, ten times slower"
    )
    parser.add_argument("--poisoned", type=int, default=5, help="frames that end their worker")
    parser.add_argument("--kills", type=int, default=3, help="of the driver")
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    print(machine())
    rng = random.Random(given.seed)
    given.poison = set(rng.sample(range(given.frames), given.poisoned))
    clock = [0.0]
    engine.time = type("Clock", (), {"monotonic": staticmethod(lambda: clock[0])})
    ideal = given.frames / given.speed / given.workers
    done = bytearray(given.frames)
    lost: Counter[int] = Counter()
    lines = written = shards_run = 0
    workers = Simulated(given, rng, clock)
    real = time.perf_counter()
    for kill in range(given.kills + 1):
        workers.ends = clock[0] + ideal / (given.kills + 1) if kill < given.kills else math.inf
        missing = [i for i, count in enumerate(done) if not count and i not in lost]
        shards = (of(first, stop) for first, stop in ranges_of(missing, given.shard))
        try:
            for shard, outcome in run_shards(shards, workers):
                shards_run += 1
                if isinstance(outcome, Lost):
                    for frame in range(shard.first, shard.stop):
                        lost[frame] += 1
                    continue
                for frame in range(shard.first, shard.stop):
                    done[frame] += 1
                lines += shard.stop - shard.first
                written += len(json.dumps({"frames": {"0" * 16: 100000}, "files": {"0.png": 9}}))
        except Killed:
            # What ran at that moment is done again; half of it was done, on average.
            workers.wasted += sum(e[1] > 0 for e in workers.events) * given.shard / given.speed / 2
            workers.events, workers.queue = [], []
            workers.idle = list(range(given.workers))
            clock[0] += given.restart
    real = time.perf_counter() - real
    once = sum(count == 1 for count in done)
    assert all(count <= 1 for count in done), "a frame was noted twice"
    assert once + len(lost) == given.frames, "a frame is nowhere"
    assert set(lost) <= given.poison, lost
    figure("frames noted once", once, "frames")
    figure("frames left out, each named", len(lost), "frames", target=f"<= {given.poisoned}")
    figure("units noted", lines, "lines")
    figure("time", clock[0] / 60, "min")
    figure("time without any failure", ideal / 60, "min")
    figure("work that was done in vain", 100 * workers.wasted / workers.busy, "%")
    figure("driver and scheduler busy", 100 * workers.driver / clock[0], "%")
    figure("shards run", shards_run, "shards")
    figure("the engine's own time", 1e3 * real / shards_run, "ms a shard")


if __name__ == "__main__":
    main()
