"""PNG files through ISA-L: several times as fast as zlib, and about as small."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from isal import isal_zlib
from numpy.typing import NDArray

_UP = 2
"""PNG's filter of a row less the row above: for images from cameras the best of the simple ones."""
_LEVEL = 1
_GRAY, _COLOUR = 0, 2


def encode_png(image: NDArray[Any]) -> bytes:
    """The file of an image ``(H, W)`` or ``(H, W, 3)``, blue-green-red, of uint8 or uint16."""
    height, width = image.shape[:2]
    if image.ndim == 3:
        image = image[..., ::-1]
    rows = np.ascontiguousarray(image.astype(image.dtype.newbyteorder(">"), copy=False))
    stored = rows.view(np.uint8).reshape(height, -1)
    filtered = np.empty((height, stored.shape[1] + 1), np.uint8)
    filtered[:, 0] = _UP
    filtered[0, 1:] = stored[0]
    np.subtract(stored[1:], stored[:-1], out=filtered[1:, 1:])
    kind = _GRAY if image.ndim == 2 else _COLOUR
    header = struct.pack(">IIBBBBB", width, height, 8 * image.itemsize, kind, 0, 0, 0)
    data = isal_zlib.compress(filtered, _LEVEL)
    chunks = _chunk(b"IHDR", header) + _chunk(b"IDAT", data) + _chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + chunks


def _chunk(kind: bytes, data: bytes) -> bytes:
    check = isal_zlib.crc32(data, isal_zlib.crc32(kind))
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", check)
