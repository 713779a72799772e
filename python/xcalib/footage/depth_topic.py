"""Depth from an image topic of a bag."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..depth import Depth, DepthProvider
from ..depth.files import fitting, known
from ..frames import Image, InputError
from .bag import is_bag
from .stream import Stream

MILLIMETRE = np.float32(1e-3)


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

    def __init__(self, stream: Stream) -> None:
        self.stream = stream

    def __call__(self, index: int, reference: Image) -> Depth:
        image, where = self.stream[index], self.stream.where(index)
        if image.ndim != 2 or image.dtype not in (np.uint16, np.float32):
            shape = "x".join(map(str, image.shape))
            raise InputError(
                f"{where}: depth is {shape} {image.dtype}, expected 32FC1 in metres or 16UC1 in"
                " millimetres"
            )
        metres = image * MILLIMETRE if image.dtype == np.uint16 else image
        return fitting(known(metres.astype(np.float32), where), reference, where)

    def files_of(self, index: int) -> list[Path]:
        return [self.stream.file(index)]
