"""`xcalib register`: source images on the reference pixels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..frames import check_output_writable
from ..registration import RegistrationOptions, run_registration
from .arguments import (
    WORDS,
    dry_run_option,
    frames_arguments,
    given_files,
    inputs_of,
    load_rig,
    open_frames,
    print_plan,
    quiet_option,
    rig_argument,
    say_depth,
    threads_option,
    with_straight_rows,
)
from .errors import NOT_TRUSTED, require_trusted, stop
from .options import Output
from .sections import Sectioned
from .workers_options import require_all, workers_options


@click.command(
    "register", cls=Sectioned, short_help="Bring SOURCE images onto the REFERENCE pixels."
)
@rig_argument
@frames_arguments
@dry_run_option
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    type=Output(check_output_writable, urls=True),
    required=True,
    help="Folder to write to: images under the reference's names, and masks/. Or a video: .mp4,"
    " .avi (8 bit), .mkv (without loss, gray also 16 bit), and its masks.",
)
@click.option("--overlay", "overlays", is_flag=True, help="Also write red-cyan overlays/.")
@click.option(
    "--overwrite",
    is_flag=True,
    help="Start over.  [default: resume an interrupted run of the same command]",
)
@click.option(
    "--nearest",
    is_flag=True,
    help="Take the nearest source pixel as it is: radiometric counts are never mixed."
    "  [default: bilinear]",
)
@click.option(
    "--occlusion",
    type=click.Choice(WORDS["occlusion"]),
    default="mark",
    show_default=True,
    help="Pixels hidden from the source by something nearer: not marked, marked in the mask, or"
    " black as well.",
)
@workers_options
@threads_option
@quiet_option
def command(
    rig_file: Path,
    output: Path | str,
    overlays: bool,
    overwrite: bool,
    nearest: bool,
    occlusion: str,
    workers: int,
    scheduler: str | None,
    threads: int,
    quiet: bool,
    dry_run: bool,
    **inputs: Any,
) -> None:
    """Bring every SOURCE image onto the pixels of its REFERENCE image.

    Images keep the source's type. Masks: 0 valid, 1 outside the source, 2 occluded, 3 no depth.

    Interrupted, the same command resumes: what is whole is not made again.
    """
    rig = load_rig(rig_file)
    frames = with_straight_rows(open_frames(inputs, threads, rig), inputs, rig, nearest)
    if dry_run:
        print_plan(frames, [output])
        return
    how = RegistrationOptions(threads, overlays, nearest, occlusion, overwrite)
    reads = [rig_file, *given_files(inputs)]
    if workers or scheduler or isinstance(output, str):
        from ..batch import open_workers, register

        with open_workers(scheduler, workers) as several:
            opened = inputs_of(inputs, threads)
            done = register(opened, rig, output, how, several, None, frames, inputs, reads, quiet)
        click.echo(f"{done.summary()}: {output}")
        say_depth(frames)
        require_all(done)
        valid = done.valid
    else:
        total = run_registration(frames, rig, output, how, inputs, quiet, reads)
        click.echo(f"{total.summary()}: {output}")
        say_depth(frames)
        valid = total.valid
    if not valid:
        stop(NOT_TRUSTED, f"no pixel of {output} is valid; see its masks")
    require_trusted(rig, rig_file)
