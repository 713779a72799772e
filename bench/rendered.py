"""Footage of the experiments: the night rig as `bench/night.py` has it, and rendered rigs, kept."""

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from common import ROOT
from night import SIZE, NightRig, gray

import xcalib
from xcalib import _street, synthetic

CACHE = ROOT / "build" / "rendered"
WIDTH, HEIGHT, SOURCE_WIDTH, SOURCE_HEIGHT = 320, 240, 320, 256


@dataclass(frozen=True)
class Rendered:
    """Frames of a rendered street and the rig they were taken with."""

    rig: xcalib.Rig
    references: np.ndarray  # (N, H, W, 3) uint8
    sources: np.ndarray  # (N, h, w) uint8
    depths: np.ndarray  # (N, H, W) float32 [m]

    def calibrate(self, options=None, frames=slice(None), depths=None, initial=None):
        return xcalib.calibrate(
            list(self.references[frames]),
            list(self.sources[frames]),
            list((self.depths if depths is None else depths)[frames]),
            initial=initial,
            options=options or xcalib.CalibrationOptions(),
        )

    def error(self, rig: xcalib.Rig, frames=slice(None)) -> float:
        """Median end-point error over the frames [px of the source]."""
        return float(
            np.nanmedian([synthetic.end_point_error(rig, self.rig, d) for d in self.depths[frames]])
        )


def rendered(rig: xcalib.Rig, frames: int, seed: int, night: bool = False) -> Rendered:
    """Rendered once; kept in build/ under the hash of all that it depends on."""
    key = hashlib.sha256(
        f"{rig!r} {rig.R.tolist()} {rig.t.tolist()} {frames} {seed} {night}".encode()
    )
    for module in (synthetic, _street):
        key.update(Path(module.__file__).read_bytes())
    kept = CACHE / f"{key.hexdigest()[:24]}.npz"
    if not kept.exists():
        street = list(synthetic.render(rig, num_frames=frames, seed=seed, night=night))
        CACHE.mkdir(parents=True, exist_ok=True)
        beside = kept.with_name(f"{kept.stem}.part.npz")
        np.savez(
            beside,
            references=[f.reference for f in street],
            sources=[f.source for f in street],
            depths=[f.depth for f in street],
        )
        beside.replace(kept)
    with np.load(kept) as arrays:
        return Rendered(rig, arrays["references"], arrays["sources"], arrays["depths"])


def random_rigs(count: int, frames: int, quick: bool, **limits):
    """Random rigs of small images, every third by night; `limits` as of `synthetic.random_rig`."""
    sizes = (WIDTH, HEIGHT, SOURCE_WIDTH, SOURCE_HEIGHT)
    if quick:
        sizes = tuple(side // 2 for side in sizes)
    for seed in range(count):
        rig = synthetic.random_rig(seed, *sizes, **limits)
        yield rendered(rig, frames, seed, night=seed % 3 == 2)


# Axes off by up to 6 % of the width, like fields of view: the night rig, roughly.
NEAR = {
    "hfov_deg": (40, 50),
    "fov_ratio": (0.85, 1.18),
    "max_offset": 0.06,
    "max_roll_deg": 2.0,
    "max_baseline": 0.3,
}


class Night:
    """The night rig with its frames on the grid that they are judged on."""

    def __init__(self, rig: NightRig) -> None:
        self.rig = rig
        self.size = SIZE

    @staticmethod
    def open() -> "Night | None":
        rig = NightRig.open()
        return rig and Night(rig)

    @cached_property
    def names(self) -> list[str]:
        return sorted(self.rig.held + self.rig.fitted)

    def fold(self, k: int) -> tuple[list[str], list[str]]:
        """Frames to fit on and to judge: of five folds, the last is the one of `NightRig`."""
        held = self.names[k::5]
        return [n for n in self.names if n not in held], held

    def reference(self, name: str) -> np.ndarray:
        return cv2.resize(gray(self.rig.visible(name)), SIZE, interpolation=cv2.INTER_AREA)

    def source(self, name: str) -> np.ndarray:
        return gray(self.rig.thermal(name))

    def calibrate(self, names, depth, options=None, initial=None) -> xcalib.CalibrationResult:
        return xcalib.calibrate(
            [self.rig.visible(n) for n in names],
            [self.rig.thermal(n) for n in names],
            [depth(n) for n in names],
            initial=initial,
            options=options or xcalib.CalibrationOptions(),
        )

    def registrar(self, rig: xcalib.Rig) -> xcalib.Registrar:
        return xcalib.Registrar(rig.resized(*SIZE, rig.source.width, rig.source.height))


def mapped(registrar: xcalib.Registrar, source: np.ndarray, depth: np.ndarray):
    """A registrar's map, and where it counts: seen, not hidden, of known depth."""
    at = registrar.map(depth)
    _, mask = registrar.register(source, depth)
    return at, mask == 0
