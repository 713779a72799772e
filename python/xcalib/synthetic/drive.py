"""A drive down a street: frames of both cameras, their depth and their occlusions."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import DTypeLike

from .._core import Rig
from ..reprojection import inside_image, targets
from .arguments import require
from .canvas import Canvas
from .raster import Raster, View
from .rigs import rotation_z, turned_towards
from .street import build
from .texture import Array

_SAMPLES = 2  # per pixel and direction
_BLUR = 0.7  # [px] sigma of the thermal optics
_VISIBLE_NOISE = {False: 1.6, True: 2.6}  # [of 255] by night
_THERMAL_NOISE, _PATTERN_NOISE = 1.3, 0.9  # [of 255] per frame; fixed
_COUNTS, _COUNT_OFFSET = 24.0, 7000.0  # raw thermal counts per 8-bit level, and at its zero


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
        require(num_frames >= 1, "num_frames", num_frames, "at least 1")
        require(seed >= 0, "seed", seed, "an integer >= 0")
        require(np.isfinite(noise) and noise >= 0, "noise", noise, "a factor >= 0")
        require(0 <= speed <= 50, "speed", speed, "in [0, 50] m per frame")
        require(0 <= depth_noise < 0.3, "depth_noise", depth_noise, "in [0, 0.3)")
        good_sky = sky_depth == 0 or (np.isfinite(sky_depth) and sky_depth >= 1)
        require(good_sky, "sky_depth", sky_depth, "0 (unknown) or at least 1 m")
        dtypes = (np.dtype(np.uint8), np.dtype(np.uint16))
        require(np.dtype(source_dtype) in dtypes, "source_dtype", source_dtype, "uint8 or uint16")
        self.rig = rig
        self.night, self.noise, self.speed = night, noise, speed
        self.depth_noise, self.sky_depth = depth_noise, sky_depth
        self.source_dtype = np.dtype(source_dtype)
        self._num_frames, self._seed = num_frames, seed
        self._scene = build(seed, num_frames * speed, speed)
        self._wander = np.random.default_rng([seed, 0xD21]).uniform(0, 2 * np.pi, 6)
        self._pattern = self._fixed_pattern()
        longest = max(3 * rig.reference.width * rig.reference.height, self._pattern.size)
        stretch = np.random.default_rng([seed, 0xA01]).standard_normal(longest * 5 // 4, np.float32)
        self._noise_stretch = stretch
        self._canvases: dict[tuple[str, int], Canvas] = {}

    def __len__(self) -> int:
        return self._num_frames

    def pose(self, index: int) -> tuple[Array, Array]:
        """(R, t), reference camera from world: x_reference = R x_world + t [m]."""
        require(0 <= index < len(self), "index", index, f"in [0, {len(self)})")
        phase = self._wander
        way = index * self.speed
        centre = np.array([1.6 + 0.35 * np.sin(way / 17 + phase[0]), -1.45, way])
        centre[1] += 0.05 * np.sin(index * 1.7 + phase[1])
        yaw = 0.075 * np.sin(index * 0.9 + phase[2])
        pitch = -0.02 + 0.022 * np.sin(index * 1.3 + phase[3])
        roll = 0.012 * np.sin(index * 1.1 + phase[4])
        R = rotation_z(roll) @ turned_towards(np.array([np.sin(yaw), np.sin(pitch), 1.0])).T
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
        require(modality in ("visible", "thermal"), "modality", modality, "visible or thermal")
        depth, _ = self._seen(index, camera)
        return self._image(index, modality, camera), depth

    def _seen(self, index: int, camera: str) -> tuple[Array, Array]:
        """Depth [m] and the id of the face, at the pixel centres of a camera."""
        view = self._view(index, camera)
        canvas = self._canvas(camera, 1)
        raster = Raster(self._scene, canvas.view(view) if canvas else view, 1, index)
        raster.find_visible(np.float64)
        if canvas:
            return canvas.seen(raster)
        return raster.depth(), raster.ids[raster.faces]

    def _canvas(self, camera: str, samples: int) -> Canvas | None:
        """What a camera is rendered on; None without a lens."""
        pinhole = self.rig.reference if camera == "reference" else self.rig.source
        if not pinhole.lens.bends:
            return None
        if (camera, samples) not in self._canvases:
            self._canvases[camera, samples] = Canvas(pinhole, samples)
        return self._canvases[camera, samples]

    def _image(self, index: int, modality: str, camera: str) -> Array:
        view = self._view(index, camera)
        canvas = self._canvas(camera, _SAMPLES)
        samples = (
            Raster(self._scene, canvas.view(view), 1, index)
            if canvas
            else Raster(self._scene, view, _SAMPLES, index)
        )
        samples.find_visible(np.float32)
        if modality == "thermal":
            # 16 bits keep the average of the samples finer than a level.
            fine = samples.paint("thermal").astype(np.uint16) << 8
        else:
            fine = self._lit(samples, index) if self.night else samples.paint("day")
        if canvas:
            fine = canvas.bent(fine)
        if modality == "thermal":
            return cv2.GaussianBlur(_averaged(fine, view) / np.float32(256), (0, 0), _BLUR)
        return _averaged(fine, view).astype(np.float32)

    def occluded(self, index: int) -> Array:
        """(H, W) bool: the point a reference pixel sees is hidden from the source camera.

        Found by ray casting: something else lies on the straight line from the source camera to the
        very point. False where the point lies outside the source image, or is sky of unknown depth.
        """
        depth, owners = self._seen(index, "reference")
        seen = targets(self.rig, depth)
        view = self._view(index, "source")
        if canvas := self._canvas("source", 1):
            inside = inside_image(seen, view.width, view.height)
            straight = Rig(self.rig.reference, canvas.camera, self.rig.R, self.rig.t)
            seen = np.where(inside[..., None], targets(straight, depth), np.nan)
            view = canvas.view(view)
        return Raster(self._scene, view, 1, index).hides(seen, owners)

    def _view(self, index: int, camera: str) -> View:
        require(camera in ("reference", "source"), "camera", camera, "reference or source")
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
        return View(
            pinhole.width,
            pinhole.height,
            np.asarray(pinhole.K, np.float64),
            R,
            t,
            sky,
            sky_z,
            self.sky_depth,
        )

    def _lit(self, samples: Raster, index: int) -> Array:
        """The street at night: albedo times the light that falls on it, plus what glows itself."""
        layers = samples.paint("night")
        light = self._light(samples, index)
        light += layers[..., 3] * np.float32(1 / 255)
        tint = np.array([0.78, 0.92, 1.0], np.float32)  # sodium and tungsten
        lit = layers[..., :3] * light[..., None]
        lit *= tint
        image: Array = np.minimum(lit, 255).astype(np.uint8)
        return image

    def _light(self, samples: Raster, index: int) -> Array:
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
                square += np.float32(40.0)  # [m^4] keeps what is next to a lamp from saturating
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


def _averaged(fine: Array, view: View) -> Array:
    """The mean over each pixel's samples, exactly: the sizes are multiples."""
    return cv2.resize(fine, (view.width, view.height), interpolation=cv2.INTER_AREA)
