"""`xcalib demo`: a rendered rig, calibrated and registered."""

from __future__ import annotations

from pathlib import Path

import click

from ..demo import run_demo
from .arguments import COUNT, DEFAULTS, SEED, quiet_option
from .errors import NOT_TRUSTED, stop


@click.command("demo", short_help="Render a rig in a street, calibrate and register it.")
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    type=click.Path(path_type=Path),
    default=Path("xcalib-demo"),
    show_default=True,
    help="Folder to write to.",
)
@click.option(
    "--frames",
    "num_frames",
    metavar="N",
    type=COUNT,
    default=8,
    show_default=True,
    help="Frames to render.",
)
@click.option(
    "--seed",
    metavar="N",
    type=SEED,
    default=DEFAULTS.seed,
    show_default=True,
    help="Seed of the scene, its noise and the frame choice.",
)
@click.option("--night", is_flag=True, help="A dark visible image.")
@click.option(
    "--width",
    metavar="PX",
    type=click.IntRange(64, 2**16),
    default=None,
    show_default="as designed",
    help="Render the reference camera at this width, the source in proportion [px].",
)
@quiet_option
def command(
    output: Path, num_frames: int, seed: int, night: bool, width: int | None, quiet: bool
) -> None:
    """Render a rig in a street, calibrate it from the files, and compare with the truth."""
    result = run_demo(output, num_frames, seed, night, width, quiet, click.echo)
    if not result.converged:
        stop(NOT_TRUSTED, result.report.message)
