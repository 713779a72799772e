"""Thermal images as cameras and their software save them, as one number per pixel.

16-bit counts, floats in kelvin or Celsius, and 8-bit gray carry that number as it is. A
*false-colour* picture hides it: each value was replaced by a colour of a map, and the gray of a
colour is no function of the value (a rainbow is brightest in its middle). But its colours lie on
one curve in the colour cube, and the place on that curve is the value. The curve is one of the
known maps, or it is found in the colours themselves.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .footage.stream import Converted, Stream
from .frames import DecodeError, Image, InputError

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float32]

NEAR = 24.0
"""Distance from the curve within which a colour lies on it [of 255]: JPEG moves colours by 10."""
SHARE = 0.9
"""Share of the pixels that must lie near: the rest is text, a colour bar, and edges in JPEG."""
COLOURFUL = 40
"""Difference of the largest and smallest channel from which a pixel is colourful [of 255]."""
KNOWN_BONUS = 4.0
"""A known map is preferred to an estimated one that is nearer by less than this [of 255]."""
THIN = 0.045
"""Largest thickness of an estimated curve, as a share of its length: photographs begin at 0.055."""
SPAN = 150.0
"""Length of the curve that the pixels must use [of 255 per channel]: less is a tint, not a map."""
SAMPLES = 4000
"""Pixels a decision is made on."""
CELL = 16
"""Side of the cells of the colour cube in which a curve is looked for [of 255]."""
CELLS = 400
"""Cells that a curve of any map can fill, at most; a photograph fills more."""

_OPENCV = (
    *("autumn", "jet", "winter", "rainbow", "ocean", "summer", "spring", "cool", "hsv"),
    *("pink", "hot", "parula", "magma", "inferno", "plasma", "viridis", "cividis", "twilight"),
    *("twilight_shifted", "turbo", "deepgreen"),
)


@dataclass(frozen=True)
class ColorMap:
    """A curve in the colour cube, from cold to hot."""

    name: str
    curve: Bytes
    """``(256, 3)``, blue, green, red."""

    def invert(self, image: Image) -> Image:
        """The place of each pixel on the curve, 0 to 255: ``(h, w, 3)`` to ``(h, w)`` uint8.

        An image of one channel is returned as it is.
        """
        if image.ndim == 2:
            return image
        places, _ = self._nearest(_as_bytes(image).reshape(-1, 3))
        return places.astype(np.uint8).reshape(image.shape[:2])

    def distances(self, colours: Bytes) -> Floats:
        """Distance of each of ``(n, 3)`` colours from the curve [of 255]."""
        return self._nearest(colours)[1]

    def _nearest(self, colours: Bytes) -> tuple[NDArray[np.intp], Floats]:
        curve = self.curve.astype(np.float32)
        squares = (curve**2).sum(axis=1)
        places = np.empty(len(colours), np.intp)
        distances = np.empty(len(colours), np.float32)
        for start in range(0, len(colours), 65536):  # 64 MB of distances at a time
            part = colours[start : start + 65536].astype(np.float32)
            # |a - b|^2 = |a|^2 + |b|^2 - 2 ab, of which |a|^2 does not change which b is nearest.
            squared = squares - 2 * part @ curve.T
            nearest = squared.argmin(axis=1)
            least = squared[np.arange(len(part)), nearest] + (part**2).sum(axis=1)
            places[start : start + 65536] = nearest
            distances[start : start + 65536] = np.sqrt(np.maximum(least, 0))
        return places, distances


def _known_maps() -> dict[str, ColorMap]:
    ramp = np.arange(256, dtype=np.uint8)[:, None]
    maps = {}
    for name in _OPENCV:
        curve = cv2.applyColorMap(ramp, getattr(cv2, f"COLORMAP_{name.upper()}"))[:, 0]
        maps[name] = ColorMap(name, curve.astype(np.uint8))
    # The palette that camera makers call iron: black, blue, purple, red, orange, yellow, white.
    stops = ((0, 0, 0), (140, 0, 30), (150, 0, 140), (30, 70, 220), (0, 160, 250), (90, 230, 255))
    places = np.linspace(0, 255, len(stops) + 1)
    colours = np.array((*stops, (255, 255, 255)), np.float64)
    iron = np.stack([np.interp(ramp[:, 0], places, colours[:, c]) for c in range(3)], axis=1)
    return maps | {"iron": ColorMap("iron", iron.round().astype(np.uint8))}


KNOWN = _known_maps()
"""The known maps by name: OpenCV's, and `iron`. Not `bone`: it is as gray as a dull photograph."""


