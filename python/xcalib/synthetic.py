"""Synthetic drives: a visible-thermal rig in a textured street, with exact depth.

For tests, benchmarks and demonstrations: the one place where the true rig, the true depth and the
true occlusions are known. Both cameras see the same geometry; every surface has an unrelated albedo
and temperature, so that structure is shared and contrast is not.

>>> rig = random_rig(seed=1)
>>> frames = list(render(rig, num_frames=8, seed=1))
>>> write("drive", frames, rig)

How a view is made. A face X(u, v) = G (u, v, 1)^T, G = [right down origin] in camera axes, is seen
at pixel x~ where z K^-1 x~ = G (u, v, 1)^T, so A x~ = (u, v, 1) / z with A = (K G)^-1: inverse
depth and the edges of the face are affine in the pixel, whether or not the face crosses the camera
plane. Visibility takes the greatest 1/z at every sample; then each face paints the samples it won,
from its texture, filtered to the distance. Samples lie on a regular grid, `_SAMPLES` each way and
symmetric about every (integer) pixel centre; depth is evaluated at the centres themselves.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import DTypeLike, NDArray

from xcalib import _street
from xcalib._core import Pinhole, Rig
from xcalib.frames import write_bytes

Array = NDArray[Any]

_SAMPLES = 2  # per pixel and direction
_NEAR = 0.05  # [m] nothing is nearer than this to a camera
_BAND = 1.6  # a face is filtered for one distance at a time, within this factor
_BLUR = 0.7  # [px] sigma of the thermal optics
_VISIBLE_NOISE = {False: 1.6, True: 2.6}  # [of 255] by night
_THERMAL_NOISE, _PATTERN_NOISE = 1.3, 0.9  # [of 255] per frame; fixed
_COUNTS, _COUNT_OFFSET = (
    24.0,
    7000.0,
)  # raw thermal counts per level of the 8-bit image, and at its zero


# --- Rigs -----------------------------------------------------------------------------------------


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
) -> Rig:
    """A random but plausible rig; the same seed gives the same rig.

    Parameters
    ----------
    seed : int >= 0
    width, height, source_width, source_height : int
        Image sizes [px].
    hfov_deg : (float, float)
        Range of both horizontal fields of view [deg]; the reference's is uniform in it.
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

    Returns
    -------
    Rig
        Principal points within 1 % of the width of the image centre, fy / fx within 0.5 %, no skew.

    Raises
    ------
    ValueError
        An argument out of range, or no field of view that satisfies both ranges.
    """
    sizes = {"width": width, "height": height}
    sizes |= {"source_width": source_width, "source_height": source_height}
    for name, value in sizes.items():
        _require(value >= 8, name, value, "at least 8 px")
    _require(seed >= 0, "seed", seed, "an integer >= 0")
    _require(0 < hfov_deg[0] <= hfov_deg[1] < 170, "hfov_deg", hfov_deg, "0 < low <= high < 170")
    _require(0 < fov_ratio[0] <= fov_ratio[1], "fov_ratio", fov_ratio, "0 < low <= high")
    _require(0 <= max_offset <= 0.5, "max_offset", max_offset, "in [0, 0.5]")
    _require(0 <= max_roll_deg <= 180, "max_roll_deg", max_roll_deg, "in [0, 180]")
    _require(max_baseline >= 0.02, "max_baseline", max_baseline, "at least 0.02 m")

    rng = np.random.default_rng([seed, 0x416])
    reference_hfov, source_hfov = _draw_hfovs(rng, hfov_deg, fov_ratio)
    reference = _draw_camera(rng, width, height, reference_hfov)
    source = _draw_camera(rng, source_width, source_height, source_hfov)
    offset = rng.uniform(-max_offset, max_offset, 2) * (width, height)
    axis_at = np.array([(width - 1) / 2, (height - 1) / 2]) + offset
    axis = np.linalg.inv(_K(reference)) @ (*axis_at, 1.0)
    roll = np.deg2rad(rng.uniform(-max_roll_deg, max_roll_deg))
    R = _rotation_z(roll) @ _turned_towards(axis).T
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
    R = _rotation_z(np.deg2rad(1.5)) @ _turned_towards(axis).T
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


def _draw_camera(rng: np.random.Generator, width: int, height: int, hfov: float) -> Pinhole:
    offset = rng.uniform(-0.01, 0.01, 2) * width
    return _camera(
        width, height, hfov, (float(offset[0]), float(offset[1])), float(rng.uniform(0.995, 1.005))
    )


def _camera(
    width: int, height: int, hfov: float, offset: tuple[float, float], aspect: float
) -> Pinhole:
    fx = width / 2 / float(np.tan(np.deg2rad(hfov) / 2))
    cx, cy = (width - 1) / 2 + offset[0], (height - 1) / 2 + offset[1]
    return Pinhole(width, height, fx, fx * aspect, cx, cy, 0.0)


def _rotation_z(angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _turned_towards(axis: Array) -> Array:
    """The rotation by pan, then tilt, without roll, that takes the z axis to `axis`."""
    forward = axis / np.linalg.norm(axis)
    right = np.array([forward[2], 0.0, -forward[0]]) / np.hypot(forward[0], forward[2])
    return np.stack([right, np.cross(forward, right), forward], axis=1)


def _K(camera: Pinhole) -> Array:
    return np.asarray(camera.K, np.float64)


# --- Drives ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Frame:
    """One synchronized pair and its depth.

    reference: (H, W, 3) uint8, BGR; source: (h, w) uint8 or uint16; depth: (H, W) float32 [m], 0
    where unknown; name: six digits.
    """

    reference: Array
    source: Array
    depth: Array
    name: str


class Street:
    """A street, and a rig driving down it.

    Parameters
    ----------
    rig : Rig
    num_frames : int
        Length of the drive; `len(street)`.
    seed : int >= 0
        Another seed is another street: layout, textures and contrasts. Same arguments, same pixels.
    night : bool
        The visible camera has only street lamps, lit windows and headlights to see by.
    noise : float
        Factor on all sensor noise; 0 turns it off. (The blur of the thermal optics stays.)
    speed : float
        [m per frame]
    depth_noise : float
        Relative standard deviation of a smooth multiplicative error of the depth; 0 is exact.
    sky_depth : float
        0: the sky is at infinity, its depth unknown (0). Otherwise the sky is painted on the plane
        z = sky_depth [m] of the reference camera of each frame, so that this depth is exact in the
        reprojection equation; it stays behind everything else however near it is.
    source_dtype : numpy.uint8 or numpy.uint16
        Thermal images with a display's 8 bits, or raw counts (24 per 8-bit level from 7000).

    Raises
    ------
    ValueError
        An argument out of range.
    """

    def __init__(
        self,
        rig: Rig,
        num_frames: int = 8,
        seed: int = 0,
        night: bool = False,
        noise: float = 1.0,
        speed: float = 6.0,
        depth_noise: float = 0.0,
        sky_depth: float = 0.0,
        source_dtype: DTypeLike = np.uint8,
    ) -> None:
        _require(num_frames >= 1, "num_frames", num_frames, "at least 1")
        _require(seed >= 0, "seed", seed, "an integer >= 0")
        _require(np.isfinite(noise) and noise >= 0, "noise", noise, "a factor >= 0")
        _require(0 <= speed <= 50, "speed", speed, "in [0, 50] m per frame")
        _require(0 <= depth_noise < 0.3, "depth_noise", depth_noise, "in [0, 0.3)")
        good_sky = sky_depth == 0 or (np.isfinite(sky_depth) and sky_depth >= 1)
        _require(good_sky, "sky_depth", sky_depth, "0 (unknown) or at least 1 m")
        dtypes = (np.dtype(np.uint8), np.dtype(np.uint16))
        _require(np.dtype(source_dtype) in dtypes, "source_dtype", source_dtype, "uint8 or uint16")
        self.rig = rig
        self.night, self.noise, self.speed = night, noise, speed
        self.depth_noise, self.sky_depth = depth_noise, sky_depth
        self.source_dtype = np.dtype(source_dtype)
        self._num_frames, self._seed = num_frames, seed
        self._scene = _street.build(seed, num_frames * speed, speed)
        self._wander = np.random.default_rng([seed, 0xD21]).uniform(0, 2 * np.pi, 6)
        self._pattern = self._fixed_pattern()
        longest = max(3 * rig.reference.width * rig.reference.height, self._pattern.size)
        stretch = np.random.default_rng([seed, 0xA01]).standard_normal(longest * 5 // 4, np.float32)
        self._noise_stretch = stretch

    def __len__(self) -> int:
        return self._num_frames

    def pose(self, index: int) -> tuple[Array, Array]:
        """(R, t), reference camera from world: x_reference = R x_world + t [m]."""
        _require(0 <= index < len(self), "index", index, f"in [0, {len(self)})")
        phase = self._wander
        way = index * self.speed
        centre = np.array([1.6 + 0.35 * np.sin(way / 17 + phase[0]), -1.45, way])
        centre[1] += 0.05 * np.sin(index * 1.7 + phase[1])
        yaw = 0.075 * np.sin(index * 0.9 + phase[2])
        pitch = -0.02 + 0.022 * np.sin(index * 1.3 + phase[3])
        roll = 0.012 * np.sin(index * 1.1 + phase[4])
        R = _rotation_z(roll) @ _turned_towards(np.array([np.sin(yaw), np.sin(pitch), 1.0])).T
        return R, -R @ centre

    def frame(self, index: int) -> Frame:
        """Renders frame `index` of the drive."""
        reference, depth = self.render_view(index, "visible", "reference")
        thermal = self._image(index, "thermal", "source")
        rng = np.random.default_rng([self._seed, index, 0xF2A])
        if self.depth_noise > 0:
            depth = depth * np.maximum(0.1, 1 + self.depth_noise * _smooth_field(rng, depth.shape))
        if self.noise > 0:
            sigma = np.float32(self.noise * _VISIBLE_NOISE[self.night])
            reference += sigma * self._noise_of(rng, reference.shape)
            noise = np.float32(_THERMAL_NOISE) * self._noise_of(rng, thermal.shape)
            thermal += np.float32(self.noise) * (noise + self._pattern)
        if self.source_dtype == np.uint16:
            thermal = thermal * np.float32(_COUNTS) + np.float32(_COUNT_OFFSET)
        image, source = _quantized(reference, np.uint8), _quantized(thermal, self.source_dtype)
        return Frame(image, source, depth.astype(np.float32), f"{index:06d}")

    def render_view(
        self, index: int, modality: str = "visible", camera: str = "reference"
    ) -> tuple[Array, Array]:
        """Either camera's noise-free view in either modality, and that camera's own depth.

        Parameters
        ----------
        index : int
        modality : "visible" or "thermal"
        camera : "reference" or "source"

        Returns
        -------
        image : (h, w, 3) or (h, w) float32, on the scale 0-255
        depth : (h, w) float32 [m], at pixel centres, in this camera; 0 on a sky of unknown depth
        """
        _require(modality in ("visible", "thermal"), "modality", modality, "visible or thermal")
        centres = _Raster(self._scene, self._view(index, camera), 1, index)
        centres.find_visible(np.float64)
        return self._image(index, modality, camera), centres.depth()

    def _image(self, index: int, modality: str, camera: str) -> Array:
        view = self._view(index, camera)
        samples = _Raster(self._scene, view, _SAMPLES, index)
        samples.find_visible(np.float32)
        if modality == "thermal":
            # 16 bits keep the average of the samples finer than a level.
            fine = samples.paint("thermal").astype(np.uint16) << 8
            return cv2.GaussianBlur(_averaged(fine, view) / np.float32(256), (0, 0), _BLUR)
        fine = self._lit(samples, index) if self.night else samples.paint("day")
        return _averaged(fine, view).astype(np.float32)

    def occluded(self, index: int) -> Array:
        """(H, W) bool: the point a reference pixel sees is hidden from the source camera.

        Found by ray casting: something else lies on the straight line from the source camera to the
        very point. False where the point lies outside the source image, or is sky of unknown depth.
        """
        reference = _Raster(self._scene, self._view(index, "reference"), 1, index)
        reference.find_visible(np.float64)
        source = _Raster(self._scene, self._view(index, "source"), 1, index)
        return source.hides(_targets(self.rig, reference.depth()), reference.ids[reference.faces])

    def _view(self, index: int, camera: str) -> _View:
        _require(camera in ("reference", "source"), "camera", camera, "reference or source")
        R, t = self.pose(index)
        if camera == "reference":
            pinhole = self.rig.reference
            sky, sky_z = R, np.array([0.0, 0.0, 1.0])
        else:
            pinhole = self.rig.source
            R_rig = np.asarray(self.rig.R, np.float64)
            t_rig = np.asarray(self.rig.t, np.float64).reshape(3)
            # A sky point is z_R = sky_depth along its ray q from the reference: R q + t q_z /
            # sky_depth.
            shift = np.outer(t_rig, (0, 0, 1.0 / self.sky_depth if self.sky_depth else 0.0))
            sky = (R_rig + shift) @ R
            sky_z = np.linalg.inv(R_rig + shift)[2]
            R, t = R_rig @ R, R_rig @ t + t_rig
        return _View(pinhole.width, pinhole.height, _K(pinhole), R, t, sky, sky_z, self.sky_depth)

    def _lit(self, samples: _Raster, index: int) -> Array:
        """The street at night: albedo times the light that falls on it, plus what glows itself."""
        layers = samples.paint("night")
        light = self._light(samples, index)
        light += layers[..., 3] * np.float32(1 / 255)
        tint = np.array([0.78, 0.92, 1.0], np.float32)  # sodium and tungsten
        lit = layers[..., :3] * light[..., None]
        lit *= tint
        image: Array = np.minimum(lit, 255).astype(np.uint8)
        return image

    def _light(self, samples: _Raster, index: int) -> Array:
        """Light at every sample's point: the lamps near by, the headlights, a little sky."""
        points = samples.points_in_world()
        R, t = self.pose(index)
        front = -R.T @ t
        light = np.full(points[0].shape, 0.055, np.float32)
        lamps = self._scene.lamps
        lamps = lamps[(lamps[:, 2] - front[2] > -12) & (lamps[:, 2] - front[2] < 70)]
        for side in (-1, 1):  # the lamps of one side share their x and height
            of_side = lamps[lamps[:, 0] * side > 0]
            if not len(of_side):
                continue
            below = np.square(np.maximum(points[1] - np.float32(of_side[0, 1]), 0))
            aside = np.square(points[0] - np.float32(of_side[0, 0])) + below
            below *= np.float32(24.0)
            for z in of_side[:, 2]:
                # Inverse square, and the cosine squared of the angle off straight down.
                square = points[2] - np.float32(z)
                np.multiply(square, square, out=square)
                square += aside
                np.multiply(square, square, out=square)
                square += np.float32(40.0)  # [m^4] what is next to a lamp is not burnt out
                np.divide(below, square, out=square)
                light += square
        x, y, ahead = (points[axis] - np.float32(front[axis]) for axis in range(3))
        ahead = np.maximum(ahead, np.float32(0.5))
        beam = np.exp(-np.square(x / ahead / 0.3) - np.square((y / ahead - 0.07) / 0.085))
        light += beam * np.float32(95) / (np.square(ahead) + 90)
        light[samples.is_sky] = 0
        return light

    def _noise_of(self, rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        """Unit noise of any shape: a piece of a long stretch drawn once, from a random place on."""
        count = int(np.prod(shape))
        start = int(rng.integers(0, len(self._noise_stretch) - count))
        return self._noise_stretch[start : start + count].reshape(shape)

    def _fixed_pattern(self) -> Array:
        """Microbolometers: columns and single pixels that are always a little off."""
        rng = np.random.default_rng([self._seed, 0xF9])
        shape = self.rig.source.height, self.rig.source.width
        columns, pixels = (
            rng.standard_normal(shape[1], np.float32),
            rng.standard_normal(shape, np.float32),
        )
        return np.float32(_PATTERN_NOISE) * (np.float32(0.7) * columns + np.float32(0.7) * pixels)


def render(
    rig: Rig,
    num_frames: int = 8,
    seed: int = 0,
    night: bool = False,
    noise: float = 1.0,
    speed: float = 6.0,
    depth_noise: float = 0.0,
    sky_depth: float = 0.0,
    source_dtype: DTypeLike = np.uint8,
) -> Iterator[Frame]:
    """The frames of a drive, one by one; the arguments are those of `Street`."""
    street = Street(
        rig, num_frames, seed, night, noise, speed, depth_noise, sky_depth, source_dtype
    )
    return (street.frame(index) for index in range(num_frames))


def _smooth_field(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """(H, W) float32 noise of unit variance, smooth over about a sixteenth of the width."""
    height, width = shape
    cell = max(4, width // 16)
    coarse = rng.standard_normal((height // cell + 3, width // cell + 3), np.float32)
    fine = cv2.resize(coarse, None, fx=cell, fy=cell, interpolation=cv2.INTER_CUBIC)
    fine = fine[cell : cell + height, cell : cell + width]
    field: Array = (fine - fine.mean()) / max(float(fine.std()), 1e-6)
    return field


def _quantized(image: Array, dtype: DTypeLike) -> Array:
    top = np.iinfo(np.dtype(dtype)).max
    return np.clip(np.rint(image), 0, top).astype(dtype)


# --- Views ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _View:
    """A camera in the street: x_camera = R x_world + t; for directions on the sky, sky @ x_world.

    The depth of a sky direction d is sky_depth * (d_z in this camera) / (sky_z . d).
    """

    width: int
    height: int
    K: Array
    R: Array
    t: Array
    sky: Array
    sky_z: Array
    sky_depth: float


def _averaged(fine: Array, view: _View) -> Array:
    """The mean over each pixel's samples, exactly: the sizes are multiples."""
    return cv2.resize(fine, (view.width, view.height), interpolation=cv2.INTER_AREA)


class _Raster:
    """Which face every sample of a view sees, and at what inverse depth.

    Sample i of `samples` per pixel lies at pixel coordinate (i + 1/2) / samples - 1/2.
    """

    def __init__(self, scene: _street.Scene, view: _View, samples: int, index: int) -> None:
        self.scene, self.view, self.time = scene, view, float(index)
        self.width, self.height = view.width * samples, view.height * samples
        half = (samples - 1) / 2
        self.K = np.array([[samples, 0, half], [0, samples, half], [0, 0, 1.0]]) @ view.K
        self._place_faces()

    def _place_faces(self) -> None:
        """A = (K G)^-1 of all faces, and the samples and depths that each can cover at most."""
        scene, view = self.scene, self.view
        origin = scene.origin.copy()
        origin[:, 2] += scene.velocity * self.time
        solid = np.arange(len(origin)) < len(origin) - scene.num_sky
        nearest = origin[:, 2] + np.minimum(0, scene.right[:, 2] + scene.down[:, 2])
        ahead = nearest - float((-view.R.T @ view.t)[2])
        # From here on a face is known by its place among those in reach; `ids` leads back.
        self.ids = ids = np.flatnonzero(
            ~solid | ((ahead < scene.reach) & (ahead > -2 * _street.BEHIND))
        )
        solid = solid[ids]
        self.num_solid = int(solid.sum())
        self.textures = [scene.textures[face] for face in ids]
        G = np.stack([scene.right[ids], scene.down[ids], origin[ids]], axis=-1)
        size = np.linalg.norm(np.cross(G[:, :, 0], G[:, :, 1]), axis=1)
        G = np.where(solid[:, None, None], view.R, view.sky) @ G
        G[solid, :, 2] += view.t
        determinant = np.linalg.det(G)
        # Seen exactly edge-on, or from behind where that is the inside of a body: nothing to draw.
        drawn = (np.abs(determinant) > 1e-7 * size) & ((determinant > 0) | ~scene.one_sided[ids])
        G[~drawn] = np.eye(3)
        self.A = np.linalg.inv(self.K @ G)
        self.bounds, self.depths = self._extents(G)
        drawn &= (self.bounds[:, 0] < self.bounds[:, 2]) & (self.bounds[:, 1] < self.bounds[:, 3])
        # Near ones first, so that most of what is hidden can be passed over; the sky last of all.
        order = np.argsort(np.where(solid, self.depths[:, 0], np.inf), kind="stable")
        self.drawn = order[drawn[order]].tolist()
        # (p, q, w) = A x~ = (u, v, 1) / z: inside means p, q, w - p and w - q >= 0, each a
        # half-plane, which starts or ends every row of samples at x = -(b y + c) / a.
        p, q, w = np.moveaxis(self.A, 1, 0)
        edges = np.stack([p, q, w - p, w - q], axis=1)
        slope = np.where(edges[:, :, 0] == 0, 1e-30, edges[:, :, 0])
        self.row_cuts = -edges[:, :, 1:] / slope[:, :, None]
        self.starts_row = slope > 0

    def _extents(self, G: Array) -> tuple[Array, Array]:
        """Bounds (N, 4) as x0 y0 x1 y1, ends excluded, and depths (N, 2), of the parts before
        _NEAR."""
        right, down, origin = G[:, :, 0], G[:, :, 1], G[:, :, 2]
        corners = np.stack([origin, origin + right, origin + right + down, origin + down], axis=1)
        following = np.roll(corners, -1, axis=1)
        z, z_next = corners[..., 2], following[..., 2]
        step = np.where(z_next == z, 1.0, z_next - z)
        share = np.clip((_NEAR - z) / step, 0, 1)[..., None]
        cuts = corners + share * (following - corners)
        crosses = (z < _NEAR) != (z_next < _NEAR)
        points = np.concatenate([corners, cuts], axis=1)
        valid = np.concatenate([z >= _NEAR, crosses], axis=1)
        depth = np.where(valid, np.maximum(points[..., 2], _NEAR), np.nan)
        pixels = points @ self.K.T
        xy = pixels[..., :2] / depth[..., None]
        low = np.where(valid[..., None], xy, np.inf).min(axis=1)
        high = np.where(valid[..., None], xy, -np.inf).max(axis=1)
        limit = np.array([self.width, self.height], np.float64)
        low = np.clip(np.ceil(np.where(np.isfinite(low), low, limit) - 1e-3), 0, limit)
        high = np.clip(np.floor(np.where(np.isfinite(high), high, -1) + 1e-3) + 1, 0, limit)
        depths = np.stack(
            [np.where(valid, depth, np.inf).min(axis=1), np.where(valid, depth, 0).max(axis=1)],
            axis=1,
        )
        return np.concatenate([low, high], axis=1).astype(np.int64), depths

    def find_visible(self, dtype: DTypeLike) -> None:
        """Fills `faces` (face per sample) and `inverse_depth` [1/m]; the sky takes what is left."""
        self.inverse_depth = np.zeros((self.height, self.width), dtype)
        self.faces = np.full((self.height, self.width), -1, np.int16)
        xs, ys = np.arange(self.width, dtype=np.float64), np.arange(self.height, dtype=np.float64)
        columns = xs.astype(np.float32)
        for face in self.drawn:
            x0, y0, x1, y1 = self.bounds[face].tolist()
            window = np.s_[y0:y1, x0:x1]
            if (
                face < self.num_solid
                and self.inverse_depth[window].min() * self.depths[face, 0] > 1.001
            ):
                continue  # all of the window is nearer already
            first, last = self._row_ends(face, ys[y0:y1])
            won = columns[x0:x1] >= first
            won &= columns[x0:x1] <= last
            if face < self.num_solid:
                a, b, c = self.A[face, 2]
                w = np.add.outer((b * ys[y0:y1] + c).astype(dtype), (a * xs[x0:x1]).astype(dtype))
                won &= w > self.inverse_depth[window]
            else:
                won &= self.faces[window] < 0
            if self.textures[face].alpha is not None:
                if not won.any():
                    continue
                won &= self._sampled(face, "alpha", x0, y0, x1, y1) > 127
            np.copyto(self.faces[window], np.int16(face), where=won)
            if face < self.num_solid:
                np.copyto(self.inverse_depth[window], w, where=won)

    def _row_ends(self, face: int, ys: Array) -> tuple[Array, Array]:
        """The first and last x on the face in every row, (h, 1) float32; first > last: none."""
        cuts = self.row_cuts[face]
        cut = cuts[:, :1] * ys + cuts[:, 1:]
        starts = self.starts_row[face]
        first = cut[starts].max(axis=0, initial=-1.0)
        last = cut[~starts].min(axis=0, initial=self.width)
        return first.astype(np.float32)[:, None], last.astype(np.float32)[:, None]

    def paint(self, kind: str) -> Array:
        """The image of all samples: "day" (h, w, 3), "night" (h, w, 4) or "thermal" (h, w),
        uint8."""
        channels = {"day": (3,), "night": (4,), "thermal": ()}[kind]
        image = np.zeros((self.height, self.width, *channels), np.uint8)
        counts = np.bincount((self.faces + 1).ravel(), minlength=len(self.textures) + 1)[
            1:
        ].tolist()
        for face in self.drawn:
            if counts[face] == 0:
                continue
            x0, y0, x1, y1 = self.bounds[face].tolist()
            mine = self.faces[y0:y1, x0:x1] == face
            for low, high in self._bands(face, x0, y0, x1, y1):
                part = mine
                if high < math.inf:
                    w = self.inverse_depth[y0:y1, x0:x1]
                    part = mine & (w >= low) & (w < high)
                mask = part.view(np.uint8)
                bx, by, bw, bh = cv2.boundingRect(mask)
                if bw == 0:
                    continue
                box = (x0 + bx, y0 + by, x0 + bx + bw, y0 + by + bh)
                colour = self._sampled(
                    face, kind, *box, weight=math.sqrt(low * high) if low else 0.0
                )
                inner = np.ascontiguousarray(mask[by : by + bh, bx : bx + bw])
                cv2.copyTo(colour, inner, image[box[1] : box[3], box[0] : box[2]])
        return image

    def _bands(self, face: int, x0: int, y0: int, x1: int, y1: int) -> list[tuple[float, float]]:
        """Ranges of 1/z that are filtered alike; one open range where depth hardly varies."""
        if face >= self.num_solid:
            return [(0.0, np.inf)]
        near, far = self.depths[face]
        corners = self.A[face, 2] @ np.array([[x0, x1, x0, x1], [y0, y0, y1, y1], [1, 1, 1, 1]])
        top = min(1 / near, float(corners.max()))
        bottom = max(1 / far, float(corners.min()))
        if top <= bottom * _BAND:
            return [(0.0, np.inf)]
        count = int(np.ceil(np.log(top / bottom) / np.log(_BAND)))
        limits = bottom * (top / bottom) ** (np.arange(count + 1) / count)
        limits[0] *= 0.999
        limits[-1] *= 1.001
        return list(pairwise(limits.tolist()))

    def _sampled(
        self, face: int, kind: str, x0: int, y0: int, x1: int, y1: int, weight: float = 0.0
    ) -> Array:
        """A window of the texture as this camera sees it; `weight`: the 1/z to filter for."""
        texture = self.textures[face]
        A = self.A[face]
        level_u = level_v = 0  # what is cut out is shape, the same at every distance
        if kind != "alpha":
            x, y = (x0 + x1 - 1) / 2, (y0 + y1 - 1) / 2
            level_u, level_v = self._levels(A, texture, x, y, weight)
        gain = float(self.scene.gain[self.ids[face]]) if kind == "day" else 1.0
        level = texture.level(kind, level_u, level_v, gain)
        height, width = level.shape[:2]
        # u in [0, 1] spans the texture edge to edge; the centre of texel i is u = (i + 1/2) /
        # width.
        texel = np.array([[width, 0, -0.5], [0, height, -0.5], [0, 0, 1.0]])
        shift = np.array([[1.0, 0, x0], [0, 1.0, y0], [0, 0, 1.0]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return cv2.warpPerspective(
            level,
            texel @ A @ shift,
            (x1 - x0, y1 - y0),
            flags=flags,
            borderMode=cv2.BORDER_REPLICATE,
        )

    @staticmethod
    def _levels(
        A: Array, texture: _street.Texture, x: float, y: float, weight: float
    ) -> tuple[int, int]:
        """How far to filter in u and v about (x, y): to about one texel per sample."""
        (pa, pb, pc), (qa, qb, qc), (wa, wb, wc) = A.tolist()
        w = weight if weight > 0 else max(wa * x + wb * y + wc, 1e-6)
        u = min(max((pa * x + pb * y + pc) / w, 0.0), 1.0)
        v = min(max((qa * x + qb * y + qc) / w, 0.0), 1.0)
        width, height = texture.size
        texels_u = math.hypot(pa - u * wa, pb - u * wb) / w * width
        texels_v = math.hypot(qa - v * wa, qb - v * wb) / w * height
        level_u = round(math.log2(max(texels_u, 1.0)))
        level_v = round(math.log2(max(texels_v, 1.0)))
        return min(level_u, int(math.log2(width))), min(level_v, int(math.log2(height)))

    @property
    def is_sky(self) -> Array:
        return self.faces >= self.num_solid

    def depth(self) -> Array:
        """(h, w) float32 [m]; the sky's is as `_View` says."""
        depth = np.zeros(self.faces.shape, np.float32)
        seen = self.inverse_depth > 0
        np.divide(1.0, self.inverse_depth, out=depth, where=seen, casting="same_kind")
        if self.view.sky_depth > 0:
            ys, xs = np.nonzero(self.is_sky)
            rays = np.linalg.inv(self.K) @ np.stack([xs, ys, np.ones(len(xs))])
            depth[ys, xs] = self.view.sky_depth / (self.view.sky_z @ rays)
        return depth

    def points_in_world(self) -> list[Array]:
        """World x, y and z [m] of what every sample sees, each (h, w) float32; the sky is far."""
        z = 1 / np.maximum(self.inverse_depth, np.float32(1e-4))
        back = self.view.R.T @ np.linalg.inv(self.K)
        centre = -self.view.R.T @ self.view.t
        xs, ys = np.arange(self.width), np.arange(self.height)
        points = []
        for axis in range(3):
            a, b, c = back[axis]
            ray = np.add.outer((b * ys + c).astype(np.float32), (a * xs).astype(np.float32))
            points.append(ray * z + np.float32(centre[axis]))
        return points

    def hides(self, targets: Array, owners: Array) -> Array:
        """Which of the points seen at `targets` lie behind a face other than their own.

        targets: (H, W, 3) as x [px], y [px], depth [m] in this camera, NaN where there is none;
        owners: (H, W), the id of the face each point is on; -1 is nobody's.
        """
        hidden = np.zeros(owners.shape, bool)
        with np.errstate(invalid="ignore"):
            known = np.flatnonzero(_inside_image(targets, self.width, self.height))
        x, y, depth = (targets[..., axis].ravel()[known] for axis in range(3))
        owner, found = owners.ravel()[known], np.zeros(len(known), bool)
        # The sky is behind everything, however near it is painted.
        depth = np.where(owner >= len(self.scene.textures) - self.scene.num_sky, np.inf, depth)
        for face in self.drawn:
            if face >= self.num_solid:
                break
            x0, y0, x1, y1 = self.bounds[face].tolist()
            near = (x > x0 - 1) & (x < x1) & (y > y0 - 1) & (y < y1)
            index = np.flatnonzero(near & ~found & (owner != self.ids[face]))
            p, q, w = self.A[face] @ np.stack([x[index], y[index], np.ones(len(index))])
            # Not a hair's breadth in front: the faces of a body share their edges.
            between = (p >= 0) & (q >= 0) & (p <= w) & (q <= w) & (w * depth[index] > 1 + 1e-4)
            index, p, q, w = index[between], p[between], q[between], w[between]
            found[index[self._opaque(face, p / w, q / w)]] = True
        hidden.ravel()[known] = found
        return hidden

    def _opaque(self, face: int, u: Array, v: Array) -> Array:
        alpha = self.textures[face].alpha
        if alpha is None or not len(u):
            return np.ones(len(u), bool)
        height, width = alpha.shape
        x, y = (u * width - 0.5).astype(np.float32), (v * height - 0.5).astype(np.float32)
        return (
            cv2.remap(alpha, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).ravel() > 127
        )


# --- Truth and files ------------------------------------------------------------------------------


def end_point_error(rig: Rig, truth: Rig, depth: Array) -> Array:
    """How far from its true place in the source image `rig` puts every reference pixel.

    Parameters
    ----------
    rig, truth : Rig
        Both with a reference camera of the depth's size.
    depth : (H, W)
        Depth in the reference camera [m]; 0, negative, NaN and inf mean unknown.

    Returns
    -------
    (H, W) float32
        [px of the source image]; NaN where the depth is unknown, where the true target lies outside
        the source image (beyond its outermost pixel centres), or where either puts the point behind
        the source camera.

    Raises
    ------
    ValueError
        A depth that is not 2-d or not of the size of both reference cameras.
    """
    depth = np.asarray(depth)
    for name, each in (("rig", rig), ("truth", truth)):
        size = (each.reference.height, each.reference.width)
        expected = f"the (height, width) of {name}.reference, {size}"
        _require(depth.shape == size, "depth.shape", depth.shape, expected)
    estimated, true = _targets(rig, depth), _targets(truth, depth)
    with np.errstate(invalid="ignore"):
        judged = _inside_image(true, truth.source.width, truth.source.height) & (
            estimated[..., 2] > 0
        )
        error = np.hypot(*np.moveaxis(estimated[..., :2] - true[..., :2], -1, 0))
    return np.where(judged, error, np.nan).astype(np.float32)


def _targets(rig: Rig, depth: Array) -> Array:
    """x, y [px] and depth [m] in the source camera of every reference pixel: (H, W, 3) float64.

    x_S = pi(D K_S R K_R^-1 x~ + K_S t); NaN where the depth is unknown or the point not before the
    camera.
    """
    height, width = depth.shape
    known = np.isfinite(depth) & (depth > 0)
    ys, xs = np.nonzero(known)
    R, t = np.asarray(rig.R, np.float64), np.asarray(rig.t, np.float64).reshape(3, 1)
    rays = np.linalg.inv(_K(rig.reference)) @ np.stack([xs, ys, np.ones(len(xs))])
    points = R @ (rays * depth[known].astype(np.float64)) + t
    pixels = _K(rig.source) @ points
    targets = np.full((height, width, 3), np.nan)
    z = np.where(points[2] > 0, points[2], np.nan)
    targets[known] = np.stack([pixels[0] / z, pixels[1] / z, z], axis=1)
    return targets


def _inside_image(targets: Array, width: int, height: int) -> Array:
    x, y, z = np.moveaxis(targets, -1, 0)
    inside: Array = (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1) & (z > 0)
    return inside


def write(folder: str | os.PathLike[str], frames: Iterable[Frame], rig: Rig | None = None) -> None:
    """Writes frames as folder/visible, folder/thermal and folder/depth /NAME.png, and
    folder/rig.yaml.

    Depth becomes 16-bit PNG in 1/256 m, 0 where unknown; what is beyond 255.996 m is written as
    that. Every file appears whole or not at all. Folders are created.

    Raises
    ------
    ValueError
        A frame whose images are not of the documented kind.
    OSError
        A file that cannot be written.
    """
    root = Path(folder)
    for kind in ("visible", "thermal", "depth"):
        (root / kind).mkdir(parents=True, exist_ok=True)
    for frame in frames:
        layers = {
            "visible": frame.reference,
            "thermal": frame.source,
            "depth": _encoded_depth(frame.depth),
        }
        for kind, image in layers.items():
            _require(image.dtype in (np.uint8, np.uint16), kind, image.dtype, "uint8 or uint16")
            write_bytes(root / kind / f"{frame.name}.png", _png(image))
    if rig is not None:
        rig.save(root / "rig.yaml")


def _encoded_depth(depth: Array) -> Array:
    known = np.isfinite(depth) & (depth > 0)
    steps = np.where(known, depth, 0).astype(np.float64) * 256
    # A known depth must not turn into the code for unknown.
    return np.where(known, np.clip(np.rint(steps), 1, 65535), 0).astype(np.uint16)


def _png(image: Array) -> bytes:
    done, data = cv2.imencode(".png", image)
    if not done:
        raise ValueError(f"cannot encode an image of shape {image.shape}, {image.dtype} as PNG")
    return data.tobytes()


def _require(condition: Any, name: str, value: Any, expected: str) -> None:
    if not condition:
        raise ValueError(f"{name} is {value}, expected {expected}")
