"""A drive registered in shards: what is there already is not made again.

The journal of the output is the manifest: it is that of a run in one process, and either goes on
from what the other has begun.
"""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tqdm import tqdm

from .._core import InputError, Ledger, Registrar, Rig, fingerprint, frame_rate
from ..footage import encoder
from ..footage.opening import PickedDepth
from ..footage.stream import Picked
from ..inputs import Inputs
from ..pipeline import Frames
from ..progress import Lines
from ..registration import PART_FRAMES, RegistrationOptions, described, is_word, run_registration
from ..remote import is_url
from .engine import Lost, run_shards
from .manifest import JournalManifest, Manifest, ObjectManifest, begun
from .register_shard import RegisterJob, RegisterShard, open_straight
from .shard import Outcome, Shard
from .target import LocalTarget, target_of
from .terminated import terminated_is_interrupted
from .units import Unit
from .workers import InThisProcess, Workers, WorkersGone, threads_of

LEAST_FRAMES = 16
"""Of a shard, so that what it costs to send it is nothing beside what it does."""
MANY_SLOTS = 100
"""Beyond which shards grow with the workers: a scheduler takes a few hundred shards a second."""
SHARDS_A_SLOT = 8
"""At least so many, so that no worker waits long for the last one."""


@dataclass
class Registered:
    """What became of the frames of a drive."""

    frames: int = 0
    earlier: int = 0
    """Of these, that were there from an earlier run."""
    made: int = 0
    """That this run has made."""
    valid: int = 0
    """Pixels of the frames of either."""
    pixels: int = 0
    """Of all frames."""
    seconds: float = 0.0
    peak_bytes: int = 0
    """The most memory that a worker had."""
    left_out: list[tuple[str, str]] = field(default_factory=list)
    """Names of frames that cannot be decoded, and why."""
    missing: list[tuple[str, int, str]] = field(default_factory=list)
    """Shards that could not be done: name, frames, and why."""

    def summary(self) -> str:
        """All of it in one line."""
        if self.earlier == self.frames:
            return f"nothing to do: all {self.frames} frames are there"
        text = f"{self.frames} frames"
        if self.earlier:
            text += f" ({self.earlier} from before)"
        whole = self.frames - len(self.left_out) - sum(count for _, count, _ in self.missing)
        text += f", {100 * self.valid / max(self.pixels * whole / self.frames, 1):.1f} % valid"
        if self.made:
            text += f", {self.made / max(self.seconds, 1e-9):.1f} frames/s"
        return text

    def problems(self) -> Iterator[str]:
        """A line on what is not there, and why, of each kind."""
        if self.left_out:
            name, why = self.left_out[0]
            more = f", and {len(self.left_out) - 1} more" if len(self.left_out) > 1 else ""
            yield f"{len(self.left_out)} frames are left out: {name} ({why}){more}"
        if self.missing:
            name, _, why = self.missing[0]
            count = sum(count for _, count, _ in self.missing)
            more = f", and {len(self.missing) - 1} more shards" if len(self.missing) > 1 else ""
            yield f"{count} frames are missing: {name} ({why}){more}; the same command tries again"


def register(
    inputs: Inputs,
    rig: Rig,
    output: str | Path,
    options: RegistrationOptions | None = None,
    workers: Workers | None = None,
    shard_frames: int | None = None,
    frames: Frames | None = None,
    made_of: Mapping[str, Any] | None = None,
    other_reads: Sequence[Path] = (),
    quiet: bool = True,
) -> Registered:
    """Register a drive in shards, on workers that see its files under the same names.

    Parameters
    ----------
    output
        A folder, also behind a URL, or a video by its suffix; what an earlier run made of it is
        kept.
    options
        ``threads`` are those of one shard; 0: this machine's, shared among its workers.
    workers
        None: this process, one shard after the other.
    shard_frames
        Frames of a shard at most; None: by the number of frames and workers.
    frames
        Those of ``inputs``, where they are open.
    made_of
        By name, all that decides what the output is besides; None: ``inputs``.
    other_reads
        Files that were read besides those of the frames: nothing that is read is written to.

    Raises
    ------
    InputError
        Also where ``output`` was made otherwise, or another run is writing to it.
    KeyboardInterrupt
        What is written is whole, and the same call resumes from there.
    """
    workers = workers or InThisProcess()
    with terminated_is_interrupted():
        drive = Drive(
            inputs, rig, output, options, workers, shard_frames, frames, made_of, other_reads
        )
        try:
            with drive_bar(drive.total, quiet) as show:
                for shard, outcome in run_shards(drive.shards(), workers):
                    if isinstance(outcome, Lost) and outcome.is_input:
                        raise InputError(outcome.reason)
                    drive.take(shard, outcome)
                    show()
        except (KeyboardInterrupt, WorkersGone) as error:
            done = drive.total.earlier + drive.total.made
            raise type(error)(
                f"{str(error) or 'interrupted'}; {done} of {drive.total.frames} frames are done,"
                " the same command goes on from there"
            ) from None
        finally:
            drive.close()
        drive.finish()
    return drive.total


