"""`xcalib transfer`: labels of one image on the other."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..frames import (
    IMAGE_SUFFIXES,
    InputError,
    check_file_writable,
    check_folder_writable,
    encode_image,
    list_files,
    read_image,
    size_of,
    write_bytes,
)
from ..labels.coco import transfer_coco
from ..labels.frames import LabelledFrames
from ..labels.points import transfer_points
from ..labels.yolo import transfer_yolo
from ..progress import progress
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
)
from .errors import NOT_TRUSTED, require_trusted, stop
from .options import Input, output_option


@click.command("transfer", short_help="Carry labels from one camera's images to the other's.")
@rig_argument
@frames_arguments
@dry_run_option
@click.option(
    "--labels",
    metavar="LABELS",
    type=Input(),
    required=True,
    help="COCO annotations (.json), a folder of YOLO labels (.txt) or of masks (.png), or a table"
    " of points (.csv with image, x, y).",
)
@click.option(
    "--to",
    type=click.Choice(["source", "reference"]),
    default="source",
    show_default=True,
    help="Whose images get the labels; they are the other's.",
)
@output_option("File to write, or folder, of the same kind as LABELS.")
@threads_option
@quiet_option
def command(
    rig_file: Path,
    labels: Path,
    to: str,
    output: Path,
    threads: int,
    quiet: bool,
    dry_run: bool,
    **inputs: Any,
) -> None:
    """Carry labels from one camera's images to the other's, through depth.

    Boxes and polygons go as one thing at the depth of what is in them, points and masks pixel by
    pixel. What is outside is left out; what is clipped, occluded or ambiguous is counted, and noted
    in COCO files.
    """
    if inputs["source_readout"] != 0 or inputs["reference_readout"] != 0:
        raise click.UsageError(
            "--source-readout and --reference-readout go with images, not with labels; expected"
            " neither"
        )
    rig = load_rig(rig_file)
    frames = open_frames(inputs, threads, rig)
    check_writes([output], frames, inputs, rig_file, labels)
    if labels.is_dir():
        check_folder_writable(output)
    else:
        check_file_writable(str(output))
    if dry_run:
        print_plan(frames, [output])
        click.echo(f"labels: {labels}")
        return
    labelled = LabelledFrames(frames, frames.fit(rig), to)
    if labels.is_dir():
        for name, data in of_folder(labels, labelled, quiet).items():
            write_bytes(output / name, data)
    else:
        write_bytes(output, of_file(labels, labelled).encode())
    click.echo(f"{labelled.summary()}: {output}")
    gone = sum(labelled.counts[what] for what in ("outside", "no depth", "ambiguous"))
    if labelled.counts["labels"] and gone == labelled.counts["labels"]:
        stop(NOT_TRUSTED, "no label has a sure place in the other images")
    require_trusted(rig, rig_file)


def of_file(labels: Path, labelled: LabelledFrames) -> str:
    """The file of the other images."""
    suffix = labels.suffix.lower()
    if suffix == ".json":
        return transfer_coco(labels, labelled)
    if suffix == ".csv":
        return transfer_points(labels, labelled)
    raise InputError(f"{labels}: expected COCO's .json, a .csv of points, or a folder")


def of_folder(labels: Path, labelled: LabelledFrames, quiet: bool) -> dict[str, bytes]:
    """The files of the other images, by name."""
    if any(path.suffix.lower() == ".txt" for path in labels.iterdir()):
        return {name: text.encode() for name, text in transfer_yolo(labels, labelled).items()}
    files = {}
    masks = list_files(labels, IMAGE_SUFFIXES)
    for path in progress(masks, len(masks), "masks", quiet):
        index, name = labelled.partner(path.name, str(path))
        mask, shapes = read_image(path), labelled.shapes(index)
        if mask.ndim != 2 or size_of(mask) != shapes.size:
            raise InputError(
                f"{path}: {'x'.join(map(str, mask.shape[1::-1]))} px, {mask.ndim} dimensions;"
                f" expected a gray mask of {shapes.size[0]}x{shapes.size[1]} px"
            )
        moved = shapes.mask(mask)
        labelled.count(() if moved.any() or not mask.any() else ("outside",))
        files[f"{Path(name).stem}.png"] = encode_image("mask.png", moved)
    return files
