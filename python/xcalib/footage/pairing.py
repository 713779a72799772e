"""Which frame of the one stream belongs to which of the other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import (
    FrameList,
    Pairing,
    _option_words,
    nearest_depths,
    pair_frames,
    pair_times,
)
from .._core import match_depths as match_depth_lists
from .._core import median_period as median_of_steps
from ..frames import InputError
from .files import ImageFiles
from .stream import Stream, Times

__all__ = [
    "METHODS",
    "Pairing",
    "match_depth_stream",
    "match_depths",
    "median_period",
    "pair_streams",
    "pair_times",
]

METHODS = _option_words()["pair"]


def frame_list(stream: Stream) -> FrameList:
    """The frames of a stream without their pixels."""
    indices = range(len(stream))
    return FrameList(
        [stream.name(index) for index in indices],
        [stream.where(index) for index in indices],
        stream.paths if isinstance(stream, ImageFiles) else [],
        None if stream.times is None else stream.times.tolist(),
    )


def pair_streams(
    references: Stream,
    sources: Stream,
    method: str = "auto",
    offset: float = 0.0,
    max_gap: float | None = None,
) -> Pairing:
    """Pair two streams, see `pair_frames`."""
    return pair_frames(frame_list(references), frame_list(sources), method, offset, max_gap)


def median_period(times: Times) -> float:
    """Median distance of frames [s]; 0 for a single one."""
    return median_of_steps(times.tolist())


def match_depths(references: Stream, used: NDArray[np.intp], depths: list[Path]) -> list[int]:
    """The depth file of each reference frame in use: indices into ``depths``."""
    return match_depth_lists(frame_list(references), used.tolist(), frame_list(ImageFiles(depths)))


def match_depth_stream(references: Stream, used: NDArray[np.intp], depths: Stream) -> list[int]:
    """The frame of a stream of depth for each reference frame in use.

    The nearest in time within half a period of the references, where both tell it; else in order,
    of as many as all reference frames or those in use.
    """
    if references.times is not None and depths.times is not None:
        times = depths.times.tolist()
        return nearest_depths(frame_list(references), used.tolist(), times, depths.where(0))
    if len(depths) == len(references):
        return [int(index) for index in used]
    if len(depths) == len(used):
        return list(range(len(used)))
    raise InputError(
        f"{depths.where(0)} is the first of {len(depths)} depth maps, {references.where(0)} of"
        f" {len(references)} reference frames; expected as many, or times of both"
    )
