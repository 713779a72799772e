"""`xcalib evaluate`: scores of registered images."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..evaluation import evaluate, evaluation_document
from ..footage import Picked, open_stream
from ..frames import InputError, check_file_writable, write_bytes
from ..pipeline import Frames
from ..progress import progress
from .arguments import (
    COUNT,
    check_writes,
    colormap_option,
    dry_run_option,
    frames_arguments,
    load_rig,
    open_frames,
    print_plan,
    quiet_option,
    rig_argument,
    say_depth,
    threads_option,
    with_scalar_sources,
    with_straight_rows,
)
from .errors import NOT_TRUSTED, require_trusted, stop, warn
from .options import Input, Output
from .sections import Sectioned


@click.command(
    "evaluate", cls=Sectioned, short_help="Score registered SOURCE images against REFERENCE."
)
@rig_argument
@frames_arguments
@dry_run_option
@click.option(
    "--width",
    metavar="PX",
    type=COUNT,
    default=640,
    show_default=True,
    help="Judge at the reference size divided by the least integer that makes it this wide [px].",
)
@click.option(
    "--registered",
    metavar="DIR",
    type=Input(),
    help="Also score these images, the source as another method registers it, over the same pixels:"
    " named as the reference's, or as many.",
)
@click.option(
    "--json",
    "json_file",
    metavar="FILE",
    type=Output(check_file_writable),
    help="Also write all scores, frame by frame (JSON).",
)
@colormap_option
@threads_option
@quiet_option
def command(
    rig_file: Path,
    width: int,
    registered: Path | None,
    json_file: Path | None,
    source_colormap: str,
    threads: int,
    quiet: bool,
    dry_run: bool,
    **inputs: Any,
) -> None:
    """Score the registered SOURCE against REFERENCE, beside the source that is only resized."""
    rig = load_rig(rig_file)
    frames = open_frames(inputs, threads, rig)
    check_writes([json_file], frames, inputs, rig_file)
    if dry_run:
        print_plan(frames, [json_file])
        return
    frames = with_scalar_sources(frames, source_colormap)
    frames = with_straight_rows(frames, inputs, rig)
    result = evaluate(
        rig,
        progress(frames.references, len(frames), "evaluating", quiet),
        frames.sources,
        frames.depth,
        width,
        threads,
        None if registered is None else given_images(registered, frames),
        judge=True,
    )
    click.echo(result.table())
    if result.verdict is not None:
        click.echo(result.verdict_line())
    say_depth(frames)
    if json_file is not None:
        names = [frames.references.where(index) for index in range(len(frames))]
        write_bytes(json_file, evaluation_document(result, str(rig_file), names).encode())
    if not result.valid_share:
        stop(NOT_TRUSTED, f"no pixel is valid in {len(frames)} frames, nothing could be scored")
    if line := result.difference(rig, str(rig_file)):
        warn(line)
    require_trusted(rig, rig_file)


def given_images(spec: Path, frames: Frames) -> Picked:
    """The images of another method, one for each reference: by name, or as many in order."""
    given = open_stream(spec)
    names = {given.name(index): index for index in range(len(given))}
    wanted = [frames.references.name(index) for index in range(len(frames))]
    if all(name in names for name in wanted):
        return Picked(given, [names[name] for name in wanted])
    if len(given) == len(wanted):
        return Picked(given, list(range(len(wanted))))
    missing = next(name for name in wanted if name not in names)
    raise InputError(
        f"--registered {spec}: {len(given)} images, and none named {missing}; expected one for each"
        f" of the {len(wanted)} reference frames, of its name"
    )
