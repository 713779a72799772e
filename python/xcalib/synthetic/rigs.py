"""Rigs to render with: random ones, and that of the demonstrations."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._core import Lens, Pinhole, Rig
from ..reprojection import rays_at
from .arguments import require

Array = NDArray[Any]


def random_rig(
    seed: int,
    width: int = 640,
    height: int = 480,
    source_width: int = 640,
    source_height: int = 512,
    hfov_deg: tuple[float, float] = (30.0, 90.0),
    fov_ratio: tuple[float, float] = (0.5, 2.0),
    max_offset: float = 0.3,
    max_roll_deg: float = 5.0,
    max_baseline: float = 0.5,
    reference_lens: Lens | None = None,
    source_lens: Lens | None = None,
) -> Rig:
    """A random but plausible rig; the same seed gives the same rig.

    Parameters
    ----------
    seed : int >= 0
    width, height, source_width, source_height : int
        Image sizes [px].
    hfov_deg : (float, float)
        Range of both horizontal fields of view [deg], as the lenses have them; the reference's is
        uniform in it.
    fov_ratio : (float, float)
        Range of source over reference field of view, log-uniform, as far as `hfov_deg` admits.
    max_offset : float
        The point at infinity on the source's optical axis is seen by the reference up to this share
        of its width (and, independently, height) away from its image centre. [0, 0.5]
    max_roll_deg : float
        Roll is uniform within +- this. [deg]
    max_baseline : float
        Length of the translation, uniform from 0.02 m to this; mostly lateral, |t_z| <= 0.3 of it.
        [m]
    reference_lens, source_lens : Lens or None
        What the cameras look through; the rig is otherwise drawn alike.

    Returns
    -------
    Rig
        Principal points within 1 % of the width of the image centre, fy / fx within 0.5 %, no skew.

    Raises
    ------
    ValueError
        An argument out of range, no field of view that satisfies both ranges, or one that a lens
        does not show.
    """
    sizes = {"width": width, "height": height}
    sizes |= {"source_width": source_width, "source_height": source_height}
    for name, value in sizes.items():
        require(value >= 8, name, value, "at least 8 px")
    require(seed >= 0, "seed", seed, "an integer >= 0")
    require(0 < hfov_deg[0] <= hfov_deg[1] < 170, "hfov_deg", hfov_deg, "0 < low <= high < 170")
    require(0 < fov_ratio[0] <= fov_ratio[1], "fov_ratio", fov_ratio, "0 < low <= high")
    require(0 <= max_offset <= 0.5, "max_offset", max_offset, "in [0, 0.5]")
    require(0 <= max_roll_deg <= 180, "max_roll_deg", max_roll_deg, "in [0, 180]")
    require(max_baseline >= 0.02, "max_baseline", max_baseline, "at least 0.02 m")

    rng = np.random.default_rng([seed, 0x416])
    reference_hfov, source_hfov = _draw_hfovs(rng, hfov_deg, fov_ratio)
    reference = _draw_camera(rng, width, height, reference_hfov, reference_lens)
    source = _draw_camera(rng, source_width, source_height, source_hfov, source_lens)
    offset = rng.uniform(-max_offset, max_offset, 2) * (width, height)
    axis_at = np.array([(width - 1) / 2, (height - 1) / 2]) + offset
    axis = np.append(rays_at(reference, axis_at[:1], axis_at[1:])[0], 1.0)
    require(np.isfinite(axis).all(), "max_offset", max_offset, "what the reference's lens shows")
    roll = np.deg2rad(rng.uniform(-max_roll_deg, max_roll_deg))
    R = rotation_z(roll) @ turned_towards(axis).T
    across, along = rng.uniform(-0.3, 0.3, 2)
    lateral = rng.choice([-1.0, 1.0]) * np.sqrt(1 - across**2 - along**2)
    t = rng.uniform(0.02, max_baseline) * np.array([lateral, across, along])
    return Rig(reference, source, R, t)


def demo_rig() -> Rig:
    """The rig of the demonstrations: a wide visible camera, and a thermal one 15 cm right of it."""
    reference = _camera(960, 720, 50.0, (3.0, -2.0), 1.001)
    source = _camera(640, 512, 42.0, (-2.5, 1.5), 0.999)
    pan, tilt = np.deg2rad([2.2, -1.3])
    axis = np.array([np.tan(pan), np.tan(tilt), 1.0])
    R = rotation_z(np.deg2rad(1.5)) @ turned_towards(axis).T
    centre = 0.15 * np.array([0.985, -0.06, 0.16]) / np.linalg.norm([0.985, -0.06, 0.16])
    return Rig(reference, source, R, -R @ centre)


def _draw_hfovs(
    rng: np.random.Generator, hfov_deg: tuple[float, float], fov_ratio: tuple[float, float]
) -> tuple[float, float]:
    low, high = hfov_deg
    for _ in range(100):
        reference = float(rng.uniform(low, high))
        # Drawing inside the admissible range is redrawing until the source's field of view fits.
        ratios = max(fov_ratio[0], low / reference), min(fov_ratio[1], high / reference)
        if ratios[0] <= ratios[1]:
            return reference, reference * float(np.exp(rng.uniform(*np.log(ratios))))
    raise ValueError(
        f"fov_ratio is {fov_ratio}, expected one that hfov_deg {hfov_deg} leaves room for"
    )


def _draw_camera(
    rng: np.random.Generator, width: int, height: int, hfov: float, lens: Lens | None
) -> Pinhole:
    offset = rng.uniform(-0.01, 0.01, 2) * width
    aspect = float(rng.uniform(0.995, 1.005))
    return _camera(width, height, hfov, (float(offset[0]), float(offset[1])), aspect, lens)


def _camera(
    width: int,
    height: int,
    hfov: float,
    offset: tuple[float, float],
    aspect: float,
    lens: Lens | None = None,
) -> Pinhole:
    fx = width / 2 / float(np.tan(np.deg2rad(hfov) / 2))
    if lens is not None:
        fx = Pinhole.from_hfov(width, height, hfov, lens).fx
    cx, cy = (width - 1) / 2 + offset[0], (height - 1) / 2 + offset[1]
    return Pinhole(width, height, fx, fx * aspect, cx, cy, 0.0, lens or Lens())


def rotation_z(angle: float) -> Array:
    """The rotation about the z axis by an angle [rad], (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def turned_towards(axis: Array) -> Array:
    """The rotation by pan, then tilt, without roll, that takes the z axis to `axis`: (3, 3)."""
    forward = axis / np.linalg.norm(axis)
    right = np.array([forward[2], 0.0, -forward[0]]) / np.hypot(forward[0], forward[2])
    return np.stack([right, np.cross(forward, right), forward], axis=1)
