"""`register` on many frames: frames a second, memory, where the time goes, what overlapping gains.

Frames are written first, to a folder of PNG files or to videos, with depth of half their size. For
the gain, short stretches are registered in turns, stage after stage on one thread, overlapped, and,
of folders, by a plain loop of OpenCV calls. Then all frames are registered
while memory and open descriptors are sampled; for what does not stay flat over 100,000 frames,
`--kind video --frames 100000 --width 64`.
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
from figures import figure, spread
from peers import plain_loop

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


def descriptors() -> int:
    """Files, pipes and so on that this process holds open."""
    return len(list(Path("/proc/self/fd").iterdir()))


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
            depth = cv2.resize(scene.depth, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_NEAREST)
            done, data = cv2.imencode(".png", np.rint(256 * depth).astype(np.uint16))
            assert done
            encoded.append(data.tobytes())
        path = folder / "depth" / f"{index:06d}.png"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(encoded[index % SCENES])
    for encoder, path in zip(encoders, streams, strict=False):
        encoder.close(count)
        join([(encoder.file, count)], path, path, 25, lambda: None)
    return streams[0], streams[1]


def stretch(frames: Frames, first: int, count: int) -> Frames:
    indices = list(range(first, first + count))
    depth = PickedDepth(frames.depth, indices)
    return Frames(Picked(frames.references, indices), Picked(frames.sources, indices), depth)


def busy(label: str, result: Registration) -> None:
    for name, share in result.busy.items():
        figure(f"{label}: {name} busy", 100 * share, "%")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=10000)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--kind", choices=["folder", "video"], default="folder")
    parser.add_argument("--work", type=Path, help="where a folder for the frames is made")
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

        images = sorted(streams[1].iterdir()) if given.kind == "folder" else []
        maps = sorted((folder / "depth").iterdir())
        plain: list[float] = []
        rates: dict[bool, list[float]] = {True: [], False: []}
        last: dict[bool, Registration] = {}
        for turn in range(ROUNDS):
            first = (turn * STRETCH) % max(1, len(frames) - STRETCH)
            few = stretch(frames, first, STRETCH)
            if images:
                which = slice(first, first + STRETCH)
                start = time.perf_counter()
                plain_loop.run(rig, images[which], maps[which], folder / "plain", 1 / 256)
                plain.append(STRETCH / (time.perf_counter() - start))
            for overlapped in (True, False) if turn % 2 else (False, True):
                options = RegistrationOptions(0 if overlapped else 1, overwrite=True)
                result = run_registration(few, rig, out, options, None, True)
                rates[overlapped].append(result.frames / result.seconds)
                last[overlapped] = result
        for overlapped, label in ((False, "one after the other"), (True, "overlapped")):
            spread(f"{label}: frames a second", rates[overlapped])
            busy(label, last[overlapped])
        ratios = np.array(rates[True]) / np.array(rates[False])
        spread(f"overlapping gains, times, in {ROUNDS} turns of {STRETCH} frames", ratios)
        if plain:
            spread("plain loop of OpenCV calls: frames a second", plain)
            label = "overlapped, times the plain loop"
            spread(label, np.array(rates[True]) / np.array(plain), "", ">= 4")
        if out.is_dir():
            shutil.rmtree(out)

        samples, opened = [resident()], [descriptors()]
        over = threading.Event()

        def sample() -> None:
            while not over.wait(0.2):
                samples.append(resident())
                opened.append(descriptors())

        sampler = threading.Thread(target=sample)
        sampler.start()
        try:
            result = run_registration(frames, rig, out, RegistrationOptions(overwrite=True))
        finally:
            over.set()
            sampler.join()
        label = f"all {result.frames} frames"
        figure(f"{label}: frames a second", result.frames / result.seconds)
        busy(label, result)
        for what, values, unit in (("memory", samples, "MB"), ("open descriptors", opened, "")):
            parts = np.array_split(values, min(20, len(values)))
            for which, index in (("first", 0), ("middle", len(parts) // 2), ("last", -1)):
                of_part = float(np.median(parts[index]))
                figure(f"{what} over the {which} twentieth of the run", of_part, unit)
        figure("memory, at most", max(samples), "MB")


if __name__ == "__main__":
    main()
