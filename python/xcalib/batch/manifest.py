"""What of an output is done: the journal beside it, or, behind a URL, an object a shard."""

from __future__ import annotations

import json
import os
import socket
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Protocol

from .._core import InputError, Ledger
from ..remote import child, file_system
from .units import Unit

NOTES = "register"
"""Folder of the objects."""
ALIVE = 300.0
"""After which a lock that was not renewed is of a run that was killed [s]."""
RENEWED = 60.0


class Manifest(Protocol):
    """Which frames there are, held by one run at a time."""

    there: dict[str, int]
    """Valid pixels of the frames that are there, by their keys."""

    def claim(self) -> None:
        """Before the first file has its name."""

    def note(self, shard: str, units: Sequence[Unit]) -> None:
        """Note what a shard has written."""

    def close(self) -> None:
        """Let go of it."""


class JournalManifest:
    """That of a run of one process."""

    def __init__(self, ledger: Ledger) -> None:
        self._ledger = ledger
        self.there = ledger.there

    def claim(self) -> None:
        """As `Manifest`."""
        self._ledger.claim()

    def note(self, shard: str, units: Sequence[Unit]) -> None:
        """As `Manifest`."""
        self._ledger.append([(unit.frames, unit.files) for unit in units])

    def close(self) -> None:
        """As `Manifest`."""
        self._ledger.close()


class ObjectLock:
    """An object that says who is writing to what is behind a URL, and that he still is."""

    def __init__(self, url: str, name: str) -> None:
        self._files, self._name = file_system(child(url, name))
        told = read_json(self._files, self._name)
        if told is not None and time.time() - float(told.get("time", 0)) < ALIVE:
            raise InputError(
                f"{url}: another run is writing to this output ({told.get('who')}), expected"
                f" its end; that of a run that was killed is over after {ALIVE:.0f} s"
            )
        if told is not None:
            self._files.rm_file(self._name)
        try:
            # Of two that come at the same time the store takes one.
            self._files.pipe_file(self._name, self._text(), mode="create")
        except FileExistsError:
            raise InputError(
                f"{url}: another run is writing to this output, expected its end"
            ) from None
        except (TypeError, NotImplementedError):  # a store that cannot tell
            self._files.pipe_file(self._name, self._text())
        self._renewed = time.monotonic()

    def _text(self) -> bytes:
        who = f"process {os.getpid()} on {socket.gethostname()}"
        return json.dumps({"who": who, "time": time.time()}).encode()

    def renew(self) -> None:
        """Say so again, if it is time to."""
        if time.monotonic() - self._renewed > RENEWED:
            self._files.pipe_file(self._name, self._text())
            self._renewed = time.monotonic()

    def close(self) -> None:
        """Let go of it."""
        self._files.rm_file(self._name)


def read_json(files: Any, name: str) -> dict[str, Any] | None:
    """The object of a JSON file; None where there is no file, {} where it has none."""
    try:
        value = json.loads(files.cat_file(name))
    except FileNotFoundError:
        return None
    except ValueError:
        return {}
    return value if isinstance(value, dict) else {}


class ObjectManifest:
    """An object a shard, since objects cannot be appended to; and one that is the lock."""

    def __init__(self, url: str, made_with: Sequence[tuple[str, str]], overwrite: bool) -> None:
        self._files, self._root = file_system(url)
        self._url, self._folder = url, f"{self._root.rstrip('/')}/{NOTES}"
        self._made_with = dict(made_with)
        self.there: dict[str, int] = {}
        self._lock = ObjectLock(url, f"{NOTES}/lock")
        try:
            self._load(overwrite)
        except BaseException:
            self.close()
            raise

    def _load(self, overwrite: bool) -> None:
        self._files.invalidate_cache()
        names = [
            name
            for name in (self._files.ls(self._folder, detail=False))
            if name.endswith(".json") and not name.endswith("/made_with.json")
        ]
        before = read_json(self._files, f"{self._folder}/made_with.json")
        if overwrite:
            for name in names:
                self._files.rm_file(name)
            before, names = None, []
        if before is None:
            self._write("made_with.json", self._made_with)
        elif before != self._made_with:
            differs = [
                f"{name} {before.get(name, 'none')}, now {self._made_with.get(name, 'none')}"
                for name in {**before, **self._made_with}
                if before.get(name) != self._made_with.get(name)
            ]
            raise InputError(
                f"{self._url}: this output was made otherwise ({', '.join(differs[:3])}); expected"
                " the same, another output, or --overwrite"
            )
        if names:
            for text in self._files.cat(names).values():
                for unit in json.loads(text):
                    self.there.update(Unit.from_json(unit).frames)

    def _write(self, name: str, value: Any) -> None:
        self._files.pipe_file(f"{self._folder}/{name}", json.dumps(value).encode())

    def claim(self) -> None:
        """As `Manifest`."""

    def note(self, shard: str, units: Sequence[Unit]) -> None:
        """As `Manifest`."""
        if units:
            self._write(f"{shard}.json", [unit.to_json() for unit in units])
        self._lock.renew()

    def close(self) -> None:
        """As `Manifest`."""
        self._lock.close()


def begun(open_ledger: Callable[[Path], Ledger]) -> Ledger:
    """A ledger that tells names, settings and the rig's size, of an output that is none."""
    with tempfile.TemporaryDirectory() as folder:
        ledger = open_ledger(Path(folder) / "output")
        ledger.close()
    return ledger
