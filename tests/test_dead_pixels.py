"""Pixels that are not finite, from the files to the rig and to the registered frames."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from conftest import run
from xcalib import CalibrationOptions, Registrar, Rig, calibrate
from xcalib.depth.files import read_depth
from xcalib.frames import Image, list_files, read_image, write_image

DEAD = [(5, 7), (60, 80), (61, 80), (100, 33)]


def spoiled(image: Image) -> Image:
    """As a radiometric camera gives it, with dead pixels and a hole."""
    counts = image.astype(np.float32) + 280
    for y, x in DEAD:
        counts[y, x] = np.nan if x % 2 else np.inf
    counts[20:26, 20:28] = np.nan
    return counts


def test_calibration_leaves_them_out(rendered: Path) -> None:
    references, sources, depths = (
        [read(path) for path in list_files(rendered / kind)]
        for kind, read in (("visible", read_image), ("thermal", read_image), ("depth", read_depth))
    )
    truth, options = Rig.load(rendered / "rig.yaml"), CalibrationOptions(max_frames=4)
    maps = []
    for images in (sources, [spoiled(image) for image in sources]):
        result = calibrate(references, images, depths, truth, options)
        maps.append(Registrar(result.rig).map(depths[0]))
    apart = np.linalg.norm(maps[0] - maps[1], axis=-1)
    assert np.nanmedian(apart) < 0.2


def test_registered_frames_mark_them(scene: Path, tmp_path: Path) -> None:
    for path in list_files(scene / "thermal"):
        write_image(path.with_suffix(".tiff"), spoiled(read_image(path)))
        path.unlink()
    given = ("register", scene / "rig.yaml", scene / "visible", scene / "thermal")
    result = run(*given, "--depth", scene / "depth", "-o", tmp_path / "out")
    assert result.exit_code == 0
    count = len(list_files(scene / "thermal")) * (len(DEAD) + 6 * 8)
    assert f"{count} source pixels are not finite, masked" in result.stdout
    for path in list_files(tmp_path / "out"):
        image, mask = read_image(path), read_image(tmp_path / "out" / "masks" / f"{path.stem}.png")
        assert np.isfinite(image).all()
        assert not image[mask == 1].any() and (image[mask == 0] > 200).all()
