"""Registering the frames of three folders as a script of twenty lines does it with OpenCV."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

import xcalib


def run(
    rig: xcalib.Rig, sources: Sequence[Path], depths: Sequence[Path], out: Path, scale: float
) -> None:
    """Read, resize the depth, map, remap, write: one frame after the other, images alone.

    scale: metres per count of the depth maps. No lens, no mask, nothing about what is hidden.
    """
    out.mkdir(parents=True, exist_ok=True)
    width, height = rig.reference.width, rig.reference.height
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    h = rig.infinite_homography.astype(np.float32)
    k = (rig.source.K @ rig.t).astype(np.float32)
    rays = [h[i, 0] * x + h[i, 1] * y + h[i, 2] for i in range(3)]
    for source, map_file in zip(sources, depths, strict=True):
        image = cv2.imread(str(source), cv2.IMREAD_UNCHANGED)
        depth = cv2.imread(str(map_file), cv2.IMREAD_UNCHANGED).astype(np.float32) * scale
        depth = cv2.resize(depth, (width, height), interpolation=cv2.INTER_LINEAR)
        z = depth * rays[2] + k[2]
        u, v = (depth * rays[0] + k[0]) / z, (depth * rays[1] + k[1]) / z
        registered = cv2.remap(image, u, v, cv2.INTER_LINEAR)
        cv2.imwrite(str(out / source.name), registered)