class Drive:
    """The registration of one drive, as shards that others run: `close` it, then `finish`."""

    def __init__(
        self,
        inputs: Inputs,
        rig: Rig,
        output: str | Path,
        options: RegistrationOptions | None,
        workers: Workers,
        shard_frames: int | None = None,
        frames: Frames | None = None,
        made_of: Mapping[str, Any] | None = None,
        other_reads: Sequence[Path] = (),
        drives: int = 1,
    ) -> None:
        options = options or RegistrationOptions()
        self._options = dataclasses.replace(options, threads=threads_of(workers, options.threads))
        self._start = time.perf_counter()
        self._rig = rig
        self._frames = frames or open_straight(inputs, rig, options.nearest)
        self._made_of = described(made_of_inputs(inputs) if made_of is None else made_of)
        self._other_reads = list(other_reads)
        self._target = target_of(output)
        how = options

        def open_ledger(output: Path) -> Ledger:
            return Ledger(
                self._frames.references,
                self._frames.sources,
                self._frames.depth,
                Registrar(rig, 1, how.nearest, how.occlusion),
                output,
                how.overlays,
                how.overwrite,
                self._made_of,
                self._other_reads,
                encoder,
            )

        if isinstance(self._target, LocalTarget):
            ledger = open_ledger(self._target.output)
            self._manifest: Manifest = JournalManifest(ledger)
        else:
            ledger = begun(open_ledger)
            self._manifest = ObjectManifest(self._target.url, ledger.made_with, options.overwrite)
        self._names, there = ledger.names, self._manifest.there
        self._missing = [index for index, (key, _) in enumerate(self._names) if key not in there]
        self._wanted = {self._names[index][0] for index in self._missing}
        self._ranges: list[tuple[int, int]] = []
        if self._missing and self._frames.depth.is_steady:
            self._ranges = [(0, len(self._names))]  # each depends on those before it
        elif self._missing:
            size = shard_frames or shard_size(len(self._missing), workers.slots, drives)
            self._ranges = ranges_of(self._missing, size)
        self._job = RegisterJob(
            fingerprint("\n".join((str(ledger.made_with), *(k for k, _ in self._names)))),
            resolved(inputs, self._frames, self._options.threads),
            rig,
            dataclasses.replace(self._options, overwrite=False),
            frame_rate(self._frames.references),
            self._target,
        )
        grid = ledger.rig.reference
        keys = {key for key, _ in self._names}
        self.total = Registered(
            len(self._names),
            earlier=len(self._names) - len(self._missing),
            valid=sum(valid for key, valid in there.items() if key in keys),
            pixels=grid.width * grid.height * len(self._names),
        )

    @property
    def output(self) -> Path:
        """Where it is written, from the root: what tells its shards from others'."""
        return self._target.output

    def shards(self) -> Iterator[RegisterShard]:
        """What is to be run, one by one."""
        if self._ranges:
            self._manifest.claim()
            self._target.begin()
        for first, stop in self._ranges:
            yield RegisterShard.of(self._job, first, stop, self._names)

    @property
    def is_done(self) -> bool:
        """Whether every shard was taken back."""
        total = self.total
        missing = sum(count for _, count, _ in total.missing)
        return total.earlier + total.made + len(total.left_out) + missing >= total.frames

    def take(self, shard: Shard, outcome: Outcome | Lost) -> None:
        """Note what became of a shard."""
        assert isinstance(shard, RegisterShard)
        total = self.total
        if isinstance(outcome, Lost):
            total.missing.append((shard.name, shard.stop - shard.start, outcome.reason))
            return
        units = [Unit.from_json(unit) for unit in outcome.result["units"]]
        self._manifest.note(shard.id, units)
        made = [v for unit in units for key, v in unit.frames if key in self._wanted]
        self._wanted.difference_update(key for unit in units for key, _ in unit.frames)
        total.made += len(made)
        total.valid += sum(made)
        total.left_out += [(name, why) for name, why in outcome.result["left_out"]]
        total.peak_bytes = max(total.peak_bytes, outcome.peak_bytes)

    def close(self) -> None:
        """Let go of the output: no shard can write to it any more."""
        if self._ranges:
            self._target.end()
        self._manifest.close()
        self.total.seconds = time.perf_counter() - self._start

    def finish(self) -> None:
        """Make one video of the parts, by the run of one process, for which nothing else is to
        do.
        """
        total = self.total
        gone = {name for name, _ in total.left_out}
        kept = [i for i, (_, name) in enumerate(self._names) if name not in gone]
        if not self._target.suffix or total.missing or not self._ranges or not kept:
            return
        some = dataclasses.replace(
            self._frames,
            references=Picked(self._frames.references, kept),
            sources=Picked(self._frames.sources, kept),
            depth=PickedDepth(self._frames.depth, kept),
        )
        run_registration(
            *(some, self._rig, self.output, self._job.options, dict(self._made_of), True),
            *(self._other_reads, self._job.rate),
        )
        total.seconds = time.perf_counter() - self._start


