"""The ``xcalib`` command.

Results go to stdout, progress and errors to stderr. Exit codes: 0 done and trusted, 1 failed,
2 wrong usage or input, 3 done, but the result is not to be trusted.
"""

from __future__ import annotations

import errno
import itertools
import json
import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import fields
from importlib.metadata import version
from pathlib import Path
from typing import Any, NoReturn

import click

from ._core import CalibrationOptions, Pinhole, Rig
from .cli_options import options
from .demo import run_demo
from .depth import MeasuredDepth, NetworkOptions, PlaneDepth
from .depth.options import DEPTH_OPTIONS
from .evaluate import as_document, evaluate
from .flow import FlowProvider, NetworkFlow
from .footage import Matching, camera_infos, is_bag, is_video
from .footage.options import FOOTAGE_OPTIONS
from .frames import (
    Image,
    InputError,
    check_file_writable,
    check_folder_writable,
    size_of,
    write_bytes,
)
from .inputs import Inputs
from .inspection import describe, facts_text
from .models_command import models
from .pipeline import (
    Frames,
    choose_by_content,
    left_out,
    progress,
    run_calibration,
    save_rig,
    with_fitted_plane,
)
from .registration import RegistrationOptions, run_registration

FAILED, WRONG_INPUT, NOT_TRUSTED = 1, 2, 3
DEFAULTS = CalibrationOptions()
SEED = click.IntRange(0, 2**32 - 1)


# -- Errors --------------------------------------------------------------------------------------


def stop(code: int, message: str) -> NoReturn:
    """End the command with one line on stderr."""
    label = "not to be trusted" if code == NOT_TRUSTED else "error"
    click.echo(f"{label}: {' '.join(message.split())}", err=True)
    sys.exit(code)


