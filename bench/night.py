"""The night rig: its frames, which of them no fit may see, its depths, its fits and views."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from common import data, gray
from judge import EROSION, View

import xcalib
from xcalib._core import fit_plane, frames_to_judge_plane
from xcalib.depth import PlaneDepth, read_depth
from xcalib.depth.completion import MIN_CONFIDENCE, complete

SIZE = (583, 473)
"""Of the grid that frames are judged on, which is that of the depth maps [px]."""

Depth = Callable[[str], np.ndarray]
"""The map [m] of the frame of a name."""


@dataclass(frozen=True)
class NightRig:
    """Frames go by the names of their files. The depths below are `Depth`s."""

    folder: Path
    names: tuple[str, ...]
    """Sorted."""

    @staticmethod
    def open() -> "NightRig | None":
        folder = data("lynred_night")
        if folder is None:
            return None
        return NightRig(folder, tuple(sorted(p.name for p in (folder / "visible").iterdir())))

    def fold(self, k: int) -> tuple[list[str], list[str]]:
        """Frames to fit on, and frames to judge: every fifth from the k-th, k = 0..4."""
        held = self.names[k::5]
        return [n for n in self.names if n not in held], list(held)

    @property
    def fitted(self) -> list[str]:
        return self.fold(4)[0]

    @property
    def held(self) -> list[str]:
        """No fit of a published figure sees these."""
        return self.fold(4)[1]

    @cache  # noqa: B019 one rig a run
    def visible(self, name: str) -> np.ndarray:
        return cv2.imread(str(self.folder / "visible" / name))

    @cache  # noqa: B019
    def thermal(self, name: str) -> np.ndarray:
        return cv2.imread(str(self.folder / "thermal" / name), cv2.IMREAD_UNCHANGED)

    def reference(self, name: str) -> np.ndarray:
        """Gray, on the grid that frames are judged on."""
        return cv2.resize(gray(self.visible(name)), SIZE, interpolation=cv2.INTER_AREA)

    def source(self, name: str) -> np.ndarray:
        return gray(self.thermal(name))

    # -- Depth ------------------------------------------------------------------------------------

    def filled(self, name: str) -> np.ndarray:
        """Stereo, with its holes filled."""
        return read_depth(self.folder / "depth_filled" / name)

    def semi_dense(self, name: str) -> np.ndarray:
        """Stereo, where it is sure."""
        return read_depth(self.folder / "depth" / name)

    @cache  # noqa: B019
    def completed(self, name: str) -> np.ndarray:
        """Semi-dense stereo, completed by the image as `--complete` does it."""
        dense, confidence = complete(self.semi_dense(name), self.visible(name))
        return np.where(confidence >= MIN_CONFIDENCE, dense, 0).astype(np.float32)

    def plane(self, name: str) -> np.ndarray:
        return PlaneDepth()(0, self.visible(name))

    def refined_plane(self, rig: xcalib.Rig, names: Sequence[str]) -> PlaneDepth:
        """Horizon and roll found from some of the frames that the rig was fitted on."""
        some = [names[i] for i in frames_to_judge_plane(len(names))]
        images = [self.visible(n) for n in some], [self.thermal(n) for n in some]
        return fit_plane(*images, PlaneDepth(), rig, xcalib.CalibrationOptions())

    def one_depth(self, name: str) -> np.ndarray:
        """The same everywhere: a rig fitted with it is a homography."""
        return np.full(SIZE[::-1], 20.0, np.float32)

    # -- Fitting and registering ------------------------------------------------------------------

    def fit(
        self,
        depth: Depth,
        names: Sequence[str] | None = None,
        options: xcalib.CalibrationOptions | None = None,
        how: Callable[..., xcalib.CalibrationResult] = xcalib.calibrate,
    ) -> xcalib.CalibrationResult:
        """On the frames that are not held out, unless others are named."""
        names = self.fitted if names is None else names
        return how(
            [self.visible(n) for n in names],
            [self.thermal(n) for n in names],
            [depth(n) for n in names],
            options=options or xcalib.CalibrationOptions(),
        )

    def registrar(self, rig: xcalib.Rig) -> xcalib.Registrar:
        """Onto the grid that frames are judged on."""
        return xcalib.Registrar(rig.resized(*SIZE, rig.source.width, rig.source.height))

    def views(self, rig: xcalib.Rig, depth: Depth) -> Iterator[View]:
        """The held-out frames, each with its depth."""
        registrar = self.registrar(rig)
        for name in self.held:
            source = self.source(name)
            registered, mask = registrar.register(source, depth(name))
            inside = cv2.erode((mask == 0).astype(np.uint8), EROSION)
            yield View(self.reference(name), cv2.resize(source, SIZE), registered, inside)
