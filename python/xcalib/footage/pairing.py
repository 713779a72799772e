"""Which frame of the one stream belongs to which of the other."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..frames import InputError, pair
from .files import ImageFiles
from .stream import Stream, Times

METHODS = ("auto", "name", "order", "time")


@dataclass(frozen=True)
class Pairing:
    """Indices into both streams, (N,) each and rising, and how they were found."""

    method: str
    """name, order or time."""
    references: NDArray[np.intp]
    sources: NDArray[np.intp]
    dropped: tuple[int, int] = (0, 0)
    """Frames of either stream without a partner."""
    gap: float = 0.0
    """Median distance in time, the offset allowed for [s]."""
    offset: float = 0.0
    """By how much the source's clock is late [s]."""

    def line(self) -> str:
        """What happened, in one line."""
        text = f"{len(self.references)} pairs by {self.method}"
        if self.method == "time":
            text += (
                f" (median gap {1e3 * self.gap:.1f} ms, source late by {self.offset:+.4f} s);"
                f" without a partner: {self.dropped[0]} reference,"
                f" {self.dropped[1]} source frames"
            )
        return text


def pair_streams(
    references: Stream,
    sources: Stream,
    method: str = "auto",
    offset: float = 0.0,
    max_gap: float | None = None,
) -> Pairing:
    """Pair two streams.

    Parameters
    ----------
    method
        ``name``: files by `frames.pair`. ``order``: first with first, of equally many. ``time``:
        `pair_times`. ``auto``: by time where both have times; else files by name, and other
        streams by order.
    offset
        By how much the source's clock is late [s]: reference time t is source time t + offset.
        Not 0: by time.
    max_gap
        Largest distance of a pair in time [s]; by default half the slower stream's period.
    """
    if method not in METHODS:
        raise InputError(f"pairing is {method!r}, expected one of {', '.join(METHODS)}")
    timed = references.times is not None and sources.times is not None
    if method == "auto":
        files = isinstance(references, ImageFiles) and isinstance(sources, ImageFiles)
        method = "time" if timed else "name" if files else "order"
    if offset and method != "time":
        raise InputError(
            f"a clock offset of {offset:g} s needs frames paired by time; they are by {method}"
        )
    if method == "time":
        for what, stream in (("reference", references), ("source", sources)):
            if stream.times is None:
                raise InputError(
                    f"{stream.where(0)}: the {what} frames have no times that rise; expected"
                    " them in the file names, in timestamps.csv, or in a video or bag"
                )
        assert references.times is not None and sources.times is not None
        return pair_times(references.times, sources.times, offset, max_gap)
    if method == "name":
        if not (isinstance(references, ImageFiles) and isinstance(sources, ImageFiles)):
            raise InputError("pairing by name needs two folders of images; expected order or time")
        partner = {path: index for index, path in enumerate(sources.paths)}
        pairs = pair(references.paths, sources.paths)
        indices = np.array([partner[second] for _, second in pairs], np.intp)
        return Pairing("name", np.arange(len(pairs), dtype=np.intp), indices)
    if len(references) != len(sources):
        raise InputError(
            f"{references.where(0)} is the first of {len(references)} frames,"
            f" {sources.where(0)} of {len(sources)}; expected as many, or times to pair them by"
        )
    every = np.arange(len(references), dtype=np.intp)
    return Pairing("order", every, every)


def median_period(times: Times) -> float:
    """Median distance of frames [s]; 0 for a single one."""
    return float(np.median(np.diff(times))) if len(times) > 1 else 0.0


