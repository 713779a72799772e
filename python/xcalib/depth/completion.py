"""From sparse or semi-dense depth to dense, along the edges of the reference image.

`bench/accuracy/depth_completion.py` compares `complete` with others; docs/inputs_measured.md has
the figures.
"""

from __future__ import annotations

from dataclasses import dataclass

from .._core import complete_depth as complete
from .._core import completed, completion_confidence
from ..frames import Image, InputError
from .provider import Depth, WrappedDepth

__all__ = ["MIN_CONFIDENCE", "CompletedDepth", "complete"]

MIN_CONFIDENCE = completion_confidence()


@dataclass(frozen=True)
class CompletedDepth(WrappedDepth):
    """Depth of another provider, completed; pixels of low confidence stay unknown."""

    min_confidence: float = MIN_CONFIDENCE
    """Smallest confidence of a filled pixel, [0, 1]; 0 fills everything."""

    def __post_init__(self) -> None:
        if not 0 <= self.min_confidence <= 1:
            raise InputError(
                f"completion confidence is {self.min_confidence:g}, expected between 0 and 1"
            )

    def __call__(self, index: int, reference: Image) -> Depth:
        return completed(self.provider(index, reference), reference, self.min_confidence)
