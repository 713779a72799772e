"""What labels of files are carried with: the frames' names, sizes and depths."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from .._core import InputError, Rig
from ..frames import IMAGE_SUFFIXES, size_of
from ..pipeline import Frames
from .shapes import Shapes


@dataclass
class LabelledFrames:
    """Frames by the stems of their images, and what was said about labels."""

    frames: Frames
    rig: Rig
    """Of the size of the images."""
    to: str
    counts: Counter[str] = field(default_factory=Counter)
    """Labels by what became of them."""

    def __post_init__(self) -> None:
        here, there = self.frames.references, self.frames.sources
        if self.to == "reference":
            here, there = there, here
        self._index = {Path(here.name(i)).stem: i for i in range(len(self.frames))}
        files = [Path(there.where(i)) for i in range(len(self.frames))]
        self._names = [
            file.name if file.suffix.lower() in IMAGE_SUFFIXES else there.name(i)
            for i, file in enumerate(files)
        ]

    def partner(self, name: str, where: str) -> tuple[int, str]:
        """The frame of an image file, and the name of its other image."""
        stem = Path(name).stem
        if stem not in self._index:
            some = ", ".join(list(self._index)[:3])
            raise InputError(f"{where}: image {name!r} is none of the frames ({some}, ...)")
        index = self._index[stem]
        return index, self._names[index]

    def shapes(self, index: int) -> Shapes:
        """What carries labels of a frame."""
        reference = self.frames.references[index]
        depth = self.frames.depth(index, reference)
        if size_of(reference) != (self.rig.reference.width, self.rig.reference.height):
            raise InputError(
                f"{self.frames.references.where(index)}: the image is of another size than the"
                " first"
            )
        return Shapes(self.rig, depth, self.to)

    def count(self, notes: tuple[str, ...]) -> None:
        """Count a label by what is said of it."""
        self.counts["labels"] += 1
        self.counts.update(notes)

    def summary(self) -> str:
        """In one line."""
        said = ", ".join(f"{n} {what}" for what, n in self.counts.items() if what != "labels")
        return f"{self.counts['labels']} labels" + (f": {said}" if said else "")
