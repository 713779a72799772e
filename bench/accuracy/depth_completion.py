"""Filling depth: known pixels are hidden, filled and compared, by five methods.

Night rig (semi-dense stereo, 583x473, 8 frames): a random tenth of the known pixels, and 40x40 px
blocks. KITTI (lidar, 3 frames): a random tenth of the points. The error is |dz| / z of the hidden
pixels. `xcalib` is what ships, `nearest` the simplest baseline.
"""

import time
from collections.abc import Callable, Iterator

import cv2
import numpy as np
from common import data, machine
from figures import figure, spread
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, cg

from xcalib._core import complete_depth as complete
from xcalib._core import compressed_guide
from xcalib.depth.lidar import project, read_lidar_calibration, read_points, without_hidden
from xcalib.frames import size_of

Array = np.ndarray


def nearest(depth: Array, guide: Array) -> Array:
    """The value of the nearest known pixel."""
    unknown = (depth <= 0).astype(np.uint8)
    _, labels = cv2.distanceTransformWithLabels(
        unknown, cv2.DIST_L2, 5, labelType=cv2.DIST_LABEL_PIXEL
    )
    values = np.zeros(labels.max() + 1, np.float32)
    values[labels[unknown == 0]] = depth[unknown == 0]
    return values[labels]


def conductance(guide: Array) -> tuple[Array, Array]:
    """The core's: weights of each pixel's bond to its right (h, w-1) and lower (h-1, w)."""
    right, down = np.diff(guide, axis=1), np.diff(guide, axis=0)
    return 1 / (1 + (right / 0.1) ** 2), 1 / (1 + (down / 0.1) ** 2)


def nearest_colour(depth: Array, guide: Array) -> Array:
    """Known pixels 0 to 32 px away in 8 directions, weighted by distance and gray."""
    known = depth > 0
    inverse = np.where(known, 1 / np.where(known, depth, 1), 0).astype(np.float32)
    total, mass = np.zeros_like(inverse), np.full_like(inverse, 1e-12)
    shades = compressed_guide(guide, *size_of(depth))
    for reach in (0, 2, 4, 8, 16, 32):
        for dy, dx in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (-1, -1), (1, -1), (-1, 1)):
            move = np.float32([[1, 0, dx * reach], [0, 1, dy * reach]])
            size = (depth.shape[1], depth.shape[0])
            moved = [
                cv2.warpAffine(part, move, size, borderMode=cv2.BORDER_REPLICATE)
                for part in (inverse, known.astype(np.float32), shades)
            ]
            weight = moved[1] * np.exp(-20 * np.abs(moved[2] - shades)) / (1 + reach) ** 3
            total += weight * moved[0]
            mass += weight
    found = mass > 1e-9
    return np.where(found, mass / np.maximum(total, 1e-12), nearest(depth, guide))


def global_smoother(depth: Array, guide: Array) -> Array:
    """Weighted least squares by separable tridiagonal solves, 3 sweeps."""
    known = (depth > 0).astype(np.float32)
    inverse = np.where(depth > 0, 1 / np.where(depth > 0, depth, 1), 0).astype(np.float32)
    right, down = conductance(compressed_guide(guide, *size_of(depth)))
    u = np.stack([inverse, known, 1e-6 * np.ones_like(known)])
    for sweep in range(3):
        strength = 1.5 * 100 * 4 ** (2 - sweep) / (4**3 - 1)
        u = tridiagonal(u, strength * right)
        u = tridiagonal(u.transpose(0, 2, 1), strength * down.T).transpose(0, 2, 1)
    return np.maximum(u[1], 1e-20) / np.maximum(u[0], 1e-20)


def tridiagonal(f: Array, w: Array) -> Array:
    """Solve (1 + w) u - w u = f along the rows of (k, h, n) for weights (h, n - 1)."""
    n = f.shape[2]
    pad = np.zeros((w.shape[0], 1), np.float32)
    left, right = np.hstack([pad, w]).T.copy(), np.hstack([w, pad]).T.copy()
    f = np.ascontiguousarray(f.transpose(2, 0, 1))
    out, c = np.empty_like(f), np.empty_like(left)
    c[0], out[0] = -right[0] / (1 + right[0]), f[0] / (1 + right[0])
    for i in range(1, n):
        m = 1 + left[i] + right[i] + left[i] * c[i - 1]
        c[i] = -right[i] / m
        out[i] = (f[i] + left[i] * out[i - 1]) / m
    for i in range(n - 2, -1, -1):
        out[i] -= c[i] * out[i + 1]
    return out.transpose(1, 2, 0)


