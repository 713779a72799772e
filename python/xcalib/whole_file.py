"""Output files that are never seen half-written."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType


class WholeFile:
    """A file that is written under another name and takes its own once it is complete.

    >>> with WholeFile("rig.yaml") as partial:
    ...     partial.write_text("...")

    An exception in the block removes what was written, and leaves alone what stood there before.

    Parameters
    ----------
    path
        The file, in a folder that exists.
    partial
        Where to write until then, on the same file system; None: hidden, beside ``path``.
    """

    def __init__(self, path: str | Path, partial: Path | None = None) -> None:
        self.path = Path(path)
        self.partial = partial or self.path.with_name(f".{self.path.name}.{os.getpid()}.partial")

    def keep(self) -> None:
        """The file is complete."""
        os.replace(self.partial, self.path)

    def discard(self) -> None:
        """Remove what was written, unless it was kept."""
        self.partial.unlink(missing_ok=True)

    def __enter__(self) -> Path:
        return self.partial

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if error is None:
                self.keep()
        finally:
            self.discard()
