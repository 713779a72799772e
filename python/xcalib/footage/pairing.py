"""Which frame of the one stream belongs to which of the other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .. import _core
from .._core import Pairing, nearest_depths, pair_streams, pair_times
from ..frames import InputError
from .files import ImageFiles
from .stream import Stream

__all__ = [
    "METHODS",
    "Pairing",
    "match_depth_stream",
    "match_depths",
    "pair_streams",
    "pair_times",
]

METHODS = _core._option_words()["pair"]


def match_depths(references: Stream, used: Sequence[int], depths: list[Path]) -> list[int]:
    """The depth file of each reference frame in use: indices into ``depths``."""
    return _core.match_depths(references, used, ImageFiles(depths))


def match_depth_stream(references: Stream, used: Sequence[int], depths: Stream) -> list[int]:
    """The frame of a stream of depth for each reference frame in use.

    The nearest in time within half a period of the references, where both tell it; else in order,
    of as many as all reference frames or those in use.
    """
    if references.times is not None and depths.times is not None:
        return nearest_depths(references, used, depths)
    if len(depths) == len(references):
        return list(used)
    if len(depths) == len(used):
        return list(range(len(used)))
    raise InputError(
        f"{depths.where(0)} is the first of {len(depths)} depth maps, {references.where(0)} of"
        f" {len(references)} reference frames; expected as many, or times of both"
    )
