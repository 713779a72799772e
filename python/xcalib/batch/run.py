"""Many drives at once: each calibrated, compared with its last rig, registered, and summed up."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .._core import InputError, Rig, Tolerance, fingerprint, frame_names, read_file
from ..convert import is_foreign, read_rig
from ..pipeline import Frames
from ..registration import RegistrationOptions
from .calibrate_shard import RIG, CalibrateShard
from .drive import Drive, Registered
from .engine import Lost, run_shards
from .jobs import Job
from .manifest import ObjectLock
from .register_shard import RegisterShard
from .shard import VERSION, Outcome, Shard
from .store import Place, is_there, join, local, read, write
from .target import target_of
from .terminated import terminated_is_interrupted
from .workers import Workers, WorkersGone, threads_of

CALIBRATION = "calibration.json"
"""In the folder of a job: what a batch that runs again need not do again."""
LOCK = "batch.lock"

FAILED, NOT_TRUSTED, MOVED, INCOMPLETE, GOOD = (
    "failed",
    "not trusted",
    "moved",
    "incomplete",
    "good",
)
"""What a drive's state may be, the most urgent first."""
STATES = (FAILED, NOT_TRUSTED, MOVED, INCOMPLETE, GOOD)


@dataclass
class DriveState:
    """What became of a job so far."""

    job: Job
    folder: Place
    failure: str = ""
    """Why it was given up."""
    is_input: bool = False
    """Whether that is for what the user gave."""
    calibration: dict[str, Any] | None = None
    rig: Place | None = None
    """That it is registered by."""
    registered: Registered | None = None
    seconds: float = 0.0
    drive: Drive | None = field(default=None, repr=False)

    @property
    def state(self) -> str:
        """One of `STATES`."""
        if self.failure:
            return FAILED
        if self.calibration is not None and not self.calibration["trusted"]:
            return NOT_TRUSTED
        if self.calibration is None and self.rig is not None and not _is_trusted(self.rig):
            return NOT_TRUSTED
        if has_moved(self.calibration):
            return MOVED
        done = self.registered
        if done is not None and (done.left_out or done.missing or not done.valid):
            return INCOMPLETE
        return GOOD

    @property
    def why(self) -> str:
        """What a person should know of it, in a line."""
        lines: list[str] = [self.failure] if self.failure else []
        found = self.calibration
        if found is not None and not found["trusted"]:
            lines.append(f"{found['reason']} {found['advice']}".strip())
            if self.job.register is not None:
                by = f"by its last rig, {self.rig}" if self.rig is not None else "not at all"
                lines.append(f"registered {by}")
        if has_moved(found):
            assert found is not None
            moved = found["drift"]
            lines.append(
                f"the rig has moved by {moved['median_px']:.1f} px (95 %: {moved['p95_px']:.1f} px)"
                f" since {self.job.rig}"
            )
        if self.registered is not None:
            lines += self.registered.problems()
            if not self.registered.valid and not self.registered.missing:
                lines.append("no pixel is valid; see the masks")
        return "; ".join(lines)


def has_moved(calibration: dict[str, Any] | None) -> bool:
    """Whether a rig that is trusted lies beyond the tolerance from the last one."""
    drift = (calibration or {}).get("drift")
    if not drift or not calibration or not calibration["trusted"]:
        return False
    tolerance = Tolerance()
    return bool(drift["median_px"] > tolerance.median or drift["p95_px"] > tolerance.p95)


def _is_trusted(file: Place) -> bool:
    verdict = _load(file).verdict
    return not verdict or bool(verdict.trusted)


def _load(place: Place) -> Rig:
    file = local(place)
    return read_rig(file) if is_foreign(file) else Rig.load(file)


