"""What a format is: how its files are known, read and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from .._core import Pinhole, Rig

NAMES = ("visible", "thermal")
"""What the reference and the source camera are called in files that name their cameras."""

Sizes = tuple[tuple[int, int] | None, tuple[int, int] | None]
"""Width and height [px] of the reference's and the source's images, where a user gives them."""


@dataclass(frozen=True)
class Format:
    """One way to write two cameras and their pose."""

    name: str
    """As ``--to`` and ``--from`` take it."""
    title: str
    """As messages call it."""
    recognise: Callable[[Path, str], bool]
    """Whether a file of this name and beginning is one."""
    read: Callable[[Sequence[Path], Sizes], Rig]
    """The rig of the files, the reference's first where there are several."""
    write: Callable[[Rig], Mapping[str, str]] | None = None
    """The files that hold a rig, by name; the name of a file alone is ''."""
    read_camera: Callable[[Path], Pinhole] | None = None
    """The camera of a file, where each has a file of its own."""
    folder: tuple[str, ...] = ()
    """The files of a folder, in the order that `read` takes them."""
    lenses: Mapping[str, int] = field(default_factory=dict)
    """How many coefficients it has for each of our models that it knows."""
