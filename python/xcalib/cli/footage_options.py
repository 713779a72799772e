"""The command-line options about footage."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import click

from ..footage import METHODS
from .options import file


def clock_offset(ctx: click.Context, param: click.Parameter, value: str) -> float | None:
    """Parse ``auto`` or seconds."""
    if value == "auto":
        return None
    try:
        seconds = float(value)
    except ValueError:
        seconds = math.nan
    if not math.isfinite(seconds):
        raise click.BadParameter(f"{value!r} is neither `auto` nor a number of seconds")
    return seconds


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
        help="By how much the source's clock is late [s], or `auto`: from the footage, and from its"
        " registration where a rig is given.",
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
)
