"""YOLO's label files: a .txt an image, a line a label, in shares of the image.

`class cx cy w h` is a box, `class x y x y x y ...` a polygon. Shares count from the outer edge of
the first pixel, whose centre is at 0.5 px.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from .._core import InputError, read_text
from ..frames import list_files
from .frames import LabelledFrames
from .shapes import Moved, Shapes

HALF = 0.5


def transfer_yolo(folder: Path, labelled: LabelledFrames) -> dict[str, str]:
    """The label files of the other images, by name: those of a folder, carried over."""
    files = {}
    for path in list_files(folder, (".txt",)):
        if path.name == "classes.txt":
            files[path.name] = read_text(path)
            continue
        index, name = labelled.partner(path.name, str(path))
        shapes = labelled.shapes(index)
        lines = []
        for row, line in enumerate(read_text(path).splitlines(), 1):
            if not line.strip():
                continue
            moved, word = of_line(line, shapes, f"{path}:{row}")
            labelled.count(moved.notes)
            if moved.points is not None:
                lines.append(word)
        files[f"{Path(name).stem}.txt"] = "".join(f"{line}\n" for line in lines)
    return files


def of_line(line: str, shapes: Shapes, where: str) -> tuple[Moved, str]:
    """A label in the other image, and its line there."""
    kind, *words = line.split()
    try:
        values = [float(word) for word in words]
    except ValueError:
        values = []
    is_box, size = len(values) == 4, np.array(shapes.size, np.float64)
    if not (kind.isdecimal() and (is_box or (len(values) >= 6 and len(values) % 2 == 0))):
        raise InputError(
            f"{where}: {line[:40]!r}, expected class cx cy w h, or class x y x y x y ..."
        )
    if not all(math.isfinite(value) and -0.01 <= value <= 1.01 for value in values):
        raise InputError(f"{where}: {line[:40]!r}, expected shares of the image, from 0 to 1")
    other = np.array(shapes.other_size, np.float64)
    if is_box:
        centre, sides = np.array(values[:2]) * size - HALF, np.array(values[2:]) * size / 2
        low, high = centre - sides, centre + sides
        moved = shapes.box((low[0], low[1], high[0], high[1]))
        if moved.box is None:
            return moved, ""
        left, top, right, bottom = moved.box
        middle = (np.array([left + right, top + bottom]) / 2 + HALF) / other
        numbers = [*middle, *(np.array([right - left, bottom - top]) / other)]
    else:
        moved = shapes.polygon(np.array(values).reshape(-1, 2) * size - HALF)
        if moved.points is None:
            return moved, ""
        numbers = list(((moved.points + HALF) / other).ravel())
    return moved, " ".join([kind, *(f"{value:.6f}" for value in numbers)])
