"""From a rig to registered frames on disk: decode, depth, warp and encode at the same time.

What is written is noted in a `Journal`; frames that it tells of are not made again.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import FrameType
from typing import Any

from tqdm import tqdm

from ._core import Registrar, Rig, absolute_path, file_stamp, fingerprint, rig_fingerprint
from .depth import Depth
from .footage import Stream, is_video, journal_of, open_sink
from .footage.encoder import encoder_name
from .footage.pairing import median_period
from .footage.writer import Sink, valid_pixels
from .frames import Image, overlay
from .journal import Journal
from .pipeline import Frames
from .stages import Stage, busy_shares, stream

WORKERS = 8
"""Threads for a stage, at most: each holds a frame."""
EVERY = 10.0
"""Time between lines of progress where there is no terminal for a bar [s]."""


@dataclass(frozen=True)
class RegistrationOptions:
    """How to register a stream of frames."""

    threads: int = 0
    """0 means all cores; with 1 nothing overlaps."""
    overlays: bool = False
    nearest: bool = False
    """Keep the source's values as they are instead of interpolating between them."""
    occlusion: str = "mark"
    """That of `Registrar`."""
    overwrite: bool = False
    """Begin anew where an earlier run has written."""


@dataclass(frozen=True)
class Registration:
    """Totals over a stream of registered frames."""

    frames: int
    valid: int
    """Valid pixels of all frames."""
    pixels: int
    earlier: int = 0
    """Frames that were there from an earlier run."""
    seconds: float = 0.0
    """What the others took."""
    busy: Mapping[str, float] = field(default_factory=dict)
    """Share of that time that each stage was at work, [0, 1]."""

    def summary(self) -> str:
        """One line."""
        there = f" ({self.earlier} from before)" if self.earlier else ""
        line = f"{self.frames} frames{there}, {100 * self.valid / self.pixels:.1f} % valid"
        if self.frames > self.earlier:
            speed = (self.frames - self.earlier) / max(self.seconds, 1e-9)
            line += f", {speed:.1f} frames/s with files, busy: {percentages(self.busy)}"
        return line


def run_registration(
    frames: Frames,
    rig: Rig,
    output: Path,
    options: RegistrationOptions | None = None,
    inputs: Mapping[str, Any] | None = None,
    quiet: bool = False,
    overlapped: bool | None = None,
) -> Registration:
    """Register frames and write images, masks and, if asked for, overlays.

    Parameters
    ----------
    output
        A folder, or a video by its suffix, at the rate of the reference.
    inputs
        All that the caller made ``frames`` with, by name: an output of other inputs is refused.
    overlapped
        Whether stages work at the same time; None: unless there is one thread.

    Raises
    ------
    InputError
        Also where ``output`` was made otherwise and is not to be overwritten.
    KeyboardInterrupt
        SIGINT or SIGTERM; what is written is whole, and the same call goes on from there.
    """
    options = options or RegistrationOptions()
    fitted = frames.fit(rig)
    registrar = Registrar(fitted, options.threads, options.nearest, options.occlusion)
    keys = frame_keys(frames)
    made_with = described(rig, options, inputs or {})
    if is_video(output):
        made_with["encoder"] = encoder_name()
    with (
        Journal(journal_of(output), made_with, options.overwrite) as journal,
        Interrupts() as interrupts,
        open_sink(output, frame_rate(frames.references), journal) as sink,
    ):
        done = sink.begin(keys)
        todo = [key not in done for key in keys]
        if overlapped is None:
            overlapped = options.threads != 1
        workers = min(options.threads or len(os.sched_getaffinity(0)), WORKERS)
        stages = stages_of(
            frames, registrar, sink, todo, options.overlays, workers if overlapped else 1
        )
        valid, made = sum(done.values()), 0
        start = time.perf_counter()
        with (
            Progress(len(keys), len(done), quiet) as progress,
            contextlib.closing(
                stream(frames_needed(frames, todo), stages, overlapped=overlapped)
            ) as results,
        ):
            for count in results:
                if count is not None:
                    valid, made = valid + count, made + 1
                    progress.update(busy_shares(stages, time.perf_counter() - start))
                interrupts.check(f"{len(done) + made} of {len(keys)} frames are done")
        sink.finish(lambda: interrupts.check("all frames are done, but not yet in one video"))
        seconds = time.perf_counter() - start
    pixels = len(keys) * fitted.reference.width * fitted.reference.height
    busy = busy_shares(stages, seconds)
    return Registration(len(keys), valid, pixels, len(done), seconds, busy)


def frame_rate(stream: Stream) -> float:
    """Frames a second, by the median; 25 where the stream does not tell."""
    period = 0.0 if stream.times is None else median_period(stream.times)
    return 1 / period if period else 25.0


# -- The stages ----------------------------------------------------------------------------------


@dataclass
class _Frame:
    """A frame on its way; what no later stage needs is let go."""

    index: int
    reference: Image | None = None
    source: Image | None = None
    depth: Depth | None = None
    image: Image | None = None
    mask: Any = None


