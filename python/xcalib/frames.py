"""Images on disk: files of a folder, their pairs, image files in, whole image files out.

Files are taken in *natural* order of their names (``2.png`` before ``10.png``); hidden files and
files of other types are ignored. Images are numpy arrays ``(H, W)`` or ``(H, W, 3)`` of ``uint8``,
``uint16`` or ``float32`` in the file's own range; colour is in OpenCV's order, blue-green-red, and
an alpha channel is dropped.

Nothing half-written: a file appears under its name only when it is complete.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from . import _core
from ._core import (
    DecodeError,
    InputError,
    Rig,
    as_signed,
    as_stored,
    check_file_writable,
    check_folder_writable,
    check_output_writable,
    display_gray,
    overlay,
    pair_files,
    read_array,
    with_full_page_first,
)
from .png import encode_png

Image = NDArray[Any]
Size = tuple[int, int]
"""Width and height [px]."""

__all__ = [
    "ARRAY_SUFFIXES",
    "IMAGE_SUFFIXES",
    "DecodeError",
    "Image",
    "InputError",
    "Size",
    "as_image",
    "check_file_writable",
    "check_folder_writable",
    "check_output_writable",
    "decode",
    "decode_bytes",
    "display_gray",
    "encode_image",
    "fit_rig",
    "gray",
    "is_truncated",
    "list_files",
    "list_images",
    "overlay",
    "pair",
    "quiet_opencv",
    "read_image",
    "same_aspect",
    "size_of",
    "write_bytes",
    "write_image",
]

IMAGE_SUFFIXES = (
    *(".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp"),
    *(".pgm", ".ppm", ".webp", ".jp2"),
)
ARRAY_SUFFIXES = (".npy",)


# -- Names ---------------------------------------------------------------------------------------


def list_files(folder: str | Path, suffixes: Collection[str] = IMAGE_SUFFIXES) -> list[Path]:
    """Files of ``folder`` with one of ``suffixes`` (any case), in natural order, at least one."""
    return _core.list_files(folder, list(suffixes))


def list_images(folder: str | Path) -> list[Path]:
    """The image files of a folder; arrays where it has no other, for they may lie beside images."""
    files = list_files(folder, IMAGE_SUFFIXES + ARRAY_SUFFIXES)
    images = [path for path in files if path.suffix.lower() not in ARRAY_SUFFIXES]
    return images or files


def pair(first: Sequence[Path], second: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Pair the files of two folders, in the order of the first, see `pair_files`."""
    partners = pair_files(list(first), list(second))
    return [(path, second[index]) for path, index in zip(first, partners, strict=True)]


# -- Reading -------------------------------------------------------------------------------------


def read_image(path: str | Path) -> Image:
    """Read one image: ``(H, W)`` or ``(H, W, 3)``, uint8, uint16 or float32.

    The pixels come as they are stored: no rotation by EXIF tags, for a camera's geometry is that
    of its sensor.
    """
    array = read_array(path, is_image=True)
    if array is not None:
        return array
    image = decode(Path(path))
    if image.dtype == np.float64:
        image = image.astype(np.float32)
    return as_image(image, str(path))


def as_image(pixels: Image, where: str) -> Image:
    """Decoded pixels as `read_image` returns them, without alpha; ``where`` names them if not."""
    if pixels.ndim == 3:
        # Two and four channels are gray and colour with alpha.
        pixels = pixels[..., 0] if pixels.shape[2] < 3 else pixels[..., :3]
    if pixels.dtype in (np.int32, np.uint32):
        pixels = pixels.astype(np.float32)
    if pixels.dtype not in (np.uint8, np.uint16, np.float32):
        raise InputError(f"{where}: pixels are {pixels.dtype}, expected uint8, uint16 or float32")
    return np.ascontiguousarray(pixels)


_quiet = threading.Lock()
_quiet_level, _quiet_users = 0, 0


