"""The road plane's horizon and roll, from the footage itself.

A horizon that is a few pixels off bends the depth of the far road, where it is largest, and no
rig makes up for it: the Normalized Edge Correlation that a fit reaches tells. The camera's height
is not looked for: it scales depth and translation alike, and the images do not change.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from .._core import CalibrationOptions, Rig, SearchOptions, calibrate
from ..frames import Image
from .plane import PlaneDepth

FRAMES = 12
"""Frames that judge a plane, at most."""
WIDTH = 320
"""Working width at which planes are judged [px]."""
SCAN = {"horizon": (0.04, 3), "roll_deg": (1.5, 1)}
"""Steps by which each is looked at first, and how many either way: fits have maxima of their own
between a guess and the best, so that going uphill from the guess is not enough."""
FINE = 2
"""Times that the steps are halved around the best of the scan."""


def spread(indices: Sequence[int]) -> Sequence[int]:
    """At most `FRAMES` of the indices, evenly: enough to judge a plane by."""
    return indices[:: -(-len(indices) // FRAMES)]


def fit_plane(
    references: Sequence[Image],
    sources: Sequence[Image],
    plane: PlaneDepth,
    rig: Rig,
    options: CalibrationOptions,
    progress: Callable[[], object] = lambda: None,
) -> PlaneDepth:
    """The plane near ``plane`` whose best rig aligns most edges.

    Parameters
    ----------
    references, sources
        Images ``(H, W)`` or ``(H, W, 3)``, as `calibrate` takes them; a dozen is enough.
    plane
        Where to start; its height, far distance and field of view are kept.
    rig
        A rig fitted with ``plane``: every other plane's fit starts there.
    options
        Of the calibration: known cameras and threads are kept.
    progress
        Called after each fit.
    """
    quick = CalibrationOptions(
        num_threads=options.num_threads,
        working_width=min(WIDTH, options.working_width),
        optimize_reference=options.optimize_reference,
        reference_camera=options.reference_camera,
        source_camera=options.source_camera,
        search=SearchOptions(mode="off"),
        flow="off",  # the plane before is near enough
    )
    known: dict[PlaneDepth, tuple[float, Rig]] = {}

    def fit(candidate: PlaneDepth, start: Rig) -> None:
        if candidate not in known:
            depths = [candidate(0, image) for image in references]
            result = calibrate(references, sources, depths, start, quick)
            known[candidate] = result.report.nec, result.rig
            progress()

    def better(best: PlaneDepth, name: str, step: float, count: int) -> PlaneDepth:
        """The best of the planes within ``count`` steps; each fit starts at its neighbour's."""
        value = getattr(best, name)
        tried = [best]
        for sign in (-1, 1):
            neighbour = best
            for k in range(1, count + 1):
                candidate = replace(best, **{name: round(value + sign * k * step, 6)})
                fit(candidate, known[neighbour][1])
                tried.append(candidate)
                neighbour = candidate
        return max(tried, key=lambda each: known[each][0])

    best = plane
    fit(best, rig)
    for halving in range(FINE + 1):
        for name, (step, count) in SCAN.items():
            best = better(best, name, step / 2**halving, count if halving == 0 else 1)
    return best
