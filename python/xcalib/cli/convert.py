"""`xcalib convert`: rigs from and to other tools' files, and maps as tables and flow."""

from __future__ import annotations

from pathlib import Path

import click

from .. import _core
from ..convert import FORMATS, TOLERANCE, read_rig, write_rig
from ..convert.maps import MAPS, write_maps
from ..frames import InputError
from .errors import warn
from .options import Input, number, output_option


def size(ctx: click.Context, param: click.Parameter, value: str | None) -> tuple[int, int] | None:
    """Parse ``WxH`` in pixels."""
    if value is None:
        return None
    width, x, height = value.partition("x")
    if not (x and width.isdecimal() and height.isdecimal() and int(width) and int(height)):
        raise click.BadParameter(f"{value!r} is no size WxH in px, as 640x512")
    return int(width), int(height)


WRITTEN = [name for name, kind in FORMATS.items() if kind.write or name == "xcalib"]


@click.command("convert", short_help="Rigs from and to other tools' files; maps as flow.")
@click.argument("files", metavar="FILE...", type=Input(), nargs=-1, required=True)
@output_option("File to write, or folder, where the format has several.")
@click.option(
    "--from",
    "from_format",
    type=click.Choice(list(FORMATS)),
    help="What the files are.  [default: by what is in them]",
)
@click.option(
    "--to",
    type=click.Choice([*WRITTEN, *MAPS]),
    default="xcalib",
    show_default=True,
    help="What to write: a rig, or its map for a depth (remap: .npy for cv2.remap; flo: .flo;"
    " kitti-flow: .png).",
)
@click.option(
    "--reference-size",
    metavar="WxH",
    callback=size,
    help="Size of the reference's images, where the files have none [px].",
)
@click.option(
    "--source-size",
    metavar="WxH",
    callback=size,
    help="Size of the source's images, where the files have none [px].",
)
@number(
    "--tolerance",
    "PX",
    TOLERANCE,
    "How far a corner of an image may move by what the format cannot hold [px].",
)
@click.option(
    "--depth",
    metavar="M|FILE|FOLDER",
    help="Of a map: metres, the same everywhere, a depth map, or a folder of them.",
)
@click.option(
    "--depth-scale",
    metavar="M",
    type=float,
    help="Metres per unit of the numbers in depth maps.  [default: 1/256 of PNG, else 1]",
)
def command(
    files: tuple[Path, ...],
    output: Path,
    from_format: str | None,
    to: str,
    reference_size: tuple[int, int] | None,
    source_size: tuple[int, int] | None,
    tolerance: float,
    depth: str | None,
    depth_scale: float | None,
) -> None:
    """Write a rig as another tool has it, or read another tool's.

    FILE is a rig file, or the files of another tool (the reference's first), or a folder of them.
    What a format cannot hold is a warning, or refused where it moves a corner by more than
    --tolerance.
    """
    if (to in MAPS) != (depth is not None):
        raise click.UsageError(
            f"--to {to} is a map, expected --depth with it"
            if to in MAPS
            else f"--depth goes with a map, --to is {to}, expected one of {', '.join(MAPS)}"
        )
    rig = read_rig(*files, kind=from_format, sizes=(reference_size, source_size))
    for line in _core.implausible(rig):
        warn(f"{files[0]}: {line}")
    refuse_input(output, [*files, *([Path(depth)] if depth else [])])
    if depth is not None:
        lines = write_maps(rig, depth, _core.DepthUnits(scale=depth_scale), output, to)
    else:
        lines = write_rig(rig, output, to, tolerance)
    for line in lines:
        warn(line)
    click.echo(f"{to}: {output}")


def refuse_input(output: Path, inputs: list[Path]) -> None:
    """Nothing that is read is written to, whichever links lead there."""
    target = output.resolve()
    for path in inputs:
        if path.exists() and path.resolve() in (target, *target.parents):
            raise InputError(f"{output}: would be written to, and {path} is read")
