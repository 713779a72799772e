"""What a source of depth is."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..frames import Image

if TYPE_CHECKING:
    from .network import NetworkDepth

Depth = NDArray[np.float32]


def reciprocal(values: Depth) -> Depth:
    """Inverse depth of depth, and back: 0 where it is not above 0."""
    return np.divide(1, values, out=np.zeros(values.shape, np.float32), where=values > 0)


class DepthProvider:
    """Depth of reference images: what sources of depth derive from.

    By default one thread at a time may ask, frames do not depend on each other, depth is in metres
    and no files are known. A source overrides what differs.
    """

    def __call__(self, index: int, reference: Image) -> Depth:
        """Depth of frame ``index``, whose reference image is given: ``(h, w)`` float32 [m]."""
        raise NotImplementedError

    @property
    def is_parallel(self) -> bool:
        """Whether several threads may ask at a time."""
        return False

    @property
    def is_steady(self) -> bool:
        """Whether the depth of a frame depends on the frames before it."""
        return False

    @property
    def looks_at_reference(self) -> bool:
        """Whether depth depends on the reference's pixels; where not, they may be 0."""
        return True

    @property
    def relative(self) -> NetworkDepth | None:
        """The network whose scale and shift have to be estimated; None where depth is in metres."""
        return None

    def files_of(self, index: int) -> list[Path]:
        """Files that the depth of a frame is made from, as far as they are known."""
        return []

    def line(self) -> str:
        """For the user: what its numbers are taken for, in a line, or ''."""
        return ""


@dataclass(frozen=True)
class WrappedDepth(DepthProvider):
    """Depth made from that of another provider, whose properties it has unless overridden."""

    provider: DepthProvider

    @property
    def is_parallel(self) -> bool:
        return self.provider.is_parallel

    @property
    def is_steady(self) -> bool:
        return self.provider.is_steady

    @property
    def relative(self) -> NetworkDepth | None:
        return self.provider.relative

    def files_of(self, index: int) -> list[Path]:
        return self.provider.files_of(index)

    def line(self) -> str:
        return self.provider.line()
