"""How the frames of a camera move, for what straightens a rolling shutter."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .frames import Image


def motion_between(first: Image, second: Image) -> NDArray[np.float32]:
    """Dense optical flow, OpenCV's DIS, between (H, W) uint8 images: (H, W, 2) [px].

    Refined at full size, since edges count here.
    """
    flow = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow.setFinestScale(0)
    flow.setVariationalRefinementIterations(15)
    out = np.zeros((*first.shape, 2), np.float32)
    flow.calc(first, second, out)
    return out
