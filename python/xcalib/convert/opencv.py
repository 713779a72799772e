"""OpenCV's stereo calibration: YAML (or XML, JSON) of cv::FileStorage, as its sample stereo_calib
names the matrices: M1 D1 M2 D2 R T.

R and T take points of the first camera to the second. Pixel centres are at integers. The sample's
files have neither image sizes nor the model of the lens: image_width1, image_height1 and
lens_model1 (none, brown or fisheye; brown where it is not there) are ours, beside them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from .._core import InputError, Lens, Pinhole, Rig, read_file
from ..frames import quiet_opencv
from .fields import Fields, brown
from .format import Format, Sizes
from .loss import padded
from .pose import pose, rig_of, rodrigues

# The names that samples, tutorials and answers give the same matrices.
NAMES = {
    "M": ("M", "K", "cameraMatrix", "camera_matrix_", "CameraMatrix"),
    "D": ("D", "distCoeffs", "dist_coeffs_", "DistCoeffs"),
}


def recognise(path: Path, head: str) -> bool:
    """A file of cv::FileStorage with the matrices of two cameras."""
    storage = head.startswith("%YAML") or "<opencv_storage>" in head or "opencv-matrix" in head
    return storage and path.suffix.lower() in (".yml", ".yaml", ".xml", ".json")


def read(paths: Sequence[Path], sizes: Sizes) -> Rig:
    """The rig of one file, or of the two that the sample writes."""
    nodes: dict[str, Any] = {}
    for path in paths:
        nodes.update(stored(path))
    fields = Fields(", ".join(map(str, paths)), nodes)
    cameras = [camera(fields, index, sizes[index - 1]) for index in (1, 2)]
    R = fields.get("R")
    R = rodrigues(fields.numbers("R")) if np.size(R) == 3 else fields.matrix("R", 3, 3)
    return rig_of(cameras, pose(R, fields.numbers("T", (3,))), fields.where)


def stored(path: Path) -> dict[str, Any]:
    """The matrices, numbers and words at the top of a file."""
    text = read_file(path).decode("utf-8", "replace")
    try:
        with quiet_opencv():
            flags = cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY
            storage = cv2.FileStorage(text, flags)
            root = storage.root()
            return {key: value_of(root.getNode(key)) for key in root.keys()}  # noqa: SIM118
    except (cv2.error, SystemError):
        raise InputError(f"{path}: not a file of OpenCV's FileStorage") from None


def value_of(node: cv2.FileNode) -> Any:
    """A node of a storage; None for what no camera has."""
    if node.isMap():
        return node.mat()
    if node.isString():
        return node.string()
    if node.isInt() or node.isReal():
        return node.real()
    if node.isSeq():
        return [value_of(node.at(index)) for index in range(node.size())]
    return None


def camera(fields: Fields, index: int, size: tuple[int, int] | None) -> Pinhole:
    """The first or the second camera."""
    keys = {}
    for kind, names in NAMES.items():
        found = [f"{name}{index}" for name in names if f"{name}{index}" in fields]
        keys[kind] = found[0] if found else f"{kind}{index}"
    K = fields.matrix(keys["M"], 3, 3)
    values = fields.numbers(keys["D"], (4, 5, 8, 12, 14)) if keys["D"] in fields else []
    model_key = f"lens_model{index}"
    model = fields.text(model_key) if model_key in fields else "brown"
    if model not in ("none", "brown", "fisheye"):
        fields.fail(model_key, "none, brown or fisheye")
    if model == "fisheye":
        lens = fields.lens(keys["D"], "fisheye", values)
    elif any(values[8:]):
        fields.fail(keys["D"], "no thin prism and no tilted sensor, which no lens here has")
    else:
        lens = brown(values) if values else Lens()
    if size is None and f"image_width{index}" not in fields:
        option = "--reference-size" if index == 1 else "--source-size"
        raise InputError(
            f"{fields.where}: image_width{index} is missing, and OpenCV's own files have none;"
            f" {option} gives it"
        )
    width, height = size or (
        fields.size(f"image_width{index}"),
        fields.size(f"image_height{index}"),
    )
    return fields.camera(width, height, [K[0, 0], K[1, 1], K[0, 2], K[1, 2]], lens)


def write(rig: Rig) -> Mapping[str, str]:
    """One file with all."""
    storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    for index, camera in ((1, rig.reference), (2, rig.source)):
        lens = camera.lens
        storage.write(f"image_width{index}", camera.width)
        storage.write(f"image_height{index}", camera.height)
        storage.write(f"lens_model{index}", lens.model)
        storage.write(f"M{index}", np.asarray(camera.K, np.float64))
        count = len(lens.coefficients) if lens.model != "none" else 5
        storage.write(f"D{index}", np.array([padded(lens, count)], np.float64))
    storage.write("R", np.asarray(rig.R, np.float64))
    storage.write("T", np.asarray(rig.t, np.float64).reshape(3, 1))
    return {"": storage.releaseAndGetString()}


FORMAT = Format(
    "opencv",
    "OpenCV's stereo YAML",
    recognise,
    read,
    write,
    folder=("intrinsics.yml", "extrinsics.yml"),
    lenses={"brown": 8, "fisheye": 4},
)
