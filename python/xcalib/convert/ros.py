"""ROS: a camera_info YAML a camera, as camera_calibration_parsers reads it, and the pose between
them as `ros2 topic echo /tf_static` prints it.

A transform's header names the parent; it is the pose of the child in it, and takes points of the
child to the parent. The frames are the cameras' optical frames: x right, y down, z forward.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from .._core import InputError, Lens, Pinhole, Rig
from .fields import Fields, Matrix, brown
from .format import NAMES, Format, Sizes
from .loss import padded
from .pose import inverse, pose, reference_from_source, rig_of, rotation, wxyz_of
from .text import yaml_of

MODELS = {
    "plumb_bob": ("brown", (4, 5)),
    "rational_polynomial": ("brown", (8,)),
    "equidistant": ("fisheye", (4,)),
    "fisheye": ("fisheye", (4,)),  # as the tool of Melodic wrote it
}


def recognise(path: Path, head: str) -> bool:
    """A camera_info."""
    return path.suffix.lower() in (".yaml", ".yml") and "camera_matrix:" in head


def read(paths: Sequence[Path], sizes: Sizes) -> Rig:
    """Of the reference's camera_info, the source's, and the transform."""
    if len(paths) != 3:
        raise InputError(
            f"{paths[0]}: {len(paths)} files, expected the reference's camera_info, the source's,"
            " and a transform as `ros2 topic echo /tf_static` prints it, or a folder of"
            f" {', '.join(FORMAT.folder)}"
        )
    cameras = [read_camera(path) for path in paths[:2]]
    names = [Fields(str(path), yaml_of(path)).node.get("camera_name", "") for path in paths[:2]]
    return rig_of(cameras, transform(paths[2], [str(name) for name in names]), str(paths[2]))


def read_camera(path: Path) -> Pinhole:
    """The camera of a camera_info."""
    fields = Fields(str(path), yaml_of(path))
    width, height = fields.size("image_width"), fields.size("image_height")
    K = fields.fields("camera_matrix").matrix("data", 3, 3)
    if K[0, 0] == 0:
        fields.fail("camera_matrix", "a calibrated camera, K[0] is 0")
    model = fields.text("distortion_model") if "distortion_model" in fields else "plumb_bob"
    if model not in MODELS:
        fields.fail("distortion_model", f"one of {', '.join(MODELS)}")
    kind, counts = MODELS[model]
    lens = Lens()
    if "distortion_coefficients" in fields:
        coefficients = fields.fields("distortion_coefficients")
        values = coefficients.numbers("data", (0, *counts))
        if values:
            lens = brown(values) if kind == "brown" else Lens(kind, values)
    return fields.camera(width, height, [K[0, 0], K[1, 1], K[0, 2], K[1, 2]], lens)


def transform(path: Path, names: list[str]) -> Matrix:
    """source_from_reference, of a transform between the frames of the two cameras."""
    node = yaml_of(path)
    if isinstance(node, dict) and isinstance(node.get("transforms"), list):
        found = node["transforms"]
        if len(found) != 1:
            raise InputError(
                f"{path}: transforms has {len(found)}, expected only that between the cameras"
            )
        node = found[0]
    fields = Fields(str(path), node)
    parent, child = fields.fields("header").text("frame_id"), fields.text("child_frame_id")
    inner = fields.fields("transform")
    place, turn = inner.fields("translation"), inner.fields("rotation")
    R = rotation([turn.number(axis) for axis in "wxyz"], str(path))
    parent_from_child = pose(R, [place.number(axis) for axis in "xyz"])
    # The reference is the parent, unless the names say the opposite.
    swapped = all(names) and names[0] != names[1]
    swapped = swapped and parent.startswith(names[1]) and child.startswith(names[0])
    return parent_from_child if swapped else inverse(parent_from_child, str(path))


def write(rig: Rig) -> Mapping[str, str]:
    """A camera_info each, and the transform."""
    files = {f"{name}.yaml": info(rig, name) for name in NAMES}
    T = reference_from_source(rig)
    w, x, y, z = wxyz_of(T)
    document = {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": f"{NAMES[0]}_optical"},
        "child_frame_id": f"{NAMES[1]}_optical",
        "transform": {
            "translation": dict(zip("xyz", map(float, T[:3, 3]), strict=True)),
            "rotation": {"x": x, "y": y, "z": z, "w": w},
        },
    }
    files["tf_static.yaml"] = yaml.safe_dump({"transforms": [document]}, sort_keys=False)
    return files


def info(rig: Rig, name: str) -> str:
    """A camera_info. R is no rectification and P is K: the pair is not rectified."""
    camera = rig.reference if name == NAMES[0] else rig.source
    model, D = distortion(camera.lens)
    K = np.asarray(camera.K, np.float64)
    document = {
        "image_width": camera.width,
        "image_height": camera.height,
        "camera_name": name,
        "camera_matrix": table(K),
        "distortion_model": model,
        "distortion_coefficients": table(np.array([D])),
        "rectification_matrix": table(np.eye(3)),
        "projection_matrix": table(np.column_stack([K, np.zeros(3)])),
    }
    return yaml.safe_dump(document, sort_keys=False, default_flow_style=None)


def distortion(lens: Lens) -> tuple[str, list[float]]:
    """ROS' name of the model, and as many coefficients as it has there."""
    if lens.model == "fisheye":
        return "equidistant", list(lens.coefficients)
    if len(lens.coefficients) > 5:
        return "rational_polynomial", list(lens.coefficients)
    return "plumb_bob", padded(lens, 5)


def table(values: Matrix) -> dict[str, Any]:
    """A matrix as camera_calibration_parsers writes one."""
    rows, columns = values.shape
    return {"rows": rows, "cols": columns, "data": [float(value) for value in values.ravel()]}


FORMAT = Format(
    "ros",
    "ROS' camera_info",
    recognise,
    read,
    write,
    read_camera,
    folder=(*(f"{name}.yaml" for name in NAMES), "tf_static.yaml"),
    lenses={"brown": 8, "fisheye": 4},
)
