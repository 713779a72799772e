"""Errors of the depth: what does the rig absorb, and what stays in the image?

A rig is fitted with the wrong depth and registers with it. Beside it: the true rig with that depth,
which absorbs nothing.
"""

from collections.abc import Callable

import cv2
import numpy as np
from rendered import NEAR, Rendered, random_rigs
from results import Results

import xcalib

Change = Callable[[np.ndarray, np.random.Generator], np.ndarray]


def smooth(shape: tuple[int, int], rng: np.random.Generator, cell: int) -> np.ndarray:
    """Noise of unit variance, correlated over about `cell` px."""
    small = rng.standard_normal((shape[0] // cell + 2, shape[1] // cell + 2)).astype(np.float32)
    field = cv2.resize(small, shape[::-1], interpolation=cv2.INTER_CUBIC)
    return (field - field.mean()) / field.std()


def noise(share: float, cell: int = 20) -> Change:
    return lambda depth, rng: depth * np.exp(share * smooth(depth.shape, rng, cell))


def displaced_edges(pixels: int) -> Change:
    """What is near grows by that much, as in depth of large windows."""
    kernel = np.ones((2 * pixels + 1, 2 * pixels + 1), np.uint8)

    def change(depth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        far = np.where(depth > 0, depth, 1e6).astype(np.float32)
        near = cv2.erode(far, kernel)
        return np.where(near < 1e6, near, 0)

    return change


def holes(share: float) -> Change:
    def change(depth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        field = smooth(depth.shape, rng, 16)
        return np.where(field < np.quantile(field, share), 0, depth)

    return change


def scaled(factor: float) -> Change:
    return lambda depth, rng: depth * factor


def shifted(metres: float) -> Change:
    return lambda depth, rng: np.where(depth > 0, depth + metres, 0)


def inverse_shifted(per_metre: float) -> Change:
    def change(depth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        with np.errstate(divide="ignore"):
            inverse = 1 / depth + per_metre
        return np.where((depth > 0) & (inverse > 1e-3), 1 / np.maximum(inverse, 1e-3), 0)

    return change


CHANGES: dict[str, Change] = {
    "exact": lambda depth, rng: depth,
    "correlated noise, 5 %": noise(0.05),
    "correlated noise, 10 %": noise(0.1),
    "correlated noise, 20 %": noise(0.2),
    "correlated noise, 40 %": noise(0.4),
    "near things grown by 2 px": displaced_edges(2),
    "near things grown by 4 px": displaced_edges(4),
    "holes, 30 %": holes(0.3),
    "holes, 60 %": holes(0.6),
    "scaled by 0.25": scaled(0.25),
    "scaled by 0.5": scaled(0.5),
    "scaled by 2": scaled(2.0),
    "scaled by 4": scaled(4.0),
    "1 m added": shifted(1.0),
    "0.02 / m added to inverse depth": inverse_shifted(0.02),
}


def end_points(scene: Rendered, rig: xcalib.Rig, depths: np.ndarray) -> np.ndarray:
    """Lengths between where `rig` with `depths` and the true rig with true depth send a pixel."""
    found, true = xcalib.Registrar(rig, occlusion="ignore"), xcalib.Registrar(
        scene.rig, occlusion="ignore"
    )  # fmt: skip
    errors = [
        np.linalg.norm(found.map(wrong.astype(np.float32)) - true.map(depth), axis=-1)
        for wrong, depth in zip(depths, scene.depths, strict=True)
    ]
    errors = np.concatenate([e[np.isfinite(e)] for e in errors])
    return errors if errors.size else np.array([np.inf])


def run(results: Results, part: str | None) -> None:
    changes = dict(list(CHANGES.items())[: results.of(None, 2)])
    found = {label: [] for label in changes}
    for seed, scene in enumerate(
        results.in_time(random_rigs(results.of(12, 1), 4, results.quick, **NEAR))
    ):
        for label, change in changes.items():
            rng = np.random.default_rng(seed)
            depths = np.stack([change(d, rng) for d in scene.depths]).astype(np.float32)
            result = scene.calibrate(depths=depths)
            ours, perfect = end_points(scene, result.rig, depths), end_points(
                scene, scene.rig, depths
            )  # fmt: skip
            rig, truth = result.rig, scene.rig
            found[label].append(
                [
                    np.median(ours),
                    np.mean(ours < 1),
                    np.median(perfect),
                    np.mean(perfect < 1),
                    scene.error(rig),
                    rig.t @ truth.t / (truth.t @ truth.t),
                    np.linalg.norm(rig.t - truth.t),
                    rig.source.fx / truth.source.fx * truth.reference.fx / rig.reference.fx - 1,
                    result.converged,
                ]
            )
        print(f"rig {seed} done", flush=True)
    rows = []
    for label, values in found.items():
        v = np.array(values, float)
        m = np.median(v, axis=0)
        rows.append(
            [
                label,
                f"{m[2]:.2f} ({m[3]:.0%})",
                f"{m[0]:.2f} ({m[1]:.0%})",
                f"{m[4]:.2f}",
                f"{m[5]:.2f}",
                f"{m[6]:.3f}",
                f"{m[7]:+.2%}",
                f"{v[:, 8].sum():.0f} of {len(v)}",
            ]
        )
    results.table(
        "depth",
        ["depth", "true rig with it: EPE [px] (< 1 px)", "fitted rig with it",
         "fitted rig with exact depth",
         "t found, along the true t", "error of t [m]", "ratio of focal lengths off by", "trusted"],
        rows,
        f"{len(v)} rendered rigs of 320x240, 4 frames each, registered on the same frames; medians"
        " over rigs of median end-point errors in source pixels. Focal lengths are free only up to"
        " the assumed field of view of the reference, so their ratio is compared.",
    )  # fmt: skip
