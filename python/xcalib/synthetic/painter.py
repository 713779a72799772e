"""What everything that paints a street shares: chance, sunlight, temperatures and shapes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .scene import AHEAD, BEHIND, Face
from .texture import Array, Canvas, Colour, NoiseBank, Texture

ROAD_HALF_WIDTH = 5.2  # [m] two lanes of 3.2 m and two rows of parked cars
PAVEMENT_WIDTH = 3.0  # [m]
PAVEMENT_HEIGHT = 0.14  # [m]
FACADE_X = ROAD_HALF_WIDTH + PAVEMENT_WIDTH
SMALL_REACH = 85.0  # [m] cars, trees and people further off than this are left out


class Painter:
    """Collects faces. Classes derived from it have a method for each kind of thing."""

    def __init__(self, seed: int, length: float, speed: float) -> None:
        self.rng = np.random.default_rng([seed, 0x57EE7])
        self.bank = NoiseBank(self.rng)
        self.start, self.end, self.speed = -BEHIND, length + AHEAD, speed
        self.faces: list[Face] = []
        self.lamps: list[tuple[float, ...]] = []
        # Sunlight from one side: facades of the two sides differ, and box edges show.
        sunny_side = bool(self.rng.random() < 0.5)
        left, right = (1.08, 0.66) if sunny_side else (0.66, 1.08)
        self.light = {"near": 0.84, "far": 0.8, "left": left, "right": right, "top": 1.12}
        # Temperatures that say which way a street's contrasts go: paint may be colder than asphalt.
        self.road_heat = self.uniform(95, 150)
        self.paint_heat = self.road_heat + self.either(-45, 40) * self.uniform(0.7, 1.2)
        self.pavement_heat = self.road_heat + self.either(-35, 30) * self.uniform(0.6, 1.2)

    # Chance

    def uniform(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def either(self, *options: Any) -> Any:
        return options[int(self.rng.integers(len(options)))]

    def colour(self, low: float, high: float, saturation: float = 0.25) -> Array:
        """A BGR colour of random brightness, mostly a warm grey."""
        tint = 1 + saturation * (self.rng.random(3) - 0.5) + np.array([-0.25, 0, 0.12]) * saturation
        return np.asarray(np.clip(self.uniform(low, high) * tint, 0, 255))

    # Shapes

    def quad(self, origin: Any, right: Any, down: Any, texture: Texture, **more: Any) -> None:
        origin, right, down = (np.asarray(v, np.float64) for v in (origin, right, down))
        self.faces.append(Face(origin, right, down, texture, **more))

    def box(
        self,
        low: tuple[float, float, float],
        high: tuple[float, float, float],
        texture: Texture,
        sides: Sequence[str] = ("near", "far", "left", "right", "top"),
        **more: Any,
    ) -> None:
        """An axis-aligned box; `low` and `high` are its corners of least and greatest x, y, z."""
        (x0, y0, z0), (x1, y1, z1) = low, high
        width, height, depth = x1 - x0, y1 - y0, z1 - z0
        spans: dict[str, tuple[Any, Any, Any]] = {
            "near": ((x0, y0, z0), (width, 0, 0), (0, height, 0)),
            "far": ((x1, y0, z1), (-width, 0, 0), (0, height, 0)),
            "left": ((x0, y0, z1), (0, 0, -depth), (0, height, 0)),
            "right": ((x1, y0, z0), (0, 0, depth), (0, height, 0)),
            "top": ((x0, y0, z1), (width, 0, 0), (0, 0, -depth)),
        }
        for side in sides:
            more["gain"] = self.light[side]
            self.quad(*spans[side], texture, one_sided=True, **more)

    def plain_texture(self, visible: Colour, thermal: float, bands: bool = False) -> Texture:
        canvas = Canvas((0.6, 1.2), 80, visible, thermal)
        canvas.grain(self.bank, 10, 8)
        canvas.rect(0, 0, 0.6, 0.12, np.multiply(visible, 0.5), thermal + 45)
        if bands:
            for y in np.arange(0.3, 1.2, 0.22):
                canvas.rect(0, y, 0.6, 0.06, np.multiply(visible, 1.6), thermal - 35)
        return canvas.texture()
