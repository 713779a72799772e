"""Lamps, signs, bins, bollards and people."""

from __future__ import annotations

from typing import Any

import numpy as np

from .ground import TILE
from .painter import FACADE_X, PAVEMENT_HEIGHT, ROAD_HALF_WIDTH, SMALL_REACH
from .texture import Canvas, Texture
from .trees import Trees

LAMP_SPACING = 24.0  # [m]
LAMP_HEIGHT = 5.6  # [m]


class Furniture(Trees):
    """Places what stands on the pavements, and who walks there."""

    def place_furniture(self) -> None:
        metal = self.plain_texture((70, 74, 72), self.uniform(60, 120))
        pale = self.plain_texture((165, 170, 172), self.uniform(80, 200))
        lamp_head = Canvas((0.8, 0.2), 60, (215, 235, 245), 215)
        lamp_head.glow[:] = 255
        head = lamp_head.texture()
        signs = [self.sign_texture(kind) for kind in ("stop", "limit", "warning", "parking")]
        people = [self.person_texture() for _ in range(4)]
        bin_texture = self.plain_texture((60, 90, 50), self.uniform(60, 180), bands=True)
        ground, kerb_x = -PAVEMENT_HEIGHT, ROAD_HALF_WIDTH + 0.45
        for index, z in enumerate(np.arange(self.start, self.end, LAMP_SPACING / 2)):
            self.lamp(1 if index % 2 else -1, float(z) + 4.0, metal, head)
        small: dict[str, Any] = {"reach": SMALL_REACH}
        for side in (-1, 1):
            z = self.start + self.uniform(0, 6)
            while z < self.end:
                kind = self.rng.random()
                x = side * kerb_x
                if kind < 0.42:
                    self.tree(x + side * 0.3, z)
                elif kind < 0.62:
                    self.sign(x, z, self.either(*signs), metal)
                elif kind < 0.75:
                    self.box(
                        (x - 0.25, ground - 1.1, z),
                        (x + 0.25, ground, z + 0.5),
                        bin_texture,
                        **small,
                    )
                else:
                    for offset in (0.0, 1.5, 3.0):  # bollards
                        low = (x - 0.07, ground - 0.95, z + offset)
                        self.box(low, (x + 0.07, ground, z + offset + 0.14), pale, **small)
                z += self.uniform(4.5, 9.0)
            z = self.start + self.uniform(0, 5)
            while z < self.end:
                x = side * self.uniform(ROAD_HALF_WIDTH + 0.9, FACADE_X - 0.5)
                self.person(x, ground, z, self.either(*people), self.uniform(-0.5, 0.5))
                z += self.uniform(6, 20)
        for z in np.arange(self.start + 5.5 * TILE, self.end, 6 * TILE):  # on the zebra crossings
            self.person(self.uniform(-4.5, 0.2), 0.0, float(z), self.either(*people), 0.0)

    def lamp(self, side: int, z: float, metal: Texture, head: Texture) -> None:
        x, ground = side * (ROAD_HALF_WIDTH + 0.4), -PAVEMENT_HEIGHT
        tip = x - side * 1.7
        self.box((x - 0.07, -LAMP_HEIGHT, z), (x + 0.07, ground, z + 0.14), metal)
        a0, a1 = sorted((x, tip))
        self.box((a0, -LAMP_HEIGHT - 0.08, z + 0.03), (a1, -LAMP_HEIGHT, z + 0.11), metal)
        low = (tip - 0.4, -LAMP_HEIGHT, z - 0.12)
        self.box(low, (tip + 0.4, -LAMP_HEIGHT + 0.16, z + 0.26), head, reach=SMALL_REACH)
        self.lamps.append((tip, -LAMP_HEIGHT + 0.2, z))

    def sign(self, x: float, z: float, texture: Texture, metal: Texture) -> None:
        ground = -PAVEMENT_HEIGHT
        more: dict[str, Any] = {"reach": SMALL_REACH}
        self.box((x - 0.04, ground - 2.9, z), (x + 0.04, ground, z + 0.08), metal, **more)
        self.quad((x - 0.4, ground - 3.0, z - 0.02), (0.8, 0, 0), (0, 0.8, 0), texture, **more)

    def sign_texture(self, kind: str) -> Texture:
        heat = self.uniform(50, 200)
        canvas = Canvas((0.8, 0.8), 130, (200, 200, 200), heat, transparent=True)
        red, white, blue, black = (40, 35, 190), (235, 235, 235), (170, 80, 20), (25, 25, 25)
        centre = np.array([0.4, 0.4])
        if kind == "warning":
            triangle = np.array([(0.4, 0.02), (0.79, 0.72), (0.01, 0.72)])
            canvas.polygon(triangle, red, heat)
            canvas.polygon(
                np.array([0.4, 0.487]) + (triangle - (0.4, 0.487)) * 0.62, white, heat + 40
            )
            canvas.rect(0.37, 0.33, 0.06, 0.2, black, heat - 10)
        elif kind == "parking":
            canvas.rect(0.05, 0.05, 0.7, 0.7, white, heat + 30)
            canvas.rect(0.09, 0.09, 0.62, 0.62, blue, heat)
            canvas.text(0.22, 0.62, 0.42, "P", white, heat + 35)
        elif kind == "limit":
            canvas.disc(*centre, 0.38, red, heat)
            canvas.disc(*centre, 0.28, white, heat - 40)
            canvas.text(0.2, 0.5, 0.2, "50", black, heat + 10)
        else:
            angle = np.pi / 8 + np.arange(8) * np.pi / 4
            octagon = np.stack([np.cos(angle), np.sin(angle)], 1)
            canvas.polygon(centre + 0.4 * octagon, white, heat + 30)
            canvas.polygon(centre + 0.36 * octagon, red, heat)
            canvas.text(0.13, 0.46, 0.15, "STOP", white, heat + 45)
        return canvas.texture()

    def person(self, x: float, ground: float, z: float, texture: Texture, speed: float) -> None:
        origin = (x - 0.45, ground - 1.8, z)
        self.quad(origin, (0.9, 0, 0), (0, 1.8, 0), texture, velocity=speed, reach=SMALL_REACH)

    def person_texture(self) -> Texture:
        coat, trousers = self.colour(30, 170, 1.6), self.colour(25, 110, 0.8)
        skin, heat = self.colour(110, 190, 0.6), self.uniform(170, 205)
        canvas = Canvas((0.9, 1.8), 110, coat, heat, transparent=True)
        stride = self.uniform(0.08, 0.2)
        for sign in (-1, 1):
            foot, hip = 0.45 + sign * stride, 0.45 + sign * 0.08
            leg = [(hip - 0.09, 0.9), (hip + 0.09, 0.9), (foot + 0.06, 1.74), (foot - 0.06, 1.74)]
            canvas.polygon(leg, trousers, heat - 20)
            canvas.rect(foot - 0.08, 1.7, 0.2, 0.1, (25, 25, 30), heat - 60)
            arm = [
                (0.45 + sign * 0.18, 0.36),
                (0.45 + sign * 0.26, 0.4),
                (0.45 + sign * 0.3, 0.92),
                (0.45 + sign * 0.21, 0.92),
            ]
            canvas.polygon(arm, coat * 0.8, heat - 25)
            canvas.disc(0.45 + sign * 0.26, 0.95, 0.05, skin, 245)
        torso = [(0.26, 0.34), (0.64, 0.34), (0.62, 1.0), (0.28, 1.0)]
        canvas.polygon(torso, coat, heat - 10)
        canvas.rect(0.43, 0.36, 0.05, 0.6, coat * 1.5, heat - 30)
        canvas.rect(0.4, 0.24, 0.1, 0.12, skin, 235)
        canvas.disc(0.45, 0.16, 0.115, skin, 250)
        canvas.polygon(
            [(0.33, 0.16), (0.34, 0.05), (0.45, 0.02), (0.56, 0.05), (0.57, 0.16), (0.5, 0.1)],
            (30, 40, 55),
            190,
        )
        return canvas.texture()
