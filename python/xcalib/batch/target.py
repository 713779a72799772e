"""Where the files of shards go: a folder, or beside a video."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from .._core import is_video

ATTEMPTS = ".attempts"


@dataclass(frozen=True)
class LocalTarget:
    """A folder of this machine, or one that all workers see under this name."""

    output: Path

    @property
    def folder(self) -> Path:
        """Which names are relative to."""
        return self.output.parent if is_video(self.output) else self.output

    @property
    def suffix(self) -> str:
        """Of the video; empty for a folder."""
        return self.output.suffix if is_video(self.output) else ""

    @property
    def attempts(self) -> Path:
        """Where shards write before it is theirs to publish: on the same file system."""
        if is_video(self.output):
            return self.output.with_name(f".{self.output.name}{ATTEMPTS}")
        return self.output / ATTEMPTS

    @contextlib.contextmanager
    def attempt(self) -> Iterator[Path]:
        """A new folder, gone afterwards. Two that do the same shard do not meet."""
        folder = Path(tempfile.mkdtemp(dir=self.attempts))
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def publish(self, attempt: Path, names: Mapping[str, str]) -> None:
        """Give files of an attempt their names in the output: each whole, in place of the same."""
        folders = {(self.folder / name).parent for name in names.values()}
        for folder in folders:
            folder.mkdir(parents=True, exist_ok=True)
        for here, there in names.items():
            os.replace(attempt / here, self.folder / there)
        for folder in folders:
            _sync(folder)

    def begin(self) -> None:
        """Make room for attempts; what a killed run left of its own goes."""
        self.end()
        self.attempts.mkdir(parents=True)

    def end(self) -> None:
        """No attempt can publish any more."""
        shutil.rmtree(self.attempts, ignore_errors=True)


def _sync(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with contextlib.suppress(OSError):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)
