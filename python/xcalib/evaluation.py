"""How well a rig registers real frames, beside the source that is only resized.

Every pair is judged as gray in [0, 1] on a reference grid of about 600 px width, the registered
and the unregistered source over the *same* pixels: those the registration can fill, eroded by
2 px, because the rim of a warp is not an edge.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterable
from typing import Any

from ._core import Evaluation, Evaluator, Rig, evaluation_document
from .depth.provider import DepthProvider
from .frames import Image
from .wrong_calls import shown

__all__ = ["Evaluation", "Evaluator", "evaluate", "evaluation_document"]

_MISSING: Any = object()
"""In place of a frame that there is not."""


def evaluate(
    rig: Rig,
    references: Iterable[Image],
    sources: Iterable[Image],
    depths: Iterable[Image] | DepthProvider,
    width: int = 640,
    num_threads: int = 0,
    given: Iterable[Image] | None = None,
    judge: bool = False,
) -> Evaluation:
    """Judge a rig on frames; they are taken one by one, so streams and iterators will do.

    Parameters
    ----------
    rig
        The calibration; rescaled to the images if they have its aspects.
    references, sources
        ``(H, W)`` or ``(H, W, 3)`` images, uint8, uint16 or float32 in [0, 1].
    depths
        ``(h, w)`` float32 [m], of any size of the reference's aspect, 0 unknown; or a provider as
        `xcalib.depth.open_depth` gives.
    width
        The reference is reduced by the smallest integer that makes it at most this wide [px].
    num_threads
        0 means all cores.
    given
        The sources as another method registers them, of the reference's aspect: scored beside ours,
        over the same pixels.
    judge
        Judge the rig on a dozen of these frames too, as a calibration would: `Evaluation.verdict`.
        It takes some seconds.

    Raises
    ------
    ValueError
        Where one of them has fewer frames than another, or an image cannot be used.
    """
    if not isinstance(rig, Rig):
        raise TypeError(
            f"evaluate(): rig is {shown(rig)}, expected an xcalib.Rig; xcalib.Rig.load reads one"
        )
    named = {"references": references, "sources": sources, "depths": depths, "given": given}
    for name, images in named.items():
        if isinstance(images, (str, bytes, os.PathLike)):
            opener = "depth.open_depth" if name == "depths" else "footage.open_stream"
            raise TypeError(
                f"evaluate(): {name} is the path {shown(images)}, expected images;"
                f" xcalib.{opener} opens one"
            )
    evaluator = Evaluator(rig, width, num_threads)
    if isinstance(depths, DepthProvider):
        # Depth wants the reference image too: tee hands it on, so that it is read once.
        references, for_depth = itertools.tee(references)
        depths = map(depths, itertools.count(), for_depth)
    parts = {"references": references, "sources": sources, "depths": depths}
    if given is not None:
        parts["given"] = given
    for count, frame in enumerate(itertools.zip_longest(*parts.values(), fillvalue=_MISSING)):
        for name, image in zip(parts, frame, strict=True):
            if image is _MISSING:
                raise ValueError(
                    f"{name}: {count} frames, fewer than of the others; expected as many of each"
                )
        evaluator.add(*frame)
    return evaluator.result(judge)
