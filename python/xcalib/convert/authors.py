"""The rig file of the paper's own code, to be read only.

`extrinsics` is each camera's pose in the rig, it takes points of the camera to the rig: of the
authors' night rig, whose thermal camera stands to the right, its x is positive. Principal points
count from the left edge of the first pixel, as in the paper; `resolution` is height and width.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .._core import InputError, Lens, Pinhole, Rig
from .fields import Fields
from .format import Format, Sizes
from .pose import inverse, rig_of
from .text import yaml_of


def recognise(path: Path, head: str) -> bool:
    """A rig of named cameras, with sensors' pixels and sizes."""
    return path.suffix.lower() in (".yaml", ".yml") and "pixelSize:" in head and "cameras:" in head


def read(paths: Sequence[Path], sizes: Sizes) -> Rig:
    """The rig of a file of two cameras: the visible one is the reference."""
    path = paths[0]
    cameras = Fields(str(path), yaml_of(path)).fields("cameras")
    both = [cameras.fields(name) for name in cameras.node]
    if len(both) != 2:
        raise InputError(f"{path}: has {len(both)} cameras, expected two")
    visible = [fields.text("modality") == "Visible" for fields in both]
    if sum(visible) != 1:
        raise InputError(f"{path}: {sum(visible)} cameras are of modality Visible, expected one")
    reference, source = both if visible[0] else both[::-1]
    poses = [fields.matrix("extrinsics", 4, 4) for fields in (reference, source)]
    T = inverse(poses[1], str(path)) @ poses[0]
    return rig_of([camera(reference), camera(source)], T, str(path))


def camera(fields: Fields) -> Pinhole:
    """A camera of the file."""
    K = fields.matrix("intrinsics", 4, 4)
    sides = fields.fields_of_list("resolution", ("height", "width"))
    values = [K[0, 0], K[1, 1], K[0, 2] - 0.5, K[1, 2] - 0.5]
    return fields.camera(sides.size("width"), sides.size("height"), values, Lens())


FORMAT = Format("authors", "the paper's own rig file", recognise, read)
