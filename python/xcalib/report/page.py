"""The page itself: what a template gets, and the file."""

from __future__ import annotations

import itertools
import json
import operator
import platform
import shlex
from importlib.metadata import version
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..evaluation import evaluate
from ..frames import write_bytes
from .charts import chart, lens_lines, rig_segments
from .pictures import frame_pictures
from .run import Run
from .template import rendered, text_of

LARGEST = 5 * 10**6
"""Of a page [bytes]."""


def write_page(run: Run, path: Path, title: str) -> None:
    """Write the page of a run."""
    write_bytes(path, page(run, title).encode())


def page(run: Run, title: str) -> str:
    """The page of a run, as HTML."""
    return rendered(__package__, "page.html", facts_of(run, title))


def facts_of(run: Run, title: str) -> dict[str, Any]:
    """All that the template shows; what the report has not is None."""
    document, rig = run.document, run.frames.fit(run.rig)
    scores = scores_of(run)
    levels = document.get("levels") or []
    errors = document.get("expected_error_map")
    run_facts = document.get("run") or {}
    lenses = lens_lines(rig)
    return {
        "title": title,
        "document": document,
        "verdict": document.get("verdict"),
        "trusted": bool(document.get("converged")),
        "message": document.get("message") or "",
        "frames": frame_pictures(run),
        "scores": scores,
        "nec": chart(
            [
                ("registered", range(len(scores)), [s["after"] for s in scores]),
                ("only resized", range(len(scores)), [s["before"] for s in scores]),
            ],
            "frame used",
            "NEC",
        ),
        "loss": chart(
            [
                ("at its end", range(len(levels)), [float(v["final_cost"]) for v in levels]),
                ("at its begin", range(len(levels)), [float(v["initial_cost"]) for v in levels]),
            ],
            "solve",
            "loss",
        )
        if levels
        else None,
        "levels": levels,
        "lens": chart(lenses, "distance from the axis [px]", "moved by [px]") if lenses else None,
        "errors": errors,
        "rig": rig,
        "rig_facts": facts_of_rig(rig),
        "segments": rig_segments(rig),
        "weak": document.get("weak_directions") or [],
        "choice": run_facts.get("choice") or [],
        "command": shlex.join(
            [run_facts.get("program", "xcalib"), *run_facts.get("arguments", [])]
        ),
        "directory": run_facts.get("directory"),
        "versions": {
            "xcalib": version("xcalib-rgbt"),
            "Python": platform.python_version(),
            "NumPy": np.__version__,
            "OpenCV": cv2.__version__,
            "machine": f"{platform.system()} {platform.machine()}",
        },
        "script": text_of(__package__, "script.js"),
    }


def facts_of_rig(rig: Any) -> dict[str, Any]:
    """What `xcalib inspect --json` prints."""
    from .._core import rig_document

    facts: dict[str, Any] = json.loads(rig_document(rig))
    return facts


def scores_of(run: Run) -> list[dict[str, Any]]:
    """NEC of each frame used, registered and only resized."""
    # One frame at a time: tee hands each on to all three.
    rows = itertools.tee((run.frames.read(index) for index in run.chosen), 3)
    parts = (map(operator.itemgetter(i), part) for i, part in enumerate(rows))
    references, sources, depths = parts
    found = evaluate(run.rig, references, sources, depths)
    return [
        {
            "name": run.frames.references.name(index),
            "after": after["nec"],
            "before": before["nec"],
        }
        for index, (after, before) in zip(run.chosen, found.frames, strict=True)
    ]
