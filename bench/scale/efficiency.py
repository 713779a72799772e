"""Shards on a Dask cluster: from one worker to two, and memory of a worker.

Two schedulers are started on the loopback address, one with a worker of one thread, one with two.
The same frames are registered by each, in turns: warp-bound, with depth from files, and
depth-bound, with depth that is completed in each frame. Efficiency is the speed with two over twice
that with one. Before each turn the workers have opened the drive: what is measured is steady work.
"""

import argparse
import contextlib
import sys
import tempfile
import time
from pathlib import Path

from common import ROOT, machine
from figures import figure, spread

from xcalib import Rig, synthetic
from xcalib.batch import register
from xcalib.batch.dask import DaskWorkers
from xcalib.depth import MeasuredDepth
from xcalib.inputs import Inputs

sys.path += [str(ROOT / "bench" / "speed"), str(ROOT / "tests")]
from stream import write

from cluster import open_cluster


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=1200)
    parser.add_argument("--shard", type=int, default=60)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--work", type=Path, help="where frames are kept, or are from before")
    parser.add_argument("--only-write", action="store_true", help="the frames, in --work")
    parser.add_argument("--kinds", nargs="+", default=["warp", "depth"])
    given = parser.parse_args()
    print(machine())
    rig = synthetic.demo_rig()
    factor = given.width / rig.reference.width
    cameras = rig.reference, rig.source
    rig: Rig = rig.resized(
        *[2 * round(factor * n / 2) for c in cameras for n in (c.width, c.height)]
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        kept = given.work or folder
        visible, thermal = kept / "visible", kept / "thermal"
        if not visible.is_dir():
            write(kept, rig, given.frames, "folder")
        if given.only_write:
            return
        with contextlib.ExitStack() as stack:
            addresses = {}
            for count in (1, 2):
                place = folder / f"cluster{count}"
                place.mkdir()
                addresses[count] = stack.enter_context(open_cluster(place, count)).address
            for count, address in addresses.items():
                wait = DaskWorkers(address)
                while wait.slots < count:
                    time.sleep(0.2)
                wait.close()
            for kind in given.kinds:
                measured = MeasuredDepth(complete=kind == "depth")
                inputs = Inputs(visible, thermal, kept / "depth", measured=measured)
                speeds: dict[int, list[float]] = {1: [], 2: []}
                peak = 0
                for turn in range(given.rounds + 1):
                    for count in (1, 2) if turn % 2 else (2, 1):
                        workers = DaskWorkers(addresses[count])
                        out = folder / f"{kind}{turn}{count}"
                        start = time.perf_counter()
                        done = register(inputs, rig, out, None, workers, given.shard)
                        seconds = time.perf_counter() - start
                        workers.close()
                        assert done.made == given.frames, done
                        if turn:  # the first warms up
                            speeds[count].append(done.made / seconds)
                            peak = max(peak, done.peak_bytes)
                one = spread(f"{kind}-bound: frames a second, 1 worker", speeds[1])
                two = spread(f"{kind}-bound: frames a second, 2 workers", speeds[2])
                figure(
                    f"{kind}-bound: efficiency of 2 workers", two / (2 * one), "", target=">= 0.9"
                )
                figure(f"{kind}-bound: memory of a worker", peak / 1e6, "MB")


if __name__ == "__main__":
    main()
