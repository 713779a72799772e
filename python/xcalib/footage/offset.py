"""By how much one camera's clock is late: the core's estimates, on streams."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .._core import OffsetEstimate, RefinedOffset, RegisteredNec, Rig, motion_edges
from ..depth import Depth, DepthProvider
from ..frames import DecodeError, Image, InputError
from .stream import Stream

__all__ = ["OffsetEstimate", "RefinedOffset", "estimate_offset", "offsets_around", "refine_offset"]


def estimate_offset(
    references: Stream, sources: Stream, max_offset: float = 2.0, max_frames: int = 1500
) -> OffsetEstimate:
    """Estimate a constant offset between the clocks of two streams, neither registered.

    Parameters
    ----------
    references, sources
        Both with times.
    max_offset
        The largest offset looked for, either way [s]; also at most a third of the footage.
    max_frames
        References read at most, from the middle of the footage.

    Raises
    ------
    InputError
        Without times, or where they do not overlap.
    """
    return _core.estimate_offset(
        *_times(references, sources), _edges(references), _edges(sources), max_offset, max_frames
    )


def _times(references: Stream, sources: Stream) -> tuple[list[float], list[float]]:
    if references.times is None or sources.times is None:
        raise InputError("a clock offset needs times of both streams' frames; expected them")
    return references.times.tolist(), sources.times.tolist()


def _edges(stream: Stream) -> Callable[[int], NDArray[np.float32] | None]:
    def edges(index: int) -> NDArray[np.float32] | None:
        try:
            image = stream[index]
        except DecodeError:
            return None
        return motion_edges(image)

    return edges


def offsets_around(guess: float, references: Stream, sources: Stream) -> list[float]:
    """Candidates for `refine_offset`: 6 frames of the faster stream either way, in quarters [s]."""
    return _core.offsets_around(guess, *_times(references, sources))


def refine_offset(
    rig: Rig,
    references: Stream,
    sources: Stream,
    depth: DepthProvider,
    candidates: Sequence[float],
    max_frames: int = 12,
) -> RefinedOffset:
    """Choose among candidate offsets by how well the frames register with a rig.

    Of the candidates that differ from the best by less than the frames do among each other (two
    standard errors of the mean), the one nearest to the middle is taken: the guess, unless the
    frames speak against it. Those that pair the same frames score the same.

    Parameters
    ----------
    rig
        The calibration; rescaled to the frames.
    references, sources
        Both with times.
    depth
        Of the reference frames.
    candidates
        Offsets [s], rising, around a guess in their middle.
    max_frames
        Frames of the slower stream judged, spread over the footage; the same ones for every
        candidate. Those with an image that cannot be decoded are left out.

    Raises
    ------
    InputError
        Without candidates or times.
    """
    judge = RegisteredNec(rig)
    last: tuple[int, Image, Depth] | None = None

    def score(index: int, other: int) -> float | None:
        nonlocal last
        try:
            if last is None or last[0] != index:
                image = references[index]
                last = index, image, depth(index, image)
            return judge(last[1], sources[other], last[2])
        except DecodeError:
            return None

    return _core.refine_offset(*_times(references, sources), list(candidates), score, max_frames)
