"""`xcalib view`: registered frames as pictures in which alignment can be seen."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..frames import check_file_writable, check_folder_writable
from ..overlays import KINDS
from ..progress import progress
from ..recording import write_recording
from ..rerun_log import write_rerun
from ..view import rate_of, registered, write_view
from .arguments import (
    check_writes,
    dry_run_option,
    frames_arguments,
    load_rig,
    open_frames,
    print_plan,
    quiet_option,
    rig_argument,
    threads_option,
    with_straight_rows,
)
from .errors import require_trusted, warn
from .options import output_option


@click.command("view", short_help="Overlays of registered frames, or a recording for Foxglove.")
@rig_argument
@frames_arguments
@dry_run_option
@output_option(
    "Folder of images (.png), a video (.mp4, .avi, .mkv), or a recording with the cameras and"
    " the registered images themselves, for Foxglove and ROS 2 (.mcap) or Rerun (.rrd)."
)
@click.option(
    "--overlay",
    type=click.Choice([*KINDS, "side"]),
    default="edges",
    show_default=True,
    help="Source edges on the reference, a blend, squares in turn, red and cyan, or side by side.",
)
@threads_option
@quiet_option
def command(
    rig_file: Path,
    output: Path,
    overlay: str,
    threads: int,
    quiet: bool,
    dry_run: bool,
    **inputs: Any,
) -> None:
    """Show every SOURCE image on its REFERENCE image, to look at."""
    rig = load_rig(rig_file)
    frames = with_straight_rows(open_frames(inputs, threads, rig), inputs, rig)
    check_writes([output], frames, inputs, rig_file)
    suffix = output.suffix.lower()
    if suffix in (".mp4", ".avi", ".mkv", ".mcap", ".rrd"):
        check_file_writable(str(output))
    else:
        check_folder_writable(output)
    if dry_run:
        print_plan(frames, [output])
        return
    every = progress(registered(frames, rig, threads), len(frames), "showing", quiet)
    if suffix == ".rrd":
        count = write_rerun(every, frames.fit(rig), output)
    elif suffix == ".mcap":
        count, lines = write_recording(every, frames.fit(rig), output)
        for line in lines:
            warn(line)
    else:
        count = write_view(every, rate_of(frames), overlay, output)
    click.echo(f"{count} frames: {output}")
    require_trusted(rig, rig_file)
