"""The command-line options about depth; those of `MeasuredDepth` have the names of its fields."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from ..depth import MeasuredDepth, PlaneDepth
from .options import file, number

PLANE = PlaneDepth()


def numbers_of(ctx: click.Context, param: click.Parameter, value: str) -> tuple[float, ...]:
    """Parse ``N,N``."""
    try:
        return tuple(float(part) for part in value.split(",")) if value else ()
    except ValueError:
        raise click.BadParameter(f"{value!r} is not a list of numbers N,N") from None


DEPTH_OPTIONS: tuple[Callable[[Any], Any], ...] = (
    click.option(
        "--depth",
        "depth_spec",
        metavar="DEPTH",
        help="Folder with a depth map per reference image (16-bit PNG; .npy, .npz, .pfm, .tiff,"
        " .exr in m; 0 unknown) or lidar scan (.bin, .pcd, .ply), `stereo:FOLDER` of the right"
        " camera's images, `disparity:FOLDER`, a bag with a topic of depth (drive.mcap#/depth), an"
        " .onnx file of a network, `plane` for a flat road, or one distance in metres.",
    ),
    click.option(
        "--depth-scale",
        metavar="M",
        type=float,
        help="Metres per count of depth maps (px of disparities).  [default: 1/256 of 16-bit PNG, 1"
        " of floats]",
    ),
    click.option(
        "--depth-unit",
        metavar="UNIT",
        help="The same in words: mm, cm, m, or 1/256 of a metre.",
    ),
    click.option(
        "--depth-invalid",
        metavar="N[,N]",
        default="",
        callback=numbers_of,
        help="Numbers of depth maps that mean unknown, besides 0, NaN and 65535.",
    ),
    number(
        "--camera-height",
        "M",
        PLANE.camera_height,
        "Plane: height of the reference camera above the road [m].",
    ),
    number(
        "--horizon",
        "F",
        PLANE.horizon,
        "Plane: row of the horizon [fraction of the image height from the top].",
    ),
    number("--far", "M", PLANE.far, "Plane: largest depth, at and above the horizon too [m]."),
    number(
        "--plane-hfov",
        "DEG",
        PLANE.hfov_deg,
        "Plane: horizontal field of view of the reference camera [deg].",
    ),
    number(
        "--plane-roll",
        "DEG",
        PLANE.roll_deg,
        "Plane: how far the horizon falls towards the right [deg].",
    ),
    click.option(
        "--depth-recipe",
        metavar="NAME",
        help="Network: what it expects and returns, a name of `xcalib models list`.  [default: the"
        " .yaml file beside it, or by its name]",
    ),
    click.option(
        "--depth-focal",
        metavar="PX",
        type=float,
        help="Network: focal length of the reference camera [px], for those whose depth scales"
        " with it.",
    ),
    click.option(
        "--inverse-scale",
        metavar="A",
        type=float,
        help="Network: depth is 1 / (A r + B) of its output r.  [default: the recipe's; for"
        " relative depth a guess without metric scale]",
    ),
    click.option("--inverse-shift", metavar="B", type=float, help="Network: see --inverse-scale."),
    click.option(
        "--providers",
        metavar="NAMES",
        default="cpu",
        show_default=True,
        help="Network: execution providers, the preferred first: cuda,cpu.",
    ),
    file(
        "--lidar-calibration",
        "Lidar: calibration of camera and lidar (YAML or KITTI's .txt; a folder of the latter).",
    ),
    file("--stereo-calibration", "Stereo, disparity: YAML with baseline, focal and doffs."),
    click.option(
        "--stereo-baseline",
        metavar="M",
        type=float,
        help="Stereo, disparity: distance of the partner, right of the reference camera [m].",
    ),
    click.option(
        "--stereo-focal",
        metavar="PX",
        type=float,
        help="Stereo, disparity: focal length of the rectified images [px].",
    ),
    click.option(
        "--stereo-doffs",
        metavar="PX",
        type=float,
        help="Stereo, disparity: principal point of the partner minus the reference's [px]."
        "  [default: 0]",
    ),
    click.option("--complete", is_flag=True, help="Fill unknown depth along image edges."),
    number(
        "--completion-confidence",
        "F",
        MeasuredDepth.completion_confidence,
        "Complete: filled pixels below this confidence stay unknown, 0 to 1.",
    ),
    click.option(
        "--depth-steady", is_flag=True, help="Average depth over consecutive frames of a video."
    ),
)
