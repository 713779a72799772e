"""Experiment 7: from how far off is a rig found? Beside ECC and MI a pair, and the paper's Adam.

Parts: `displacement` (ratio of fields of view by displacement), `frames` (roll by frames).
"""

from collections.abc import Callable

import cv2
import numpy as np
from baselines import NotFound, homographies, mutual_information
from footage import HEIGHT, SOURCE_HEIGHT, SOURCE_WIDTH, WIDTH, Rendered, rendered
from results import Results

import xcalib

LIMIT = 2.0
"""Median end-point error of what counts as found [px]: a homography may."""
BASELINE = 0.1  # [m]


def rig_of(ratio: float, shift: float, roll_deg: float, angle: float) -> xcalib.Rig:
    """Reference of 50 deg, which sees the source's axis `shift` of its width off its centre."""
    reference = xcalib.Pinhole.from_hfov(WIDTH, HEIGHT, 50)
    tangent = ratio * np.tan(np.radians(25))
    source = xcalib.Pinhole.from_hfov(
        SOURCE_WIDTH, SOURCE_HEIGHT, 2 * np.degrees(np.arctan(tangent))
    )
    along = shift * WIDTH / reference.fx
    turn = cv2.Rodrigues(np.array([np.sin(angle), np.cos(angle), 0]) * np.arctan(along))[0]
    roll = cv2.Rodrigues(np.array([0, 0, np.radians(roll_deg)]))[0]
    return xcalib.Rig(reference, source, roll @ turn, [-BASELINE, 0.01, 0.0])


def by_pair(method: Callable) -> Callable[[Rendered], float]:
    def error(scene: Rendered) -> float:
        errors = []
        true = xcalib.Registrar(scene.rig, occlusion="ignore")
        for reference, source, depth in zip(
            scene.references, scene.sources, scene.depths, strict=True
        ):
            images = reference.mean(axis=2).astype(np.float32) / 255, source / np.float32(255)
            try:
                found = np.linalg.norm(method(*images) - true.map(depth), axis=-1)
                errors.append(np.nanmedian(found))
            except NotFound:
                errors.append(np.inf)
        return float(np.median(errors))

    return error


def by_rig(**options) -> Callable[[Rendered], float]:
    def error(scene: Rendered) -> float:
        try:
            made = xcalib.CalibrationOptions(
                **{name: make() if callable(make) else make for name, make in options.items()}
            )
            return scene.error(scene.calibrate(made).rig)
        except RuntimeError:
            return np.inf

    return error


METHODS = {
    "ours": by_rig(),
    "the paper's Adam": by_rig(solver="adam", adam=lambda: xcalib.AdamOptions(epochs=120)),
    "ECC, a pair": by_pair(homographies.ecc),
    "MI affine, a pair": by_pair(mutual_information.affine),
}
RATIOS, SHIFTS = (0.6, 0.8, 1.0, 1.25, 1.67), (0.0, 0.05, 0.1, 0.2, 0.3)
ROLLS, FRAMES = (0.0, 5.0, 10.0, 20.0), (1, 2, 4, 8)


def heat(figure, panels: dict[str, np.ndarray], x, y, xlabel: str, ylabel: str) -> None:
    all_axes = figure.subplots(1, len(panels), squeeze=False)[0]
    for axes, (label, values) in zip(all_axes, panels.items(), strict=True):
        axes.imshow(values, vmin=0, vmax=1, cmap="viridis", origin="lower")
        axes.set(title=label, xlabel=xlabel)
        axes.set_xticks(range(len(x)), [f"{v:g}" for v in x])
        axes.set_yticks(range(len(y)), [f"{v:g}" for v in y])
        for (row, column), value in np.ndenumerate(values):
            shade = "k" if value > 0.6 else "w"
            axes.text(column, row, f"{value:.0%}", ha="center", va="center", color=shade, size=7)
    all_axes[0].set(ylabel=ylabel)


