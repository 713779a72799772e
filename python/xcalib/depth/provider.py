"""What a source of depth is."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..frames import Image

Depth = NDArray[np.float32]


def reciprocal(values: Depth) -> Depth:
    """Inverse depth of depth, and back: 0 where it is not above 0."""
    return np.divide(1, values, out=np.zeros(values.shape, np.float32), where=values > 0)


class DepthProvider(Protocol):
    """Depth of frame ``index``, whose reference image is given: ``(h, w)`` float32 [m]."""

    def __call__(self, index: int, reference: Image) -> Depth: ...
