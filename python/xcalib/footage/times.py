"""Times of frames from file names and from tables."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..frames import InputError

if TYPE_CHECKING:
    from .stream import Stream, Times

# Since 1970: 19 digits of nanoseconds, 16 of microseconds, 13 of milliseconds; or seconds with a
# fraction. Plain seconds could be any number, and so are not taken for times.
_NAME = re.compile(r"(?<![0-9.])(?:(\d{9,10})\.(\d+)|(\d{19})|(\d{16})|(\d{13}))(?![0-9.])")


def times_of_names(names: Sequence[str]) -> Times | None:
    """(N,) seconds where every name holds one time since 1970 and they rise; None otherwise."""
    times = np.empty(len(names))
    for index, name in enumerate(names):
        found = _NAME.findall(name)
        if len(found) != 1:
            return None
        seconds, fraction, *whole = found[0]
        digits = next((digits for digits in whole if digits), "")
        text = f"{seconds}.{fraction}" if seconds else f"{digits[:10]}.{digits[10:]}"
        times[index] = float(text)
    return times if len(times) and (np.diff(times) > 0).all() else None


def read_times(table: str | Path, stream: Stream) -> Times:
    """(N,) seconds of the frames of a stream from a CSV or TXT file of ``name timestamp`` lines.

    Names are those of the frames, with or without suffix, separated from the time by a comma,
    semicolon or blanks; lines of other kinds (a header, ``#`` comments) may only come first. Times
    of 19, 16 or 13 digits are nano-, micro- and milliseconds, others seconds.
    """
    table = Path(table)
    try:
        lines = table.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError:
        raise InputError(f"{table}: not a text file of `name timestamp` lines") from None
    found: dict[str, float] = {}
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        cells = [cell.strip(" \"'") for cell in re.split(r"\s*[,;]\s*|\s+", line.strip())]
        try:
            name, time = cells[0], _seconds(cells[1])
        except (IndexError, ValueError):
            if not found:
                continue  # a header
            raise InputError(
                f"{table} line {number}: {line.strip()!r}, expected `name timestamp`"
            ) from None
        found[name] = found[Path(name).stem] = time
    names = [stream.name(index) for index in range(len(stream))]
    lost = [name for name in names if name not in found]
    if lost:
        raise InputError(
            f"{table}: no time of {lost[0]}"
            + (f" and {len(lost) - 1} more" if len(lost) > 1 else "")
            + ", expected a line `name timestamp` for each frame"
        )
    times = np.array([found[name] for name in names])
    falling = np.flatnonzero(np.diff(times) < 0)
    if falling.size:
        raise InputError(
            f"{table}: {names[falling[0] + 1]} is earlier than {names[falling[0]]},"
            " expected rising times in the order of the frames"
        )
    return times


def _seconds(text: str) -> float:
    units = {19: 1e-9, 16: 1e-6, 13: 1e-3}
    value = float(text) * (units.get(len(text), 1.0) if text.isdigit() else 1.0)
    if not np.isfinite(value):
        raise ValueError
    return value
