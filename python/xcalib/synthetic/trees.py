"""Trees."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from .painter import PAVEMENT_HEIGHT, SMALL_REACH, Painter
from .texture import Canvas, Texture


class Trees(Painter):
    """Places trees."""

    def tree(self, x: float, z: float) -> None:
        """A trunk in a crown of four leafy planes, two across the street and two along it."""
        crowns, bark = self.tree_textures
        ground, radius = -PAVEMENT_HEIGHT, self.uniform(1.3, 2.0)
        top = ground - self.uniform(4.6, 6.2)
        more: dict[str, Any] = {"reach": SMALL_REACH}
        self.box((x - 0.14, top + radius, z - 0.14), (x + 0.14, ground, z + 0.14), bark, **more)
        for offset, size in ((-0.55, 0.8), (0.35, 1.0)):
            r = radius * size
            at = offset * radius
            self.quad(
                (x - r, top + radius - r, z + at),
                (2 * r, 0, 0),
                (0, 2.1 * r, 0),
                self.either(*crowns),
                gain=0.8 + 0.25 * size,
                **more,
            )
            self.quad(
                (x + at, top + radius - r, z + r),
                (0, 0, -2 * r),
                (0, 2.1 * r, 0),
                self.either(*crowns),
                gain=0.8 + 0.3 * size,
                **more,
            )

    @cached_property
    def tree_textures(self) -> tuple[list[Texture], Texture]:
        """Crowns, and the bark of all trunks."""
        crowns = [self.crown_texture() for _ in range(3)]
        bark = self.plain_texture((48, 62, 76), self.uniform(90, 150), bands=True)
        return crowns, bark

    def crown_texture(self) -> Texture:
        heat = self.road_heat + self.either(-45, 25)
        canvas = Canvas((4.0, 4.0), 64, (40, 70, 50), heat, transparent=True)
        angle, reach = self.rng.uniform(0, 2 * np.pi, 320), np.sqrt(self.rng.random(320)) * 1.7
        for a, r in zip(angle, reach, strict=True):
            shade = self.uniform(45, 120) * (1.2 - 0.3 * np.sin(a) * r / 1.7)
            leaf = np.array([0.45, 1.0, 0.7]) * shade
            size = self.uniform(0.1, 0.26)
            at = 2.0 + r * np.cos(a), 2.0 + r * np.sin(a)
            canvas.disc(*at, size, leaf, heat + self.uniform(-22, 22))
        canvas.grain(self.bank, 12, 8)
        return canvas.texture()