def recognise(images: Sequence[Image]) -> ColorMap | None:
    """The colour map of false-colour images of one camera, or None if they are none.

    Parameters
    ----------
    images
        ``(h, w)`` or ``(h, w, 3)``, of one map; a few are enough, and more than one is better
        where the map is not a known one.

    Returns the known map that is nearest, or one named ``estimated``, whose bright end counts as
    hot. Gray images, tinted ones, and photographs give None.
    """
    colours = _sample(images)
    if colours is None:
        return None
    spread = colours.max(axis=1).astype(int) - colours.min(axis=1)
    colourful = float(np.mean(spread > COLOURFUL))
    if colourful < 0.3:
        return None
    found = {name: _thickness(known, colours) for name, known in KNOWN.items()}
    best = min(found, key=lambda name: found[name])
    estimated = _estimate(colours)
    # The curve through the colours themselves is nearly always a little nearer than a known one.
    own = math.inf if estimated is None else _thickness(estimated, colours) + KNOWN_BONUS
    if found[best] < min(NEAR, own):
        return KNOWN[best] if _used_length(KNOWN[best], colours) > SPAN else None
    # Without a known map as a witness, only what no photograph has shown will do.
    if estimated is None or colourful < 0.6:
        return None
    thin = own - KNOWN_BONUS < min(NEAR, THIN * _used_length(estimated, colours))
    return estimated if thin else None


def scalar_sources(images: Stream, colormap: str = "auto") -> tuple[Stream, str]:
    """Source images with false colour turned back to numbers, and a line that says so.

    Parameters
    ----------
    images
        Source images on disk; a few of them, spread over the footage, are read to decide.
    colormap
        ``auto``, ``none`` (images as they are), or the name of a known map.

    The line is empty where nothing is changed.
    """
    if colormap == "none":
        return images, ""
    if colormap != "auto":
        if colormap not in KNOWN:
            raise InputError(
                f"colour map {colormap!r} is not known, expected auto, none or one of"
                f" {', '.join(sorted(KNOWN))}"
            )
        return Converted(images, KNOWN[colormap].invert), ""
    some: list[Image] = []
    for index in sorted({round(i) for i in np.linspace(0, len(images) - 1, 4)}):
        # What cannot be read is met again, and named, when its turn comes.
        with contextlib.suppress(DecodeError):
            some.append(images[index])
    found = recognise(some) if some else None
    if found is None:
        return images, ""
    line = (
        f"source images are false colour (map: {found.name}), turned back to numbers;"
        " --source-colormap none keeps their colours"
    )
    return Converted(images, found.invert), line


def _as_bytes(image: Image) -> Bytes:
    if image.dtype == np.uint16:
        return (image >> 8).astype(np.uint8)
    if image.dtype == np.float32:
        return (255 * image.clip(0, 1)).astype(np.uint8)
    return image.astype(np.uint8, copy=False)


