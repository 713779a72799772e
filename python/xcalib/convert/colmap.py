"""COLMAP: cameras.txt and rigs.txt of a reconstruction, and rig_config.json, which its
rig_configurator takes.

The first pixel's centre is at (0.5, 0.5). Poses are sensor_from_rig, the reference's is the rig's.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .._core import InputError, Lens, Pinhole, Rig, read_text
from .fields import Fields, Matrix, brown, number
from .format import NAMES, Format, Sizes
from .loss import padded
from .pose import pose, rig_of, rotation, source_from_reference, wxyz_of
from .text import json_of

# Of a model: where in fx fy cx cy its parameters go, and to which of the lens' coefficients.
PARAMETERS = {
    "SIMPLE_PINHOLE": ("f cx cy", ""),
    "PINHOLE": ("fx fy cx cy", ""),
    "SIMPLE_RADIAL": ("f cx cy", "k1"),
    "RADIAL": ("f cx cy", "k1 k2"),
    "OPENCV": ("fx fy cx cy", "k1 k2 p1 p2"),
    "FULL_OPENCV": ("fx fy cx cy", "k1 k2 p1 p2 k3 k4 k5 k6"),
    "OPENCV_FISHEYE": ("fx fy cx cy", "k1 k2 k3 k4"),
}
HALF = 0.5


def recognise(path: Path, head: str) -> bool:
    """A table of cameras, or the configuration of rigs."""
    return path.name in ("cameras.txt", "rigs.txt") or "ref_sensor" in head


def read(paths: Sequence[Path], sizes: Sizes) -> Rig:
    """The rig of cameras.txt and rigs.txt, or of a rig_config.json."""
    if paths[0].suffix.lower() == ".json":
        return of_config(paths[0], sizes)
    if len(paths) < 2:
        raise InputError(f"{paths[0]}: expected cameras.txt and rigs.txt, or the folder with both")
    cameras = {}
    for row, words in rows(paths[0]):
        fields = Fields(f"{paths[0]}:{row}", dict(enumerate(words)), "camera")
        cameras[str(words[0])] = camera_of(
            fields, str(words[1]), fields.size(2), fields.size(3), list(words[4:])
        )
    rigs = rows(paths[1])
    if len(rigs) != 1:
        raise InputError(f"{paths[1]}: has {len(rigs)} rigs, expected 1")
    row, words = rigs[0]
    where = f"{paths[1]}:{row}"
    if len(words) < 8 or words[1] != 2 or words[2] != "CAMERA" or words[4] != "CAMERA":
        raise InputError(f"{where}: expected a rig of two sensors, both CAMERA")
    if words[6] != 1 or len(words) != 14:
        raise InputError(f"{where}: the second sensor has no pose, expected one of 7 numbers")
    for name in (words[3], words[5]):
        if str(name) not in cameras:
            raise InputError(f"{where}: camera {name} is not in {paths[0]}")
    fields = Fields(where, {"pose": list(words[7:])})
    values = fields.numbers("pose", (7,))
    T = pose(rotation(values[:4], where), values[4:])
    return rig_of([cameras[str(words[index])] for index in (3, 5)], T, where)


def rows(path: Path) -> list[tuple[int, list[Any]]]:
    """The rows of a table, with their numbers in it: numbers, and words."""
    found = []
    for index, line in enumerate(read_text(path).splitlines(), 1):
        if line.strip() and not line.startswith("#"):
            found.append((index, [number_or_word(word) for word in line.split()]))
            if len(found[-1][1]) < 4:
                raise InputError(f"{path}:{index}: {len(found[-1][1])} words, expected more")
    if not found:
        raise InputError(f"{path}: no rows, expected some")
    return found


def number_or_word(word: str) -> int | float | str:
    """A word, as a number if it is one."""
    for kind in (int, float):
        try:
            return kind(word)
        except ValueError:
            continue
    return word


def camera_of(fields: Fields, model: str, width: int, height: int, values: list[Any]) -> Pinhole:
    """A camera of a model's parameters."""
    if model not in PARAMETERS:
        raise InputError(
            f"{fields.where}: the model is {model}, expected one of {', '.join(PARAMETERS)}"
        )
    plain, bent = (text.split() for text in PARAMETERS[model])
    found = [number(value) for value in values]
    if None in found or len(found) != len(plain) + len(bent):
        raise InputError(
            f"{fields.where}: {len(found)} parameters, expected {len(plain) + len(bent)} finite"
            f" numbers for {model}"
        )
    named = dict(zip([*plain, *bent], [v for v in found if v is not None], strict=True))
    fx, fy = (named.get(name, named.get("f", 0.0)) for name in ("fx", "fy"))
    values = [fx, fy, named["cx"] - HALF, named["cy"] - HALF]
    lens = Lens()
    if model == "OPENCV_FISHEYE":
        lens = Lens("fisheye", [named[name] for name in bent])
    elif bent:
        order = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
        lens = brown([named.get(name, 0.0) for name in order])
    return fields.camera(width, height, values, lens)


