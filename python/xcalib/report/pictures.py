"""The pictures of a page: each frame before and after, as layers that the page combines."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._core import Registrar, patch_flow
from ..frames import Image, size_of
from ..overlays import Picture, colour, edge_layer, false_colour
from .run import Run

FRAMES = 4
"""Shown at most."""
WIDTH = 640
"""Of a picture at most [px]."""
ARROWS = 16
"""Along the width."""
CONFIDENT = 0.35
"""Flow below is not shown."""

MASK = {0: None, 1: (150, 90, 40), 2: (40, 60, 220), 3: (110, 110, 110)}
"""Colours of the codes of a mask, blue, green, red."""


@dataclass(frozen=True)
class Arrow:
    """What flow still sees at a place of the reference [px of the picture]."""

    x: float
    y: float
    dx: float
    dy: float


@dataclass(frozen=True)
class FramePictures:
    """A frame as layers of one size, as data URLs."""

    name: str
    width: int
    height: int
    reference: str
    before: str
    after: str
    edges_before: str
    edges_after: str
    mask: str
    arrows: list[Arrow]
    shares: dict[str, float]
    """Of the pixels: valid, outside, occluded, no depth."""


def frame_pictures(run: Run) -> list[FramePictures]:
    """Some of the frames used, spread over them."""
    spread = np.linspace(0, len(run.chosen) - 1, min(FRAMES, len(run.chosen)))
    return [pictures_of(run, run.chosen[round(float(i))]) for i in spread]


def pictures_of(run: Run, index: int) -> FramePictures:
    """The layers of one frame."""
    reference, source, depth = run.frames.read(index)
    registered, mask = Registrar(run.frames.fit(run.rig)).register(source, depth)
    width, height = size_of(reference)
    factor = min(1.0, WIDTH / width)
    size = (max(1, round(factor * width)), max(1, round(factor * height)))

    def small(image: Image) -> Image:
        method = cv2.INTER_AREA if size < size_of(image) else cv2.INTER_LINEAR
        return image if size_of(image) == size else cv2.resize(image, size, interpolation=method)

    codes = np.asarray(cv2.resize(mask, size, interpolation=cv2.INTER_NEAREST), np.uint8)
    shown, moved, valid = small(reference), small(registered), codes == 0
    unmoved = small(source)
    return FramePictures(
        run.frames.references.name(index),
        *size,
        jpeg(colour(shown)),
        jpeg(false_colour(unmoved)),
        png(np.dstack([false_colour(moved), np.uint8(255) * valid])),
        png(edge_layer(unmoved)),
        png(edge_layer(moved, valid)),
        png(mask_layer(codes)),
        arrows(shown, moved, valid),
        {
            name: float(np.mean(mask == code))
            for code, name in enumerate(("valid", "outside", "occluded", "no depth"))
        },
    )


def mask_layer(codes: NDArray[np.uint8]) -> Picture:
    """Colours over what is not valid."""
    layer = np.zeros((*codes.shape, 4), np.uint8)
    for code, tint in MASK.items():
        if tint is not None:
            layer[codes == code] = (*tint, 170)
    return layer


def arrows(reference: Image, registered: Image, valid: NDArray[Any]) -> list[Arrow]:
    """The residual flow on a coarse grid, where it is confident."""
    height, width = valid.shape
    flow, confidence = patch_flow(reference, registered, valid.astype(np.uint8))
    step = max(8, width // ARROWS)
    found = []
    for y in range(step // 2, height, step):
        for x in range(step // 2, width, step):
            if confidence[y, x] > CONFIDENT and valid[y, x]:
                dx, dy = map(float, flow[y, x])
                found.append(Arrow(x, y, dx, dy))
    return found


def jpeg(image: Picture) -> str:
    """A data URL."""
    return url("image/jpeg", ".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 82])


def png(image: Picture) -> str:
    """A data URL."""
    return url("image/png", ".png", image, [cv2.IMWRITE_PNG_COMPRESSION, 9])


def url(kind: str, suffix: str, image: Picture, parameters: Sequence[int]) -> str:
    """An encoded image as a data URL."""
    done, data = cv2.imencode(suffix, image, list(parameters))
    if not done:
        raise ValueError(f"cannot encode {image.shape} {image.dtype} as {suffix}")
    return f"data:{kind};base64,{base64.b64encode(data.tobytes()).decode()}"
