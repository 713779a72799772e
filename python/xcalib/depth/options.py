"""The command-line options of `MeasuredDepth`; they bear the names of its fields."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from .measured import MeasuredDepth


def _file(flag: str, text: str) -> Callable[[Any], Any]:
    return click.option(flag, metavar="FILE", type=click.Path(path_type=Path), help=text)


MEASURED_OPTIONS: tuple[Callable[[Any], Any], ...] = (
    _file(
        "--lidar-calibration",
        "Lidar: calibration of camera and lidar (YAML or KITTI's .txt; a folder of the latter).",
    ),
    _file("--stereo-calibration", "Stereo: YAML with baseline, focal and doffs."),
    click.option(
        "--stereo-baseline",
        metavar="M",
        type=float,
        help="Stereo: distance of the partner, right of the reference camera [m].",
    ),
    click.option(
        "--stereo-focal",
        metavar="PX",
        type=float,
        help="Stereo: focal length of the rectified images [px].",
    ),
    click.option(
        "--stereo-doffs",
        metavar="PX",
        type=float,
        help="Stereo: principal point of the partner minus the reference's [px].  [default: 0]",
    ),
    click.option("--complete", is_flag=True, help="Fill unknown depth along image edges."),
    click.option(
        "--completion-confidence",
        metavar="F",
        type=float,
        default=MeasuredDepth.completion_confidence,
        show_default=True,
        help="Complete: filled pixels below this confidence stay unknown, 0 to 1.",
    ),
    click.option(
        "--depth-steady", is_flag=True, help="Average depth over consecutive frames of a video."
    ),
)
