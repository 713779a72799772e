"""What is recovered beside what the night rig's builders state.

They give the thermal camera at (0.127, -0.008, -0.055) m of the visible one, x to the right, and
fields of view of 43-44 deg before an unknown crop. The depth's own scale is good to about 5 %.
"""

import numpy as np
from night import NightRig
from results import Results

import xcalib

NOMINAL = np.array([0.127, -0.008, -0.055])
HFOV = 43.5


def run(results: Results, part: str | None) -> None:
    night = NightRig.open()
    if night is None:
        return
    fit, _ = night.fold(4)
    fit = results.of(fit, fit[:3])

    def depth_times(factor: float):
        return lambda name: (night.filled(name) * factor).astype(np.float32)

    camera = night.visible(fit[0]).shape
    thermal = night.thermal(fit[0]).shape
    both = {
        "reference_camera": xcalib.Pinhole.from_hfov(camera[1], camera[0], HFOV),
        "source_camera": xcalib.Pinhole.from_hfov(thermal[1], thermal[0], HFOV),
    }
    runs = {
        "as it is": (fit, 1.0, {}),
        "odd frames only": (fit[::2], 1.0, {}),
        "even frames only": (fit[1::2], 1.0, {}),
        "depth 5 % longer": (fit, 1.05, {}),
        "reference assumed 40 deg": (fit, 1.0, {"reference_hfov_deg": 40}),
        "reference assumed 43.5 deg": (fit, 1.0, {"reference_hfov_deg": HFOV}),
        "reference assumed 50 deg": (fit, 1.0, {"reference_hfov_deg": 50}),
        "reference free": (fit, 1.0, {"reference_hfov_deg": HFOV, "optimize_reference": True}),
        "both cameras known, 43.5 deg": (fit, 1.0, both),
    }
    rows = []
    for label, (names, factor, options) in results.in_time(
        list(runs.items())[: results.of(None, 1)]
    ):
        result = night.fit(depth_times(factor), names, xcalib.CalibrationOptions(**options))
        rig, report = result.rig, result.report
        source = rig.source
        centre = -rig.R.T @ rig.t  # of the thermal camera, in the visible one's axes
        angles = np.degrees(np.arccos(np.clip((np.trace(rig.R) - 1) / 2, -1, 1)))
        rows.append(
            [
                label,
                f"({centre[0]:+.3f}, {centre[1]:+.3f}, {centre[2]:+.3f})",
                f"{np.linalg.norm(centre[:2]):.3f}",
                f"{rig.reference.hfov_deg:.1f}",
                f"{rig.source.hfov_deg:.1f}",
                f"{rig.source.fy / rig.source.fx:.3f}",
                f"({source.cx / source.width:.3f}, {source.cy / source.height:.3f})",
                f"{angles:.2f}",
                f"{report.nec:.4f}",
                f"{report.levels[-1].condition_number:.0g}",
            ]
        )
        print(rows[-1], flush=True)
    stated = [f"({NOMINAL[0]:+.3f}, {NOMINAL[1]:+.3f}, {NOMINAL[2]:+.3f})",
              f"{np.linalg.norm(NOMINAL[:2]):.3f}", "43-44", "43-44", *["-"] * 5]  # fmt: skip
    results.table(
        "nominal",
        ["fit", "thermal camera at [m]", "its lateral distance [m]", "HFoV reference [deg]",
         "HFoV source [deg]", "fy / fx", "principal point, shares", "turn [deg]", "NEC",
         "condition"],
        [["*stated by the builders*", *stated], *rows],
        f"The night rig, fitted on {len(fit)} frames with filled stereo depth. NEC is of the"
        " objective, at full working size; condition is of the normal equations with columns of"
        " unit length.",
    )  # fmt: skip
