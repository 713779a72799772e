"""Depth of the reference frames: from files, from a network, or from a prior on the road.

A `DepthProvider` is called with the index of a frame and its reference image and returns the depth
map ``(h, w)`` float32 in metres along the optical axis, 0 where unknown. Its size is free, its
aspect is that of the reference image.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .._core import DepthUnits
from ..frames import InputError
from .constant import ConstantDepth, distance_of
from .files import DEPTH_SUFFIXES, PNG_SCALE, FolderDepth, read_depth
from .measured import MeasuredDepth
from .network import NetworkDepth, NetworkOptions
from .plane import PlaneDepth
from .provider import Depth, DepthProvider, WrappedDepth

__all__ = [
    "DEPTH_SUFFIXES",
    "PNG_SCALE",
    "ConstantDepth",
    "Depth",
    "DepthProvider",
    "DepthUnits",
    "FolderDepth",
    "MeasuredDepth",
    "NetworkDepth",
    "NetworkOptions",
    "PlaneDepth",
    "WrappedDepth",
    "open_depth",
    "read_depth",
]


def open_depth(
    spec: str | Path,
    reference_paths: Sequence[Path],
    units: DepthUnits | None = None,
    plane: PlaneDepth | None = None,
    network: NetworkOptions | None = None,
    measured: MeasuredDepth | None = None,
) -> DepthProvider:
    """The depth provider that a ``--depth`` argument names.

    Parameters
    ----------
    spec
        A folder of depth maps, the .onnx file of a network, the word ``plane`` (a folder of that
        name: ``./plane``), or a distance in metres; a folder of lidar scans, ``stereo:FOLDER`` or
        ``disparity:FOLDER`` with the options of ``measured`` for them.
    reference_paths
        Files of the reference images, in the order of the frames.
    units
        What the numbers of depth maps mean.
    plane
        The prior used for ``plane``.
    network
        How to run a network.
    measured
        Lidar, stereo, completion and conditioning.
    """
    measured = measured or MeasuredDepth()
    provider = measured.open(str(spec), reference_paths)
    if provider is None:
        folder, units = measured.maps(str(spec), units or DepthUnits())
        provider = _open_given(folder, reference_paths, units, plane, network)
    return measured.conditioned(provider)


def _open_given(
    spec: str | Path,
    reference_paths: Sequence[Path],
    units: DepthUnits,
    plane: PlaneDepth | None,
    network: NetworkOptions | None,
) -> DepthProvider:
    if str(spec) == "plane":
        return plane or PlaneDepth()
    if Path(spec).suffix.lower() == ".onnx" and not Path(spec).is_dir():
        return NetworkDepth(spec, network)
    if (metres := distance_of(spec)) is not None:
        return ConstantDepth(metres)
    if not Path(spec).is_dir():
        raise InputError(
            f"depth {spec}: expected an existing folder of depth maps, an .onnx file, `plane`, or a"
            " distance in metres"
        )
    return FolderDepth(spec, reference_paths, units)
