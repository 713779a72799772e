"""Rows of the table as calls of the Python API."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import NoReturn

from table import Row

from xcalib import CalibrationOptions, Rig, evaluate
from xcalib.depth import DepthUnits
from xcalib.footage import Matching
from xcalib.inputs import Inputs
from xcalib.pipeline import Frames, run_calibration
from xcalib.registration import RegistrationOptions, run_registration


class NoCall(Exception):
    """A command of which the API has no counterpart, as one with a flag that is misspelt."""


class Words(argparse.ArgumentParser):
    """Reads the commands whose arguments are arguments of functions too."""

    def __init__(self, positional: tuple[str, ...]) -> None:
        super().__init__(add_help=False, allow_abbrev=False)
        for name in positional:
            self.add_argument(name)
        for flag in ("--depth", "-o", "--reference-times", "--source-times", "--initial"):
            self.add_argument(flag, dest=flag.strip("-").replace("-", "_"))
        self.add_argument("--depth-scale", type=float)
        for flag in ("--overlay", "--overwrite"):
            self.add_argument(flag, action="store_true")

    def error(self, message: str) -> NoReturn:
        """Not a call."""
        raise NoCall(message)


POSITIONAL = {
    "inspect": ("rig",),
    "register": ("rig", "reference", "source"),
    "evaluate": ("rig", "reference", "source"),
    "calibrate": ("reference", "source"),
}


def call_of(row: Row) -> Callable[[], object] | None:
    """What a caller of the API would write in place of the command; None where there is nothing."""
    if row.api is not None:
        return row.api
    name, *words = row.words()
    # What is not to be trusted is a result, and an empty name in `Path` is the folder one is in.
    if row.only == "cli" or name not in POSITIONAL or row.code == 3 or "" in words:
        return None
    if any(word.startswith("-o=") for word in words):
        return None
    try:
        given = Words(POSITIONAL[name]).parse_args(words)
    except NoCall:
        return None
    if name == "inspect":
        return lambda: Rig.load(given.rig)
    if given.depth is None or (name == "register" and given.o is None):
        return None
    # What a caller does with the result of a calibration is another call.
    if name == "calibrate" and given.o != "new.yaml":
        return None

    def opened() -> Frames:
        def path(text: str | None) -> Path | None:
            return None if text is None else Path(text)

        matching = Matching(
            reference_times=path(given.reference_times), source_times=path(given.source_times)
        )
        units = DepthUnits(scale=given.depth_scale)
        return Frames.open(Inputs(given.reference, given.source, given.depth, units, matching))

    def registered() -> object:
        rig = Rig.load(given.rig)
        options = RegistrationOptions(1, overlays=given.overlay, overwrite=given.overwrite)
        return run_registration(
            *(opened(), rig, Path(given.o), options, {"rig": given.rig}, True),
            other_reads=[Path(given.rig)],
        )

    def evaluated() -> object:
        rig, frames = Rig.load(given.rig), opened()
        return evaluate(rig, frames.references, frames.sources, frames.depth)

    def calibrated() -> object:
        initial = Rig.load(given.initial) if given.initial else None
        return run_calibration(opened(), CalibrationOptions(num_threads=1), initial, True)

    return {"register": registered, "evaluate": evaluated, "calibrate": calibrated}[name]
