"""Where an experiment's tables and plots go: a folder, and the marked places of docs/results.md."""

import csv
import io
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import pages
from common import ROOT, cpu, git

T = TypeVar("T")

DOCS = ROOT / "docs" / "results.md"
PLOTS = ROOT / "docs" / "images" / "results"


def machine_and_package() -> str:
    """The machine, and the last commit of what is measured."""
    commit = git("log", "-1", "--format=%h", "--", "cpp", "python")
    return f"{cpu()}; package as of commit {commit or 'unknown'}"


@dataclass(frozen=True)
class Results:
    folder: Path
    experiment: str
    tables: list[str]
    """All that the experiment writes."""
    quick: bool
    deadline: float = float("inf")
    """By `time.perf_counter`: no further rig is begun after it."""

    def in_time(self, rigs: Iterable[T]) -> Iterator[T]:
        """The rigs until time is up; at least one."""
        for done, rig in enumerate(rigs):
            if done and time.perf_counter() > self.deadline:
                print(f"stopped after {done}: time is up")
                return
            yield rig

    def of(self, full, quick):
        """The first, or the second in a quick run."""
        return quick if self.quick else full

    def table(self, name: str, columns: list[str], rows: list[list[str]], note: str) -> None:
        """Prints and keeps a table; `note` says what it rests on."""
        if name not in self.tables:
            raise ValueError(f"table {name} of experiment {self.experiment}: not in EXPERIMENTS")
        text = f"{pages.table(columns, rows)}\n{note} ({machine_and_package()}.)\n"
        print(f"\n== {self.experiment} {name}\n{text}", flush=True)
        text_csv = io.StringIO()
        csv.writer(text_csv).writerows([columns, *rows])
        stem = f"{self.experiment}_{name}"
        pages.write_whole(self.folder / f"{stem}.md", text)
        pages.write_whole(self.folder / f"{stem}.csv", text_csv.getvalue())
        if not self.quick:
            pages.replace_marked(DOCS, stem, text)

    def plot(
        self, name: str, draw, size: tuple[float, float] = (6.5, 3.6), keep: bool = True
    ) -> None:
        """`draw(figure)` fills a figure of that many inches; `keep`: in the docs, too.

        Plots of real data are never kept there.
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
        pages.write_whole(self.folder / stem, data.getvalue())
        if keep and not self.quick:
            pages.write_whole(PLOTS / stem, data.getvalue())
