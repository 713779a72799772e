"""Kalibr's camchain: cam0 is the reference, cam1 the source, whose T_cn_cnm1 takes points of cam0
to cam1. Kalibr's reader wants focal lengths and principal points with a decimal point.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from .._core import InputError, Lens, Pinhole, Rig
from .fields import Fields, brown
from .format import NAMES, Format, Sizes
from .loss import padded
from .pose import rig_of, source_from_reference
from .text import yaml_of

COUNTS = {"radtan": 4, "equidistant": 4, "none": 0}


def recognise(path: Path, head: str) -> bool:
    """A chain of cameras."""
    return path.suffix.lower() in (".yaml", ".yml") and "cam0:" in head


def read(paths: Sequence[Path], sizes: Sizes) -> Rig:
    """The rig of a chain of two cameras."""
    path = paths[0]
    fields = Fields(str(path), yaml_of(path))
    if "cam2" in fields:
        raise InputError(f"{path}: has a cam2, expected cam0, the reference, and cam1, the source")
    cameras = [camera(fields.fields(name)) for name in ("cam0", "cam1")]
    return rig_of(cameras, fields.fields("cam1").matrix("T_cn_cnm1", 4, 4), str(path))


def camera(fields: Fields) -> Pinhole:
    """A camera of a chain."""
    if fields.text("camera_model") != "pinhole":
        fields.fail("camera_model", "pinhole: no other projection is known here")
    values = fields.numbers("intrinsics", (4,))
    model = fields.text("distortion_model")
    if model not in COUNTS:
        fields.fail("distortion_model", f"one of {', '.join(COUNTS)}")
    lens = Lens()
    if COUNTS[model]:
        coefficients = fields.numbers("distortion_coeffs", (COUNTS[model],))
        lens = brown(coefficients) if model == "radtan" else Lens("fisheye", coefficients)
    sides = fields.fields_of_list("resolution", ("width", "height"))
    return fields.camera(sides.size("width"), sides.size("height"), values, lens)


def write(rig: Rig) -> Mapping[str, str]:
    """A chain of two."""
    document = {}
    for index, camera in enumerate((rig.reference, rig.source)):
        if min(camera.cx, camera.cy) < 0:
            raise InputError(
                f"Kalibr cannot hold a principal point of ({camera.cx:g}, {camera.cy:g}) px,"
                " expected none below 0"
            )
        fisheye = camera.lens.model == "fisheye"
        document[f"cam{index}"] = {
            "camera_model": "pinhole",
            "intrinsics": [float(v) for v in (camera.fx, camera.fy, camera.cx, camera.cy)],
            "distortion_model": "equidistant" if fisheye else "radtan",
            "distortion_coeffs": padded(camera.lens, 4),
            "resolution": [camera.width, camera.height],
            "rostopic": f"/{NAMES[index]}/image_raw",
            "cam_overlaps": [1 - index],
        }
    document["cam1"]["T_cn_cnm1"] = source_from_reference(rig).tolist()
    return {"": yaml.safe_dump(document, sort_keys=False, default_flow_style=None)}


FORMAT = Format(
    "kalibr", "Kalibr's camchain", recognise, read, write, lenses={"brown": 4, "fisheye": 4}
)
