"""From what REFERENCE or SOURCE names to a stream."""

from __future__ import annotations

from pathlib import Path

from ..frames import InputError, list_files
from .bag import BagImages, is_bag
from .files import ImageFiles, open_files
from .stream import HALVES, Half, Stream
from .video import VIDEO_SUFFIXES, Video


def open_stream(spec: str | Path) -> Stream:
    """Open what REFERENCE or SOURCE names.

    A folder of images; a pattern (``shots/*.png``, ``shots/%06d.png``); a TIFF stack; a video; or
    a bag with its topic (``drive.mcap#/camera/image_raw``; the topic may go if it is the only
    one). ``#left``, ``#right``, ``#top`` or ``#bottom`` behind any of them takes that half of each
    frame. A path that exists is taken as it is, whatever is in its name.
    """
    text = str(spec)
    if not Path(text).exists() and "#" in text:
        base, _, part = text.rpartition("#")
        if part in HALVES:
            return Half(open_stream(base), part)
        if is_bag(Path(base)):
            return BagImages(Path(base), part)
        raise InputError(
            f"{text}: expected #TOPIC behind a bag, or one of"
            f" {', '.join('#' + half for half in HALVES)}"
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
    return ImageFiles(list_files(path))  # which says what is wrong with it
