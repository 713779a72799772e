"""What the benchmarks share: where the data is, what machine this is, gray images, end-point error.

No data is part of the repository. Where it is from: lynred_night, the night rig, frames of
Azorgz/Disparity_Pipeline (no licence stated); roadscene, hanna-xu/RoadScene; kitti, three frames of
kuixu/kitti_object_vis (CC BY-NC-SA); motorcycle, Middlebury 2014 as scikit-image ships it;
flir_adas, two pairs of Tarpit59/thermal-rgb-aligner.
"""

import ast
import os
import platform
import subprocess
from pathlib import Path

import cv2
import numpy as np
from figures import skipped

import xcalib
from xcalib import metrics

ROOT = Path(__file__).resolve().parent.parent


def data(name: str) -> Path | None:
    """The folder of a data set, in XCALIB_DATA or ../shared/data; None where it is absent."""
    base = Path(os.environ.get("XCALIB_DATA", ROOT.parent / "shared" / "data"))
    folder = base / name
    if folder.is_dir():
        return folder
    skipped(name, f"not in {base} (set XCALIB_DATA)")
    return None


def git(*arguments: str) -> str:
    """What git prints; empty where this is no repository."""
    command = ["git", "-C", str(ROOT), *arguments]
    return subprocess.run(command, capture_output=True, text=True).stdout.strip()


def cpu() -> str:
    """The processor and its number of cores."""
    model = platform.machine()
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            model = line.split(":", 1)[1].strip()
    return f"{model}, {os.cpu_count()} cores"


def machine() -> str:
    """Processor, cores, commit: what a figure must be printed with."""
    return f"{cpu()}, commit {git('rev-parse', '--short', 'HEAD') or 'unknown'}"


def summary(script: Path) -> str:
    """The first line of a script's docstring: what it measures."""
    return (ast.get_docstring(ast.parse(script.read_text())) or "").partition("\n")[0]


def gray(image: np.ndarray) -> np.ndarray:
    """(H, W) float32, in [0, 1] where the image is of integers."""
    one = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
    return one.astype(np.float32) / (np.iinfo(one.dtype).max if one.dtype.kind == "u" else 1)


def median_error(found: xcalib.Rig, truth: xcalib.Rig, depths) -> float:
    """Median end-point error over all pixels of all depth maps [source px]."""
    return float(np.nanmedian([metrics.end_point_error(found, truth, d) for d in depths]))
