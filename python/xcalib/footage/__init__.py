"""Footage: streams of frames from folders, patterns, TIFF stacks, videos, bags and MCAP files.

>>> references = open_stream("drive.mcap#/visible/image_raw")
>>> sources = open_stream("thermal.mkv")
>>> pairing = pair_streams(references, sources, "time", offset=0.1)
"""

from __future__ import annotations

from .bag import BagImages, CameraInfo, camera_infos, is_bag
from .depth_topic import TopicDepth
from .files import ImageFiles, Pages
from .offset import OffsetEstimate, RefinedOffset, estimate_offset, offsets_around, refine_offset
from .opening import Matching, Pairs, open_pairs
from .pairing import METHODS, Pairing, match_depths, pair_streams, pair_times
from .sources import open_stream
from .stream import Part, Picked, Stream
from .times import read_times
from .video import VIDEO_SUFFIXES, Video
from .writer import Sink, is_video, journal_of, open_sink

__all__ = [
    "METHODS",
    "VIDEO_SUFFIXES",
    "BagImages",
    "CameraInfo",
    "ImageFiles",
    "Matching",
    "OffsetEstimate",
    "Pages",
    "Pairing",
    "Pairs",
    "Part",
    "Picked",
    "RefinedOffset",
    "Sink",
    "Stream",
    "TopicDepth",
    "Video",
    "camera_infos",
    "estimate_offset",
    "is_bag",
    "is_video",
    "journal_of",
    "match_depths",
    "offsets_around",
    "open_pairs",
    "open_sink",
    "open_stream",
    "pair_streams",
    "pair_times",
    "read_times",
    "refine_offset",
]
