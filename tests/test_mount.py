"""Sources that are mounted turned, or look into a mirror, on rendered footage."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import xcalib
from xcalib.synthetic import Street, random_rig

FRAMES = 6


@pytest.fixture(scope="module")
def footage() -> tuple[xcalib.Rig, list[NDArray], list[NDArray], list[NDArray]]:
    rig = random_rig(
        seed=3,
        max_offset=0.1,
        hfov_deg=(45, 60),
        fov_ratio=(0.9, 1.1),
        max_baseline=0.2,
        width=240,
        height=180,
        source_width=240,
        source_height=192,
    )
    street = Street(rig, num_frames=FRAMES, seed=3)
    frames = [street.frame(i) for i in range(FRAMES)]
    return rig, [f.reference for f in frames], [f.source for f in frames], [f.depth for f in frames]


def turned_180(image: NDArray) -> NDArray:
    return cv2.rotate(image, cv2.ROTATE_180)


def turned_90(image: NDArray) -> NDArray:
    return cv2.rotate(image, cv2.ROTATE_90_CLOCKWISE)


def mirrored(image: NDArray) -> NDArray:
    return cv2.flip(image, 1)


# How the source image is changed, what is said, and where a pixel (x, y) of w x h goes.
MOUNTS = {
    "turned by 90 deg clockwise": (turned_90, lambda x, y, w, h: (h - 1 - y, x)),
    "mirrored": (mirrored, lambda x, y, w, h: (w - 1 - x, y)),
}


@pytest.mark.parametrize("words", MOUNTS)
def test_a_mount_is_found_and_said(words: str, footage, tmp_path) -> None:
    truth, references, sources, depths = footage
    change, moved = MOUNTS[words]
    result = xcalib.calibrate(references, [change(s) for s in sources], depths)
    assert result.converged, result.report.message
    head, tail = words[:9], words[-9:]
    assert result.rig.mount.startswith(head)
    assert result.rig.mount.endswith(tail)
    assert result.rig.mount in result.report.message
    assert result.rig.source_mirrored == (words == "mirrored")
    result.rig.save(tmp_path / "rig.yaml")
    found = xcalib.Registrar(xcalib.Rig.load(tmp_path / "rig.yaml")).map(depths[3])
    u, v = np.moveaxis(xcalib.Registrar(truth).map(depths[3]), -1, 0)
    expected = np.stack(moved(u, v, truth.source.width, truth.source.height), -1)
    error = np.linalg.norm(found - expected, axis=-1)
    assert np.nanmedian(error) < 0.3
    assert np.isfinite(error).mean() > 0.3


def test_a_given_mount_is_the_only_one_looked_for(footage) -> None:
    _, references, sources, depths = footage
    options = xcalib.CalibrationOptions(mount="180")
    result = xcalib.calibrate(references, [turned_180(s) for s in sources], depths, options=options)
    assert result.converged, result.report.message
    assert result.rig.mount == "upside down"
    upright = xcalib.CalibrationOptions(mount="upright")
    refused = xcalib.calibrate(
        references, [turned_180(s) for s in sources], depths, options=upright
    )
    assert not refused.converged
    assert refused.rig.mount == "upright"
    with pytest.raises(ValueError, match="mount is 'sideways', expected auto, upright"):
        xcalib.CalibrationOptions(mount="sideways")


def test_a_mirrored_rig_is_a_start(footage) -> None:
    _, references, sources, depths = footage
    flipped = [mirrored(s) for s in sources]
    found = xcalib.calibrate(
        references, flipped, depths, options=xcalib.CalibrationOptions(mount="mirrored")
    )
    again = xcalib.calibrate(references, flipped, depths, initial=found.rig)
    assert again.converged, again.report.message
    assert again.rig.source_mirrored
    one, other = (xcalib.Registrar(rig).map(depths[0]) for rig in (found.rig, again.rig))
    assert np.nanmedian(np.linalg.norm(one - other, axis=-1)) < 0.1
