"""Where registered frames go: a folder of images, or a video.

Both note in a `Journal` what is whole, and so can go on from where an earlier run ended.
"""

from __future__ import annotations

import contextlib
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..frames import Image, write_image
from ..journal import Journal, Unit
from .encoder import SUFFIXES, Encoder, check_image, join


class Sink(Protocol):
    """Takes frames. Leaving it keeps what is whole, whatever happened; `finish` completes it."""

    parallel: bool
    """Whether several threads may write at a time, and frames in any order."""

    def __enter__(self) -> Sink: ...
    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...
    def begin(self, keys: Sequence[str]) -> dict[str, int]:
        """Before the first frame: the keys of all frames, in order. Returns those that are there
        already, with the valid pixels of each.
        """

    def write(
        self,
        index: int,
        name: str,
        image: Image,
        mask: NDArray[np.uint8],
        overlay: Image | None,
    ) -> None: ...
    def finish(self, check: Callable[[], None]) -> None:
        """After the last frame; ``check`` is called now and then, and may raise."""


def valid_pixels(mask: NDArray[np.uint8]) -> int:
    """How many pixels of a mask are valid."""
    return int(np.count_nonzero(mask == 0))


class FolderSink:
    """Images under the names of the frames, ``masks/`` and ``overlays/`` beside them."""

    parallel = True

    def __init__(self, folder: Path, journal: Journal) -> None:
        self.folder, self.journal = folder, journal
        self._keys: Sequence[str] = ()

    def __enter__(self) -> FolderSink:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def begin(self, keys: Sequence[str]) -> dict[str, int]:
        self._keys, wanted = keys, set(keys)
        if self.journal.units:  # then it is ours alone: what is partial is of a killed run
            for name in ("", "masks", "overlays"):
                for file in (self.folder / name).glob(".*.partial"):
                    file.unlink()
        found = [pair for unit in self.journal.units for pair in unit.frames.items()]
        return {key: valid for key, valid in found if key in wanted}

    def write(
        self,
        index: int,
        name: str,
        image: Image,
        mask: NDArray[np.uint8],
        overlay: Image | None,
    ) -> None:
        suffix = ".tiff" if image.dtype == np.float32 else ".png"
        pictures = {f"{name}{suffix}": image, f"masks/{name}.png": mask}
        if overlay is not None:
            pictures[f"overlays/{name}.png"] = overlay
        for file, picture in pictures.items():
            write_image(self.folder / file, picture)
        frames = {self._keys[index]: valid_pixels(mask)}
        self.journal.append(Unit(frames, self.journal.sizes(*pictures)))

    def finish(self, check: Callable[[], None]) -> None:
        pass


