"""`xcalib evaluate`: scores of registered images."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import click

from ..evaluate import evaluate, evaluation_document
from ..frames import check_file_writable, write_bytes
from ..pipeline import progress
from .arguments import (
    COUNT,
    check_writes,
    colormap_option,
    frames_arguments,
    load_rig,
    open_frames,
    quiet_option,
    rig_argument,
    threads_option,
    with_scalar_sources,
)
from .errors import NOT_TRUSTED, require_trusted, stop
from .options import Output


@click.command("evaluate", short_help="Score registered SOURCE images against REFERENCE.")
@rig_argument
@frames_arguments
@click.option(
    "--width",
    metavar="PX",
    type=COUNT,
    default=640,
    show_default=True,
    help="Judge at the reference size divided by the least integer that makes it this wide [px].",
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
    json_file: Path | None,
    source_colormap: str,
    threads: int,
    quiet: bool,
    **inputs: Any,
) -> None:
    """Score the registered SOURCE against REFERENCE, beside the source that is only resized."""
    rig = load_rig(rig_file)
    frames = open_frames(inputs, threads, rig)
    check_writes([json_file], frames, inputs, rig_file)
    frames = with_scalar_sources(frames, source_colormap)
    # Depth wants the reference image too: tee hands it on, so that it is read once.
    references, for_depth = itertools.tee(frames.references)
    result = evaluate(
        rig,
        progress(references, len(frames), "evaluating", quiet),
        frames.sources,
        (frames.depth(index, image) for index, image in enumerate(for_depth)),
        width,
        threads,
    )
    click.echo(result.table())
    if json_file is not None:
        names = [frames.references.where(index) for index in range(len(frames))]
        write_bytes(json_file, evaluation_document(result, str(rig_file), names).encode())
    if not result.valid_share:
        stop(NOT_TRUSTED, f"no pixel is valid in {len(frames)} frames, nothing could be scored")
    require_trusted(rig, rig_file)
