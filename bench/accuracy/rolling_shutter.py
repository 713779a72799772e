"""Rigs from sources with a rolling shutter: as they are read, with the readout given, and found.

Rendered drives of 14 frames whose source reads its rows one after another, over a share of the time
from frame to frame (0: all at once), calibrated by `xcalib calibrate` without `--source-readout`,
with the true share, and with `auto`. The error is the median over the pixels of the distance to
where the true rig maps them.
"""

import argparse
import re
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np
from accuracy.lags import Drive, rig_of
from common import machine
from figures import figure

import xcalib
from xcalib import metrics

FRAMES, BANDS = 14, 12
KINDS = ("uneven", "steady")


def rolled(drive, index, share):
    """A source frame whose rows are read from `index` on, in bands."""
    if share == 0:
        return drive.render_view(index, "thermal", "source")[0]
    height = drive.rig.source.height
    edges = np.linspace(0, height, BANDS + 1).astype(int)
    bands = []
    for top, bottom in pairwise(edges):
        middle = (top + bottom) / 2 / height
        view = drive.render_view(index + share * middle, "thermal", "source")[0]
        bands.append(view[top:bottom])
    return np.concatenate(bands)


def write(drive, share, folder):
    """The footage as files; returns the depth maps."""
    depths = []
    for name in ("reference", "source", "depth"):
        (folder / name).mkdir(exist_ok=True)
    for index in range(FRAMES):
        frame = drive.frame(index)
        depths.append(frame.depth)
        source = np.clip(rolled(drive, index, share), 0, 255).astype(np.uint8)
        cv2.imwrite(str(folder / f"reference/{index:06d}.png"), frame.reference)
        cv2.imwrite(str(folder / f"source/{index:06d}.png"), source)
        np.save(folder / f"depth/{index:06d}.npy", frame.depth)
    return depths


def calibrated(folder, readout):
    """The rig, and the share that was taken up: 0 where none was."""
    rig = folder / "rig.yaml"
    given = ("reference", "source", "--depth", "depth", "--source-readout", readout, "-o", rig.name)
    run = subprocess.run(
        [sys.executable, "-m", "xcalib", "calibrate", *given],
        cwd=folder,
        capture_output=True,
        text=True,
    )
    if run.returncode not in (0, 3):
        raise SystemExit(run.stderr)
    found = re.search(r"--source-readout ([0-9.]+)", run.stdout)
    return xcalib.Rig.load(rig), float(found[1]) if found else 0.0, run.returncode == 0


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=50, help="seed")
    parser.add_argument("--drives", type=int, default=3, help="of each kind")
    parser.add_argument("--kinds", nargs="*", default=list(KINDS))
    parser.add_argument("--shares", type=float, nargs="*", default=[0.0, 0.3, 0.6, 0.9])
    arguments = parser.parse_args()
    print(machine())
    errors = {}
    off, false = [], 0
    for kind in arguments.kinds:
        for seed in range(arguments.first, arguments.first + arguments.drives):
            rig = rig_of(seed)
            drive = Drive(rig, kind, seed)
            for share in arguments.shares:
                with tempfile.TemporaryDirectory() as name:
                    depths = write(drive, share, Path(name))
                    row = []
                    for readout in ("0", f"{share}", "auto"):
                        estimate, found, trusted = calibrated(Path(name), readout)
                        error = np.median(
                            [
                                np.nanmedian(metrics.end_point_error(estimate, rig, d))
                                for d in depths
                            ]
                        )
                        errors.setdefault(
                            (share > 0, readout == "0", readout == "auto"), []
                        ).append(error)
                        row.append(f"{error:.2f}{'' if trusted else ' (not trusted)'}")
                if share:
                    off.append(abs(found - share))
                false += share == 0 and found > 0
                print(
                    f"{kind} {seed}, read over {share:g}: found {found:g};"
                    f" error as read, given, found: {', '.join(row)} px",
                    flush=True,
                )
    if off:
        figure("share found, off by, median", np.median(off))
        figure("share found, off by, largest", max(off))
        figure("error as read, median", np.median(errors[True, True, False]), "px")
        figure("error with the share given, median", np.median(errors[True, False, False]), "px")
        figure("error with the share found, median", np.median(errors[True, False, True]), "px")
    figure("readout seen where there is none", false)


if __name__ == "__main__":
    main()
