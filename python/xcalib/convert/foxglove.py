"""Foxglove's messages as JSON: a CameraCalibration a camera, and the FrameTransform between them.

There is no file of them but a recording (MCAP); here each stands in a list with its topic and the
name of its schema.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .._core import InputError, Lens, Pinhole, Rig
from .fields import Fields, brown
from .format import NAMES, Format, Sizes
from .pose import inverse, pose, reference_from_source, rig_of, rotation, wxyz_of
from .ros import distortion
from .text import json_of

MODELS = {
    "plumb_bob": ("brown", (4, 5)),
    "rational_polynomial": ("brown", (8,)),
    "kannala_brandt": ("fisheye", (4,)),
    "": ("brown", (0, 4, 5)),
}
CALIBRATION, TRANSFORM = "foxglove.CameraCalibration", "foxglove.FrameTransform"


def recognise(path: Path, head: str) -> bool:
    """A list of messages."""
    return path.suffix.lower() == ".json" and CALIBRATION in head


def read(paths: Sequence[Path], sizes: Sizes) -> Rig:
    """The rig of two calibrations and the transform between their frames, either way."""
    path = paths[0]
    document = json_of(path)
    messages = document if isinstance(document, list) else []
    records = [Fields(str(path), node, f"[{i}]") for i, node in enumerate(messages)]
    kinds = [record.text("schema") for record in records]
    if (kinds.count(CALIBRATION), kinds.count(TRANSFORM)) != (2, 1):
        raise InputError(
            f"{path}: expected a list of two {CALIBRATION}, the reference's first, and one"
            f" {TRANSFORM}, each {{topic, schema, message}}"
        )
    found = {
        kind: [r.fields("message") for r in records if r.text("schema") == kind] for kind in kinds
    }
    cameras = [camera(fields) for fields in found[CALIBRATION]]
    frames = [fields.text("frame_id") for fields in found[CALIBRATION]]
    fields = found[TRANSFORM][0]
    place, turn = fields.fields("translation"), fields.fields("rotation")
    T = pose(
        rotation([turn.number(axis) for axis in "wxyz"], str(path)),
        [place.number(axis) for axis in "xyz"],
    )
    ends = [fields.text("parent_frame_id"), fields.text("child_frame_id")]
    if sorted(ends) != sorted(frames):
        raise InputError(
            f"{path}: the transform is from {ends[1]} to {ends[0]}, expected between"
            f" {frames[0]} and {frames[1]}"
        )
    return rig_of(cameras, T if ends[0] == frames[1] else inverse(T, str(path)), str(path))


def camera(fields: Fields) -> Pinhole:
    """The camera of a calibration."""
    model = fields.text("distortion_model") if "distortion_model" in fields else ""
    if model not in MODELS:
        fields.fail("distortion_model", f"one of {', '.join(filter(None, MODELS))}")
    kind, counts = MODELS[model]
    values = fields.numbers("D", (0, *counts)) if "D" in fields else []
    lens = Lens()
    if values:
        lens = brown(values) if kind == "brown" else Lens(kind, values)
    K = fields.matrix("K", 3, 3)
    return fields.camera(
        fields.size("width"), fields.size("height"), [K[0, 0], K[1, 1], K[0, 2], K[1, 2]], lens
    )


def write(rig: Rig) -> Mapping[str, str]:
    """A list of the three messages."""
    return {"": json.dumps(messages(rig), indent=2) + "\n"}


def messages(rig: Rig) -> list[dict[str, Any]]:
    """The three messages, each with its topic and the name of its schema."""
    stamp = {"sec": 0, "nsec": 0}
    found: list[dict[str, Any]] = []
    for name, camera in zip(NAMES, (rig.reference, rig.source), strict=True):
        K = np.asarray(camera.K, np.float64)
        model, D = distortion(camera.lens)
        message = {
            "timestamp": stamp,
            "frame_id": f"{name}_optical",
            "width": camera.width,
            "height": camera.height,
            "distortion_model": "kannala_brandt" if model == "equidistant" else model,
            "D": D,
            "K": K.ravel().tolist(),
            "R": np.eye(3).ravel().tolist(),
            "P": np.column_stack([K, np.zeros(3)]).ravel().tolist(),
        }
        found.append({"topic": f"/{name}/calibration", "schema": CALIBRATION, "message": message})
    T = reference_from_source(rig)
    w, x, y, z = wxyz_of(T)
    transform = {
        "timestamp": stamp,
        "parent_frame_id": f"{NAMES[0]}_optical",
        "child_frame_id": f"{NAMES[1]}_optical",
        "translation": dict(zip("xyz", map(float, T[:3, 3]), strict=True)),
        "rotation": {"x": x, "y": y, "z": z, "w": w},
    }
    found.append({"topic": "/tf_static", "schema": TRANSFORM, "message": transform})
    return found


FORMAT = Format(
    "foxglove",
    "Foxglove's CameraCalibration",
    recognise,
    read,
    write,
    lenses={"brown": 8, "fisheye": 4},
)
