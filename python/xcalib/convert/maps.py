"""The map of a rig as files that others read: OpenCV's remap tables and optical flow.

A map says for each pixel of the reference where it lies in the source. Flow is that minus the
pixel itself, so it is a displacement between two images of one size; of others it is long.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import InputError, Registrar, Rig
from ..depth import DEPTH_SUFFIXES, PNG_SCALE, DepthUnits, read_depth
from ..frames import (
    check_file_writable,
    check_folder_writable,
    encode_image,
    list_files,
    write_bytes,
)

Map = NDArray[np.float32]

UNKNOWN_FLOW = 1e10
"""In .flo, above 1e9 is unknown."""
KITTI_REACH = 512
"""KITTI's flow is 16 bits of 1/64 px [px]."""


def of_remap(values: Map) -> tuple[bytes, str]:
    """.npy of (H, W, 2) float32, x then y, as cv2.remap takes it; NaN where there is none."""
    file = io.BytesIO()
    np.save(file, values)
    return file.getvalue(), ""


def of_flo(values: Map) -> tuple[bytes, str]:
    """Middlebury's .flo."""
    flow = displacement(values)
    flow[~np.isfinite(flow).all(axis=2)] = UNKNOWN_FLOW
    height, width = flow.shape[:2]
    return b"PIEH" + struct.pack("<2i", width, height) + flow.astype("<f4").tobytes(), ""


def of_kitti(values: Map) -> tuple[bytes, str]:
    """KITTI's flow PNG: u and v, 16 bits of 1/64 px about 2^15, and valid."""
    flow = displacement(values)
    known = np.isfinite(flow).all(axis=2)
    held = known & (np.abs(np.nan_to_num(flow)) < KITTI_REACH).all(axis=2)
    code = np.zeros((*held.shape, 3), np.uint16)  # OpenCV's order: valid, v, u
    code[held, 0] = 1
    code[held, 1:] = np.rint(flow[held][:, ::-1] * 64 + 2**15).clip(0, 2**16 - 1)
    lost = int(known.sum() - held.sum())
    line = f"{lost} pixels move by {KITTI_REACH} px or more, which KITTI's flow cannot hold"
    return encode_image("flow.png", code), line if lost else ""


def displacement(values: Map) -> Map:
    """The map without the pixels themselves."""
    height, width = values.shape[:2]
    grid = np.dstack(np.meshgrid(np.arange(width), np.arange(height))).astype(np.float32)
    return values - grid


MAPS: dict[str, tuple[str, Callable[[Map], tuple[bytes, str]]]] = {
    "remap": (".npy", of_remap),
    "flo": (".flo", of_flo),
    "kitti-flow": (".png", of_kitti),
}
"""By the name that ``--to`` takes: the suffix, and what makes the file."""


def write_maps(rig: Rig, depth: str, scale: float, output: Path, kind: str) -> list[str]:
    """Write the map for a depth in metres, the same everywhere, or for the depth map of a file; of
    a folder of depth maps a folder of maps, under their names. Returns what is left out.
    """
    suffix, encode = MAPS[kind]
    registrar = Registrar(rig)
    shape = rig.reference.height, rig.reference.width
    metres = number(depth)
    jobs: list[tuple[Path, str, NDArray[np.float32] | None]]
    lines = []
    if metres is not None:
        jobs = [(output, "", np.full(shape, metres, np.float32))]
    elif Path(depth).is_dir():
        check_folder_writable(output)
        files = list_files(depth, DEPTH_SUFFIXES)
        jobs = [(output / f"{file.stem}{suffix}", str(file), None) for file in files]
    else:
        jobs = [(output, depth, None)]
    for path, file, values in jobs:
        check_file_writable(str(path))
        if path.suffix.lower() != suffix:
            raise InputError(f"{path}: expected a name that ends in {suffix} for {kind}")
        data, line = encode(registrar.map(read_map(file, scale) if values is None else values))
        if line:
            lines.append(f"{path}: {line}")
        write_bytes(path, data)
    return lines


def read_map(file: str, scale: float) -> NDArray[np.float32]:
    """Depth of a file; the scale is that of a PNG's counts."""
    is_png = Path(file).suffix.lower() == ".png"
    return read_depth(file, DepthUnits(scale=scale) if is_png else None)


def number(depth: str) -> float | None:
    """A depth in metres, None where it is the name of something."""
    try:
        metres = float(depth)
    except ValueError:
        return None
    if not 0 < metres < float("inf"):
        raise InputError(f"depth is {depth} m, expected above 0 and finite")
    return metres


__all__ = ["MAPS", "PNG_SCALE", "write_maps"]
