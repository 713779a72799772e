"""Depth from lidar scans, projected into the reference camera."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..frames import Image, InputError, Size, list_files, pair, same_aspect, size_of
from ..yaml_file import load_yaml
from .points import POINT_SUFFIXES, Points, read_points
from .provider import Depth, DepthProvider

Array = NDArray[np.float64]

SHOWING_THROUGH = 0.1
"""A point this much farther than its surroundings, relatively, is behind them."""
SURROUNDINGS = 0.008
"""Reach of a point's surroundings, as a share of the image width: two scan lines or so."""


@dataclass(frozen=True)
class LidarCalibration:
    """Pose of the reference camera relative to the lidar, and its intrinsics."""

    K: Array
    """Intrinsics of the reference camera ``(3, 3)`` [px], of images of ``image_size``."""
    camera_from_lidar: Array
    """``(3, 4)``: takes lidar points to the axes of the reference camera [m]."""
    image_size: Size | None = None
    """Width and height the intrinsics belong to [px]; None: those of the reference images."""

    def at(self, size: Size) -> Array:
        """The intrinsics ``(3, 3)`` for reference images of ``size``."""
        if self.image_size is None or self.image_size == size:
            return self.K
        if not same_aspect(self.image_size, size):
            raise InputError(
                f"lidar calibration is for images of {self.image_size[0]}x{self.image_size[1]},"
                f" the reference image is {size[0]}x{size[1]}; expected the same aspect"
            )
        x, y = (new / old for new, old in zip(size, self.image_size, strict=True))
        return np.array([[x, 0, (x - 1) / 2], [0, y, (y - 1) / 2], [0, 0, 1]]) @ self.K


def project(points: Points, calibration: LidarCalibration, size: Size) -> Depth:
    """Depth map ``(h, w)`` float32 [m] of a scan ``(N, 3)`` [m]; the nearest point wins, 0 unknown.

    No occlusion is judged beyond that: see `without_hidden`.
    """
    width, height = size
    in_camera = (
        points @ calibration.camera_from_lidar[:, :3].T + calibration.camera_from_lidar[:, 3]
    )
    in_camera = in_camera[in_camera[:, 2] > 0]
    homogeneous = in_camera @ calibration.at(size).T
    u, v = np.rint(homogeneous[:, :2] / homogeneous[:, 2:]).T
    inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
    pixels = v[inside].astype(np.intp) * width + u[inside].astype(np.intp)
    depth = np.full(width * height, np.inf, np.float32)
    np.minimum.at(depth, pixels, in_camera[inside, 2].astype(np.float32))
    depth[np.isinf(depth)] = 0
    return depth.reshape(height, width)


def without_hidden(depth: Depth) -> Depth:
    """The map without far points that show through the gaps between those of a near surface.

    The lidar stands elsewhere than the camera and sees behind near things. A point is removed if
    in each of the four quadrants around it, within `SURROUNDINGS` of the width, some point is
    nearer by more than `SHOWING_THROUGH`. A background point beside an edge has free quadrants
    and stays; so does the road, which is nearer below but not above.
    """
    reach = max(2, round(SURROUNDINGS * depth.shape[1]))
    known = depth > 0
    z = np.where(known, depth, np.float32(np.inf))
    kernel = np.ones((reach + 1, reach + 1), np.uint8)
    surroundings = np.zeros_like(z)
    for anchor in ((0, 0), (reach, 0), (0, reach), (reach, reach)):
        nearest = cv2.erode(
            z, kernel, anchor=anchor, borderType=cv2.BORDER_CONSTANT, borderValue=np.inf
        )
        surroundings = np.maximum(surroundings, nearest)
    hidden = known & (z > (1 + SHOWING_THROUGH) * surroundings)
    return np.where(hidden, np.float32(0), depth)


