"""Two streams as the arguments of the commands name them, paired."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from .._core import OffsetEstimate, Pairs, oriented
from ..depth import (
    DEPTH_SUFFIXES,
    Depth,
    DepthProvider,
    DepthUnits,
    MeasuredDepth,
    NetworkOptions,
    PlaneDepth,
    WrappedDepth,
    open_depth,
)
from ..depth.measured import DISPARITY
from ..depth.points import POINT_SUFFIXES
from ..frames import Image, InputError, list_files
from .bag import BagImages, one_clock
from .depth_topic import TopicDepth, is_depth_topic
from .pairing import match_depth_stream, match_depths
from .sources import open_stream, open_two
from .stream import Stream


@dataclass(frozen=True)
class Matching:
    """How to pair two streams: the arguments of `pair_streams`, and where times come from."""

    method: str = "auto"
    time_offset: float | None = 0.0
    """By how much the source's clock is late [s]; None: estimated from the footage."""
    max_gap: float | None = None
    """Largest distance of a pair in time [s]; None: half the slower stream's period."""
    reference_times: Path | None = None
    """Table of `read_times`; None: what the stream itself says."""
    source_times: Path | None = None
    frame_offset: int = 0
    """By how many of its frames the source is late beyond `time_offset`."""
    exif_orientation: str = "ignore"
    """What of image files that say how their picture is to be turned: ``ignore`` or ``apply``."""


@dataclass(frozen=True)
class PickedDepth(WrappedDepth):
    """Depth of some frames of a stream."""

    indices: list[int]

    def __call__(self, index: int, reference: Image) -> Depth:
        return self.provider(self.indices[index], reference)

    @property
    def looks_at_reference(self) -> bool:
        return self.provider.looks_at_reference

    def files_of(self, index: int) -> list[Path]:
        return self.provider.files_of(self.indices[index])


def open_pairs(
    reference: str | Path,
    source: str | Path,
    matching: Matching | None = None,
    estimate: OffsetEstimate | None = None,
) -> Pairs:
    """Open and pair what REFERENCE and SOURCE name, see `Pairs`."""
    m = matching or Matching()
    references, sources = open_two(reference, source)
    one_clock(references, sources)
    if m.exif_orientation == "apply":
        references, sources = oriented(references), oriented(sources)
    return Pairs(
        references,
        sources,
        m.method,
        m.time_offset,
        m.max_gap,
        m.reference_times,
        m.source_times,
        estimate,
        m.frame_offset,
    )


def open_matched_depth(
    references: Stream,
    used: list[int],
    spec: str,
    units: DepthUnits | None = None,
    plane: PlaneDepth | None = None,
    network: NetworkOptions | None = None,
    measured: MeasuredDepth | None = None,
) -> DepthProvider:
    """Depth of the frames ``used`` of the references, see `open_depth`: of a folder the files that
    `match_depths` finds, of a bag's topic the frames that `match_depth_stream` does.
    """
    folder = Path(spec.removeprefix(DISPARITY))
    if is_depth_topic(spec):
        stream = open_stream(spec)
        if isinstance(references, BagImages) and isinstance(stream, BagImages):
            if references.clock not in ("", *stream.clocks):
                raise InputError(
                    f"{spec}: the reference frames go by {references.clock}, which the depth topic"
                    f" cannot: its header stamps {stream.flaws}; expected one clock"
                )
            stream.use_clock(references.clock)
        matched = match_depth_stream(references, used, stream)
        measured = measured or MeasuredDepth()
        provider = measured.open(spec, []) or TopicDepth(stream, units)
        return PickedDepth(measured.conditioned(provider), matched)
    given = units, plane, network, measured
    if spec == "plane" or not folder.is_dir():
        paths = [Path(f"{references.name(index)}.png") for index in range(len(references))]
        provider = open_depth(spec, getattr(references, "paths", paths), *given)
        return PickedDepth(provider, used)
    scans = measured is not None and measured.lidar_calibration is not None
    files = list_files(folder, POINT_SUFFIXES if scans else DEPTH_SUFFIXES)
    matched = match_depths(references, used, files)
    return PickedDepth(open_depth(spec, files, *given), matched)
