"""Where a rig puts the pixels of the reference image in the source camera, from their depth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._core import Pinhole, Rig

Array = NDArray[Any]


def targets(rig: Rig, depth: Array) -> Array:
    """x, y [px] and depth [m] in the source camera of every reference pixel: (H, W, 3) float64.

    x_S = pi(D K_S R K_R^-1 x~ + K_S t), and what the lenses do; NaN where the depth is unknown (0,
    negative, NaN, inf), the point not before the camera, or a lens shows nothing.
    """
    height, width = depth.shape
    known = np.isfinite(depth) & (depth > 0)
    ys, xs = np.nonzero(known)
    R, t = np.asarray(rig.R, np.float64), np.asarray(rig.t, np.float64).reshape(3, 1)
    rays = np.vstack([rays_at(rig.reference, xs, ys).T, np.ones(len(xs))])
    points = R @ (rays * depth[known].astype(np.float64)) + t
    if rig.source_mirrored:
        points[0] *= -1
    found = np.full((height, width, 3), np.nan)
    z = np.where(points[2] > 0, points[2], np.nan)
    found[known] = np.column_stack([pixels_of(rig.source, (points[:2] / z).T), z])
    return found


def rays_at(camera: Pinhole, xs: Array, ys: Array) -> Array:
    """(N, 2): X/Z and Y/Z of what the camera shows at pixels; NaN where its lens shows nothing."""
    at = np.linalg.inv(np.asarray(camera.K, np.float64)) @ np.stack([xs, ys, np.ones(len(xs))])
    return camera.lens.undistort(at[:2].T) if camera.lens.bends else at[:2].T


def pixels_of(camera: Pinhole, points: Array) -> Array:
    """(N, 2): the pixels where the camera shows points (X/Z, Y/Z), (N, 2); NaN where none."""
    shown = camera.lens.distort(points) if camera.lens.bends else points
    K = np.asarray(camera.K, np.float64)
    pixels: Array = shown @ K[:2, :2].T + K[:2, 2]
    return pixels


def inside_image(targets: Array, width: int, height: int) -> Array:
    """Which of `targets` lie in an image of this size, up to its outermost pixel centres: bool."""
    x, y, z = np.moveaxis(targets, -1, 0)
    inside: Array = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1) & (z > 0)
    return inside
