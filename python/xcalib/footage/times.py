"""Times of frames from tables."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._core import times_of_table
from ..frames import InputError

if TYPE_CHECKING:
    from .stream import Stream, Times


def read_times(table: str | Path, stream: Stream) -> Times:
    """(N,) seconds of the frames of a stream from a CSV or TXT file of ``name timestamp`` lines.

    See `times_of_table`; names are those of the frames, with or without suffix.
    """
    try:
        text = Path(table).read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise InputError(f"{table}: not a text file of `name timestamp` lines") from None
    names = [stream.name(index) for index in range(len(stream))]
    return np.array(times_of_table(text, str(table), names))
