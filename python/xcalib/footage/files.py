"""Streams of image files: folders, patterns, and the pages of one TIFF."""

from __future__ import annotations

import contextlib
import glob
import re
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from .. import remote
from .._core import natural_order, times_beside, times_of_names
from ..frames import (
    ARRAY_SUFFIXES,
    IMAGE_SUFFIXES,
    DecodeError,
    Image,
    InputError,
    as_image,
    list_images,
    quiet_opencv,
    read_image,
)
from .stream import Stream


class ImageFiles(Stream):
    """A list of image files; their times stand in their names or in a table beside them."""

    parallel = True

    def __init__(self, paths: Sequence[Path]) -> None:
        super().__init__()
        self.paths = list(paths)
        times = times_of_names([path.stem for path in self.paths])
        self.times = None if times is None else np.array(times)
        beside = times_beside(self.paths, self)
        if beside is not None:
            self.times = np.array(beside)

    def __len__(self) -> int:
        return len(self.paths)

    def read(self, index: int) -> Image:
        with remote.named(self.paths[index]):
            return read_image(self.paths[index])

    def name(self, index: int) -> str:
        return self.paths[index].stem

    def where(self, index: int) -> str:
        return remote.shown(self.paths[index])

    def file(self, index: int) -> Path:
        return remote.identity(self.paths[index])

    def header_file(self, index: int) -> Path:
        """The file whose header says the frame's size."""
        remote.fetch(self.paths[index])
        return self.paths[index]


def matching_files(pattern: Path) -> list[Path]:
    """Image files of a pattern with ``*``, ``?``, ``[...]``, or a number as in ``%06d``."""
    number = re.fullmatch(r"(.*)%(0\d{1,3})?d(.*)", pattern.name)
    if number:
        before, width, after = number[1], number[2], number[3]
        digits = rf"\d{{{int(width)},}}" if width else r"\d+"
        name = re.compile(re.escape(before) + digits + re.escape(after))
        folder = pattern.parent
        files = folder.iterdir() if folder.is_dir() else ()
        found = [path for path in files if name.fullmatch(path.name)]
    else:
        found = [Path(path) for path in glob.glob(str(pattern))]
    found = [
        path
        for path in found
        if path.suffix.lower() in IMAGE_SUFFIXES + ARRAY_SUFFIXES and path.is_file()
    ]
    if not found:
        raise InputError(f"{pattern}: no image file matches")
    return [found[index] for index in natural_order([str(path) for path in found])]


class Pages(Stream):
    """The pages of a TIFF stack."""

    parallel = True

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        with quiet_opencv():
            self._count = cv2.imcount(str(path), cv2.IMREAD_UNCHANGED)
        if not self._count:
            raise InputError(f"{path}: cannot decode, truncated or not a TIFF")

    def __len__(self) -> int:
        return self._count

    def read(self, index: int) -> Image:
        done = False
        pages: Sequence[Image] = ()
        with quiet_opencv(), contextlib.suppress(cv2.error):
            done, pages = cv2.imreadmulti(str(self.path), index, 1, flags=cv2.IMREAD_UNCHANGED)
        if not done or len(pages) != 1:
            raise DecodeError(f"{self.where(index)}: cannot decode, truncated")
        return as_image(pages[0], self.where(index))

    def name(self, index: int) -> str:
        return f"{index:06d}"

    def where(self, index: int) -> str:
        return f"{self.path} page {index}"

    def file(self, index: int) -> Path:
        return self.path


def open_files(path: Path) -> Stream | None:
    """The stream of a folder, a pattern or a TIFF; None where the path is none of these."""
    if path.is_dir():
        return ImageFiles(list_images(path))
    if path.is_file():
        return Pages(path) if path.suffix.lower() in (".tif", ".tiff") else None
    if re.search(r"[*?\[]|%(0\d{1,3})?d", path.name):
        return ImageFiles(matching_files(path))
    return None
