"""What the commands' arguments on footage and its depth say."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path

from . import remote
from .depth import DepthUnits, MeasuredDepth, NetworkOptions, PlaneDepth
from .footage import Matching


@dataclass(frozen=True)
class Inputs:
    """Footage of two cameras and the depth of the reference camera's, named but not opened."""

    reference: str | Path
    source: str | Path
    """Folders or patterns of images, videos, bags; see `footage.open_stream`. Or a URL."""
    depth: str | Path
    """A ``--depth`` argument, see `depth.open_depth`."""
    units: DepthUnits = field(default_factory=DepthUnits)
    """What the numbers of depth maps mean."""
    matching: Matching = field(default_factory=Matching)
    """Which frames of the two belong together."""
    plane: PlaneDepth = field(default_factory=PlaneDepth)
    """The road, where depth is ``plane``."""
    network: NetworkOptions = field(default_factory=NetworkOptions)
    """How to run it, where depth is a network."""
    measured: MeasuredDepth = field(default_factory=MeasuredDepth)
    """Lidar and stereo; completion and averaging over time of any depth."""
    readout: tuple[float, float] = (0.0, 0.0)
    """Of the source and the reference, in shares of the time from frame to frame."""


def with_local_names(inputs: Inputs) -> Inputs:
    """The inputs with names on this machine in place of URLs."""
    return replace(
        inputs,
        reference=remote.local_name(inputs.reference),
        source=remote.local_name(inputs.source),
        depth=remote.local_name(inputs.depth),
    )
