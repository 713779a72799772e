"""The street that `synthetic` renders: textured parallelograms, described without any camera.

World axes are those of a camera looking down the street: x right, y down, z forward, in metres, the
road surface at y = 0. Every surface is a `Face`, X(u, v) = origin + u * right + v * down with u and
v in [0, 1], carrying a `Texture` that holds an independent picture for each modality.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Colour = Sequence[float] | Array  # BGR, 0-255

ROAD_HALF_WIDTH = 5.2  # [m] two lanes of 3.2 m and two rows of parked cars
PAVEMENT_WIDTH = 3.0  # [m]
PAVEMENT_HEIGHT = 0.14  # [m]
FACADE_X = ROAD_HALF_WIDTH + PAVEMENT_WIDTH
TILE = 8.0  # [m] length of one piece of road
LAMP_SPACING = 24.0  # [m]
LAMP_HEIGHT = 5.6  # [m]
BEHIND = 32.0  # [m] the street starts this far behind the first camera
AHEAD = 200.0  # [m] and reaches this far beyond the last
SMALL_REACH = 85.0  # [m] cars, trees and people further off than this are left out
WORDS = ("CAFE", "BOOKS", "PIZZA", "HOTEL", "BAKERY", "OPTIK", "BANK", "FLEURS", "SALON", "MARKET")


@dataclass
class Texture:
    """One surface's looks; filtered copies are made when first asked for, and kept.

    visible: (h, w, 4) uint8, BGR albedo and, fourth, how far the surface glows by itself at night;
    thermal: (h, w) uint8, apparent temperature; alpha: (h, w) uint8, or None where nothing is cut
    out.
    """

    visible: Array
    thermal: Array
    alpha: Array | None = None
    _levels: dict[tuple[str, int, int, float], Array] = field(default_factory=dict, repr=False)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in texels."""
        return self.thermal.shape[1], self.thermal.shape[0]

    def level(self, kind: str, level_u: int, level_v: int, gain: float = 1.0) -> Array:
        """The "day", "night", "thermal" or "alpha" picture, averaged over 2^level texels each way.

        The two directions are filtered apart because streets are seen at grazing angles, where one
        common level is either blurred across or aliased along the road.
        """
        key = (kind, level_u, level_v, gain)
        if key not in self._levels:
            self._levels[key] = self._filtered(kind, level_u, level_v, gain)
        return self._levels[key]

    def _filtered(self, kind: str, level_u: int, level_v: int, gain: float) -> Array:
        if kind == "day":
            colour = np.ascontiguousarray(self.level("night", level_u, level_v)[..., :3])
            return cv2.convertScaleAbs(colour, alpha=gain)
        if level_u == level_v == 0:
            image = {"night": self.visible, "thermal": self.thermal, "alpha": self.alpha}[kind]
            assert image is not None
            return image
        finer = (level_u - 1, level_v) if level_u >= level_v else (level_u, level_v - 1)
        width, height = self.size
        size = (max(1, width >> level_u), max(1, height >> level_v))
        # Any level spans the texture edge to edge, so sizes that do not divide move nothing.
        return cv2.resize(self.level(kind, *finer), size, interpolation=cv2.INTER_AREA)


@dataclass(frozen=True)
class Face:
    """A textured parallelogram. Seen from its front, `right` is right and `down` is down."""

    origin: Array
    right: Array
    down: Array
    texture: Texture
    gain: float = 1.0  # daylight on the surface: which way it faces the sun
    one_sided: bool = False  # part of a closed body, so its back is never seen
    velocity: float = 0.0  # [m per frame] along z
    reach: float = AHEAD  # [m] drawn up to this distance


