"""The charts of a page, as numbers that its template draws in SVG."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._core import Pinhole, Rig


@dataclass(frozen=True)
class Line:
    """A polyline, in the chart's own units from 0 to 1, y up."""

    label: str
    points: list[tuple[float, float]]


@dataclass(frozen=True)
class Chart:
    """Lines over common axes."""

    lines: list[Line]
    x_label: str
    y_label: str
    x_ticks: list[tuple[float, str]]
    y_ticks: list[tuple[float, str]]


def chart(
    lines: Sequence[tuple[str, Sequence[float], Sequence[float]]], x_label: str, y_label: str
) -> Chart:
    """Lines of (label, xs, ys); what is not finite is left out. 0 is always in the picture."""
    found = [
        (label, [(x, y) for x, y in zip(xs, ys, strict=True) if math.isfinite(x + y)])
        for label, xs, ys in lines
    ]
    every = [point for _, points in found for point in points]
    left, right = limits([x for x, _ in every])
    low, high = limits([y for _, y in every])

    def inside(x: float, y: float) -> tuple[float, float]:
        return (x - left) / (right - left), (y - low) / (high - low)

    return Chart(
        [Line(label, [inside(*point) for point in points]) for label, points in found],
        x_label,
        y_label,
        [(inside(x, low)[0], f"{x:g}") for x in ticks(left, right)],
        [(inside(left, y)[1], f"{y:g}") for y in ticks(low, high)],
    )


def limits(values: Sequence[float]) -> tuple[float, float]:
    """What a chart spans."""
    low, high = min([0.0, *values]), max([0.0, *values])
    return (low, high) if high > low else (low, low + 1)


def ticks(low: float, high: float) -> list[float]:
    """Round numbers, four to nine of them."""
    step = 10.0 ** math.floor(math.log10((high - low) / 4))
    factors = [f for f in (5.0, 2.0) if (high - low) / (f * step) >= 3.5]
    step *= factors[0] if factors else 1.0
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [float(f"{i * step:.12g}") for i in range(first, last + 1)]


def lens_lines(rig: Rig) -> list[tuple[str, list[float], list[float]]]:
    """By how much each lens moves a point, over its distance from the axis [px]."""
    return [
        (name, *lens_line(camera))
        for name, camera in (("reference", rig.reference), ("source", rig.source))
        if camera.lens.bends
    ]


def lens_line(camera: Pinhole) -> tuple[list[float], list[float]]:
    """Along the row through the principal point, to the farther corner's distance."""
    corners = [
        math.hypot(x - camera.cx, y - camera.cy)
        for x in (0, camera.width - 1)
        for y in (0, camera.height - 1)
    ]
    shown = np.linspace(0, max(corners), 41)
    points = camera.lens.undistort(np.column_stack([shown / camera.fx, 0 * shown]))
    plain = np.hypot(points[:, 0], points[:, 1]) * camera.fx
    return shown.tolist(), (shown - plain).tolist()


Segments = list[tuple[tuple[float, float, float], tuple[float, float, float], str]]


def rig_segments(rig: Rig) -> Segments:
    """The two cameras in the axes of the reference: lines (from, to, which), scaled so that the
    baseline, or the reference's frustum where it is longer, is of length 1.
    """
    R, t = np.asarray(rig.R, np.float64), np.asarray(rig.t, np.float64)
    length = max(float(np.linalg.norm(t)), 0.05)
    lines: Segments = []
    for name, camera, turn, place in (
        ("reference", rig.reference, np.eye(3), np.zeros(3)),
        ("source", rig.source, R.T, -R.T @ t),
    ):
        field = np.array([camera.width / camera.fx, camera.height / camera.fy]) / 2
        corners = [np.array([sx * field[0], sy * field[1], 1.0]) * 0.6 for sx, sy in CORNERS]
        ends = [turn @ corner + place / length for corner in corners]
        eye = place / length
        for i, end in enumerate(ends):
            lines.append((point(eye), point(end), name))
            lines.append((point(end), point(ends[(i + 1) % 4]), name))
        up = turn @ np.array([0.0, -field[1] * 0.75, 0.6]) + eye
        lines.append((point(ends[0]), point(up), name))
        lines.append((point(up), point(ends[1]), name))
    lines.append((point(np.zeros(3)), point(-R.T @ t / length), "baseline"))
    return lines


CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))


def point(values: Any) -> tuple[float, float, float]:
    """Rounded to what a picture shows."""
    x, y, z = (round(float(value), 4) for value in values)
    return x, y, z
