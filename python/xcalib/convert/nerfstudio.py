"""nerfstudio's transforms.json, of two frames: the reference's and the source's.

The first pixel's centre is at (0.5, 0.5). transform_matrix takes points of the camera, in OpenGL's
axes (x right, y up, z back), to the world, which is the reference here.
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
from .loss import padded
from .pose import inverse, reference_from_source, rig_of
from .text import json_of

HALF = 0.5
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""Between OpenGL's axes and ours."""
BROWN = ("k1", "k2", "p1", "p2", "k3")
FISHEYE = ("k1", "k2", "k3", "k4")


def recognise(path: Path, head: str) -> bool:
    """A transforms.json."""
    return path.suffix.lower() == ".json" and '"fl_x"' in head


def read(paths: Sequence[Path], sizes: Sizes) -> Rig:
    """The rig of a file of two frames."""
    path = paths[0]
    fields = Fields(str(path), json_of(path))
    frames = fields.get("frames")
    if not isinstance(frames, list) or len(frames) != 2:
        count = len(frames) if isinstance(frames, list) else 0
        raise InputError(
            f"{path}: has {count} frames, expected two, the reference's and the source's"
        )
    # What is the same for all frames stands above them.
    both = [
        Fields(str(path), {**fields.node, **Fields(str(path), node, f"frames[{i}]").node}, f"[{i}]")
        for i, node in enumerate(frames)
    ]
    cameras = [camera(frame) for frame in both]
    poses = [frame.matrix("transform_matrix", 4, 4) @ FLIP for frame in both]
    return rig_of(cameras, inverse(poses[1], str(path)) @ poses[0], str(path))


def camera(fields: Fields) -> Pinhole:
    """The camera of a frame."""
    model = fields.text("camera_model") if "camera_model" in fields else "OPENCV"
    if model not in ("OPENCV", "OPENCV_FISHEYE", "PINHOLE", "SIMPLE_PINHOLE"):
        fields.fail("camera_model", "OPENCV, OPENCV_FISHEYE or PINHOLE")

    def given(names: Sequence[str]) -> list[float]:
        return [fields.number(name) if name in fields else 0.0 for name in names]

    lens = Lens()
    if model == "OPENCV_FISHEYE":
        lens = Lens("fisheye", given(FISHEYE))
    elif model == "OPENCV":
        if any(given(["k4"])):
            fields.fail(
                "k4", "0: it is a fourth power of the radius' square, which no lens here has"
            )
        lens = brown(given(BROWN))
    values = [fields.number(name) for name in ("fl_x", "fl_y", "cx", "cy")]
    values[2:] = [values[2] - HALF, values[3] - HALF]
    return fields.camera(fields.size("w"), fields.size("h"), values, lens)


def write(rig: Rig) -> Mapping[str, str]:
    """A file of two frames."""
    fisheye = [camera.lens.model == "fisheye" for camera in (rig.reference, rig.source)]
    if len(set(fisheye)) > 1:
        raise InputError(
            "nerfstudio has one camera_model for all frames, and only one of the rig's cameras is"
            " a fisheye; expected both or none"
        )
    frames: list[dict[str, Any]] = []
    poses = (np.eye(4), reference_from_source(rig))
    for name, camera, T in zip(NAMES, (rig.reference, rig.source), poses, strict=True):
        names = FISHEYE if fisheye[0] else BROWN
        frames.append(
            {
                "file_path": f"{name}/",
                "w": camera.width,
                "h": camera.height,
                "fl_x": camera.fx,
                "fl_y": camera.fy,
                "cx": camera.cx + HALF,
                "cy": camera.cy + HALF,
                **dict(zip(names, padded(camera.lens, len(names)), strict=True)),
                "transform_matrix": (T @ FLIP).tolist(),
            }
        )
    document = {"camera_model": "OPENCV_FISHEYE" if fisheye[0] else "OPENCV", "frames": frames}
    return {"": json.dumps(document, indent=2) + "\n"}


FORMAT = Format(
    "nerfstudio",
    "nerfstudio's transforms.json",
    recognise,
    read,
    write,
    folder=("transforms.json",),
    lenses={"brown": 5, "fisheye": 4},
)
