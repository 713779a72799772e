"""`--workers` and `--scheduler`, and how a run in shards ends."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from .errors import FAILED, NOT_TRUSTED, stop, warn
from .options import options

if TYPE_CHECKING:
    from ..batch import Registered

workers_options = options(
    click.option(
        "--workers",
        metavar="N",
        type=click.IntRange(0, 256),
        default=0,
        help="Register in so many processes, a range of frames each; --threads are then those of"
        " one.  [default: threads of one process]",
    ),
    click.option(
        "--scheduler",
        metavar="ADDRESS",
        help="Register on the workers of a Dask scheduler, tcp://HOST:PORT, which see the same"
        " files under the same names (needs xcalib-rgbt[dask]).",
    ),
)


def require_all(done: Registered) -> None:
    """End the command where frames are not there: 1 where trying again may help, else 3."""
    lines = list(done.problems())
    for line in lines[:-1]:
        warn(line)
    if lines:
        stop(FAILED if done.missing else NOT_TRUSTED, lines[-1])
