"""Sky, clouds and the hills at the horizon."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np

from .painter import Painter
from .scene import Face
from .texture import Array, Texture


class Sky(Painter):
    """Paints a box of directions."""

    def sky(self) -> list[Face]:
        """Five sides of a box of directions; clouds lie in a flat layer, so they shrink afar."""
        spans: list[tuple[Any, Any, Any]] = [
            ((-1, -1, 1), (2, 0, 0), (0, 2, 0)),
            ((-1, -1, -1), (0, 0, 2), (0, 2, 0)),
            ((1, -1, 1), (0, 0, -2), (0, 2, 0)),
            ((1, -1, -1), (-2, 0, 0), (0, 2, 0)),
            ((-1, -1, -1), (2, 0, 0), (0, 0, 2)),
        ]
        faces = []
        for origin, right, down in spans:
            origin, right, down = (np.asarray(v, np.float64) for v in (origin, right, down))
            faces.append(Face(origin, right, down, self.sky_texture(origin, right, down)))
        return faces

    def sky_texture(self, origin: Array, right: Array, down: Array, size: int = 512) -> Texture:
        """The sky seen through one side of the box, (size, size)."""
        steps = (np.arange(size, dtype=np.float32) + 0.5) / size
        u, v = np.meshgrid(steps, steps)
        ray = origin.astype(np.float32) + u[..., None] * right.astype(np.float32)
        ray += v[..., None] * down.astype(np.float32)
        ray /= np.linalg.norm(ray, axis=-1, keepdims=True)
        up = np.clip(-ray[..., 1], 0, 1)
        clouds = cv2.remap(  # reflected at the border of the bank, so that the layer has no end
            cv2.GaussianBlur(self.bank.image, (0, 0), 5),
            100 * ray[..., 0] / (up + 0.12) + 640,
            100 * ray[..., 2] / (up + 0.12) + 640,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REFLECT,
        )
        cover = np.clip(clouds * 0.55 + 0.35, 0, 1)
        blue = np.array([225, 185, 145]) + (up[..., None] ** 0.5) * np.array([-10, -50, -70])
        colour = blue + cover[..., None] * (np.array([238, 238, 240]) - blue)
        heat = 22 + 45 * cover + 26 * (1 - up)
        hills = self.bank.patch((1, size))[0]
        ridge = 0.02 + 0.012 * cv2.GaussianBlur(hills[None, :], (0, 0), 4)[0]
        below = -ray[..., 1] < ridge[None, :]
        colour[below] = (138, 132, 118)
        heat[below] = 100
        # At night the sky is lit by the town, not by the lamps: it glows a little, most at the
        # horizon.
        glow = np.where(below, 6, 10 + 14 * (1 - up) ** 4)
        return Texture(
            np.dstack([colour, glow]).clip(0, 255).astype(np.uint8),
            heat.clip(0, 255).astype(np.uint8),
        )
