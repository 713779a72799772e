"""The demo: a rig in a rendered street, calibrated from its files and compared with the truth."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path

import cv2
import numpy as np

from . import metrics, synthetic
from ._core import CalibrationOptions, CalibrationResult, Registrar, Rig, report_document
from .frames import check_folder_writable, size_of, write_bytes, write_image
from .inputs import Inputs
from .overlays import Picture, colour, with_edges
from .pipeline import Frames, run_calibration, save_rig
from .progress import progress
from .registration import RegistrationOptions, run_registration
from .report import Run, write_page


def run_demo(
    output: Path,
    num_frames: int,
    seed: int,
    night: bool,
    width: int | None,
    quiet: bool,
    say: Callable[[str], object] = print,
) -> CalibrationResult:
    """Render, calibrate and register into a folder; ``say`` gets the lines to print."""
    check_folder_writable(output)
    truth = synthetic.demo_rig()
    if width:
        factor = width / truth.reference.width
        sizes = [
            max(1, round(factor * side))
            for camera in (truth.reference, truth.source)
            for side in (camera.width, camera.height)
        ]
        truth = truth.resized(*sizes)
    data = output / "data"
    rendered = synthetic.render(truth, num_frames=num_frames, seed=seed, night=night)
    synthetic.write(data, progress(rendered, num_frames, "rendering", quiet), truth)

    everything = Frames.open(Inputs(data / "visible", data / "thermal", data / "depth"))
    # An earlier and longer demo may have left frames behind these.
    references, sources = everything.references[:num_frames], everything.sources[:num_frames]
    frames = Frames(references, sources, everything.depth)
    result, chosen = run_calibration(frames, CalibrationOptions(seed=seed), quiet=quiet)
    save_rig(result.rig, output / "rig.yaml")
    options = RegistrationOptions(overwrite=True)
    total = run_registration(frames, result.rig, output / "registered", options, quiet=quiet)

    say(result.report.brief())
    say(against_truth(result.rig, truth, frames))
    say(total.summary())
    before, after = before_and_after(frames, result.rig)
    write_image(output / "before.png", before)
    write_image(output / "after.png", after)
    write_report(output, frames, result, chosen, seed)
    for name in ("data", "rig.yaml", "registered", "before.png", "after.png", "report.html"):
        say(f"{name + ':':<12} {output / name}")
    return result


def write_report(
    output: Path, frames: Frames, result: CalibrationResult, chosen: Sequence[int], seed: int
) -> None:
    """The report, and the page of it; its command does the same from the files."""
    folders = ("data/visible", "data/thermal", "--depth", "data/depth")
    files = [str(Path(frames.references.where(index)).relative_to(output)) for index in chosen]
    command = ["calibrate", *folders, "--choose", "spread", "--seed", str(seed), "-o", "rig.yaml"]
    folder = str(output.absolute())
    document = report_document(result.report, "rig.yaml", files, command, folder, 0, [])
    write_bytes(output / "report.json", document.encode())
    run = Run(json.loads(document), result.rig, frames, chosen)
    write_page(run, output / "report.html", "The demo: a rig in a rendered street")


def against_truth(rig: Rig, truth: Rig, frames: Frames) -> str:
    """The parameters found beside the true ones, and the error in pixels, as text."""
    errors = []
    for index in range(len(frames)):
        reference, _, depth = frames.read(index)
        if size_of(depth) == size_of(reference):
            error = metrics.end_point_error(rig, truth, depth)
            errors.append(error[np.isfinite(error)])
    pixels = np.concatenate(errors)
    median, high = np.percentile(pixels, (50, 95)) if pixels.size else (math.nan, math.nan)
    turn = np.asarray(rig.R) @ np.asarray(truth.R).T
    angle = math.degrees(math.acos(np.clip((np.trace(turn) - 1) / 2, -1, 1)))
    rows = [
        ("HFoV reference", f"{rig.reference.hfov_deg:.3f}", f"{truth.reference.hfov_deg:.3f} deg"),
        ("HFoV source", f"{rig.source.hfov_deg:.3f}", f"{truth.source.hfov_deg:.3f} deg"),
        ("translation", vector(rig.t), f"{vector(truth.t)} m"),
        ("rotation error", f"{angle:.4f}", "0 deg"),
        ("end-point error", f"{median:.3f} median, {high:.3f} 95th percentile", "0 px"),
    ]
    head = f"{'':<16}{'found':<40}truth"
    return "\n".join([head, *(f"{name:<16}{found:<40}{true}" for name, found, true in rows)])


def before_and_after(frames: Frames, rig: Rig) -> tuple[Picture, Picture]:
    """Visible, thermal and its edges on the visible image side by side: only resized, and
    registered.
    """
    reference, source, depth = frames.read(0)
    registered, mask = Registrar(frames.fit(rig)).register(source, depth)
    resized = cv2.resize(source, size_of(reference), interpolation=cv2.INTER_AREA)
    before = [colour(reference), colour(resized), with_edges(reference, resized)]
    after = [colour(reference), colour(registered), with_edges(reference, registered, mask == 0)]
    return np.hstack(before), np.hstack(after)


def vector(values: Iterable[float]) -> str:
    """Numbers as text."""
    return " ".join(f"{value:+.4f}" for value in values)
