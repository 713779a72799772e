"""Two streams as the arguments of the commands name them, paired."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .._core import Rig
from ..depth import (
    DEPTH_SUFFIXES,
    PNG_SCALE,
    Depth,
    DepthProvider,
    MeasuredDepth,
    NetworkOptions,
    PlaneDepth,
    WrappedDepth,
    open_depth,
)
from ..depth.points import POINT_SUFFIXES
from ..frames import Image, InputError, list_files
from .depth_topic import TopicDepth, is_depth_topic
from .offset import (
    OffsetEstimate,
    RefinedOffset,
    estimate_offset,
    offsets_around,
    refine_offset,
)
from .pairing import Pairing, match_depth_stream, match_depths, pair_streams
from .sources import open_stream
from .stream import Picked, Stream
from .times import read_times


@dataclass(frozen=True)
class Matching:
    """How to pair two streams: the arguments of `pair_streams`, and where times come from."""

    method: str = "auto"
    time_offset: float | None = 0.0
    """By how much the source's clock is late [s]; None: estimated from the footage."""
    max_gap: float | None = None
    """Largest distance of a pair in time [s]; None: half the slower stream's period."""
    reference_times: Path | None = None
    """Table of `read_times`; None: what the stream itself tells."""
    source_times: Path | None = None


@dataclass(frozen=True)
class PickedDepth(WrappedDepth):
    """Depth of some frames of a stream."""

    indices: list[int]

    def __call__(self, index: int, reference: Image) -> Depth:
        return self.provider(self.indices[index], reference)

    def files_of(self, index: int) -> list[Path]:
        return self.provider.files_of(self.indices[index])


@dataclass(frozen=True)
class Pairs:
    """Two streams and which of their frames belong together."""

    all_references: Stream
    all_sources: Stream
    pairing: Pairing
    notes: tuple[str, ...]
    """What the user should know, a line each."""
    matching: Matching = Matching()
    estimate: OffsetEstimate | None = None
    """Of the clock offset, where that was asked for."""

    @property
    def references(self) -> Stream:
        """The reference frames that have a partner."""
        return _picked(self.all_references, self.pairing.references)

    @property
    def sources(self) -> Stream:
        """Their partners, in the same order."""
        return _picked(self.all_sources, self.pairing.sources)

    def refined(self, rig: Rig, open_depth: Callable[[Pairs], DepthProvider]) -> Pairs:
        """Paired anew with the offset at which frames register best with the rig, `refine_offset`.

        ``open_depth`` gives the depth of the `references` of pairs. Without an estimated offset
        the pairs stay as they are, and so they do where the registered frames tell neither around
        the estimate nor around 0.
        """
        if self.estimate is None:
            return self
        found = self._refined(self.estimate.peak, rig, open_depth)
        if not found.told and self.estimate.offset:
            # A peak elsewhere may be as high, and most clocks are meant to agree.
            again = self._refined(0.0, rig, open_depth)
            found = again if again.told else found
        notes = [f"clock offset: {found.line()}"]
        if self.estimate.trusted or not found.told:
            notes.insert(0, self.notes[0])
        pairing = self.pairing
        if found.told:
            streams = self.all_references, self.all_sources
            pairing = pair_streams(*streams, "time", found.offset, self.matching.max_gap)
        return replace(self, pairing=pairing, notes=(*notes, f"frames: {pairing.line()}"))

    def _refined(
        self, guess: float, rig: Rig, open_depth: Callable[[Pairs], DepthProvider]
    ) -> RefinedOffset:
        streams = self.all_references, self.all_sources
        candidates = offsets_around(guess, *streams)
        wide, depth = self, None
        if len(self.all_references) > len(self.all_sources):
            # The neighbours of a paired reference tell too, if there is depth of them.
            with contextlib.suppress(InputError):
                pairings = [pair_streams(*streams, "time", offset) for offset in candidates]
                every = np.unique(np.concatenate([found.references for found in pairings]))
                wide = replace(self, pairing=Pairing("time", every.tolist(), []))
                depth = open_depth(wide)
        if depth is None:
            wide, depth = self, open_depth(self)
        return refine_offset(rig, wide.references, self.all_sources, depth, candidates)

    def open_depth(
        self,
        spec: str,
        scale: float = PNG_SCALE,
        plane: PlaneDepth | None = None,
        network: NetworkOptions | None = None,
        measured: MeasuredDepth | None = None,
    ) -> DepthProvider:
        """Depth of `references`: of a folder the files that `match_depths` finds, of a bag's topic
        the frames that `match_depth_stream` does.
        """
        used, folder = self.pairing.references, Path(spec)
        if is_depth_topic(spec):
            stream = open_stream(spec)
            matched = match_depth_stream(self.all_references, used, stream)
            measured = measured or MeasuredDepth()
            provider = measured.open(spec, []) or TopicDepth(stream)
            return PickedDepth(measured.conditioned(provider), matched)
        given = scale, plane, network, measured
        if spec == "plane" or not folder.is_dir():
            stream = self.all_references
            paths = [Path(f"{stream.name(index)}.png") for index in range(len(stream))]
            provider = open_depth(spec, getattr(stream, "paths", paths), *given)
            return PickedDepth(provider, used.tolist())
        scans = measured is not None and measured.lidar_calibration is not None
        files = list_files(folder, POINT_SUFFIXES if scans else DEPTH_SUFFIXES)
        matched = match_depths(self.all_references, used, files)
        return PickedDepth(open_depth(spec, files, *given), matched)


def _picked(stream: Stream, indices: NDArray[np.intp]) -> Stream:
    chosen = indices.tolist()
    return stream if chosen == list(range(len(stream))) else Picked(stream, chosen)


def open_pairs(
    reference: str | Path, source: str | Path, matching: Matching | None = None
) -> Pairs:
    """Open and pair what REFERENCE and SOURCE name; nothing but times is read, save that an
    offset to be estimated needs the frames.
    """
    matching = matching or Matching()
    streams = open_stream(reference), open_stream(source)
    for stream, table in zip(
        streams, (matching.reference_times, matching.source_times), strict=True
    ):
        if table is not None:
            stream.times = read_times(table, stream)
    notes: list[str] = []
    offset, estimate = matching.time_offset, None
    if offset is None:
        if matching.method not in ("auto", "time"):
            raise InputError(
                f"a clock offset needs frames paired by time; they are by {matching.method}"
            )
        estimate = estimate_offset(*streams)
        notes.append(f"clock offset: {estimate.line()}")
        offset = estimate.offset
    pairing = pair_streams(*streams, matching.method, offset, matching.max_gap)
    if pairing.method == "time":
        notes.append(f"frames: {pairing.line()}")
    return Pairs(*streams, pairing, tuple(notes), matching, estimate)
