"""What a format cannot hold of a rig, measured by how far its absence moves a corner."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import InputError, Lens, Pinhole, Rig
from ..reprojection import pixels_of, rays_at

TOLERANCE = 0.1
"""A corner may move so far [px] before a format is refused."""


def corner_shift(camera: Pinhole, other: Pinhole) -> float:
    """How far the corners, and the middles of the borders, of an image are moved [px]: the
    largest distance between where two cameras show what the first one has there.
    """
    right, bottom = camera.width - 1.0, camera.height - 1.0
    xs, ys = (side.ravel() for side in np.meshgrid([0, right / 2, right], [0, bottom / 2, bottom]))
    shown = pixels_of(other, rays_at(camera, xs, ys))
    shift: NDArray[Any] = np.hypot(shown[:, 0] - xs, shown[:, 1] - ys)
    return float(np.inf if np.isnan(shift).any() else shift.max())


def held(
    rig: Rig, format_name: str, lenses: Mapping[str, int], tolerance: float
) -> tuple[Rig, list[str]]:
    """The rig that a format holds in place of one, and what it leaves out, a line each.

    Parameters
    ----------
    lenses
        How many coefficients the format has for each of our models that it knows.
    tolerance
        How far a corner may move [px].

    Raises
    ------
    InputError
        Where something would move by more, or the format has nothing of the kind.
    """
    if rig.source_mirrored:
        raise InputError(
            f"the rig's source is mirrored, which {format_name} cannot hold; expected a rig of"
            " images that were flipped beforehand"
        )
    lines: list[str] = []
    if rig.relative_depth is not None:
        lines.append(f"relative_depth is left out, {format_name} has nothing of the kind")
    cameras: list[Pinhole] = []
    for name, camera in (("reference", rig.reference), ("source", rig.source)):
        kept, missing = nearest(camera, format_name, name, lenses)
        if missing:
            shift = corner_shift(camera, kept)
            if shift > tolerance:
                raise InputError(
                    f"{format_name} cannot hold {missing} of the {name} camera: without, a corner"
                    f" of its image moves by {shift:.3g} px, expected at most {tolerance:g} px"
                    " (--tolerance)"
                )
            lines.append(
                f"{missing} of the {name} camera is left out, which moves a corner of its image by"
                f" {shift:.2g} px"
            )
        cameras.append(kept)
    return Rig(cameras[0], cameras[1], rig.R, rig.t), lines


def nearest(
    camera: Pinhole, format_name: str, name: str, lenses: Mapping[str, int]
) -> tuple[Pinhole, str]:
    """The camera without what the format cannot hold, and what that is, in words."""
    lens, missing = camera.lens, []
    if camera.skew:
        missing.append("the skew")
    if lens.model != "none" and lens.model not in lenses:
        raise InputError(
            f"{format_name} has no {lens.model} lens, which the {name} camera has; expected a rig"
            f" with {' or '.join([*lenses, 'none'])}, or another format"
        )
    count = lenses.get(lens.model, 0)
    names = BROWN if lens.model == "brown" else FISHEYE
    named = list(zip(names, lens.coefficients, strict=False))
    lost = [word for word, value in named[count:] if value]
    if lost:
        missing.append(" ".join(lost))
    if len(lens.coefficients) > count:
        lens = Lens(lens.model, lens.coefficients[:count])
    kept = Pinhole(
        camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, 0.0, lens
    )
    return kept, " and ".join(missing)


BROWN = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
FISHEYE = ("k1", "k2", "k3", "k4")


def padded(lens: Lens, count: int) -> list[float]:
    """The coefficients, with zeros up to a count."""
    values = list(lens.coefficients)
    return values + [0.0] * (count - len(values))
