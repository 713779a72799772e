"""The night rig: fitted on 32 frames, judged on 8 others.

Held out are every fifth of the sorted frames from the fifth. Gains are printed twice: over the
unregistered source of the whole frame, and over that source on the pixels that the registered one
covers (the paper's way: one mask for both).
"""

import argparse
import resource
import time

import numpy as np
from common import machine
from figures import figure
from judge import gain, mean_score, patch_lengths, scored
from night import NightRig

from xcalib import metrics

DEPTHS = ("filled", "semi_dense", "completed", "plane")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--depth", default="filled", choices=DEPTHS)
    args = parser.parse_args()
    print(machine())
    night = NightRig.open()
    if night is None:
        return

    depth = getattr(night, args.depth)
    for name in night.fitted:  # read before the clock starts
        night.visible(name), night.thermal(name)
    depths = {name: depth(name) for name in night.fitted}
    start = time.perf_counter()
    result = night.fit(depths.__getitem__)
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(result.report.full())
    figure("calibration of 32 frames", seconds, "s")
    figure("peak memory of the process, all frames loaded", peak, "MB")
    print(f"t = {result.rig.t.round(4)} m (thermal camera to the right: t_x < 0)")

    views = list(night.views(result.rig, depth))
    judged = [scored(view) for view in views]
    for score in ("NEC", "GC"):
        figure(f"{score} unregistered", mean_score(judged, "whole", score))
        covered = mean_score(judged, "before", score)
        figure(f"{score} unregistered, where the registered source is", covered)
        figure(f"{score} registered", mean_score(judged, "after", score))
        figure(f"{score} gain", 100 * gain(judged, score, over="whole"), "%")
        figure(f"{score} gain, same mask", 100 * gain(judged, score), "%")
    unregistered = [
        metrics.patch_residual(view.reference, view.unregistered, view.mask).norms for view in views
    ]
    for image, norms in (
        ("unregistered", np.concatenate(unregistered)),
        ("registered", patch_lengths(judged)),
    ):
        low, middle, high = np.percentile(norms, [10, 50, 90])
        figure(f"patch residual, {image}, {len(norms)} patches", middle, "px", low, high)
        figure(f"patch residual, {image}, under 2 px", 100 * np.mean(norms < 2), "%")


if __name__ == "__main__":
    main()
