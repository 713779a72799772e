"""What a source of depth is."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..frames import Image

Depth = NDArray[np.float32]


class DepthProvider(Protocol):
    """Depth of frame ``index``, whose reference image is given: ``(h, w)`` float32 [m]."""

    def __call__(self, index: int, reference: Image) -> Depth: ...
