"""Point clouds from files: KITTI .bin, .pcd and .ply.

Both headers describe records of named numbers, so that both become one numpy record type; only
``x``, ``y`` and ``z`` are kept. What is not understood is refused, never guessed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..frames import InputError

POINT_SUFFIXES = (".bin", ".pcd", ".ply")
Points = NDArray[np.float64]

_PLY_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}


def read_points(path: str | Path) -> Points:
    """Read one scan: ``(N, 3)`` float64 x, y, z [m] in the file's own axes, N at least 1.

    Points that are not finite, or at the origin (no return), are dropped. ``.bin`` holds float32
    x, y, z, reflectance (KITTI); ``.pcd`` is ascii or binary, not compressed; ``.ply`` is ascii or
    binary with the vertices first. Raises `InputError` naming the file.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    suffix = path.suffix.lower()
    if suffix not in POINT_SUFFIXES:
        raise InputError(f"{path}: expected a .bin, .pcd or .ply file")
    data = path.read_bytes()
    points: Points = {".bin": _bin, ".pcd": _pcd, ".ply": _ply}[suffix](path, data)
    points = points[np.isfinite(points).all(axis=1) & (points != 0).any(axis=1)]
    if not len(points):
        raise InputError(f"{path}: no point in it, expected at least one with finite x, y, z")
    return points


def _bin(path: Path, data: bytes) -> Points:
    if len(data) % 16:
        raise InputError(
            f"{path}: {len(data)} bytes, expected a multiple of 16"
            " (float32 x, y, z, reflectance), so the file is truncated or something else"
        )
    return np.frombuffer(data, "<f4").reshape(-1, 4)[:, :3].astype(np.float64)


def _pcd(path: Path, data: bytes) -> Points:
    fields: dict[str, list[str]] = {}
    at = 0
    while "DATA" not in fields:
        line, at = _line(path, data, at)
        if line and not line.startswith("#"):
            key, *values = line.split()
            fields[key] = values
    try:
        names, count = fields["FIELDS"], int(fields["POINTS"][0])
        repeats = [int(value) for value in fields.get("COUNT", ["1"] * len(names))]
        record = [
            (name, f"<{kind.lower()}{int(size)}", (repeat,))
            for name, kind, size, repeat in zip(
                names, fields["TYPE"], fields["SIZE"], repeats, strict=True
            )
        ]
        layout = np.dtype([(f"{i} {name}", *rest) for i, (name, *rest) in enumerate(record)])
        [encoding] = fields["DATA"]
    except (KeyError, ValueError, TypeError, IndexError) as error:
        raise InputError(f"{path}: bad .pcd header ({error})") from None
    if encoding not in ("ascii", "binary"):
        raise InputError(f"{path}: DATA is {encoding}, expected ascii or binary")
    return _records(path, data[at:], layout, names, count, encoding == "ascii")


def _ply(path: Path, data: bytes) -> Points:
    line, at = _line(path, data, 0)
    if line != "ply":
        raise InputError(f"{path}: starts with {line[:20]!r}, expected `ply`")
    encoding, count, names = "", -1, []
    types: list[str] = []
    inside = False
    while line != "end_header":
        line, at = _line(path, data, at)
        match line.split():
            case ["format", encoding, "1.0"]:
                pass
            case ["element", "vertex", number] if number.isdigit():
                inside, count = True, int(number)
            case ["element", name, _]:
                if count < 0:
                    raise InputError(f"{path}: element {name} comes first, expected vertex first")
                inside = False
            case ["property", kind, name] if kind in _PLY_TYPES and inside:
                names.append(name)
                types.append(_PLY_TYPES[kind])
            case ["property", *_] if not inside:
                pass  # of faces and the like, which come after the vertices
            case ["comment" | "obj_info" | "end_header", *_]:
                pass
            case _:
                raise InputError(f"{path}: header line {line[:60]!r} is not understood")
    orders = {"ascii": "<", "binary_little_endian": "<", "binary_big_endian": ">"}
    if encoding not in orders or count < 0:
        raise InputError(f"{path}: expected a format ({', '.join(orders)}) and an element vertex")
    layout = np.dtype(
        [(f"{i} {name}", orders[encoding] + types[i], (1,)) for i, name in enumerate(names)]
    )
    return _records(path, data[at:], layout, names, count, encoding == "ascii")


def _line(path: Path, data: bytes, at: int) -> tuple[str, int]:
    """The header line that starts at byte ``at``, and where the next one starts."""
    end = data.find(b"\n", at)
    if end < 0:
        raise InputError(f"{path}: the header does not end, truncated or not a point cloud")
    return data[at:end].decode("ascii", "replace").strip(), end + 1


def _records(
    path: Path, data: bytes, layout: np.dtype[np.void], names: list[str], count: int, text: bool
) -> Points:
    """x, y, z of ``count`` records that follow a header."""
    if not {"x", "y", "z"} <= set(names):
        raise InputError(f"{path}: fields are {' '.join(names)}, expected x, y and z among them")
    places = [names.index(axis) for axis in "xyz"]
    if not text:
        if len(data) < count * layout.itemsize:
            raise InputError(
                f"{path}: {len(data)} bytes of points, expected {count} times {layout.itemsize}"
            )
        values = np.frombuffer(data, layout, count)
        return np.column_stack([values[f"{i} {names[i]}"][:, 0] for i in places]).astype(np.float64)
    widths = [layout[i].shape[0] for i in range(len(names))]
    columns = [sum(widths[:i]) for i in places]
    lines = data.splitlines()[:count]
    try:
        rows = [line.split() for line in lines]
        if len(rows) < count or any(len(row) != sum(widths) for row in rows):
            raise ValueError
        return np.array([[float(row[i]) for i in columns] for row in rows]).reshape(-1, 3)
    except ValueError:
        raise InputError(
            f"{path}: expected {count} lines of {sum(widths)} numbers after the header"
        ) from None