class Batch:
    """The jobs of a file under way: shards out, outcomes in, and a state for each drive."""

    def __init__(
        self,
        jobs: Sequence[Job],
        output: Place,
        workers: Workers,
        threads: int = 0,
        overwrite: bool = False,
        say: Callable[[DriveState], None] = lambda _: None,
    ) -> None:
        self.states = [DriveState(job, join(output, job.name)) for job in jobs]
        self._workers = workers
        self._threads = threads_of(workers, threads)
        self._overwrite = overwrite
        self._say = say
        self._by_shard: dict[str, tuple[DriveState, str]] = {}
        self._by_output: dict[Path, DriveState] = {}
        self.made = 0
        """Shards that were done, none where all was there."""

    def shards(self) -> Iterator[Shard | None]:
        """Calibrations first; a drive is opened for registering when workers are free for it."""
        for state in self.states:
            with self._noted(state):
                yield from self._calibration(state)
        waiting = list(self.states)
        while waiting:
            ready = next((state for state in waiting if self._is_calibrated(state)), None)
            if ready is None:
                yield None
                continue
            waiting.remove(ready)
            with self._noted(ready):
                yield from self._registration(ready)

    @contextlib.contextmanager
    def _noted(self, state: DriveState) -> Iterator[None]:
        """An error within is that of one drive, and none of the others'."""
        try:
            yield
        except (ValueError, OSError) as error:
            self._give_up(state, str(error), is_input=True)

    def _give_up(self, state: DriveState, why: str, is_input: bool) -> None:
        if not state.failure:
            state.failure, state.is_input = why, is_input
            if state.drive is not None:
                state.drive.close()
                state.registered = state.drive.total
            self._say(state)

    def _is_calibrated(self, state: DriveState) -> bool:
        return bool(state.job.calibrate is None or state.calibration is not None or state.failure)

    def _calibration(self, state: DriveState) -> Iterator[Shard]:
        job = state.job
        if job.calibrate is None:
            return
        frames = Frames.open(job.inputs())
        keys = [key for key, _ in frame_names(frames.references, frames.sources, frames.depth)]
        last = str(job.rig.absolute()) if job.rig is not None else None
        made_of = [VERSION, *job.calibrate, *keys]
        if job.rig is not None:
            made_of.append(fingerprint(read_file(job.rig)))
        ident = fingerprint("\n".join(made_of))
        if isinstance(state.folder, Path):
            state.folder.mkdir(parents=True, exist_ok=True)
        known = _noted_result(state.folder, ident)
        if known is not None and not self._overwrite:
            self._take_calibration(state, known)
            return
        target = target_of(state.folder)
        target.begin()
        name = f"{job.name}: calibration"
        shard = CalibrateShard(
            ident, name, job.calibrate, os.getcwd(), last, target, threads=self._threads
        )
        self._by_shard[shard.id] = state, ident
        yield shard

    def _take_calibration(self, state: DriveState, result: dict[str, Any]) -> None:
        state.calibration = result
        state.rig = join(state.folder, RIG) if result["trusted"] else state.job.rig
        if state.job.register is None or state.rig is None:
            self._say(state)

    def _registration(self, state: DriveState) -> Iterator[Shard]:
        job = state.job
        if job.calibrate is None:
            state.rig = job.rig
        if job.register is None or state.failure or state.rig is None:
            return
        p = job.register
        options = RegistrationOptions(
            self._threads, p["overlays"], p["nearest"], p["occlusion"], self._overwrite
        )
        inputs = {name: value for name, value in p.items() if name in job.frames}
        drive = Drive(
            job.inputs(),
            _load(state.rig),
            join(state.folder, job.output),
            options,
            self._workers,
            made_of=inputs,
            other_reads=[local(state.rig)],
            drives=len(self.states),
        )
        state.drive = drive
        self._by_output[drive.output] = state
        yield from drive.shards()
        if drive.is_done:
            self._end(state)

    def take(self, shard: Shard, outcome: Outcome | Lost) -> None:
        """Note what became of a shard."""
        self.made += isinstance(outcome, Outcome)
        if isinstance(shard, RegisterShard):
            state = self._by_output[shard.job.target.output]
            if state.failure:
                return
            assert state.drive is not None
            if isinstance(outcome, Lost) and outcome.is_input:
                self._give_up(state, outcome.reason, is_input=True)
                return
            with self._noted(state):
                state.drive.take(shard, outcome)
                if state.drive.is_done:
                    self._end(state)
            return
        state, ident = self._by_shard.pop(shard.id)
        target_of(state.folder).end()
        if isinstance(outcome, Lost):
            self._give_up(state, outcome.reason, outcome.is_input)
            return
        state.seconds += outcome.seconds
        noted = json.dumps({"id": ident, "result": outcome.result}, indent=1)
        write(join(state.folder, CALIBRATION), noted.encode())
        self._take_calibration(state, outcome.result)

    def _end(self, state: DriveState) -> None:
        if state.registered is not None or state.drive is None:
            return
        state.drive.close()
        state.drive.finish()
        state.registered = state.drive.total
        self._by_output.pop(state.drive.output, None)
        state.drive = None
        self._say(state)

    def close(self) -> None:
        """Let go of drives that are not done: what is written of them is whole, and noted."""
        for state in self.states:
            if state.drive is not None:
                state.drive.close()
                state.registered = state.drive.total
                state.drive = None
            elif not self._is_calibrated(state):
                target_of(state.folder).end()

    def gone(self, why: str) -> None:
        """No worker is left: what is not done is missing."""
        for state in self.states:
            total = state.drive.total if state.drive is not None else None
            wants = state.job.register is not None and state.registered is None
            if total is not None:
                count = total.frames - total.earlier - total.made - len(total.left_out)
                count -= sum(frames for _, frames, _ in total.missing)
                total.missing.append(("the rest", count, why))
            elif not state.failure and (wants or not self._is_calibrated(state)):
                state.failure = why


