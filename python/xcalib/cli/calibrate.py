"""`xcalib calibrate`: from frames to a rig file."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from .._core import (
    CalibrationOptions,
    Lens,
    Pinhole,
    Tolerance,
    _flow_arguments,
    draw_frames,
    left_out,
    report_document,
)
from ..flow import FlowProvider, NetworkFlow
from ..footage import lens_of_topic
from ..frames import Image, InputError, check_file_writable, same_aspect, size_of, write_bytes
from ..pipeline import (
    Frames,
    choose_by_content,
    find_readout,
    run_calibration,
    save_rig,
    with_fitted_plane,
)
from .arguments import (
    COUNT,
    DEFAULTS,
    SEED,
    WORDS,
    check_writes,
    colormap_option,
    dry_run_option,
    frames_arguments,
    load_rig,
    open_frames,
    print_plan,
    quiet_option,
    say_depth,
    threads_option,
    with_scalar_sources,
    with_straight_rows,
)
from .errors import NOT_TRUSTED, stop, warn
from .options import ARGUMENTS, Input, Output
from .sections import Sectioned

LAG_ROUNDS = 2
"""Times at most that a lag is taken up, each of some frames."""


def intrinsics(
    ctx: click.Context, param: click.Parameter, value: str | None
) -> tuple[float, float, float, float] | Pinhole | None:
    """Parse ``FX,FY,CX,CY`` in pixels, or read the camera of a file."""
    if value is None:
        return None
    if Path(value).exists():
        from ..convert import read_camera  # seldom needed, and it loads much

        assert param.name is not None
        return read_camera(value, param.name.removesuffix("_intrinsics"))
    try:
        fx, fy, cx, cy = (float(part) for part in value.split(","))
    except ValueError:
        raise click.BadParameter(f"{value!r} is not four numbers FX,FY,CX,CY") from None
    if not (fx > 0 and fy > 0 and all(map(math.isfinite, (fx, fy, cx, cy)))):
        raise click.BadParameter(f"{value!r}: expected finite numbers, FX and FY above 0 px")
    return fx, fy, cx, cy


def known_camera(
    given: tuple[float, float, float, float] | Pinhole, image: Image, topic: str, lens: str
) -> Pinhole:
    """The camera of ``--reference-intrinsics`` or ``--source-intrinsics`` behind an image."""
    if isinstance(given, Pinhole):
        size, own = size_of(image), (given.width, given.height)
        if not same_aspect(size, own):
            raise InputError(
                f"the camera given is of {own[0]}x{own[1]} px, the images are {size[0]}x{size[1]};"
                " expected the same aspect"
            )
        return given if size == own else given.resized(*size)
    found = lens_of_topic(topic) if lens == "auto" else None
    return Pinhole(*size_of(image), *given, lens=found or Lens())


def lens_option(camera: str) -> Callable[[Any], Any]:
    """``--reference-lens`` or ``--source-lens``."""
    else_ = "k1 and k2 are estimated" if camera == "source" else "none"
    return click.option(
        f"--{camera}-lens",
        metavar="auto|none|brown:K1,K2,P1,P2[,K3[,K4,K5,K6]]|fisheye:K1,K2,K3,K4",
        default="auto",
        show_default=True,
        help=f"Known lens of the {camera} camera, OpenCV's model and coefficients, kept; auto: that"
        f" of the initial rig, with --{camera}-intrinsics that of a bag's camera_info or none; else"
        f" {else_}.",
    )


def flow_of(spec: str) -> tuple[str, FlowProvider | None]:
    """What ``--flow`` says: the mode of the options, and the provider, None for the built-in."""
    modes = _flow_arguments()
    if spec in modes:
        return modes[spec], None
    if not spec.endswith(".onnx"):
        raise click.UsageError(f"--flow is {spec!r}, expected auto, off, patch or a .onnx file")
    return "on", NetworkFlow(spec)


def frames_again(arguments: list[str], lag: int) -> Frames:
    """The frames that ``xcalib`` or ``xcalib-cli`` with such arguments calibrated, opened anew."""
    if command.name not in arguments:
        raise InputError(f"its command is {' '.join(arguments)}, expected a calibration")
    own = arguments[arguments.index(command.name) + 1 :]
    try:
        options = command.make_context(command.name, own).params
    except click.ClickException as error:
        raise InputError(error.format_message()) from None
    initial = load_rig(options["initial"]) if options["initial"] else None
    frames = open_frames(options, options["threads"], initial)
    frames = with_scalar_sources(frames, options["source_colormap"])
    frames = with_straight_rows(frames, options, initial, may_be_auto=True)
    return frames.with_lag(lag, [])[0] if lag else frames


@click.command("calibrate", cls=Sectioned)
@frames_arguments
@dry_run_option
@click.option(
    "-o",
    "--output",
    metavar="RIG",
    type=Output(check_file_writable),
    required=True,
    help="Rig file to write (YAML).",
)
@click.option(
    "--frames",
    "max_frames",
    metavar="N",
    type=COUNT,
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
    help="Frames that determine the rig best (looks at 4 N), or spread over the footage.",
)
@click.option(
    "--explain", is_flag=True, help="Print why each frame was taken or left (--choose informed)."
)
@colormap_option
@threads_option
@click.option(
    "--initial",
    metavar="RIG",
    type=Input(),
    help="Rig file to start from.  [default: none, searched]",
)
@click.option(
    "--search",
    type=click.Choice(WORDS["search"]),
    default=DEFAULTS.search.mode,
    show_default=True,
    help="Global search before refinement: full, local (around the initial rig), off, or auto.",
)
@click.option(
    "--mount",
    metavar="auto|upright|DEG|mirrored[-DEG]",
    default=DEFAULTS.mount,
    show_default=True,
    help="How the source image is turned, in degrees clockwise (90, 180, 270, ...), and whether it"
    " is then mirrored; auto: upright, and where that is not found any.",
)
@click.option(
    "--max-roll",
    metavar="DEG",
    type=click.FloatRange(0, 180),
    default=DEFAULTS.search.max_roll_deg,
    show_default=True,
    help="Roll about the mount that is searched.",
)
@click.option(
    "--max-fov-ratio",
    metavar="R",
    type=click.FloatRange(1, 10, min_open=True),
    default=DEFAULTS.search.max_fov_ratio,
    show_default=True,
    help="Largest ratio of the two fields of view that is searched, either way, in tangents.",
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
    type=click.Choice(WORDS["solver"]),
    default=DEFAULTS.solver,
    show_default=True,
    help="adam is the paper's, which searches nothing.",
)
@click.option(
    "--reference-intrinsics",
    metavar="FX,FY,CX,CY|FILE",
    callback=intrinsics,
    help="Known intrinsics of the reference camera, kept [px], or a file that `xcalib convert`"
    " reads, with its lens."
    "  [default: none]",
)
@click.option(
    "--source-intrinsics",
    metavar="FX,FY,CX,CY|FILE",
    callback=intrinsics,
    help="Known intrinsics of the source camera, kept [px], or a file that `xcalib convert`"
    " reads, with its lens."
    "  [default: none, estimated]",
)
@lens_option("reference")
@lens_option("source")
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
    "--optimize-lens",
    is_flag=True,
    default=DEFAULTS.optimize_lens,
    help="Estimate k1 and k2 of the source's lens, from --source-lens where given, and keep them"
    " whether or not unseen frames gain; with --solver adam too.  [default: kept where they gain]",
)
@click.option(
    "--working-width",
    metavar="PX",
    type=COUNT,
    default=DEFAULTS.working_width,
    show_default=True,
    help="Reference width that calibration works at [px].",
)
@click.option(
    "--tolerance",
    metavar="MEDIAN[,P95]",
    default="2,5",
    show_default=True,
    help="Expected error up to which the rig is trusted, over the footage's own depths [px of the"
    " reference at 640 px of width].",
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
    type=Output(check_file_writable),
    help="Also write the full report: .html a page to look at, else JSON, for `xcalib report`.",
)
@quiet_option
def command(
    output: Path,
    max_frames: int,
    seed: int,
    choose: str,
    explain: bool,
    source_colormap: str,
    threads: int,
    initial: Path | None,
    search: str,
    mount: str,
    max_roll: float,
    max_fov_ratio: float,
    flow_spec: str,
    solver: str,
    reference_intrinsics: tuple[float, float, float, float] | Pinhole | None,
    source_intrinsics: tuple[float, float, float, float] | Pinhole | None,
    reference_lens: str,
    source_lens: str,
    reference_hfov: float | None,
    optimize_reference: bool,
    optimize_lens: bool,
    working_width: int,
    tolerance: str,
    refine_plane: bool,
    report_file: Path | None,
    quiet: bool,
    dry_run: bool,
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
        raise click.UsageError("--explain goes with --choose informed, expected that too")
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
        optimize_lens=optimize_lens,
    )
    calibration.search.mode = search
    calibration.search.max_roll_deg = max_roll
    calibration.search.max_fov_ratio = max_fov_ratio
    calibration.mount = mount
    calibration.tolerance = Tolerance.parse("--tolerance", tolerance)
    calibration.reference_lens = Lens.parse("--reference-lens", reference_lens)
    calibration.source_lens = Lens.parse("--source-lens", source_lens)
    calibration.solver = solver
    calibration.validate()
    calibration.flow, flow = flow_of(flow_spec)

    def set_cameras(calibration: CalibrationOptions, reference: Image, source: Image) -> None:
        if reference_intrinsics:
            calibration.reference_camera = known_camera(
                reference_intrinsics, reference, inputs["reference"], reference_lens
            )
        if source_intrinsics:
            calibration.source_camera = known_camera(
                source_intrinsics, source, inputs["source"], source_lens
            )

    initial_rig = load_rig(initial) if initial else None
    frames = open_frames(inputs, threads, initial_rig)
    check_writes([output, report_file], frames, inputs, initial)
    raw = with_scalar_sources(frames, source_colormap)
    frames = with_straight_rows(raw, inputs, initial_rig, may_be_auto=True)

    arguments = list(click.get_current_context().meta.get(ARGUMENTS, ()))
    indices, looked_at, lag_taken = None, [], 0
    if choose == "informed":
        choice = choose_by_content(frames, max_frames, seed, quiet)
        if explain:
            click.echo(choice.table(lambda index: frames.references.name(index)))
        looked_at = [
            (frames.references.where(c.index), c.taken, c.reason) for c in choice.candidates
        ]
        if choice.unusable:
            first = choice.unusable[0]
            # What cannot be decoded names its file.
            named = f"{frames.references.where(first.index)}: " if first.decoded else ""
            why = named + first.reason
            if not choice.indices:
                raise InputError(f"none of {len(choice.candidates)} frames can be used; {why}")
            warn(left_out(len(choice.unusable), why))
        indices = choice.indices
    if dry_run:
        used = draw_frames(len(frames), max_frames, seed) if indices is None else indices
        print_plan(frames, [output, report_file], used)
        return
    result, chosen = run_calibration(
        frames, calibration, initial_rig, quiet, set_cameras, indices, warn, flow
    )
    readout = {name: inputs[f"{name}_readout"] for name in ("source", "reference")}
    finds_readout = None in readout.values()
    if finds_readout:
        camera = "source" if readout["source"] is None else "reference"
        fit = find_readout(raw, chosen, result.rig, calibration, readout, quiet)
        click.echo(f"rolling shutter: {fit.line(camera)}")
        readout[camera] = fit.taken if fit.seen else 0
        arguments += [f"--{camera}-readout", f"{readout[camera]:g}"]
    # Which rows of both look the same way is known now.
    if any(readout.values()) and (finds_readout or (readout["reference"] and not initial_rig)):
        frames = raw.with_straight_rows(readout["source"], readout["reference"], result.rig)
        result, chosen = run_calibration(
            frames, calibration, initial_rig, quiet, set_cameras, chosen, warn, flow
        )
    if refine_plane:
        frames, plane = with_fitted_plane(frames, result.rig, chosen, calibration, quiet)
        result, chosen = run_calibration(
            frames, calibration, result.rig, quiet, set_cameras, chosen, warn
        )
        arguments += ["--horizon", str(plane.horizon), "--plane-roll", str(plane.roll_deg)]
        click.echo(f"plane: --horizon {plane.horizon:g} --plane-roll {plane.roll_deg:g}")
    for _ in range(LAG_ROUNDS):
        lag = result.report.lag
        if not lag.frames or frames.offset is None or not frames.offset.automatic:
            break
        click.echo(f"clock offset: {lag.line()}, taken up", err=True)
        frames, chosen = frames.with_lag(lag.frames, chosen)
        lag_taken += lag.frames
        result, chosen = run_calibration(
            frames, calibration, initial_rig, quiet, set_cameras, chosen, warn, flow
        )
    save_rig(result.rig, output)
    click.echo(result.report.brief())
    click.echo(f"rig: {output}")
    if report_file is not None:
        files = [frames.references.where(index) for index in chosen]
        document = report_document(
            *(result.report, str(output), files, arguments, str(Path.cwd()), lag_taken, looked_at)
        )
        if report_file.suffix.lower() == ".html":
            from ..report import Run, write_page  # seldom needed, and it loads much

            run = Run(json.loads(document), result.rig, frames, chosen)
            write_page(run, report_file, f"Calibration of {output}")
        else:
            write_bytes(report_file, document.encode())
        click.echo(f"report: {report_file}")
    say_depth(frames)
    if not result.converged:
        stop(NOT_TRUSTED, result.report.message)
