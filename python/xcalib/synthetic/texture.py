"""How a surface looks: a picture for each modality, painted in metres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Colour = Sequence[float] | Array  # BGR, 0-255


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
