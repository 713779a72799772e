"""A whole calibration: `xcalib calibrate` in a process of its own, whose memory ends with it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .._core import InputError
from .shard import Shard
from .target import Target

RIG, REPORT = "rig.yaml", "report.json"


@dataclass(frozen=True)
class CalibrateShard(Shard):
    """The calibration of a drive, and how far that is from its last rig."""

    arguments: tuple[str, ...]
    directory: str
    """That names in the arguments are as seen from."""
    last: str | None
    """Rig file to compare with."""
    target: Target

    def run(self) -> dict[str, Any]:
        """Calibrate, and write the rig and its report."""
        final = self.target.place
        with self.target.attempt() as folder:
            rig, report = folder / RIG, folder / REPORT
            self._call("xcalib", "calibrate", "-o", str(rig), "--report", str(report), "--quiet",
                       "--threads", str(self.threads), *self.arguments)  # fmt: skip
            moved = None
            if self.last is not None:
                told = self._call("xcalib.batch.drift", str(report), self.last)
                moved = json.loads(told)
            text = report.read_text("utf-8").replace(json.dumps(str(folder))[1:-1], final)
            report.write_text(text, "utf-8")
            self.target.publish(folder, {RIG: RIG, REPORT: REPORT})
        return {**result_of(json.loads(text)), "drift": moved}

    def _call(self, *words: str) -> str:
        """What a module of ours prints; its last line on stderr is why it fails."""
        command: Sequence[str] = [sys.executable, "-m", *words]
        environment = {**os.environ, "OMP_NUM_THREADS": str(max(self.threads, 1))}
        done = subprocess.run(
            command,
            cwd=self.directory if Path(self.directory).is_dir() else None,
            env=environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode in (0, 3):
            return done.stdout
        lines = done.stderr.strip().splitlines() or [f"ended with {done.returncode}"]
        why = lines[-1].removeprefix("error: ")
        raise InputError(why) if done.returncode == 2 else RuntimeError(why)


def result_of(report: dict[str, Any]) -> dict[str, Any]:
    """What a batch keeps of a report."""
    verdict = report.get("verdict") or {}
    error = verdict.get("expected_error_px") or {}
    return {
        "trusted": bool(report.get("converged")),
        "reason": str(verdict.get("reason") or report.get("message") or ""),
        "advice": str(verdict.get("advice") or ""),
        "median_px": error.get("median"),
        "p95_px": error.get("p95"),
    }
