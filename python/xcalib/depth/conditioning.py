"""Depth averaged over the frames of a video, where asked for."""

from __future__ import annotations

from dataclasses import dataclass, field

from .._core import DepthSteadier
from ..frames import Image
from .provider import Depth, WrappedDepth


@dataclass(frozen=True)
class SteadyDepth(WrappedDepth):
    """Depth of another provider, averaged over time along the image flow, see `DepthSteadier`.

    Call it with consecutive frames. Any other frame restarts the average and passes unchanged.
    """

    is_parallel = False
    is_steady = True
    _steadier: DepthSteadier = field(default_factory=DepthSteadier, init=False)

    def __call__(self, index: int, reference: Image) -> Depth:
        """Depth ``(h, w)`` float32 [m]; unknown pixels stay unknown."""
        return self._steadier(index, self.provider(index, reference), reference)
