"""Thermal-visible camera rigs: calibrated without a target, registered through depth.

>>> result = xcalib.calibrate(references, sources, depths)
>>> registrar = xcalib.Registrar(result.rig)
>>> image, mask = registrar.register(source, depth)
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from xcalib import convert, labels, metrics
    from xcalib._core import (
        AdamOptions,
        CalibrationOptions,
        CalibrationReport,
        CalibrationResult,
        CandidateReport,
        ExpectedError,
        FrameTransfer,
        LagFit,
        LagReport,
        Lens,
        LensReport,
        LevelReport,
        Pinhole,
        Registrar,
        RelativeDepth,
        Rig,
        SearchOptions,
        Tolerance,
        Verdict,
        calibrate,
        fit_lags,
    )
    from xcalib.choose import choose_frames
    from xcalib.evaluation import evaluate

    __version__: str
else:
    IN_PYTHON = {"choose_frames": "choose", "evaluate": "evaluation"}

    def __getattr__(name: str) -> Any:
        """Import what a name stands for when it is first used: `xcalib --version` needs nothing."""
        if name == "__version__":
            value = import_module("importlib.metadata").version("xcalib-rgbt")
        elif name in ("convert", "labels", "metrics"):
            value = import_module(f"xcalib.{name}")
        elif name in IN_PYTHON:
            value = getattr(import_module(f"xcalib.{IN_PYTHON[name]}"), name)
        elif name in __all__:
            value = getattr(import_module("xcalib._core"), name)
        else:
            raise AttributeError(
                f"module 'xcalib' has no attribute {name!r}", name=name, obj=sys.modules[__name__]
            )
        globals()[name] = value
        return value

    def __dir__() -> list[str]:
        return sorted({*globals(), *__all__, "__version__"})


__all__ = [
    "AdamOptions",
    "CalibrationOptions",
    "CalibrationReport",
    "CalibrationResult",
    "CandidateReport",
    "ExpectedError",
    "FrameTransfer",
    "LagFit",
    "LagReport",
    "Lens",
    "LensReport",
    "LevelReport",
    "Pinhole",
    "Registrar",
    "RelativeDepth",
    "Rig",
    "SearchOptions",
    "Tolerance",
    "Verdict",
    "calibrate",
    "choose_frames",
    "convert",
    "evaluate",
    "fit_lags",
    "labels",
    "metrics",
]
