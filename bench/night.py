"""The night rig: its frames, which of them no fit may see, and how a rig is judged on those."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from common import data

import xcalib
from xcalib import metrics
from xcalib.depth import read_depth

SIZE = (583, 473)


def gray(image: np.ndarray) -> np.ndarray:
    one = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
    return one.astype(np.float32) / 255


@dataclass(frozen=True)
class View:
    """A held-out frame as it is judged."""

    reference: np.ndarray
    unregistered: np.ndarray
    registered: np.ndarray
    inside: np.ndarray  # valid, eroded by 2


@dataclass(frozen=True)
class NightRig:
    folder: Path
    held: tuple[str, ...]  # sorted names, every fifth from the fifth
    fitted: tuple[str, ...]

    @staticmethod
    def open() -> "NightRig | None":
        folder = data("lynred_night")
        if folder is None:
            return None
        names = sorted(p.name for p in (folder / "visible").iterdir())
        held = names[4::5]
        return NightRig(folder, tuple(held), tuple(n for n in names if n not in held))

    @cache  # noqa: B019 one rig a run
    def visible(self, name: str) -> np.ndarray:
        return cv2.imread(str(self.folder / "visible" / name))

    @cache  # noqa: B019
    def thermal(self, name: str) -> np.ndarray:
        return cv2.imread(str(self.folder / "thermal" / name), cv2.IMREAD_UNCHANGED)

    def depth(self, kind: str, name: str) -> np.ndarray:
        """`depth_filled` or `depth` [m]."""
        return read_depth(self.folder / kind / name)

    def fit(self, depth) -> xcalib.CalibrationResult:
        """On the 32 frames; `depth(name)` gives the map of one."""
        return xcalib.calibrate(
            [self.visible(n) for n in self.fitted],
            [self.thermal(n) for n in self.fitted],
            [depth(n) for n in self.fitted],
        )

    def views(self, rig: xcalib.Rig, depth):
        """The held-out frames, each with its depth."""
        registrar = xcalib.Registrar(rig.resized(*SIZE, rig.source.width, rig.source.height))
        for name in self.held:
            thermal = gray(self.thermal(name))
            registered, mask = registrar.register(thermal, depth(name))
            yield View(
                cv2.resize(gray(self.visible(name)), SIZE, interpolation=cv2.INTER_AREA),
                cv2.resize(thermal, SIZE),
                registered,
                cv2.erode((mask == 0).astype(np.uint8), np.ones((5, 5), np.uint8)),
            )


def gains(views: list[View], same_mask: bool = False) -> dict[str, tuple[float, float]]:
    """NEC and GC, (unregistered, registered): the one over the whole frame, or the same pixels."""
    found = {}
    for name, score in (("NEC", metrics.nec), ("GC", metrics.gc)):
        before = [
            score(v.reference, v.unregistered, v.inside if same_mask else None) for v in views
        ]
        after = [score(v.reference, v.registered, v.inside) for v in views]
        found[name] = float(np.mean(before)), float(np.mean(after))
    return found


def patches(views: list[View], image: str = "registered") -> np.ndarray:
    """Lengths of the patch residual over all views [px]."""
    return np.concatenate(
        [metrics.patch_residual(v.reference, getattr(v, image), v.inside).norms for v in views]
    )
