"""Depth from a prior on the road."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..frames import Image, InputError, size_of
from .provider import Depth


@dataclass(frozen=True)
class PlaneDepth:
    """Road-plane prior: a flat road under the camera, and everything else far away.

    ``D(x, y) = camera_height * fy / r(x, y)``, where ``r`` is the distance of a pixel below the
    horizon [px], never beyond ``far``, which is also the depth at and above the horizon.
    """

    camera_height: float = 1.6
    """Height of the reference camera above the road [m], > 0."""
    horizon: float = 0.5
    """Row of the horizon in the middle column, as a fraction of the image height from the top,
    (-1, 1)."""
    far: float = 60.0
    """Largest depth [m], > 0."""
    hfov_deg: float = 45.0
    """Horizontal field of view of the reference camera [deg], (0, 180); pixels are square."""
    roll_deg: float = 0.0
    """How far the horizon falls towards the right [deg], (-45, 45)."""

    parallel = True

    def __post_init__(self) -> None:
        for name, low, high, unit in (
            ("camera_height", 0.0, math.inf, "m"),
            ("horizon", -1.0, 1.0, "of the image height"),
            ("far", 0.0, math.inf, "m"),
            ("hfov_deg", 0.0, 180.0, "deg"),
            ("roll_deg", -45.0, 45.0, "deg"),
        ):
            value = getattr(self, name)
            if not low < value < high:  # NaN fails too
                between = f"above {low:g}" if high == math.inf else f"between {low:g} and {high:g}"
                raise InputError(f"plane {name} is {value:g}, expected {between} {unit}")

    def __call__(self, index: int, reference: Image) -> Depth:
        width, height = size_of(reference)
        fy = 0.5 * width / math.tan(math.radians(self.hfov_deg) / 2)
        roll = math.radians(self.roll_deg)
        y = np.arange(height)[:, None] - (self.horizon * height - 0.5)
        x = np.arange(width)[None, :] - (width - 1) / 2
        # A plane's inverse depth is linear in the image; the horizon is where it is zero.
        below = y * math.cos(roll) - x * math.sin(roll)
        depth = np.full((height, width), self.far, np.float32)
        road = below > 0
        depth[road] = np.minimum(self.camera_height * fy / below[road], self.far)
        return depth