class LidarDepth(DepthProvider):
    """Depth of a folder of scans, one per reference image, paired with them by `frames.pair`.

    ``calibration`` is one file for all, or a folder with one of KITTI's files per scan.
    """

    is_parallel = True
    looks_at_reference = False

    def __init__(
        self, folder: str | Path, reference_paths: Sequence[Path], calibration: str | Path
    ) -> None:
        self.paths = [scan for _, scan in pair(reference_paths, list_files(folder, POINT_SUFFIXES))]
        calibration = Path(calibration)
        if calibration.is_dir():
            files = [file for _, file in pair(reference_paths, list_files(calibration, (".txt",)))]
            self.calibrations = [read_lidar_calibration(file) for file in files]
        else:
            self.calibrations = [read_lidar_calibration(calibration)] * len(self.paths)

    def __call__(self, index: int, reference: Image) -> Depth:
        path = self.paths[index]
        depth = project(read_points(path), self.calibrations[index], size_of(reference))
        if not depth.any():
            raise InputError(
                f"{path}: no point falls into the reference image, expected some in view;"
                " is the lidar calibration right?"
            )
        return without_hidden(depth)

    def files_of(self, index: int) -> list[Path]:
        return [self.paths[index]]


# -- Calibration files ---------------------------------------------------------------------------


def read_lidar_calibration(path: str | Path) -> LidarCalibration:
    """Read a lidar calibration: ``.txt`` as KITTI has it, or YAML.

    YAML: ``intrinsics: [fx, fy, cx, cy]`` [px]; ``camera_from_lidar``, three rows of four numbers
    or ``quaternion_wxyz`` and ``translation_m``; optionally ``image_size: [width, height]``.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file, expected a lidar calibration (.yaml, .txt)")
    return _kitti(path) if path.suffix.lower() == ".txt" else _yaml(path)


def _kitti(path: Path) -> LidarCalibration:
    text = path.read_text(encoding="utf-8", errors="replace")
    lines = dict(line.split(":", 1) for line in text.splitlines() if ":" in line)
    projection = _numbers(path, "P2", lines.get("P2", "").split(), (3, 4))
    rectify = _numbers(path, "R0_rect", lines.get("R0_rect", "").split(), (3, 3))
    velo = _numbers(path, "Tr_velo_to_cam", lines.get("Tr_velo_to_cam", "").split(), (3, 4))
    K = _intrinsics(path, projection[:, :3])
    camera = rectify @ velo
    camera[:, 3] += np.linalg.solve(K, projection[:, 3])  # from camera 0 to camera 2
    return LidarCalibration(K, _pose(path, camera))


def _yaml(path: Path) -> LidarCalibration:
    document = load_yaml(path, ("intrinsics", "camera_from_lidar"), ("image_size",))
    fx, fy, cx, cy = _numbers(path, "intrinsics", document["intrinsics"], (4,))
    K = _intrinsics(path, np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]]))
    pose = document["camera_from_lidar"]
    if isinstance(pose, dict):
        if pose.keys() != {"quaternion_wxyz", "translation_m"}:
            raise InputError(
                f"{path}: camera_from_lidar has {', '.join(map(str, pose))};"
                " expected quaternion_wxyz and translation_m"
            )
        R = _rotation(path, _numbers(path, "quaternion_wxyz", pose["quaternion_wxyz"], (4,)))
        pose = np.column_stack([R, _numbers(path, "translation_m", pose["translation_m"], (3,))])
    size = None
    if "image_size" in document:
        width, height = _numbers(path, "image_size", document["image_size"], (2,))
        size = int(width), int(height)
        if min(size) < 1:
            raise InputError(f"{path}: image_size is {width:g} x {height:g}, expected above 0 px")
    return LidarCalibration(K, _pose(path, _numbers(path, "camera_from_lidar", pose, (3, 4))), size)


def _numbers(path: Path, name: str, values: Any, shape: tuple[int, ...]) -> Array:
    try:
        numbers = np.array(values, np.float64)
        if numbers.ndim == 1:
            numbers = numbers.reshape(shape)
        if numbers.shape == shape and np.isfinite(numbers).all():
            return numbers
    except (ValueError, TypeError):
        pass
    raise InputError(f"{path}: {name} is {values}, expected {'x'.join(map(str, shape))} numbers")


def _intrinsics(path: Path, K: Array) -> Array:
    if not (K[0, 0] > 0 and K[1, 1] > 0):
        raise InputError(f"{path}: focal lengths {K[0, 0]:g}, {K[1, 1]:g} px, expected above 0")
    return K


def _pose(path: Path, pose: Array) -> Array:
    R = pose[:, :3]
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-3 or np.linalg.det(R) < 0:
        raise InputError(f"{path}: the lidar's pose has no rotation in its first three columns")
    return pose


def _rotation(path: Path, q: Array) -> Array:
    if abs(np.linalg.norm(q) - 1) > 1e-3:
        raise InputError(f"{path}: quaternion_wxyz is {q}, expected unit length")
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
