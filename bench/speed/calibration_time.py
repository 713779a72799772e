"""Time and memory of a calibration: beside the paper's Adam in PyTorch, by frames, by pixels.

Two threads throughout; every run is a process of its own, which measures the fit alone: frames are
in memory, modules loaded. The peer takes the published 120 steps (15 epochs of 32 frames by 4)
without its flow network, which would only add to its time; since nothing but its edges leads it,
the rig rendered for the comparison lies 7 px from where it starts. Ours starts from nothing and
searches. Both results are judged by both objectives.

    python bench/run.py calibration_time                               all of it
    python bench/run.py calibration_time -- --only peer|frames|pixels
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
from common import ROOT, machine, median_error
from figures import figure, skipped, spread
from night import NightRig
from rendered import Rendered, mapped_array, rendered

import xcalib
from xcalib import synthetic

CACHE = ROOT / "build" / "bench"
ARRAYS = ("references", "sources", "depths")
THREADS = 2
Sets = tuple[list[np.ndarray], list[np.ndarray], list[np.ndarray]]


def drive(width: int, count: int) -> Rendered:
    """A rendered drive of a rig near the paper's start."""
    height, source = width * 3 // 4, (width, width * 4 // 5)
    rig = synthetic.random_rig(
        2,
        *(width, height, *source),
        hfov_deg=(44, 46),
        fov_ratio=(0.98, 1.02),
        max_offset=0.03,
        max_baseline=0.15,
        max_roll_deg=1,
    )
    return rendered(rig, count, seed=2)


def night_frames() -> Path | None:
    """The 32 frames of the night rig that it is fitted on, at 640x520 and as given."""
    night = NightRig.open()
    if night is None:
        return None
    folder = CACHE / "night"
    if not (folder / "depths.npy").is_file():
        folder.mkdir(parents=True, exist_ok=True)
        names = night.fitted
        size = (640, round(640 * 946 / 1166))
        visible = [cv2.resize(night.visible(n), size, interpolation=cv2.INTER_AREA) for n in names]
        np.save(folder / "references.npy", np.stack(visible))
        np.save(folder / "sources.npy", np.stack([night.thermal(n) for n in names]))
        depths = [night.filled(n) for n in names]
        depths = [cv2.resize(d, size, interpolation=cv2.INTER_NEAREST) for d in depths]
        np.save(folder / "depths.npy", np.stack(depths))  # the last: with it the folder is whole
    return folder


def read(folder: Path, count: int, width: int | None = None) -> Sets:
    """The first frames; smaller, where a width is given."""
    mapped = [mapped_array(folder / f"{name}.npy") for name in ARRAYS]
    factor = 1.0 if width is None else width / mapped[0].shape[2]
    how = (cv2.INTER_AREA, cv2.INTER_AREA, cv2.INTER_NEAREST)
    sets: list[list[np.ndarray]] = [[], [], []]
    for i in range(count):
        for part, images, method in zip(sets, mapped, how, strict=True):
            size = [round(factor * side) for side in images[i].shape[1::-1]]
            image = np.array(images[i])
            part.append(image if factor == 1 else cv2.resize(image, size, interpolation=method))
    return sets[0], sets[1], sets[2]


# -- One run, in its own process -----------------------------------------------------------------


def memory() -> tuple[float, float]:
    """Now, and at its highest [MB]: of this process alone (ru_maxrss has its parent's too)."""
    status = dict(line.split(":", 1) for line in Path("/proc/self/status").read_text().splitlines())
    return tuple(int(status[k].split()[0]) / 1e3 for k in ("VmRSS", "VmHWM"))  # type: ignore


class Clock:
    """Time, and the processor time of all threads: the steadier one on a shared machine."""

    def __init__(self) -> None:
        self.start = time.perf_counter(), time.process_time()

    def read(self) -> dict[str, float]:
        now = time.perf_counter(), time.process_time()
        return {"seconds": now[0] - self.start[0], "processor": now[1] - self.start[1]}


def run(contestant: str, folder: Path, count: int, width: int | None, rig_file: Path) -> dict:
    sets = read(folder, count, width)
    if contestant == "peer":
        import torch
        from peers import torch_calibration as peer

        torch.set_num_threads(THREADS)
        peer.calibrate(peer.Frames.of(*(part[:4] for part in sets)), epochs=2)  # warm
        clock = Clock()
        found = peer.calibrate(peer.Frames.of(*sets))
        taken = clock.read()
        found.rig.save(rig_file)
        return {**taken, "steps": len(found.losses)}
    options = xcalib.CalibrationOptions(num_threads=THREADS, max_frames=count)
    if width is not None:
        options.working_width = width
    before, _ = memory()
    clock = Clock()
    result = xcalib.calibrate(*sets, options=options)
    taken = clock.read()
    result.rig.save(rig_file)
    report = result.report
    return {
        **taken,
        "memory": memory()[1],
        "memory_before": before,
        "parts": dict(report.time),
        "converged": result.converged,
        "iterations": sum(level.iterations for level in report.levels),
    }


def in_process(contestant: str, folder: Path, count: int, width: int | None = None) -> dict:
    rig_file = CACHE / f"found-{contestant}.yaml"
    job = json.dumps([contestant, str(folder), count, width, str(rig_file)])
    command = [sys.executable, __file__, "--run", job]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1]) | {"rig": xcalib.Rig.load(rig_file)}


# -- Ours and the peer ---------------------------------------------------------------------------


