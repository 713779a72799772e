"""Stereo depth beside the truth (Middlebury motorcycle); lidar points removed as hidden (KITTI)."""

import time
from pathlib import Path

import numpy as np
from common import data, machine
from figures import figure

from xcalib.depth.lidar import project, read_lidar_calibration, read_points, without_hidden
from xcalib.depth.stereo import StereoGeometry, disparity
from xcalib.frames import read_image, size_of

MOTORCYCLE = StereoGeometry(baseline=0.193001, focal=994.978, doffs=31.086)


def stereo(folder: Path) -> None:
    left, right = (read_image(folder / f"motorcycle_{side}.png") for side in ("left", "right"))
    truth = np.load(folder / "motorcycle_disp.npz")["arr_0"]
    start = time.perf_counter()
    found = disparity(left, right, lowest=int(np.floor(-MOTORCYCLE.doffs)))
    seconds = time.perf_counter() - start
    known = np.isfinite(truth)
    both = known & np.isfinite(found)
    off = np.abs(found - truth)[both]
    depth, true_depth = (
        MOTORCYCLE.focal * MOTORCYCLE.baseline / (d[both] + MOTORCYCLE.doffs)
        for d in (found, truth)
    )
    wrong = np.abs(depth - true_depth)
    figure("motorcycle: known pixels matched", 100 * both.sum() / known.sum(), "%")
    figure("motorcycle: of these, off by more than 2 px", 100 * np.mean(off > 2), "%")
    figure("motorcycle: median error of the disparity", np.median(off), "px")
    figure("motorcycle: of the depth", 100 * np.median(wrong / true_depth), "%")
    figure("motorcycle: of the depth, in mm", 1e3 * np.median(wrong), "mm")
    figure("motorcycle: time", seconds, "s")


def lidar(folder: Path) -> None:
    for scan in sorted((folder / "velodyne").iterdir()):
        image = read_image(folder / "image_2" / f"{scan.stem}.png")
        calibration = read_lidar_calibration(folder / "calib" / f"{scan.stem}.txt")
        start = time.perf_counter()
        depth = project(read_points(scan), calibration, size_of(image))
        seen = without_hidden(depth)
        seconds = time.perf_counter() - start
        before = np.count_nonzero(depth)
        figure(f"kitti {scan.stem}: pixels with a point", before)
        removed = 100 * (1 - np.count_nonzero(seen) / before)
        figure(f"kitti {scan.stem}: of them removed as hidden", removed, "%")
        figure(f"kitti {scan.stem}: time", seconds, "s")


def main() -> None:
    print(machine())
    for name, measure in (("motorcycle", stereo), ("kitti", lidar)):
        if folder := data(name):
            measure(folder)


if __name__ == "__main__":
    main()
