"""Where the files of shards go: a folder, beside a video, or behind a URL."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from .._core import InputError, is_video
from ..remote import file_system, is_url

ATTEMPTS = ".attempts"


@dataclass(frozen=True)
class LocalTarget:
    """A folder of this machine, or one that all workers see under this name."""

    output: Path

    @property
    def place(self) -> str:
        """Where it is, in words."""
        return str(self.output)

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

    @property
    def _sign(self) -> Path:
        """Is there as long as a run waits for its shards."""
        return self.attempts / "run"

    @contextlib.contextmanager
    def attempt(self) -> Iterator[Path]:
        """A new folder, gone afterwards. Two that do the same shard do not meet."""
        folder = Path(tempfile.mkdtemp(dir=self.attempts))
        try:
            yield folder
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            if not self._sign.exists():
                with contextlib.suppress(OSError):
                    self.attempts.rmdir()  # which this one has made again

    def publish(self, attempt: Path, names: Mapping[str, str]) -> None:
        """Give files of an attempt their names in the output: each whole, in place of the same."""
        if not self._sign.exists():
            raise FileNotFoundError(f"{self.output}: the run that asked for this has ended")
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
        self._sign.touch()

    def end(self) -> None:
        """No attempt can publish any more."""
        self._sign.unlink(missing_ok=True)
        shutil.rmtree(self.attempts, ignore_errors=True)


@dataclass(frozen=True)
class ObjectTarget:
    """A folder behind a URL: attempts are files of the worker, and whole objects are put."""

    url: str

    suffix = ""

    @property
    def place(self) -> str:
        """Where it is, in words."""
        return self.url

    @property
    def output(self) -> Path:
        """What tells it from others."""
        return Path(self.url)

    @contextlib.contextmanager
    def attempt(self) -> Iterator[Path]:
        """A new folder of this worker, gone afterwards."""
        with tempfile.TemporaryDirectory(prefix="xcalib-attempt-") as folder:
            yield Path(folder)

    def publish(self, attempt: Path, names: Mapping[str, str]) -> None:
        """Put files of an attempt, each as one object, in place of the same."""
        files, root = file_system(self.url)
        try:
            files.put(
                [str(attempt / here) for here in names],
                [f"{root.rstrip('/')}/{there}" for there in names.values()],
            )
        except OSError:
            raise
        except Exception as error:  # each store has errors of its own
            raise OSError(f"{self.url}: {error}") from None

    def begin(self) -> None:
        """Nothing is to be made."""

    def end(self) -> None:
        """What comes late is the same once more."""


Target = LocalTarget | ObjectTarget


def target_of(output: str | Path) -> Target:
    """Where an output is; ``file://`` is a folder of this machine."""
    text = str(output)
    if text.startswith("file://"):
        return LocalTarget(Path(text.removeprefix("file://")).absolute())
    if not is_url(text):
        return LocalTarget(Path(output).absolute())
    if is_video(Path(text.rpartition("/")[2])):
        raise InputError(f"{text}: a video is made of its parts here, expected a folder")
    if text.startswith(("zip://", "http://", "https://")) or "::" in text:
        raise InputError(f"{text}: cannot be written to, expected a store of objects or a folder")
    file_system(text)  # a scheme that is not there is refused before any work
    return ObjectTarget(text)


def _sync(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        with contextlib.suppress(OSError):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)
