"""Progress on stderr: a bar on a terminal, elsewhere a line every few seconds."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

from tqdm import tqdm

T = TypeVar("T")

EVERY = 10.0
"""Time between lines [s]."""


class Lines:
    """A line now and then, where there is no terminal for a bar."""

    def __init__(self, quiet: bool = False) -> None:
        self._on = not quiet and not sys.stderr.isatty()
        self._said = time.perf_counter()

    def say(self, what: str, how_far: str) -> None:
        """Print how far it is, if it is time to."""
        if self._on and time.perf_counter() - self._said > EVERY:
            self._said = time.perf_counter()
            print(f"{what}: {how_far}", file=sys.stderr, flush=True)


def progress(items: Iterable[T], total: int, what: str, quiet: bool = False) -> Iterator[T]:
    """The items, with a bar on stderr or a line now and then."""
    lines = Lines(quiet)
    bar: Iterable[T] = tqdm(
        items, total=total, desc=what, unit="frame", disable=True if quiet else None, leave=False
    )
    for done, item in enumerate(bar):
        lines.say(what, f"{100 * done // max(total, 1)} %")
        yield item


@contextlib.contextmanager
def stages_bar(quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """A function that shows a stage and the share of it that is done."""
    lines = Lines(quiet)
    with tqdm(
        total=1.0,
        bar_format="{desc} {percentage:3.0f}%|{bar}| {elapsed}",
        disable=True if quiet else None,
        leave=False,
    ) as bar:

        def show(stage: str, fraction: float) -> None:
            bar.set_description_str(stage, refresh=False)
            bar.update(fraction - bar.n)
            lines.say(stage, f"{int(100 * fraction)} %")

        yield show