def _sample(images: Sequence[Image]) -> Bytes | None:
    """Some pixels of all images, ``(n, 3)``; None if one has no colour channels."""
    if any(image.ndim != 3 for image in images):
        return None
    parts = []
    for image in images:
        pixels = _as_bytes(image).reshape(-1, 3)
        parts.append(pixels[:: max(1, len(pixels) * len(images) // SAMPLES)])
    return np.concatenate(parts)


def _thickness(colormap: ColorMap, colours: Bytes) -> float:
    """Distance from the curve within which the share `SHARE` of the colours lies [of 255]."""
    return float(np.quantile(colormap.distances(colours), SHARE))


def _used_length(colormap: ColorMap, colours: Bytes) -> float:
    """Length of the part of the curve between the 2nd and the 98th percentile of the pixels."""
    places, _ = colormap._nearest(colours)
    first, last = np.quantile(places, (0.02, 0.98)).astype(int)
    steps = np.diff(colormap.curve[first : last + 1].astype(float), axis=0)
    return float(np.linalg.norm(steps, axis=1).sum())


# -- A curve from the colours themselves ---------------------------------------------------------


def _estimate(colours: Bytes) -> ColorMap | None:
    """The curve that the colours lie on; None if they fill more of the cube than a curve does.

    Distances are measured along the cloud of colours, cell by cell, so that a curve that winds
    is unrolled; the two colours farthest apart in this sense are its ends. What is equally far
    from one end is averaged.
    """
    cells, counts, means = _occupied(colours)
    if not 4 <= len(cells) <= CELLS:
        return None
    middle = int(counts.argmax())
    first = int(np.argmax(_along(cells, means, middle)))
    far = _along(cells, means, first)
    if not math.isfinite(float(far.max())) or far.max() < SPAN:
        return None
    nodes = np.arange(0, far.max() + CELL / 2, CELL / 2)
    # A window of a cell's width, weighted by how many pixels a cell has.
    weights = counts * np.exp(-0.5 * ((nodes[:, None] - far) / CELL) ** 2)
    curve = weights @ means / weights.sum(axis=1, keepdims=True)
    if curve[0] @ (0.114, 0.587, 0.299) > curve[-1] @ (0.114, 0.587, 0.299):
        curve = curve[::-1]
    lengths = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    even = np.linspace(0, lengths[-1], 256)
    fine = np.stack([np.interp(even, lengths, curve[:, c]) for c in range(3)], axis=1)
    return ColorMap("estimated", fine.round().astype(np.uint8))


def _occupied(
    colours: Bytes,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Cells of the cube that together hold nearly all pixels: places, counts and mean colours."""
    places = (colours // CELL).astype(np.int64)
    keys = places @ (1, 256, 65536)
    unique, inverse, counts = np.unique(keys, return_inverse=True, return_counts=True)
    inverse = inverse.reshape(-1)
    sums = np.stack([np.bincount(inverse, colours[:, c]) for c in range(3)], axis=1)
    order = np.argsort(-counts)
    # The fullest cells until 97 % of the pixels are in: noise fills the others, one by one.
    kept = order[: int(np.searchsorted(np.cumsum(counts[order]), 0.97 * len(colours))) + 1]
    cells = np.stack([unique // 256**k % 256 for k in range(3)], axis=1)[kept]
    return cells, counts[kept], sums[kept] / counts[kept, None]


def _along(cells: NDArray[np.int64], means: NDArray[np.float64], start: int) -> NDArray[np.float64]:
    """Distance of each cell from one, in steps between cells at most two apart (Dijkstra)."""
    distance = np.full(len(cells), math.inf)
    distance[start] = 0
    unseen = np.ones(len(cells), bool)
    while True:
        reachable = np.where(unseen, distance, math.inf)
        here = int(reachable.argmin())
        if not math.isfinite(reachable[here]):
            break
        unseen[here] = False
        near = np.abs(cells - cells[here]).max(axis=1) <= 2
        steps = distance[here] + np.linalg.norm(means - means[here], axis=1)
        distance[near] = np.minimum(distance[near], steps[near])
    # Islands apart from the rest are not of the curve.
    return np.where(np.isfinite(distance), distance, 0.0)
