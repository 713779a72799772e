"""Sources of depth on the night rig: fitted on 32 frames, judged on the other 8, each with its own.

Stereo depth filled in; semi-dense stereo, completed by the image; a road plane as it is and with
horizon and roll found from the footage; one depth for all, which is a homography.
"""

import time
from collections.abc import Callable

import numpy as np
from common import machine
from figures import figure
from night import NightRig, gains, patches

import xcalib
from xcalib._core import fit_plane, frames_to_judge_plane
from xcalib.depth import PlaneDepth
from xcalib.depth.completion import MIN_CONFIDENCE, complete


def main() -> None:
    print(machine())
    night = NightRig.open()
    if night is None:
        return
    plane = PlaneDepth()

    def of_plane(some: PlaneDepth) -> Callable[[str], np.ndarray]:
        return lambda name: some(0, night.visible(name))

    def completed(name: str) -> np.ndarray:
        dense, confidence = complete(night.depth("depth", name), night.visible(name))
        return np.where(confidence >= MIN_CONFIDENCE, dense, 0).astype(np.float32)

    start = time.perf_counter()
    rig, some = (
        night.fit(of_plane(plane)).rig,
        [night.fitted[i] for i in frames_to_judge_plane(len(night.fitted))],
    )
    images = [night.visible(n) for n in some], [night.thermal(n) for n in some]
    found = fit_plane(*images, plane, rig, xcalib.CalibrationOptions())
    print(f"plane refined: horizon {found.horizon:g}, roll {found.roll_deg:g} deg", end=", ")
    print(f"{time.perf_counter() - start:.1f} s, the first fit included")

    sources: dict[str, Callable[[str], np.ndarray]] = {
        "stereo, filled": lambda name: night.depth("depth_filled", name),
        "semi-dense stereo": lambda name: night.depth("depth", name),
        "semi-dense, completed": completed,
        "plane": of_plane(plane),
        "plane, refined": of_plane(found),
        "one depth (homography)": lambda name: np.full((946, 1166), 20.0, np.float32),
    }
    for label, depth in sources.items():
        rig = night.fit(depth).rig
        views = list(night.views(rig, depth))
        (nec, nec_found), (gc, gc_found) = gains(views).values()
        norms, valid = patches(views), np.mean([view.inside.mean() for view in views])
        figure(f"{label}: NEC gain", 100 * (nec_found / nec - 1), "%")
        figure(f"{label}: GC gain", 100 * (gc_found / gc - 1), "%")
        figure(f"{label}: patch residual", np.median(norms), "px")
        figure(f"{label}: patch residual under 2 px", 100 * np.mean(norms < 2), "%")
        figure(f"{label}: t_x", rig.t[0], "m")
        figure(f"{label}: valid", 100 * valid, "%")


if __name__ == "__main__":
    main()
