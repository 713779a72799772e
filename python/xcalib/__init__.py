"""Thermal-visible camera rigs: calibrated without a target, registered through depth.

>>> result = xcalib.calibrate(references, sources, depths)
>>> registrar = xcalib.Registrar(result.rig)
>>> image, mask = registrar.register(source, depth)
"""

from importlib.metadata import version as _version

from xcalib import metrics
from xcalib._core import (
    AdamOptions,
    CalibrationOptions,
    CalibrationReport,
    CalibrationResult,
    CandidateReport,
    LevelReport,
    Pinhole,
    Registrar,
    RelativeDepth,
    Rig,
    SearchOptions,
    calibrate,
)
from xcalib.choose import choose_frames

__version__ = _version("xcalib-rgbt")

__all__ = [
    "AdamOptions",
    "CalibrationOptions",
    "CalibrationReport",
    "CalibrationResult",
    "CandidateReport",
    "LevelReport",
    "Pinhole",
    "Registrar",
    "RelativeDepth",
    "Rig",
    "SearchOptions",
    "calibrate",
    "choose_frames",
    "metrics",
]
