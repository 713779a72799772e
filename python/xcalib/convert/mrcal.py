"""mrcal's .cameramodel: a file a camera, the text of a Python dict.

rt_cam_ref is a rotation vector and a translation that take points of the reference's axes to the
camera; versions before 2.5 call it extrinsics, so both are written.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from .._core import InputError, Lens, Pinhole, Rig
from .fields import Fields, Matrix, brown
from .format import NAMES, Format, Sizes
from .loss import padded
from .pose import inverse, pose, rig_of, rodrigues, rotation_vector
from .text import literal_of

COUNTS = {f"LENSMODEL_OPENCV{count}": count for count in (4, 5, 8, 12)} | {"LENSMODEL_PINHOLE": 0}


def recognise(path: Path, head: str) -> bool:
    """A file of mrcal's."""
    return path.suffix.lower() == ".cameramodel" or "LENSMODEL_" in head


def read(paths: Sequence[Path], sizes: Sizes) -> Rig:
    """The rig of two files, the reference's first."""
    if len(paths) != 2:
        raise InputError(
            f"{paths[0]}: {len(paths)} files, expected two, the reference's and the source's, or a"
            f" folder of {' and '.join(FORMAT.folder)}"
        )
    cameras = [read_camera(path) for path in paths]
    reference, source = (pose_of(path) for path in paths)
    return rig_of(cameras, source @ inverse(reference, str(paths[0])), str(paths[1]))


def read_camera(path: Path) -> Pinhole:
    """The camera of a file."""
    fields = Fields(str(path), literal_of(path))
    model = fields.text("lensmodel")
    if model not in COUNTS:
        fields.fail("lensmodel", f"one of {', '.join(COUNTS)}")
    values = fields.numbers("intrinsics", (4 + COUNTS[model],))
    if any(values[12:]):
        fields.fail("intrinsics", "no thin prism (the last four), which no lens here has")
    lens = brown(values[4:12]) if model != "LENSMODEL_PINHOLE" else Lens()
    sides = fields.fields_of_list("imagersize", ("width", "height"))
    return fields.camera(sides.size("width"), sides.size("height"), values[:4], lens)


def pose_of(path: Path) -> Matrix:
    """camera_from_reference, 4x4."""
    fields = Fields(str(path), literal_of(path))
    values = fields.numbers("rt_cam_ref" if "rt_cam_ref" in fields else "extrinsics", (6,))
    return pose(rodrigues(values[:3]), values[3:])


def write(rig: Rig) -> Mapping[str, str]:
    """A file a camera."""
    poses = [[0.0] * 6, [*rotation_vector(rig.R), *map(float, rig.t)]]
    files = {}
    for name, camera, values in zip(NAMES, (rig.reference, rig.source), poses, strict=True):
        lens, model = camera.lens, "LENSMODEL_PINHOLE"
        coefficients: list[float] = []
        if lens.model != "none":
            coefficients = padded(lens, len(lens.coefficients))
            model = f"LENSMODEL_OPENCV{len(coefficients)}"
        intrinsics = [camera.fx, camera.fy, camera.cx, camera.cy, *coefficients]
        files[f"{name}.cameramodel"] = (
            "{\n"
            f"    'lensmodel':  {model!r},\n"
            f"    'intrinsics': {intrinsics!r},\n"
            f"    'rt_cam_ref': {values!r},\n"
            f"    'extrinsics': {values!r},\n"
            f"    'imagersize': {[camera.width, camera.height]!r},\n"
            "}\n"
        )
    return files


FORMAT = Format(
    "mrcal",
    "mrcal's .cameramodel",
    recognise,
    read,
    write,
    read_camera,
    folder=tuple(f"{name}.cameramodel" for name in NAMES),
    lenses={"brown": 8},
)
