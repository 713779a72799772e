"""What the patch residual of the night rig's unseen frames consists of.

Each row shows what is left of it after a correction that can mend one cause only. A correction
fitted on the 32 frames (a smooth field, as of lens distortion, and a depth scale by depth) is
judged on the other 8; one made from a judged frame itself (its own shift, its own affine) is a
bound, not a method.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from judge import counted_map, judge, systematic
from night import SIZE, NightRig
from rendered import rendered
from results import Results

import xcalib
from xcalib import metrics, synthetic


@dataclass
class Patches:
    """Of one frame: centres and shifts [px], depth there, and how much it varies about it."""

    at: np.ndarray
    shift: np.ndarray
    inverse: np.ndarray
    varied: np.ndarray
    bright: np.ndarray


def measured(night: NightRig, registrar, name: str) -> Patches:
    source, depth = night.source(name), night.filled(name)
    reference = night.reference(name)
    at, counts = counted_map(registrar, source, depth)
    patches = judge(reference, source, at, counts).patches
    inverse, varied, bright = [], [], []
    for x, y in patches.centers.round().astype(int):
        here = depth[max(0, y - 24) : y + 24, max(0, x - 24) : x + 24]
        some = here[here > 0]
        low, mid, high = np.percentile(1 / some, (10, 50, 90)) if some.size else (0, 0, 0)
        inverse.append(mid)
        varied.append(high - low)
        bright.append(reference[max(0, y - 24) : y + 24, max(0, x - 24) : x + 24].mean())
    return Patches(patches.centers, patches.shifts, *map(np.array, (inverse, varied, bright)))


def basis(p: Patches, degree: int, by_depth: bool) -> np.ndarray:
    """Polynomials of the place, and of inverse depth where asked for."""
    x, y = ((p.at[:, k] - SIZE[k] / 2) / (SIZE[0] / 2) for k in (0, 1))
    columns = [x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)]
    if by_depth:
        columns += [p.inverse, p.inverse * x, p.inverse * y]
    return np.stack(columns, axis=1)


def robust_fit(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Least squares with Huber weights at 1 px."""
    weight = np.ones(len(b))
    solution = np.zeros((a.shape[1], 2))
    for _ in range(15):
        root = np.sqrt(weight)[:, None]
        solution = np.linalg.lstsq(a * root, b * root, rcond=None)[0]
        length = np.linalg.norm(b - a @ solution, axis=1)
        weight = 1 / np.maximum(length, 1.0)
    return solution


def neighbours(frames: list[Patches], distance: int) -> tuple[float, float]:
    """Correlation of x and of y shifts of patches so far apart along or across [px]."""
    first, second = [], []
    for p in frames:
        small = np.hypot(*p.shift.T) < 6
        at, shift = p.at[small], (p.shift - np.median(p.shift, axis=0))[small]
        apart = np.abs(at[:, None] - at[None]).max(axis=-1)
        i, j = np.nonzero(np.abs(apart - distance) < 4)
        first.append(shift[i])
        second.append(shift[j])
    a, b = np.concatenate(first), np.concatenate(second)
    return tuple(float(np.corrcoef(a[:, k], b[:, k])[0, 1]) for k in (0, 1))


def parallax(rig: xcalib.Rig, p: Patches) -> np.ndarray:
    """What a relative change of its depth moves each patch by, to first order [px]."""
    rays = np.column_stack([p.at, np.ones(len(p.at))]) @ np.linalg.inv(rig.reference.K).T
    baseline = rig.source.K @ rig.t
    inverse = p.inverse[:, None]
    at = rays @ (rig.source.K @ rig.R).T + inverse * baseline
    slope = inverse * (baseline[:2] - at[:, :2] / at[:, 2:] * baseline[2]) / at[:, 2:]
    return slope * rig.reference.fx / rig.source.fx


