"""Points, boxes, polygons and masks from one image of a frame to the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .._core import FrameTransfer, InputError, Rig
from ..frames import same_aspect, size_of

Points = NDArray[np.float64]
Mask = NDArray[np.uint8]
Box = tuple[float, float, float, float]
"""Left, top, right, bottom [px], of pixel centres at integers."""

VALID, OUTSIDE, OCCLUDED, NO_DEPTH, AMBIGUOUS = range(5)
CODES = ("valid", "outside", "occluded", "no depth", "ambiguous")
"""What the codes of `FrameTransfer` stand for."""

SPREAD = 0.05
"""A shape is ambiguous where the quarters of its depths move it by this much of its own size ..."""
SPREAD_PX = 2.0
"""... and by so many pixels."""
HIDDEN = 0.5
"""A shape is occluded where this share of it is."""
ONE_THING = 1.25
"""Depths, as ratios, that belong to a thing."""
PER_EDGE = 8
"""Points along an edge: lenses bend lines."""


@dataclass(frozen=True)
class Moved:
    """A shape in the other image."""

    points: Points | None
    """(N, 2) [px], within the image; None where nothing of it is there."""
    notes: tuple[str, ...] = field(default=())
    """What is to be known of it: outside, clipped, occluded, no depth, ambiguous."""
    depth: float = float("nan")
    """That it was moved at [m]."""

    @property
    def box(self) -> Box | None:
        """What it spans."""
        if self.points is None:
            return None
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        return float(low[0]), float(low[1]), float(high[0]), float(high[1])


class Shapes:
    """What carries labels between the two images of one frame.

    Parameters
    ----------
    rig
        Of the size of the images.
    depth
        ``(h, w)`` float32 [m] of the reference, 0 unknown.
    to
        ``source``: labels are the reference's; ``reference``: they are the source's.
    """

    def __init__(self, rig: Rig, depth: NDArray[Any], to: str) -> None:
        if to not in ("source", "reference"):
            raise InputError(f"to is {to!r}, expected source or reference")
        camera = rig.reference
        if not same_aspect(size_of(depth), (camera.width, camera.height)):
            raise InputError(
                f"depth is {depth.shape[1]}x{depth.shape[0]}, expected the aspect of the"
                f" reference's {camera.width}x{camera.height}"
            )
        self.rig, self.to = rig, to
        self._frame = FrameTransfer(rig, depth)
        start, end = (rig.reference, rig.source) if to == "source" else (rig.source, rig.reference)
        self.size, self.other_size = (start.width, start.height), (end.width, end.height)

    def points(self, points: Any) -> tuple[Points, Mask]:
        """(N, 2) points in the other image, each through its own depth, and codes."""
        values = np.asarray(points, np.float64).reshape(-1, 2)
        move = self._frame.to_source if self.to == "source" else self._frame.to_reference
        found, _, codes = move(values)
        return np.where((codes == OUTSIDE)[:, None], np.nan, found), codes

    def box(self, box: Box) -> Moved:
        """A box around where a box goes."""
        left, top, right, bottom = box
        corners = [(left, top), (right, top), (right, bottom), (left, bottom)]
        moved = self.polygon(corners)
        if moved.box is None:
            return moved
        left, top, right, bottom = moved.box
        points = np.array([(left, top), (right, top), (right, bottom), (left, bottom)])
        return Moved(points, moved.notes, moved.depth)

    def polygon(self, corners: Sequence[Sequence[float]] | Points) -> Moved:
        """A polygon, at the depth of what is in it, cut off at the other image's borders."""
        outline = np.asarray(corners, np.float64).reshape(-1, 2)
        inside = pixels_in(outline, *self.size)
        if not len(inside):
            return Moved(None, ("outside",))
        depths, hidden = self._depths(inside)
        if not depths.size:
            return Moved(None, ("no depth",))
        low, middle, high = np.quantile(depths, (0.25, 0.5, 0.75))
        notes = []
        placed = self._at(dense(outline), middle)
        if not np.isfinite(placed).all():
            return Moved(None, ("outside",), float(middle))
        apart = np.abs(self._at(outline, low) - self._at(outline, high)).max()
        if not apart <= max(SPREAD_PX, SPREAD * np.ptp(placed, axis=0).max()):
            notes.append("ambiguous")
        if hidden > HIDDEN:
            notes.append("occluded")
        cut = clipped(placed, *self.other_size)
        if cut is None:
            return Moved(None, (*notes, "outside"), float(middle))
        if np.any(placed.min(axis=0) < -0.5) or np.any(
            placed.max(axis=0) > np.array(self.other_size) - 0.5
        ):
            notes.append("clipped")
        return Moved(cut, tuple(notes), float(middle))

    def mask(self, mask: Mask) -> Mask:
        """A mask of the other image, pixel by pixel through the depth; 0 where nothing goes."""
        if size_of(mask) != self.size:
            raise InputError(
                f"the mask is {mask.shape[1]}x{mask.shape[0]}, expected the image's"
                f" {self.size[0]}x{self.size[1]} px"
            )
        width, height = self.other_size
        ys, xs = np.mgrid[0:height, 0:width]
        grid = np.column_stack([xs.ravel(), ys.ravel()]).astype(np.float64)
        # The other image is filled from where its pixels come from.
        back = self._frame.to_reference if self.to == "source" else self._frame.to_source
        found, _, codes = back(grid)
        found[codes != VALID] = -1
        at = found.astype(np.float32).reshape(height, width, 2)
        moved = cv2.remap(mask, at[..., 0], at[..., 1], cv2.INTER_NEAREST)
        return np.asarray(moved, np.uint8)

    def _depths(self, pixels: Points) -> tuple[NDArray[np.float64], float]:
        """Depths of the thing at these pixels, in the reference [m], and the share of it that the
        source does not see.
        """
        move = self._frame.to_source if self.to == "source" else self._frame.to_reference
        _, depths, codes = move(pixels)
        known = np.isfinite(depths) & (depths > 0)
        if not known.any():
            return depths[known], 0.0
        # A thing stands before what is behind it: of the middle half of the shape, what lies about
        # the median depth.
        near = np.abs(pixels - pixels.mean(axis=0)) <= np.ptp(pixels, axis=0) / 4 + 0.5
        middle = depths[known & near.all(axis=1)]
        centre = float(np.median(middle if middle.size else depths[known]))
        thing = known & (depths < centre * ONE_THING) & (depths > centre / ONE_THING)
        return depths[thing], float(np.mean(codes[thing] == OCCLUDED))

    def _at(self, points: Points, depth: float) -> Points:
        """Points at one depth, beyond the image too; NaN where they are behind a camera."""
        move = self.rig.transfer if self.to == "source" else self.rig.transfer_back
        return np.asarray(move(points, depth, beyond=True), np.float64)


