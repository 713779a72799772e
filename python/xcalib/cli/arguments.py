"""Arguments that several commands share, and what they open."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import click

from .. import _core
from .._core import (
    CalibrationOptions,
    DepthUnits,
    Rig,
    _option_words,
    depth_choices,
    depth_unit_of,
    plan_text,
)
from ..depth import MeasuredDepth, NetworkOptions, PlaneDepth
from ..footage import Matching
from ..frames import InputError
from ..inputs import Inputs
from ..pipeline import Frames
from .depth_options import DEPTH_OPTIONS
from .errors import warn
from .footage_options import FOOTAGE_OPTIONS
from .options import Input, options

DEFAULTS = CalibrationOptions()
WORDS = _option_words()
"""What an option may be, by its name."""
SEED = click.IntRange(0, 2**32 - 1)
COUNT = click.IntRange(1, 2**31 - 1)

config_option = click.option(
    "--config",
    metavar="FILE",
    expose_value=False,
    help="Take arguments from a YAML file, by their names without dashes (reference, source,"
    " depth, ...); those given here go before.",
)
frames_arguments = options(
    click.argument("reference", type=Input(urls=True)),
    click.argument("source", type=Input(urls=True)),
    *DEPTH_OPTIONS,
    *FOOTAGE_OPTIONS,
    config_option,
)

dry_run_option = click.option(
    "--dry-run",
    is_flag=True,
    help="Print what would be read, paired and written, and do no more.",
)
quiet_option = click.option("--quiet", is_flag=True, help="No progress bars.")
threads_option = click.option(
    "--threads",
    type=click.IntRange(0, _core.max_threads()),
    default=DEFAULTS.num_threads,
    show_default=True,
    help="Threads to use; 0 means all cores.",
)
colormap_option = click.option(
    "--source-colormap",
    metavar="MAP",
    default="auto",
    show_default=True,
    help="False-colour source images: turn them back to numbers if they are (auto), never (none),"
    " or by a map of that name (inferno, jet, iron, ...).",
)


def load_rig(path: Path) -> Rig:
    """The rig of a file, ours or another tool's, with a warning of what is not plausible in it."""
    from ..convert import is_foreign, read_rig  # seldom needed, and it loads much

    rig = read_rig(path) if is_foreign(path) else Rig.load(path)
    for line in _core.implausible(rig):
        warn(f"{path}: {line}")
    return rig


rig_argument = click.argument("rig_file", metavar="RIG", type=Input())


def units_of(arguments: Mapping[str, Any]) -> DepthUnits:
    """What the numbers of depth maps mean, by the names of the command's parameters."""
    scale, unit = arguments["depth_scale"], arguments["depth_unit"]
    if scale is not None and unit is not None:
        raise click.UsageError(
            "--depth-unit and --depth-scale both say the unit, expected one of them"
        )
    return DepthUnits(
        scale=depth_unit_of(unit) if unit is not None else scale,
        invalid=list(arguments["depth_invalid"]),
    )


def inputs_of(arguments: Mapping[str, Any], threads: int) -> Inputs:
    """The values of `frames_arguments`, by the names of the command's parameters."""
    a = arguments
    return Inputs(
        a["reference"],
        a["source"],
        a["depth_spec"],
        units_of(a),
        Matching(
            a["pairing"],
            None if a["time_offset"].automatic else a["time_offset"].seconds,
            a["max_gap"],
            a["reference_times"],
            a["source_times"],
            a["time_offset"].frames,
            a["exif_orientation"],
        ),
        PlaneDepth(a["camera_height"], a["horizon"], a["far"], a["plane_hfov"], a["plane_roll"]),
        NetworkOptions(
            a["depth_recipe"],
            a["depth_focal"],
            a["inverse_scale"],
            a["inverse_shift"],
            a["providers"],
            threads,
        ),
        MeasuredDepth(**{field.name: a[field.name] for field in fields(MeasuredDepth)}),
        (a["source_readout"] or 0.0, a["reference_readout"] or 0.0),
    )


def open_frames(arguments: Mapping[str, Any], threads: int, rig: Rig | None) -> Frames:
    """Open what `frames_arguments` names, and print how frames were paired by time."""
    if arguments["depth_spec"] is None:
        click.echo(depth_choices(), err=True)
        raise InputError("--depth is missing, expected one of those above")
    frames = Frames.open(inputs_of(arguments, threads), rig)
    for note in frames.notes:
        click.echo(note, err=True)
    return frames


def given_files(arguments: Mapping[str, Any]) -> list[Path]:
    """The files that `frames_arguments` name, besides those of the frames."""
    files = [value for value in arguments.values() if isinstance(value, Path)]
    spec = arguments["depth_spec"]
    return [*files, Path(spec), Path(spec).with_suffix(".yaml")]


def check_writes(
    files: Sequence[Path | None],
    frames: Frames,
    arguments: Mapping[str, Any],
    *other_reads: Path | None,
) -> None:
    """Refuse to write to what a run on these frames reads, see `_core.check_writes`."""
    reads = [path for path in (*other_reads, *given_files(arguments)) if path]
    outputs = [path for path in files if path is not None]
    _core.check_writes(outputs, frames.references, frames.sources, frames.depth, reads)


def with_scalar_sources(frames: Frames, colormap: str) -> Frames:
    """The frames with false colour turned back to numbers, with a line on stderr."""
    frames, line = frames.with_scalar_sources(colormap)
    if line:
        click.echo(line, err=True)
    return frames


def with_straight_rows(
    frames: Frames,
    arguments: Mapping[str, Any],
    rig: Rig | None,
    nearest: bool = False,
    may_be_auto: bool = False,
) -> Frames:
    """The frames straightened by the readouts given; ``auto`` is none, where it may be given."""
    source, reference = arguments["source_readout"], arguments["reference_readout"]
    if not may_be_auto and None in (source, reference):
        camera = "source" if source is None else "reference"
        raise click.UsageError(
            f"--{camera}-readout auto: expected the share that calibrate has found"
        )
    if source is None and reference is None:
        raise click.UsageError(
            "--source-readout auto --reference-readout auto: only how they differ can be seen;"
            " expected a share for one of them"
        )
    return frames.with_straight_rows(source or 0, reference or 0, rig, nearest)


def say_depth(frames: Frames) -> None:
    """What the numbers of the depth maps were taken for, once it is known that they will do."""
    if frames.depth_line:
        click.echo(frames.depth_line)


def print_plan(
    frames: Frames, outputs: Sequence[Path | str | None], chosen: Sequence[int] = ()
) -> None:
    """What a run would read, pair, choose and write."""
    click.echo(plan_text(frames.references, frames.sources, frames.depth, list(chosen)))
    say_depth(frames)
    for path in outputs:
        if path is not None:
            click.echo(f"would be written: {path}")
