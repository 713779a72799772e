"""From frames on disk to a rig, with progress on stderr; `registration` is what follows."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from ._core import (
    CalibrationOptions,
    CalibrationResult,
    Choice,
    ReadoutFit,
    Rig,
    TimeOffset,
    add_lags,
    calibrate,
    distrust,
    draw_frames,
    fit_readout,
    frames_later,
    frames_to_judge_plane,
    joined_images,
    load_frames,
    look_at_lags,
    orientation_line,
    straightened,
    with_file_name,
)
from .choose import choose_informed
from .depth import ConstantDepth, DepthProvider, FolderDepth, PlaneDepth
from .flow import FlowProvider
from .footage import Picked, Stream, TopicDepth, open_matched_depth, open_pairs
from .footage.bag import clock_line
from .footage.opening import PickedDepth
from .frames import DecodeError, Image, InputError, fit_rig, size_of
from .inputs import Inputs, with_local_names
from .motion import motion_between
from .progress import progress, stages_bar
from .thermal import scalar_sources

READOUT_FRAMES = 12
"""That a readout is found by, at most."""


@dataclass(frozen=True)
class Frames:
    """Paired frames, opened but not read."""

    references: Stream
    sources: Stream
    depth: DepthProvider
    notes: tuple[str, ...] = ()
    """What the pairing by time found, a line each."""
    all_sources: Stream | None = None
    """With those that have no partner; None: not known, `look_at_lags` sees nothing."""
    partners: tuple[int, ...] = ()
    """Of the references, in all sources."""
    offset: TimeOffset | None = None
    """That they were paired with."""
    depth_line: str = ""
    """What the numbers of the depth maps were taken for, in a line, or ''."""

    @staticmethod
    def open(inputs: Inputs, rig: Rig | None = None) -> Frames:
        """Open and pair frames. With a ``rig`` an estimated clock offset is refined, see
        `Pairs.refine`.
        """
        inputs = with_local_names(inputs)
        pairs = open_pairs(inputs.reference, inputs.source, inputs.matching)

        def open_depth(used: list[int]) -> DepthProvider:
            depth = open_matched_depth(
                pairs.all_references,
                used,
                str(inputs.depth),
                inputs.units,
                inputs.plane,
                inputs.network,
                inputs.measured,
            )
            network = depth.relative
            if network is not None and rig is not None:
                network.relative_depth = rig.relative_depth
            return depth

        if rig is not None:
            pairs.refine(rig, open_depth)
        depth = open_depth(pairs.pairing.references.tolist())
        streams = pairs.all_references, pairs.all_sources
        applied = inputs.matching.exif_orientation == "apply"
        opened = [orientation_line(stream, applied) for stream in streams] + [clock_line(*streams)]
        note = misfit(depth, rig) if rig is not None else ""
        notes = tuple(line for line in (*opened, *pairs.notes, note) if line)
        partners = tuple(pairs.pairing.sources.tolist())
        return Frames(
            pairs.references,
            pairs.sources,
            depth,
            notes,
            pairs.all_sources,
            partners,
            pairs.offset,
            depth.line(),
        )

    def __len__(self) -> int:
        return len(self.references)

    def read(self, index: int) -> tuple[Image, Image, NDArray[np.float32]]:
        """Reference, source and depth of one frame."""
        reference = self.references[index]
        return reference, self.sources[index], self.depth(index, reference)

    @property
    def given_depth(self) -> DepthProvider:
        """The provider itself, where `depth` only picks of its frames."""
        return self.depth.provider if isinstance(self.depth, PickedDepth) else self.depth

    def with_scalar_sources(self, colormap: str) -> tuple[Frames, str]:
        """The frames with false-colour sources turned back to numbers, and a line on it or ''."""
        if self.all_sources is None:
            sources, line = scalar_sources(self.sources, colormap)
            return replace(self, sources=sources), line
        every, line = scalar_sources(self.all_sources, colormap)
        if every is self.all_sources:
            return self, line
        return replace(self, sources=Picked(every, self.partners), all_sources=every), line

    def with_straight_rows(
        self, source: float, reference: float, rig: Rig | None, nearest: bool = False
    ) -> Frames:
        """The frames with their sources straightened, see `_core.straightened`."""
        if not source and not reference:
            return self
        assert self.all_sources is not None
        every = straightened(
            self.all_sources, source, reference, rig, motion_between, nearest=nearest
        )
        return replace(self, sources=Picked(every, self.partners), all_sources=every)

    def with_lag(self, lag: int, chosen: Sequence[int]) -> tuple[Frames, list[int]]:
        """The frames with the sources ``lag`` frames later, without those that have none, and the
        indices of the ``chosen`` references in them.
        """
        assert self.all_sources is not None
        kept, partners = frames_later(self.all_sources, self.partners, lag)
        later = replace(
            self,
            references=Picked(self.references, kept),
            sources=Picked(self.all_sources, partners),
            depth=PickedDepth(self.depth, kept),
            partners=tuple(partners),
        )
        return later, [kept.index(index) for index in chosen if index in kept]

    def fit(self, rig: Rig) -> Rig:
        """The rig at the size of these frames, read from the first one."""
        return fit_rig(rig, size_of(self.references[0]), size_of(self.sources[0]))


def misfit(depth: DepthProvider, rig: Rig) -> str:
    """A line where depth and rig do not go together, or ''."""
    relative = depth.relative is not None
    if relative and rig.relative_depth is None:
        return "depth is relative, the rig metric: its scale is guessed for every frame"
    if not relative and rig.relative_depth is not None:
        return "the rig was calibrated with relative depth: metres do not fit its translation"
    return ""


def choose_by_content(frames: Frames, max_frames: int, seed: int, quiet: bool = False) -> Choice:
    """The frames that determine the rig best, see `choose`. Depth counts where it is cheap."""
    cheap = isinstance(frames.given_depth, ConstantDepth | FolderDepth | PlaneDepth | TopicDepth)

    def read(index: int) -> tuple[Image, Image, NDArray[np.float32] | None]:
        if cheap:
            return frames.read(index)
        return frames.references[index], frames.sources[index], None

    def watch(indices: list[int]) -> Iterator[int]:
        return progress(indices, len(indices), "choosing", quiet)

    return choose_informed(len(frames), max_frames, seed, read, watch)


def run_calibration(
    frames: Frames,
    calibration: CalibrationOptions,
    initial: Rig | None = None,
    quiet: bool = False,
    prepare: Callable[[CalibrationOptions, Image, Image], None] | None = None,
    chosen: Sequence[int] | None = None,
    warn: Callable[[str], None] = warnings.warn,
    flow: FlowProvider | None = None,
) -> tuple[CalibrationResult, list[int]]:
    """Load the chosen frames and calibrate; returns the indices of the frames used as well.

    ``prepare`` completes the options once the images, and so their sizes, are known. Without
    ``chosen`` the frames are spread over the footage by the seed. Frames that cannot be decoded
    are left out, and ``warn`` is called with their number; if none is left, `InputError` names the
    first. ``flow`` is a provider for the flow term, None the built-in one.

    Where the footage is a sequence, the fits with the sources some frames earlier and later are
    looked at; the result is not to be trusted if one of them is better (``report.lag``).
    """
    if chosen is None:
        chosen = draw_frames(len(frames), calibration.max_frames, calibration.seed)
    network = frames.depth.relative
    if network is not None:
        start = initial.relative_depth if initial is not None else None
        start = start or network.pooled(_readable(frames.references, chosen))
        calibration.relative_depth = network.relative_depth = start
    loading = progress(range(len(chosen)), len(chosen), "loading", quiet)
    chosen, references, sources, depths, line = load_frames(
        frames.references, frames.sources, frames.depth, chosen, lambda _: next(loading, None)
    )
    if line:
        warn(line)
    if prepare is not None:
        prepare(calibration, references[0], sources[0])
    if initial is not None:
        initial = fit_rig(initial, size_of(references[0]), size_of(sources[0]))

    with stages_bar(quiet) as show:
        try:
            result = calibrate(references, sources, depths, initial, calibration, show, flow)
        except ValueError as error:
            raise InputError(with_file_name(str(error), frames.references, chosen)) from None
        for images, name in ((references, "REFERENCE"), (sources, "SOURCE")):
            distrust(result, *joined_images(images, name))
        if frames.all_sources is not None and frames.offset is not None:
            lag = look_at_lags(
                *(references, sources, depths, [frames.partners[index] for index in chosen]),
                *(frames.all_sources, result.rig, calibration, lambda share: show("lags", share)),
            )
            add_lags(result, lag, frames.offset, frames.all_sources)
    return result, chosen


def find_readout(
    frames: Frames,
    chosen: Sequence[int],
    rig: Rig,
    calibration: CalibrationOptions,
    known: Mapping[str, float | None],
    quiet: bool = False,
) -> ReadoutFit:
    """What the ``chosen`` frames, to which ``rig`` was fitted, show of a rolling shutter.

    ``known``: the readouts of ``source`` and ``reference``, None for the one that is looked for.
    The frames' sources are as they were read.
    """
    assert frames.all_sources is not None
    count = min(len(chosen), READOUT_FRAMES)
    few = [chosen[i * len(chosen) // count] for i in range(count)]
    read = [(frames.references[index], index) for index in few]
    with stages_bar(quiet) as show:
        return fit_readout(
            [reference for reference, _ in read],
            [frames.depth(index, reference) for reference, index in read],
            [frames.partners[index] for index in few],
            *(frames.all_sources, rig, calibration),
            *(known["source"] or 0, known["reference"] or 0, known["reference"] is None),
            *(motion_between, lambda share: show("readout", share)),
        )


def _readable(stream: Stream, chosen: Sequence[int]) -> Iterator[Image]:
    """Those of the chosen images that can be decoded."""
    for index in chosen:
        try:
            yield stream[index]
        except DecodeError:
            continue


def with_fitted_plane(
    frames: Frames,
    rig: Rig,
    chosen: Sequence[int],
    calibration: CalibrationOptions,
    quiet: bool = False,
) -> tuple[Frames, PlaneDepth]:
    """The frames with the road plane that suits them best, see `PlaneDepth.fitted`, and that plane.

    Their depth must be a `PlaneDepth`, and ``rig`` fitted with it to the ``chosen`` frames.
    """
    plane = frames.given_depth
    if not isinstance(plane, PlaneDepth):
        raise ValueError(f"depth is {type(plane).__name__}, expected a PlaneDepth to refine")
    chosen = [chosen[index] for index in frames_to_judge_plane(len(chosen))]
    references = [frames.references[index] for index in chosen]
    sources = [frames.sources[index] for index in chosen]
    with tqdm(desc="plane", unit="fit", disable=True if quiet else None, leave=False) as bar:
        fitted = plane.fitted(references, sources, rig, calibration, bar.update)
    return replace(frames, depth=fitted), fitted


def save_rig(rig: Rig, path: Path) -> None:
    """Write a rig file, and make its folder."""
    path.parent.mkdir(parents=True, exist_ok=True)
    rig.save(path)
