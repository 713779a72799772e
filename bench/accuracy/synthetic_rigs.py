"""Random rendered rigs, exact depth, 8 frames, no initial guess: how many are found.

Reference HFoV 30-90 deg, source to reference ratio 0.5-2, optical axes off by up to 30 % of the
width, roll within 5 deg, baseline up to 0.5 m. Every third street is a night.
"""

import argparse
import time

import numpy as np
from common import machine, median_error
from figures import figure, spread

import xcalib
from xcalib import synthetic


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rigs", type=int, default=100)
    parser.add_argument("--first", type=int, default=0, help="first seed")
    args = parser.parse_args()
    print(machine())
    errors, converged, seconds = [], [], []
    for seed in range(args.first, args.first + args.rigs):
        truth = synthetic.random_rig(seed)
        frames = list(synthetic.render(truth, num_frames=8, seed=seed, night=seed % 3 == 2))
        depths = [f.depth for f in frames]
        start = time.perf_counter()
        result = xcalib.calibrate([f.reference for f in frames], [f.source for f in frames], depths)
        seconds.append(time.perf_counter() - start)
        errors.append(median_error(result.rig, truth, depths))
        converged.append(result.converged)
        print(
            f"rig {seed:3d}: {errors[-1]:8.3f} px, {seconds[-1]:4.1f} s, {result.report.brief()}",
            flush=True,
        )
    error, trusted = np.array(errors), np.array(converged)
    spread("median end-point error of a rig", error, "px")
    figure("worst of them", error.max(), "px")
    figure("rigs", len(error))
    figure("under 0.3 px", np.sum(error < 0.3))
    figure("under 1 px", np.sum(error < 1))
    figure("reported as converged", trusted.sum())
    figure("reported as converged, over 1 px", (error[trusted] > 1).sum(), target="<= 0")
    figure("under 1 px but reported as not converged", np.sum(~trusted & (error < 1)))
    spread("time of a calibration", seconds, "s")


if __name__ == "__main__":
    main()