def stages_of(
    frames: Frames,
    registrar: Registrar,
    sink: Sink,
    todo: Sequence[bool],
    overlays: bool,
    workers: int,
) -> list[Stage]:
    """Decode, depth, warp, encode: from the index of a frame to the number of its valid pixels.

    Stages in which frames do not depend on each other have as many ``workers``.
    """

    def many(parallel: bool) -> int:
        return workers if parallel else 1

    def reference(index: int) -> _Frame:
        return _Frame(index, frames.references[index])

    def source(frame: _Frame) -> _Frame:
        if todo[frame.index]:
            frame.source = frames.sources[frame.index]
        return frame

    def depth(frame: _Frame) -> _Frame:
        assert frame.reference is not None
        frame.depth = frames.depth(frame.index, frame.reference)
        if not overlays:
            frame.reference = None
        return frame

    def warp(frame: _Frame) -> _Frame:
        if frame.source is not None and frame.depth is not None:
            frame.image, frame.mask = registrar.register(frame.source, frame.depth)
        frame.source = frame.depth = None
        return frame

    def encode(frame: _Frame) -> int | None:
        if frame.image is None:
            return None
        picture = None
        if frame.reference is not None:
            picture = overlay(frame.reference, frame.image, frame.mask == 0)
        name = frames.references.name(frame.index)
        sink.write(frame.index, name, frame.image, frame.mask, picture)
        return valid_pixels(frame.mask)

    return [
        Stage("decode", reference, many(frames.references.parallel)),
        Stage("decode", source, many(frames.sources.parallel)),
        Stage("depth", depth, many(frames.depth.is_parallel)),
        Stage("warp", warp),
        Stage("encode", encode, many(sink.parallel)),
    ]


def frames_needed(frames: Frames, todo: Sequence[bool]) -> Iterator[int]:
    """The frames to make; for depth that depends on the frames before, these too."""
    if not any(todo):
        return
    last = max(index for index, missing in enumerate(todo) if missing)
    steady = frames.depth.is_steady
    yield from (index for index in range(last + 1) if steady or todo[index])


# -- What a frame, and an output, is made of -----------------------------------------------------


def frame_keys(frames: Frames) -> list[str]:
    """A name for each frame that changes with the files it is made of: their names, sizes, times.

    Depth that depends on the frames before makes the name depend on them as well.
    """

    stamp = cache(file_stamp)
    keys: list[str] = []
    steady = frames.depth.is_steady
    for index in range(len(frames)):
        parts = [frames.references.name(index)]
        for images in (frames.references, frames.sources):
            file = images.file(index)
            parts += [*stamp(file), images.where(index).removeprefix(str(file))]
        for file in frames.depth.files_of(index):
            parts += stamp(file)
        if steady and keys:
            parts.append(keys[-1])
        keys.append(fingerprint("\n".join(parts)))
    return keys


def described(rig: Rig, options: RegistrationOptions, inputs: Mapping[str, Any]) -> dict[str, str]:
    """All that an output depends on, but for the frames and how fast it is made."""
    text = {
        "xcalib": version("xcalib-rgbt"),
        "rig": rig_fingerprint(rig),
        "overlay": str(options.overlays),
        "nearest": str(options.nearest),
        "occlusion": options.occlusion,
    }
    for name, value in inputs.items():
        path = isinstance(value, Path) or (name == "depth_spec" and value != "plane")
        text[name] = str(absolute_path(value) if path else value)
        if path and Path(value).is_file() and name not in ("reference", "source", "depth_spec"):
            text[name] += f" ({fingerprint(Path(value).read_bytes())})"
    return text


# -- Interrupts and progress ---------------------------------------------------------------------


class Interrupts:
    """SIGINT and SIGTERM, held back until `check`: between two frames they do no harm.

    A second one is not held back.
    """

    def __init__(self) -> None:
        self._came = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Interrupts:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                if signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
                    self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._came:
            raise KeyboardInterrupt
        self._came = True

    def check(self, state: str) -> None:
        """Raise KeyboardInterrupt, with the state of things, if one has come."""
        if self._came:
            raise KeyboardInterrupt(f"interrupted; {state}, the same command goes on from there")


class Progress:
    """A bar on stderr; where that is no terminal, a line every `EVERY` seconds."""

    def __init__(self, total: int, done: int, quiet: bool) -> None:
        self._total, self._done, self._made = total, done, 0
        self._lines = not quiet and not sys.stderr.isatty()
        self._start = self._said = time.perf_counter()
        self._bar = tqdm(
            total=total,
            initial=done,
            desc="registering",
            unit="frame",
            disable=True if quiet else None,
            leave=False,
            smoothing=0.05,
        )

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def update(self, busy: Mapping[str, float]) -> None:
        """One more frame is done."""
        self._made += 1
        if not self._bar.disable:
            self._bar.set_postfix_str(percentages(busy), refresh=False)
            self._bar.update()
        now = time.perf_counter()
        if self._lines and now - self._said > EVERY:
            self._said = now
            speed = self._made / (now - self._start)
            count = self._done + self._made
            left = (self._total - count) / speed
            print(
                f"registering: {count} of {self._total} frames, {speed:.1f} frames/s,"
                f" {left:.0f} s left, busy: {percentages(busy)}",
                file=sys.stderr,
                flush=True,
            )


def percentages(shares: Mapping[str, float]) -> str:
    """Shares by name, in words."""
    return ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares.items())
