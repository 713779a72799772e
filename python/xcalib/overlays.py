"""Two registered images in one, so that their alignment can be seen across modalities."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .frames import Image, display_gray, overlay, size_of

Picture = NDArray[np.uint8]
"""8-bit colour ``(H, W, 3)``, or ``(H, W, 4)`` with alpha, in OpenCV's order."""

EDGE = (40, 230, 255)
"""Colour of edges, blue, green, red: yellow stands off from both modalities."""
CELLS = 8
"""Of a checkerboard, along the width."""


def colour(image: Image) -> Picture:
    """8-bit colour of an image, stretched for the eye where it is not of 8 bits."""
    if image.dtype != np.uint8:
        image = display_gray(image)
    picture: Picture = image if image.ndim == 3 else np.dstack([image] * 3)
    return picture


def false_colour(image: Image) -> Picture:
    """An image in false colour, stretched for the eye."""
    return np.asarray(cv2.applyColorMap(display_gray(image), cv2.COLORMAP_INFERNO), np.uint8)


def edges_of(image: Image, mask: NDArray[Any] | None = None) -> NDArray[np.bool_]:
    """The edges of an image, thin lines; none along the rim of what the mask has valid."""
    gray = cv2.GaussianBlur(display_gray(image), (0, 0), 1.2)
    strength = np.hypot(cv2.Sobel(gray, cv2.CV_32F, 1, 0), cv2.Sobel(gray, cv2.CV_32F, 0, 1))
    inside = np.ones(gray.shape, bool)
    if mask is not None:
        valid = (np.asarray(mask) != 0).astype(np.uint8)
        inside = cv2.erode(valid, np.ones((7, 7), np.uint8), borderValue=0) != 0
    used = strength[inside]
    if not used.size:
        return inside
    low, high = (max(float(np.quantile(used, share)), 8.0) for share in (0.80, 0.93))
    found: NDArray[np.bool_] = (cv2.Canny(gray, low, high, L2gradient=True) != 0) & inside
    return found


def edge_layer(image: Image, mask: NDArray[Any] | None = None) -> Picture:
    """The edges of an image to lay over another: ``(H, W, 4)``, clear elsewhere."""
    found = edges_of(image, mask)
    layer = np.zeros((*found.shape, 4), np.uint8)
    layer[found] = (*EDGE, 255)
    return layer


def with_edges(reference: Image, registered: Image, mask: NDArray[Any] | None = None) -> Picture:
    """The registered source's edges drawn on the reference."""
    picture = colour(reference).copy()
    picture[edges_of(registered, mask)] = EDGE
    return picture


def blended(reference: Image, registered: Image, mask: NDArray[Any]) -> Picture:
    """Half the reference, in gray, and half the registered source, in false colour."""
    base = colour(display_gray(reference))
    mixed = np.asarray(cv2.addWeighted(base, 0.5, false_colour(registered), 0.5, 0), np.uint8)
    return np.where((mask != 0)[..., None], mixed, base)


def checkered(reference: Image, registered: Image, mask: NDArray[Any]) -> Picture:
    """The reference and the registered source in turn, square by square."""
    width, height = size_of(reference)
    side = max(1, width // CELLS)
    odd = (np.arange(height)[:, None] // side + np.arange(width) // side) % 2 == 1
    return np.where((odd & (mask != 0))[..., None], false_colour(registered), colour(reference))


def red_cyan(reference: Image, registered: Image, mask: NDArray[Any]) -> Picture:
    """The reference in red, the registered source in cyan."""
    return overlay(reference, registered, np.where(mask != 0, 0, 1).astype(np.uint8))


KINDS: dict[str, Callable[[Image, Image, NDArray[Any]], Picture]] = {
    "edges": with_edges,
    "blend": blended,
    "checker": checkered,
    "red-cyan": red_cyan,
}
"""By name: of a reference, a registered source and a mask that is nonzero where it is valid."""
