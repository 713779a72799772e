"""Rigs from and to the files of other tools, and maps as tables and flow.

>>> rig = xcalib.convert.read_rig("camchain.yaml")
>>> lost = xcalib.convert.write_rig(rig, "cameras", "ros")

What a format cannot hold is refused where it would move a corner of an image by more than 0.1 px,
and otherwise told.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from .._core import InputError, Pinhole, Rig, check_folder_writable
from ..frames import check_file_writable, write_bytes
from ..pipeline import save_rig
from . import authors, colmap, flir, foxglove, kalibr, mrcal, nerfstudio, opencv, ros, xcalib_rig
from .format import Format, Sizes
from .loss import TOLERANCE, held

__all__ = ["FORMATS", "TOLERANCE", "is_foreign", "read_camera", "read_rig", "write_rig"]

FORMATS: Mapping[str, Format] = {
    module.FORMAT.name: module.FORMAT
    for module in (
        xcalib_rig,
        opencv,
        ros,
        kalibr,
        mrcal,
        colmap,
        nerfstudio,
        foxglove,
        authors,
        flir,
    )
}

HEAD = 1 << 16
"""Bytes of a file by which it is recognised."""


def read_rig(*paths: str | Path, kind: str | None = None, sizes: Sizes = (None, None)) -> Rig:
    """The rig of one or more files, or of a folder of them.

    Parameters
    ----------
    paths
        The reference's first, where each camera has a file.
    kind
        One of `FORMATS`; None: by the files.
    sizes
        (width, height) [px] of the reference's and the source's images, where the files have none.
    """
    chosen, files = opened([Path(path) for path in paths], kind)
    return chosen.read(files, sizes)


def read_camera(path: str | Path, which: str) -> Pinhole:
    """One camera: that of a file which has no other, or else the ``which``, reference or source,
    of a rig.
    """
    chosen, files = opened([Path(path)], None)
    if chosen.read_camera is not None and len(files) == 1:
        return chosen.read_camera(files[0])
    rig = chosen.read(files, (None, None))
    return rig.reference if which == "reference" else rig.source


def write_rig(rig: Rig, path: str | Path, kind: str, tolerance: float = TOLERANCE) -> list[str]:
    """Write a rig, a file or a folder of them; returns what the format leaves out, a line each.

    Parameters
    ----------
    tolerance
        How far a corner of an image may move by what the format cannot hold [px].
    """
    chosen, path = named(kind), Path(path)
    if chosen is xcalib_rig.FORMAT:
        save_rig(rig, path)
        return []
    if chosen.write is None:
        raise InputError(f"{chosen.title} is read, not written")
    rig, lines = held(rig, chosen.title, chosen.lenses, tolerance)
    files = chosen.write(rig)
    if "" in files:
        check_file_writable(str(path))
    else:
        check_folder_writable(path)
    for name, text in files.items():
        write_bytes(path / name if name else path, text.encode())
    return lines


def is_foreign(path: str | Path) -> bool:
    """Whether a file or a folder is a rig of one of the formats, but not of ours."""
    with suppress(InputError, OSError):
        return opened([Path(path)], None)[0] is not xcalib_rig.FORMAT
    return False


def named(kind: str) -> Format:
    """The format of a name."""
    if kind not in FORMATS:
        raise InputError(f"format {kind!r}, expected one of {', '.join(FORMATS)}")
    return FORMATS[kind]


def opened(paths: Sequence[Path], kind: str | None) -> tuple[Format, list[Path]]:
    """The format, and its files in the order in which it takes them."""
    if not paths:
        raise InputError("no files, expected those of a rig")
    candidates = [named(kind)] if kind else list(FORMATS.values())
    first = paths[0]
    if first.is_dir():
        for candidate in candidates:
            files = [first / name for name in candidate.folder]
            if files and all(file.is_file() for file in files):
                return candidate, files
        expected = " or ".join(" and ".join(c.folder) for c in candidates if c.folder)
        raise InputError(f"{first}: a folder without the files of a rig, expected {expected}")
    for path in paths:
        if not path.is_file():
            raise InputError(f"{path}: no such file")
    if kind:
        return candidates[0], list(paths)
    with first.open("rb") as file:
        head = file.read(HEAD).decode("utf-8", "replace")
    for candidate in candidates:
        if candidate.recognise(first, head):
            return candidate, list(paths)
    raise InputError(
        f"{first}: not recognised as a rig of any format; --from says which one it is"
        f" ({', '.join(FORMATS)})"
    )
