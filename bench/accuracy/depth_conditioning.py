"""Noise and flicker of depth, as it is and steadied: a drive of 24 frames, 0.3 m apart."""

import time

import cv2
import numpy as np
from common import machine
from figures import figure
from rendered import Drive

from xcalib import synthetic
from xcalib.depth.conditioning import SteadyDepth


def steady(noise: float, smooth: bool) -> None:
    drive = Drive(synthetic.demo_rig().resized(480, 360, 320, 256), 24, 0.3, seed=3)
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
    start = time.perf_counter()
    steadied = [provider(i, f.reference) for i, f in enumerate(frames)]
    ms = 1e3 * (time.perf_counter() - start) / len(frames)
    print(f"{ms:.0f} ms a frame of 480x360, the noise included")
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
        label = f"{'smooth' if smooth else 'pixel'} noise {noise:.0%}, {name}"
        for what, value in zip(("flicker", "error", "just changed"), rms, strict=True):
            figure(f"{label}: {what}", 100 * value, "%")


def main() -> None:
    cv2.setNumThreads(1)
    print(machine())
    for noise in (0.02, 0.05):
        steady(noise, smooth=False)
        steady(noise, smooth=True)


if __name__ == "__main__":
    main()
