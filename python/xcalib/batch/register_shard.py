"""Frames of one drive, registered by the runner that registers whole drives."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .._core import (
    DecodeError,
    InputError,
    Registrar,
    Rig,
    fingerprint,
    frame_names,
    register_frames,
)
from ..footage import Picked, encoder
from ..footage.opening import PickedDepth
from ..inputs import Inputs
from ..pipeline import Frames
from ..registration import RegistrationOptions
from .frames_of import opened_once
from .shard import Shard, this_worker
from .target import Target
from .units import Unit, placed, units_of


@dataclass(frozen=True)
class RegisterJob:
    """What the shards of one drive have in common."""

    id: str
    """Fingerprint of rig, settings, and all files."""
    inputs: Inputs
    rig: Rig
    options: RegistrationOptions
    rate: float
    """Of a video [frames/s], which a few of its frames do not tell."""
    target: Target

    def frames(self) -> Frames:
        """The footage, opened once in a worker."""
        return opened_once(
            self.id, lambda: open_straight(self.inputs, self.rig, self.options.nearest)
        )


def open_straight(inputs: Inputs, rig: Rig, nearest: bool) -> Frames:
    """The frames with their sources straightened by the readouts among the inputs."""
    return Frames.open(inputs, rig).with_straight_rows(*inputs.readout, rig, nearest)


@dataclass(frozen=True)
class RegisterShard(Shard):
    """The frames from ``start`` up to ``stop``."""

    job: RegisterJob
    start: int
    stop: int
    keys: tuple[str, ...]
    """Of these frames: a worker that finds others sees other files."""

    @staticmethod
    def of(
        job: RegisterJob, start: int, stop: int, names: Sequence[tuple[str, str]]
    ) -> RegisterShard:
        """A shard of these frames of a drive whose (key, name) these are."""
        keys = tuple(key for key, _ in names[start:stop])
        name = f"frames {names[start][1]} to {names[stop - 1][1]}"
        return RegisterShard(
            fingerprint("\n".join((job.id, *keys))),
            name,
            job,
            start,
            stop,
            keys,
            threads=job.options.threads,
        )

    def halves(self) -> Sequence[RegisterShard]:
        """Two shards of half the frames."""
        middle = (self.start + self.stop) // 2
        if middle == self.start or self.job.frames().depth.is_steady:
            return ()
        names = frame_names(*_picked(self.job.frames(), range(self.start, self.stop)))
        both = [("", "")] * self.start + names
        return (
            RegisterShard.of(self.job, self.start, middle, both),
            RegisterShard.of(self.job, middle, self.stop, both),
        )

    def run(self) -> dict[str, Any]:
        """Register the frames. Those that cannot be decoded are left out, and named."""
        frames = self.job.frames()
        rest = list(range(self.start, self.stop))
        names = frame_names(*_picked(frames, rest))
        if tuple(key for key, _ in names) != self.keys:
            raise InputError(
                f"worker {this_worker()} sees other files for {self.name}, expected the same ones,"
                " under the same names, on all workers"
            )
        index_of = {key: index for (key, _), index in zip(names, rest, strict=True)}
        left_out: list[tuple[str, str]] = []
        units: list[Unit] = []
        with self.job.target.attempt() as folder:
            for part in range(len(rest)):
                output = folder / f"{part}{self.job.target.suffix}"
                failure = self._register(frames, rest, output)
                units += self._published(output)
                if not failure:
                    break
                # Those before the one that failed are done, none after it.
                done = {index_of[key] for unit in units for key, _ in unit.frames}
                rest = [index for index in rest if index not in done]
                left_out.append((frames.references.name(rest.pop(0)), failure))
                if not rest:
                    break
        return {"units": [unit.to_json() for unit in units], "left_out": left_out}

    def _register(self, frames: Frames, indices: Sequence[int], output: Path) -> str:
        """Why the first of the frames that was not written could not be decoded, or ''."""
        o = self.job.options
        registrar = Registrar(self.job.rig, max(o.threads, 0), o.nearest, o.occlusion)
        try:
            register_frames(
                *_picked(frames, indices),
                registrar,
                output,
                o.overlays,
                False,
                max(len(indices), 1),
                [],
                [],
                encoder,
                lambda _: None,
                False,
                self.job.rate,
            )
        except DecodeError as error:
            return str(error)
        return ""

    def _published(self, attempt: Path) -> list[Unit]:
        """The units of an attempt, under the names that they have in the output now."""
        target, units = self.job.target, []
        folder = attempt.parent if target.suffix else attempt
        for unit in units_of(attempt):
            names = placed(unit, attempt, target.output.name)
            target.publish(folder, names)
            units.append(dataclasses.replace(unit, files=[(names[n], s) for n, s in unit.files]))
        return units


def _picked(frames: Frames, indices: Sequence[int]) -> tuple[Picked, Picked, PickedDepth]:
    some = list(indices)
    return (
        Picked(frames.references, some),
        Picked(frames.sources, some),
        PickedDepth(frames.depth, some),
    )
