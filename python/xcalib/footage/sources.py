"""From what REFERENCE or SOURCE names to a stream."""

from __future__ import annotations

from pathlib import Path

from ..frames import InputError, list_images
from .bag import BagImages, is_bag
from .files import ImageFiles, open_files
from .flir import PARTS, RadiometricFiles, parts_of
from .stream import HALVES, Half, Stream
from .video import VIDEO_SUFFIXES, Video


def open_stream(spec: str | Path) -> Stream:
    """Open what REFERENCE or SOURCE names.

    A folder of images; a pattern (``shots/*.png``, ``shots/%06d.png``); a TIFF stack; a video; or
    a bag with its topic (``drive.mcap#/camera/image_raw``; the topic may go if it is the only
    one). ``#visible``, ``#thermal`` or ``#temperature`` behind radiometric JPEGs takes that part of
    each. ``#left``, ``#right``, ``#top`` or ``#bottom`` behind any of them takes that half of each
    frame. A path that exists is taken as it is, whatever is in its name.
    """
    text = str(spec)
    if not Path(text).exists() and "#" in text:
        base, _, part = text.rpartition("#")
        if part in HALVES:
            return Half(open_stream(base), part)
        if part in PARTS:
            return _radiometric(open_stream(base), part, text)
        if is_bag(Path(base)):
            return BagImages(Path(base), part)
        raise InputError(
            f"{text}: expected #TOPIC behind a bag, one of"
            f" {', '.join('#' + half for half in HALVES)}, or, behind radiometric JPEGs, of"
            f" {', '.join('#' + part for part in PARTS)}"
        )
    path = Path(text)
    if is_bag(path):
        return BagImages(path, "")
    files = open_files(path)
    if files is not None:
        return files
    if path.suffix.lower() in VIDEO_SUFFIXES and path.is_file():
        return Video(path)
    if path.suffix.lower() in VIDEO_SUFFIXES:
        raise InputError(f"{path}: no such file")
    return ImageFiles(list_images(path))  # which says what is wrong with it


def open_two(reference: str | Path, source: str | Path) -> tuple[Stream, Stream]:
    """Open both, one after the other. Radiometric JPEGs given as both are the visible image and the
    raw thermal one in each.
    """
    first, second = open_stream(reference), open_stream(source)
    if (
        isinstance(first, ImageFiles)
        and isinstance(second, ImageFiles)
        and first.paths == second.paths
        and parts_of(first.paths[0]) is not None
    ):
        first = RadiometricFiles(first.paths, "visible")
        second = RadiometricFiles(second.paths, "thermal")
        first.said = (
            f"{reference}: radiometric JPEGs, of which the visible image is the reference and the"
            " raw thermal one the source"
        )
    return first, second


def _radiometric(stream: Stream, part: str, spec: str) -> Stream:
    if not isinstance(stream, ImageFiles) or parts_of(stream.paths[0]) is None:
        raise InputError(f"{spec}: expected radiometric JPEGs of a FLIR camera before #{part}")
    return RadiometricFiles(stream.paths, part)
