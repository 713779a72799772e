"""Does conditioning of depth help? Snapped edges on the night rig, steadied depth on a drive.

Snap: the rig is fitted once on 32 night frames (`depth_filled`), then judged on the other 8 with
depth as it is and snapped. Also on a rendered street whose depth edges are spoilt on purpose.
Steady: a rendered drive of 24 frames at 0.3 m a frame, its depth with independent noise.
"""

import time

import cv2
import numpy as np
from common import data, machine

import xcalib
from xcalib import synthetic
from xcalib.depth import FolderDepth
from xcalib.depth.conditioning import SnappedDepth, SteadyDepth, snap
from xcalib.evaluate import evaluate
from xcalib.frames import Images, list_files


def night() -> None:
    folder = data("lynred_night")
    if folder is None:
        return
    paths = list_files(folder / "visible")
    references, sources = Images(paths), Images(list_files(folder / "thermal"))
    depth = FolderDepth(folder / "depth_filled", paths)
    held = range(4, len(paths), 5)
    fit = [i for i in range(len(paths)) if i not in held]
    result = xcalib.calibrate(
        [references[i] for i in fit],
        [sources[i] for i in fit],
        [depth(i, references[i]) for i in fit],
    )
    for name, provider in (("as it is", depth), ("snapped", SnappedDepth(depth))):
        scores = evaluate(
            result.rig,
            [references[i] for i in held],
            [sources[i] for i in held],
            [provider(i, references[i]) for i in held],
        ).registered
        print(
            f"night, {name:<9} patch residual {scores.patch_median:.3f} px,"
            f" {scores.patch_under_2px:.1%} under 2 px; NEC {scores.nec:.4f}, GC {scores.gc:.4f}"
        )


class Drive(synthetic.Street):
    """A street passed at 0.3 m a frame, where the street's own frames are 6 m apart."""

    def pose(self, index: float) -> tuple[np.ndarray, np.ndarray]:
        return super().pose(index / 20)


def small_rig() -> xcalib.Rig:
    return synthetic.demo_rig().resized(480, 360, 320, 256)


def spoilt_edges() -> None:
    rng = np.random.default_rng(0)
    before, after, seconds = [], [], []
    for frame in synthetic.render(small_rig(), num_frames=6, seed=3):
        h, w = frame.depth.shape
        # Edges off by up to 3 px, as from matching with blocks.
        wave = cv2.resize(rng.uniform(-3, 3, (h // 12, w // 12, 2)).astype(np.float32), (w, h))
        y, x = np.mgrid[0:h, 0:w].astype(np.float32)
        spoilt = cv2.remap(frame.depth, x + wave[..., 0], y + wave[..., 1], cv2.INTER_NEAREST)
        start = time.perf_counter()
        snapped = snap(spoilt, frame.reference)
        seconds.append(time.perf_counter() - start)
        known = (frame.depth > 0) & (spoilt > 0)
        for d, parts in ((spoilt, before), (snapped, after)):
            parts.append(np.abs(d - frame.depth)[known] / frame.depth[known])
    ms = 1e3 * np.median(seconds)
    for name, parts in (("spoilt", before), ("snapped", after)):
        e = np.concatenate(parts)
        print(f"street, edges off by 3 px, {name:<8} off by > 10 %: {np.mean(e > 0.1):.2%}")
    print(f"snap {ms:.0f} ms at 480x360")


def steady(noise: float, smooth: bool) -> None:
    drive = Drive(small_rig(), num_frames=24, seed=3)
    frames = [drive.frame(i) for i in range(24)]
    rng = np.random.default_rng(1)

    def noisy(index: int, reference: np.ndarray) -> np.ndarray:
        truth = frames[index].depth
        h, w = truth.shape
        field = rng.standard_normal((h // 16, w // 16) if smooth else (h, w)).astype(np.float32)
        field = cv2.resize(field, (w, h), interpolation=cv2.INTER_CUBIC)
        return truth * np.exp(noise * field)

    seen: list[np.ndarray] = []

    def recorded(index: int, reference: np.ndarray) -> np.ndarray:
        seen.append(noisy(index, reference))
        return seen[-1]

    provider = SteadyDepth(recorded)
    steadied = [provider(i, f.reference) for i, f in enumerate(frames)]
    # What is new in a frame, or moves: inverse depth differs by > 10 % from the frame before.
    for name, maps in (("as it is", seen), ("steadied", steadied)):
        still, moving, flicker = [], [], []
        for i in range(8, 24):
            truth, old = frames[i].depth, frames[i - 1].depth
            known = (truth > 0) & (old > 0)
            changed = np.abs(np.log(np.where(known, truth, 1) / np.where(known, old, 1))) > 0.1
            error = np.log(np.where(known, maps[i], 1) / np.where(known, truth, 1))
            last = np.log(np.where(known, maps[i - 1], 1) / np.where(known, old, 1))
            flicker.append((error - last)[known & ~changed])
            still.append(error[known & ~changed])
            moving.append(error[known & changed])
        rms = [np.sqrt(np.mean(np.concatenate(parts) ** 2)) for parts in (flicker, still, moving)]
        print(
            f"drive, {'smooth' if smooth else 'pixel'} noise {noise:.0%}, {name}:"
            f" flicker {rms[0]:.2%}, error {rms[1]:.2%}, where depth has just changed {rms[2]:.2%}"
        )


def main() -> None:
    cv2.setNumThreads(1)
    print(machine())
    spoilt_edges()
    for noise in (0.02, 0.05):
        steady(noise, smooth=False)
        steady(noise, smooth=True)
    night()


if __name__ == "__main__":
    main()
