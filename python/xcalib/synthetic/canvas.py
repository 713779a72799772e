"""A camera with a lens, rendered: its view without one, from which the lens takes its samples.

Faces are bounded by straight lines only without a lens. So what a bent image shows is rendered by
a pinhole, on a canvas wide enough for all of it and at least as fine, and sampled where the lens
looks.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from .._core import Pinhole
from ..reprojection import rays_at
from .raster import Raster, View
from .texture import Array

_WIDEST = 5.0  # tangent: what lies farther from the axis is not rendered


class Canvas:
    """The canvas of a camera, sampled so many times per pixel and direction.

    camera: the pinhole that renders it. at: (h, w, 2), where each sample of the bent image lies on
    it [px], NaN where the lens shows nothing.
    """

    def __init__(self, camera: Pinhole, samples: int) -> None:
        ys, xs = np.indices((camera.height * samples, camera.width * samples), np.float64)
        pixels = ((part.ravel() + 0.5) / samples - 0.5 for part in (xs, ys))
        rays = rays_at(camera, *pixels).reshape(*xs.shape, 2)
        rays[np.abs(rays).max(axis=-1) > _WIDEST] = np.nan
        # As fine as where the bent image is finest.
        with np.errstate(invalid="ignore"):
            steps = [np.linalg.norm(np.diff(rays, axis=axis), axis=-1) for axis in (0, 1)]
        focal = 1 / min(float(np.nanmin(step)) for step in steps)
        low, high = np.nanmin(rays, axis=(0, 1)), np.nanmax(rays, axis=(0, 1))
        width, height = (int(np.ceil(side)) + 3 for side in focal * (high - low))
        cx, cy = (float(1 - focal * side) for side in low)
        self.camera = Pinhole(width, height, focal, focal, cx, cy)
        self.at = (focal * rays + (cx, cy)).astype(np.float32)

    def view(self, view: View) -> View:
        """The same view, of the canvas."""
        camera = self.camera
        return replace(view, width=camera.width, height=camera.height, K=np.asarray(camera.K))

    def bent(self, image: Array) -> Array:
        """The samples of the bent image, from the canvas's; 0 where the lens shows nothing."""
        x, y = np.moveaxis(self.at, -1, 0)
        beyond = np.float32(-10)  # outside, where the border is 0
        x, y = np.where(np.isnan(x), beyond, x), np.where(np.isnan(y), beyond, y)
        bent: Array = cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        return bent

    def seen(self, raster: Raster) -> tuple[Array, Array]:
        """Depth [m], 0 where unknown, and the id of the face, -1 where none, of every sample."""
        known = np.isfinite(self.at[..., 0])
        x, y = self.at[known].astype(np.float64).T
        faces = raster.faces[np.rint(y).astype(int), np.rint(x).astype(int)]
        depth = np.zeros(known.shape, np.float32)
        owners = np.full(known.shape, -1, raster.ids.dtype)
        depth[known] = raster.depth_of(faces, x, y)
        owners[known] = np.where(faces >= 0, raster.ids[faces], -1)
        return depth, owners
