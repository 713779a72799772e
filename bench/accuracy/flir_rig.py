"""Two pairs of another rig: false-colour thermal, another field of view, plane prior, no guess."""

import cv2
import numpy as np
from common import data, machine
from figures import figure

import xcalib
from xcalib.depth import PlaneDepth


def main() -> None:
    print(machine())
    folder = data("flir_adas")
    if folder is None:
        return
    references = [cv2.imread(str(p)) for p in sorted(folder.glob("*_Z.JPG"))]
    sources = [cv2.imread(str(p)) for p in sorted(folder.glob("*_T.JPG"))]
    plane = PlaneDepth()
    depths = [plane(i, image) for i, image in enumerate(references)]
    result = xcalib.calibrate(references, sources, depths)
    print(result.report.brief())
    height, width = references[0].shape[:2]
    scaled = result.rig.resized(640, round(height * 640 / width), 640, 512)
    grid = xcalib.Registrar(scaled).map(depths[0])
    y, x = np.mgrid[0 : grid.shape[0], 0:640]
    ok = np.isfinite(grid[..., 0])
    distance = np.abs(grid[..., 0] - (x - 52) / 0.889)[ok]
    slope = np.polyfit(y[ok], grid[..., 1][ok], 1)[0]
    low, middle, high = np.percentile(distance, [10, 50, 90])
    figure("|x_S - (x - 52) / 0.889|, of 640 px", middle, "px", low, high)
    figure(f"vertical scale (similarity: {1 / 0.889:.3f})", slope)


if __name__ == "__main__":
    main()
