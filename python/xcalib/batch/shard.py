"""A shard: work that any worker may do, any number of times, to the same end.

Only its description travels to a worker, and only a small dictionary back: no image does.
"""

from __future__ import annotations

import os
import resource
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from typing import Any

import cv2

from .._core import InputError

VERSION = version("xcalib-rgbt")


@dataclass(frozen=True)
class Shard:
    """What to do, in a few kilobytes that can be pickled; kinds of work derive from it."""

    id: str
    """Fingerprint of all that goes in: rig, settings, what the files are."""
    name: str
    """For messages."""
    version: str = field(default=VERSION, kw_only=True)
    """Of the package that made it; a worker of another refuses it."""
    threads: int = field(default=1, kw_only=True)
    """Native threads that it may use."""

    def run(self) -> dict[str, Any]:
        """Do it; what it writes appears whole. Returns what is to be noted of it."""
        raise NotImplementedError

    def halves(self) -> Sequence[Shard]:
        """The same in two parts, to find what ends its worker; nothing where it is one piece."""
        return ()


@dataclass(frozen=True)
class Outcome:
    """What came of a shard."""

    worker: str
    """Which one ran it."""
    seconds: float
    peak_bytes: int
    """The most memory that the worker's process has had so far."""
    result: dict[str, Any] = field(default_factory=dict)
    failure: str = ""
    """Why there is no result."""
    is_input: bool = False
    """Whether it fails for what the user gave: nowhere would it do."""


def run_shard(shard: Shard) -> Outcome:
    """What a worker does with a shard. Exceptions come back as text: not all of them travel."""
    start = time.perf_counter()
    result: dict[str, Any] = {}
    failure, is_input = "", False
    try:
        if shard.version != VERSION:
            raise InputError(
                f"worker {this_worker()} has xcalib {VERSION}, expected {shard.version} as here"
            )
        cv2.setNumThreads(shard.threads)
        result = shard.run()
    except (InputError, ValueError) as error:
        failure, is_input = str(error), True
    except OSError as error:
        failure = f"{error.filename}: {error.strerror}" if error.filename else str(error)
    except Exception as error:  # whatever it is, another worker may do better
        failure = f"{type(error).__name__}: {error}"
    seconds = time.perf_counter() - start
    return Outcome(this_worker(), seconds, peak_bytes(), result, failure, is_input)


def this_worker() -> str:
    """The address of a Dask worker, else host and process."""
    try:
        from distributed import get_worker

        return str(get_worker().address)
    except (ImportError, ValueError):
        return f"{socket.gethostname()}:{os.getpid()}"


def peak_bytes() -> int:
    """The most memory that this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
