"""Depth made fit for video: steadied in time, and only where asked for."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._core import compressed_guide
from ..frames import Image, size_of
from .provider import Depth, DepthProvider, reciprocal

Array = NDArray[Any]
"""float32."""

MEMORY = 4
"""Frames that a steadied value is the mean of, at most."""
GATE = 0.04
"""Innovation that starts a pixel anew: depth against its prediction, around it, relative."""
MOTION = 0.04
"""Difference of the compressed image from its prediction that starts a pixel anew."""
PATCH = 5
"""Side of the square that both are averaged over [px]."""


@dataclass
class SteadyDepth:
    """Depth of another provider, averaged over time along the image flow; causal.

    Call it with consecutive frames. Any other frame starts it anew and passes as it is.
    """

    provider: DepthProvider
    _last: int | None = field(default=None, init=False)
    _inverse: Array = field(default_factory=lambda: np.empty((0, 0), np.float32), init=False)
    _image: Array = field(default_factory=lambda: np.empty((0, 0), np.float32), init=False)
    _count: Array = field(default_factory=lambda: np.empty((0, 0), np.float32), init=False)
    _flow: cv2.DISOpticalFlow = field(
        default_factory=lambda: cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_FAST),
        init=False,
    )

    def __call__(self, index: int, reference: Image) -> Depth:
        """Depth ``(h, w)`` float32 [m]: running mean of inverse depth, of `MEMORY` frames at most.

        A pixel starts anew where depth or image around it has changed (`GATE`, `MOTION`), and
        where it was unknown. Unknown pixels stay unknown.
        """
        depth = self.provider(index, reference)
        known = depth > 0
        inverse = reciprocal(depth)
        image = compressed_guide(reference, *size_of(depth))
        count = known.astype(np.float32)
        if self._last == index - 1 and self._inverse.shape == inverse.shape:
            predicted, before, seen = self._carried(image)
            both = known & (seen > 0)
            if both.any():
                # Driving by v [m] takes inverse depth u to u + v u^2: one v for the whole frame.
                step = (inverse - predicted)[both]
                predicted += np.median(step / predicted[both] ** 2) * predicted**2
            step = np.where(both, inverse - predicted, np.float32(0))
            side = (PATCH, PATCH)
            innovation = np.abs(cv2.blur(step, side))
            motion = cv2.blur(np.abs(image - before), side)
            still = both & (innovation < GATE * predicted) & (motion < MOTION)
            count = np.where(still, np.minimum(seen + 1, MEMORY), count)
            inverse = np.where(still, predicted + step / np.maximum(count, 1), inverse)
        self._last, self._inverse, self._image, self._count = index, inverse, image, count
        return reciprocal(inverse)

    def _carried(self, image: Array) -> tuple[Array, Array, Array]:
        """The last inverse depth, image and count where this image shows the same things."""
        now, last = (np.rint(255 * one).astype(np.uint8) for one in (image, self._image))
        flow = self._flow.calc(now, last, np.zeros((*image.shape, 2), np.float32))
        h, w = image.shape
        x = flow[..., 0] + np.arange(w, dtype=np.float32)
        y = flow[..., 1] + np.arange(h, dtype=np.float32)[:, None]
        inverse = cv2.remap(self._inverse, x, y, cv2.INTER_NEAREST, borderValue=0)
        before = cv2.remap(self._image, x, y, cv2.INTER_LINEAR, borderValue=0)
        count = cv2.remap(self._count, x, y, cv2.INTER_NEAREST, borderValue=0)
        return inverse, before, count