def table_of(values: np.ndarray, x, y, corner: str) -> tuple[list[str], list[list[str]]]:
    columns = [corner, *(f"{v:g}" for v in x)]
    return columns, [
        [f"{name:g}", *(f"{v:.0%}" for v in row)] for name, row in zip(y, values, strict=True)
    ]


def rows_of(found: dict[str, np.ndarray], x, y) -> list[list[str]]:
    """The tables of several methods, one below the other."""
    return [
        [f"{label}, {row[0]}", *row[1:]]
        for label, values in found.items()
        for row in table_of(values, x, y, "")[1]
    ]


def displacement(results: Results) -> None:
    ratios, shifts = results.of(RATIOS, RATIOS[2:3]), results.of(SHIFTS, SHIFTS[1:2])
    methods = dict(list(METHODS.items())[: results.of(None, 1)])
    found = {label: np.zeros((len(ratios), len(shifts))) for label in methods}
    done = 0
    for seed in results.in_time(range(results.of(3, 1))):
        done += 1
        for i, ratio in enumerate(ratios):
            for j, shift in enumerate(shifts):
                rng = np.random.default_rng([seed, i, j])
                rig = rig_of(ratio, shift, rng.uniform(-2, 2), rng.uniform(0, 2 * np.pi))
                scene = rendered(rig, 4, 100 + seed)
                for label, error in methods.items():
                    found[label][i, j] += error(scene) < LIMIT
        print(seed, {label: f"{v.mean() / done:.0%}" for label, v in found.items()}, flush=True)
    found = {label: v / done for label, v in found.items()}
    results.table(
        "displacement",
        ["found at ratio of fields of view \\ displacement", *(f"{s:g} w" for s in shifts)],
        rows_of(found, shifts, ratios),
        f"{done} rendered rig{'s' * (done > 1)} of 320x240 in each cell, 4 frames, baseline"
        f" {BASELINE:g} m, roll within 2 deg; found: median end-point error under {LIMIT:g} px."
        " Ratio of tangents, source to reference (50 deg); displacement in widths, any direction.",
    )
    results.plot(
        "displacement",
        lambda figure: heat(
            figure, found, shifts, ratios, "displacement [widths]", "ratio of fields of view"
        ),
        (11, 3),
    )


def frames(results: Results) -> None:
    rolls, counts = results.of(ROLLS, ROLLS[:1]), results.of(FRAMES, FRAMES[1:2])
    done = 0
    ranges = {"ours": 5.0, "ours, max_roll_deg = 20": 20.0}
    found = {label: np.zeros((len(counts), len(rolls))) for label in ranges}
    for seed in results.in_time(range(results.of(3, 1))):
        done += 1
        for j, roll in enumerate(rolls):
            rng = np.random.default_rng([seed, j])
            rig = rig_of(rng.uniform(0.8, 1.25), 0.1, roll, rng.uniform(0, 2 * np.pi))
            scene = rendered(rig, max(counts), 200 + seed)
            for i, count in enumerate(counts):
                for label, limit in ranges.items():
                    search = xcalib.SearchOptions(max_roll_deg=limit)
                    options = xcalib.CalibrationOptions(search=search)
                    result = scene.calibrate(options, slice(0, count))
                    found[label][i, j] += scene.error(result.rig) < LIMIT
        print(seed, {k: v.mean() / done for k, v in found.items()}, flush=True)
    values = {label: v / done for label, v in found.items()}
    results.table(
        "frames",
        ["found at frames \\ roll", *(f"{r:g} deg" for r in rolls)],
        rows_of(values, rolls, counts),
        f"{done} rendered rig{'s' * (done > 1)} of 320x240 in each cell, displaced by 0.1 of the"
        " width, ratio of fields of view 0.8-1.25; the search looks for rolls within 5 deg unless"
        " told otherwise.",
    )
    results.plot(
        "frames", lambda figure: heat(figure, values, rolls, counts, "roll [deg]", "frames"), (7, 3)
    )


def run(results: Results, part: str | None) -> None:
    if part in (None, "displacement"):
        displacement(results)
    if part in (None, "frames"):
        frames(results)
