"""The command-line options about footage."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from .._core import TimeOffset, parse_readout, parse_time_offset
from ..footage import METHODS
from .options import file


def readout(ctx: click.Context, param: click.Parameter, value: str) -> float | None:
    """Parse a share, or ``auto``: None."""
    return parse_readout(param.opts[0], value)


def clock_offset(ctx: click.Context, param: click.Parameter, value: str) -> TimeOffset:
    """Parse ``auto``, seconds or source frames."""
    return parse_time_offset(value)


FOOTAGE_OPTIONS: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "--pair",
        "pairing",
        type=click.Choice(METHODS),
        default="auto",
        show_default=True,
        help="Pair frames by name, order or time; auto: by time where both have times.",
    ),
    click.option(
        "--time-offset",
        metavar="S",
        default="0",
        show_default=True,
        callback=clock_offset,
        help="By how much the source's clock is late: seconds, source frames (`2f`), or `auto`:"
        " from the footage, and from its registration.",
    ),
    click.option(
        "--max-gap",
        metavar="S",
        type=click.FloatRange(0, min_open=True),
        help="Largest distance in time of a pair [s].  [default: half the slower one's period]",
    ),
    *(
        file(
            f"--{name}-times",
            f"Times of the {name} frames: lines `name timestamp`.  [default: their own]",
        )
        for name in ("reference", "source")
    ),
    click.option(
        "--exif-orientation",
        type=click.Choice(["ignore", "apply"]),
        default="ignore",
        show_default=True,
        help="Image files that say how their picture is to be turned: take pixels as they are"
        " stored, or turn them.",
    ),
    *(
        click.option(
            f"--{camera}-readout",
            metavar="SHARE",
            default="0",
            show_default=True,
            callback=readout,
            help=f"Rolling shutter of the {camera}: the time from its first row to its last, as a"
            " share of that from frame to frame, 0 to 1; auto: calibrate finds it from what moves.",
        )
        for camera in ("source", "reference")
    ),
)