def of_config(path: Path, sizes: Sizes) -> Rig:
    """The rig of a configuration, which has no image sizes."""
    document = json_of(path)
    if not isinstance(document, list) or len(document) != 1:
        raise InputError(f"{path}: expected a list of one rig")
    cameras = Fields(str(path), document[0]).get("cameras")
    if not isinstance(cameras, list) or len(cameras) != 2:
        raise InputError(f"{path}: cameras: expected a list of two")
    both = [Fields(str(path), node, f"cameras[{i}]") for i, node in enumerate(cameras)]
    both.sort(key=lambda fields: not fields.node.get("ref_sensor"))
    if not both[0].node.get("ref_sensor") or both[1].node.get("ref_sensor"):
        raise InputError(f"{path}: expected one camera with ref_sensor")
    found = []
    for fields, size, option in zip(both, sizes, ("reference", "source"), strict=True):
        if size is None:
            raise InputError(f"{path}: has no image sizes, --{option}-size gives that")
        model = fields.text("camera_model_name")
        found.append(camera_of(fields, model, *size, list(fields.numbers("camera_params"))))
    R = rotation(both[1].numbers("cam_from_rig_rotation", (4,)), str(path))
    T: Matrix = pose(R, both[1].numbers("cam_from_rig_translation", (3,)))
    return rig_of(found, T, str(path))


def model_of(camera: Pinhole) -> tuple[str, list[float]]:
    """COLMAP's model and its parameters."""
    values = [camera.fx, camera.fy, camera.cx + HALF, camera.cy + HALF]
    lens = camera.lens
    if lens.model == "none":
        return "PINHOLE", values
    if lens.model == "fisheye":
        return "OPENCV_FISHEYE", [*values, *lens.coefficients]
    count = 4 if len(lens.coefficients) == 4 else 8
    return "OPENCV" if count == 4 else "FULL_OPENCV", [*values, *padded(lens, count)]


def write(rig: Rig) -> Mapping[str, str]:
    """The two tables, and the configuration."""
    T = source_from_reference(rig)
    q, t = wxyz_of(T), [float(value) for value in T[:3, 3]]
    cameras = ["# CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]"]
    config: list[dict[str, Any]] = []
    for index, camera in enumerate((rig.reference, rig.source), 1):
        model, values = model_of(camera)
        cameras.append(" ".join(map(str, (index, model, camera.width, camera.height, *values))))
        config.append(
            {
                "image_prefix": f"{NAMES[index - 1]}/",
                "camera_model_name": model,
                "camera_params": values,
            }
        )
    config[0]["ref_sensor"] = True
    config[1]["cam_from_rig_rotation"] = q
    config[1]["cam_from_rig_translation"] = t
    rigs = (
        "# RIG_ID NUM_SENSORS REF_SENSOR_TYPE REF_SENSOR_ID"
        " SENSORS[] as (SENSOR_TYPE SENSOR_ID HAS_POSE [QW QX QY QZ TX TY TZ])\n"
        f"1 2 CAMERA 1 CAMERA 2 1 {' '.join(map(str, [*q, *t]))}\n"
    )
    return {
        "cameras.txt": "\n".join(cameras) + "\n",
        "rigs.txt": rigs,
        "rig_config.json": json.dumps([{"cameras": config}], indent=2) + "\n",
    }


FORMAT = Format(
    "colmap",
    "COLMAP",
    recognise,
    read,
    write,
    folder=("cameras.txt", "rigs.txt"),
    lenses={"brown": 8, "fisheye": 4},
)
