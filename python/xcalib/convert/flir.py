"""The alignment that a FLIR camera itself gives its two images, in radiometric JPEGs; read only.

A start, not a calibration: the ratio of the fields of view and an offset, for one distance. The
file says nothing of the field of view itself: 45 degrees are assumed of the visible camera.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .._core import InputError, Rig
from ..footage.flir import parts_of
from .format import Format, Sizes


def recognise(path: Path, head: str) -> bool:
    """Any JPEG: what else would it be?"""
    return path.suffix.lower() in (".jpg", ".jpeg")


def read(paths: Sequence[Path], sizes: Sizes) -> Rig:
    """The rig of a file."""
    parts = parts_of(paths[0])
    if parts is None:
        raise InputError(
            f"{paths[0]}: no rig file and no radiometric JPEG of a FLIR camera, expected either"
        )
    return parts.alignment(str(paths[0]))


FORMAT = Format("flir", "a radiometric JPEG", recognise, read)
