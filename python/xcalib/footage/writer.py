"""Where registered frames go: a folder of images, or a video."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from types import TracebackType
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from ..frames import Image, InputError, size_of, write_image

CODECS = {".mp4": "mp4v", ".avi": "MJPG", ".mkv": "FFV1"}


class Sink(Protocol):
    """Takes frames one by one; what it made is whole only after it was closed without an error."""

    def __enter__(self) -> Sink: ...
    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None: ...
    def write(
        self, name: str, image: Image, mask: NDArray[np.uint8], overlay: Image | None
    ) -> None: ...


class FolderSink:
    """Images under the names of the frames, ``masks/`` and ``overlays/`` beside them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __enter__(self) -> FolderSink:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def write(
        self, name: str, image: Image, mask: NDArray[np.uint8], overlay: Image | None
    ) -> None:
        suffix = ".tiff" if image.dtype == np.float32 else ".png"
        write_image(self.folder / f"{name}{suffix}", image)
        write_image(self.folder / "masks" / f"{name}.png", mask)
        if overlay is not None:
            write_image(self.folder / "overlays" / f"{name}.png", overlay)


class VideoSink:
    """One video; beside it ``NAME.masks.mkv``, lossless, and ``NAME.overlay`` with its suffix.

    .mp4 and .avi hold 8-bit images, compressed with loss; .mkv holds 8-bit and 16-bit gray images
    without loss (FFV1). No video holds float32 or 16-bit colour, nor odd sizes: OpenCV cuts those.
    """

    def __init__(self, path: Path, rate: float) -> None:
        self.path, self.rate = path, rate
        self._writers: dict[Path, tuple[Path, cv2.VideoWriter]] = {}
        self._kinds: dict[Path, tuple[object, ...]] = {}

    def __enter__(self) -> VideoSink:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        for target, (partial, writer) in self._writers.items():
            writer.release()
            if kind is None:
                os.replace(partial, target)
            with contextlib.suppress(OSError):
                partial.unlink(missing_ok=True)

    def write(
        self, name: str, image: Image, mask: NDArray[np.uint8], overlay: Image | None
    ) -> None:
        self._write(self.path, image)
        self._write(self.path.with_suffix(".masks.mkv"), mask)
        if overlay is not None:
            self._write(self.path.with_suffix(f".overlay{self.path.suffix}"), overlay)

    def _write(self, path: Path, image: Image) -> None:
        if path not in self._writers:
            self._writers[path] = self._opened(path, image)
        # OpenCV would leave out, or misread, what is not like the first frame.
        kind = (*image.shape, str(image.dtype))
        first = self._kinds.setdefault(path, kind)
        if kind != first:
            raise InputError(
                f"{path}: a frame is {kind}, the first is {first}; a video holds frames of one"
                " kind, a folder any"
            )
        self._writers[path][1].write(image)

    def _opened(self, path: Path, image: Image) -> tuple[Path, cv2.VideoWriter]:
        suffix = path.suffix.lower()
        deep = image.dtype == np.uint16 and image.ndim == 2 and suffix == ".mkv"
        if image.dtype != np.uint8 and not deep:
            kind = f"{image.dtype} {'gray' if image.ndim == 2 else 'colour'}"
            raise InputError(
                f"{path}: the images are {kind}; {suffix} holds uint8"
                + (" and gray uint16" if suffix == ".mkv" else "")
                + ", a folder holds any"
            )
        width, height = size_of(image)
        if width % 2 or height % 2:
            raise InputError(
                f"{path}: the images are {width}x{height}; a video holds even sizes, a folder any"
            )
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")
        writer = cv2.VideoWriter(
            str(partial),
            cv2.CAP_FFMPEG,
            cv2.VideoWriter.fourcc(*CODECS[suffix]),
            self.rate,
            (width, height),
            [
                *(cv2.VIDEOWRITER_PROP_IS_COLOR, int(image.ndim == 3)),
                *(cv2.VIDEOWRITER_PROP_DEPTH, cv2.CV_16U if deep else cv2.CV_8U),
            ],
        )
        if not writer.isOpened():
            raise InputError(f"{path}: this OpenCV cannot write {CODECS[suffix]} video")
        return partial, writer


def open_sink(output: Path, rate: float) -> Sink:
    """A video where the suffix says so, at ``rate`` frames a second; else a folder."""
    return VideoSink(output, rate) if is_video(output) else FolderSink(output)


def is_video(output: Path) -> bool:
    """Whether an output of this name is a video."""
    return output.suffix.lower() in CODECS and not output.is_dir()
