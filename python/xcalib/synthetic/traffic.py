"""Parked and moving cars."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from .painter import SMALL_REACH, Painter
from .texture import Array, Canvas, Colour, Texture

# A hatchback from the side: (distance from its rear, height) [m]; the names of the strips between.
CAR_PROFILE = (
    (0.0, 0.0),
    (0.04, 0.95),
    (0.5, 1.42),
    (2.25, 1.45),
    (3.05, 0.98),
    (4.25, 0.8),
    (4.35, 0.0),
)
CAR_PARTS = ("tail", "rear_window", "roof", "windscreen", "hood", "nose")


class Traffic(Painter):
    """Places cars."""

    def place_traffic(self) -> None:
        parked = [self.car_textures(lit=False) for _ in range(5)]
        moving = [self.car_textures(lit=True) for _ in range(3)]
        for side in (-1, 1):
            z = self.start + self.uniform(0, 6)
            while z < self.end:
                if self.rng.random() < 0.6:
                    x = side * (4.2 + self.uniform(-0.08, 0.08))
                    self.car(x, z, side, self.either(*parked), 0.0)
                z += self.uniform(5.6, 7.5)
        # Ahead in the lane, at the camera's own speed on average; oncoming in the other one.
        ahead = self.uniform(11, 17)
        self.car(1.65, ahead, 1, moving[0], self.speed * self.uniform(0.98, 1.06))
        z = self.uniform(14, 26)
        while z < self.end + (self.end - self.start):
            self.car(-1.65, z, -1, self.either(*moving), -self.speed * 0.8)
            z += self.uniform(22, 50)

    def car(
        self, x: float, z: float, heading: int, look: dict[str, Texture], velocity: float
    ) -> None:
        """An extruded silhouette: two cut-out sides and a strip of body over each part of the
        profile.

        z is its rearmost point's coordinate if heading is +1, its foremost's if -1.
        """
        width, length = 1.76, CAR_PROFILE[-1][0]
        more: dict[str, Any] = {"velocity": velocity, "reach": SMALL_REACH}
        left = x - width / 2
        tall = 1.0 if "van" not in look else 1.25

        def along(s: float) -> float:
            return z + (s if heading > 0 else length - s)

        for at, side in ((left, "left"), (left + width, "right")):
            self.quad(
                (at, -1.5 * tall, along(0)),
                (0, 0, along(length) - along(0)),
                (0, 1.5 * tall, 0),
                look["side"],
                gain=self.light[side],
                **more,
            )
        for name, (s0, h0), (s1, h1) in zip(CAR_PARTS, CAR_PROFILE, CAR_PROFILE[1:], strict=False):
            # The upper edge of a strip is the top of its picture, whichever end of the car it is.
            (st, ht), (sb, hb) = ((s1, h1), (s0, h0)) if h1 > h0 else ((s0, h0), (s1, h1))
            front = (s1 > 2.0) == (heading < 0)
            gain = 1.1 if name in ("roof", "hood") else (0.9 if front else 0.85)
            self.quad(
                (left, -ht * tall, along(st)),
                (width, 0, 0),
                (0, (ht - hb) * tall, along(sb) - along(st)),
                look[name],
                gain=gain,
                **more,
            )
        self.quad(
            (left - 0.3, -0.01, z + length + 0.2),
            (width + 0.6, 0, 0),
            (0, 0, -length - 0.4),
            self.car_shadow,
            **more,
        )

    @cached_property
    def car_shadow(self) -> Texture:
        canvas = Canvas((2.3, 4.8), 40, (30, 30, 32), self.road_heat + 10, transparent=True)
        canvas.rect(0.08, 0.08, 2.14, 4.64, (34, 34, 36), self.road_heat + 12)
        canvas.grain(self.bank, 3, 5)
        return canvas.texture()

    def car_textures(self, lit: bool) -> dict[str, Texture]:
        paint = self.either(
            self.colour(190, 230, 0.1),
            self.colour(25, 50, 0.2),
            self.colour(90, 150, 0.2),
            self.rng.uniform(10, 170, 3),
            self.rng.uniform((20, 10, 90), (60, 50, 200)),
        )
        body = self.uniform(70, 150)
        engine = self.uniform(205, 245) if lit else body + self.either(-10, 50)
        tyre = body + (80 if lit else 10)
        glass_heat = body + self.either(-45, 35)
        look = {
            "tail": self.car_end(paint, body, tyre, (40, 35, 200), lit, exhaust=lit),
            "rear_window": self.car_glass(paint, body, glass_heat),
            "roof": self.car_panel(paint, body - 20, body + 5),
            "windscreen": self.car_glass(paint, body, glass_heat + 15),
            "hood": self.car_panel(paint, engine, body + 15),
            "nose": self.car_end(paint, engine - 10, tyre, (225, 240, 245), lit, exhaust=False),
            "side": self.car_side(paint, body, engine, tyre, glass_heat),
        }
        if self.rng.random() < 0.25:
            look["van"] = look["roof"]
        return look

    def car_panel(self, paint: Array, heat: float, rim: float) -> Texture:
        canvas = Canvas((1.76, 1.4), 60, paint, rim)
        canvas.rect(0.15, 0.1, 1.46, 1.2, paint * 1.06 + 4, heat)
        canvas.rect(0.5, 0.2, 0.06, 1.0, paint * 0.85, None)
        canvas.rect(1.2, 0.2, 0.06, 1.0, paint * 0.85, None)
        canvas.grain(self.bank, 3, 5)
        return canvas.texture()

    def car_glass(self, paint: Array, body: float, heat: float) -> Texture:
        canvas = Canvas((1.76, 0.7), 80, paint, body)
        canvas.polygon([(0.22, 0.06), (1.54, 0.06), (1.66, 0.66), (0.1, 0.66)], (62, 54, 46), heat)
        canvas.polygon([(0.3, 0.1), (0.9, 0.1), (0.5, 0.62), (0.2, 0.62)], (120, 110, 98), None)
        canvas.grain(self.bank, 3, 4)
        return canvas.texture()

    def car_end(
        self, paint: Array, body: float, tyre: float, lights: Colour, lit: bool, exhaust: bool
    ) -> Texture:
        canvas = Canvas((1.76, 0.95), 110, paint, body, transparent=True)
        for x in (0.08, 1.44):
            canvas.rect(x, 0.6, 0.24, 0.35, (24, 24, 26), tyre)
        canvas.rect(0, 0, 1.76, 0.72, paint, body)
        canvas.rect(0, 0.5, 1.76, 0.22, paint * 0.55, body - 20)
        canvas.rect(0.5, 0.22, 0.76, 0.2, paint * 0.4, body + 25)
        canvas.rect(0.62, 0.26, 0.52, 0.13, (225, 230, 232), body - 30)
        canvas.text(0.65, 0.37, 0.1, "KX 482", (20, 20, 20), None)
        for x in (0.05, 1.36):
            canvas.rect(
                x, 0.12, 0.35, 0.19, lights, body + (70 if lit else -15), glow=255 if lit else 0
            )
            canvas.rect(x + 0.1, 0.16, 0.1, 0.1, np.multiply(lights, 0.6), None)
        if exhaust:
            canvas.disc(0.42, 0.68, 0.07, (20, 20, 20), 252)
        return canvas.texture()

    def car_side(
        self, paint: Array, body: float, engine: float, tyre: float, glass_heat: float
    ) -> Texture:
        length = CAR_PROFILE[-1][0]
        canvas = Canvas((length, 1.5), 90, paint, body, transparent=True)
        outline = [(s, 1.5 - max(h, 0.3)) for s, h in CAR_PROFILE]
        canvas.polygon(outline, paint, body)
        canvas.rect(3.1, 0.72, 1.2, 0.3, None, engine - 20)
        canvas.polygon(
            [(0.3, 0.52), (0.72, 0.14), (1.55, 0.11), (1.55, 0.52)], (60, 52, 46), glass_heat
        )
        canvas.polygon(
            [(1.65, 0.52), (1.65, 0.11), (2.2, 0.11), (2.85, 0.52)], (66, 58, 50), glass_heat
        )
        canvas.rect(0.1, 0.98, 4.2, 0.12, paint * 0.6, body - 18)
        for x in (1.6, 2.9):
            canvas.rect(x, 0.52, 0.025, 0.6, paint * 0.35, body - 25)
        canvas.rect(1.7, 0.62, 0.18, 0.05, paint * 0.4, body + 20)
        for x in (0.8, 3.55):
            canvas.disc(x, 1.18, 0.38, paint * 0.25, body - 25)
            canvas.disc(x, 1.18, 0.32, (26, 26, 28), tyre)
            canvas.disc(x, 1.18, 0.19, (165, 168, 170), tyre - 35)
            canvas.disc(x, 1.18, 0.07, (60, 60, 62), tyre + 60)
        canvas.grain(self.bank, 2, 4)
        return canvas.texture()
