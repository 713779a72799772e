"""Thermal images as cameras and their software save them, as one number per pixel.

16-bit counts, floats in kelvin or Celsius, and 8-bit gray carry that number as it is. A
*false-colour* picture hides it: each value was replaced by a colour of a map, which `recognise`
finds.
"""

from __future__ import annotations

from ._core import ColorMap, known_color_maps, recognise, scalar_sources

__all__ = ["KNOWN", "ColorMap", "recognise", "scalar_sources"]

KNOWN = {colormap.name: colormap for colormap in known_color_maps()}
"""The known maps by name: OpenCV's, and `iron`."""
