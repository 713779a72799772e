"""What a run has written, by the journal beside it: units of files that are whole together."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .._core import is_video, journal_of


@dataclass(frozen=True)
class Unit:
    """Files, and the frames in them."""

    frames: list[tuple[str, int]]
    """Keys and valid pixels, in order."""
    files: list[tuple[str, int]]
    """Names from the journal's folder, and bytes."""

    def to_json(self) -> dict[str, Any]:
        """As journals have it."""
        return {"frames": dict(self.frames), "files": dict(self.files)}

    @staticmethod
    def from_json(value: dict[str, Any]) -> Unit:
        """What `to_json` gave."""
        return Unit(list(value["frames"].items()), list(value["files"].items()))


def units_of(output: Path) -> list[Unit]:
    """The units of an output whose files are all there."""
    journal = journal_of(output)
    if not journal.is_file():
        return []
    lines = journal.read_text("utf-8").splitlines()[1:]
    units = [Unit.from_json(json.loads(line)) for line in lines]
    return [
        unit for unit in units if all((journal.parent / name).is_file() for name, _ in unit.files)
    ]


def placed(unit: Unit, attempt: Path, output: str) -> dict[str, str]:
    """Where the files of an attempt's unit belong, from the output's folder: by their names here.

    A video's are parts of the video to be, named by the first frame as a run's own parts are.
    """
    if not is_video(attempt):
        return {name: name for name, _ in unit.files}
    first = unit.frames[0][0]
    return {
        name: f"{output}.parts/{first}.{Path(name).name.partition('.')[2]}"
        for name, _ in unit.files
    }