@contextlib.contextmanager
def quiet_opencv() -> Iterator[None]:
    """Keep OpenCV from printing messages of its own on a bad file, beside our one line.

    The level is the whole process's: the first thread in takes it down, the last one out back up.
    """
    global _quiet_level, _quiet_users
    with _quiet:
        if not _quiet_users:
            _quiet_level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
        _quiet_users += 1
    try:
        yield
    finally:
        with _quiet:
            _quiet_users -= 1
            if not _quiet_users:
                cv2.utils.logging.setLogLevel(_quiet_level)


def decode(path: Path) -> Image:
    """Decode an image file with all its channels, or raise `DecodeError` naming the file."""
    if not path.is_file():
        if path.is_symlink():
            raise DecodeError(f"{path}: a link to a file that is not there")
        raise InputError(f"{path}: no such file")
    return decode_bytes(path.read_bytes(), str(path))


def decode_bytes(data: bytes, path: str) -> Image:
    """The same of the bytes of a file; ``path`` names it in messages."""
    is_unsigned = False
    if data.startswith((b"II*\0", b"MM\0*")):
        is_unsigned, data = as_signed(with_full_page_first(as_stored(data), path))
    image = None
    with quiet_opencv(), contextlib.suppress(cv2.error):
        if data and not is_truncated(data):
            image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    kind = _core.tiff_pixel_type(data) if image is None else ""
    if kind not in ("", "uint8", "uint16", "float32"):
        raise InputError(f"{path}: pixels are {kind}, expected uint8, uint16 or float32")
    if image is None:
        raise DecodeError(f"{path}: cannot decode {len(data)} bytes, truncated or not an image")
    if is_unsigned and image.dtype == np.int32:
        return image.view(np.uint32)
    return image


def is_truncated(data: bytes) -> bool:
    """Whether a PNG or JPEG ends early: OpenCV would return it with a gray or black rest."""
    if data.startswith(b"\x89PNG"):
        return b"\x00\x00\x00\x00IEND\xaeB`\x82" not in data
    if not data.startswith(b"\xff\xd8"):
        return False
    # Walk the segments to the scan: thumbnails inside them have end markers of their own. In the
    # scan a byte FF is always escaped, so that FF D9 is the end and nothing else.
    at = 2
    while data[at : at + 1] == b"\xff" and data[at : at + 2] != b"\xff\xda":
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return b"\xff\xd9" not in data[at:]


def size_of(image: Image) -> Size:
    """Width and height [px] of an image or a depth map."""
    return image.shape[1], image.shape[0]


# -- Sizes ---------------------------------------------------------------------------------------


def same_aspect(size: Size, reference: Size) -> bool:
    """Whether ``size`` is ``reference`` scaled, to within one pixel of rounding."""
    return abs(size[0] * reference[1] - size[1] * reference[0]) <= max(reference)


def fit_rig(rig: Rig, reference: Size, source: Size) -> Rig:
    """The rig for images of these sizes: itself, or rescaled when both aspects are the same."""
    return rig.fitted(*reference, *source)


# -- Gray ----------------------------------------------------------------------------------------


def gray(image: Image) -> NDArray[np.float32]:
    """Gray in [0, 1], ``(H, W)`` float32: integers over their range, floats as they are."""
    if image.ndim == 3:
        image = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
    if image.dtype == np.float32:
        return image
    return image.astype(np.float32) / np.float32(np.iinfo(image.dtype).max)


# -- Writing -------------------------------------------------------------------------------------


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file whole or not at all, see `_core.write_file`."""
    _core.write_file(path, data)


def encode_image(path: str | Path, image: Image) -> bytes:
    """An image file of the kind that the suffix of ``path`` says."""
    path = Path(path)
    whole = image.dtype in (np.uint8, np.uint16) and image.shape[2:] in ((), (3,))
    if path.suffix.lower() == ".png" and whole:
        return encode_png(image)
    done, data = cv2.imencode(path.suffix, image)
    if not done:
        raise ValueError(f"{path}: cannot encode {image.shape} {image.dtype}")
    return data.tobytes()


def write_image(path: str | Path, image: Image) -> None:
    """Encode an image by the suffix of ``path`` and write it whole or not at all."""
    write_bytes(path, encode_image(path, image))
