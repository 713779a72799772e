"""Registered frames as pictures in which alignment can be seen: images, a video, or a recording."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from ._core import Registrar, Rig, is_video, keep_file
from .footage.encoder import Encoder, join
from .frames import Image, InputError, encode_image, size_of, write_bytes
from .overlays import KINDS, Picture, colour, false_colour
from .pipeline import Frames


@dataclass(frozen=True)
class Registered:
    """A frame, and its source on its pixels."""

    name: str
    time: float
    """[s]"""
    reference: Image
    image: Image
    mask: Image
    """Codes: 0 valid."""

    def overlay(self, kind: str) -> Picture:
        """Both in one picture, one of `overlays.KINDS`, or `side`: beside each other."""
        valid = (self.mask == 0).astype(np.uint8)
        if kind == "side":
            return np.hstack([colour(self.reference), false_colour(self.image)])
        return KINDS[kind](self.reference, self.image, valid)


def registered(frames: Frames, rig: Rig, threads: int) -> Iterator[Registered]:
    """All frames, one by one."""
    registrar = Registrar(frames.fit(rig), threads)
    times = frames.references.times
    for index in range(len(frames)):
        reference, source, depth = frames.read(index)
        image, mask = registrar.register(source, depth)
        time = index / rate_of(frames) if times is None else float(times[index])
        yield Registered(frames.references.name(index), time, reference, image, mask)


def rate_of(frames: Frames) -> float:
    """Frames a second of the references; 10 where they have no times."""
    times = frames.references.times
    if times is None or len(times) < 2:
        return 10.0
    step = float(np.median(np.diff(times)))
    return 1 / step if step > 0 else 10.0


def write_view(frames: Iterator[Registered], rate: float, kind: str, output: Path) -> int:
    """Write overlays: a folder of images under the references' names, or a video; returns how many
    there are. A video appears under its name when it is whole.
    """
    if not is_video(output):
        count = 0
        for frame in frames:
            path = output / f"{Path(frame.name).stem}.png"
            write_bytes(path, encode_image(path, frame.overlay(kind)))
            count += 1
        return count
    output.parent.mkdir(parents=True, exist_ok=True)
    with (
        tempfile.TemporaryDirectory(dir=output.parent, prefix=".xcalib-view-") as folder,
        ExitStack() as stack,
    ):
        part, whole = Path(folder) / "part.mkv", Path(folder) / f"whole{output.suffix}"
        encoder: Encoder | None = None
        count = 0
        for frame in frames:
            picture = even(frame.overlay(kind))
            if encoder is None:
                encoder = Encoder(part, output, picture, rate)
                stack.callback(encoder.end)
                size = size_of(picture)
            if size_of(picture) != size:
                raise InputError(f"{frame.name}: is of another size than the frames before it")
            encoder.write(picture)
            count += 1
        assert encoder is not None
        encoder.close(count)
        join([(part, count)], whole, output, rate, lambda: None)
        keep_file(whole, output)
        os.chmod(output, 0o644)
    return count


def even(picture: Picture) -> Picture:
    """Of even sides, which the codecs of .mp4 want."""
    height, width = picture.shape[:2]
    bottom, right = height % 2, width % 2
    padded = cv2.copyMakeBorder(picture, 0, bottom, 0, right, cv2.BORDER_REPLICATE)
    return np.asarray(padded, np.uint8)
