"""Radiometric JPEGs of FLIR cameras: the visible image, the counts or temperatures in them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .._core import FlirParts, flir_parts, plain_counts
from ..frames import DecodeError, Image, InputError, as_image, decode_bytes
from .files import ImageFiles

PARTS = ("visible", "thermal", "temperature")
"""What ``#`` behind a folder of such files may take."""


def parts_of(path: Path) -> FlirParts | None:
    """What a file has in it; None where it is no radiometric JPEG."""
    if path.suffix.lower() not in (".jpg", ".jpeg") or not path.is_file():
        return None
    return flir_parts(path.read_bytes(), str(path))


class RadiometricFiles(ImageFiles):
    """One of `PARTS` of each file."""

    def __init__(self, paths: Sequence[Path], part: str) -> None:
        super().__init__(paths)
        self.part = part

    def read(self, index: int) -> Image:
        path = self.paths[index]
        parts = parts_of(path)
        if parts is None:
            raise InputError(
                f"{path}: no radiometric JPEG of a FLIR camera, expected one to take its"
                f" {self.part} image"
            )
        if self.part == "visible":
            if not parts.visible:
                raise InputError(f"{path}: has no visible image in it, only the thermal one")
            return as_image(decode_bytes(parts.visible, self.where(index)), self.where(index))
        counts = _counts(parts, self.where(index))
        if self.part == "thermal":
            return counts
        celsius = parts.celsius(counts)
        if celsius is None:
            raise InputError(f"{path}: does not say what temperatures its counts are")
        return celsius

    def where(self, index: int) -> str:
        return f"{self.paths[index]} ({self.part})"


def _counts(parts: FlirParts, where: str) -> Image:
    if not parts.is_file:
        try:
            return plain_counts(parts)
        except DecodeError as error:
            raise DecodeError(f"{where}: {error}") from None
    counts = decode_bytes(parts.thermal, where)
    if counts.dtype != np.uint16 or counts.ndim != 2:
        raise DecodeError(f"{where}: counts are {counts.dtype} {counts.shape}, expected uint16")
    return counts.byteswap() if parts.big_endian else counts
