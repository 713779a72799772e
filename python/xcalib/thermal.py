"""Thermal images as cameras and their software save them, as one number per pixel.

16-bit counts, floats in kelvin or Celsius, and 8-bit gray carry that number as it is. A
*false-colour* picture hides it: each value was replaced by a colour of a map, which `recognise`
finds.
"""

from __future__ import annotations

import contextlib

from ._core import (
    ColorMap,
    frames_to_recognise_by,
    known_color_map,
    known_color_maps,
    recognise,
)
from .footage.stream import Converted, Stream
from .frames import DecodeError, Image

__all__ = ["KNOWN", "ColorMap", "recognise", "scalar_sources"]

KNOWN = {colormap.name: colormap for colormap in known_color_maps()}
"""The known maps by name: OpenCV's, and `iron`."""


def scalar_sources(images: Stream, colormap: str = "auto") -> tuple[Stream, str]:
    """Source images with false colour turned back to numbers, and a line that says so.

    Parameters
    ----------
    images
        Source images on disk; a few of them, spread over the footage, are read to decide.
    colormap
        ``auto``, ``none`` (images as they are), or the name of a known map.

    The line is empty where nothing is changed.
    """
    if colormap == "none":
        return images, ""
    if colormap != "auto":
        return Converted(images, known_color_map(colormap).invert), ""
    some: list[Image] = []
    for index in frames_to_recognise_by(len(images)):
        # What cannot be read is met again, and named, when its turn comes.
        with contextlib.suppress(DecodeError):
            some.append(images[index])
    found = recognise(some) if some else None
    if found is None:
        return images, ""
    line = (
        f"source images are false colour (map: {found.name}), turned back to numbers;"
        " --source-colormap none keeps their colours"
    )
    return Converted(images, found.invert), line
