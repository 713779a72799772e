"""A flat road for depth, where nothing was measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from .. import _core
from .._core import CalibrationOptions, Rig
from ..frames import Image
from .provider import DepthProvider


class PlaneDepth(_core.PlaneDepth, DepthProvider):
    """A flat road under the camera, all else far away: see the core's class."""

    is_parallel = True
    looks_at_reference = False

    @property
    def _numbers(self) -> tuple[float, float, float, float | None, float]:
        return self.camera_height, self.horizon, self.far, self.hfov_deg, self.roll_deg

    def __reduce__(self) -> tuple[Any, ...]:
        return PlaneDepth, self._numbers

    def __repr__(self) -> str:
        return f"PlaneDepth{self._numbers}"

    def fitted(
        self,
        references: Sequence[Image],
        sources: Sequence[Image],
        rig: Rig,
        options: CalibrationOptions,
        progress: Callable[[], object] | None = None,
    ) -> PlaneDepth:
        """The plane with the horizon and the roll that suit these frames best, see `fit_plane`."""
        found = _core.fit_plane(references, sources, self, rig, options, progress)
        return PlaneDepth(
            found.camera_height, found.horizon, found.far, found.hfov_deg, found.roll_deg
        )