@contextlib.contextmanager
def drive_bar(total: Registered, quiet: bool) -> Iterator[Callable[[], None]]:
    """A function that shows how far a registration is."""
    lines = Lines(quiet)
    with tqdm(
        total=total.frames,
        initial=total.earlier,
        desc="registering",
        unit="frame",
        disable=True if quiet else None,
        leave=False,
    ) as bar:

        def show() -> None:
            done = total.earlier + total.made
            bar.update(done - bar.n)
            lines.say("registering", f"{done} of {total.frames} frames")

        yield show


def made_of_inputs(inputs: Inputs) -> dict[str, Any]:
    """By name, what the inputs are; files by where they are."""
    fields = {field.name: getattr(inputs, field.name) for field in dataclasses.fields(inputs)}
    fields["depth_spec"] = str(fields.pop("depth"))
    return fields


def shard_size(frames: int, slots: int, drives: int = 1) -> int:
    """Frames of a shard: few enough that all workers end together, and that what is lost with one
    is little; enough that the scheduler keeps up, however many workers there are.
    """
    most = PART_FRAMES * max(1, slots // MANY_SLOTS)
    ours = max(slots // drives, 1)
    return min(max(-(-frames // (SHARDS_A_SLOT * ours)), LEAST_FRAMES), most)


def ranges_of(indices: Sequence[int], most: int) -> list[tuple[int, int]]:
    """First and behind the last of runs of consecutive indices, none longer than ``most``."""
    ranges: list[tuple[int, int]] = []
    for index in indices:
        if ranges and ranges[-1][1] == index and index - ranges[-1][0] < most:
            ranges[-1] = ranges[-1][0], index + 1
        else:
            ranges.append((index, index + 1))
    return ranges


def resolved(inputs: Inputs, frames: Frames, threads: int) -> Inputs:
    """The inputs for a worker, which may stand in another folder: paths from the root, an offset of
    clocks that was estimated here as it was found, and networks on the threads of a shard.
    """
    matching = inputs.matching
    if frames.offset is not None and frames.offset.automatic:
        by_time = frames.offset.seconds != 0
        matching = dataclasses.replace(
            matching,
            method="time" if by_time else matching.method,
            time_offset=frames.offset.seconds,
            frame_offset=frames.offset.frames,
        )
    return dataclasses.replace(
        inputs,
        reference=rooted(inputs.reference),
        source=rooted(inputs.source),
        depth=rooted(inputs.depth),
        matching=_rooted_fields(matching),
        network=dataclasses.replace(inputs.network, num_threads=threads),
        measured=_rooted_fields(inputs.measured),
    )


def rooted(spec: str | Path) -> str | Path:
    """A name from the root, where the first part of it is there; words and numbers as they are."""
    prefix, text = "", str(spec)
    for known in ("stereo:", "disparity:"):
        if text.startswith(known):
            prefix, text = known, text.removeprefix(known)
    return (
        spec
        if not prefix and (is_word(text) or is_url(text))
        else prefix + str(Path(text).absolute())
    )


def _rooted_fields(options: Any) -> Any:
    paths = {
        f.name: Path(value).absolute()
        for f in dataclasses.fields(options)
        if isinstance(value := getattr(options, f.name), Path)
    }
    return dataclasses.replace(options, **paths)
