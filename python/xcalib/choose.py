"""Which frames to calibrate on: those that together determine the rig best, see `Choice`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from ._core import CalibrationOptions, Candidate, Choice, choose, frames_to_look_at, look_at
from .frames import DecodeError, Image, InputError

__all__ = ["Candidate", "Choice", "choose_frames", "choose_informed"]

Floats = NDArray[np.float32]
Read = Callable[[int], tuple[Image, Image, Floats | None]]
"""Reference, source and depth (None: not known, or too expensive to ask for) of one frame."""


def choose_frames(
    references: Sequence[Image],
    sources: Sequence[Image],
    depths: Sequence[Floats] | None = None,
    max_frames: int = CalibrationOptions().max_frames,
    seed: int = CalibrationOptions().seed,
) -> Choice:
    """The frames to give to `calibrate`: those that together determine the rig best.

    >>> chosen = choose_frames(visible, thermal, depths).indices
    >>> given = ([images[i] for i in chosen] for images in (visible, thermal, depths))
    >>> result = calibrate(*given)

    Parameters
    ----------
    references, sources
        Images in any form that `calibrate` takes, in sequences of one length. At most
        ``4 * max_frames`` of each are looked at, one by one and none is kept, so that a sequence
        may read or render its images when they are asked for, as `footage.Stream` does.
    depths
        Depth maps ``(h, w)`` float32 [m] of the references; None leaves depth out of the choice.
    max_frames
        Frames wanted, at least 1.
    seed
        Draws the frames that are looked at.

    Returns the choice: ``indices``, rising, and ``candidates`` with what became of each frame.

    Raises
    ------
    InputError
        Sequences of different lengths, no frames, images of one camera that differ in size, or
        ``max_frames`` below 1.
    """
    count = len(references)
    counts = [len(items) for items in (references, sources, depths) if items is not None]
    if not count or set(counts) != {count}:
        raise InputError(
            f"references, sources and depths are {', '.join(map(str, counts))} frames,"
            " expected as many of each, at least 1"
        )
    if max_frames < 1:
        raise InputError(f"max_frames is {max_frames}, expected at least 1")

    shapes: list[tuple[int, ...]] = []

    def read(index: int) -> tuple[Image, Image, Floats | None]:
        images = references[index], sources[index]
        for name, image, first in zip(("reference", "source"), images, shapes, strict=False):
            if image.shape[:2] != first:
                raise InputError(
                    f"{name} {index} has shape {image.shape}, expected {first} as those before it"
                )
        shapes[:] = [image.shape[:2] for image in images]
        return *images, None if depths is None else depths[index]

    return choose_informed(count, max_frames, seed, read)


def choose_informed(
    count: int,
    max_frames: int,
    seed: int,
    read: Read,
    watch: Callable[[list[int]], Iterator[int]] = iter,
) -> Choice:
    """Choose at most ``max_frames`` of ``count`` frames by how well they determine the rig.

    Parameters
    ----------
    count, max_frames
        Frames in the footage, frames wanted; at least 1.
    seed
        Draws the candidates: one of each of ``4 * max_frames`` equal parts.
    read
        Called with the index of each candidate once, in order. A `frames.DecodeError` it raises
        leaves the frame out; other errors pass through.
    watch
        Hands on the indices of the candidates as they are read, for a progress bar.

    Returns the choice; without a usable frame it is empty.
    """
    drawn = frames_to_look_at(count, max_frames, seed)
    return choose([_candidate(index, read) for index in watch(drawn)], max_frames)


def _candidate(index: int, read: Read) -> Candidate:
    try:
        return look_at(index, *read(index))
    except DecodeError as error:
        return Candidate(index, str(error))
