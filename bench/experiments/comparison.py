"""Experiment 3: ours beside what registers pairs without a rig, and beside the paper's solver.

Parts: `night`, the night rig in five folds of 8 frames, fitted on the other 32 (the fifth is the
split of `bench/night_rig.py`); `rendered`, rigs with truth.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from baselines import NotFound, dense, homographies, mutual_information, unregistered
from baselines.phase_congruency import rift
from footage import NEAR, Night, mapped, random_rigs
from judge import SCORE_COLUMNS, Judged, judge, scores
from results import Results

import xcalib
from xcalib._core import fit_plane, frames_to_judge_plane
from xcalib.depth import PlaneDepth
from xcalib.depth.completion import MIN_CONFIDENCE, complete

PAIRWISE: dict[str, Callable[[np.ndarray, np.ndarray], np.ndarray]] = {
    "unregistered": unregistered,
    "homography a pair, ECC on edges": homographies.ecc,
    "homography a pair, SIFT": homographies.sift,
    "homography a pair, RIFT-like": rift,
    "affine a pair, mutual information": mutual_information.affine,
    "B-spline a pair, mutual information": mutual_information.bspline,
    "flow a pair, patches": dense.patches,
    "flow a pair, DIS on edges": dense.dis,
}
HOMOGRAPHY, ADAM, OURS = (
    "one homography for the rig",
    "the paper's Adam",
    "ours, stereo depth filled",
)

COMPLETED, REFINED = "ours, semi-dense, completed", "ours, road plane, refined"
ONCE = "B-spline a pair, mutual information", COMPLETED, REFINED  # slow: on one fold only


@dataclass
class Row:
    judged: list[Judged] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    """A pair, of registering it: for a rig, without its calibration."""
    failures: int = 0
    fits: list[float] = field(default_factory=list)
    """Seconds of each calibration."""
    trusted: int = 0

    def cells(self, size: tuple[int, int]) -> list[str]:
        fits = f"{np.median(self.fits):.0f} s" if self.fits else "-"
        if self.fits:
            fits += f" ({self.trusted} of {len(self.fits)} trusted)"
        per_pair = f"{np.median(self.seconds):.3f}"
        return [*scores(self.judged, size), per_pair, fits, f"{self.failures}"]


COLUMNS = [*SCORE_COLUMNS, "s a pair", "calibration", "not found"]


def pairwise(row: Row, method, reference, source, truth=None, scale=1.0) -> None:
    """One pair by one method; where it finds nothing, the pair stays as it is."""
    start = time.perf_counter()
    try:
        at = method(reference, source)
    except NotFound:
        row.failures += 1
        at = unregistered(reference, source)
    row.seconds.append(time.perf_counter() - start)
    row.judged.append(judge(reference, source, at, truth=truth, scale=scale))


class Sources:
    """Depth of the night rig by source: `sources[label](name)`."""

    def __init__(self, night: Night) -> None:
        self.night = night
        self.completed: dict[str, np.ndarray] = {}
        self.planes: dict[int, PlaneDepth] = {}

    def filled(self, name: str) -> np.ndarray:
        return self.night.rig.depth("depth_filled", name)

    def semi_dense(self, name: str) -> np.ndarray:
        return self.night.rig.depth("depth", name)

    def completion(self, name: str) -> np.ndarray:
        if name not in self.completed:
            dense_depth, confidence = complete(self.semi_dense(name), self.night.rig.visible(name))
            self.completed[name] = np.where(confidence >= MIN_CONFIDENCE, dense_depth, 0).astype(
                np.float32
            )
        return self.completed[name]

    def plane(self, name: str) -> np.ndarray:
        return PlaneDepth()(0, self.night.rig.visible(name))

    def one_depth(self, name: str) -> np.ndarray:
        return np.full((473, 583), 20.0, np.float32)

    def refined_plane(self, rig: xcalib.Rig, names: list[str]):
        """Horizon and roll found from the frames that the rig was fitted on."""
        some = [names[i] for i in frames_to_judge_plane(len(names))]
        images = (
            [self.night.rig.visible(n) for n in some],
            [self.night.rig.thermal(n) for n in some],
        )
        found = fit_plane(*images, PlaneDepth(), rig, xcalib.CalibrationOptions())
        return lambda name: found(0, self.night.rig.visible(name))


def night_folds(results: Results) -> Iterator[dict[str, Row]]:
    """The rows of each fold, that of `NightRig` first."""
    night = Night.open()
    if night is None:
        return
    sources = Sources(night)
    for k in results.in_time(results.of((4, 0, 1, 2, 3), (4,))):
        fit, held = night.fold(k)
        fit, held = results.of((fit, held), (fit[:4], held[:2]))
        rows: dict[str, Row] = {}
        for label, method in PAIRWISE.items():
            if k != 4 and label in ONCE:
                continue
            row = rows[label] = Row()
            for name in held:
                pairwise(row, method, night.reference(name), night.source(name))
        plane_rig = None
        for label, depth, options in (
            (HOMOGRAPHY, sources.one_depth, {}),
            (ADAM, sources.filled, {"solver": "adam"}),
            (OURS, sources.filled, {}),
            ("ours, semi-dense stereo", sources.semi_dense, {}),
            ("ours, road plane", sources.plane, {}),
            (COMPLETED, sources.completion, {}),
            (REFINED, None, {}),
        ):
            if (results.quick and label not in (HOMOGRAPHY, OURS)) or (k != 4 and label in ONCE):
                continue
            row = rows[label] = Row()
            start = time.perf_counter()
            if depth is None:
                depth = sources.refined_plane(plane_rig, fit)
            result = night.calibrate(fit, depth, xcalib.CalibrationOptions(**options))
            row.fits.append(time.perf_counter() - start)
            row.trusted = int(result.converged)
            if label == "ours, road plane":
                plane_rig = result.rig
            registrar = night.registrar(result.rig)
            for name in held:
                reference, source, map_depth = (
                    night.reference(name),
                    night.source(name),
                    depth(name),
                )
                start = time.perf_counter()
                registrar.register(source, map_depth)
                row.seconds.append(time.perf_counter() - start)
                at, counts = mapped(registrar, source, map_depth)
                row.judged.append(judge(reference, source, at, counts))
            print(
                f"fold {k}, {label}: {row.cells(night.size)}, t {result.rig.t.round(3)}", flush=True
            )
        yield rows


REPORTED = ["*XCalib, as its paper reports on its own 1800 frames of the rig*", "0.46 (+17%)",
            "0.13 (+173%)", "0.36 (+1%)", "0.02 (+37%)", *["-"] * 7]  # fmt: skip


def night_table(results: Results, name: str, folds: list[dict[str, Row]], note: str) -> None:
    rows = []
    for label in folds[-1]:
        together = Row()
        for fold in folds:
            together.judged += fold[label].judged
            together.seconds += fold[label].seconds
            together.failures += fold[label].failures
            together.fits += fold[label].fits
            together.trusted += fold[label].trusted
        rows.append([label, *together.cells((583, 473))])
    results.table(name, ["", *COLUMNS], [*rows, REPORTED], note)


JUDGED = (
    "Each row is judged over its own valid pixels at 583x473; gains are over the unregistered"
    " source on the same pixels. A pair that a method finds nothing for stays unregistered. Times:"
    " rough, of a shared machine."
)


def night_part(results: Results) -> None:
    folds = []
    for rows in night_folds(results):
        folds.append(rows)
        if len(folds) == 1:
            one_fold(results, rows)
        night_table(
            results,
            "folds",
            folds,
            f"{len(folds)} of five folds of 8 frames, each fitted on the other 32; a pair's methods"
            f" on all of them. {JUDGED}",
        )


def one_fold(results: Results, rows: dict[str, Row]) -> None:
    """The split that all other figures of the night rig are of."""
    plain = rows["unregistered"].judged
    nec, gc = (np.mean([j.whole[score] for j in plain]) for score in ("NEC", "GC"))
    note = (
        f"Fitted on 32 frames, judged on {len(plain)} others (sorted, every fifth from the fifth);"
        f" over its whole frame, rim included, the unregistered source has NEC {nec:.3f}, GC"
        f" {gc:.3f}."
    )
    night_table(results, "night", [rows], f"{note} {JUDGED}")


def rendered_part(results: Results) -> None:
    """Rigs near the start of a pair's methods, fitted on 8 frames, judged on 3 others."""
    rows: dict[str, Row] = {}
    fit, held = slice(0, results.of(8, 2)), slice(results.of(8, 2), results.of(11, 3))
    count = results.of(10, 1)
    done = 0
    for scene in results.in_time(random_rigs(count, held.stop, results.quick, **NEAR)):
        done += 1
        one_depth = np.full_like(scene.depths, 20.0)
        fits = {HOMOGRAPHY: (one_depth, {}), ADAM: (scene.depths, {"solver": "adam"}),
                "ours, exact depth": (scene.depths, {})}  # fmt: skip
        registrars = {}
        for label, (depths, options) in fits.items():
            if results.quick and label == ADAM:
                continue
            if "solver" in options:  # the paper's number of steps, of fewer frames
                options = options | {"adam": xcalib.AdamOptions(epochs=60)}
            row = rows.setdefault(label, Row())
            start = time.perf_counter()
            result = scene.calibrate(xcalib.CalibrationOptions(**options), fit, depths)
            row.fits.append(time.perf_counter() - start)
            row.trusted += int(result.converged)
            registrars[label] = depths, xcalib.Registrar(result.rig)
        true = xcalib.Registrar(scene.rig)
        scale = scene.rig.reference.fx / scene.rig.source.fx
        for i in range(held.start, held.stop):
            source = scene.sources[i].astype(np.float32) / 255
            reference = scene.references[i].mean(axis=2).astype(np.float32) / 255
            truth, counts = mapped(true, source, scene.depths[i])
            truth = np.where(counts[..., None], truth, np.nan)
            for label, method in PAIRWISE.items():
                row = rows.setdefault(label, Row())
                pairwise(row, method, reference, source, truth, scale)
            for label, (depths, registrar) in registrars.items():
                row = rows[label]
                start = time.perf_counter()
                registrar.register(source, depths[i])
                row.seconds.append(time.perf_counter() - start)
                at, counts = mapped(registrar, source, depths[i])
                row.judged.append(judge(reference, source, at, counts, truth, scale))
    order = [*PAIRWISE, *(label for label in rows if label not in PAIRWISE)]
    table = []
    for label in order:
        epe = np.concatenate([j.epe for j in rows[label].judged])
        table.append(
            [
                label,
                f"{np.median(epe):.2f}",
                f"{np.mean(epe < 1):.0%}",
                *rows[label].cells(scene.references.shape[2:0:-1]),
            ]
        )
    results.table(
        "rendered",
        ["", "EPE [px]", "< 1 px", *COLUMNS],
        table,
        f"{done} rendered rigs (320x240; axes off by up to 6 % of the width, fields of view 40-50"
        " deg, baseline up to 0.3 m; every third by night), fitted on 8 frames, judged on 3 others."
        " EPE: median over all judged pixels with a true partner, in reference pixels. The patch"
        " residual is meant for wider images.",
    )


def run(results: Results, part: str | None) -> None:
    if part in (None, "rendered"):
        rendered_part(results)
    if part in (None, "night"):
        night_part(results)
