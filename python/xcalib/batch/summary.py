"""The table and the page of a batch."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from typing import Any

from ..report.template import rendered, text_of
from .calibrate_shard import REPORT, RIG
from .run import STATES, DriveState
from .store import is_there, join

COLUMNS = (
    *("name", "state", "why", "trusted", "expected_median_px", "expected_p95_px"),
    *("moved_median_px", "moved_p95_px", "nec_last_rig", "nec_new_rig", "rig"),
    *("frames", "registered", "from_before", "left_out", "missing", "valid_share"),
    *("seconds", "peak_worker_mb"),
)


def row(state: DriveState) -> dict[str, Any]:
    """A drive in numbers, by `COLUMNS`; None where there is none."""
    found = state.calibration or {}
    drift = found.get("drift") or {}
    done = state.registered
    values: dict[str, Any] = dict.fromkeys(COLUMNS)
    values |= {
        "name": state.job.name,
        "state": state.state,
        "why": state.why,
        "trusted": found.get("trusted"),
        "expected_median_px": found.get("median_px"),
        "expected_p95_px": found.get("p95_px"),
        "moved_median_px": drift.get("median_px"),
        "moved_p95_px": drift.get("p95_px"),
        "nec_last_rig": drift.get("nec_last"),
        "nec_new_rig": drift.get("nec_new"),
        "rig": None if state.rig is None else str(state.rig),
    }
    if done is not None:
        values |= {
            "frames": done.frames,
            "registered": done.earlier + done.made,
            "from_before": done.earlier,
            "left_out": len(done.left_out),
            "missing": sum(count for _, count, _ in done.missing),
            "valid_share": done.valid / done.pixels if done.pixels else None,
            "seconds": round(done.seconds, 3),
            "peak_worker_mb": done.peak_bytes // 10**6 or None,
        }
    return values


def as_csv(states: Sequence[DriveState]) -> bytes:
    """The table, a line a drive."""
    text = io.StringIO()
    table = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    table.writeheader()
    table.writerows(map(row, states))
    return text.getvalue().encode()


def as_json(states: Sequence[DriveState]) -> bytes:
    """The table, with every frame that is not there."""
    drives = []
    for state in states:
        done = state.registered
        gone = {
            "left_out_frames": [] if done is None else [list(one) for one in done.left_out],
            "missing_shards": [] if done is None else [list(one) for one in done.missing],
        }
        drives.append(row(state) | gone)
    document = {"format": "xcalib-batch", "version": 1, "drives": drives}
    return (json.dumps(document, indent=1) + "\n").encode()


def as_page(states: Sequence[DriveState], title: str) -> bytes:
    """The page: those that need a person first."""
    rows = [row(state) | {"links": _links(state)} for state in states]
    counts = {name: sum(one["state"] == name for one in rows) for name in STATES}
    facts = {
        "title": title,
        "rows": rows,
        "counts": counts,
        "frames": sum(one["registered"] or 0 for one in rows),
    }
    return rendered(__package__, "index.html", facts, text_of(__package__, "index.css")).encode()


def _links(state: DriveState) -> list[tuple[str, str]]:
    names = [RIG, REPORT, state.job.output]
    return [
        (name, f"{state.job.name}/{name}") for name in names if is_there(join(state.folder, name))
    ]
