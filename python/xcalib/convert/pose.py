"""Poses as other formats write them."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from .._core import InputError, Pinhole, Rig
from .fields import Matrix

LOOSE = 1e-3
"""How far a rotation of a file may be from one: files are rounded to few digits."""


def pose(R: Matrix, t: Sequence[float] | Matrix) -> Matrix:
    """A transform as a 4x4 matrix."""
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = np.ravel(t)
    return T


def rotation(wxyz: Sequence[float], where: str) -> Matrix:
    """The rotation matrix of a quaternion of unit length, within `LOOSE`."""
    q = np.array(wxyz, np.float64)
    if not abs(np.linalg.norm(q) - 1) <= LOOSE:
        raise InputError(
            f"{where}: the quaternion w x y z {' '.join(f'{v:g}' for v in q)} has length"
            f" {np.linalg.norm(q):g}, expected 1"
        )
    w, x, y, z = q / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rodrigues(vector: Sequence[float]) -> Matrix:
    """The rotation matrix of a rotation vector [rad]."""
    return np.asarray(cv2.Rodrigues(np.array(vector, np.float64))[0], np.float64)


def rotation_vector(R: Matrix) -> list[float]:
    """The rotation vector [rad] of a rotation matrix."""
    return [float(value) for value in cv2.Rodrigues(np.asarray(R, np.float64))[0].ravel()]


def inverse(T: Matrix, where: str) -> Matrix:
    """The transform back."""
    if not abs(np.linalg.det(T)) > 0.5:
        raise InputError(
            f"{where}: the pose has determinant {np.linalg.det(T):.3g}, expected a rotation"
        )
    return np.asarray(np.linalg.inv(T), np.float64)


def rig_of(cameras: Sequence[Pinhole], source_from_reference: Matrix, where: str) -> Rig:
    """The rig of a reference and a source, and of the rotation that is nearest to the transform's,
    which must be one within `LOOSE`.
    """
    reference, source = cameras
    R = source_from_reference[:3, :3]
    u, _, vt = np.linalg.svd(R)
    nearest = u @ vt
    if np.linalg.det(nearest) < 0 or not np.abs(nearest - R).max() <= LOOSE:
        raise InputError(
            f"{where}: the pose's rotation has determinant {np.linalg.det(R):.3g} and rows of"
            f" length {', '.join(f'{v:.3g}' for v in np.linalg.norm(R, axis=1))}, expected a"
            " rotation"
        )
    return Rig(reference, source, nearest, source_from_reference[:3, 3])


def source_from_reference(rig: Rig) -> Matrix:
    """The rig's pose as a 4x4 matrix."""
    return pose(np.asarray(rig.R), np.asarray(rig.t))


def reference_from_source(rig: Rig) -> Matrix:
    """The source camera's pose in the axes of the reference, as a 4x4 matrix."""
    R = np.asarray(rig.R, np.float64)
    return pose(R.T, -R.T @ np.asarray(rig.t, np.float64))


def wxyz_of(T: Matrix) -> list[float]:
    """The unit quaternion of a transform's rotation, w >= 0."""
    camera = Pinhole(2, 2, 1, 1, 0, 0)
    q = np.asarray(Rig(camera, camera, T[:3, :3]).quaternion_wxyz, np.float64)
    return [float(value) for value in (q if q[0] >= 0 else -q)]
