"""Whether footage tells how long the source takes to read a frame.

Rendered drives of 14 frames whose source reads its rows one after another, over a share of the time
from frame to frame (0: all at once). For each share that is tried, rows of the source are moved
back by what the flow to the next source frame says of it (OpenCV's DIS), the rig is fitted anew,
and the NEC is compared. It can be told where the NEC is largest at the true share.
"""

import argparse
from itertools import pairwise

import cv2
import numpy as np
from accuracy.lags import Drive, rig_of
from common import machine
from figures import figure

import xcalib
from xcalib import metrics

FRAMES, BANDS = 14, 12
SHARES = (0.0, 0.25, 0.5, 0.75)


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


def read_at_once(image, following, share):
    """The image with its rows where they were when the first one was read."""
    height, width = image.shape
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    flow = dis.calc(image, following, None)
    y, x = np.mgrid[:height, :width].astype(np.float32)
    late = share * y / height
    return cv2.remap(
        image,
        x + late * flow[..., 0],
        y + late * flow[..., 1],
        cv2.INTER_LINEAR,
        None,
        cv2.BORDER_REPLICATE,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=20, help="seed")
    parser.add_argument("--drives", type=int, default=2, help="of each kind")
    parser.add_argument("--kinds", nargs="*", default=["uneven", "steady"])
    arguments = parser.parse_args()
    print(machine())
    right, total, gains = 0, 0, []
    for kind in arguments.kinds:
        for seed in range(arguments.first, arguments.first + arguments.drives):
            rig = rig_of(seed)
            drive = Drive(rig, kind, seed)
            frames = [drive.frame(i) for i in range(FRAMES - 1)]
            references, depths = ([getattr(f, n) for f in frames] for n in ("reference", "depth"))
            for true in (0.0, 0.5):
                sources = [
                    np.clip(rolled(drive, i, true), 0, 255).astype(np.uint8) for i in range(FRAMES)
                ]
                necs, errors = [], []
                for share in SHARES:
                    straight = [read_at_once(a, b, share) for a, b in pairwise(sources)]
                    result = xcalib.calibrate(references, straight, depths)
                    necs.append(result.report.nec)
                    errors.append(
                        np.median(
                            [
                                np.nanmedian(metrics.end_point_error(result.rig, rig, d))
                                for d in depths
                            ]
                        )
                    )
                best = SHARES[int(np.argmax(necs))]
                right += best == true
                total += 1
                gains.append(errors[0] - errors[SHARES.index(true)])
                print(
                    f"{kind} {seed}, read over {true}: found {best}; NEC {np.round(necs, 4)},"
                    f" error {np.round(errors, 2)} px",
                    flush=True,
                )
    figure(f"readout found, of {total}", right)
    figure("error that it takes away, median", np.median(gains), "px")


if __name__ == "__main__":
    main()
