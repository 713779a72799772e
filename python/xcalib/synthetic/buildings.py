"""Houses on both sides, with gardens between some of them."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import cv2
import numpy as np

from .painter import FACADE_X, PAVEMENT_HEIGHT, SMALL_REACH
from .texture import Array, Canvas, Texture
from .trees import Trees

WORDS = ("CAFE", "BOOKS", "PIZZA", "HOTEL", "BAKERY", "OPTIK", "BANK", "FLEURS", "SALON", "MARKET")


class Buildings(Trees):
    """Builds house fronts, their sides, balconies and signs."""

    def place_buildings(self) -> None:
        styles = [self.facade() for _ in range(7)]
        hedge = self.hedge_texture()
        for side in (-1, 1):
            z = self.start - self.uniform(0, 8)
            last = -1
            while z < self.end:
                if self.rng.random() < 0.1:  # a garden between two houses
                    gap = self.uniform(5, 9)
                    x0, x1 = sorted((side * (FACADE_X + 0.1), side * (FACADE_X + 0.7)))
                    self.box((x0, -1.7, z), (x1, -PAVEMENT_HEIGHT, z + gap), hedge)
                    for depth in (4.0, 8.0):
                        self.tree(side * (FACADE_X + depth), z + gap / 2)
                    z += gap
                    continue
                choice = int(self.rng.integers(len(styles)))
                choice = (choice + 1) % len(styles) if choice == last else choice
                last = choice
                z += self.building(side, z, *styles[choice])

    def building(
        self, side: int, z: float, front: Texture, wall: Texture, size: tuple[float, float]
    ) -> float:
        width, height = size
        setback = self.either(0.0, 0.0, 0.25, 0.6)
        x_front = side * (FACADE_X + setback)
        x0, x1 = sorted((x_front, x_front + side * 11.0))
        low, high = (x0, -height - PAVEMENT_HEIGHT, z), (x1, -PAVEMENT_HEIGHT, z + width)
        street_side = "left" if side > 0 else "right"
        self.box(low, high, front, (street_side,))
        self.box(low, high, wall, ("near", "far"))
        # A cornice along the roof and balconies break the flat front: parallax close to a wall.
        reach = x_front - side * 0.35
        c0, c1 = sorted((x_front, reach))
        sides = ("near", "far", street_side)
        self.box((c0, low[1] - 0.3, z), (c1, low[1] + 0.15, z + width), wall, sides)
        if self.rng.random() < 0.6:
            b0, b1 = sorted((x_front, x_front - side * 0.9))
            for floor in range(1, int((height - 3.6) // 3.0) + 1):
                top, at = -PAVEMENT_HEIGHT - 3.6 - 3.0 * (floor - 1) - 1.0, z + width * 0.3
                more: dict[str, Any] = {"reach": SMALL_REACH}
                self.box(
                    (b0, top, at), (b1, top + 1.05, at + width * 0.36), self.balcony, sides, **more
                )
        if self.rng.random() < 0.6:  # a sign across the pavement
            s0, s1 = sorted((x_front - side * 0.2, x_front - side * 1.1))
            at = z + width * self.uniform(0.15, 0.85)
            self.box(
                (s0, -3.9, at),
                (s1, -3.1, at + 0.12),
                self.either(*self.shop_signs),
                reach=SMALL_REACH,
            )
        return width

    def facade(self) -> tuple[Texture, Texture, tuple[float, float]]:
        """A house front, the plain wall of its sides, and its width and height [m]."""
        bays, floors = int(self.rng.integers(3, 6)), int(self.rng.integers(3, 6))
        bay = self.uniform(2.5, 3.1)
        size = (bays * bay, 3.6 + 3.0 * (floors - 1) + 0.6)
        walls = (
            (168, 190, 204),
            (120, 150, 196),
            (92, 108, 168),
            (196, 200, 206),
            (140, 178, 196),
            (158, 166, 158),
        )
        tone, heat = (
            np.array(self.either(*walls)) * self.colour(200, 270, 0.15) / 240,
            self.uniform(60, 195),
        )
        canvas = Canvas(size, 60, tone, heat)
        wall = Canvas((6.0, size[1]), 40, tone, heat)
        if self.rng.random() < 0.6:
            for each in (canvas, wall):
                self.bricks(each, tone, heat)
        self.heat_patches(canvas)
        for each in (canvas, wall):
            each.grain(self.bank, 6, 5)
        contrast = self.either(-1, 1) * self.uniform(30, 75)
        glass, frame = self.colour(35, 85, 0.4), self.colour(60, 235, 0.4)
        for floor in range(1, floors):
            top = size[1] - 3.6 - 3.0 * floor + 0.65
            for index in range(bays):
                self.window(
                    canvas, (index + 0.24) * bay, top, bay * 0.52, glass, frame, heat, contrast
                )
            canvas.rect(0, top + 2.15, size[0], 0.14, tone * 0.72, heat + contrast * 0.45)
        self.shop(canvas, size, heat, contrast)
        pipe = self.uniform(0.1, 0.3)
        canvas.rect(pipe, 0, 0.1, size[1] - 0.2, tone * 0.5, heat - contrast * 0.6)
        for _ in range(2):
            at = self.uniform(0.6, 4.5), self.uniform(1.0, size[1] - 3.0)
            self.window(wall, *at, 0.9, glass, frame, heat, contrast)
        return canvas.texture(), wall.texture(), size

    def bricks(self, canvas: Canvas, tone: Array, heat: float) -> None:
        course, length = 0.16, 0.45  # coarser than life, so that they survive at a distance
        width, height = canvas.size_m
        mortar, joint_heat = tone * self.either(0.75, 1.2), heat + self.either(-14, 14)
        for row, y in enumerate(np.arange(0, height, course)):
            canvas.line([(0, y), (width, y)], 0.01, mortar, joint_heat)
            for x in np.arange((row % 2) * length / 2, width, length):
                if self.rng.random() < 0.12:
                    canvas.rect(x, y, length, course, tone * self.uniform(0.75, 1.1), None)
            joints = np.rint(
                np.arange((row % 2) * length / 2, width, length) * canvas.scale
            ).astype(int)
            rows = slice(round(y * canvas.scale), round((y + course) * canvas.scale))
            joints = joints[joints < canvas.thermal.shape[1]]
            canvas.visible[rows, joints] = np.clip(mortar, 0, 255)
            canvas.thermal[rows, joints] = np.clip(joint_heat, 0, 255)

    def heat_patches(self, canvas: Canvas) -> None:
        """Heat leaking through a wall: soft spots that the eye cannot see."""
        width, height = canvas.size_m
        layer: Array = np.zeros(canvas.thermal.shape, np.float32)
        for _ in range(6):
            x, y = self.rng.uniform((0, 0), (width, height)) * canvas.scale
            axes = tuple(int(v) for v in self.rng.uniform(0.3, 1.5, 2) * canvas.scale)
            cv2.ellipse(layer, (int(x), int(y)), axes, 0, 0, 360, self.uniform(-25, 30), -1)
        layer = cv2.blur(cv2.blur(layer, (25, 25)), (25, 25))
        canvas.thermal = cv2.add(canvas.thermal, layer, dtype=cv2.CV_8U)

    def window(
        self,
        canvas: Canvas,
        x: float,
        y: float,
        width: float,
        glass: Array,
        frame: Array,
        heat: float,
        contrast: float,
        height: float = 1.6,
    ) -> None:
        lit = self.rng.random() < 0.3
        pane_heat = heat + contrast + (self.uniform(20, 50) if lit else self.uniform(-8, 8))
        pane = np.array([120, 190, 235]) if lit else glass * self.uniform(0.8, 1.5)
        glow = self.uniform(90, 230) if lit else 0
        canvas.rect(x - 0.1, y - 0.1, width + 0.2, height + 0.2, frame, heat - contrast * 0.35)
        canvas.rect(x, y, width, height, pane, pane_heat, glow=glow)
        if self.rng.random() < 0.45:  # curtains and blinds
            canvas.rect(x, y, width, height * self.uniform(0.2, 0.6), pane * 0.4 + 120, None)
        if self.rng.random() < 0.25:  # somebody airs the room
            canvas.rect(x, y, width / 2, height, pane * 0.6, heat + 70)
        canvas.rect(x + width / 2 - 0.04, y, 0.08, height, frame, heat - contrast * 0.3)
        canvas.rect(x, y + height * 0.32, width, 0.07, frame, heat - contrast * 0.3)
        canvas.rect(
            x - 0.18, y + height + 0.1, width + 0.36, 0.12, frame * 0.7, heat + contrast * 0.6
        )

    def shop(self, canvas: Canvas, size: tuple[float, float], heat: float, contrast: float) -> None:
        width, height = size
        base = height - 3.5
        canvas.rect(0, base, width, 3.5, self.colour(50, 190, 0.8), heat + self.uniform(-25, 25))
        canvas.rect(0, height - 0.45, width, 0.45, self.colour(50, 100), heat - 25)
        door = self.uniform(0.1, 0.8) * (width - 1.4)
        x = 0.4
        while x < width - 1.6:
            if abs(x - door) < 1.3:
                x += 0.3
                continue
            span = min(self.uniform(1.3, 2.4), width - 0.4 - x)
            glow = self.either(0, 0, self.uniform(110, 220))
            canvas.rect(x, base + 0.95, span, 2.05, self.colour(190, 240), heat - contrast * 0.4)
            goods, inside = self.colour(60, 130, 0.8), heat + contrast * 0.9 + self.uniform(-15, 15)
            canvas.rect(x + 0.08, base + 1.03, span - 0.16, 1.89, goods, inside, glow=glow)
            for _ in range(4):  # posters, behind glass that is opaque to a thermal camera
                at = x + 0.1 + self.uniform(0, max(0.01, span - 0.7)), base + self.uniform(1.1, 2.3)
                canvas.rect(*at, 0.4, 0.5, self.colour(40, 230, 1.5), None)
            x += span + 0.25
        canvas.rect(
            door, base + 0.9, 1.1, 2.6, self.colour(30, 120, 1.2), heat + self.either(-45, 50)
        )
        canvas.rect(door + 0.2, base + 1.2, 0.7, 0.9, self.colour(60, 110), heat + contrast)
        board, lettering = self.colour(25, 130, 1.6), self.colour(190, 250, 0.5)
        board_heat = heat + self.either(-30, 35)
        canvas.rect(
            0.25, base + 0.12, width - 0.5, 0.68, board, board_heat, glow=self.either(0, 60)
        )
        start = self.uniform(0.6, max(0.7, width - 4.0))
        canvas.text(start, base + 0.62, 0.42, self.either(*WORDS), lettering, board_heat + 30)

    def hedge_texture(self) -> Texture:
        canvas = Canvas((6, 1.6), 60, (45, 82, 62), self.road_heat - 25)
        canvas.grain(self.bank, 26, 16)
        return canvas.texture()

    @cached_property
    def balcony(self) -> Texture:
        shade, heat = self.colour(70, 120, 0.3), self.uniform(60, 190)
        canvas = Canvas((3.2, 1.05), 60, shade, heat)
        canvas.grain(self.bank, 5, 5)
        for x in np.arange(0.05, 3.2, 0.2):
            canvas.rect(x, 0.12, 0.09, 0.8, shade * 1.9, heat - 28)
        canvas.rect(0, 0, 3.2, 0.09, shade * 0.4, heat + 40)
        return canvas.texture()

    @cached_property
    def shop_signs(self) -> list[Texture]:
        signs = []
        for word in self.rng.choice(WORDS, 4, replace=False):
            heat = self.uniform(60, 190)
            canvas = Canvas((0.9, 0.8), 120, self.colour(30, 150, 1.8), heat)
            canvas.rect(0.05, 0.05, 0.8, 0.7, self.colour(40, 200, 1.8), heat + 25, glow=120)
            canvas.text(0.1, 0.5, 0.17, str(word), (240, 245, 250), heat - 30)
            signs.append(canvas.texture())
        return signs
