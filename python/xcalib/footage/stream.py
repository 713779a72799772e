"""What footage is, wherever it comes from."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray

from ..frames import Image, InputError, Size, size_of

Times = NDArray[np.float64]
"""Seconds of each frame, (N,), on the clock of its stream."""


class Stream(Sequence[Image]):
    """A sized sequence of frames, each read at the moment of access, all of one size.

    Only names and times are held, so that memory does not grow with the pixels of the footage.
    A slice, and `picked`, are streams again.
    """

    times: Times | None = None
    """(N,) seconds of the frames, never falling; None where unknown. Each stream has its clock."""
    parallel = False
    """Whether several threads may read at a time, after a first frame was read."""
    _first: tuple[str, Size] | None = None

    @abstractmethod
    def __len__(self) -> int: ...

    @abstractmethod
    def read(self, index: int) -> Image:
        """Frame ``index``, 0 <= index < len, as `frames.read_image` returns images."""

    @abstractmethod
    def name(self, index: int) -> str:
        """What a file made from the frame is called, without suffix."""

    @abstractmethod
    def where(self, index: int) -> str:
        """Where the frame is, for messages: a file, or a file and the frame's number."""

    def file(self, index: int) -> Path:
        """The file that the frame is in, or the folder of a bag."""
        return Path(self.where(index))

    @overload
    def __getitem__(self, index: int) -> Image: ...
    @overload
    def __getitem__(self, index: slice) -> Stream: ...
    def __getitem__(self, index: int | slice) -> Image | Stream:
        if isinstance(index, slice):
            return Picked(self, range(len(self))[index])
        index = range(len(self))[index]
        image = self.read(index)
        size = size_of(image)
        if self._first is None:
            self._first = self.where(index), size
        first, expected = self._first
        if size != expected:
            raise InputError(
                f"{self.where(index)} is {size[0]}x{size[1]}, expected"
                f" {expected[0]}x{expected[1]} as {Path(first).name}"
            )
        return image

    def __iter__(self) -> Iterator[Image]:
        return (self[index] for index in range(len(self)))


class Picked(Stream):
    """Some frames of a stream, in the order of ``indices``."""

    def __init__(self, stream: Stream, indices: Sequence[int]) -> None:
        self.stream, self.indices = stream, indices
        self.parallel = stream.parallel
        if stream.times is not None:
            self.times = stream.times[np.asarray(indices, np.intp)]

    def __len__(self) -> int:
        return len(self.indices)

    def read(self, index: int) -> Image:
        return self.stream[self.indices[index]]

    def name(self, index: int) -> str:
        return self.stream.name(self.indices[index])

    def where(self, index: int) -> str:
        return self.stream.where(self.indices[index])

    def file(self, index: int) -> Path:
        return self.stream.file(self.indices[index])


class Converted(Stream):
    """A stream whose frames are passed through ``convert`` as they are read."""

    def __init__(self, stream: Stream, convert: Callable[[Image], Image]) -> None:
        self.stream, self.convert = stream, convert
        self.times, self.parallel = stream.times, stream.parallel

    def __len__(self) -> int:
        return len(self.stream)

    def read(self, index: int) -> Image:
        return self.convert(self.stream[index])

    def name(self, index: int) -> str:
        return self.stream.name(index)

    def where(self, index: int) -> str:
        return self.stream.where(index)

    def file(self, index: int) -> Path:
        return self.stream.file(index)


class Part(Stream):
    """A half of every frame: two cameras side by side, or one above the other, in one stream."""

    HALVES = ("left", "right", "top", "bottom")

    def __init__(self, stream: Stream, half: str) -> None:
        self.stream, self.half = stream, half
        self.times, self.parallel = stream.times, stream.parallel

    def __len__(self) -> int:
        return len(self.stream)

    def read(self, index: int) -> Image:
        image = self.stream[index]
        side = image.shape[1] if self.half in ("left", "right") else image.shape[0]
        if side % 2:
            kind = "width" if self.half in ("left", "right") else "height"
            raise InputError(
                f"{self.stream.where(index)}: its {kind} is {side} px, expected an even one to"
                f" take the {self.half} half"
            )
        first = np.s_[: side // 2] if self.half in ("left", "top") else np.s_[side // 2 :]
        part = image[:, first] if self.half in ("left", "right") else image[first]
        return np.ascontiguousarray(part)

    def name(self, index: int) -> str:
        return self.stream.name(index)

    def where(self, index: int) -> str:
        return f"{self.stream.where(index)} ({self.half} half)"

    def file(self, index: int) -> Path:
        return self.stream.file(index)
