"""Would registration gain if each frame were fitted anew? Two ways that were tried, and why not.

One refines the depth of each pixel, within 10 % of what is given, by how well edges agree along its
epipolar line; the other finds a frame's own shift by how well all its edges agree. Both maximise
what the scores measure, so a gain in the scores alone shows nothing. The first is therefore
compared with the same search *across* the epipolar line, where depth moves nothing, and with known
depth.
"""

import cv2
import numpy as np
from depth_errors import displaced_edges, noise
from judge import SCORE_COLUMNS, Judged, counted_map, judge, sampled, score_cells
from night import SIZE, NightRig
from rendered import rendered
from results import Results

import xcalib
from xcalib import synthetic

REACH = 0.1  # of inverse depth, either way
LABELS = 11
WINDOW = 6.0  # [px] sigma of what is compared
TIE = 0.03  # what the furthest depth costs, of 1 - NEC
STEP, JUMP = 0.005, 0.03  # what a neighbour one label, or more, away costs


def edges(image: np.ndarray, valid: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Edge vectors as in the objective, after a blur of 1 px; 0 where not valid."""
    smooth = cv2.GaussianBlur(image, (0, 0), 1.0)
    x, y = np.zeros_like(smooth), np.zeros_like(smooth)
    x[:, 1:-1] = (smooth[:, 2:] - smooth[:, :-2]) / 2
    y[1:-1] = (smooth[2:] - smooth[:-2]) / 2
    counts = np.ones(image.shape, bool) if valid is None else valid
    g = np.hypot(x, y)
    mean = g[counts].mean()
    scale = np.maximum(np.minimum(g, 2 * mean) - 0.3 * mean, 0) / np.maximum(g, 1e-9) * counts
    return x * scale, y * scale


def warped_edges(source: np.ndarray, at: np.ndarray):
    image, inside = sampled(source, np.nan_to_num(at, nan=-1).astype(np.float32))
    valid = cv2.erode((inside).astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0) > 0
    return edges(np.where(inside, image, 0), valid)


def reference_edges(reference: np.ndarray):
    low, high = np.percentile(reference, (1, 99))
    return edges(np.log1p(20 * np.clip((reference - low) / max(high - low, 1e-6), 0, 1)))


def aggregated(cost: np.ndarray) -> np.ndarray:
    """Semi-global: least costs (labels, H, W) of paths from the left, right, top and bottom."""

    def along(lines: np.ndarray) -> np.ndarray:  # (n, labels, m), over n
        out = lines.copy()
        for i in range(1, len(lines)):
            last = out[i - 1]
            least = last.min(axis=0)
            padded = np.pad(last, ((1, 1), (0, 0)), constant_values=np.inf)
            near = np.minimum(padded[:-2], padded[2:]) + STEP
            out[i] += np.minimum(np.minimum(last, near), least + JUMP) - least
        return out

    rows, columns = cost.transpose(1, 0, 2), cost.transpose(2, 0, 1)
    return (
        along(rows).transpose(1, 0, 2)
        + along(rows[::-1])[::-1].transpose(1, 0, 2)
        + along(columns).transpose(1, 2, 0)
        + along(columns[::-1])[::-1].transpose(1, 2, 0)
    ) / 4


def refined(registrar, reference, source, depth, across: bool = False) -> np.ndarray:
    """The map of the refined depth; `across`: of as large steps at right angles to them."""
    given = registrar.map(depth)

    def at_share(share) -> np.ndarray:
        moved = registrar.map((depth / (1 + share)).astype(np.float32))
        return given + (moved - given)[..., ::-1] * (-1, 1) if across else moved

    def window(values: np.ndarray) -> np.ndarray:
        return cv2.GaussianBlur(values, (0, 0), WINDOW)

    ax, ay = reference_edges(reference)
    aa = window(ax * ax + ay * ay)
    evidence = aa / (aa + np.median(aa))
    shares = np.linspace(-REACH, REACH, LABELS)
    costs = []
    for share in shares:
        bx, by = warped_edges(source, at_share(share))
        norm = np.sqrt(aa * window(bx * bx + by * by) + 1e-9)
        nec = window(np.abs(ax * bx + ay * by)) / norm
        costs.append((1 - nec) * evidence + TIE * (share / REACH) ** 2)
    total = aggregated(np.array(costs, np.float32))
    best = np.clip(total.argmin(axis=0), 1, LABELS - 2)
    low, mid, high = (np.take_along_axis(total, (best + k)[None], 0)[0] for k in (-1, 0, 1))
    bend = np.maximum(low - 2 * mid + high, 1e-7)
    share = shares[0] + (best + np.clip((low - high) / (2 * bend), -1, 1)) * (shares[1] - shares[0])
    return at_share(cv2.GaussianBlur(share.astype(np.float32), (0, 0), 2.0)).astype(np.float32)


def shifted(registrar, reference, source, depth) -> np.ndarray:
    """The map moved by half of the frame's own best shift and roll: half, as it is noisy."""
    given = registrar.map(depth)
    height, width = depth.shape
    x, y = np.meshgrid(np.arange(width) - width / 2, np.arange(height) - height / 2)
    ax, ay = reference_edges(reference)

    def moved(by: np.ndarray) -> np.ndarray:
        roll = by[2] / (width / 2)
        return (given + np.stack([by[0] - roll * y, by[1] + roll * x], axis=-1)).astype(np.float32)

    def nec(by: np.ndarray) -> float:
        bx, by_ = warped_edges(source, moved(by))
        met = (bx != 0) | (by_ != 0)
        norm = np.sum((ax**2 + ay**2)[met]) * np.sum(bx**2 + by_**2)
        return float(np.sum(np.abs(ax * bx + ay * by_)) / np.sqrt(norm))

    best, step = np.zeros(3), 0.7  # [px], roll at the side of the image
    for _ in range(2):
        for k in range(3):
            low, mid, high = (nec(best + q * step * np.eye(3)[k]) for q in (-1, 0, 1))
            if (bend := low - 2 * mid + high) < -1e-7:
                best[k] += step * np.clip((low - high) / (2 * bend), -1.5, 1.5)
    return moved(best / 2)


def error(at: np.ndarray, truth: np.ndarray) -> tuple[float, float]:
    """Median and root mean square, of at most 10 px."""
    lengths = np.linalg.norm(at - truth, axis=-1)
    lengths = lengths[np.isfinite(lengths)]
    return float(np.median(lengths)), float(np.sqrt(np.mean(np.minimum(lengths, 10) ** 2)))


def on_night(results: Results, night: NightRig) -> list[list[str]]:
    """Scores in four folds of the 32 frames; returns rows of known depth errors."""
    names = night.fitted
    ways = {
        "as it is": None,
        "depth refined": refined,
        "the same across the epipolar line: control": lambda *a: refined(*a, across=True),
        "half of the frame's own shift and roll": shifted,
    }
    judged: dict[str, list[Judged]] = {label: [] for label in ways}
    known: list[list[tuple[float, float]]] = [[], []]
    rng = np.random.default_rng(0)
    for k in range(results.of(4, 1)):
        held = names[k::4]
        fit = [n for n in names if n not in held]
        rig = night.fit(night.filled, results.of(fit, fit[:3])).rig
        registrar = night.registrar(rig)
        for name in results.of(held, held[:1]):
            source, depth = night.source(name), night.filled(name)
            reference = night.reference(name)
            at, counts = counted_map(registrar, source, depth)
            for label, way in ways.items():
                here = way(registrar, reference, source, depth) if way else at
                judged[label].append(judge(reference, source, here, counts))
            wrong = noise(0.1, 40)(depth, rng).astype(np.float32)
            known[0].append(error(registrar.map(wrong), at))
            known[1].append(error(refined(registrar, reference, source, wrong), at))
    results.table(
        "night",
        ["", *SCORE_COLUMNS],
        [[label, *score_cells(found, SIZE)] for label, found in judged.items()],
        f"{len(judged['as it is'])} frames of the night rig in folds, the 8 unseen ones not among"
        " them; filled stereo depth.",
    )
    return [known_row("night rig, 10 % of noise (40 px) put on the depth given", known)]


def known_row(label: str, errors) -> list[str]:
    cells = [np.mean(part, axis=0) for part in errors]
    return [label, *(f"{median:.3f} ({rms:.3f})" for median, rms in cells)]


def on_rendered(results: Results) -> list[list[str]]:
    rig = synthetic.demo_rig().resized(*SIZE, 579, 477)
    registrar = xcalib.Registrar(rig)
    frames = results.of(4, 1)
    scenes = [rendered(rig, frames, seed, night=seed == 7) for seed in (7, 8)]
    rows = []
    for label, change in {
        "exact": lambda depth, rng: depth,
        "5 % of noise (20 px)": noise(0.05),
        "10 % of noise (20 px)": noise(0.1),
        "near things grown by 2 px": displaced_edges(2),
    }.items():
        rng = np.random.default_rng(0)
        known: list[list[tuple[float, float]]] = [[], []]
        for scene in scenes:
            for reference, source, depth in scene.gray_frames():
                wrong = change(depth, rng).astype(np.float32)
                truth = registrar.map(depth)
                known[0].append(error(registrar.map(wrong), truth))
                known[1].append(error(refined(registrar, reference, source, wrong), truth))
        rows.append(known_row(f"rendered, {label}", known))
    return rows


def run(results: Results, part: str | None) -> None:
    rows = on_rendered(results)
    if (night := NightRig.open()) is not None:
        rows += on_night(results, night)
    results.table(
        "known",
        ["depth", "EPE with it [px]", "EPE with it refined [px]"],
        rows,
        "Medians, in brackets root mean squares, means over frames. Rendered: two streets, one by"
        " night, true rig, against the true depth; night rig: against the depth given.",
    )
