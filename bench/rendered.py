"""Rendered streets with their truth, kept in build/rendered: rendered once, mapped into memory."""

import hashlib
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from common import ROOT, median_error

import xcalib
from xcalib import synthetic

CACHE = ROOT / "build" / "rendered"
WIDTH, HEIGHT, SOURCE_WIDTH, SOURCE_HEIGHT = 320, 240, 320, 256

# Axes off by up to 6 % of the width, like fields of view: the night rig, roughly.
NEAR = {
    "hfov_deg": (40, 50),
    "fov_ratio": (0.85, 1.18),
    "max_offset": 0.06,
    "max_roll_deg": 2.0,
    "max_baseline": 0.3,
}


@dataclass(frozen=True)
class Rendered:
    """Frames of a rendered street and the rig they were taken with."""

    rig: xcalib.Rig
    folder: Path
    """Of references.npy, sources.npy and depths.npy."""
    references: np.ndarray  # (N, H, W, 3) uint8
    sources: np.ndarray  # (N, h, w) uint8
    depths: np.ndarray  # (N, H, W) float32 [m]

    def calibrate(
        self, options=None, frames=slice(None), depths=None, initial=None, how=xcalib.calibrate
    ) -> xcalib.CalibrationResult:
        return how(
            list(self.references[frames]),
            list(self.sources[frames]),
            list((self.depths if depths is None else depths)[frames]),
            initial=initial,
            options=options or xcalib.CalibrationOptions(),
        )

    def error(self, rig: xcalib.Rig, frames=slice(None)) -> float:
        """Median end-point error over the frames [px of the source]."""
        return median_error(rig, self.rig, self.depths[frames])

    def gray_frames(
        self, frames=slice(None)
    ) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Reference and source, gray in [0, 1], and depth."""
        for reference, source, depth in zip(
            self.references[frames], self.sources[frames], self.depths[frames], strict=True
        ):
            yield mean_gray(reference), source.astype(np.float32) / 255, depth


def mean_gray(image: np.ndarray) -> np.ndarray:
    """The mean of a colour image's channels, (H, W) float32 in [0, 1]."""
    return image.mean(axis=2).astype(np.float32) / 255


def rendered(rig: xcalib.Rig, frames: int, seed: int, night: bool = False) -> Rendered:
    """A street as `synthetic.render` makes it, kept by the hash of all that it depends on."""
    key = hashlib.sha256(
        f"{rig!r} {rig.R.tolist()} {rig.t.tolist()} {frames} {seed} {night}".encode()
    )
    for source in sorted(Path(synthetic.__file__).parent.rglob("*.py")):
        key.update(source.read_bytes())
    folder = CACHE / key.hexdigest()[:24]
    names = ("references", "sources", "depths")
    if not folder.is_dir():
        street = list(synthetic.render(rig, num_frames=frames, seed=seed, night=night))
        beside = folder.with_suffix(".part")
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir(parents=True)
        for name in names:
            np.save(beside / f"{name}.npy", np.stack([getattr(f, name[:-1]) for f in street]))
        beside.replace(folder)
    return Rendered(rig, folder, *(mapped_array(folder / f"{name}.npy") for name in names))


def mapped_array(path: Path) -> np.ndarray:
    """Read from the file where it is looked at."""
    return np.asarray(np.load(path, mmap_mode="r"))


def random_rigs(count: int, frames: int, quick: bool, **limits) -> Iterator[Rendered]:
    """Random rigs of small images, every third by night; `limits` as of `synthetic.random_rig`."""
    sizes = (WIDTH, HEIGHT, SOURCE_WIDTH, SOURCE_HEIGHT)
    if quick:
        sizes = tuple(side // 2 for side in sizes)
    for seed in range(count):
        rig = synthetic.random_rig(seed, *sizes, **limits)
        yield rendered(rig, frames, seed, night=seed % 3 == 2)


class Drive(synthetic.Street):
    """A street passed at so many metres a frame, where the street's own frames are 6 m apart."""

    def __init__(self, rig: xcalib.Rig, frames: int, metres: float, **kwargs) -> None:
        super().__init__(rig, num_frames=frames, **kwargs)
        self.slowness = 6.0 / metres

    def pose(self, index: float) -> tuple[np.ndarray, np.ndarray]:
        return super().pose(index / self.slowness)
