"""Where a rig puts the pixels of the reference image in the source camera, from their depth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._core import Rig

Array = NDArray[Any]


def targets(rig: Rig, depth: Array) -> Array:
    """x, y [px] and depth [m] in the source camera of every reference pixel: (H, W, 3) float64.

    x_S = pi(D K_S R K_R^-1 x~ + K_S t); NaN where the depth is unknown (0, negative, NaN, inf) or
    the point not before the camera.
    """
    height, width = depth.shape
    known = np.isfinite(depth) & (depth > 0)
    ys, xs = np.nonzero(known)
    R, t = np.asarray(rig.R, np.float64), np.asarray(rig.t, np.float64).reshape(3, 1)
    K_reference, K_source = (np.asarray(c.K, np.float64) for c in (rig.reference, rig.source))
    rays = np.linalg.inv(K_reference) @ np.stack([xs, ys, np.ones(len(xs))])
    points = R @ (rays * depth[known].astype(np.float64)) + t
    pixels = K_source @ points
    found = np.full((height, width, 3), np.nan)
    z = np.where(points[2] > 0, points[2], np.nan)
    found[known] = np.stack([pixels[0] / z, pixels[1] / z, z], axis=1)
    return found


def inside_image(targets: Array, width: int, height: int) -> Array:
    """Which of `targets` lie in an image of this size, up to its outermost pixel centres: bool."""
    x, y, z = np.moveaxis(targets, -1, 0)
    inside: Array = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1) & (z > 0)
    return inside
