"""Frames of a drive as files."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from .._core import Rig
from ..frames import write_image
from .arguments import require
from .drive import Frame
from .texture import Array


def write(folder: str | os.PathLike[str], frames: Iterable[Frame], rig: Rig | None = None) -> None:
    """Writes frames as folder/visible, folder/thermal and folder/depth /NAME.png, and
    folder/rig.yaml.

    Depth becomes 16-bit PNG in 1/256 m, 0 where unknown; what is beyond 255.996 m is written as
    that. Every file appears whole or not at all. Folders are created.

    Raises
    ------
    ValueError
        A frame whose images are not of the documented kind.
    OSError
        A file that cannot be written.
    """
    root = Path(folder)
    for kind in ("visible", "thermal", "depth"):
        (root / kind).mkdir(parents=True, exist_ok=True)
    for frame in frames:
        layers = {
            "visible": frame.reference,
            "thermal": frame.source,
            "depth": _encoded_depth(frame.depth),
        }
        for kind, image in layers.items():
            require(image.dtype in (np.uint8, np.uint16), kind, image.dtype, "uint8 or uint16")
            write_image(root / kind / f"{frame.name}.png", image)
    if rig is not None:
        rig.save(root / "rig.yaml")


def _encoded_depth(depth: Array) -> Array:
    known = np.isfinite(depth) & (depth > 0)
    steps = np.where(known, depth, 0).astype(np.float64) * 256
    # A known depth must not turn into the code for unknown.
    return np.where(known, np.clip(np.rint(steps), 1, 65535), 0).astype(np.uint16)
