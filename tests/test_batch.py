"""Shards: through workers that fail, and drives that they register as one process does."""

from __future__ import annotations

import shutil
from collections import Counter, deque
from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from conftest import run
from drive import contents, same_frames
from xcalib import Rig
from xcalib.batch import (
    InThisProcess,
    Lost,
    OnExecutor,
    Outcome,
    Shard,
    Workers,
    register,
    run_shards,
)
from xcalib.batch.drive import Drive, ranges_of, shard_size
from xcalib.batch.workers import Gone
from xcalib.inputs import Inputs

# -- The engine, on workers that do as they are told -----------------------------------------------


@dataclass(frozen=True)
class Numbers(Shard):
    """Numbers to be counted."""

    first: int
    stop: int

    @staticmethod
    def of(first: int, stop: int) -> Numbers:
        return Numbers(f"{first}-{stop}", f"{first} to {stop}", first, stop)

    def halves(self) -> Sequence[Numbers]:
        middle = (self.first + self.stop) // 2
        both = (Numbers.of(self.first, middle), Numbers.of(middle, self.stop))
        return both if self.first < middle else ()

    def run(self) -> dict[str, Any]:
        return {"numbers": list(range(self.first, self.stop))}


class Told(Workers):
    """One worker after the other; ``ends`` says which numbers end the worker that has them."""

    is_shared_fate = True

    def __init__(
        self, ends: Collection[int] = (), full: Collection[str] = (), slots: int = 3
    ) -> None:
        self._ends, self._full, self._slots = set(ends), set(full), slots
        self._queue: deque[tuple[int, Numbers, str]] = deque()
        self.most = 0

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
        assert isinstance(shard, Numbers)
        names = [f"worker {index}" for index in range(self._slots)]
        worker = next(name for name in names if name not in avoid)
        self._queue.append((ticket, shard, worker))
        self.most = max(self.most, len(self._queue))

    def wait(self, seconds: float) -> list[tuple[int, Outcome | Gone]]:
        ticket, shard, worker = self._queue.popleft()
        if self._ends & set(range(shard.first, shard.stop)):
            others = [(other, Gone(is_blamed=True)) for other, _, _ in self._queue]
            self._queue.clear()
            return [(ticket, Gone(is_blamed=True)), *others]
        failure = "no space left" if worker in self._full else ""
        return [(ticket, Outcome(worker, 1.0, 0, {} if failure else shard.run(), failure))]


def counted(workers: Workers, shards: Iterator[Shard | None]) -> tuple[Counter[int], list[str]]:
    seen: Counter[int] = Counter()
    lost = []
    for shard, outcome in run_shards(shards, workers):
        if isinstance(outcome, Lost):
            lost.append(f"{shard.name}: {outcome.reason}")
        else:
            seen.update(outcome.result["numbers"])
    return seen, lost


def tens(count: int) -> Iterator[Shard]:
    return (Numbers.of(first, first + 10) for first in range(0, count, 10))


def test_each_shard_runs_once() -> None:
    workers = Told()
    seen, lost = counted(workers, tens(1000))
    assert seen == Counter(range(1000))
    assert not lost
    assert workers.most == 6  # not more than is needed to keep three busy


def test_what_ends_its_workers_is_found_and_left_out() -> None:
    seen, lost = counted(Told(ends={137, 404}), tens(1000))
    assert seen == Counter(set(range(1000)) - {137, 404})
    assert sorted(line.partition(":")[0] for line in lost) == ["137 to 138", "404 to 405"]


def test_a_worker_with_a_full_disk_is_avoided() -> None:
    seen, lost = counted(Told(full={"worker 0"}), tens(100))
    assert seen == Counter(range(100))
    assert not lost
    seen, lost = counted(Told(full={"worker 0", "worker 1", "worker 2"}, slots=4), tens(10))
    assert not seen
    assert lost == ["0 to 10: no space left (on worker 2, 3 times in all)"]


def test_shards_that_are_not_known_yet_are_waited_for() -> None:
    ended: list[str] = []

    def shards() -> Iterator[Shard | None]:
        yield Numbers.of(0, 10)
        while not ended:
            yield None
        yield Numbers.of(10, 20)

    for shard, _ in run_shards(shards(), Told()):
        ended.append(shard.name)
    assert ended == ["0 to 10", "10 to 20"]


class Slow(Told):
    """Whose first shard never ends, unless it is asked for a second time."""

    def wait(self, seconds: float) -> list[tuple[int, Outcome | Gone]]:
        if self._queue[0][0] == 1 and len(self._queue) > 1:
            self._queue.rotate(-1)
        if self._queue[0][0] == 1:
            return []
        return super().wait(seconds)