class VideoSink:
    """One video; beside it ``NAME.masks.mkv``, lossless, and ``NAME.overlay`` with its suffix.

    A video cannot be appended to. Frames go to parts of `PART` frames in a folder with ``.parts``
    behind the video's name; `finish` copies the compressed frames of all parts into the videos, and
    removes the parts.
    """

    parallel = False
    PART = 250
    """Frames that a run that is killed, not only interrupted, can lose at most."""

    def __init__(self, path: Path, rate: float, journal: Journal) -> None:
        self.path, self.rate, self.journal = path, rate, journal
        self.parts = path.with_name(f"{path.name}.parts")
        self._places: dict[str, int] = {}
        self._keys: Sequence[str] = ()
        self._open: dict[str, Encoder] = {}
        self._frames: dict[str, int] = {}
        self._next = 0

    def __enter__(self) -> VideoSink:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self._close_part()
        except (OSError, ValueError):
            if kind is None:
                raise
        finally:
            for encoder in self._open.values():
                encoder.discard()
            with contextlib.suppress(OSError):
                self.parts.rmdir()  # only if nothing whole is in it

    def begin(self, keys: Sequence[str]) -> dict[str, int]:
        self._keys = keys
        self._places = {key: index for index, key in enumerate(keys)}
        units = self._fitting()
        # What a killed run left half-written, and parts of what has changed since.
        ours = {name for unit in units for name in unit.files}
        for file in self.parts.glob("*"):
            if f"{self.parts.name}/{file.name}" not in ours:
                file.unlink()
        return {key: valid for unit in units for key, valid in unit.frames.items()}

    def _fitting(self) -> list[Unit]:
        """The units whose frames still follow on each other, in order."""
        fitting = {}
        for unit in self.journal.units:
            places = [self._places.get(key, -1) for key in unit.frames]
            follow = places == list(range(places[0], places[0] + len(places)))
            partly = self._is_joined(unit) and len(places) != len(self._keys)
            if places[0] >= 0 and follow and not partly:
                fitting[places[0]] = unit
        joined = [unit for unit in fitting.values() if self._is_joined(unit)]
        return joined or [fitting[place] for place in sorted(fitting)]

    def _is_joined(self, unit: Unit) -> bool:
        return self.path.name in unit.files

    def write(
        self,
        index: int,
        name: str,
        image: Image,
        mask: NDArray[np.uint8],
        overlay: Image | None,
    ) -> None:
        pictures = {self.path.name: image, self.path.with_suffix(".masks.mkv").name: mask}
        if overlay is not None:
            pictures[self.path.with_suffix(f".overlay{self.path.suffix}").name] = overlay
        if len(self._frames) == self.PART or index != self._next:
            self._close_part()
        self._next = index + 1
        if not self._open:
            for target, picture in pictures.items():
                check_image(self.path.with_name(target), picture)
            self.parts.mkdir(parents=True, exist_ok=True)
            for target, picture in pictures.items():
                kind = target.removeprefix(self.path.stem)
                part = self.parts / f"{self._keys[index]}{kind}"
                self._open[target] = Encoder(part, self.path.with_name(target), picture, self.rate)
        for target, picture in pictures.items():
            self._open[target].write(picture)
        self._frames[self._keys[index]] = valid_pixels(mask)

    def _close_part(self) -> None:
        """The open part is whole now, and noted."""
        if not self._frames:
            return
        for encoder in self._open.values():
            encoder.close(len(self._frames))
        names = [f"{self.parts.name}/{encoder.path.name}" for encoder in self._open.values()]
        self.journal.append(Unit(self._frames, self.journal.sizes(*names)))
        self._open, self._frames = {}, {}

    def finish(self, check: Callable[[], None]) -> None:
        self._close_part()
        units = self._fitting()
        if any(map(self._is_joined, units)):
            return
        frames = {key: valid for unit in units for key, valid in unit.frames.items()}
        counts = [len(unit.frames) for unit in units]
        if list(frames) != list(self._keys) or sum(counts) != len(frames):
            raise RuntimeError(f"{self.parts}: frames are missing in these parts")
        targets = []
        for files in zip(*(unit.files for unit in units), strict=True):
            kind = Path(files[0]).name.removeprefix(self._keys[0])
            target = self.path.with_name(f"{self.path.stem}{kind}")
            parts = [(self.path.parent / file, n) for file, n in zip(files, counts, strict=True)]
            join(parts, target, self.rate, check)
            targets.append(target.name)
        self.journal.append(Unit(frames, self.journal.sizes(*targets)))
        shutil.rmtree(self.parts, ignore_errors=True)


def open_sink(output: Path, rate: float, journal: Journal) -> Sink:
    """A video where the suffix says so, at ``rate`` frames a second; else a folder."""
    return VideoSink(output, rate, journal) if is_video(output) else FolderSink(output, journal)


def journal_of(output: Path) -> Path:
    """Where the journal of an output is: in the folder, or beside the video, named after it."""
    name = "register.jsonl"
    return output.with_name(f"{output.name}.{name}") if is_video(output) else output / name


def is_video(output: Path) -> bool:
    """Whether an output of this name is a video."""
    return output.suffix.lower() in SUFFIXES and not output.is_dir()
