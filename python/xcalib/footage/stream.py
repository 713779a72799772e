"""What footage is, wherever it comes from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._core import Half, Picked, Stream

__all__ = ["HALVES", "Half", "Picked", "Stream", "Times"]

HALVES = ("left", "right", "top", "bottom")
"""Those that `Half` takes."""

Times = NDArray[np.float64]
"""Seconds of each frame, (N,), on the clock of its stream."""