class Commands(click.Group):
    """A group that turns every expected exception into one line and an exit code."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (click.exceptions.Exit, click.exceptions.Abort):
            raise  # these are click's own control flow, and RuntimeErrors
        except click.ClickException as error:
            stop(WRONG_INPUT, error.format_message())
        except KeyboardInterrupt as error:
            stop(FAILED, str(error) or "interrupted")
        except OSError as error:
            if error.errno == errno.EPIPE:
                raise  # the reader of our output left: click ends quietly
            named = f"{error.filename}: {error.strerror}" if error.filename else str(error)
            stop(WRONG_INPUT, named)
        except ValueError as error:
            stop(WRONG_INPUT, str(error))
        except (RuntimeError, MemoryError) as error:
            stop(FAILED, str(error) or "out of memory")


# -- Arguments that commands share ---------------------------------------------------------------


def intrinsics(
    ctx: click.Context, param: click.Parameter, value: str | None
) -> tuple[float, float, float, float] | None:
    """Parse ``FX,FY,CX,CY`` in pixels."""
    if value is None:
        return None
    try:
        fx, fy, cx, cy = (float(part) for part in value.split(","))
    except ValueError:
        raise click.BadParameter(f"{value!r} is not four numbers FX,FY,CX,CY") from None
    if not (fx > 0 and fy > 0 and all(map(math.isfinite, (fx, fy, cx, cy)))):
        raise click.BadParameter(f"{value!r}: expected finite numbers, FX and FY above 0 px")
    return fx, fy, cx, cy


def flow_of(spec: str) -> tuple[str, FlowProvider | None]:
    """What ``--flow`` says: the mode of the options, and the provider, None for the built-in."""
    if spec in ("auto", "off"):
        return spec, None
    if spec == "patch":
        return "on", None
    if not spec.endswith(".onnx"):
        raise click.UsageError(f"--flow is {spec!r}, expected auto, off, patch or a .onnx file")
    return "on", NetworkFlow(spec)


frames_arguments = options(
    click.argument("reference", type=click.Path(path_type=Path)),
    click.argument("source", type=click.Path(path_type=Path)),
    *DEPTH_OPTIONS,
    *FOOTAGE_OPTIONS,
)


def inputs_of(arguments: Mapping[str, Any], threads: int) -> Inputs:
    """The values of `frames_arguments`, by the names of the command's parameters."""
    a = arguments
    return Inputs(
        a["reference"],
        a["source"],
        a["depth_spec"],
        a["depth_scale"],
        Matching(
            a["pairing"], a["time_offset"], a["max_gap"], a["reference_times"], a["source_times"]
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
    )


def open_frames(arguments: Mapping[str, Any], threads: int, rig: Rig | None) -> Frames:
    """Open what `frames_arguments` names, and say how frames were paired by time."""
    frames = Frames.open(inputs_of(arguments, threads), rig)
    for note in frames.notes:
        click.echo(note, err=True)
    return frames


quiet_option = click.option("--quiet", is_flag=True, help="No progress bars.")
threads_option = click.option(
    "--threads",
    type=click.IntRange(min=0),
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
rig_argument = click.argument("rig_file", metavar="RIG", type=click.Path(path_type=Path))


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(version("xcalib-rgbt"), prog_name="xcalib")
def cli() -> None:
    """Calibrate a fixed pair of cameras, visible and thermal, and register their frames.

    REFERENCE and SOURCE are folders or patterns of images (8 or 16 bit, any size), videos, or
    bags with a topic (drive.mcap#/camera/image_raw); #left, #right, #top or #bottom behind one
    takes half of each frame.

    Exit codes: 0 done and trusted, 1 failed, 2 wrong usage or input, 3 done, but the result is
    not to be trusted.
    """


# -- calibrate -----------------------------------------------------------------------------------


@cli.command("calibrate")
@frames_arguments
@click.option(
    "-o",
    "--output",
    metavar="RIG",
    type=click.Path(path_type=Path),
    required=True,
    help="Rig file to write (YAML).",
)
@click.option(
    "--frames",
    "max_frames",
    metavar="N",
    type=click.IntRange(min=1),
    default=DEFAULTS.max_frames,
    show_default=True,
    help="Frames to use at most.",
)
@click.option(
    "--seed",
    metavar="N",
    type=SEED,
    default=DEFAULTS.seed,
    show_default=True,
    help="Seed of the frame choice.",
)
@click.option(
    "--choose",
    type=click.Choice(["informed", "spread"]),
    default="informed",
    show_default=True,
    help="Frames by what they say about the rig (looks at 4 N), or spread over the footage.",
)
@click.option(
    "--explain", is_flag=True, help="Print why each frame was taken or left (--choose informed)."
)
@colormap_option
@threads_option
@click.option(
    "--initial",
    metavar="RIG",
    type=click.Path(path_type=Path),
    help="Rig file to start from.  [default: none, searched]",
)
@click.option(
    "--search",
    type=click.Choice(["auto", "full", "local", "off"]),
    default=DEFAULTS.search.mode,
    show_default=True,
    help="Global search before refinement: full, local (around the initial rig), off, or auto.",
)
@click.option(
    "--flow",
    "flow_spec",
    metavar="auto|off|patch|MODEL.onnx",
    default="auto",
    show_default=True,
    help="The flow term: patch, built in, or a network of two images; auto is patch where nothing"
    " is searched.",
)
@click.option(
    "--solver",
    type=click.Choice(["ceres", "adam"]),
    default=DEFAULTS.solver,
    show_default=True,
    help="adam is the paper's, which searches nothing.",
)
@click.option(
    "--reference-intrinsics",
    metavar="FX,FY,CX,CY",
    callback=intrinsics,
    help="Known intrinsics of the reference camera, kept [px].  [default: none]",
)
@click.option(
    "--source-intrinsics",
    metavar="FX,FY,CX,CY",
    callback=intrinsics,
    help="Known intrinsics of the source camera, kept [px].  [default: none, estimated]",
)
@click.option(
    "--reference-hfov",
    metavar="DEG",
    type=click.FloatRange(0, 180, min_open=True, max_open=True),
    default=DEFAULTS.reference_hfov_deg,
    show_default="searched" if DEFAULTS.reference_hfov_deg is None else True,
    help="Horizontal field of view of the reference camera at the start [deg].",
)
@click.option(
    "--optimize-reference",
    is_flag=True,
    default=DEFAULTS.optimize_reference,
    help="Estimate the reference intrinsics too.  [default: kept]",
)
@click.option(
    "--working-width",
    metavar="PX",
    type=click.IntRange(min=1),
    default=DEFAULTS.working_width,
    show_default=True,
    help="Reference width that calibration works at [px].",
)
@click.option(
    "--refine-plane",
    is_flag=True,
    help="With --depth plane: find the horizon and the roll from the footage (some 17 quick fits),"
    " and print them for `register`.",
)
@click.option(
    "--report",
    "report_file",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Also write the full report (JSON), for `xcalib report`.",
)
@quiet_option
def calibrate_command(
    output: Path,
    max_frames: int,
    seed: int,
    choose: str,
    explain: bool,
    source_colormap: str,
    threads: int,
    initial: Path | None,
    search: str,
    flow_spec: str,
    solver: str,
    reference_intrinsics: tuple[float, float, float, float] | None,
    source_intrinsics: tuple[float, float, float, float] | None,
    reference_hfov: float | None,
    optimize_reference: bool,
    working_width: int,
    refine_plane: bool,
    report_file: Path | None,
    quiet: bool,
    **inputs: Any,
) -> None:
    """Estimate both cameras and their pose, and write a rig file.

    The rig is written even if it is not to be trusted (exit code 3).
    """
    if reference_intrinsics and (reference_hfov or optimize_reference):
        raise click.UsageError(
            "--reference-intrinsics are kept; expected no --reference-hfov or"
            " --optimize-reference with them"
        )
    if explain and choose != "informed":
        raise click.UsageError("--explain tells of --choose informed, expected that too")
    if refine_plane and inputs["depth_spec"] != "plane":
        raise click.UsageError(
            f"--refine-plane goes with --depth plane, not {inputs['depth_spec']}"
        )
    for flag in ("--complete", "--depth-steady"):
        if refine_plane and inputs[flag[2:].replace("-", "_")]:
            raise click.UsageError(
                f"--refine-plane fits the plane itself, which {flag} would change; expected only"
                " one of them"
            )
    calibration = CalibrationOptions(
        max_frames=max_frames,
        seed=seed,
        num_threads=threads,
        working_width=working_width,
        reference_hfov_deg=reference_hfov,
        optimize_reference=optimize_reference,
    )
    calibration.search.mode = search
    calibration.solver = solver
    calibration.validate()
    calibration.flow, flow = flow_of(flow_spec)

    def set_cameras(calibration: CalibrationOptions, reference: Image, source: Image) -> None:
        if reference_intrinsics:
            calibration.reference_camera = Pinhole(*size_of(reference), *reference_intrinsics)
        if source_intrinsics:
            calibration.source_camera = Pinhole(*size_of(source), *source_intrinsics)

    initial_rig = Rig.load(initial) if initial else None
    frames = open_frames(inputs, threads, initial_rig)
    check_file_writable(output)
    if report_file:
        check_file_writable(report_file)
    frames = with_scalar_sources(frames, source_colormap)

    indices = None
    if choose == "informed":
        choice = choose_by_content(frames, max_frames, seed, quiet)
        if explain:
            click.echo(choice.table(lambda index: frames.references.name(index)))
        if choice.unusable:
            first = choice.unusable[0]
            # What cannot be decoded names its file.
            named = f"{frames.references.where(first.index)}: " if first.decoded else ""
            why = named + first.reason
            if not choice.indices:
                raise InputError(f"none of {len(choice.candidates)} frames can be used; {why}")
            warn(left_out(len(choice.unusable), why))
        indices = choice.indices
    result, chosen = run_calibration(
        frames, calibration, initial_rig, quiet, set_cameras, indices, warn, flow
    )
    if refine_plane:
        frames, plane = with_fitted_plane(frames, result.rig, chosen, calibration, quiet)
        result, chosen = run_calibration(
            frames, calibration, result.rig, quiet, set_cameras, chosen, warn
        )
        click.echo(f"plane: --horizon {plane.horizon:g} --plane-roll {plane.roll_deg:g}")
    save_rig(result.rig, output)
    click.echo(result.report.brief())
    click.echo(f"rig: {output}")
    if report_file:
        files = [frames.references.where(index) for index in chosen]
        document = {"format": "xcalib-report", "version": 1, "rig": str(output), "files": files}
        write_json(report_file, document | result.report.to_dict())
        click.echo(f"report: {report_file}")
    if not result.converged:
        stop(NOT_TRUSTED, result.report.message)


def with_scalar_sources(frames: Frames, colormap: str) -> Frames:
    """The frames with false colour turned back to numbers, said on stderr."""
    frames, line = frames.with_scalar_sources(colormap)
    if line:
        click.echo(line, err=True)
    return frames


def warn(message: str) -> None:
    """One line on stderr; the command goes on."""
    click.echo(f"warning: {' '.join(message.split())}", err=True)


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write JSON whole or not at all; what is not finite becomes null."""
    write_bytes(path, (json.dumps(finite(document), indent=2) + "\n").encode())


def finite(value: Any) -> Any:
    """The value with null in place of NaN and infinities, which JSON does not know."""
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# -- register ------------------------------------------------------------------------------------


@cli.command("register", short_help="Bring SOURCE images onto the REFERENCE pixels.")
@rig_argument
@frames_arguments
@click.option(
    "-o",
    "--output",
    metavar="OUT",
    type=click.Path(path_type=Path),
    required=True,
    help="Folder to write to: images under the reference's names, and masks/. Or a video: .mp4,"
    " .avi (8 bit), .mkv (without loss, gray also 16 bit), and its masks.",
)
@click.option("--overlay", "overlays", is_flag=True, help="Also write red-cyan overlays/.")
@click.option(
    "--overwrite",
    is_flag=True,
    help="Begin anew.  [default: go on where an interrupted run of the same command ended]",
)
@click.option(
    "--nearest",
    is_flag=True,
    help="Take the nearest source pixel as it is: radiometric counts are never mixed."
    "  [default: bilinear]",
)
@click.option(
    "--occlusion",
    type=click.Choice(["ignore", "mark", "hide"]),
    default="mark",
    show_default=True,
    help="What the source sees something nearer in front of: told by the mask, or black as well.",
)
@threads_option
@quiet_option
def register_command(
    rig_file: Path,
    output: Path,
    overlays: bool,
    overwrite: bool,
    nearest: bool,
    occlusion: str,
    threads: int,
    quiet: bool,
    **inputs: Any,
) -> None:
    """Bring every SOURCE image onto the pixels of its REFERENCE image.

    Images keep the source's type. Masks: 0 valid, 1 outside the source, 2 occluded, 3 no depth.

    Interrupted, the same command goes on where it ended: what is whole is not made again.
    """
    rig = Rig.load(rig_file)
    frames = open_frames(inputs, threads, rig)
    for name in ("reference", "source", "depth_spec"):
        if Path(inputs[name]).resolve() == output.resolve():
            raise InputError(f"output folder {output} is an input folder, expected another")
    (check_file_writable if is_video(output) else check_folder_writable)(output)
    how = RegistrationOptions(threads, overlays, nearest, occlusion, overwrite)
    total = run_registration(frames, rig, output, how, inputs, quiet)
    click.echo(f"{total.summary()}: {output}")
    if not total.valid:
        stop(NOT_TRUSTED, f"no pixel of {output} is valid; see its masks")


# -- evaluate ------------------------------------------------------------------------------------


@cli.command("evaluate", short_help="Score registered SOURCE images against REFERENCE.")
@rig_argument
@frames_arguments
@click.option(
    "--width",
    metavar="PX",
    type=click.IntRange(min=1),
    default=640,
    show_default=True,
    help="Judge at the reference size divided by the least integer that makes it this wide [px].",
)
@click.option(
    "--json",
    "json_file",
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="Also write all scores, frame by frame (JSON).",
)
@colormap_option
@threads_option
@quiet_option
def evaluate_command(
    rig_file: Path,
    width: int,
    json_file: Path | None,
    source_colormap: str,
    threads: int,
    quiet: bool,
    **inputs: Any,
) -> None:
    """Score the registered SOURCE against REFERENCE, beside the source that is only resized."""
    rig = Rig.load(rig_file)
    frames = open_frames(inputs, threads, rig)
    if json_file:
        check_file_writable(json_file)
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
    if json_file:
        names = [frames.references.where(index) for index in range(len(frames))]
        write_json(json_file, {"rig": str(rig_file), "files": names} | as_document(result))
    if not result.valid_share:
        stop(NOT_TRUSTED, f"no pixel is valid in {len(frames)} frames, nothing could be scored")


# -- demo ----------------------------------------------------------------------------------------


@cli.command("demo", short_help="Render a rig in a street, calibrate and register it.")
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
    type=click.IntRange(min=1),
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
    type=click.IntRange(min=64),
    default=None,
    show_default="as designed",
    help="Render the reference camera at this width, the source in proportion [px].",
)
@quiet_option
def demo_command(
    output: Path, num_frames: int, seed: int, night: bool, width: int | None, quiet: bool
) -> None:
    """Render a rig in a street, calibrate it from the files, and compare with the truth."""
    result = run_demo(output, num_frames, seed, night, width, quiet, click.echo)
    if not result.converged:
        stop(NOT_TRUSTED, result.report.message)


# -- inspect -------------------------------------------------------------------------------------


@cli.command("inspect")
@rig_argument
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def inspect_command(rig_file: Path, as_json: bool) -> None:
    """Print what a rig file says, in units one can picture; of a bag, what its cameras say."""
    if is_bag(rig_file):
        for info in camera_infos(rig_file):
            click.echo(info.line())
        return
    rig = Rig.load(rig_file)
    click.echo(json.dumps(finite(describe(rig)), indent=2) if as_json else facts_text(rig))


# -- report --------------------------------------------------------------------------------------


@cli.command("report", short_help="Print the report file of a calibration.")
@click.argument("report_file", metavar="FILE", type=click.Path(path_type=Path))
def report_command(report_file: Path) -> None:
    """Print the report that `xcalib calibrate --report FILE` wrote."""
    try:
        document = json.loads(report_file.read_text(encoding="utf-8"))
    except ValueError:
        raise InputError(f"{report_file}: not a JSON file") from None
    kind = document.get("format") if isinstance(document, dict) else None
    if kind != "xcalib-report" or document.get("version") != 1:
        raise InputError(f"{report_file}: expected format xcalib-report, version 1")
    click.echo("\n".join(lines_of(document)))


def lines_of(document: dict[str, Any], indent: str = "") -> Iterator[str]:
    """A JSON object as text: values by name, lists of objects as tables."""
    for key, value in document.items():
        if isinstance(value, dict):
            yield f"{indent}{key}:"
            yield from lines_of(value, indent + "  ")
        elif isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
            yield f"{indent}{key}:"
            names = list(value[0])
            cells = [names, *([short(item.get(name)) for name in names] for item in value)]
            widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
            for row in cells:
                yield f"{indent}  " + "  ".join(map(str.rjust, row, widths))
        else:
            yield f"{indent}{key}: {short(value)}"


def short(value: Any) -> str:
    """A value in a few characters."""
    if isinstance(value, list):
        return ", ".join(map(short, value))
    return f"{value:.6g}" if isinstance(value, float) else "-" if value is None else str(value)


cli.add_command(models)


def main() -> None:
    """Entry point of the ``xcalib`` command."""
    cli(prog_name="xcalib")


if __name__ == "__main__":
    main()
