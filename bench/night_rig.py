"""The night rig: fitted on 32 frames, judged on the other 8 (sorted, every fifth from the fifth).

Gains are printed twice: against the unregistered source over the whole frame, and over the pixels
that the registered source covers (the paper's way: one mask for both).
"""

import argparse
import resource
import time

import cv2
import numpy as np
from common import data, machine

import xcalib
from xcalib import metrics
from xcalib.depth import PlaneDepth

SIZE = (583, 473)


def gray(image: np.ndarray) -> np.ndarray:
    one = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
    return one.astype(np.float32) / 255


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--depth", default="depth_filled", help="depth_filled, depth or plane")
    args = parser.parse_args()
    print(machine())
    folder = data("lynred_night")
    if folder is None:
        return
    names = sorted(p.name for p in (folder / "visible").iterdir())
    held = names[4::5]

    def load(name: str, depth: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        visible = cv2.imread(str(folder / "visible" / name))
        thermal = cv2.imread(str(folder / "thermal" / name), cv2.IMREAD_UNCHANGED)
        if depth == "plane":
            return visible, thermal, PlaneDepth()(0, visible)
        raw = cv2.imread(str(folder / depth / name), cv2.IMREAD_UNCHANGED)
        return visible, thermal, raw.astype(np.float32) / 256

    pairs = [load(n, args.depth) for n in names if n not in held]
    start = time.perf_counter()
    result = xcalib.calibrate(*zip(*pairs, strict=True))
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(result.report.full())
    print(f"calibration {seconds:.1f} s, peak memory of the process {peak:.2f} GB")
    print(f"t = {result.rig.t.round(4)} m (thermal camera to the right: t_x < 0)")

    registrar = xcalib.Registrar(result.rig.resized(*SIZE, 579, 477))
    rows, before, after = [], [], []
    for name in held:
        visible, thermal, depth = load(name, args.depth)
        reference = cv2.resize(gray(visible), SIZE, interpolation=cv2.INTER_AREA)
        unregistered = cv2.resize(gray(thermal), SIZE)
        registered, mask = registrar.register(gray(thermal), depth)
        inside = cv2.erode((mask == 0).astype(np.uint8), np.ones((5, 5), np.uint8))
        rows.append(
            [
                f(reference, image, m)
                for f in (metrics.nec, metrics.gc)
                for image, m in (
                    (unregistered, None),
                    (unregistered, inside),
                    (registered, inside),
                )
            ]
        )
        before.append(metrics.patch_residual(reference, unregistered, inside).norms)
        after.append(metrics.patch_residual(reference, registered, inside).norms)
    nec, nec_same, nec_found, gc, gc_same, gc_found = np.mean(rows, axis=0)
    print(f"NEC {nec:.3f} -> {nec_found:.3f}: {nec_found / nec - 1:+.1%}", end="; ")
    print(f"same mask {nec_same:.3f} -> {nec_found:.3f}: {nec_found / nec_same - 1:+.1%}")
    print(f"GC  {gc:.3f} -> {gc_found:.3f}: {gc_found / gc - 1:+.1%}", end="; ")
    print(f"same mask {gc_same:.3f} -> {gc_found:.3f}: {gc_found / gc_same - 1:+.1%}")
    for label, parts in (("unregistered", before), ("registered", after)):
        norms = np.concatenate(parts)
        print(
            f"patch residual {label}: median {np.median(norms):.2f} px, "
            f"{np.mean(norms < 2):.0%} under 2 px, {len(norms)} patches"
        )


if __name__ == "__main__":
    main()