class Canvas:
    """Paints one texture, in metres from its top left corner, in both modalities at once.

    A colour or temperature of None leaves that modality as it is: that is how each gets structure
    that the other does not show.
    """

    def __init__(
        self,
        size_m: tuple[float, float],
        pixels_per_m: float,
        visible: Colour,
        thermal: float,
        transparent: bool = False,
    ) -> None:
        self.scale = pixels_per_m
        self.size_m = size_m
        width, height = (max(4, round(side * pixels_per_m)) for side in size_m)
        self.visible: Array = np.empty((height, width, 3), np.uint8)
        self.visible[:] = np.clip(visible, 0, 255)
        self.glow = np.zeros((height, width), np.uint8)
        self.thermal: Array = np.full((height, width), np.clip(thermal, 0, 255), np.uint8)
        self.alpha = np.zeros((height, width), np.uint8) if transparent else None

    def polygon(
        self,
        points_m: Any,
        visible: Colour | None = None,
        thermal: float | None = None,
        glow: float | None = None,
    ) -> None:
        """Fills a polygon; whatever is painted becomes opaque."""
        # Texel i covers [i, i + 1), hence the half; the fill keeps 4 fractional bits.
        texels = np.asarray(points_m, np.float64) * self.scale - 0.5
        points = [np.rint(texels * 16).astype(np.int32).reshape(-1, 1, 2)]
        for image, value in self._layers(visible, thermal, glow):
            cv2.fillPoly(image, points, value, cv2.LINE_AA if image is not self.alpha else 8, 4)

    def rect(
        self, x: float, y: float, width: float, height: float, *look: Any, **more: Any
    ) -> None:
        """Fills the rectangle whose top left corner is (x, y) [m]."""
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
        self.polygon(corners, *look, **more)

    def disc(self, x: float, y: float, radius: float, *look: Any, **more: Any) -> None:
        """Fills a circle about (x, y) [m]."""
        angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
        self.polygon(
            np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], 1), *look, **more
        )

    def line(
        self, points_m: Any, width: float, visible: Colour | None, thermal: float | None
    ) -> None:
        """Strokes a polyline of the given width [m]."""
        points = [np.rint(np.asarray(points_m) * self.scale).astype(np.int32).reshape(-1, 1, 2)]
        thickness = max(1, round(width * self.scale))
        for image, value in self._layers(visible, thermal, None):
            cv2.polylines(image, points, False, value, thickness, cv2.LINE_AA)

    def text(self, x: float, y: float, height: float, text: str, *look: Any) -> None:
        """Writes `text` with its baseline starting at (x, y) [m]."""
        at = (round(x * self.scale), round(y * self.scale))
        thickness = max(1, round(height * self.scale / 8))
        for image, value in self._layers(*look):
            cv2.putText(
                image,
                text,
                at,
                cv2.FONT_HERSHEY_SIMPLEX,
                height * self.scale / 22,
                value,
                thickness,
                cv2.LINE_AA,
            )

    def grain(self, bank: NoiseBank, visible: float, thermal: float) -> None:
        """Adds unrelated noise of the given standard deviation to each modality."""
        shape = self.thermal.shape
        shade = bank.patch(shape) * visible
        self.visible = cv2.add(self.visible, cv2.merge([shade] * 3), dtype=cv2.CV_8U)
        self.thermal = cv2.add(self.thermal, bank.patch(shape) * thermal, dtype=cv2.CV_8U)

    def texture(self) -> Texture:
        return Texture(np.dstack([self.visible, self.glow]), self.thermal, self.alpha)

    def _layers(
        self, visible: Colour | None = None, thermal: float | None = None, glow: float | None = None
    ) -> list[tuple[Array, Any]]:
        layers: list[tuple[Array, Any]] = []
        if visible is not None:
            layers.append((self.visible, tuple(min(max(float(c), 0.0), 255.0) for c in visible)))
        if thermal is not None:
            layers.append((self.thermal, min(max(float(thermal), 0.0), 255.0)))
        if glow is not None:
            layers.append((self.glow, float(glow)))
        if self.alpha is not None:
            layers.append((self.alpha, 255.0))
        return layers


class NoiseBank:
    """Unit-variance noise at several scales, drawn once and cut into patches: drawing is slow."""

    def __init__(self, rng: np.random.Generator, size: int = 1280) -> None:
        self.rng = rng
        total = np.zeros((size, size), np.float32)
        for cell, weight in ((1, 0.8), (4, 0.7), (16, 0.6), (96, 0.6)):
            count = size // cell + 2
            coarse = rng.standard_normal((count, count), dtype=np.float32)
            total += weight * cv2.resize(coarse, (size, size), interpolation=cv2.INTER_CUBIC)
        self.image = total / total.std()

    def patch(self, shape: tuple[int, ...]) -> Array:
        """A random cut of (h, w) float32; different cuts are as good as unrelated."""
        height, width = shape
        image = self.image if self.rng.random() < 0.5 else self.image[:, ::-1]
        y = int(self.rng.integers(0, max(1, image.shape[0] - height)))
        x = int(self.rng.integers(0, max(1, image.shape[1] - width)))
        cut = image[y : y + height, x : x + width]
        if cut.shape != (height, width):
            cut = cv2.resize(cut, (width, height), interpolation=cv2.INTER_LINEAR)
        return np.ascontiguousarray(cut)


