"""Clock offsets found in rendered drives with parallax: how many are trusted, how far they are off.

Each drive lasts 1.5 to 3 s at 30 frames/s, at about 9 m/s, the source late by up to 0.3 s either
way. The speed is steady in half of them and varies in the others; the rig turns a little in all.
"""

import argparse

import numpy as np
from common import machine

from xcalib import synthetic
from xcalib.footage import Stream, estimate_offset

RATE = 30.0
NOISE = 2.0  # of 255


class Drive(synthetic.Street):
    """A street whose frame is taken at any time [s]; the street's own are 6 m apart."""

    def __init__(self, seed: int, varies: bool) -> None:
        rig = synthetic.demo_rig().resized(160, 120, 160, 128)
        super().__init__(rig, num_frames=8, seed=seed)
        self.varies = varies
        self.phase = np.random.default_rng(seed).uniform(0, 2 * np.pi)

    def pose(self, index: float) -> tuple[np.ndarray, np.ndarray]:
        way = index + 0.5  # [s], from a little down the street
        if self.varies:
            way += 0.8 / np.pi * np.sin(np.pi * index + self.phase)  # speed 0.2 to 1.8 times
        return super().pose(np.clip(1.5 * way, 0, 7))


class View(Stream):
    """What one camera sees of the drive."""

    def __init__(self, drive: Drive, camera: str, scene: np.ndarray, late: float) -> None:
        modality = "visible" if camera == "reference" else "thermal"
        rng = np.random.default_rng(len(scene))
        self.images = []
        for time in scene:
            image, _ = drive.render_view(time, modality, camera)
            image += NOISE * rng.standard_normal(image.shape)
            self.images.append(image.clip(0, 255).astype(np.uint8))
        self.times = scene + late

    def __len__(self) -> int:
        return len(self.images)

    def read(self, index: int) -> np.ndarray:
        return self.images[index]

    def name(self, index: int) -> str:
        return f"{index:06d}"

    where = name


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=20, help="of either kind")
    args = parser.parse_args()
    print(machine())
    for varies in (True, False):
        errors, trusted = [], []
        for seed in range(args.drives):
            rng = np.random.default_rng([seed, varies])
            late = rng.uniform(-0.3, 0.3)
            scene = np.arange(0, rng.uniform(1.5, 3), 1 / RATE)
            drive = Drive(seed, varies)
            found = estimate_offset(
                View(drive, "reference", scene, 0),
                View(drive, "source", scene + rng.uniform(0, 1 / RATE), late),
            )
            errors.append(1e3 * abs(found.peak - late))
            trusted.append(found.trusted)
        error, told = np.array(errors), np.array(trusted)
        print(
            f"{'varying' if varies else 'steady'} speed: {told.sum()} of {len(told)} trusted,"
            f" of these median error {np.median(error[told] if told.any() else [np.nan]):.1f} ms,"
            f" largest {error[told].max(initial=0):.1f} ms"
        )


if __name__ == "__main__":
    main()
