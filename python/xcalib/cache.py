"""A folder of results that were expensive to compute, found again by the hash of what made them."""

from __future__ import annotations

import hashlib
import io
import os
import shutil
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .frames import write_bytes


def cache_folder() -> Path:
    """``XCALIB_CACHE``, or ``xcalib`` in the user's cache folder (``XDG_CACHE_HOME``)."""
    given = os.environ.get("XCALIB_CACHE")
    if given:
        return Path(given)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "xcalib"


class ResultCache:
    """Named arrays by key: written whole, checked as they are read.

    An entry that cannot be read counts as absent, and what cannot be written is computed again
    next time: a cache never makes a run fail.
    """

    def __init__(self, kind: str, folder: Path | None = None) -> None:
        self.folder = (folder or cache_folder()) / kind

    def _path(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.npz"

    def load(self, key: str) -> dict[str, NDArray[Any]] | None:
        """The arrays, or None; the zip's own checksums reveal a damaged entry."""
        try:
            with np.load(self._path(key), allow_pickle=False) as entry:
                return {name: entry[name] for name in entry.files}
        except Exception:  # numpy, zipfile and zlib have many, and which of them says nothing
            return None

    def store(self, key: str, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Write an entry."""
        buffer = io.BytesIO()
        np.savez(buffer, allow_pickle=False, **arrays)
        try:
            write_bytes(self._path(key), buffer.getvalue())
        except OSError as error:
            warnings.warn(f"results are not cached: {error}", RuntimeWarning, stacklevel=2)

    def size(self) -> tuple[int, int]:
        """Entries, and their bytes."""
        sizes = [path.stat().st_size for path in self.folder.glob("*/*.npz")]
        return len(sizes), sum(sizes)

    def clear(self) -> None:
        """Remove all entries of this kind."""
        shutil.rmtree(self.folder, ignore_errors=True)


def file_hash(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
