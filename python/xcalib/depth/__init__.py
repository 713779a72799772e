"""Depth of the reference frames: from files, or from a prior on the road.

A provider is called with the index of a frame and its reference image and returns the depth map
``(h, w)`` float32 in metres along the optical axis, 0 where unknown. Its size is free, its aspect
is that of the reference image.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..frames import InputError
from .files import DEPTH_SUFFIXES, PNG_SCALE, FolderDepth, read_depth
from .measured import MeasuredDepth
from .plane import PlaneDepth
from .provider import Depth, DepthProvider

__all__ = [
    "DEPTH_SUFFIXES",
    "PNG_SCALE",
    "Depth",
    "DepthProvider",
    "FolderDepth",
    "MeasuredDepth",
    "PlaneDepth",
    "open_depth",
    "read_depth",
]


def open_depth(
    spec: str | Path,
    reference_paths: Sequence[Path],
    scale: float = PNG_SCALE,
    plane: PlaneDepth | None = None,
    measured: MeasuredDepth | None = None,
) -> DepthProvider:
    """The depth provider that a ``--depth`` argument names.

    Parameters
    ----------
    spec
        A folder of depth maps, or the word ``plane`` (a folder of that name: ``./plane``); a
        folder of lidar scans or ``stereo:FOLDER`` with the options of ``measured`` for them.
    reference_paths
        Files of the reference images, in the order of the frames.
    scale
        Metres per count of 16-bit PNG depth.
    plane
        The prior used for ``plane``.
    measured
        Lidar, stereo, completion and conditioning.
    """
    measured = measured or MeasuredDepth()
    provider = measured.open(str(spec), reference_paths)
    return measured.conditioned(provider or _open_given(spec, reference_paths, scale, plane))


def _open_given(
    spec: str | Path, reference_paths: Sequence[Path], scale: float, plane: PlaneDepth | None
) -> DepthProvider:
    if str(spec) == "plane":
        return plane or PlaneDepth()
    if not Path(spec).is_dir():
        raise InputError(f"depth {spec}: expected an existing folder of depth maps, or `plane`")
    return FolderDepth(spec, reference_paths, scale)
