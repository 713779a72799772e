"""Footage: streams of frames from folders, patterns, TIFF stacks, videos, bags and MCAP files.

>>> references = open_stream("drive.mcap#/visible/image_raw")
>>> sources = open_stream("thermal.mkv")
>>> pairing = pair_streams(references, sources, "time", offset=0.1)
"""

from __future__ import annotations

from .._core import (
    OffsetEstimate,
    Pairs,
    RefinedOffset,
    estimate_offset,
    is_video,
    journal_of,
    offsets_around,
    read_times,
    refine_offset,
)
from .bag import BagImages, CameraInfo, camera_infos, is_bag, lens_of_topic
from .depth_topic import TopicDepth
from .files import ImageFiles, Pages
from .opening import Matching, open_matched_depth, open_pairs
from .pairing import METHODS, Pairing, match_depths, pair_streams, pair_times
from .sources import open_stream
from .stream import Half, Picked, Stream
from .video import VIDEO_SUFFIXES, Video

__all__ = [
    "METHODS",
    "VIDEO_SUFFIXES",
    "BagImages",
    "CameraInfo",
    "Half",
    "ImageFiles",
    "Matching",
    "OffsetEstimate",
    "Pages",
    "Pairing",
    "Pairs",
    "Picked",
    "RefinedOffset",
    "Stream",
    "TopicDepth",
    "Video",
    "camera_infos",
    "estimate_offset",
    "is_bag",
    "is_video",
    "journal_of",
    "lens_of_topic",
    "match_depths",
    "offsets_around",
    "open_matched_depth",
    "open_pairs",
    "open_stream",
    "pair_streams",
    "pair_times",
    "read_times",
    "refine_offset",
]
