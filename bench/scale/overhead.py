"""What a shard costs besides its work: through processes and through Dask; and a line of a journal.

Shards that do nothing, one after the other and as many as workers take; the size of a real shard
and of its outcome as they travel; the time that a journal takes to note a shard, and to be read.
"""

import argparse
import os
import pickle
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from common import ROOT, machine
from figures import figure

from xcalib import Rig, synthetic
from xcalib.batch import InThisProcess, LocalProcesses, Shard, Workers, run_shards
from xcalib.batch.dask import DaskWorkers
from xcalib.batch.drive import Drive
from xcalib.inputs import Inputs

sys.path += [str(ROOT / "tests")]
from cluster import open_cluster


@dataclass(frozen=True)
class Nothing(Shard):
    """A shard of the size of a real one, that does nothing."""

    load: bytes

    def run(self) -> dict[str, Any]:
        return {"units": self.load.hex()}


def milliseconds(workers: Workers, count: int, load: bytes) -> float:
    shards = (Nothing(str(index), "nothing", load) for index in range(count))
    for _ in run_shards((Nothing("w", "warm", load) for _ in range(8)), workers):
        pass
    start = time.perf_counter()
    assert sum(1 for _ in run_shards(shards, workers)) == count
    return 1e3 * (time.perf_counter() - start) / count


def seconds_of(process: int) -> float:
    """Processor time of another process."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--shards", type=int, default=500)
    parser.add_argument("--frames", type=int, default=250, help="of a shard")
    parser.add_argument("--lines", type=int, default=100_000, help="of the journal that is read")
    given = parser.parse_args()
    print(machine())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        rig = synthetic.demo_rig().resized(160, 120, 160, 120)
        synthetic.write(folder, synthetic.render(rig, num_frames=2, seed=1), rig)
        kinds = (folder / kind for kind in ("visible", "thermal", "depth"))
        inputs = Inputs(*kinds)
        drive = Drive(inputs, Rig.load(folder / "rig.yaml"), folder / "out", None, InThisProcess())
        (shard,) = drive.shards()
        outcome = shard.run()
        each = len(outcome["units"])
        key = len(pickle.dumps(shard.keys)) // len(shard.keys)
        sent = len(pickle.dumps(shard)) + key * given.frames
        back = len(pickle.dumps(outcome)) // each * given.frames
        figure(f"a shard of {given.frames} frames, sent", sent / 1e3, "kB")
        figure("its outcome, sent back", back / 1e3, "kB")
        units = [
            ([(f"{index:016x}", 10_000)], [(f"{index:06d}.png", 1), (f"masks/{index:06d}.png", 1)])
            for index in range(given.lines)
        ]
        drive._manifest.claim()
        start = time.perf_counter()
        for first in range(0, given.lines, given.frames):
            drive._manifest._ledger.append(units[first : first + given.frames])
        seconds = time.perf_counter() - start
        figure("a shard noted in the journal", 1e3 * seconds * given.frames / given.lines, "ms")
        drive.close()
        journal = folder / "out" / "register.jsonl"
        figure("journal", journal.stat().st_size / given.lines, "bytes a frame")
        start = time.perf_counter()
        Drive(inputs, Rig.load(folder / "rig.yaml"), folder / "out", None, InThisProcess()).close()
        figure("journal read", 1e6 * (time.perf_counter() - start) / given.lines, "us a frame")

        load = b"x" * (sent // 2)
        figure("in this process", milliseconds(InThisProcess(), given.shards, load), "ms a shard")
        local = LocalProcesses(2)
        figure("2 processes", milliseconds(local, given.shards, load), "ms a shard")
        local.close()
        (folder / "cluster").mkdir()
        with open_cluster(folder / "cluster") as cluster:
            for worker in cluster.workers:
                cluster.end(worker)
            os.environ["PYTHONPATH"] = str(Path(__file__).parent)
            for _ in range(2):
                cluster.start_worker()
            dask = DaskWorkers(cluster.address)
            while dask.slots < 2:
                time.sleep(0.2)
            before = seconds_of(cluster.scheduler.pid), time.process_time()
            figure("Dask, 2 workers", milliseconds(dask, given.shards, load), "ms a shard")
            after = seconds_of(cluster.scheduler.pid), time.process_time()
            for name, first, last in zip(("scheduler", "driver"), before, after, strict=True):
                own = 1e3 * (last - first) / (given.shards + 8)
                figure(f"processor time of the {name} then", own, "ms a shard")
            dask.close()


if __name__ == "__main__":
    sys.modules["overhead"] = sys.modules["__main__"]
    Nothing.__module__ = "overhead"  # as workers import it
    main()