def pair_times(
    references: Times, sources: Times, offset: float = 0.0, max_gap: float | None = None
) -> Pairing:
    """Pair nearest times, one to one and in order, at most ``max_gap`` apart [s].

    The frames of the stream with fewer of them choose, one after the other, among the frames
    behind the last one chosen. By default ``max_gap`` is half the larger median period.
    """
    if max_gap is None:
        max_gap = max(median_period(references), median_period(sources)) / 2 or 0.5
    if not max_gap > 0:
        raise InputError(f"largest gap is {max_gap:g} s, expected above 0")
    shifted = sources - offset
    swapped = len(references) > len(shifted)
    few, many = (shifted, references) if swapped else (references, shifted)
    # Half a period apart, rounding must not decide.
    limit = max_gap * (1 + 1e-6)
    chosen: list[tuple[int, int]] = []
    first = 0
    for index, time in enumerate(few):
        at = first + int(np.searchsorted(many[first:], time))
        near = [k for k in (at - 1, at) if first <= k < len(many)]
        best = min(near, key=lambda k: abs(many[k] - time), default=None)
        if best is not None and abs(many[best] - time) <= limit:
            chosen.append((index, best))
            first = best + 1
    if not chosen:
        spans = (references[0], references[-1], shifted[0], shifted[-1])
        raise InputError(
            "no two frames are within {:g} s: reference times are {:.3f} to {:.3f} s, source times"
            " {:.3f} to {:.3f} s; expected one clock, or --pair order".format(max_gap, *spans)
        )
    pairs = np.array(chosen, np.intp)
    ours, theirs = (pairs[:, 1], pairs[:, 0]) if swapped else (pairs[:, 0], pairs[:, 1])
    return Pairing(
        "time",
        ours,
        theirs,
        (len(references) - len(pairs), len(shifted) - len(pairs)),
        float(np.median(np.abs(references[ours] - shifted[theirs]))),
        offset,
    )


def match_depths(
    references: Stream, used: NDArray[np.intp], depths: list[Path], folder: Path
) -> list[int]:
    """The depth file of each reference frame in use: indices into ``depths``.

    Files under the names of the frames are theirs, and others are left over. Else the nearest in
    time within half a period of the references, where both tell it; else by `frames.pair`, of all
    reference frames or of those in use.
    """
    own = {path.stem: index for index, path in enumerate(depths)}
    names = [references.name(int(index)) for index in used]
    if len(own) == len(depths) and all(name in own for name in names):
        return [own[name] for name in names]
    times = ImageFiles(depths).times
    if references.times is not None and times is not None:
        return _nearest_depths(references, used, times, str(folder))
    everything = len(depths) == len(references)
    picked = range(len(references)) if everything else [int(index) for index in used]
    stand_ins = [
        references.paths[index]
        if isinstance(references, ImageFiles)
        else Path(f"{references.where(0).rpartition(' frame ')[0]}/{references.name(index)}.png")
        for index in picked
    ]
    index_of = {path: index for index, path in enumerate(depths)}
    matched = [index_of[depth] for _, depth in pair(stand_ins, depths)]
    return [matched[int(index)] for index in used] if everything else matched


def match_depth_stream(references: Stream, used: NDArray[np.intp], depths: Stream) -> list[int]:
    """The frame of a stream of depth for each reference frame in use.

    The nearest in time within half a period of the references, where both tell it; else in order,
    of as many as all reference frames or those in use.
    """
    if references.times is not None and depths.times is not None:
        return _nearest_depths(references, used, depths.times, depths.where(0))
    if len(depths) == len(references):
        return [int(index) for index in used]
    if len(depths) == len(used):
        return list(range(len(used)))
    raise InputError(
        f"{depths.where(0)} is the first of {len(depths)} depth maps, {references.where(0)} of"
        f" {len(references)} reference frames; expected as many, or times of both"
    )


def _nearest_depths(
    references: Stream, used: NDArray[np.intp], depths: Times, where: str
) -> list[int]:
    assert references.times is not None
    times = references.times[used]
    found = pair_times(times, depths, 0.0, median_period(references.times) / 2 or None)
    if len(found.references) < len(times):
        lost = sorted(set(range(len(times))) - set(found.references.tolist()))[0]
        raise InputError(
            f"{where}: no depth map near the time of {references.where(int(used[lost]))},"
            f" {times[lost]:.6f} s"
        )
    return [int(index) for index in found.sources]
