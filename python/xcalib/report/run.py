"""A calibration to be shown: its report, its rig and its frames."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .._core import Rig, read_file
from ..frames import InputError
from ..pipeline import Frames

VERSION = 1
FILE = "report.json"
"""In a folder that `demo` wrote."""


@dataclass(frozen=True)
class Run:
    """A calibration."""

    document: dict[str, Any]
    """What `calibrate --report FILE.json` writes."""
    rig: Rig
    frames: Frames
    chosen: Sequence[int]
    """Those of the frames that it was calibrated on."""


def load_document(path: Path) -> tuple[Path, dict[str, Any]]:
    """The report of a file, or of a folder that has one, and the file."""
    file = path / FILE if path.is_dir() else path
    if file.suffix.lower() == ".html":
        raise InputError(
            f"{file}: a page already, expected the report that `calibrate --report FILE.json` wrote"
        )
    if path.is_dir() and not file.is_file():
        raise InputError(f"{path}: a folder without {FILE}, expected one that `xcalib demo` wrote")
    try:
        document = json.loads(read_file(file))
    except InputError:
        raise
    except (ValueError, RecursionError):
        raise InputError(f"{file}: not a JSON file") from None
    kind = document.get("format") if isinstance(document, dict) else None
    if kind != "xcalib-report" or document.get("version") != VERSION:
        raise InputError(f"{file}: expected format xcalib-report, version {VERSION}")
    return file, document


@contextlib.contextmanager
def of_report(path: Path) -> Iterator[Run]:
    """The run of a report, with its frames opened again as its command opened them; names are as
    seen from the folder that it ran in, as long as the context lasts.
    """
    from ..cli.calibrate import frames_again  # what parses the command stands there

    file, document = load_document(path)
    run, files = document.get("run"), document.get("files")
    if not isinstance(run, dict) or not is_list(run.get("arguments")) or not is_list(files):
        raise InputError(
            f"{file}: does not say which command made it, as those of earlier versions do not;"
            " expected a report that this version wrote"
        )
    folder = Path(str(run.get("directory")))
    if not folder.is_dir():
        raise InputError(f"{file}: was made in {folder}, which is not there any more")
    with contextlib.chdir(folder):
        try:
            frames = frames_again(run["arguments"], int(run.get("lag", 0)))
            rig = Rig.load(str(document.get("rig")))
        except (OSError, ValueError) as error:
            raise InputError(f"{file}: what it is about is not as it was: {error}") from None
        if (network := frames.depth.relative) is not None:
            network.relative_depth = rig.relative_depth
        by_name = {frames.references.where(index): index for index in range(len(frames))}
        names = [str(name) for name in files or ()]
        for name in names:
            if name not in by_name:
                raise InputError(f"{file}: {name} was used, and is not among the frames any more")
        yield Run(document, rig, frames, [by_name[name] for name in names])


def is_list(value: object) -> bool:
    """Whether a value is a list of words, and not empty."""
    return isinstance(value, list) and bool(value) and all(type(item) is str for item in value)
