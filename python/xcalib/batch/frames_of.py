"""Footage opened once in a worker, for all of its shards."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable

from ..pipeline import Frames

MOST = 2
"""Drives that a thread of a worker keeps open."""

_local = threading.local()


def opened_once(key: str, open_frames: Callable[[], Frames]) -> Frames:
    """The frames of this key: opened by this thread before, or now. Streams of videos are not for
    several threads at once, so each has its own.
    """
    known: OrderedDict[str, Frames] = _local.__dict__.setdefault("known", OrderedDict())
    if key not in known:
        known[key] = open_frames()
        while len(known) > MOST:
            known.popitem(last=False)
    known.move_to_end(key)
    return known[key]
