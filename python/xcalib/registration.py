"""From a rig to registered frames on disk: decode, depth, warp and encode at the same time.

What is written is noted in a journal; frames that it lists are not made again.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from ._core import (
    Registrar,
    Registration,
    Rig,
    absolute_path,
    fingerprint,
    read_file,
    register_frames,
)
from .depth.constant import distance_of
from .footage import encoder
from .pipeline import Frames
from .progress import Lines
from .remote import is_url

__all__ = ["Registration", "RegistrationOptions", "run_registration"]

PART_FRAMES = 250
"""Frames of a video that a run that is killed, not only interrupted, can lose at most."""


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
    """Start again where an earlier run has written."""


def run_registration(
    frames: Frames,
    rig: Rig,
    output: Path,
    options: RegistrationOptions | None = None,
    inputs: Mapping[str, Any] | None = None,
    quiet: bool = False,
    other_reads: Sequence[Path] = (),
    rate: float = 0.0,
) -> Registration:
    """Register frames and write images, masks and, if asked for, overlays.

    Parameters
    ----------
    output
        A folder, or a video by its suffix, at the rate of the reference.
    inputs
        All that the caller made ``frames`` with, by name: an output of other inputs is refused.
    other_reads
        Files that were read besides those of the frames: nothing that is read is written to.
    rate
        Of a video [frames/s]; 0: that of the reference.

    Raises
    ------
    InputError
        Also where ``output`` was made otherwise and is not to be overwritten.
    KeyboardInterrupt
        SIGINT or SIGTERM; what is written is whole, and the same call resumes from there.
    """
    options = options or RegistrationOptions()
    with Progress(len(frames), quiet) as progress:
        return register_frames(
            frames.references,
            frames.sources,
            frames.depth,
            Registrar(rig, options.threads, options.nearest, options.occlusion),
            output,
            options.overlays,
            options.overwrite,
            PART_FRAMES,
            described(inputs or {}),
            list(other_reads),
            encoder,
            progress,
            threading.current_thread() is threading.main_thread(),
            rate,
        )


def is_word(depth_spec: str) -> bool:
    """Whether a ``--depth`` argument names no path."""
    is_number = not is_url(depth_spec) and distance_of(depth_spec) is not None
    return depth_spec == "plane" or is_url(depth_spec) or is_number


def described(inputs: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Values as text, paths from the root, and tables by what is in them too."""
    text = []
    for name, value in inputs.items():
        path = isinstance(value, Path) or (name == "depth_spec" and not is_word(value))
        line = str(absolute_path(value) if path else value)
        if path and Path(value).is_file() and name not in ("reference", "source", "depth_spec"):
            line += f" ({fingerprint(read_file(value))})"
        text.append((name, line))
    return text


class Progress:
    """A bar on stderr; where that is no terminal, a line now and then."""

    def __init__(self, total: int, quiet: bool) -> None:
        self._lines = Lines(quiet)
        self._bar = tqdm(
            total=total,
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

    def __call__(self, now: Registration) -> None:
        """Show how far it is."""
        if not self._bar.disable:
            busy = ", ".join(f"{name} {100 * share:.0f} %" for name, share in now.busy.items())
            self._bar.set_postfix_str(busy, refresh=False)
            self._bar.initial = now.earlier
            self._bar.update(now.earlier + now.made - self._bar.n)
        if now.made:
            self._lines.say("registering", now.line())
