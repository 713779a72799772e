"""`register` on many frames: memory, frames a second, where the time goes, and what overlap gains.

Frames are written first, to a folder of PNG files or to videos. Then all of them are registered,
memory being sampled; and, for the gain, short stretches one after the other, stage after stage on
one thread and overlapped, in turns.

    python bench/stream.py [--frames 10000] [--width 640] [--kind folder|video] [--work FOLDER]
"""

import argparse
import shutil
import tempfile
import threading
import time
from pathlib import Path

import cv2
import numpy as np
from common import machine

from xcalib import Rig, synthetic
from xcalib.footage import Picked
from xcalib.footage.encoder import Encoder, join
from xcalib.footage.opening import PickedDepth
from xcalib.frames import write_image
from xcalib.inputs import Inputs
from xcalib.pipeline import Frames
from xcalib.registration import Registration, RegistrationOptions, run_registration

SCENES = 8
STRETCH = 120
ROUNDS = 5


def resident() -> float:
    """Memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6


def write(folder: Path, rig: Rig, count: int, kind: str) -> tuple[Path, Path]:
    """Rendered frames with noise of their own, and their depth; the two streams."""
    rng = np.random.default_rng(0)
    scenes = list(synthetic.render(rig, num_frames=SCENES, seed=1))
    noise = rng.normal(0, 3, (4, 2 * rig.reference.height, 2 * rig.reference.width))
    streams = [folder / "visible", folder / "thermal"]
    if kind == "video":
        streams = [path.with_suffix(".mkv") for path in streams]
    encoders: list[Encoder] = []
    encoded = []
    for index in range(count):
        scene = scenes[index % SCENES]
        pair = []
        for image in (scene.reference, scene.source):
            h, w = image.shape[:2]
            y, x = rng.integers(0, h, 2)[0], rng.integers(0, w, 2)[0]
            own = noise[index % 4, y : y + h, x : x + w].reshape(h, w, *[1] * (image.ndim - 2))
            pair.append(np.clip(image + own, 0, 255).astype(np.uint8))
        if kind == "video":
            if not encoders:
                encoders = [
                    Encoder(path.with_suffix(".part"), path, image, 25)
                    for path, image in zip(streams, pair, strict=True)
                ]
            for encoder, image in zip(encoders, pair, strict=True):
                encoder.write(image)
        else:
            for path, image in zip(streams, pair, strict=True):
                write_image(path / f"{index:06d}.png", image)
        if index < SCENES:
            done, data = cv2.imencode(".png", np.rint(256 * scene.depth).astype(np.uint16))
            assert done
            encoded.append(data.tobytes())
        path = folder / "depth" / f"{index:06d}.png"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(encoded[index % SCENES])
    for encoder, path in zip(encoders, streams, strict=False):
        encoder.close(count)
        join([(encoder.path, count)], path, 25, lambda: None)
    return streams[0], streams[1]


def part(frames: Frames, first: int, count: int) -> Frames:
    indices = list(range(first, first + count))
    depth = PickedDepth(frames.depth, indices)
    return Frames(Picked(frames.references, indices), Picked(frames.sources, indices), depth)


def told(result: Registration) -> str:
    busy = ", ".join(f"{name} {100 * share:.0f} %" for name, share in result.busy.items())
    return f"{result.frames / result.seconds:.1f} frames/s; busy: {busy}"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--frames", type=int, default=10000)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--kind", choices=["folder", "video"], default="folder")
    parser.add_argument("--work", type=Path)
    given = parser.parse_args()
    print(machine())
    rig = synthetic.demo_rig()
    factor = given.width / rig.reference.width
    cameras = rig.reference, rig.source
    rig = rig.resized(*[2 * round(factor * n / 2) for c in cameras for n in (c.width, c.height)])
    with tempfile.TemporaryDirectory(dir=given.work) as name:
        folder = Path(name)
        out = folder / ("out.mkv" if given.kind == "video" else "out")
        streams = write(folder, rig, given.frames, given.kind)
        frames = Frames.open(Inputs(*streams, folder / "depth"))
        print(f"{given.frames} frames {rig.reference.width}x{rig.reference.height}, {given.kind}")

        rates: dict[bool, list[float]] = {True: [], False: []}
        last: dict[bool, Registration] = {}
        for turn in range(ROUNDS):
            few = part(frames, (turn * STRETCH) % max(1, len(frames) - STRETCH), STRETCH)
            for overlapped in (True, False) if turn % 2 else (False, True):
                options = RegistrationOptions(0 if overlapped else 1, overwrite=True)
                result = run_registration(few, rig, out, options, None, True)
                rates[overlapped].append(result.frames / result.seconds)
                last[overlapped] = result
        ratios = np.array(rates[True]) / np.array(rates[False])
        print(f"one after the other: {told(last[False])}")
        print(f"overlapped:          {told(last[True])}")
        print(
            f"overlap gains {np.median(ratios):.2f} times"
            f" ({ratios.min():.2f}-{ratios.max():.2f}) in {ROUNDS} turns of {STRETCH} frames"
        )
        if out.is_dir():
            shutil.rmtree(out)

        samples: list[float] = []
        over = threading.Event()

        def sample() -> None:
            while not over.wait(0.2):
                samples.append(resident())

        sampler = threading.Thread(target=sample)
        sampler.start()
        start = time.perf_counter()
        try:
            result = run_registration(frames, rig, out, RegistrationOptions(overwrite=True))
        finally:
            over.set()
            sampler.join()
        print(f"all, in {time.perf_counter() - start:.0f} s: {told(result)}")
        print("memory, median over a twentieth of the run each [MB]:")
        print(" ".join(f"{np.median(part):.0f}" for part in np.array_split(samples, 20)))
        third = len(samples) // 3
        print(
            f"largest in the first, middle and last third: {max(samples[:third]):.0f},"
            f" {max(samples[third:-third]):.0f}, {max(samples[-third:]):.0f} MB"
        )


if __name__ == "__main__":
    main()