def dense(outline: Points) -> Points:
    """An outline with more points along its edges."""
    shares = np.arange(PER_EDGE) / PER_EDGE
    following = np.roll(outline, -1, axis=0)
    steps = outline[:, None] + shares[:, None] * (following - outline)[:, None]
    return np.asarray(steps.reshape(-1, 2), np.float64)


def pixels_in(outline: Points, width: int, height: int) -> Points:
    """The pixels of an image in an outline; none where it lies outside."""
    low = np.clip(np.floor(outline.min(axis=0)), 0, (width - 1, height - 1)).astype(int)
    high = np.clip(np.ceil(outline.max(axis=0)), 0, (width - 1, height - 1)).astype(int)
    inside = np.zeros((high[1] - low[1] + 1, high[0] - low[0] + 1), np.uint8)
    fixed = np.rint((outline - low) * 16).astype(np.int32)
    cv2.fillPoly(inside, [fixed], 1, shift=4)
    if np.any(outline.max(axis=0) < 0) or np.any(outline.min(axis=0) > (width - 1, height - 1)):
        return np.empty((0, 2))
    ys, xs = np.nonzero(inside)
    return np.asarray(np.column_stack([xs, ys]) + low, np.float64)


def clipped(outline: Points, width: int, height: int) -> Points | None:
    """The part of an outline that an image has, by Sutherland and Hodgman; None where none."""
    points = outline
    for axis, border, sign in (
        (0, -0.5, 1),
        (0, width - 0.5, -1),
        (1, -0.5, 1),
        (1, height - 0.5, -1),
    ):
        kept: list[NDArray[np.float64]] = []
        for point, following in zip(points, np.roll(points, -1, axis=0), strict=True):
            a, b = sign * (point[axis] - border), sign * (following[axis] - border)
            if a >= 0:
                kept.append(point)
            if (a >= 0) != (b >= 0):
                kept.append(point + a / (a - b) * (following - point))
        if len(kept) < 3:
            return None
        points = np.array(kept)
    return points
