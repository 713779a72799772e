"""Points of a table: image, x, y, and whatever else its rows have."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from .._core import InputError, read_text
from ..convert.fields import number
from .frames import LabelledFrames
from .shapes import CODES


def transfer_points(path: Path, labelled: LabelledFrames) -> str:
    """The table with the other image's names and coordinates, and what became of each in a column
    ``transfer``; x and y are empty where there is no point.
    """
    rows = list(csv.DictReader(io.StringIO(read_text(path))))
    names = list(rows[0]) if rows else []
    if not {"image", "x", "y"} <= set(names):
        raise InputError(
            f"{path}: its first row is {','.join(names)!r}, expected image, x and y in it"
        )
    shapes = {}
    out = io.StringIO()
    writer = csv.DictWriter(out, [*names, "transfer"], lineterminator="\n", extrasaction="ignore")
    writer.writeheader()
    for line, row in enumerate(rows, 2):
        index, name = labelled.partner(row["image"] or "", f"{path}:{line}")
        place = [number(as_float(row[axis])) for axis in "xy"]
        if None in place:
            raise InputError(f"{path}:{line}: x, y = {row['x']}, {row['y']}, expected numbers")
        if index not in shapes:
            shapes = {index: labelled.shapes(index)}
        found, codes = shapes[index].points([place])
        word = CODES[codes[0]]
        labelled.count(() if word == "valid" else (word,))
        there = word in ("valid", "occluded")
        x, y = (f"{value:.3f}" if there else "" for value in found[0])
        writer.writerow(row | {"image": name, "x": x, "y": y, "transfer": word})
    return out.getvalue()


def as_float(text: str | None) -> float | None:
    """A number of a table."""
    try:
        return float(text or "")
    except ValueError:
        return None
