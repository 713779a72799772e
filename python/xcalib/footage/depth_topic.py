"""Depth from an image topic of a bag."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .._core import DepthUnits, metres_of, units_line
from ..depth import Depth, DepthProvider
from ..depth.files import fitting
from ..frames import Image, InputError
from .bag import is_bag
from .stream import Stream

MILLIMETRE = 1e-3


def is_depth_topic(spec: str) -> bool:
    """Whether a ``--depth`` argument names a bag, with a topic or with only one in it."""
    return is_bag(Path(spec.rpartition("#")[0] or spec))


class TopicDepth(DepthProvider):
    """Depth maps of a stream as REP 118 has them: 32FC1 in metres, 16UC1 in millimetres.

    Parameters
    ----------
    stream
        Images ``(h, w)``, float32 or uint16, 0 or NaN where depth is unknown.
    """

    looks_at_reference = False

    def __init__(self, stream: Stream, units: DepthUnits | None = None) -> None:
        self.stream = stream
        self.units = units or DepthUnits()

    def __call__(self, index: int, reference: Image) -> Depth:
        numbers, where = self._numbers(index), self.stream.where(index)
        metres = metres_of(numbers, self._units_of(numbers), where, is_png=False)
        return fitting(metres, reference, where)

    def _units_of(self, numbers: Image) -> DepthUnits:
        units = self.units
        if units.scale is not None or numbers.dtype != np.uint16:
            return units
        return DepthUnits(scale=MILLIMETRE, invalid=units.invalid)

    def line(self) -> str:
        try:
            numbers = self._numbers(0)
        except InputError:
            return ""
        return units_line(numbers, self._units_of(numbers), self.stream.where(0), is_png=False)

    def _numbers(self, index: int) -> Image:
        image, where = self.stream[index], self.stream.where(index)
        if image.ndim != 2 or image.dtype not in (np.uint16, np.float32):
            shape = "x".join(map(str, image.shape))
            raise InputError(
                f"{where}: depth is {shape} {image.dtype}, expected 32FC1 in metres or 16UC1 in"
                " millimetres"
            )
        return image

    def files_of(self, index: int) -> list[Path]:
        return [self.stream.file(index)]