def less(shift: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Without what lies along the vectors `most`, up to their length either way."""
    length = np.maximum(np.linalg.norm(most, axis=1, keepdims=True), 1e-9)
    unit = most / length
    return shift - unit * np.clip((shift * unit).sum(axis=1, keepdims=True), -length, length)


def without_neighbours(p: Patches, degree: int) -> np.ndarray:
    """Less the frame's own field, fitted to patches that share no pixel with the block."""
    block = (p.at[:, 0] // 110 + 10 * (p.at[:, 1] // 110)).astype(int)
    a, left = basis(p, degree, False), p.shift.copy()
    for b in np.unique(block):
        here = np.nonzero(block == b)[0]
        far = np.abs(p.at[:, None] - p.at[here][None]).max(axis=-1).min(axis=1) >= 48
        if far.sum() > 2 * a.shape[1]:
            left[here] -= a[here] @ robust_fit(a[far], p.shift[far])
    return left


def systematic_by_chance(frames: list[Patches]) -> float:
    """The systematic residual of the same patches, their signs drawn: median of 200."""
    rng = np.random.default_rng(0)
    found = []
    for _ in range(200):
        drawn = [
            metrics.PatchResidual(p.at, p.shift * rng.choice([-1, 1], (len(p.at), 1)))
            for p in frames
        ]
        found.append(systematic(drawn, SIZE))
    return float(np.median(found))


def own_noise(results: Results) -> list[str]:
    """The measure on rendered nights of that size, registered by the true rig."""
    rig = synthetic.demo_rig().resized(*SIZE, 579, 477)
    scene = rendered(rig, results.of(6, 1), 7, night=True)
    registrar = xcalib.Registrar(rig)
    patches = []
    for reference, source, depth in scene.gray_frames():
        at, counts = counted_map(registrar, source, depth)
        patches.append(judge(reference, source, at, counts).patches)
    shift = np.concatenate([p.shifts for p in patches])
    norms = np.hypot(*shift.T)
    x, y = np.median(np.abs(shift), axis=0)
    return ["*the measure's own: rendered nights, true rig and depth*", f"{np.median(norms):.2f}",
            f"{np.mean(norms < 2):.0%}", f"{x:.2f}", f"{y:.2f}",
            f"{systematic(patches, SIZE):.2f}", f"{len(norms)}"]  # fmt: skip


def run(results: Results, part: str | None) -> None:
    night = NightRig.open()
    if night is None:
        return
    fit, held = night.fold(4)
    fit, held = results.of((fit, held), (fit[:3], held[:1]))
    rig = night.fit(night.filled, fit).rig
    registrar = night.registrar(rig)
    fitted = [measured(night, registrar, n) for n in fit]
    judged = [measured(night, registrar, n) for n in held]
    rows = []

    def row(label: str, shifts: list[np.ndarray]) -> None:
        norms = np.concatenate([np.hypot(*s.T) for s in shifts])
        kept = [
            metrics.PatchResidual(p.at, s.astype(np.float32))
            for p, s in zip(judged, shifts, strict=True)
        ]
        rows.append(
            [label, f"{np.median(norms):.2f}", f"{np.mean(norms < 2):.0%}",
             f"{np.median(np.abs(np.concatenate(shifts)[:, 0])):.2f}",
             f"{np.median(np.abs(np.concatenate(shifts)[:, 1])):.2f}",
             f"{systematic(kept, SIZE):.2f}", f"{len(norms)}"]
        )  # fmt: skip

    row("as it is", [p.shift for p in judged])
    for label, degree, by_depth in (
        ("a constant shift, from the 32", 0, False),
        ("a smooth field of degree 3, from the 32 (distortion)", 3, False),
        ("the same and terms by inverse depth, from the 32", 3, True),
    ):
        a = np.concatenate([basis(p, degree, by_depth) for p in fitted])
        solution = robust_fit(a, np.concatenate([p.shift for p in fitted]))
        row(label, [p.shift - basis(p, degree, by_depth) @ solution for p in judged])
    for label, degree, by_depth in (
        ("its own shift (vibration, time): bound", 0, False),
        ("its own affine (rolling shutter, turns): bound", 1, False),
        ("its own shift and terms by inverse depth (motion): bound", 0, True),
    ):
        own = [basis(p, degree, by_depth) for p in judged]
        row(
            label,
            [p.shift - a @ robust_fit(a, p.shift) for p, a in zip(judged, own, strict=True)],
        )
    for label, degree in (("shift", 0), ("affine", 1)):
        row(
            f"its own {label}, from patches that share no pixel",
            [without_neighbours(p, degree) for p in judged],
        )
    moves = [0.1 * parallax(registrar.rig, p) for p in judged]
    row(
        "what 10 % of its depth can take: bound",
        [less(p.shift, m) for p, m in zip(judged, moves, strict=True)],
    )
    row(
        "as much across, which no depth moves: control",
        [less(p.shift, m[:, ::-1] * (-1, 1)) for p, m in zip(judged, moves, strict=True)],
    )
    row("all along the baseline (x) taken away (depth): bound", [p.shift * (0, 1) for p in judged])
    row("all across it (y) taken away: bound", [p.shift * (1, 0) for p in judged])
    chance = f"{systematic_by_chance(judged):.2f}"
    rows.append(["*signs of the patches drawn: systematic by chance*", *["-"] * 4, chance, "-"])
    rows.append(own_noise(results))
    results.table(
        "corrections",
        ["what is taken away", "median [px]", "< 2 px", "x [px]", "y [px]", "systematic [px]",
         "patches"],
        rows,
        f"Patch residual of {len(held)} unseen frames, fitted on {len(fit)}, filled stereo depth; x"
        " and y are medians of lengths.",
    )  # fmt: skip

    every = fitted + judged
    distances = (32, 64, 96, 128, 192)
    likeness = [neighbours(every, distance) for distance in distances]
    results.table(
        "neighbours",
        ["", *(f"{d} px apart" for d in distances)],
        [[f"of {name}", *(f"{c[k]:.2f}" for c in likeness)] for k, name in enumerate("xy")],
        f"Correlation of the shifts of two patches of one frame, less the frame's median, of shifts"
        f" under 6 px; {len(every)} frames. Patches are 48 px wide: those 32 px apart overlap.",
    )
    shift = np.concatenate([p.shift for p in every])
    length = np.hypot(*shift.T)
    groups = []
    for label, values in (
        ("inverse depth [1/m]", np.concatenate([p.inverse for p in every])),
        ("its spread in the patch [1/m]", np.concatenate([p.varied for p in every])),
        ("brightness of the visible image", np.concatenate([p.bright for p in every])),
        ("row [px]", np.concatenate([p.at[:, 1] for p in every])),
        ("distance to the centre [px]", np.concatenate(
            [np.hypot(*(p.at - np.array(SIZE) / 2).T) for p in every])),
    ):  # fmt: skip
        edges = np.quantile(values, (0, 0.25, 0.5, 0.75, 1))
        cells = []
        for low, high in pairwise(edges):
            some = (values >= low) & (values <= high)
            x, y = np.median(np.abs(shift[some]), axis=0)
            cells.append(
                f"{np.median(length[some]):.2f} ({x:.2f}, {y:.2f}); {low:.3g} to {high:.3g}"
            )
        groups.append([label, *cells])
    results.table(
        "where",
        ["by", "lowest quarter", "second", "third", "highest quarter"],
        groups,
        f"Median patch residual [px] over all {len(every)} frames, in quarters of the patches; in"
        " brackets of its lengths in x and y; then the values that bound the quarter.",
    )