def our_loss(rig: xcalib.Rig, sets: Sets) -> float:
    """Eq. (image_loss) of this library's objective: what its first step of Adam starts from."""
    count = len(sets[0])
    options = xcalib.CalibrationOptions(
        solver="adam",
        flow="off",
        num_threads=THREADS,
        max_frames=count,
        adam=xcalib.AdamOptions(epochs=1, batch=count),
        search=xcalib.SearchOptions(mode="off"),
    )
    return float(xcalib.calibrate(*sets, initial=rig, options=options).report.steps[0].image)


def against_peer(name: str, folder: Path, truth: xcalib.Rig | None, rounds: int) -> None:
    try:
        import torch
        from peers import torch_calibration as peer
    except ImportError:
        skipped(f"{name}: 120 Adam steps in PyTorch", "PyTorch is not installed")
        return
    torch.set_num_threads(THREADS)
    ours, theirs = [], []
    load = os.getloadavg()[0]
    for _ in range(rounds):  # in pairs
        ours.append(in_process("ours", folder, 32))
        theirs.append(in_process("peer", folder, 32))
    for clock, label, target in (
        ("seconds", "time", "<= 0.25" if load < THREADS else None),
        ("processor", "processor time", None),
    ):
        our_time = np.array([r[clock] for r in ours])
        peer_time = np.array([r[clock] for r in theirs])
        spread(f"{name}: {label}, ours, search included", our_time, "s")
        spread(f"{name}: {label}, {theirs[0]['steps']} Adam steps in PyTorch", peer_time, "s")
        spread(f"{name}: {label}, ours of the peer's", our_time / peer_time, "", target)
    if load >= THREADS:
        reason = f"load average {load:.1f} at the start: PyTorch's threads wait for each other"
        skipped(f"{name}: time, ours of the peer's <= 0.25", reason)
    sets = read(folder, 32)
    frames = peer.Frames.of(*sets)
    start = xcalib.Rig(
        xcalib.Pinhole.from_hfov(sets[0][0].shape[1], sets[0][0].shape[0], 45),
        xcalib.Pinhole.from_hfov(sets[1][0].shape[1], sets[1][0].shape[0], 45),
    )
    rigs = {"the peer's start": start, "ours": ours[-1]["rig"], "the peer": theirs[-1]["rig"]}
    for label, loss in (
        ("image loss of the paper", lambda rig: peer.image_loss_of(rig, frames)),
        ("image loss of our objective", lambda rig: our_loss(rig, sets)),
    ):
        values = {who: loss(rig) for who, rig in rigs.items()}
        figure(f"{name}: {label}, at the peer's start", values["the peer's start"])
        figure(f"{name}: {label}, the peer", values["the peer"])
        figure(
            f"{name}: {label}, ours",
            values["ours"],
            target=f"<= {values['the peer']:.4g}",
            met=values["ours"] <= values["the peer"],
        )
    if truth is None:
        return
    for who, rig in rigs.items():
        figure(f"{name}: end-point error, {who}", median_error(rig, truth, sets[2]), "px")


# -- By frames and by pixels ---------------------------------------------------------------------


def exponent(sizes: list[float], seconds: list[float]) -> float:
    """Slope of the least-squares line through the logarithms: 1 is linear."""
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def series(label: str, folder: Path, runs: list[tuple[int, int]], by: str, rounds: int) -> None:
    """`runs`: frames and width. Every round has them all once: a busy time meets all alike."""
    taken: list[list[float]] = [[] for _ in runs]
    processor: list[list[float]] = [[] for _ in runs]
    last: list[dict] = [{} for _ in runs]
    for _ in range(rounds):
        for i, (count, width) in enumerate(runs):
            last[i] = in_process("ours", folder, count, width)
            taken[i].append(last[i]["seconds"])
            processor[i].append(last[i]["processor"])
    sizes = [float(count if by == "frames" else width**2) for count, width in runs]
    for (count, width), seconds, spent, result in zip(runs, taken, processor, last, strict=True):
        name = f"{label}: {count} frames, {width}x{width * 3 // 4}"
        spread(name, seconds, "s")
        spread(f"{name}, processor time", spent, "s")
        target = "<= 600" if (count, width) == (32, 640) else None
        figure(f"{name}, peak memory of the process", result["memory"], "MB", target=target)
        figure(f"{name}, of that before the call", result["memory_before"], "MB")
        figure(f"{name}, iterations of the solver", result["iterations"])
        if (count, width) == (32, 640):
            breakdown(result)
    for label, seconds in (("time", taken), ("processor time", processor)):
        power = exponent(sizes, [min(s) for s in seconds])
        figure(f"{label} grows with the {by} to the power of", power, target="<= 1.1")


def breakdown(result: dict) -> None:
    for part, seconds in result["parts"].items():
        figure(f"breakdown: {part}", seconds, "s")
    rest = result["seconds"] - sum(result["parts"].values())
    figure("breakdown: the rest", rest, "s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=("peer", "frames", "pixels"))
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--run", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.run:
        contestant, folder, count, width, rig_file = json.loads(args.run)
        print(json.dumps(run(contestant, Path(folder), count, width, Path(rig_file))))
        return
    print(machine())
    CACHE.mkdir(parents=True, exist_ok=True)
    scene = drive(640, 64)
    if args.only in (None, "peer"):
        against_peer("rendered", scene.folder, scene.rig, args.rounds)
        night = night_frames()
        if night is not None:
            against_peer("night rig", night, None, 1)
    if args.only in (None, "frames"):
        runs = [(count, 640) for count in (8, 16, 32, 64)]
        series("by frames", scene.folder, runs, "frames", args.rounds)
    if args.only in (None, "pixels"):
        runs = [(16, width) for width in (320, 640, 960, 1280)]
        series("by pixels", drive(1280, 16).folder, runs, "pixels", args.rounds)


if __name__ == "__main__":
    main()
