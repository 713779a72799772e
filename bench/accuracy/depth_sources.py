"""The night rig by where its depth is from, in the fit and in what is judged.

Stereo depth, filled; semi-dense stereo, as it is and completed by the image; a road plane, as it is
and with horizon and roll found from the footage; one depth for all pixels, which is a homography.
"""

import time

import numpy as np
from common import machine
from figures import figure
from judge import gain, patch_lengths, scored
from night import Depth, NightRig


def main() -> None:
    print(machine())
    night = NightRig.open()
    if night is None:
        return
    start = time.perf_counter()
    refined = night.refined_plane(night.fit(night.plane).rig, night.fitted)
    print(f"plane refined: horizon {refined.horizon:g}, roll {refined.roll_deg:g} deg", end=", ")
    print(f"{time.perf_counter() - start:.1f} s, the first fit included")
    sources: dict[str, Depth] = {
        "stereo, filled": night.filled,
        "semi-dense stereo": night.semi_dense,
        "semi-dense, completed": night.completed,
        "plane": night.plane,
        "plane, refined": lambda name: refined(0, night.visible(name)),
        "one depth (homography)": night.one_depth,
    }
    for label, depth in sources.items():
        rig = night.fit(depth).rig
        judged = [scored(view) for view in night.views(rig, depth)]
        lengths = patch_lengths(judged)
        figure(f"{label}: NEC gain", 100 * gain(judged, "NEC", over="whole"), "%")
        figure(f"{label}: GC gain", 100 * gain(judged, "GC", over="whole"), "%")
        if len(lengths):
            figure(f"{label}: patch residual", np.median(lengths), "px")
            figure(f"{label}: patch residual under 2 px", 100 * np.mean(lengths < 2), "%")
        figure(f"{label}: t_x", rig.t[0], "m")
        figure(f"{label}: valid", 100 * np.mean([j.valid for j in judged]), "%")


if __name__ == "__main__":
    main()