def run_batch(
    jobs: Sequence[Job],
    output: Place,
    workers: Workers,
    threads: int = 0,
    overwrite: bool = False,
    say: Callable[[DriveState], None] = lambda _: None,
) -> tuple[list[DriveState], bool]:
    """Do the jobs; what an earlier batch has done of them is kept.

    Parameters
    ----------
    output
        A folder, in which each job has one of its own.
    threads
        Native threads of a shard; 0: this machine's, shared among its workers.
    say
        Called with each drive that is done.

    Returns
    -------
    states
        Of all jobs, those that need a person first.
    is_new
        Whether anything was to be done.

    Raises
    ------
    InputError
        Another batch is writing to this output.
    KeyboardInterrupt
        What is written is whole, and the same call resumes from there.
    """
    with terminated_is_interrupted(), locked(output):
        start = time.perf_counter()
        batch = Batch(jobs, output, workers, threads, overwrite, say)
        try:
            for shard, outcome in run_shards(batch.shards(), workers):
                batch.take(shard, outcome)
        except WorkersGone as error:
            batch.gone(str(error))
        except KeyboardInterrupt:
            done = sum(state.registered is not None for state in batch.states)
            raise KeyboardInterrupt(
                f"interrupted; {done} of {len(jobs)} drives are done after"
                f" {time.perf_counter() - start:.0f} s, the same command goes on from there"
            ) from None
        finally:
            batch.close()
    return sorted(batch.states, key=urgency), batch.made > 0


def urgency(state: DriveState) -> tuple[int, float, str]:
    """What sorts the drives that need a person first, and of these the largest errors."""
    error = (state.calibration or {}).get("median_px")
    return STATES.index(state.state), -(error or 0.0), state.job.name


def _noted_result(folder: Place, ident: str) -> dict[str, Any] | None:
    """What a calibration of the same id has found, if its files are there."""
    try:
        noted = json.loads(read(join(folder, CALIBRATION)) or b"null")
    except ValueError:
        return None
    if not isinstance(noted, dict) or noted.get("id") != ident:
        return None
    result = noted.get("result")
    return result if isinstance(result, dict) and is_there(join(folder, RIG)) else None


@contextlib.contextmanager
def locked(output: Place) -> Iterator[None]:
    """Hold the output of a batch alone."""
    if not isinstance(output, Path):
        with contextlib.closing(ObjectLock(output, LOCK)):
            yield
        return
    output.mkdir(parents=True, exist_ok=True)
    path = output / LOCK
    with path.open("a") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"{output}: another batch is writing to this output, expected its end or another"
                " output"
            ) from None
        yield
