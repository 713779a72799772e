"""Depth maps from files."""

from __future__ import annotations

import importlib
import importlib.util
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import remote
from .._core import DepthUnits, metres_of, read_array, units_line
from ..frames import Image, InputError, decode, list_files, pair, same_aspect, size_of
from .provider import Depth, DepthProvider

DEPTH_SUFFIXES = (".png", ".npy", ".npz", ".pfm", ".tif", ".tiff", ".exr")
PNG_SCALE = 1 / 256
"""Metres per count of a 16-bit PNG (KITTI)."""


class FolderDepth(DepthProvider):
    """Depth maps of a folder, one per reference image, paired with them by `frames.pair`."""

    is_parallel = True
    looks_at_reference = False

    def __init__(
        self,
        folder: str | Path,
        reference_paths: Sequence[Path],
        units: DepthUnits | None = None,
    ) -> None:
        self.units = units or DepthUnits()
        self.units.validate()
        self.paths = [
            depth for _, depth in pair(reference_paths, list_files(folder, DEPTH_SUFFIXES))
        ]

    def __call__(self, index: int, reference: Image) -> Depth:
        path = self.paths[index]
        return fitting(read_depth(path, self.units), reference, str(path))

    def files_of(self, index: int) -> list[Path]:
        return [remote.identity(self.paths[index])]

    def line(self) -> str:
        try:
            first = self.paths[0]
            return units_line(read_numbers(first), self.units, str(first), is_png(first))
        except InputError:
            return ""  # which is said when the map is needed


def read_depth(path: str | Path, units: DepthUnits | None = None) -> Depth:
    """Read one depth map: ``(h, w)`` float32 [m], 0 where it is unknown.

    Parameters
    ----------
    path
        16-bit PNG; or .npy, .npz, .pfm, .tiff, .exr in metres.
    units
        What its numbers mean; None: 1/256 m a count of a PNG, metres of floats.
    """
    path = Path(path)
    return metres_of(read_numbers(path), units or DepthUnits(), str(path), is_png(path))


def is_png(path: Path) -> bool:
    """Whether counts are of 1/256 m where nothing else is said."""
    return path.suffix.lower() == ".png"


def read_numbers(path: Path) -> NDArray[Any]:
    """The numbers of one depth map as they are stored: (h, w) uint16 or float32."""
    with remote.named(path):
        return _read_numbers(path)


def _read_numbers(path: Path) -> NDArray[Any]:
    array = read_array(path, is_image=False)
    if array is not None:
        return array
    values = _decoded(path)
    if values.ndim == 3 and values.shape[2] == 1:
        values = values[..., 0]
    if values.ndim != 2:
        raise InputError(f"{path}: depth has shape {values.shape}, expected one channel (h, w)")
    if is_png(path) and values.dtype != np.uint16:
        raise InputError(f"{path}: depth is {values.dtype}, expected a 16-bit PNG")
    if np.issubdtype(values.dtype, np.floating):
        return values.astype(np.float32)
    if values.dtype != np.uint16:
        raise InputError(f"{path}: depth is {values.dtype}, expected floats in metres")
    return values


def fitting(depth: Depth, reference: Image, where: str) -> Depth:
    """The map, if it has the aspect of the reference image."""
    (w, h), (width, height) = size_of(depth), size_of(reference)
    if not same_aspect((w, h), (width, height)):
        raise InputError(
            f"{where}: depth is {w}x{h}, but the reference image is {width}x{height};"
            " expected the same aspect"
        )
    return depth


def _decoded(path: Path) -> NDArray[Any]:
    if path.suffix.lower() != ".exr":
        return decode(path)
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


def _read_exr(path: Path) -> NDArray[Any]:
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
