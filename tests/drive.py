"""A drive long enough to be interrupted, and what registering it wrote."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np

from xcalib.footage import open_stream
from xcalib.frames import list_files, read_image, write_image

COPIES = 20  # of the rendered frames


def write_drive(rendered: Path, folder: Path) -> None:
    """The rendered frames over and over, each with noise of its own."""
    rng = np.random.default_rng(0)
    for kind in ("visible", "thermal", "depth"):
        paths = list_files(rendered / kind)
        for index, path in enumerate(paths):
            image = read_image(path)
            for copy in range(COPIES):
                if kind == "thermal":
                    image = image // 2 + rng.integers(0, 120, image.shape, np.uint8)
                write_image(folder / kind / f"{copy * len(paths) + index:04d}.png", image)
    shutil.copy(rendered / "rig.yaml", folder)


def arguments(folder: Path, out: Path, *more: str | Path) -> tuple[str, ...]:
    given = ("register", folder / "rig.yaml", folder / "visible", folder / "thermal")
    return tuple(map(str, (*given, "--depth", folder / "depth", "-o", out, *more)))


def files_below(out: Path) -> dict[str, Path]:
    return {str(path.relative_to(out)): path for path in out.rglob("*") if path.is_file()}


def contents(out: Path) -> dict[str, bytes]:
    """All that was written, but the journals, whose lines come as threads end."""
    found = files_below(out)
    return {name: p.read_bytes() for name, p in found.items() if not name.endswith(".jsonl")}


def same_frames(first: Path, second: Path, tolerance: float = 0) -> None:
    one, two = open_stream(first), open_stream(second)
    assert len(one) == len(two)
    for index in range(len(one)):
        error = np.abs(one[index].astype(int) - two[index].astype(int)).mean()
        assert error <= tolerance, f"frame {index}"
