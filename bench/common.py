"""What the benchmarks share: where the data is, what machine this is, how a mapping is compared.

No data is part of the repository. Where it is from: lynred_night, the night rig, frames of
Azorgz/Disparity_Pipeline (no licence stated); roadscene, hanna-xu/RoadScene; kitti, three frames of
kuixu/kitti_object_vis (CC BY-NC-SA); motorcycle, Middlebury 2014 as scikit-image ships it;
flir_adas, two pairs of Tarpit59/thermal-rgb-aligner.
"""

import os
import platform
import subprocess
from pathlib import Path

import numpy as np
from figures import skipped

ROOT = Path(__file__).resolve().parent.parent


def data(name: str) -> Path | None:
    """The folder of a data set, by XCALIB_DATA or ../shared/data; None, said, where absent."""
    base = Path(os.environ.get("XCALIB_DATA", ROOT.parent / "shared" / "data"))
    folder = base / name
    if folder.is_dir():
        return folder
    skipped(name, f"not in {base} (set XCALIB_DATA)")
    return None


def cpu_model() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()


def machine() -> str:
    """Processor, cores, commit: what a figure must be printed with."""
    commit = subprocess.run(
        ["git", "-C", str(ROOT), "rev-parse", "--short", "HEAD"], capture_output=True, text=True
    ).stdout.strip()
    return f"{cpu_model()}, {os.cpu_count()} cores, commit {commit or 'unknown'}"


def median_error(found, truth, depths) -> float:
    """Median end-point error [source px] over all frames."""
    from xcalib import metrics

    errors = np.concatenate(
        [metrics.end_point_error(found, truth, depth).ravel() for depth in depths]
    )
    return float(np.nanmedian(errors))
