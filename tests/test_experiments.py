"""The experiments of bench/experiments run, on next to nothing; their figures are not judged."""

from __future__ import annotations

import importlib.util
import os
import runpy
import subprocess
import sys
from pathlib import Path

import pytest

BENCH = Path(__file__).resolve().parents[1] / "bench" / "experiments"

pytestmark = [
    pytest.mark.skipif(not BENCH.is_dir(), reason="no bench folder"),
    *(
        pytest.mark.skipif(importlib.util.find_spec(name) is None, reason=f"needs {name}")
        for name in ("matplotlib", "SimpleITK")
    ),
]


def run(folder: Path, *arguments: str) -> str:
    """The command's output."""
    command = [sys.executable, str(BENCH), *arguments, "--quick", "--results", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | {"LANG": "C"})
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("arguments", "table"),
    [
        (["3", "--part", "rendered"], "3_rendered"),
        (["4"], "4_scales"),
        (["6"], "6_depth"),
    ],
)
def test_an_experiment_leaves_its_table(tmp_path: Path, arguments: list[str], table: str) -> None:
    docs = BENCH.parents[1] / "docs" / "results.md"
    before = docs.read_bytes()
    run(tmp_path, *arguments)
    lines = (tmp_path / f"{table}.md").read_text().splitlines()
    header, rows = lines[0], [line for line in lines[2:] if line.startswith("|")]
    assert rows
    assert all(row.count("|") == header.count("|") for row in rows)
    csv = (tmp_path / f"{table}.csv").read_text().splitlines()
    assert len(csv) == len(rows) + 1
    assert docs.read_bytes() == before  # quick figures are nobody's results


def test_metrics_by_shift(tmp_path: Path, xcalib_data: Path) -> None:
    run(tmp_path, "1")
    rows = (tmp_path / "1_metrics.csv").read_text().splitlines()
    assert rows[1].startswith("NEC,")
    assert (tmp_path / "1_metrics.png").read_bytes().startswith(b"\x89PNG")


def test_every_table_has_its_place_in_the_docs(monkeypatch: pytest.MonkeyPatch) -> None:
    """A table that is not among an experiment's own is refused when it is written."""
    for folder in (BENCH.parent, BENCH):
        monkeypatch.syspath_prepend(str(folder))
    import pages
    from results import DOCS, Results

    experiments = runpy.run_path(str(BENCH / "__main__.py"))["EXPERIMENTS"]
    marked = pages.marked(DOCS)
    assert marked == {f"{e}_{name}" for e, (_, names) in experiments.items() for name in names}
    assert all(f"<!-- /{name} -->" in DOCS.read_text() for name in marked)
    with pytest.raises(ValueError, match="table other of experiment 1"):
        Results(Path(), "1", ["metrics"], quick=True).table("other", [], [], "")
