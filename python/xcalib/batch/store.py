"""Small files of a batch, on this machine or behind a URL, each whole."""

from __future__ import annotations

from pathlib import Path

from .._core import write_file
from ..remote import child, file_system, is_url, local_name

Place = str | Path
"""A path, or a URL as text."""


def join(place: Place, name: str) -> Place:
    """Something in a folder."""
    return child(str(place), name) if is_url(place) else Path(place) / name


def read(place: Place) -> bytes | None:
    """What is in a file; None where there is none."""
    try:
        if not is_url(place):
            return Path(place).read_bytes()
        files, path = file_system(str(place))
        files.invalidate_cache()
        data: bytes = files.cat_file(path)
        return data
    except FileNotFoundError:
        return None


def write(place: Place, data: bytes) -> None:
    """Write a file, whole or not at all."""
    if not is_url(place):
        write_file(place, data)
        return
    files, path = file_system(str(place))
    files.pipe_file(path, data)


def is_there(place: Place) -> bool:
    """Whether there is such a file or folder."""
    if not is_url(place):
        return Path(place).exists()
    files, path = file_system(str(place))
    return bool(files.exists(path))


def local(place: Place) -> Path:
    """The file on this machine."""
    return Path(local_name(place))
