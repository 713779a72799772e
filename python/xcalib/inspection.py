"""The facts of a rig, in units one can picture."""

from __future__ import annotations

from typing import Any

from ._core import Rig, facts_text
from ._core import describe as describe_rig

__all__ = ["describe", "facts_text"]


def describe(rig: Rig) -> dict[str, Any]:
    """The rig's parameters and what follows from them, in px, deg and m.

    ``rotation_deg`` turns the source camera out of the reference camera's axes: pan to the right,
    then tilt up, then roll clockwise. Parallax is the distance from the point at infinity.
    """
    cameras = {
        name: {
            **{key: getattr(camera, key) for key in ("width", "height", "fx", "fy", "cx", "cy")},
            "skew": camera.skew,
            "hfov_deg": camera.hfov_deg,
            "vfov_deg": camera.vfov_deg,
        }
        for name, camera in (("reference", rig.reference), ("source", rig.source))
    }
    facts = describe_rig(rig)
    return {
        **cameras,
        "rotation_deg": facts["rotation_deg"],
        "quaternion_wxyz": [float(value) for value in rig.quaternion_wxyz],
        "translation_m": rig.t.tolist(),
        "position_m": facts["position_m"],
        "baseline_m": facts["baseline_m"],
        "centre": facts["centre"],
    }
