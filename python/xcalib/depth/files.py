"""Depth maps from files."""

from __future__ import annotations

import importlib
import importlib.util
import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import read_npy
from ..frames import Image, InputError, decode, list_files, pair, same_aspect, size_of
from .provider import Depth, DepthProvider

DEPTH_SUFFIXES = (".png", ".npy", ".tif", ".tiff", ".exr")
PNG_SCALE = 1 / 256
"""Metres per count of a 16-bit PNG (KITTI)."""


class FolderDepth(DepthProvider):
    """Depth maps of a folder, one per reference image, paired with them by `frames.pair`."""

    is_parallel = True
    looks_at_reference = False

    def __init__(
        self, folder: str | Path, reference_paths: Sequence[Path], scale: float = PNG_SCALE
    ) -> None:
        if not 0 < scale < math.inf:
            raise InputError(f"depth scale is {scale:g}, expected above 0 m per count")
        self.paths = [
            depth for _, depth in pair(reference_paths, list_files(folder, DEPTH_SUFFIXES))
        ]
        self.scale = scale

    def __call__(self, index: int, reference: Image) -> Depth:
        path = self.paths[index]
        return fitting(read_depth(path, self.scale), reference, str(path))

    def files_of(self, index: int) -> list[Path]:
        return [self.paths[index]]


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
    return known(depth, str(path))


def known(depth: Depth, where: str) -> Depth:
    """The map with 0, in place, where it is not positive and finite; some pixel must be."""
    depth[~((depth > 0) & np.isfinite(depth))] = 0
    if not depth.any():
        raise InputError(f"{where}: all depth is unknown, expected some pixels above 0 m")
    return depth


def fitting(depth: Depth, reference: Image, where: str) -> Depth:
    """The map, if it has the aspect of the reference image."""
    (w, h), (width, height) = size_of(depth), size_of(reference)
    if not same_aspect((w, h), (width, height)):
        raise InputError(
            f"{where}: depth is {w}x{h}, but the reference image is {width}x{height};"
            " expected the same aspect"
        )
    return depth


def _read_values(path: Path) -> NDArray[np.generic]:
    suffix = path.suffix.lower()
    if suffix == ".npy":
        return read_npy(path).copy()
    if suffix == ".exr":
        if importlib.util.find_spec("OpenEXR"):
            return _read_exr(path)
        # OpenCV reads EXR only on request, and its pip wheels are built without it.
        os.environ.setdefault("OPENCV_IO_ENABLE_OPENEXR", "1")
        try:
            return decode(path)
        except InputError as error:
            raise InputError(
                f"{error}, or this OpenCV is built without OpenEXR (as the pip wheels are):"
                " `pip install OpenEXR`; .npy and .tiff in metres are read everywhere"
            ) from None
    return decode(path)


def _read_exr(path: Path) -> NDArray[np.generic]:
    """The only channel of an EXR file, or the one named Z, by the optional package OpenEXR."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        with importlib.import_module("OpenEXR").File(str(path), separate_channels=True) as file:
            windows = [np.array(file.header()[key]) for key in ("dataWindow", "displayWindow")]
            channels = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
    except (RuntimeError, ValueError):
        raise InputError(f"{path}: cannot decode, truncated or not an EXR file") from None
    if not np.array_equal(windows[0], windows[1]):
        raise InputError(f"{path}: its data window is a part of the image, expected all of it")
    name = next(iter(channels)) if len(channels) == 1 else "Z"
    if name not in channels:
        raise InputError(
            f"{path}: channels are {', '.join(channels)}, expected only one, or one named Z"
        )
    return np.asarray(channels[name])
