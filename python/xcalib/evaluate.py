"""How well a rig registers real frames, beside the source that is only resized.

Every pair is judged as gray in [0, 1] on a reference grid of about 600 px width, the registered
and the unregistered source over the *same* pixels: those the registration can fill, eroded by
2 px, because the rim of a warp is not an edge.
"""

from __future__ import annotations

from collections.abc import Iterable

from ._core import Evaluation, Evaluator, Rig, evaluation_document
from .frames import Image

__all__ = ["Evaluation", "Evaluator", "evaluate", "evaluation_document"]


def evaluate(
    rig: Rig,
    references: Iterable[Image],
    sources: Iterable[Image],
    depths: Iterable[Image],
    width: int = 640,
    num_threads: int = 0,
) -> Evaluation:
    """Judge a rig on frames; they are taken one by one, so iterators will do.

    Parameters
    ----------
    rig
        The calibration; rescaled to the images if they have its aspects.
    references, sources
        ``(H, W)`` or ``(H, W, 3)`` images, uint8, uint16 or float32 in [0, 1].
    depths
        ``(h, w)`` float32 [m], of any size of the reference's aspect, 0 unknown.
    width
        The reference is reduced by the smallest integer that makes it at most this wide [px].
    num_threads
        0 means all cores.
    """
    evaluator = Evaluator(rig, width, num_threads)
    for reference, source, depth in zip(references, sources, depths, strict=True):
        evaluator.add(reference, source, depth)
    return evaluator.result()
