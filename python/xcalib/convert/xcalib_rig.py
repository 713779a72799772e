"""Our own rig file, which the core reads and writes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .._core import Rig
from .format import Format, Sizes


def recognise(path: Path, head: str) -> bool:
    """A rig file names its format."""
    return "xcalib-rig" in head


def read(paths: Sequence[Path], sizes: Sizes) -> Rig:
    """The rig of a file."""
    return Rig.load(paths[0])


FORMAT = Format("xcalib", "a rig file", recognise, read)
