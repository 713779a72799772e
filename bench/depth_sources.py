"""Sources of depth on the night rig: fitted on 32 frames, judged on the other 8, each with its own.

Stereo depth filled in; semi-dense stereo, completed by the image; a road plane as it is and with
horizon and roll found from the footage; one depth for all, which is a homography.
"""

import time
from collections.abc import Callable

import cv2
import numpy as np
from common import data, machine
from night_rig import SIZE, gray

import xcalib
from xcalib import metrics
from xcalib.depth import PlaneDepth, read_depth
from xcalib.depth.completion import MIN_CONFIDENCE, complete
from xcalib.depth.plane_fit import fit_plane, spread

Depth = Callable[[str, np.ndarray], np.ndarray]


def main() -> None:
    print(machine())
    folder = data("lynred_night")
    if folder is None:
        return
    names = sorted(p.name for p in (folder / "visible").iterdir())
    held = names[4::5]
    fitted = [name for name in names if name not in held]
    visible = {n: cv2.imread(str(folder / "visible" / n)) for n in names}
    thermal = {n: cv2.imread(str(folder / "thermal" / n), cv2.IMREAD_UNCHANGED) for n in names}

    def fit(depth: Depth) -> xcalib.CalibrationResult:
        depths = [depth(n, visible[n]) for n in fitted]
        return xcalib.calibrate([visible[n] for n in fitted], [thermal[n] for n in fitted], depths)

    def completed(name: str, image: np.ndarray) -> np.ndarray:
        dense, confidence = complete(read_depth(folder / "depth" / name), image)
        return np.where(confidence >= MIN_CONFIDENCE, dense, 0).astype(np.float32)

    def refined(plane: PlaneDepth) -> PlaneDepth:
        some = spread(fitted)
        start = fit(lambda _, image: plane(0, image)).rig
        images = [visible[n] for n in some], [thermal[n] for n in some]
        found = fit_plane(*images, plane, start, xcalib.CalibrationOptions())
        print(f"plane refined: horizon {found.horizon:g}, roll {found.roll_deg:g} deg")
        return found

    plane = PlaneDepth()
    start = time.perf_counter()
    found = refined(plane)
    print(f"refining took {time.perf_counter() - start:.1f} s, a first fit included")
    sources: dict[str, Depth] = {
        "stereo, filled": lambda name, _: read_depth(folder / "depth_filled" / name),
        "semi-dense stereo": lambda name, _: read_depth(folder / "depth" / name),
        "semi-dense, completed": completed,
        "plane": lambda _, image: plane(0, image),
        "plane, refined": lambda _, image: found(0, image),
        "one depth (homography)": lambda _, image: np.full(image.shape[:2], 20.0, np.float32),
    }
    print(f"{'depth':<24}{'NEC':>8}{'GC':>9}{'patch':>10}{'< 2 px':>8}{'t_x':>9}{'valid':>8}")
    for label, depth in sources.items():
        rig = fit(depth).rig
        registrar = xcalib.Registrar(rig.resized(*SIZE, 579, 477))
        rows, norms, valid = [], [], []
        for name in held:
            reference = cv2.resize(gray(visible[name]), SIZE, interpolation=cv2.INTER_AREA)
            plain = cv2.resize(gray(thermal[name]), SIZE)
            image, mask = registrar.register(gray(thermal[name]), depth(name, visible[name]))
            inside = cv2.erode((mask == 0).astype(np.uint8), np.ones((5, 5), np.uint8))
            pairs = [(plain, None), (image, inside)]
            rows.append([f(reference, im, m) for f in (metrics.nec, metrics.gc) for im, m in pairs])
            norms.append(metrics.patch_residual(reference, image, inside).norms)
            valid.append(inside.mean())
        nec, nec_found, gc, gc_found = np.mean(rows, axis=0)
        norm = np.concatenate(norms)
        print(
            f"{label:<24}{nec_found / nec - 1:>+8.1%}{gc_found / gc - 1:>+9.0%}"
            f"{np.median(norm):>7.2f} px{np.mean(norm < 2):>8.0%}{rig.t[0]:>+7.3f} m"
            f"{np.mean(valid):>8.0%}",
            flush=True,
        )


if __name__ == "__main__":
    main()
