"""Scales of the translation with Adam, from random starts; the same with Ceres."""

import cv2
import numpy as np
from rendered import NEAR, random_rigs
from results import Results

import xcalib

SCALES = (1, 2, 3)


def random_start(rig: xcalib.Rig, rng: np.random.Generator) -> xcalib.Rig:
    """Both of its cameras at 45 deg; turned by up to 2 deg about each axis, up to 0.5 m away."""
    cameras = (
        xcalib.Pinhole.from_hfov(camera.width, camera.height, 45.0)
        for camera in (rig.reference, rig.source)
    )
    R = cv2.Rodrigues(np.radians(rng.uniform(-2, 2, 3)))[0]
    return xcalib.Rig(*cameras, R, rng.uniform(-0.5, 0.5, 3) * (1, 1, 0.3))


def run(results: Results, part: str | None) -> None:
    frames = results.of(8, 2)
    scene = next(iter(random_rigs(1, frames, results.quick, **NEAR)))
    epochs = results.of(120 * 4 // frames, 1)  # the paper's 120 steps
    rng = np.random.default_rng(0)
    starts = [random_start(scene.rig, rng) for _ in range(results.of(10, 1))]
    curves: dict[int, list[np.ndarray]] = {scales: [] for scales in SCALES}
    ends: dict[str, list[list[float]]] = {}

    def note(label: str, result: xcalib.CalibrationResult, loss: float) -> None:
        seconds = result.report.seconds
        ends.setdefault(label, []).append(
            [loss, 1 - result.report.nec, scene.error(result.rig), seconds]
        )

    done = 0
    for start in results.in_time(starts):
        done += 1
        for scales in SCALES:
            adam = xcalib.AdamOptions(epochs=epochs, translation_scales=scales)
            options = xcalib.CalibrationOptions(solver="adam", adam=adam)
            result = scene.calibrate(options, initial=start)
            steps = result.report.steps
            curve = [s.image + options.flow_weight * s.flow for s in steps]
            curves[scales].append(np.array(curve))
            note(f"Adam, {scales} scale{'s' * (scales > 1)}", result, np.mean(curve[-10:]))
        for label, mode in (
            ("Ceres, no search", "off"),
            ("Ceres, local search as by default", "auto"),
        ):
            options = xcalib.CalibrationOptions(search=xcalib.SearchOptions(mode=mode))
            result = scene.calibrate(options, initial=start)
            loss = result.report.levels[-1].final_cost if mode == "off" else np.nan
            note(label, result, loss)
        print({k: [round(x, 2) for x in v[-1]] for k, v in ends.items()}, flush=True)
    rows = []
    for label, values in ends.items():
        v = np.array(values)
        loss = f"{v[:, 0].mean():.3f} ± {v[:, 0].std():.3f}" if np.isfinite(v[:, 0]).all() else "-"
        rows.append(
            [
                label,
                loss,
                f"{v[:, 1].mean():.3f} ± {v[:, 1].std():.3f}",
                f"{np.median(v[:, 2]):.2f}",
                f"{np.sum(v[:, 2] < 1)} of {len(v)}",
                f"{np.median(v[:, 3]):.1f}",
            ]
        )
    results.table(
        "scales",
        ["", "combined loss at the end", "1 - NEC at the end", "EPE, median [px]", "under 1 px",
         "s"],
        rows,
        f"One rendered rig of 320x240, {frames} frames, {done} random starts (up to 2 deg and 0.5 m"
        " off, 45 deg fields of view). Combined loss: image and 2.5 times flow term, mean of the"
        " last ten steps; mean and standard deviation over the starts. Times are rough.",
    )  # fmt: skip

    def draw(figure) -> None:
        axes = figure.subplots()
        for scales, values in curves.items():
            v = np.array(values)
            # An epoch's batches differ: a running mean over it.
            kernel = np.ones(max(1, frames // 4)) / max(1, frames // 4)
            v = np.array([np.convolve(c, kernel, "valid") for c in v])
            mean, sd = v.mean(axis=0), v.std(axis=0)
            (line,) = axes.plot(mean, label=f"Adam, {scales} scale{'s' * (scales > 1)}")
            x = np.arange(len(mean))
            axes.fill_between(x, mean - sd, mean + sd, alpha=0.15, color=line.get_color())
        ceres = np.mean([v[0] for v in ends["Ceres, no search"]])
        axes.axhline(ceres, color="k", ls="--", lw=1, label="Ceres, end, no search")
        axes.set(xlabel="step", ylabel="image + 2.5 flow")
        axes.grid(alpha=0.3)
        axes.legend()

    results.plot("scales", draw)
