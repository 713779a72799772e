"""Registration of one pair without a rig: what the comparisons stand beside.

Each takes `(reference, source)`, gray float32 in [0, 1] of any sizes, and gives a map (H, W, 2):
the place in the source [px] of each reference pixel. Pairs begin where the images are laid on each
other. One that finds nothing raises `NotFound`.
"""

import cv2
import numpy as np


class NotFound(RuntimeError):
    """The method found no registration of this pair."""


def prepared(image: np.ndarray) -> np.ndarray:
    """Log-compressed where dark, 1-99 % stretched: what a pair's methods see, [0, 1]."""
    low, high = np.percentile(image, (1, 99))
    one = np.clip((image - low) / max(high - low, 1e-6), 0, 1).astype(np.float32)
    if np.median(one) < 0.3:
        one = np.log1p(20 * one) / np.float32(np.log(21))
    return one


def on_grid_of(reference: np.ndarray, source: np.ndarray) -> np.ndarray:
    """The source resized to the reference."""
    size = reference.shape[1], reference.shape[0]
    smaller = size[0] < source.shape[1]
    return cv2.resize(source, size, interpolation=cv2.INTER_AREA if smaller else cv2.INTER_LINEAR)


def edges(image: np.ndarray) -> np.ndarray:
    """Gradient magnitude after a blur, capped at 4 means, [0, 1]."""
    smooth = cv2.GaussianBlur(prepared(image), (0, 0), 1.0)
    magnitude = np.hypot(cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1))
    cap = max(4 * float(magnitude.mean()), 1e-6)
    return np.minimum(magnitude / cap, 1).astype(np.float32)


def grid(shape: tuple[int, ...]) -> np.ndarray:
    """The map that leaves everything where it is, (H, W, 2)."""
    x, y = np.meshgrid(*(np.arange(side, dtype=np.float32) for side in (shape[1], shape[0])))
    return np.stack([x, y], axis=-1)


def into_source(at: np.ndarray, source: np.ndarray) -> np.ndarray:
    """A map into the source resized to the reference, as one into the source itself."""
    factor = np.array([source.shape[1] / at.shape[1], source.shape[0] / at.shape[0]], np.float32)
    return at * factor + (factor - 1) / 2


def homography_map(shape: tuple[int, ...], homography: np.ndarray) -> np.ndarray:
    """Where a homography takes the pixels of an image, (H, W, 2) float32."""
    points = grid(shape).reshape(-1, 1, 2)
    return cv2.perspectiveTransform(points, homography).reshape(*shape[:2], 2)


def plausible(homography: np.ndarray | None, shape: tuple[int, ...]) -> bool:
    """Are areas kept within a factor of 4, and the image's corners in front and in order?"""
    if homography is None or not np.isfinite(homography).all():
        return False
    height, width = shape[:2]
    corners = np.float32([[[0, 0]], [[width, 0]], [[width, height]], [[0, height]]])
    weights = np.concatenate([corners[:, 0], np.ones((4, 1))], axis=1) @ homography[2]
    moved = cv2.perspectiveTransform(corners, homography)
    if (weights / homography[2, 2] <= 0).any() or not cv2.isContourConvex(moved):
        return False
    area = cv2.contourArea(moved, oriented=True) / cv2.contourArea(corners, oriented=True)
    return 0.25 < area < 4


def unregistered(reference: np.ndarray, source: np.ndarray) -> np.ndarray:
    return into_source(grid(reference.shape), source)
