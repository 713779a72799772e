"""What compresses for `register_frames`: images through OpenCV, videos through PyAV.

PyAV is FFmpeg's libraries. OpenCV writes videos too, but reports no error (a full disk leaves half
a video behind), and cannot copy compressed frames from one file to another.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
from av import library_versions

from ..frames import Image, encode_image, size_of

__all__ = ["Encoder", "encode_image", "encoder_name", "join"]

# Container, codec and the pixels it stores; None: as they are. The quantizer of the lossy ones is
# fixed, so that a frame's quality does not depend on where a part began.
_QUALITY = {"flags": "+qscale", "global_quality": str(2 * 118)}
_KINDS: dict[str, tuple[str, str, str | None, dict[str, str]]] = {
    ".mp4": ("mp4", "mpeg4", "yuv420p", _QUALITY),
    ".avi": ("avi", "mjpeg", "yuvj420p", _QUALITY),
    # Slices are coded by threads of their own, and must be as many in all parts.
    ".mkv": ("matroska", "ffv1", None, {"level": "3", "slices": "4"}),
}
# How arrays are called by their type and number of dimensions, and what FFV1 stores them as.
_PIXELS = {("uint8", 2): "gray", ("uint16", 2): "gray16le", ("uint8", 3): "bgr24"}
_LOSSLESS = {"gray": "gray", "gray16le": "gray16le", "bgr24": "bgr0"}


def encoder_name() -> str:
    """The library that compresses, and its version: parts of a video are of one."""
    return f"libavcodec {'.'.join(map(str, library_versions['libavcodec']))}"


class Encoder:
    """Compresses frames into a part of a video: a Matroska file, complete once it is closed.

    Parameters
    ----------
    file
        To be written, under a name that is not yet the part's.
    target
        The video it becomes a part of: its suffix says the codec, and messages name it.
    first
        An image like all that follow.
    rate
        Frames a second.
    """

    def __init__(self, file: Path, target: Path, first: Image, rate: float) -> None:
        self.file, self.target = file, target
        self._pixels = _PIXELS[str(first.dtype), first.ndim]
        self._frames = 0
        stored = _KINDS[target.suffix.lower()][2]
        with _named(target):
            self._container = av.open(_name(file), "w", format="matroska")
            self._stream = _added(self._container, target, rate)
            self._stream.width, self._stream.height = size_of(first)
            self._stream.pix_fmt = stored or _LOSSLESS[self._pixels]

    def write(self, image: Image) -> None:
        """Add a frame."""
        with _named(self.target):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format=self._pixels)
            frame.pts = self._frames
            self._container.mux(self._stream.encode(frame))
        self._frames += 1

    def close(self, frames: int) -> None:
        """Complete the file; OSError if it does not hold at least ``frames`` frames then."""
        with _named(self.target):
            self._container.mux(self._stream.encode(None))
            self._container.close()
        _check_count(self.file, frames, self.target)

    def end(self) -> None:
        """Let go of the file, complete or not."""
        with contextlib.suppress(OSError, ValueError, av.FFmpegError):
            self._container.close()


def join(
    parts: Sequence[tuple[Path, int]],
    file: Path,
    target: Path,
    rate: float,
    check: Callable[[], None],
) -> None:
    """Write a video of the compressed frames of its parts.

    Parameters
    ----------
    parts
        Files of `Encoder`, and how many frames to take of each.
    file
        To be written, under a name that is not yet the video's.
    target
        The video: its suffix says the container, and messages name it.
    rate
        Frames a second.
    check
        Called for every frame; what it raises ends the writing.
    """
    step = 1 / _fraction(rate)
    frames = 0
    with _named(target), av.open(_name(file), "w", format=_format(target)) as container:
        stream = None
        for path, count in parts:
            with av.open(_name(path)) as part:
                source = part.streams.video[0]
                if stream is None:
                    # By its settings: a stream made after a template has no rate, which readers
                    # then guess.
                    stream = _added(container, target, rate)
                    stream.width, stream.height = source.width, source.height
                    stream.pix_fmt = source.pix_fmt
                    container.start_encoding()
                if source.codec_context.extradata != stream.codec_context.extradata:
                    raise OSError(f"{path}: coded otherwise than {target.name} would be now")
                for packet in _packets(part, count):
                    check()
                    packet.stream = stream
                    packet.time_base = step
                    packet.pts = packet.dts = frames
                    packet.duration = 1
                    container.mux(packet)
                    frames += 1
    _check_count(file, sum(count for _, count in parts), target)


def _name(path: Path) -> str:
    """A name that FFmpeg takes for a file: ``a:b.mkv`` alone would be of a protocol ``a``."""
    return str(path.absolute())


def _added(container: av.container.OutputContainer, target: Path, rate: float) -> av.VideoStream:
    """A new stream of frames as the target holds them; size and pixels are still to be set."""
    _, codec, _, options = _KINDS[target.suffix.lower()]
    stream = container.add_stream(codec, rate=_fraction(rate), options=options)
    assert isinstance(stream, av.VideoStream)
    stream.codec_context.thread_type = "SLICE"
    return stream


def _format(target: Path) -> str:
    return _KINDS[target.suffix.lower()][0]


def _packets(container: av.container.InputContainer, count: int) -> Iterator[av.Packet[Any]]:
    """The first compressed frames of a file, in order."""
    for packet in container.demux(video=0):
        if packet.size and count > 0:
            count -= 1
            yield packet


def _check_count(path: Path, frames: int, target: Path) -> None:
    """Raise OSError if fewer frames arrived on the disk."""
    try:
        with _named(target), av.open(_name(path)) as container:
            found = sum(1 for _ in _packets(container, frames))
    except (OSError, ValueError) as error:
        raise OSError(f"{target}: could not be written: {error}") from None
    if found < frames:
        raise OSError(
            f"{target}: {found} of {frames} frames could be written; is there space on the disk?"
        )


@contextlib.contextmanager
def _named(target: Path) -> Iterator[None]:
    """FFmpeg's errors as OSError with the file the user knows."""
    try:
        yield
    except av.FFmpegError as error:
        raise OSError(error.errno, error.strerror, str(target)) from None


def _fraction(rate: float) -> Fraction:
    """A rate whose time base MPEG-4 can hold: both terms fit 16 bits."""
    rate = min(max(rate, 0.01), 65535.0)
    return Fraction(rate).limit_denominator(min(1001, int(65535 / rate)))
