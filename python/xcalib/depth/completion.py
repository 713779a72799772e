"""From sparse or semi-dense depth to dense, along the edges of the reference image.

Unknown pixels take the steady state of a diffusion of inverse depth, in which a plane is linear,
from the known ones. It is reached coarse to fine: each level of a pyramid starts from the coarser
one and needs a few relaxations only. Image edges conduct less, so depth rather changes there.
`bench/depth_completion.py` compares this with others; docs/inputs_measured.md has the figures.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from ..frames import Image, InputError, gray, same_aspect, size_of
from .provider import Depth, DepthProvider, is_parallel, reciprocal

Array = NDArray[Any]
"""float32."""

MIN_CONFIDENCE = 0.3
EDGE = 0.1
"""Step of the compressed gray image that halves the conductance."""
SWEEPS = 4
"""Relaxations per level; twice as many change the errors by less than their scatter."""
REACH = 0.02
"""Distance to known depth at which confidence is down to 1/e [of the image width]."""
SPREAD = 0.1
"""Relative spread of inverse depth around a pixel that halves its confidence."""


@dataclass(frozen=True)
class CompletedDepth:
    """Depth of another provider, completed; pixels of low confidence stay unknown."""

    provider: DepthProvider
    min_confidence: float = MIN_CONFIDENCE
    """Smallest confidence of a filled pixel, [0, 1]; 0 fills everything."""

    def __post_init__(self) -> None:
        if not 0 <= self.min_confidence <= 1:
            raise InputError(
                f"completion confidence is {self.min_confidence:g}, expected between 0 and 1"
            )

    @property
    def parallel(self) -> bool:
        """See `depth.is_parallel`."""
        return is_parallel(self.provider)

    def __call__(self, index: int, reference: Image) -> Depth:
        dense, confidence = complete(self.provider(index, reference), reference)
        dense[confidence < self.min_confidence] = 0
        return dense


def complete(depth: Depth, guide: Image) -> tuple[Depth, Array]:
    """Fill the unknown pixels of a depth map; known ones are kept as they are.

    Parameters
    ----------
    depth
        ``(h, w)`` float32 [m], 0 where unknown, some pixel known.
    guide
        Reference image ``(H, W)`` or ``(H, W, 3)`` of the same aspect.

    Returns
    -------
    dense
        ``(h, w)`` float32 [m], > 0 everywhere.
    confidence
        ``(h, w)`` float32 in [0, 1]: 1 where depth was known, and lower the farther a pixel is
        from known depth and the more depth varies around it. An order, not a probability.
    """
    known = depth > 0
    if not known.any():
        raise InputError("depth to complete is unknown everywhere, expected some pixels above 0 m")
    if not same_aspect(size_of(depth), size_of(guide)):
        raise InputError(
            f"depth is {depth.shape[1]}x{depth.shape[0]}, its guide"
            f" {guide.shape[1]}x{guide.shape[0]}; expected the same aspect"
        )
    filled = _diffused(reciprocal(depth), known, compressed(guide, size_of(depth)))
    dense = np.where(known, depth, 1 / filled).astype(np.float32, copy=False)
    return dense, _confidence(filled, known)


def compressed(guide: Image, size: tuple[int, int]) -> Array:
    """The guide as gray at ``size``, with the contrast of dark parts raised, in [0, 1]."""
    small = cv2.resize(gray(guide), size, interpolation=cv2.INTER_AREA)
    bright: Array = np.log1p(20 * small.clip(0, 1)) / np.log(np.float32(21))
    return bright.astype(np.float32, copy=False)


def conductance(guide: Array) -> tuple[Array, Array]:
    """Weights in (0, 1] of each pixel's bond to its right ``(h, w-1)`` and lower ``(h-1, w)``."""
    right, down = np.diff(guide, axis=1), np.diff(guide, axis=0)
    return 1 / (1 + (right / EDGE) ** 2), 1 / (1 + (down / EDGE) ** 2)


def _diffused(value: Array, known: NDArray[np.bool_], guide: Array) -> Array:
    """The diffusion on this level, started from the one of half the size."""
    if min(value.shape) <= 4:
        start = np.full_like(value, value[known].mean())
    else:
        half = (value.shape[1] + 1) // 2, (value.shape[0] + 1) // 2
        mass = cv2.resize(known.astype(np.float32), half, interpolation=cv2.INTER_AREA)
        mean = cv2.resize(value, half, interpolation=cv2.INTER_AREA)  # unknown pixels are 0
        # Area means leave some 1e-9 of a neighbour's weight: too little is none.
        some = mass > 1e-3
        np.divide(mean, mass, out=mean, where=some)
        coarse = _diffused(
            np.where(some, mean, np.float32(0)),
            some,
            cv2.resize(guide, half, interpolation=cv2.INTER_AREA),
        )
        start = cv2.resize(coarse, size_of(value), interpolation=cv2.INTER_LINEAR)
    return _relaxed(start, value, known, guide)


def _relaxed(start: Array, value: Array, known: NDArray[np.bool_], guide: Array) -> Array:
    """Unknown pixels become the mean of their neighbours, by conductance, a few times."""
    right, down = conductance(guide)
    total = np.zeros_like(value)
    total[:, :-1] += right
    total[:, 1:] += right
    total[:-1] += down
    total[1:] += down
    old, new = start, np.empty_like(start)
    np.copyto(old, value, where=known)
    for _ in range(SWEEPS):
        new.fill(0)
        new[:, :-1] += right * old[:, 1:]
        new[:, 1:] += right * old[:, :-1]
        new[:-1] += down * old[1:]
        new[1:] += down * old[:-1]
        new /= total
        np.copyto(new, value, where=known)
        old, new = new, old
    return old


def _confidence(filled: Array, known: NDArray[np.bool_]) -> Array:
    width = known.shape[1]
    distance = cv2.distanceTransform((~known).astype(np.uint8), cv2.DIST_L2, 5)
    side = 2 * round(0.012 * width) + 1
    mean = cv2.blur(filled, (side, side))
    variance = cv2.blur(filled**2, (side, side)) - mean**2
    spread = variance.clip(0) / mean**2  # squared and relative
    confidence = np.exp(-distance / (REACH * width)) / (1 + spread / SPREAD**2)
    return np.where(known, np.float32(1), confidence).astype(np.float32, copy=False)
