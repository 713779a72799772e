"""Radiometric JPEGs as FLIR cameras write them."""

from __future__ import annotations

import struct
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

PLANCK = {0x58: 16556.0, 0x5C: 1428.0, 0x60: 1.0, 0x30C: 0.0466}


def radiometric(thermal: Array, visible: Array | None, raw: str = "png") -> bytes:
    """A JPEG as FLIR writes them: its records in segments of the file."""
    # In a PNG counts have the wrong order of bytes.
    png = cv2.imencode(".png", thermal.byteswap())[1].tobytes()
    pixels = png if raw == "png" else thermal.astype("<u2").tobytes()
    height, width = thermal.shape
    head = struct.pack("<HHH", 2, width, height).ljust(32, b"\0")
    camera = bytearray(0x320)
    struct.pack_into("<H", camera, 0, 2)
    for at, value in PLANCK.items():
        struct.pack_into("<f", camera, at, value)
    struct.pack_into("<i", camera, 0x308, -342)
    picture = struct.pack(">fhh", 1.3, 12, -7).ljust(32, b"\0")
    records = [(1, head + pixels), (0x20, bytes(camera)), (0x2A, picture)]
    if visible is not None:
        jpeg = cv2.imencode(".jpg", visible)[1].tobytes()
        records.append(
            (0x0E, struct.pack("<HHH", 3, *visible.shape[1::-1]).ljust(32, b"\0") + jpeg)
        )
    start = 64 + 32 * len(records)
    directory, body = b"", b""
    for kind, data in records:
        directory += struct.pack(">HHIIII", kind, 1, 100, 1, start + len(body), len(data)).ljust(
            32, b"\0"
        )
        body += data
    head = b"FFF\0" + b"test".ljust(16, b"\0") + struct.pack(">III", 101, 64, len(records))
    data = head.ljust(64, b"\0") + directory + body
    shown = cv2.imencode(".jpg", np.full((48, 64), 7, np.uint8))[1].tobytes()
    parts = [data[at : at + 60000] for at in range(0, len(data), 60000)]
    segments = b"".join(
        b"\xff\xe1"
        + struct.pack(">H", len(part) + 10)
        + b"FLIR\0\1"
        + bytes([i, len(parts) - 1])
        + part
        for i, part in enumerate(parts)
    )
    return shown[:2] + segments + shown[2:]
