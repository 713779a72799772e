"""From how far off is a rig found? Beside ECC and MI on each pair, and the paper's Adam.

Parts: `displacement` (ratio of fields of view by displacement), `limits` (the same for ours alone,
farther), `frames` (frames by roll).
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from baselines import NotFound, homographies, mutual_information
from rendered import HEIGHT, SOURCE_HEIGHT, SOURCE_WIDTH, WIDTH, Rendered, rendered
from results import Results

import xcalib

LIMIT = 2.0
"""A rig counts as found below this median end-point error [px]; a homography can get there."""
BASELINE = 0.1  # [m]

Method = Callable[[Rendered, int], float]
"""Median end-point error [px] of a method that may use so many frames of a scene, the first."""


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


def a_pair(method: Callable) -> Method:
    def error(scene: Rendered, count: int) -> float:
        errors = []
        true = xcalib.Registrar(scene.rig, occlusion="ignore")
        for reference, source, depth in scene.gray_frames(slice(0, count)):
            try:
                found = np.linalg.norm(method(reference, source) - true.map(depth), axis=-1)
                errors.append(np.nanmedian(found))
            except NotFound:
                errors.append(np.inf)
        return float(np.median(errors))

    return error


def a_rig(options: Callable[[int], xcalib.CalibrationOptions]) -> Method:
    def error(scene: Rendered, count: int) -> float:
        try:
            return scene.error(scene.calibrate(options(count), slice(0, count)).rig)
        except RuntimeError:
            return np.inf

    return error


def adam_options(count: int) -> xcalib.CalibrationOptions:
    """The paper's 120 steps, of four frames each or of as many as there are."""
    adam = xcalib.AdamOptions(epochs=480 // max(count, 4))
    return xcalib.CalibrationOptions(solver="adam", adam=adam)


OURS = {"ours": a_rig(lambda count: xcalib.CalibrationOptions())}
WIDE = {
    "ours, max_roll_deg = 20": a_rig(
        lambda count: xcalib.CalibrationOptions(search=xcalib.SearchOptions(max_roll_deg=20))
    )
}
OTHERS = {
    "the paper's Adam": a_rig(adam_options),
    "ECC, a pair": a_pair(homographies.ecc),
    "MI affine, a pair": a_pair(mutual_information.affine),
}
RATIOS, SHIFTS = (0.6, 0.8, 1.0, 1.25, 1.67), (0.0, 0.05, 0.1, 0.2, 0.3)
FAR_RATIOS, FAR_SHIFTS = (0.4, 0.5, 0.6, 1.0, 1.67, 2.0, 2.5), (0.0, 0.2, 0.3, 0.4, 0.5)
ROLLS, FRAMES = (0.0, 5.0, 10.0, 20.0), (1, 2, 4, 8)


@dataclass(frozen=True)
class Grid:
    """What is tried: a value for each row and one for each column, and their labels."""

    rows: tuple[float, ...]
    row_label: str
    columns: tuple[float, ...]
    column_label: str
    column_unit: str

    def explore(
        self, results: Results, methods: dict[str, Method], seeds: int, scene_of
    ) -> tuple[dict[str, np.ndarray], str]:
        """Share of the rigs that each method finds in each cell, and how many there are in one.

        `scene_of(seed, row, column)` gives the scene by the numbers of row and column, and how many
        of its frames may be used.
        """
        shape = len(self.rows), len(self.columns)
        found, done = {label: np.zeros(shape) for label in methods}, np.zeros(shape, int)
        cells = product(range(seeds), *map(range, shape))
        for seed, i, j in results.in_time(cells):
            scene, count = scene_of(seed, i, j)
            for label, error in methods.items():
                found[label][i, j] += error(scene, count) < LIMIT
            done[i, j] += 1
            counts = (f"{v[i, j]:.0f}" for v in found.values())
            print(seed, self.rows[i], self.columns[j], *counts, "of", done[i, j], flush=True)
        if not done.all():
            raise SystemExit("time was up before every cell had a rig; expected more --minutes")
        rigs = " to ".join(str(n) for n in sorted({done.min(), done.max()}))
        return {label: v / done for label, v in found.items()}, rigs

    def write(self, results: Results, name: str, found: dict[str, np.ndarray], note: str) -> None:
        """Tables of the methods, one below the other, and heat maps, side by side."""
        results.table(
            name,
            [
                f"found at {self.row_label} \\ {self.column_label}",
                *(f"{v:g}{self.column_unit}" for v in self.columns),
            ],
            [
                [f"{label}, {of:g}", *(f"{v:.0%}" for v in row)]
                for label, values in found.items()
                for of, row in zip(self.rows, values, strict=True)
            ],
            note,
        )
        results.plot(name, lambda figure: self.heat(figure, found), (max(3, 2.4 * len(found)), 3))

    def heat(self, figure, found: dict[str, np.ndarray]) -> None:
        all_axes = figure.subplots(1, len(found), squeeze=False)[0]
        for axes, (label, values) in zip(all_axes, found.items(), strict=True):
            axes.imshow(values, vmin=0, vmax=1, cmap="viridis", origin="lower", aspect="auto")
            axes.set_title(label, size=9)
            axes.set_xlabel(f"{self.column_label} [{self.column_unit.strip()}]", size=8)
            axes.set_xticks(range(len(self.columns)), [f"{v:g}" for v in self.columns], size=8)
            axes.set_yticks(range(len(self.rows)), [f"{v:g}" for v in self.rows], size=8)
            for (row, column), value in np.ndenumerate(values):
                shade = "k" if value > 0.6 else "w"
                axes.text(
                    column, row, f"{value:.0%}", ha="center", va="center", color=shade, size=7
                )
        all_axes[0].set_ylabel(self.row_label, size=8)


def displacement(
    results: Results,
    name: str,
    ratios: tuple[float, ...],
    shifts: tuple[float, ...],
    methods: dict[str, Method],
) -> None:
    grid = Grid(
        results.of(ratios, ratios[2:3]), "ratio of fields of view",
        results.of(shifts, shifts[1:2]), "displacement", " w",
    )  # fmt: skip

    def scene_of(seed: int, i: int, j: int) -> tuple[Rendered, int]:
        rng = np.random.default_rng([seed, i, j])
        roll, angle = rng.uniform(-2, 2), rng.uniform(0, 2 * np.pi)
        rig = rig_of(grid.rows[i], grid.columns[j], roll, angle)
        return rendered(rig, 4, 100 + seed), 4

    found, rigs = grid.explore(results, methods, results.of(3, 1), scene_of)
    grid.write(
        results,
        name,
        found,
        f"Rendered rigs of 320x240, {rigs} in each cell, 4 frames, baseline {BASELINE:g} m, roll"
        f" within 2 deg; found: median end-point error under {LIMIT:g} px. Ratio of tangents,"
        " source to reference (50 deg); displacement in widths w, in any direction.",
    )


def frames(results: Results) -> None:
    grid = Grid(
        results.of(FRAMES, FRAMES[1:2]), "frames", results.of(ROLLS, ROLLS[:1]), "roll", " deg"
    )

    def scene_of(seed: int, i: int, j: int) -> tuple[Rendered, int]:
        rng = np.random.default_rng([seed, j])  # the same rig for all numbers of frames
        rig = rig_of(rng.uniform(0.8, 1.25), 0.1, grid.columns[j], rng.uniform(0, 2 * np.pi))
        return rendered(rig, max(grid.rows), 200 + seed), grid.rows[i]

    methods = OURS | WIDE | results.of(OTHERS, {})
    found, rigs = grid.explore(results, methods, results.of(3, 1), scene_of)
    grid.write(
        results,
        "frames",
        found,
        f"Rendered rigs of 320x240, {rigs} in each cell, displaced by 0.1 of the width, ratio of"
        " fields of view 0.8-1.25; the search looks for rolls within 5 deg unless asked otherwise."
        f" Found: median end-point error under {LIMIT:g} px, of a rig over all 8 frames.",
    )


def run(results: Results, part: str | None) -> None:
    if part in (None, "displacement"):
        methods = OURS | results.of(OTHERS, {})
        displacement(results, "displacement", RATIOS, SHIFTS, methods)
    if part in (None, "limits"):
        displacement(results, "limits", FAR_RATIOS, FAR_SHIFTS, OURS)
    if part in (None, "frames"):
        frames(results)
