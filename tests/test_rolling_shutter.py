"""Sources read row by row by a camera that pans: straightened, and their readout found."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import Result
from numpy.typing import NDArray

from conftest import Process
from xcalib import Pinhole, Rig
from xcalib.frames import read_image, write_image

WIDTH, HEIGHT, FRAMES, SHARE = 200, 150, 12, 0.6
FAR = "100"


def pan(time: float) -> float:
    """Columns that the view has moved by, unevenly."""
    return 7 * time + 5 * np.sin(0.6 * time)


def scenery() -> NDArray[np.float32]:
    """Patches and dots, wide enough for the whole pan."""
    random = np.random.default_rng(3)
    wide = np.zeros((HEIGHT, 400), np.float32)
    for _ in range(220):
        x, y, w, h = random.integers((0, 0, 6, 6), (400, HEIGHT, 40, 40))
        wide[y : y + h, x : x + w] = random.uniform(0, 255)
    return cv2.GaussianBlur(wide, (0, 0), 1.2)


def view(wide: NDArray[np.float32], index: int, share: float) -> NDArray[np.uint8]:
    """A frame whose rows are read over a share of the time to the next one."""
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(np.float32)
    moved = np.array([pan(index + share * row / (HEIGHT - 1)) for row in range(HEIGHT)])
    image = cv2.remap(wide, x + moved[:, None].astype(np.float32), y, cv2.INTER_CUBIC)
    return np.clip(image, 0, 255).astype(np.uint8)


@pytest.fixture(scope="session")
def panned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with visible, read at once, thermal, row by row, and true, at once; and rig.yaml."""
    folder = tmp_path_factory.mktemp("panned")
    wide = scenery()
    for index in range(FRAMES):
        name = f"{index:04d}.png"
        write_image(folder / "visible" / name, view(wide, index, 0))
        write_image(folder / "thermal" / name, 255 - view(wide, index, SHARE))
        write_image(folder / "true" / name, 255 - view(wide, index, 0))
    camera = Pinhole.from_hfov(WIDTH, HEIGHT, np.deg2rad(50))
    Rig(camera, camera).save(folder / "rig.yaml")
    return folder


def off(images: Path, panned: Path) -> float:
    """Mean difference of images from those that are read at once."""
    return float(
        np.mean(
            [
                np.abs(read_image(images / true.name).astype(float) - read_image(true))[
                    :, 10 : WIDTH - 30
                ].mean()
                for true in sorted((panned / "true").iterdir())
            ]
        )
    )


def test_registered_rows_are_those_of_one_moment(
    panned: Path, tmp_path: Path, both: Callable[..., tuple[Process, Result]]
) -> None:
    footage = panned / "rig.yaml", panned / "visible", panned / "thermal", "--depth", FAR
    both("register", *footage, "--source-readout", SHARE, "-o", tmp_path / "OUT")
    as_read = off(panned / "thermal", panned)
    for name in ("c", "p"):
        assert off(tmp_path / name, panned) < 0.35 * as_read


def test_the_journal_knows_the_readout(
    panned: Path, tmp_path: Path, both: Callable[..., tuple[Process, Result]]
) -> None:
    footage = panned / "rig.yaml", panned / "visible", panned / "thermal", "--depth", FAR
    both("register", *footage, "-o", tmp_path / "OUT")
    for result in both("register", *footage, "--source-readout", "0.5", "-o", tmp_path / "OUT"):
        assert "readout" in result.stderr


@pytest.mark.parametrize(("source", "seen"), [("thermal", True), ("true", False)])
def test_a_readout_is_found(
    source: str,
    seen: bool,
    panned: Path,
    tmp_path: Path,
    both: Callable[..., tuple[Process, Result]],
) -> None:
    footage = panned / "visible", panned / source, "--depth", FAR
    start = "--initial", panned / "rig.yaml", "--search", "off", "--source-lens", "none"
    results = both(
        *("calibrate", *footage, *start, "--source-readout", "auto", "-o", tmp_path / "OUT.yaml")
    )
    for result in results:
        assert "rolling shutter: " in result.stdout
        if not seen:
            assert "no rolling shutter of the source is seen" in result.stdout
            continue
        share = float(result.stdout.split("give --source-readout ")[1].split()[0])
        assert abs(share - SHARE) < 0.15
