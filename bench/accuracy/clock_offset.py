"""How well the clock offset is found by footage alone, and by registration with the true rig.

Drives of 3 s through rendered streets at 30 frames/s, at a steady speed and at one that varies, the
thermal camera at 30 or 9 frames/s and late by up to 0.4 s. For each kind: how many estimates were
trusted, and the errors of those; the same after `refine_offset`, which starts at the estimate's
peak, trusted or not.
"""

import argparse

import numpy as np
from common import machine
from figures import figure

from xcalib import synthetic
from xcalib.depth import DepthProvider
from xcalib.footage import Stream, estimate_offset, offsets_around, refine_offset

RATE, SECONDS, WIDTH = 30, 3.0, 192
METRES = 6.0  # from one index of a `Street` to the next


class Camera(Stream):
    """Images in memory."""

    def __init__(self, images, times):
        super().__init__()
        self.images, self.times = images, times

    def __len__(self):
        return len(self.images)

    def read(self, index):
        return self.images[index]

    def name(self, index):
        return f"{index:06d}"

    def where(self, index):
        return f"drive frame {index}"


class Maps(DepthProvider):
    """Depth maps in memory."""

    def __init__(self, maps):
        self.maps = maps

    def __call__(self, index, reference):
        return self.maps[index]


def small_rig():
    rig = synthetic.demo_rig()
    factor = WIDTH / rig.reference.width
    cameras = rig.reference, rig.source
    return rig.resized(*(round(factor * s) for c in cameras for s in (c.width, c.height)))


def drive(rig, seed, varies):
    """A function from times [s] and a view to noisy images and depth."""
    street = synthetic.Street(rig, num_frames=10, seed=seed, speed=METRES)
    random = np.random.default_rng(seed)
    phase = random.uniform(0, 2 * np.pi)

    def film(times, *view):
        seconds = np.asarray(times)
        pulse = np.sin(2.6 * seconds + phase) - np.sin(phase)  # 10 m/s, +- 6.5 m/s
        ways = 10 * (seconds + 0.5) + (2.5 * pulse if varies else 0)
        for way in ways:
            image, depth = street.render_view(way / METRES, *view)
            noisy = image + random.normal(0, 3, image.shape)
            yield noisy.clip(0, 255).astype(np.uint8), depth.astype(np.float32)

    return film


def report(name, rows):
    errors = [1e3 * abs(error) for trusted, error in rows if trusted]
    figure(f"{name}: trusted, of {len(rows)}", len(errors))
    if errors:
        figure(f"{name}: median error", np.median(errors), "ms")
        figure(f"{name}: largest error", max(errors), "ms")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=8, help="of each kind")
    drives = parser.parse_args().drives
    print(machine())
    rig = small_rig()
    for varies in (True, False):
        for rate in (30, 9):
            alone, refined = [], []
            for seed in range(drives):
                film = drive(rig, seed, varies)
                late = np.random.default_rng(seed).uniform(0.1, 0.4)
                at = np.arange(0, SECONDS, 1 / RATE)
                images, depths = zip(*film(at, "visible", "reference"), strict=True)
                visible = Camera(images, at)
                at = np.arange(0.01, SECONDS, 1 / rate)
                thermal = Camera([i for i, _ in film(at, "thermal", "source")], at + late)
                estimate = estimate_offset(visible, thermal)
                alone.append((estimate.trusted, estimate.peak - late))
                candidates = offsets_around(estimate.peak, visible, thermal)
                found = refine_offset(rig, visible, thermal, Maps(depths), candidates)
                refined.append((found.decided, found.offset - late))
            speed = "varying" if varies else "steady"
            label = f"{RATE} and {rate} frames/s, {speed} speed"
            report(f"{label}, footage alone", alone)
            report(f"{label}, with the rig", refined)


if __name__ == "__main__":
    main()
