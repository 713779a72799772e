"""Shards on a Dask cluster whose parts fail; the long cases are those of `make test-cluster`."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from cluster import Cluster, open_cluster
from drive import arguments, contents
from xcalib.batch.dask import DaskWorkers
from xcalib.frames import InputError

pytest.importorskip("distributed")
long = pytest.mark.skipif(not os.environ.get("XCALIB_CLUSTER"), reason="of `make test-cluster`")


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    (tmp_path / "cluster").mkdir()
    with open_cluster(tmp_path / "cluster") as opened:
        yield opened


@pytest.fixture(scope="module")
def registered(drive: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """What one process writes of the drive."""
    out = tmp_path_factory.mktemp("registered") / "out"
    subprocess.run([sys.executable, "-m", "xcalib", *arguments(drive, out)], check=True)
    return contents(out)


class Run:
    """A registration on a cluster, under way."""

    def __init__(self, cluster: Cluster, drive: Path, out: Path, *more: str) -> None:
        self.out = out
        given = arguments(drive, out, "--scheduler", cluster.address, "--quiet", *more)
        self.process = subprocess.Popen(
            [sys.executable, "-m", "xcalib", *given],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def await_frames(self, count: int) -> None:
        """Until so many frames are noted; fails if the run is over before."""
        await_notes(self.process, self.out, count)

    def end(self, code: int = 0) -> tuple[str, str]:
        out, err = self.process.communicate(timeout=240)
        assert self.process.returncode == code, out + err
        return out, err


def await_notes(process: subprocess.Popen[str], out: Path, count: int) -> None:
    journal = out / "register.jsonl"
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        assert process.poll() is None, process.communicate()
        if journal.is_file() and journal.read_text().count('"files"') > count:
            return
        time.sleep(0.01)
    raise TimeoutError(out)


def frames_noted(out: Path) -> list[str]:
    """Names of the images that the journal notes, as often as it does."""
    found = re.findall(r'"(\d+)\.png":', (out / "register.jsonl").read_text())
    deadline = time.monotonic() + 30
    while (out / ".attempts").exists():  # until the last worker has noticed
        assert time.monotonic() < deadline
        time.sleep(0.1)
    return sorted(found)


def test_a_worker_that_is_killed(
    cluster: Cluster, drive: Path, registered: dict[str, bytes], tmp_path: Path
) -> None:
    run = Run(cluster, drive, tmp_path / "out")
    run.await_frames(0)
    cluster.end(cluster.workers[0])
    out, _ = run.end()
    assert out.startswith("120 frames, ")
    assert contents(tmp_path / "out") == registered
    assert frames_noted(tmp_path / "out") == [f"{index:04d}" for index in range(120)]
    out, _ = Run(cluster, drive, tmp_path / "out").end()
    assert out.startswith("nothing to do: all 120 frames are there")


@long
def test_a_process_that_is_killed(
    drive: Path, registered: dict[str, bytes], tmp_path: Path
) -> None:
    command = [sys.executable, "-m", "xcalib", *arguments(drive, tmp_path / "out")]
    process = subprocess.Popen([*command, "--workers", "2"], stdout=subprocess.PIPE, text=True)
    await_notes(process, tmp_path / "out", 0)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    workers = [
        pid for pid in children if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()
    ]
    assert len(workers) == 2
    os.kill(int(workers[0]), signal.SIGKILL)
    out, _ = process.communicate(timeout=240)
    assert process.returncode == 0
    assert out.startswith("120 frames, ")
    assert contents(tmp_path / "out") == registered


@long
def test_a_scheduler_that_is_started_again(
    cluster: Cluster, drive: Path, registered: dict[str, bytes], tmp_path: Path
) -> None:
    run = Run(cluster, drive, tmp_path / "out")
    run.await_frames(0)
    cluster.end(cluster.scheduler)
    for worker in cluster.workers:
        cluster.end(worker)
    cluster.start_scheduler()
    cluster.start_worker()
    out, _ = run.end()
    assert out.startswith("120 frames, ")
    assert contents(tmp_path / "out") == registered
    assert frames_noted(tmp_path / "out") == [f"{index:04d}" for index in range(120)]


@long
def test_a_scheduler_that_stays_away(
    cluster: Cluster, drive: Path, registered: dict[str, bytes], tmp_path: Path
) -> None:
    run = Run(cluster, drive, tmp_path / "out")
    run.await_frames(0)
    cluster.end(cluster.scheduler)
    _, err = run.end(1)
    told = re.search(r"came back in 60 s; (\d+) of 120 frames are done, the same command", err)
    assert told and err.count("\n") == 1, err
    assert len(frames_noted(tmp_path / "out")) == int(told[1])
    cluster.start_scheduler()
    cluster.start_worker()
    out, _ = Run(cluster, drive, tmp_path / "out").end()
    assert out.startswith(f"120 frames ({told[1]} from before), ")
    assert contents(tmp_path / "out") == registered


@long
def test_a_frame_that_cannot_be_decoded(
    cluster: Cluster, drive: Path, registered: dict[str, bytes], tmp_path: Path
) -> None:
    spoiled = Path(shutil.copytree(drive, tmp_path / "spoiled"))
    for name in ("0000", "0047", "0048"):
        (spoiled / "thermal" / f"{name}.png").write_bytes(b"nothing")
    run = Run(cluster, spoiled, tmp_path / "out")
    _, err = run.end(3)
    assert "3 frames are left out: 0000 (" in err or "3 frames are left out: 0047 (" in err
    assert err.count("\n") == 1
    gone = {f"{folder}{name}.png" for name in ("0000", "0047", "0048") for folder in ("", "masks/")}
    assert contents(tmp_path / "out") == {
        name: data for name, data in registered.items() if name not in gone
    }


@long
def test_a_worker_that_stands_still(
    cluster: Cluster, drive: Path, registered: dict[str, bytes], tmp_path: Path
) -> None:
    run = Run(cluster, drive, tmp_path / "out")
    run.await_frames(0)
    cluster.workers[0].send_signal(signal.SIGSTOP)
    out, _ = run.end()
    assert out.startswith("120 frames, ")
    assert contents(tmp_path / "out") == registered
    cluster.workers[0].send_signal(signal.SIGCONT)
    time.sleep(3)  # what it still writes changes nothing
    assert contents(tmp_path / "out") == registered
    assert frames_noted(tmp_path / "out") == [f"{index:04d}" for index in range(120)]


@long
def test_a_worker_whose_disk_is_full(
    drive: Path, registered: dict[str, bytes], tmp_path: Path
) -> None:
    (tmp_path / "cluster").mkdir()
    with open_cluster(tmp_path / "cluster", workers=0) as cluster:
        # No file of over 4 KiB, in place of a disk without room.
        limited = ("bash", "-c", 'ulimit -f 4; exec "$@" > /dev/null 2>&1', "bash")
        cluster.start_worker(prefix=limited)
        cluster.start_worker()
        out, _ = Run(cluster, drive, tmp_path / "out").end()
        assert out.startswith("120 frames, ")
        assert contents(tmp_path / "out") == registered
        cluster.end(cluster.workers[1])
        _, err = Run(cluster, drive, tmp_path / "other").end(1)
        assert "120 frames are missing: " in err and "File too large" in err
        assert "the same command tries again" in err
        assert contents(tmp_path / "other") == {}


@long
def test_a_driver_that_is_killed(
    cluster: Cluster, drive: Path, registered: dict[str, bytes], tmp_path: Path
) -> None:
    run = Run(cluster, drive, tmp_path / "out")
    run.await_frames(20)
    run.process.kill()
    run.process.communicate()
    out, _ = Run(cluster, drive, tmp_path / "out").end()
    assert re.match(r"120 frames \(\d+ from before\), ", out), out
    assert contents(tmp_path / "out") == registered
    interrupted = Run(cluster, drive, tmp_path / "again")
    interrupted.await_frames(0)
    interrupted.process.send_signal(signal.SIGTERM)
    _, err = interrupted.end(1)
    assert re.search(r"interrupted; \d+ of 120 frames are done, the same command goes on", err)
    frames_noted(tmp_path / "again")


def has_older(address: str) -> bool:
    """Whether a worker of another version is there already."""
    try:
        DaskWorkers(address).close()
    except InputError as error:
        return "0.0.1" in str(error)
    return False


@long
def test_workers_that_are_not_ours(
    refused: Callable[..., str],
    drive: Path,
    tmp_path: Path,
    tmp_path_factory: pytest.TempPathFactory,
) -> None:
    folder = tmp_path_factory.mktemp("cluster")
    older = folder / "older.py"
    older.write_text("from xcalib.batch import shard\nshard.VERSION = '0.0.1'\n"
                     "from xcalib.batch import dask\ndask.VERSION = '0.0.1'\n")  # fmt: skip
    with open_cluster(folder, workers=0) as cluster:
        given = arguments(drive, tmp_path / "out", "--scheduler", cluster.address)
        assert "it has no worker, expected `dask worker tcp://" in refused(*given)
        cluster.start_worker("--preload", str(older))
        deadline = time.monotonic() + 120
        while not has_older(cluster.address):
            assert time.monotonic() < deadline
        line = refused(*given)
        assert re.search(r"worker tcp://127.0.0.1:\d+ has xcalib 0.0.1, expected ", line)
        started = time.monotonic()
        cluster.end(cluster.scheduler)
        assert "no Dask scheduler answers" in refused(*given)
        assert time.monotonic() - started < 10
