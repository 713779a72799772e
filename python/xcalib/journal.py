"""What of an output is done, so that an interrupted run can be taken up again.

A text file beside the output: a line of JSON on how the output is made, then a line for each unit
of whole files: which frames they hold, and their sizes. A line is written after its files are, so
that whatever moment a run ends at, the journal never promises what is not there.
"""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from .frames import InputError

FORMAT, VERSION = "xcalib-register", 1


@dataclass(frozen=True)
class Unit:
    """Files that are whole only together."""

    frames: dict[str, int]
    """Valid pixels of each frame in them, in order, by the frame's key."""
    files: dict[str, int]
    """Bytes of each file, by its name relative to the journal's folder."""


class Journal:
    """The journal of one output, held by one process at a time.

    Until there is a first unit the file is empty, and goes when it is closed.

    Parameters
    ----------
    path
        The file, in a folder that is made where there is none.
    made_with
        All that decides what the output is, apart from the frames themselves.
    overwrite
        Remove what is there instead of going on from it.

    Raises
    ------
    InputError
        What is there was made otherwise, is not a journal, or another process is at it.
    """

    def __init__(self, path: Path, made_with: Mapping[str, Any], overwrite: bool = False) -> None:
        self.path = path
        self.units: list[Unit] = []
        """Units whose files are all there, in the size that they were written."""
        self._first = json.dumps({"format": FORMAT, "version": VERSION, "made_with": made_with})
        self._lock = threading.Lock()
        self._descriptor = -1
        self._made_folders: list[Path] = []
        try:
            self._open()
            self._load(json.loads(self._first)["made_with"], overwrite)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Journal:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let another process have it."""
        if self._descriptor >= 0:
            with contextlib.suppress(OSError):
                if os.fstat(self._descriptor).st_size == 0 and _is_at(self._descriptor, self.path):
                    self.path.unlink()
            os.close(self._descriptor)
            self._descriptor = -1
        for folder in self._made_folders:
            with contextlib.suppress(OSError):  # it holds something
                folder.rmdir()

    def append(self, unit: Unit) -> None:
        """Note that the files of a unit are whole; from any thread."""
        line = json.dumps({"frames": unit.frames, "files": unit.files})
        with self._lock:
            if os.fstat(self._descriptor).st_size == 0:
                self._write(self._first)
            self._write(line)
            self.units.append(unit)

    def sizes(self, *names: str) -> dict[str, int]:
        """The files of these names, as `Unit.files` has them."""
        return {name: (self.path.parent / name).stat().st_size for name in names}

    def is_whole(self, unit: Unit) -> bool:
        """Whether the files of a unit are there as they were written."""
        try:
            return self.sizes(*unit.files) == unit.files
        except OSError:
            return False

    def _open(self) -> None:
        folder = self.path.parent
        self._made_folders = [p for p in (folder, *folder.parents) if not p.exists()]
        folder.mkdir(parents=True, exist_ok=True)
        while True:
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                os.close(descriptor)
                raise InputError(f"{self.path}: another run is writing to this output") from None
            if _is_at(descriptor, self.path):
                self._descriptor = descriptor
                return
            os.close(descriptor)  # removed by the run that held it

    def _write(self, line: str) -> None:
        data = (line + "\n").encode()
        start = os.fstat(self._descriptor).st_size
        if os.write(self._descriptor, data) != len(data):
            os.ftruncate(self._descriptor, start)
            raise OSError(f"{self.path}: no space left for it")

    def _load(self, made_with: Mapping[str, Any], overwrite: bool) -> None:
        data = self.path.read_bytes()
        whole = data[: data.rfind(b"\n") + 1]  # a killed run may leave half a line
        lines = []
        try:
            lines = [json.loads(line) for line in whole.splitlines()]
            units = [Unit(line["frames"], line["files"]) for line in lines[1:]]
            if lines and (lines[0]["format"], lines[0]["version"]) != (FORMAT, VERSION):
                raise ValueError
            if any(
                Path(name).is_absolute() or ".." in Path(name).parts
                for u in units
                for name in u.files
            ):
                raise ValueError  # what --overwrite removes is ours
            if not all(unit.frames and unit.files for unit in units):
                raise ValueError
        except (ValueError, KeyError, TypeError):
            raise InputError(
                f"{self.path}: not a journal of format {FORMAT}, version {VERSION}; expected"
                " another output, or this file removed"
            ) from None
        if overwrite:
            for name in {name for unit in units for name in unit.files}:
                (self.path.parent / name).unlink(missing_ok=True)
        elif lines and lines[0]["made_with"] != made_with:
            raise InputError(
                f"{self.path}: this output was made otherwise"
                f" ({_differences(lines[0]['made_with'], made_with)}); expected the same, another"
                " output, or --overwrite"
            )
        if overwrite:
            os.ftruncate(self._descriptor, 0)
            return
        if len(whole) < len(data):
            os.ftruncate(self._descriptor, len(whole))
        self.units = [unit for unit in units if self.is_whole(unit)]


def _is_at(descriptor: int, path: Path) -> bool:
    """Whether the open file is what stands at the path now."""
    try:
        return os.path.samestat(os.fstat(descriptor), os.stat(path))
    except FileNotFoundError:
        return False


def _differences(old: Mapping[str, Any], new: Mapping[str, Any]) -> str:
    names = [name for name in {**old, **new} if old.get(name) != new.get(name)]
    return ", ".join(f"{name} {old.get(name)}, now {new.get(name)}" for name in names[:3])
