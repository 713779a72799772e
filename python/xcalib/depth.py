"""Depth of the reference frames: from files, or from a prior on the road.

A provider is called with the index of a frame and its reference image and returns the depth map
``(h, w)`` float32 in metres along the optical axis, 0 where unknown. Its size is free, its aspect
is that of the reference image.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .frames import Image, InputError, decode, list_files, pair, same_aspect, size_of

DEPTH_SUFFIXES = (".png", ".npy", ".tif", ".tiff", ".exr")
PNG_SCALE = 1 / 256
"""Metres per count of a 16-bit PNG (KITTI)."""

Depth = NDArray[np.float32]


class DepthProvider(Protocol):
    """Depth of frame ``index``, whose reference image is given: ``(h, w)`` float32 [m]."""

    def __call__(self, index: int, reference: Image) -> Depth: ...


@dataclass(frozen=True)
class PlaneDepth:
    """Road-plane prior: a flat road under a level camera, and everything else far away.

    ``D(y) = camera_height * fy / (y - horizon row)``, never beyond ``far``, which is also the
    depth at and above the horizon.
    """

    camera_height: float = 1.6
    """Height of the reference camera above the road [m], > 0."""
    horizon: float = 0.5
    """Row of the horizon as a fraction of the image height from the top, (-1, 1)."""
    far: float = 60.0
    """Largest depth [m], > 0."""
    hfov_deg: float = 45.0
    """Horizontal field of view of the reference camera [deg], (0, 180); pixels are square."""

    def __post_init__(self) -> None:
        for name, low, high, unit in (
            ("camera_height", 0.0, math.inf, "m"),
            ("horizon", -1.0, 1.0, "of the image height"),
            ("far", 0.0, math.inf, "m"),
            ("hfov_deg", 0.0, 180.0, "deg"),
        ):
            value = getattr(self, name)
            if not low < value < high:  # NaN fails too
                between = f"above {low:g}" if high == math.inf else f"between {low:g} and {high:g}"
                raise InputError(f"plane {name} is {value:g}, expected {between} {unit}")

    def __call__(self, index: int, reference: Image) -> Depth:
        width, height = size_of(reference)
        fy = 0.5 * width / math.tan(math.radians(self.hfov_deg) / 2)
        below = np.arange(height) - (self.horizon * height - 0.5)  # rows below the horizon [px]
        depth = np.full(height, self.far)
        road = below > 0
        depth[road] = np.minimum(self.camera_height * fy / below[road], self.far)
        return np.repeat(depth.astype(np.float32)[:, None], width, axis=1)


class FolderDepth:
    """Depth maps of a folder, one per reference image, paired with them by `frames.pair`."""

    def __init__(
        self, folder: str | Path, reference_paths: Sequence[Path], scale: float = PNG_SCALE
    ) -> None:
        if not 0 < scale < math.inf:
            raise InputError(f"depth scale is {scale:g}, expected above 0 m per count")
        self.paths = [depth for _, depth in pair(reference_paths, _list_depths(Path(folder)))]
        self.scale = scale

    def __call__(self, index: int, reference: Image) -> Depth:
        path = self.paths[index]
        depth = read_depth(path, self.scale)
        (w, h), (width, height) = size_of(depth), size_of(reference)
        if not same_aspect((w, h), (width, height)):
            raise InputError(
                f"{path}: depth is {w}x{h}, but the reference image is {width}x{height};"
                " expected the same aspect"
            )
        return depth


def _list_depths(folder: Path) -> list[Path]:
    return list_files(folder, DEPTH_SUFFIXES)


def read_depth(path: str | Path, scale: float = PNG_SCALE) -> Depth:
    """Read one depth map: ``(h, w)`` float32 [m], 0 where it is not positive and finite.

    Parameters
    ----------
    path
        16-bit PNG in counts of ``scale``; or .npy, .tiff, .exr in metres.
    scale
        Metres per count of a PNG.
    """
    path = Path(path)
    values = _read_values(path)
    if values.ndim == 3 and values.shape[2] == 1:
        values = values[..., 0]
    if values.ndim != 2:
        raise InputError(f"{path}: depth has shape {values.shape}, expected one channel (h, w)")
    if path.suffix.lower() == ".png":
        if values.dtype != np.uint16:
            raise InputError(f"{path}: depth is {values.dtype}, expected a 16-bit PNG")
        depth = values.astype(np.float32) * np.float32(scale)
    else:
        if not np.issubdtype(values.dtype, np.floating):
            raise InputError(f"{path}: depth is {values.dtype}, expected floats in metres")
        depth = values.astype(np.float32)
    depth[~((depth > 0) & np.isfinite(depth))] = 0
    if not depth.any():
        raise InputError(f"{path}: all depth is unknown, expected some pixels above 0 m")
    return depth


def _read_values(path: Path) -> NDArray[np.generic]:
    suffix = path.suffix.lower()
    if suffix == ".npy":
        try:
            values = np.load(path, allow_pickle=False)
        except (ValueError, EOFError):
            raise InputError(f"{path}: cannot decode, truncated or not a .npy array") from None
        return np.asarray(values)
    if suffix == ".exr":
        # OpenCV reads EXR only on request, and its pip wheels are built without it.
        os.environ.setdefault("OPENCV_IO_ENABLE_OPENEXR", "1")
        try:
            return decode(path)
        except InputError as error:
            raise InputError(
                f"{error}, or this OpenCV is built without OpenEXR (as the pip wheels are);"
                " .npy and .tiff in metres are read everywhere"
            ) from None
    return decode(path)


def open_depth(
    spec: str | Path,
    reference_paths: Sequence[Path],
    scale: float = PNG_SCALE,
    plane: PlaneDepth | None = None,
) -> DepthProvider:
    """The depth provider that a ``--depth`` argument names.

    Parameters
    ----------
    spec
        A folder of depth maps, or the word ``plane`` (a folder of that name: ``./plane``).
    reference_paths
        Files of the reference images, in the order of the frames.
    scale
        Metres per count of 16-bit PNG depth.
    plane
        The prior used for ``plane``.
    """
    if str(spec) == "plane":
        return plane or PlaneDepth()
    if not Path(spec).is_dir():
        raise InputError(f"depth {spec}: expected an existing folder of depth maps, or `plane`")
    return FolderDepth(spec, reference_paths, scale)
