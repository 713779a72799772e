"""What a source of depth is."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..frames import Image

Depth = NDArray[np.float32]


def reciprocal(values: Depth) -> Depth:
    """Inverse depth of depth, and back: 0 where it is not above 0."""
    return np.divide(1, values, out=np.zeros(values.shape, np.float32), where=values > 0)


class DepthProvider(Protocol):
    """Depth of frame ``index``, whose reference image is given: ``(h, w)`` float32 [m]."""

    def __call__(self, index: int, reference: Image) -> Depth: ...


def is_parallel(provider: object) -> bool:
    """Whether several threads may ask a provider at a time: those with a true ``parallel``."""
    return bool(getattr(provider, "parallel", False))


def files_of(provider: object, index: int) -> list[Path]:
    """Files that the depth of a frame is made from, as far as the provider tells.

    A provider tells by ``files(index)``, by ``paths``, one for each frame, by a ``path``, or by
    those of the ``provider`` that it goes on from.
    """
    if hasattr(provider, "files"):
        return list(provider.files(index))
    if hasattr(provider, "provider"):
        return files_of(provider.provider, index)
    if hasattr(provider, "paths"):
        return [provider.paths[index]]
    return [provider.path] if hasattr(provider, "path") else []
