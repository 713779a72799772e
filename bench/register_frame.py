"""One 1280x960 frame from a 640x512 float32 source, one thread, against numpy + cv2.remap."""

import time

import cv2
import numpy as np
from common import machine

import xcalib


def main() -> None:
    print(machine())
    cv2.setNumThreads(1)
    rng = np.random.default_rng(0)
    reference = xcalib.Pinhole.from_hfov(1280, 960, 50)
    rig = xcalib.Rig(reference, xcalib.Pinhole.from_hfov(640, 512, 48), t=[-0.13, 0.01, 0.02])
    registrar = xcalib.Registrar(rig, num_threads=1)
    source = rng.random((512, 640), dtype=np.float32)
    # A road, another height each frame: like real depth it is smooth, which caches like.
    row = np.arange(960, dtype=np.float32)[:, None] - 400
    depths = [
        np.broadcast_to(np.where(row > 0, height * 1370 / np.maximum(row, 1), 80), (960, 1280))
        .clip(0, 80)
        .astype(np.float32)
        for height in (1.4, 1.5, 1.6, 1.7)
    ]
    y, x = np.mgrid[0:960, 0:1280].astype(np.float32)
    h = rig.infinite_homography.astype(np.float32)
    k = (rig.source.K @ rig.t).astype(np.float32)

    def peer(depth: np.ndarray) -> np.ndarray:
        z = depth * (h[2, 0] * x + h[2, 1] * y + h[2, 2]) + k[2]
        u = (depth * (h[0, 0] * x + h[0, 1] * y + h[0, 2]) + k[0]) / z
        v = (depth * (h[1, 0] * x + h[1, 1] * y + h[1, 2]) + k[1]) / z
        return cv2.remap(source, u, v, cv2.INTER_LINEAR)

    ours, theirs = [], []
    for i in range(60):  # in pairs, so that the machine's mood cancels
        depth = depths[i % 4]
        start = time.perf_counter()
        registrar.register(source, depth)
        middle = time.perf_counter()
        peer(depth)
        ours.append(middle - start)
        theirs.append(time.perf_counter() - middle)
    ratio = np.array(theirs) / np.array(ours)
    print(
        f"Registrar.register {np.median(ours) * 1e3:.2f} ms, numpy map + cv2.remap "
        f"{np.median(theirs) * 1e3:.2f} ms; ratio {np.median(ratio):.2f} "
        f"({np.percentile(ratio, 10):.2f}-{np.percentile(ratio, 90):.2f})"
    )


if __name__ == "__main__":
    main()
