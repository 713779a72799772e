"""One distance for all pixels, where the scene is flat or far."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from ..frames import Image, InputError
from .provider import Depth, DepthProvider


class ConstantDepth(DepthProvider):
    """A plane before the camera, square to its axis: what a homography assumes."""

    is_parallel = True

    def __init__(self, metres: float) -> None:
        if not 0 < metres < math.inf:
            raise InputError(f"depth is {metres:f}, expected a distance above 0 m")
        self.metres = metres

    def __call__(self, index: int, reference: Image) -> Depth:
        return np.full(reference.shape[:2], self.metres, np.float32)


def distance_of(spec: str | Path) -> float | None:
    """The number that a ``--depth`` argument is; None where it is none, or the name of a path."""
    text = str(spec)
    try:
        metres = float(text) if text.isascii() and "_" not in text else None
    except ValueError:
        return None
    return None if Path(text).exists() else metres
