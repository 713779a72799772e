"""How a benchmark reports: a figure is printed, and kept where `run.py` asks for it.

A figure has a name, a value with its unit, a range (10 to 90 % of the repetitions unless the
benchmark says otherwise), and a target, such as "<= 0.25", where one was set beforehand.
"""

import json
import operator
import os
from pathlib import Path
from typing import Any

import numpy as np

KEPT_IN = "XCALIB_BENCH_FIGURES"  # a file, one JSON object a line

_COMPARE = {"<=": operator.le, "<": operator.lt, ">=": operator.ge, ">": operator.gt}


def meets(value: float, target: str) -> bool:
    """`target`: a comparison and a number. Raises ValueError for anything else."""
    sign, _, limit = target.partition(" ")
    if sign not in _COMPARE:
        raise ValueError(
            f"target is {target!r}, expected one of {', '.join(_COMPARE)} and a number"
        )
    return bool(_COMPARE[sign](value, float(limit)))


def figure(
    name: str,
    value: float,
    unit: str = "",
    low: float | None = None,
    high: float | None = None,
    target: str | None = None,
    met: bool | None = None,
) -> None:
    """One figure. `met` says whether the target is met where comparing `value` is not enough."""
    entry: dict[str, object] = {"name": name, "value": float(value), "unit": unit}
    text = f"{name:<58} {value:>9.4g} {unit}"
    if low is not None and high is not None:
        entry |= {"low": float(low), "high": float(high)}
        text += f" ({low:.4g}-{high:.4g})"
    if target is not None:
        met = meets(value, target) if met is None else met
        entry |= {"target": target, "met": met}
        text += f"  target {target}: {'met' if met else 'NOT met'}"
    print(text, flush=True)
    _keep(entry)


def spread(
    name: str, values: list[float] | np.ndarray, unit: str = "", target: str | None = None
) -> float:
    """The median of repeated measurements with their 10 and 90 %; returned."""
    low, median, high = (float(v) for v in np.percentile(values, [10, 50, 90]))
    figure(name, median, unit, low, high, target)
    return median


def skipped(name: str, reason: str) -> None:
    print(f"skipped: {name}: {reason}", flush=True)
    _keep({"name": name, "skipped": reason})


def details(found: dict[str, Any]) -> None:
    """Measurements that are kept as they are, for a table or a picture of the benchmark's own."""
    _keep({"details": found})


def _keep(entry: dict[str, object]) -> None:
    if path := os.environ.get(KEPT_IN):
        with Path(path).open("a") as file:
            file.write(json.dumps(entry) + "\n")
