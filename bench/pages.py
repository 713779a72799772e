"""Tables in Markdown, and the marked places of a page of docs/ that they are written to."""

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path


def write_whole(path: Path, data: str | bytes) -> None:
    """A reader sees the file as it was or as it is now, never a part of it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(path.name + ".part")
    beside.write_bytes(data.encode() if isinstance(data, str) else data)
    os.replace(beside, path)


def table(columns: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Raises ValueError where a row has more or fewer cells than there are columns."""

    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    lines = [line(columns), "|" + "---|" * len(columns)]
    for row in rows:
        if len(row) != len(columns):
            raise ValueError(f"a row has {len(row)} cells, expected {len(columns)}: {row}")
        lines.append(line(row))
    return "\n".join(lines) + "\n"


def marked(page: Path) -> set[str]:
    """Names of the places of a page that begin with <!-- NAME -->."""
    return set(re.findall(r"<!-- (\w+) -->", page.read_text()))


def replace_marked(page: Path, name: str, text: str) -> None:
    """Puts `text` between <!-- NAME --> and <!-- /NAME -->; exits unless both are there, once."""
    begin, end = f"<!-- {name} -->\n", f"<!-- /{name} -->"
    before = page.read_text()
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    if len(pattern.findall(before)) != 1:
        raise SystemExit(f"{page}: expected one place between {begin.strip()} and {end}")
    write_whole(page, pattern.sub(lambda _: begin + text + end, before))
