"""What a rig says, in units one can picture."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._core import Rig


def describe(rig: Rig) -> dict[str, Any]:
    """The rig's parameters and what follows from them, in px, deg and m.

    ``rotation_deg`` turns the source camera out of the reference camera's axes: pan to the right,
    then tilt up, then roll clockwise. Parallax is the distance from the point at infinity.
    """
    rotation, t = np.asarray(rig.R), np.asarray(rig.t)
    axes = rotation.T  # columns: the source camera's axes in the reference camera
    cameras = {
        name: {
            **{key: getattr(camera, key) for key in ("width", "height", "fx", "fy", "cx", "cy")},
            "skew": camera.skew,
            "hfov_deg": camera.hfov_deg,
            "vfov_deg": camera.vfov_deg,
        }
        for name, camera in (("reference", rig.reference), ("source", rig.source))
    }
    centre = np.array([(rig.reference.width - 1) / 2, (rig.reference.height - 1) / 2, 1.0])
    ray = np.linalg.solve(rig.reference.K, centre)

    def point(inverse_depth: float) -> NDArray[np.float64]:
        x = rig.source.K @ (rotation @ ray + inverse_depth * t)
        # A point behind the source camera has no image.
        return x[:2] / x[2] if x[2] > 0 else np.full(2, np.nan)

    return {
        **cameras,
        "rotation_deg": {
            "pan": math.degrees(math.atan2(axes[0, 2], axes[2, 2])),
            "tilt": math.degrees(math.asin(np.clip(0 - axes[1, 2], -1, 1))),
            "roll": math.degrees(math.atan2(axes[1, 0], axes[1, 1])),
        },
        "quaternion_wxyz": [float(value) for value in rig.quaternion_wxyz],
        "translation_m": t.tolist(),
        "position_m": (-axes @ t).tolist(),
        "baseline_m": float(np.linalg.norm(t)),
        "centre": [
            {
                "depth_m": depth,
                "point_px": point(1 / depth if depth else 0.0).tolist(),
                "parallax_px": float(
                    np.linalg.norm(point(1 / depth if depth else 0.0) - point(0.0))
                ),
            }
            for depth in (2.0, 5.0, 10.0, 50.0, None)
        ],
    }


def as_lines(facts: dict[str, Any]) -> Iterator[str]:
    """What `describe` found, as text."""
    for name in ("reference", "source"):
        camera = facts[name]
        yield (
            f"{name:<10} {camera['width']}x{camera['height']} px,"
            f" fx {camera['fx']:.2f} fy {camera['fy']:.2f} px,"
            f" HFoV {camera['hfov_deg']:.2f} VFoV {camera['vfov_deg']:.2f} deg,"
            f" cx {camera['cx']:.2f} cy {camera['cy']:.2f} px, skew {camera['skew']:.3f} px"
        )
    turn = facts["rotation_deg"]
    yield (
        f"rotation   pan {turn['pan']:+.3f} (right), tilt {turn['tilt']:+.3f} (up),"
        f" roll {turn['roll']:+.3f} (clockwise) deg"
    )
    yield f"t          {vector(facts['translation_m'])} m (source_from_reference)"
    yield f"position   {vector(facts['position_m'])} m of the source: right, down, forward"
    yield f"baseline   {facts['baseline_m']:.4f} m"
    yield "the reference image's centre in the source image:"
    for row in facts["centre"]:
        distance = "infinity" if row["depth_m"] is None else f"{row['depth_m']:g} m"
        x, y = row["point_px"]
        parallax = row["parallax_px"]
        yield f"  {distance:>8}: ({x:8.2f}, {y:8.2f}) px, parallax {parallax:6.2f} px"


def vector(values: Iterable[float]) -> str:
    """Numbers as text."""
    return " ".join(f"{value:+.4f}" for value in values)
