"""What the flow term adds: convergence without the search, and accuracy with it.

Random rendered rigs of 8 frames, started at 45 deg and the identity as the paper does, axes off by
up to a share of the width. A rig is found if its median end-point error is under 1 px.
"""

import argparse
import time

import numpy as np
from common import machine, median_error
from figures import figure

import xcalib
from xcalib import synthetic

VARIANTS = {
    "edges alone, no search": {"flow": "off", "search": "off"},
    "with flow, no search": {"flow": "on", "search": "off"},
    "Adam, edges alone": {"flow": "off", "solver": "adam"},
    "Adam with flow": {"flow": "on", "solver": "adam"},
    "search": {"flow": "off", "search": "auto"},
    "search, with flow": {"flow": "on", "search": "auto"},
}


def options(flow: str, search: str = "auto", solver: str = "ceres") -> xcalib.CalibrationOptions:
    return xcalib.CalibrationOptions(
        flow=flow,
        solver=solver,
        search=xcalib.SearchOptions(mode=search),
        adam=xcalib.AdamOptions(epochs=60),  # of 8 frames: the paper's 120 steps
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rigs", type=int, default=6, help="at each displacement")
    parser.add_argument("--offsets", type=float, nargs="+", default=[0.03, 0.06, 0.12])
    args = parser.parse_args()
    print(machine())
    for offset in args.offsets:
        starts, errors, seconds = [], {v: [] for v in VARIANTS}, {v: [] for v in VARIANTS}
        for seed in range(args.rigs):
            truth = synthetic.random_rig(
                seed, hfov_deg=(40, 50), fov_ratio=(0.85, 1.18), max_offset=offset, max_baseline=0.3
            )
            frames = list(synthetic.render(truth, num_frames=8, seed=seed, night=seed % 3 == 2))
            images = [f.reference for f in frames], [f.source for f in frames]
            depths = [f.depth for f in frames]
            start = xcalib.Rig(
                xcalib.Pinhole.from_hfov(truth.reference.width, truth.reference.height, 45),
                xcalib.Pinhole.from_hfov(truth.source.width, truth.source.height, 45),
            )
            starts.append(median_error(start, truth, depths))
            for name, settings in VARIANTS.items():
                began = time.perf_counter()
                result = xcalib.calibrate(*images, depths, options=options(**settings))
                seconds[name].append(time.perf_counter() - began)
                errors[name].append(median_error(result.rig, truth, depths))
            row = ", ".join(f"{errors[name][-1]:.2f}" for name in VARIANTS)
            print(f"offset {offset:g}, rig {seed}: {starts[-1]:.1f} px -> {row}", flush=True)
        print(f"axes off by up to {offset:g} of the width, start {np.median(starts):.0f} px off:")
        for name, values in errors.items():
            found = np.array(values) < 1
            middle = np.median(np.array(values)[found]) if found.any() else np.nan
            label = f"offset {offset:g}, {name}"
            figure(f"{label}: found, of {len(found)}", found.sum())
            figure(f"{label}: median error of those", middle, "px")
            figure(f"{label}: time", np.median(seconds[name]), "s")


if __name__ == "__main__":
    main()
