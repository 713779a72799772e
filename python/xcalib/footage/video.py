"""Video files, through OpenCV and the FFmpeg inside it."""

from __future__ import annotations

import os
from pathlib import Path

import cv2
import numpy as np

from .._core import video_line
from ..frames import DecodeError, Image, InputError, quiet_opencv
from ..progress import Lines
from .stream import Stream

VIDEO_SUFFIXES = (".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".ts", ".wmv")

# FFmpeg's own words on a bad file would come between our one line and its reader.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")

# Formats that OpenCV hands out as they are stored. All others it converts to 8-bit colour.
_GRAY_FORMATS = (b"Y800", b"GREY", b"Y1\x00\x10")


class Video(Stream):
    """A video: 8-bit colour ``(H, W, 3)``; or gray, 8 or 16 bit, ``(H, W)``, from codecs with it.

    Opening reads the file once, without converting pixels, for the number of frames and the time
    of each. Frames come by decoding on; what lies elsewhere by seeking, believed only if the
    frame that comes has the time of the one wanted, else by decoding from the start.
    """

    FEW = 64
    """Frames ahead that are reached by decoding on rather than by seeking."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self._capture = self._open()
        format_code = int(self._capture.get(cv2.CAP_PROP_CODEC_PIXEL_FORMAT)) & 0xFFFFFFFF
        self._gray = format_code.to_bytes(4, "little") in _GRAY_FORMATS
        announced = int(self._capture.get(cv2.CAP_PROP_FRAME_COUNT))
        times: list[float] = []
        lines = Lines()
        while self._capture.grab():
            times.append(self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3)
            lines.say(f"counting the frames of {path}", f"{len(times)} of about {announced}")
        rate = self._capture.get(cv2.CAP_PROP_FPS)
        self.said = video_line(str(path), times, announced, rate)
        self.frame_times = np.array(times)
        rising = bool((np.diff(self.frame_times) > 0).all())
        self.times = self.frame_times if rising else None
        self._restart()
        self._last: tuple[int, Image] | None = None

    def _open(self) -> cv2.VideoCapture:
        with quiet_opencv():
            capture = cv2.VideoCapture(str(self.path), cv2.CAP_FFMPEG)
        if not capture.isOpened():
            raise InputError(f"{self.path}: cannot decode frame 0, truncated or not a video")
        # As with images: the geometry is that of the sensor, whatever a tag says of turning it.
        capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        return capture

    def _restart(self) -> None:
        self._capture.release()
        self._capture = self._open()
        if self._gray:
            self._capture.set(cv2.CAP_PROP_CONVERT_RGB, 0)
        self._next = 0

    def __len__(self) -> int:
        return len(self.frame_times)

    def read(self, index: int) -> Image:
        # Two halves, or a slower partner, ask for the same frame again.
        if self._last is None or self._last[0] != index:
            self._last = index, self._decode(index)
        return self._last[1].copy()

    def _decode(self, index: int) -> Image:
        if not (0 <= index - self._next <= self.FEW or self._seek(index)):
            self._restart()
        while self._next <= index:
            if not self._capture.grab():
                self._next = len(self)  # nowhere known: the next frame is sought anew
                raise DecodeError(f"{self.where(index)}: cannot decode, truncated or changed")
            self._next += 1
        done, image = self._capture.retrieve()
        if not done:
            raise DecodeError(f"{self.where(index)}: cannot decode")
        return np.ascontiguousarray(image)

    def _seek(self, index: int) -> bool:
        """Go to before a frame; False where the file does not lead there."""
        if self.times is None or index == 0:
            return False
        # To the frame before it: the time of the frame grabbed there shows where we are.
        self._capture.set(cv2.CAP_PROP_POS_FRAMES, index - 1)
        if not self._capture.grab():
            return False
        time = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        self._next = index
        return bool(abs(time - self.times[index - 1]) < 1e-6)

    def name(self, index: int) -> str:
        return f"{index:06d}"

    def where(self, index: int) -> str:
        return f"{self.path} frame {index}"

    def file(self, index: int) -> Path:
        return self.path