def diffusion(depth: Array, guide: Array) -> Array:
    """Anisotropic diffusion to its end: conjugate gradients, from the nearest."""
    h, w = depth.shape
    right, down = conductance(compressed_guide(guide, *size_of(depth)))
    r = np.pad(right, ((0, 0), (0, 1))).ravel()[:-1].astype(float)  # none across the rows' ends
    d = down.ravel().astype(float)
    laplace = sparse.diags([-d, -r, -r, -d], [-w, -1, 1, w], format="csr")
    laplace = laplace - sparse.diags(np.asarray(laplace.sum(axis=1)).ravel())
    known = (depth > 0).ravel()
    inverse = np.where(known, 1 / np.where(known, depth.ravel(), 1), 0)
    system = (laplace + sparse.diags(10.0 * known)).tocsr()
    scale = 1 / system.diagonal()
    jacobi = LinearOperator(system.shape, lambda v: scale * v)
    start = 1 / nearest(depth, guide).ravel()
    u, _ = cg(system, 10 * inverse, x0=start, M=jacobi, rtol=1e-4, maxiter=300)
    return (1 / np.maximum(u, 1e-6)).reshape(h, w).astype(np.float32)


def shipped(depth: Array, guide: Array) -> Array:
    return complete(depth, guide)[0]


CANDIDATES: dict[str, Callable[[Array, Array], Array]] = {
    "nearest": nearest,
    "nearest, colour": nearest_colour,
    "global smoother": global_smoother,
    "diffusion, CG": diffusion,
    "xcalib": shipped,
}


def cases() -> Iterator[tuple[str, Array, Array, Array]]:
    """Name, depth, guide, hidden pixels."""
    rng = np.random.default_rng(0)
    night = data("lynred_night")
    if night:
        for name in sorted(p.name for p in (night / "depth").iterdir())[::5]:
            guide = cv2.imread(str(night / "visible" / name))
            depth = cv2.imread(str(night / "depth" / name), -1).astype(np.float32) / 256
            yield "night, tenth", depth, guide, rng.random(depth.shape) < 0.1
            blocks = rng.random((12, 15)) < 0.1
            blocks = np.kron(blocks, np.ones((40, 40), bool))[: depth.shape[0], : depth.shape[1]]
            yield "night, blocks", depth, guide, blocks
    kitti = data("kitti")
    if kitti:
        for scan in sorted((kitti / "velodyne").iterdir()):
            guide = cv2.imread(str(kitti / "image_2" / f"{scan.stem}.png"))
            calibration = read_lidar_calibration(kitti / "calib" / f"{scan.stem}.txt")
            depth = without_hidden(project(read_points(scan), calibration, size_of(guide)))
            yield "kitti, tenth", depth, guide, rng.random(depth.shape) < 0.1


def main() -> None:
    cv2.setNumThreads(1)
    print(machine())
    errors: dict[tuple[str, str], list[Array]] = {}
    seconds: dict[tuple[str, str], list[float]] = {}
    confidences: dict[str, list[Array]] = {}
    for case, depth, guide, hidden in cases():
        judged = hidden & (depth > 0)
        if not judged.any():
            continue
        given = np.where(hidden, 0, depth)
        for name, fill in CANDIDATES.items():
            start = time.perf_counter()
            dense = fill(given, guide)
            seconds.setdefault((case, name), []).append(time.perf_counter() - start)
            error = np.abs(dense[judged] - depth[judged]) / depth[judged]
            errors.setdefault((case, name), []).append(error)
        confidences.setdefault(case, []).append(complete(given, guide)[1][judged])
    for (case, name), parts in errors.items():
        e = 100 * np.concatenate(parts)
        figure(f"{case}: {name}, median error", np.median(e), "%")
        figure(f"{case}: {name}, off by more than 10 %", 100 * np.mean(e > 10), "%")
        spread(f"{case}: {name}, a frame", 1e3 * np.array(seconds[case, name]), "ms")
    print("\nshipped, by its confidence: share of the hidden pixels, share of them off by > 10 %")
    for case, parts in confidences.items():
        c, e = np.concatenate(parts), np.concatenate(errors[case, "xcalib"])
        row = f"{case:<15}"
        for low in (0, 0.25, 0.5, 0.75):
            inside = (c >= low) & (c < low + 0.25 + (low == 0.75))
            bad = np.mean(e[inside] > 0.1) if inside.any() else np.nan
            row += f"  {low:.2f}-{low + 0.25:.2f}: {inside.mean():4.0%}, {bad:5.1%}"
        print(row)


if __name__ == "__main__":
    main()
