"""Where an experiment's tables and plots go: a folder, and the marked places of docs/results.md."""

import csv
import io
import os
import re
import subprocess
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from common import ROOT, machine

T = TypeVar("T")

DOCS = ROOT / "docs" / "results.md"
PLOTS = ROOT / "docs" / "images" / "results"


def write_whole(path: Path, data: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(path.name + ".part")
    beside.write_bytes(data)
    os.replace(beside, path)


def package() -> str:
    """The machine, and the last commit of what is measured."""
    log = ["git", "-C", str(ROOT), "log", "-1", "--format=%h", "--", "cpp", "python"]
    commit = subprocess.run(log, capture_output=True, text=True).stdout.strip()
    return f"{machine().partition(', commit')[0]}; package as of commit {commit or 'unknown'}"


@dataclass(frozen=True)
class Results:
    folder: Path
    experiment: str
    quick: bool
    deadline: float = float("inf")
    """Of `time.perf_counter`: no further rig is begun then."""

    def in_time(self, rigs: Iterable[T]) -> Iterator[T]:
        """The rigs until time is up; at least one."""
        for done, rig in enumerate(rigs):
            if done and time.perf_counter() > self.deadline:
                print(f"stopped after {done}: time is up")
                return
            yield rig

    def of(self, full, quick):
        """The one or the other, by how much is asked for."""
        return quick if self.quick else full

    def table(self, name: str, columns: list[str], rows: list[list[str]], note: str) -> None:
        """Prints and keeps a table; `note` says what it rests on."""
        for row in rows:
            assert len(row) == len(columns), row
        lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
        lines += ["| " + " | ".join(row) + " |" for row in rows]
        text = "\n".join(lines) + f"\n\n{note} ({package()}.)\n"
        print(f"\n== {self.experiment} {name}\n{text}", flush=True)
        text_csv = io.StringIO()
        csv.writer(text_csv).writerows([columns, *rows])
        stem = f"{self.experiment}_{name}"
        write_whole(self.folder / f"{stem}.md", text.encode())
        write_whole(self.folder / f"{stem}.csv", text_csv.getvalue().encode())
        if not self.quick:
            replace_in_docs(stem, text)

    def plot(
        self, name: str, draw, size: tuple[float, float] = (6.5, 3.6), keep: bool = True
    ) -> None:
        """`draw(figure)` fills a figure of that many inches; `keep`: in the docs, too.

        Of real data nothing is kept there, not even a plot.
        """
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot

        figure = pyplot.figure(figsize=size, layout="constrained")
        draw(figure)
        data = io.BytesIO()
        figure.savefig(data, format="png", dpi=80, metadata={"Software": None})
        pyplot.close(figure)
        stem = f"{self.experiment}_{name}.png"
        write_whole(self.folder / stem, data.getvalue())
        if keep and not self.quick:
            write_whole(PLOTS / stem, data.getvalue())


def replace_in_docs(name: str, text: str, docs: Path = DOCS) -> None:
    """Puts a table between its markers; they must be there, once."""
    begin, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
    page = docs.read_text()
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    if len(pattern.findall(page)) != 1:
        raise SystemExit(f"{docs}: expected one place between {begin.strip()} and {end}")
    write_whole(docs, pattern.sub(lambda _: begin + text + end, page).encode())
