"""Ours beside what registers pairs without a rig, and beside the paper's solver.

Parts: `night`, the night rig in five folds of 8 frames, fitted on the other 32 (the fifth is the
split of `bench/accuracy/night_rig.py`); `rendered`, rigs with truth.
"""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from baselines import NotFound, dense, homographies, mutual_information, unregistered
from baselines.phase_congruency import rift
from judge import SCORE_COLUMNS, Judged, counted_map, judge, score_cells
from night import SIZE, NightRig
from rendered import NEAR, random_rigs
from results import Results

import xcalib

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
        return [*score_cells(self.judged, size), per_pair, fits, f"{self.failures}"]


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


def night_folds(results: Results) -> Iterator[dict[str, Row]]:
    """The rows of each fold, the one of `NightRig.held` first."""
    night = NightRig.open()
    if night is None:
        return
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
            (HOMOGRAPHY, night.one_depth, {}),
            (ADAM, night.filled, {"solver": "adam"}),
            (OURS, night.filled, {}),
            ("ours, semi-dense stereo", night.semi_dense, {}),
            ("ours, road plane", night.plane, {}),
            (COMPLETED, night.completed, {}),
            (REFINED, None, {}),
        ):
            if (results.quick and label not in (HOMOGRAPHY, OURS)) or (k != 4 and label in ONCE):
                continue
            row = rows[label] = Row()
            start = time.perf_counter()
            if depth is None:
                plane = night.refined_plane(plane_rig, fit)
                depth = lambda name, plane=plane: plane(0, night.visible(name))  # noqa: E731
            result = night.fit(depth, fit, xcalib.CalibrationOptions(**options))
            row.fits.append(time.perf_counter() - start)
            row.trusted = int(result.converged)
            if label == "ours, road plane":
                plane_rig = result.rig
            registrar = night.registrar(result.rig)
            for name in held:
                reference, source = night.reference(name), night.source(name)
                map_depth = depth(name)
                start = time.perf_counter()
                registrar.register(source, map_depth)
                row.seconds.append(time.perf_counter() - start)
                at, counts = counted_map(registrar, source, map_depth)
                row.judged.append(judge(reference, source, at, counts))
            print(f"fold {k}, {label}: {row.cells(SIZE)}, t {result.rig.t.round(3)}", flush=True)
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
        rows.append([label, *together.cells(SIZE)])
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
        for i, (reference, source, depth) in enumerate(scene.gray_frames(held), held.start):
            truth, counts = counted_map(true, source, depth)
            truth = np.where(counts[..., None], truth, np.nan)
            for label, method in PAIRWISE.items():
                row = rows.setdefault(label, Row())
                pairwise(row, method, reference, source, truth, scale)
            for label, (depths, registrar) in registrars.items():
                row = rows[label]
                start = time.perf_counter()
                registrar.register(source, depths[i])
                row.seconds.append(time.perf_counter() - start)
                at, counts = counted_map(registrar, source, depths[i])
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
