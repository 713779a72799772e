"""How far a rig has moved since it was last calibrated, on the footage of a new calibration.

``python -m xcalib.batch.drift REPORT LAST_RIG`` prints it as JSON.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from .. import metrics
from .._core import InputError, Rig
from ..convert import is_foreign, read_rig
from ..evaluation import evaluate
from ..report.run import Run, of_report

FRAMES = 8
"""Frames that are looked at, of those that were calibrated on."""
WIDTH = 640.0
"""Of the reference image that errors are given at [px], as the verdict gives them."""


def drift(run: Run, last: Rig) -> dict[str, Any]:
    """Where the two rigs put the same pixels, and which of them registers the footage better.

    ``median_px`` and ``p95_px``: distance between the two mappings, over the footage's own depths,
    where the reference is 640 px wide. ``nec_last``, ``nec_new``: the objective with each.
    """
    frames = run.frames
    step = max(1, len(run.chosen) // FRAMES)
    chosen = list(run.chosen)[::step][:FRAMES]
    new, last = frames.fit(run.rig), frames.fit(last)
    distances, references, sources, depths = [], [], [], []
    for index in chosen:
        reference, source, depth = frames.read(index)
        distances.append(metrics.end_point_error(new, last, depth).ravel())
        references.append(reference)
        sources.append(source)
        depths.append(depth)
    moved = np.concatenate(distances)
    moved = moved[np.isfinite(moved)]
    if not moved.size:
        raise InputError("the two rigs see nothing of the footage in common")
    # From the source's pixels to the reference's, and from these to the width of 640.
    unit = new.reference.fx / new.source.fx * WIDTH / new.reference.width
    median, p95 = (float(value) for value in unit * np.percentile(moved, (50, 95)))
    scores = [
        float(np.mean([after["nec"] for after, _ in found.frames]))
        for found in (evaluate(rig, references, sources, depths) for rig in (last, new))
    ]
    return {"median_px": median, "p95_px": p95, "nec_last": scores[0], "nec_new": scores[1]}


def main(report: str, last_rig: str) -> None:
    """Print the drift since the last rig."""
    path = Path(last_rig)
    last = read_rig(path) if is_foreign(path) else Rig.load(path)
    with of_report(Path(report)) as run:
        print(json.dumps(drift(run, last)))


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
