"""Road, pavements, kerbs and grass."""

from __future__ import annotations

import numpy as np

from .painter import FACADE_X, PAVEMENT_HEIGHT, PAVEMENT_WIDTH, ROAD_HALF_WIDTH, Painter
from .texture import Canvas, Colour, Texture

TILE = 8.0  # [m] length of one piece of road


class Ground(Painter):
    """Paints what is driven and walked on."""

    def place_ground(self) -> None:
        plain = [self.road_texture(zebra=False) for _ in range(3)]
        zebra = self.road_texture(zebra=True)
        pavement = [self.pavement_texture() for _ in range(2)]
        kerb, grass = self.kerb_texture(), self.grass_texture()
        edge, height = ROAD_HALF_WIDTH, PAVEMENT_HEIGHT
        for index, z in enumerate(np.arange(self.start, self.end, TILE)):
            far = z + TILE
            road = zebra if index % 6 == 5 else self.either(*plain)
            self.quad((-edge, 0, far), (2 * edge, 0, 0), (0, 0, -TILE), road)
            for side in (-1, 1):
                face = "right" if side < 0 else "left"
                x0 = edge if side > 0 else -FACADE_X
                self.quad(
                    (x0, -height, far),
                    (PAVEMENT_WIDTH, 0, 0),
                    (0, 0, -TILE),
                    self.either(*pavement),
                )
                self.box(
                    (side * edge - 0.001, -height, z),
                    (side * edge + 0.001, 0.0, far),
                    kerb,
                    (face,),
                )
        for z in np.arange(self.start, self.end, 30.0):
            for x in (-FACADE_X - 40.0, FACADE_X):
                self.quad((x, -height, z + 30), (40, 0, 0), (0, 0, -30), grass)

    def road_texture(self, zebra: bool) -> Texture:
        width = 2 * ROAD_HALF_WIDTH
        asphalt = self.uniform(72, 100)
        canvas = Canvas((width, TILE), 96, (asphalt,) * 3, self.road_heat)
        for _ in range(5):  # repairs: darker or paler asphalt, warmer or cooler, not in step
            size = self.rng.uniform((0.5, 0.6), (2.2, 3.0))
            at = self.rng.uniform((0, 0), np.subtract((width, TILE), size))
            shade, heat = asphalt + self.uniform(-30, 22), self.road_heat + self.uniform(-22, 22)
            canvas.rect(*at, *size, (shade,) * 3, heat)
        for x in (-2.35, -0.95, 0.95, 2.35):  # wheel tracks: polished and warm
            canvas.rect(width / 2 + x - 0.2, 0, 0.4, TILE, None, self.road_heat + 14)
        canvas.grain(self.bank, 8, 7)
        for _ in range(9):
            self.crack(canvas, width)
        paint = (205, 212, 214)
        canvas.rect(width / 2 - 0.07, 1.5, 0.14, 5, paint, self.paint_heat)
        for x in (-3.15, 3.15):  # parking bays
            canvas.rect(width / 2 + x - 0.06, 0, 0.12, TILE, paint, self.paint_heat)
        for x in (0, width / 2 + 3.15):
            canvas.rect(x, 0.2, ROAD_HALF_WIDTH - 3.15, 0.1, paint, self.paint_heat)
        if zebra:
            canvas.rect(width / 2 - 3.1, 0.8, 6.2, 6.4, (asphalt,) * 3, self.road_heat)
            for x in np.arange(-2.9, 2.9, 1.0):
                canvas.rect(width / 2 + x, 2.0, 0.5, 3.6, paint, self.paint_heat)
            canvas.rect(width / 2 + 0.1, 6.5, 3.0, 0.35, paint, self.paint_heat)
        elif self.rng.random() < 0.6:
            self.arrow(canvas, width / 2 + 1.6, 2.0, paint)
        for _ in range(2):
            at = self.rng.uniform((2.5, 1.0), (width - 2.5, TILE - 1.0))
            self.manhole(canvas, float(at[0]), float(at[1]), asphalt)
        for _ in range(10):  # leaves, oil and spilt paint show to the eye alone
            at = self.rng.uniform((0.2, 0.2), (width - 0.2, TILE - 0.2))
            canvas.disc(*at, self.uniform(0.03, 0.12), self.colour(30, 150, 0.8), None)
        canvas.grain(self.bank, 4, 3)
        return canvas.texture()

    def crack(self, canvas: Canvas, width: float) -> None:
        steps = self.rng.normal(0, 0.22, (9, 2)) + self.rng.normal(0, 0.22, 2)
        path = self.rng.uniform((0, 0), (width, TILE)) + np.cumsum(steps, 0)
        shade, heat = self.uniform(25, 50), self.road_heat + self.either(-30, 24)
        canvas.line(path, self.uniform(0.015, 0.05), (shade,) * 3, heat)

    def arrow(self, canvas: Canvas, x: float, y: float, paint: Colour) -> None:
        canvas.rect(x - 0.08, y + 1.0, 0.16, 2.6, paint, self.paint_heat)
        canvas.polygon([(x, y), (x - 0.4, y + 1.2), (x + 0.4, y + 1.2)], paint, self.paint_heat)

    def manhole(self, canvas: Canvas, x: float, y: float, asphalt: float) -> None:
        heat = self.road_heat + self.either(-30, 60)
        canvas.disc(x, y, 0.38, (asphalt - 45,) * 3, heat - 12)
        canvas.disc(x, y, 0.32, (asphalt + 25,) * 3, heat)
        for offset in (-0.16, 0, 0.16):
            canvas.rect(x - 0.22, y + offset - 0.02, 0.44, 0.05, (asphalt - 35,) * 3, heat - 10)

    def pavement_texture(self) -> Texture:
        canvas = Canvas((PAVEMENT_WIDTH, TILE), 80, (140, 144, 148), self.pavement_heat)
        slab = self.either(0.5, 0.6, 0.75)
        for x in np.arange(0, PAVEMENT_WIDTH, slab):
            for y in np.arange(0, TILE, slab):
                shade, heat = self.uniform(118, 168), self.pavement_heat + self.uniform(-9, 9)
                tone = (shade - 8, shade - 3, shade)
                canvas.rect(x + 0.015, y + 0.015, slab - 0.03, slab - 0.03, tone, heat)
        canvas.grain(self.bank, 7, 5)
        for x in (0.0, PAVEMENT_WIDTH - 0.25):  # kerb stones; either end may be the kerb
            canvas.rect(x, 0, 0.25, TILE, (172, 176, 178), self.pavement_heat + 18)
            for y in np.arange(0, TILE, 1.0):
                canvas.rect(x, y, 0.25, 0.02, (80, 80, 80), self.pavement_heat - 20)
        for _ in range(3):
            at = self.rng.uniform((0.4, 0.4), (PAVEMENT_WIDTH - 0.9, TILE - 0.9))
            canvas.rect(*at, 0.5, 0.4, (60, 62, 64), self.pavement_heat + self.either(-25, 35))
        return canvas.texture()

    def kerb_texture(self) -> Texture:
        canvas = Canvas((TILE, PAVEMENT_HEIGHT), 48, (150, 152, 154), self.pavement_heat + 22)
        canvas.grain(self.bank, 8, 6)
        for x in np.arange(0, TILE, 1.0):
            canvas.rect(x, 0, 0.03, PAVEMENT_HEIGHT, (70, 70, 70), self.pavement_heat - 15)
        return canvas.texture()

    def grass_texture(self) -> Texture:
        canvas = Canvas((40, 30), 12, (52, 96, 78), self.road_heat - 35)
        canvas.grain(self.bank, 16, 12)
        return canvas.texture()
