"""What a notebook shows of a rig: where the source camera looks, on the reference's image."""

from __future__ import annotations

from html import escape

import numpy as np
from numpy.typing import NDArray

from ._core import Rig
from .reprojection import targets

WIDTH = 320
"""Of the picture [px]."""
DEPTHS = ((np.inf, "#1f77b4"), (10.0, "#2ca02c"), (2.0, "#d62728"))
"""Depths [m] whose outlines are drawn, and their colours."""
FAR = 1e6
"""In place of an infinite depth [m]."""


def rig_html(rig: Rig) -> str:
    """The rig's parameters, and a drawing: the reference's image on that of the source."""
    camera = rig.source
    height = WIDTH * camera.height / camera.width
    scale = WIDTH / camera.width
    shapes = [f'<rect width="{WIDTH}" height="{height:.1f}" fill="#eee" stroke="#888"/>']
    labels = []
    for depth, colour in DEPTHS:
        points = outline(rig, min(depth, FAR)) * scale
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points if np.isfinite((x, y)).all())
        shapes.append(
            f'<polygon points="{path}" fill="none" stroke="{colour}" stroke-width="1.5"/>'
        )
        name = f"{depth:g} m" if np.isfinite(depth) else "far away"
        labels.append(f'<span style="color:{colour}">{name}</span>')
    return (
        f"<div><pre>{escape(repr(rig))}</pre>"
        f'<svg width="{WIDTH}" height="{height:.0f}" viewBox="{-0.25 * WIDTH} {-0.25 * height}'
        f' {1.5 * WIDTH} {1.5 * height}">{"".join(shapes)}</svg>'
        f"<br>the reference's image on the source's (gray): {', '.join(labels)}</div>"
    )


def outline(rig: Rig, depth: float, steps: int = 16) -> NDArray[np.float64]:
    """Where the source sees the border of the reference's image at a depth: (N, 2) [px]."""
    camera = rig.reference
    grid = np.zeros((camera.height, camera.width), np.float32)
    grid[[0, -1]] = grid[:, [0, -1]] = depth
    places = targets(rig, grid)[..., :2]
    rows = np.linspace(0, camera.height - 1, steps).astype(int)
    columns = np.linspace(0, camera.width - 1, steps).astype(int)
    sides = (
        places[0, columns],
        places[rows, -1],
        places[-1, columns[::-1]],
        places[rows[::-1], 0],
    )
    return np.concatenate(sides)
