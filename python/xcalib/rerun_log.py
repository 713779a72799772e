"""Registered frames as a recording for Rerun (.rrd): both cameras in space, images, the cloud in
thermal colours, and the agreement of each frame.

Rerun draws the first pixel's centre at (0.5, 0.5), and knows no lens: where one bends, the cloud
and the images are right, and the images' place in space is that of the pinhole.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from . import metrics
from ._core import InputError, Pinhole, Rig, keep_file
from .frames import display_gray, gray
from .overlays import Picture, colour, false_colour
from .reprojection import rays_at
from .view import Registered

HALF = 0.5
POINTS = 40_000
"""Of a cloud at most."""


def write_rerun(frames: Iterator[Registered], rig: Rig, output: Path) -> int:
    """Write all frames; returns how many there are. The file appears when it is whole."""
    try:
        import rerun
    except ImportError:
        raise InputError(
            f"{output}: Rerun's recordings need the library rerun-sdk, `pip install rerun-sdk`"
        ) from None
    output.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=output.parent, prefix=".xcalib-view-") as folder:
        file = Path(folder) / "whole.rrd"
        recording = rerun.RecordingStream("xcalib")
        recording.save(str(file))
        log_rig(rerun, recording, rig)
        count = 0
        for frame in frames:
            recording.set_time("frame", sequence=count)
            recording.set_time("time", duration=frame.time)
            log_frame(rerun, recording, rig, frame)
            count += 1
        recording.flush()
        recording.disconnect()
        keep_file(file, output)
    return count


def log_rig(rerun: Any, recording: Any, rig: Rig) -> None:
    """The cameras: the source's pose takes points of the reference, its parent, to it."""
    recording.log("visible", rerun.ViewCoordinates.RDF, static=True)
    recording.log("visible", pinhole(rerun, rig.reference), static=True)
    recording.log("rig/thermal", pinhole(rerun, rig.source), static=True)
    pose = rerun.Transform3D(
        translation=np.asarray(rig.t),
        mat3x3=np.asarray(rig.R),
        relation=rerun.TransformRelation.ChildFromParent,
    )
    recording.log("rig/thermal", pose, static=True)


def pinhole(rerun: Any, camera: Pinhole) -> Any:
    """A camera as Rerun has one."""
    K = np.array(camera.K, np.float64)
    K[:2, 2] += HALF
    return rerun.Pinhole(
        image_from_camera=K,
        resolution=[camera.width, camera.height],
        camera_xyz=rerun.ViewCoordinates.RDF,
    )


def log_frame(rerun: Any, recording: Any, rig: Rig, frame: Registered) -> None:
    """The images of a frame, its cloud, and how well its edges agree."""
    valid = frame.mask == 0
    recording.log("visible/image", rerun.Image(rgb(colour(frame.reference))))
    recording.log("visible/registered", rerun.Image(rgb(false_colour(frame.image))))
    recording.log("visible/edges", rerun.Image(rgb(frame.overlay("edges"))))
    recording.log("rig/thermal/image", rerun.Image(rgb(false_colour(frame.source))))
    points, shades = cloud(rig, frame)
    recording.log("cloud", rerun.Points3D(points, colors=shades))
    nec = metrics.nec(gray(frame.reference), display_gray(frame.image) / np.float32(255), valid)
    recording.log("metrics/nec", rerun.Scalars(nec))
    recording.log("metrics/valid_share", rerun.Scalars(float(valid.mean())))


def cloud(rig: Rig, frame: Registered) -> tuple[Any, Picture]:
    """Valid pixels as points in the reference's axes [m], in false colour."""
    known = (frame.mask == 0) & np.isfinite(frame.depth) & (frame.depth > 0)
    ys, xs = np.nonzero(known)
    step = max(1, -(-len(xs) // POINTS))
    ys, xs = ys[::step], xs[::step]
    z = frame.depth[ys, xs].astype(np.float64)
    rays = rays_at(rig.reference, xs, ys)
    return np.column_stack([rays * z[:, None], z]), rgb(false_colour(frame.image))[ys, xs]


def rgb(picture: Picture) -> Picture:
    """In Rerun's order of colours."""
    return np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB), np.uint8)
