"""Depth from a rectified stereo partner of the reference camera."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from ..frames import Image, InputError, gray, list_files, pair, read_image, size_of
from ..yaml_file import load_yaml
from .provider import Depth, DepthProvider

BLOCK = 5
"""Side of the matched blocks [px]."""
LEFT_RIGHT = 1.0
"""Largest disagreement of the two directions of matching [px]."""


@dataclass(frozen=True)
class StereoGeometry:
    """A rectified pair whose right camera is the partner: z = focal * baseline / (d + doffs)."""

    baseline: float
    """Distance of the partner, to the right of the reference camera [m]."""
    focal: float
    """Focal length of the rectified reference images [px]."""
    doffs: float = 0.0
    """Principal point of the partner minus that of the reference, along x [px]."""

    def __post_init__(self) -> None:
        for name, unit in (("baseline", "m"), ("focal", "px")):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise InputError(f"stereo {name} is {value:g}, expected above 0 {unit}")
        if not math.isfinite(self.doffs):
            raise InputError(f"stereo doffs is {self.doffs:g}, expected a finite number [px]")


def read_stereo_geometry(path: str | Path) -> StereoGeometry:
    """Read YAML with ``baseline`` [m], ``focal`` [px] and, if not 0, ``doffs`` [px]."""
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected a stereo calibration (.yaml)")
    document = load_yaml(path, ("baseline", "focal"), ("doffs",))
    for key, value in document.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise InputError(f"{path}: {key} is {value!r}, expected a number")
    return StereoGeometry(**{key: float(value) for key, value in document.items()})


def disparity(
    left: Image, right: Image, lowest: int = 0, span: int | None = None
) -> NDArray[np.float32]:
    """Disparity ``(h, w)`` float32 [px] of the left image, NaN where unknown.

    Semi-global matching (OpenCV's, three-way) to 1/16 px. A match counts if that of the right
    image to the left agrees within `LEFT_RIGHT`.

    Parameters
    ----------
    left, right
        Rectified images of one size, ``(H, W)`` or ``(H, W, 3)``.
    lowest
        Smallest disparity sought [px].
    span
        Range of disparities sought [px]; None: a quarter of the width.
    """
    if left.shape[:2] != right.shape[:2]:
        raise InputError(
            f"stereo partner is {right.shape[1]}x{right.shape[0]},"
            f" the reference {left.shape[1]}x{left.shape[0]}; expected one size"
        )
    height, width = left.shape[:2]
    span = 16 * max(1, math.ceil((width / 4 if span is None else span) / 16))
    images = [np.rint(255 * gray(image).clip(0, 1)).astype(np.uint8) for image in (left, right)]
    forward = _matched(images[0], images[1], lowest, span)
    backward = _matched(images[1][:, ::-1], images[0][:, ::-1], lowest, span)[:, ::-1]
    nearby = np.rint(np.nan_to_num(forward)).astype(np.intp)
    there = np.arange(width) - nearby
    inside = (there >= 0) & (there < width)
    rows = np.arange(height)[:, None]
    answer = backward[rows, there.clip(0, width - 1)]
    # NaN on either side compares false.
    agreed = inside & (np.abs(answer - forward) <= LEFT_RIGHT)
    return np.where(agreed, forward, np.float32(np.nan)).astype(np.float32, copy=False)


def _matched(
    left: NDArray[np.uint8], right: NDArray[np.uint8], lowest: int, span: int
) -> NDArray[np.float32]:
    """Disparity of ``left`` [px], NaN where the matcher has none."""
    matcher = cv2.StereoSGBM.create(
        minDisparity=lowest,
        numDisparities=span,
        blockSize=BLOCK,
        P1=8 * BLOCK**2,
        P2=32 * BLOCK**2,
        uniquenessRatio=5,
        speckleWindowSize=100,
        speckleRange=2,
        preFilterCap=31,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    # The matcher leaves out the columns from which the largest disparity points out of the image.
    margin, beyond = max(0, lowest + span), max(0, -lowest)
    wide = [
        cv2.copyMakeBorder(image, 0, 0, margin, beyond, cv2.BORDER_REPLICATE)
        for image in (np.ascontiguousarray(left), np.ascontiguousarray(right))
    ]
    fixed = matcher.compute(*wide)[:, margin : margin + left.shape[1]]
    found: NDArray[np.float32] = fixed.astype(np.float32) / np.float32(16)
    found[fixed < 16 * lowest] = np.nan
    return found


class StereoDepth(DepthProvider):
    """Depth from a folder of the partner's images, paired with the references by `frames.pair`."""

    is_parallel = True

    def __init__(
        self,
        folder: str | Path,
        reference_paths: Sequence[Path],
        geometry: StereoGeometry,
    ) -> None:
        self.paths = [partner for _, partner in pair(reference_paths, list_files(folder))]
        self.geometry = geometry

    def __call__(self, index: int, reference: Image) -> Depth:
        g = self.geometry
        path = self.paths[index]
        partner = read_image(path)
        if size_of(partner) != size_of(reference):
            raise InputError(
                f"{path} is {partner.shape[1]}x{partner.shape[0]}, expected"
                f" {reference.shape[1]}x{reference.shape[0]} as its reference image"
            )
        # Nothing is beyond infinity, where the disparity is -doffs.
        offset = disparity(reference, partner, lowest=math.floor(-g.doffs)) + np.float32(g.doffs)
        depth = np.zeros(offset.shape, np.float32)
        np.divide(g.focal * g.baseline, offset, out=depth, where=offset > 0)
        if not depth.any():
            raise InputError(
                f"{path}: no match with its reference image; expected the right image of a"
                " rectified pair"
            )
        return depth

    def files_of(self, index: int) -> list[Path]:
        return [self.paths[index]]
