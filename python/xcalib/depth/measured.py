"""The options of measured depth: where it comes from, and what is done to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .._core import DepthUnits
from ..frames import InputError
from .completion import MIN_CONFIDENCE, CompletedDepth
from .conditioning import SteadyDepth
from .lidar import LidarDepth
from .provider import DepthProvider
from .stereo import StereoDepth, StereoGeometry, read_stereo_geometry

STEREO = "stereo:"
DISPARITY = "disparity:"


@dataclass(frozen=True)
class MeasuredDepth:
    """The options of measured depth, named as the commands name them."""

    lidar_calibration: Path | None = None
    """File for all scans, or a folder of KITTI's files; the depth folder then holds scans."""
    stereo_calibration: Path | None = None
    """YAML file with baseline, focal and doffs, in place of the three numbers."""
    stereo_baseline: float | None = None
    """[m]"""
    stereo_focal: float | None = None
    """[px]"""
    stereo_doffs: float | None = None
    """[px]"""
    complete: bool = False
    completion_confidence: float = MIN_CONFIDENCE
    """Filled pixels below it stay unknown, [0, 1]."""
    depth_steady: bool = False

    def open(self, spec: str, reference_paths: Sequence[Path]) -> DepthProvider | None:
        """The provider of a lidar or stereo ``--depth``; None where it is neither."""
        numbers = (self.stereo_baseline, self.stereo_focal, self.stereo_doffs)
        stereo = self.stereo_calibration is not None or any(n is not None for n in numbers)
        if spec.startswith(STEREO):
            if self.lidar_calibration is not None:
                raise InputError(f"--lidar-calibration goes with scans, not with --depth {spec}")
            return StereoDepth(spec.removeprefix(STEREO), reference_paths, self._geometry())
        if stereo and not spec.startswith(DISPARITY):
            raise InputError(
                f"depth {spec}: stereo options go with --depth {STEREO}FOLDER or {DISPARITY}FOLDER"
            )
        if self.lidar_calibration is None:
            return None
        if spec == "plane" or not Path(spec).is_dir():
            raise InputError(
                f"--lidar-calibration: --depth {spec} is no folder, expected one with scans"
            )
        return LidarDepth(spec, reference_paths, self.lidar_calibration)

    def maps(self, spec: str, units: DepthUnits) -> tuple[str, DepthUnits]:
        """The folder of a ``--depth`` that names depth maps or disparities, and their units."""
        if not spec.startswith(DISPARITY):
            return spec, units
        g = self._geometry(DISPARITY)
        return spec.removeprefix(DISPARITY), DepthUnits(
            scale=units.scale,
            invalid=units.invalid,
            baseline=g.baseline,
            focal=g.focal,
            doffs=g.doffs,
        )

    def _geometry(self, prefix: str = STEREO) -> StereoGeometry:
        if self.stereo_calibration is not None:
            if (self.stereo_baseline, self.stereo_focal, self.stereo_doffs) != (None, None, None):
                raise InputError(
                    f"--stereo-calibration {self.stereo_calibration}: expected no other stereo"
                    " options with it"
                )
            return read_stereo_geometry(self.stereo_calibration)
        if self.stereo_baseline is None or self.stereo_focal is None:
            raise InputError(
                f"--depth {prefix} expected --stereo-baseline and --stereo-focal,"
                " or --stereo-calibration"
            )
        return StereoGeometry(self.stereo_baseline, self.stereo_focal, self.stereo_doffs or 0.0)

    def conditioned(self, provider: DepthProvider) -> DepthProvider:
        """The provider with what was asked for: steadied, then completed."""
        if self.depth_steady:
            provider = SteadyDepth(provider)
        if self.complete:
            provider = CompletedDepth(provider, self.completion_confidence)
        return provider
