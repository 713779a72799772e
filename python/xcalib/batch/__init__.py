"""Registering and calibrating in shards: on executors, on a cluster, many drives at once.

>>> with ProcessPoolExecutor(4) as executor:
...     done = register(inputs, rig, "out", workers=OnExecutor(executor, 4))
>>> print(done.summary())
"""

from __future__ import annotations

from .drive import Registered, register
from .engine import Lost, run_shards
from .shard import Outcome, Shard
from .workers import InThisProcess, LocalProcesses, OnExecutor, Workers, WorkersGone, open_workers

__all__ = [
    "InThisProcess",
    "LocalProcesses",
    "Lost",
    "OnExecutor",
    "Outcome",
    "Registered",
    "Shard",
    "Workers",
    "WorkersGone",
    "open_workers",
    "register",
    "run_shards",
]