def test_a_slow_worker_does_not_hold_up_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("xcalib.batch.engine.PATIENCE", 0.0)
    monkeypatch.setattr("xcalib.batch.engine.SLOW", 0.0)
    seen, lost = counted(Slow(), tens(100))
    assert seen == Counter(range(100))
    assert not lost


def test_how_a_drive_is_cut() -> None:
    assert ranges_of([0, 1, 2, 5, 6, 7, 8, 9], 3) == [(0, 3), (5, 8), (8, 10)]
    assert shard_size(36_000, 2) == 250
    assert shard_size(1_000, 2) == 63
    assert shard_size(10, 1000) == 16
    assert shard_size(36_000, 1000, drives=1000) == 2500


# -- Drives ----------------------------------------------------------------------------------------


def arguments(scene: Path, *more: str | Path) -> tuple[str | Path, ...]:
    folders = (scene / "rig.yaml", scene / "visible", scene / "thermal")
    return ("register", *folders, "--depth", scene / "depth", *more)


@pytest.fixture(scope="session")
def registered(rendered: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What one process makes of `rendered`."""
    out = tmp_path_factory.mktemp("registered") / "out"
    assert run(*arguments(rendered, "-o", out)).exit_code == 0
    return out


def inputs(scene: Path) -> Inputs:
    return Inputs(scene / "visible", scene / "thermal", scene / "depth")


def test_shards_write_what_one_process_writes(
    rendered: Path, registered: Path, tmp_path: Path
) -> None:
    rig = Rig.load(rendered / "rig.yaml")
    with ThreadPoolExecutor(2) as executor:
        workers = OnExecutor(executor, 2)
        done = register(inputs(rendered), rig, tmp_path / "out", workers=workers, shard_frames=2)
        assert (done.frames, done.made, done.missing, done.left_out) == (6, 6, [], [])
        assert contents(tmp_path / "out") == contents(registered)
        again = register(inputs(rendered), rig, tmp_path / "out", workers=workers)
    assert again.summary() == "nothing to do: all 6 frames are there"
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(
        path.name for path in registered.iterdir()
    )


def test_either_goes_on_from_the_other(rendered: Path, registered: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(registered, out)
    lines = (out / "register.jsonl").read_text().splitlines(keepends=True)
    (out / "register.jsonl").write_text("".join(lines[:3]))  # two frames are noted
    result = run(*arguments(rendered, "-o", out, "--workers", 1))
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("6 frames (2 from before), ")
    assert contents(out) == contents(registered)
    result = run(*arguments(rendered, "-o", out))
    assert result.stdout.startswith("6 frames (6 from before), ")


def test_a_video_of_shards_is_that_of_one_process(rendered: Path, tmp_path: Path) -> None:
    assert run(*arguments(rendered, "-o", tmp_path / "one.mkv", "--overlay")).exit_code == 0
    rig = Rig.load(rendered / "rig.yaml")
    given = arguments(rendered, "-o", tmp_path / "two.mkv", "--overlay", "--workers", 1)
    assert run(*given).exit_code == 0
    for suffix in (".mkv", ".masks.mkv", ".overlay.mkv"):
        same_frames(tmp_path / f"one{suffix}", tmp_path / f"two{suffix}")
    done = register(inputs(rendered), rig, tmp_path / "three.mp4", shard_frames=2)
    assert done.made == 6
    assert sorted(path.name for path in tmp_path.glob("*three*")) == [
        "three.masks.mkv",
        "three.mp4",
        "three.mp4.register.jsonl",
    ]


def test_frames_that_cannot_be_decoded_are_left_out(scene: Path, tmp_path: Path) -> None:
    names = sorted(path.name for path in (scene / "thermal").iterdir())
    for name in (names[0], names[3]):
        (scene / "thermal" / name).write_bytes(b"nothing")
    result = run(*arguments(scene, "-o", tmp_path / "out", "--workers", 1))
    assert result.exit_code == 3, result.output
    assert "2 frames are left out: 000000 (" in result.stderr
    assert sorted(path.name for path in (tmp_path / "out").glob("*.png")) == sorted(
        {*names} - {names[0], names[3]}
    )
    again = run(*arguments(scene, "-o", tmp_path / "out", "--workers", 1))
    assert again.exit_code == 3
    assert again.stdout.startswith("6 frames (4 from before)")


def test_one_run_at_a_time(rendered: Path, tmp_path: Path) -> None:
    rig = Rig.load(rendered / "rig.yaml")
    drive = Drive(inputs(rendered), rig, tmp_path / "out", None, InThisProcess())
    result = run(*arguments(rendered, "-o", tmp_path / "out", "--workers", 1))
    assert result.exit_code == 2
    assert "another run is writing to this output" in result.stderr
    drive.close()
    assert not (tmp_path / "out").exists()
