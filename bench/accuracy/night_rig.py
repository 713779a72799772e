"""The night rig: fitted on 32 frames, judged on the other 8 (sorted, every fifth from the fifth).

Gains are printed twice: against the unregistered source over the whole frame, and over the pixels
that the registered source covers (the paper's way: one mask for both).
"""

import argparse
import resource
import time

import numpy as np
from common import machine
from figures import figure
from night import NightRig, gains, patches

from xcalib.depth import PlaneDepth


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--depth", default="depth_filled", help="depth_filled, depth or plane")
    args = parser.parse_args()
    print(machine())
    night = NightRig.open()
    if night is None:
        return

    def depth(name: str) -> np.ndarray:
        if args.depth == "plane":
            return PlaneDepth()(0, night.visible(name))
        return night.depth(args.depth, name)

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
    whole, same = gains(views), gains(views, same_mask=True)
    for score in whole:
        (before, found), (before_same, _) = whole[score], same[score]
        figure(f"{score} unregistered", before)
        figure(f"{score} unregistered, where the registered source is", before_same)
        figure(f"{score} registered", found)
        figure(f"{score} gain", 100 * (found / before - 1), "%")
        figure(f"{score} gain, same mask", 100 * (found / before_same - 1), "%")
    for image in ("unregistered", "registered"):
        norms = patches(views, image)
        low, middle, high = np.percentile(norms, [10, 50, 90])
        figure(f"patch residual, {image}, {len(norms)} patches", middle, "px", low, high)
        figure(f"patch residual, {image}, under 2 px", 100 * np.mean(norms < 2), "%")


if __name__ == "__main__":
    main()