@dataclass(frozen=True)
class Scene:
    """All faces of a street as arrays over N faces, ready for a rasteriser.

    origin, right, down: (N, 3) [m]; velocity: (N,) [m per frame] along z; gain: (N,) daylight;
    one_sided: (N,) bool; reach: (N,) [m]; textures: N; lamps: (L, 3) [m], street lamps. The last
    `num_sky` faces form a box at infinity: their origins are directions, not points.
    """

    origin: Array
    right: Array
    down: Array
    velocity: Array
    gain: Array
    one_sided: Array
    reach: Array
    textures: list[Texture]
    lamps: Array
    num_sky: int

    @staticmethod
    def from_faces(faces: list[Face], sky: list[Face], lamps: list[tuple[float, ...]]) -> Scene:
        every = faces + sky
        return Scene(
            origin=np.array([face.origin for face in every], np.float64),
            right=np.array([face.right for face in every], np.float64),
            down=np.array([face.down for face in every], np.float64),
            velocity=np.array([face.velocity for face in every], np.float64),
            gain=np.array([face.gain for face in every], np.float64),
            one_sided=np.array([face.one_sided for face in every], bool),
            reach=np.array([face.reach for face in every], np.float64),
            textures=[face.texture for face in every],
            lamps=np.array(lamps, np.float64).reshape(-1, 3),
            num_sky=len(sky),
        )


def build(seed: int, length: float, speed: float) -> Scene:
    """A street that can be driven for `length` metres from z = 0, cars moving at about `speed`."""
    return _Builder(seed, length, speed).scene()


class _Builder:
    """Collects faces. One method paints or places one kind of thing."""

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

    # The whole

    def scene(self) -> Scene:
        self.place_ground()
        self.place_buildings()
        self.place_furniture()
        self.place_traffic()
        return Scene.from_faces(self.faces, self.sky(), self.lamps)

    # Ground

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

    # Buildings

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

    # Street furniture

    @property
    def balcony(self) -> Texture:
        if not hasattr(self, "_balcony"):
            shade, heat = self.colour(70, 120, 0.3), self.uniform(60, 190)
            canvas = Canvas((3.2, 1.05), 60, shade, heat)
            canvas.grain(self.bank, 5, 5)
            for x in np.arange(0.05, 3.2, 0.2):
                canvas.rect(x, 0.12, 0.09, 0.8, shade * 1.9, heat - 28)
            canvas.rect(0, 0, 3.2, 0.09, shade * 0.4, heat + 40)
            self._balcony = canvas.texture()
        return self._balcony

    @property
    def shop_signs(self) -> list[Texture]:
        if not hasattr(self, "_signs"):
            self._signs: list[Texture] = []
            for word in self.rng.choice(WORDS, 4, replace=False):
                heat = self.uniform(60, 190)
                canvas = Canvas((0.9, 0.8), 120, self.colour(30, 150, 1.8), heat)
                canvas.rect(0.05, 0.05, 0.8, 0.7, self.colour(40, 200, 1.8), heat + 25, glow=120)
                canvas.text(0.1, 0.5, 0.17, str(word), (240, 245, 250), heat - 30)
                self._signs.append(canvas.texture())
        return self._signs

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

    def plain_texture(self, visible: Colour, thermal: float, bands: bool = False) -> Texture:
        canvas = Canvas((0.6, 1.2), 80, visible, thermal)
        canvas.grain(self.bank, 10, 8)
        canvas.rect(0, 0, 0.6, 0.12, np.multiply(visible, 0.5), thermal + 45)
        if bands:
            for y in np.arange(0.3, 1.2, 0.22):
                canvas.rect(0, y, 0.6, 0.06, np.multiply(visible, 1.6), thermal - 35)
        return canvas.texture()

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

    def tree(self, x: float, z: float) -> None:
        """A trunk in a crown of four leafy planes, two across the street and two along it."""
        if not hasattr(self, "_trees"):
            self._trees = [self.crown_texture() for _ in range(3)]
            self._bark = self.plain_texture((48, 62, 76), self.uniform(90, 150), bands=True)
        ground, radius = -PAVEMENT_HEIGHT, self.uniform(1.3, 2.0)
        top = ground - self.uniform(4.6, 6.2)
        more: dict[str, Any] = {"reach": SMALL_REACH}
        self.box(
            (x - 0.14, top + radius, z - 0.14), (x + 0.14, ground, z + 0.14), self._bark, **more
        )
        for offset, size in ((-0.55, 0.8), (0.35, 1.0)):
            r = radius * size
            at = offset * radius
            self.quad(
                (x - r, top + radius - r, z + at),
                (2 * r, 0, 0),
                (0, 2.1 * r, 0),
                self.either(*self._trees),
                gain=0.8 + 0.25 * size,
                **more,
            )
            self.quad(
                (x + at, top + radius - r, z + r),
                (0, 0, -2 * r),
                (0, 2.1 * r, 0),
                self.either(*self._trees),
                gain=0.8 + 0.3 * size,
                **more,
            )

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

    # Cars

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

    @property
    def car_shadow(self) -> Texture:
        if not hasattr(self, "_shadow"):
            canvas = Canvas((2.3, 4.8), 40, (30, 30, 32), self.road_heat + 10, transparent=True)
            canvas.rect(0.08, 0.08, 2.14, 4.64, (34, 34, 36), self.road_heat + 12)
            canvas.grain(self.bank, 3, 5)
            self._shadow = canvas.texture()
        return self._shadow

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

    # Sky

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
