"""Depth from files and from the road plane."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from xcalib import CalibrationOptions, calibrate, synthetic
from xcalib._core import fit_plane
from xcalib.depth import DepthUnits, PlaneDepth, open_depth, read_depth
from xcalib.frames import Image, InputError, write_image

REFERENCE = np.zeros((480, 640), np.uint8)


def save(path: Path, depth: Image) -> Path:
    if path.suffix == ".npy":
        np.save(path, depth)
    else:
        write_image(path, depth)
    return path


def test_png_counts_are_1_256_m(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", np.array([[0, 256, 2560]], np.uint16))
    np.testing.assert_array_equal(read_depth(path), [[0, 1, 10]])
    millimetres = DepthUnits(scale=0.001)
    np.testing.assert_allclose(read_depth(path, millimetres), [[0, 0.256, 2.56]], rtol=1e-6)


@pytest.mark.parametrize("suffix", [".npy", ".tiff"])
def test_only_positive_finite_metres_are_known(tmp_path: Path, suffix: str) -> None:
    values = np.array([[np.nan, np.inf, -np.inf, -1, 0, 7.5]], np.float32)
    depth = read_depth(save(tmp_path / f"a{suffix}", values))
    assert depth.dtype == np.float32
    np.testing.assert_array_equal(depth, [[0, 0, 0, 0, 0, 7.5]])


@pytest.mark.parametrize(
    ("name", "values", "problem"),
    [
        ("a.png", np.zeros((3, 4), np.uint16), "all depth is unknown"),
        ("a.npy", np.full((3, 4), np.nan), "all depth is unknown"),
        ("a.tiff", np.full((3, 4), np.inf, np.float32), "all depth is unknown"),
        ("a.png", np.ones((3, 4), np.uint8), "expected a 16-bit PNG"),
        ("a.npy", np.ones((3, 4), np.int32), "expected floats in metres"),
        ("a.npy", np.ones((3, 4, 2), np.float32), r"shape \(3, 4, 2\), expected one channel"),
        ("a.png", np.ones((3, 4, 3), np.uint16), r"shape \(3, 4, 3\), expected one channel"),
    ],
)
def test_bad_depth_is_named(tmp_path: Path, name: str, values: Image, problem: str) -> None:
    with pytest.raises(InputError, match=f"{name}.*{problem}"):
        read_depth(save(tmp_path / name, values))


def test_truncated_npy_is_named(tmp_path: Path) -> None:
    path = save(tmp_path / "a.npy", np.ones((30, 40), np.float32))
    path.write_bytes(path.read_bytes()[:-8])
    with pytest.raises(InputError, match=r"a\.npy: cannot decode"):
        read_depth(path)


@pytest.mark.skipif(cv2.haveImageWriter("a.exr"), reason="this OpenCV reads EXR")
def test_missing_exr_support_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    (tmp_path / "a.exr").write_bytes(b"v/1\x01\x02\x00\x00\x00")
    with pytest.raises(InputError, match=r"a\.exr.*without OpenEXR"):
        read_depth(tmp_path / "a.exr")


def test_folder_is_paired_by_name_and_any_size_of_the_aspect_does(tmp_path: Path) -> None:
    for name, metres in (("2", 2.0), ("10", 10.0)):
        save(tmp_path / f"{name}.npy", np.full((120, 160), metres))
    depth = open_depth(tmp_path, [Path("v/2.png"), Path("v/10.png")])
    assert depth(0, REFERENCE).max() == 2
    assert depth(1, REFERENCE).shape == (120, 160)
    assert depth(1, REFERENCE).max() == 10


def test_wrong_aspect_is_named(tmp_path: Path) -> None:
    save(tmp_path / "1.npy", np.ones((120, 170)))
    depth = open_depth(tmp_path, [Path("v/1.png")])
    with pytest.raises(InputError, match=r"1\.npy: depth is 170x120.*reference image is 640x480"):
        depth(0, REFERENCE)


@pytest.mark.parametrize(
    ("spec", "problem"),
    [("nothing", "expected an existing folder"), ("model.onnx", "no such file")],
)
def test_only_folders_networks_and_plane_are_depth(spec: str, problem: str) -> None:
    with pytest.raises(InputError, match=f"depth {spec}: {problem}"):
        open_depth(spec, [Path("v/1.png")])


def test_plane_by_hand() -> None:
    plane = PlaneDepth(camera_height=2.0, horizon=0.25, far=50.0, hfov_deg=90.0)
    depth = plane(0, REFERENCE)
    # fx = fy = 320 px; the horizon is the edge between rows 119 and 120.
    assert depth.shape == (480, 640)
    assert depth.dtype == np.float32
    np.testing.assert_array_equal(depth[:120], 50)
    assert depth[479, 7] == pytest.approx(2 * 320 / (479 - 119.5))
    assert depth[130, 0] == 50
    assert depth[140, 0] == pytest.approx(2 * 320 / 20.5)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("camera_height", 0.0),
        ("horizon", 1.0),
        ("far", -1.0),
        ("far", math.inf),
        ("hfov_deg", 180.0),
        ("hfov_deg", math.nan),
    ],
)
def test_plane_options_have_ranges(name: str, value: float) -> None:
    with pytest.raises(InputError, match=f"plane {name} is {value:g}, expected"):
        PlaneDepth(**{name: value})


def test_a_rolled_plane_has_a_falling_horizon() -> None:
    plane = PlaneDepth(camera_height=2.0, horizon=0.5, far=500.0, roll_deg=10.0)
    depth = plane(0, REFERENCE)
    level = PlaneDepth(camera_height=2.0, horizon=0.5, far=500.0)(0, REFERENCE)
    # The right side of a row lies less far below the horizon, and so is farther.
    assert depth[400, 600] > level[400, 600] > depth[400, 40]
    # Along the horizon, which falls by tan(10 deg), depth is the same.
    down = round(200 * math.tan(math.radians(10.0)))
    assert depth[400 + down, 520] == pytest.approx(depth[400, 320], rel=0.02)


def test_the_plane_is_found_from_the_footage() -> None:
    rig = synthetic.demo_rig()
    rig = rig.resized(320, 240, 214, 171)
    frames = list(synthetic.render(rig, num_frames=4, seed=3))
    references, sources = [f.reference for f in frames], [f.source for f in frames]
    hfov = rig.reference.hfov_deg
    wrong = PlaneDepth(horizon=0.58, far=60.0, hfov_deg=hfov)
    options = CalibrationOptions(reference_camera=rig.reference)
    start = calibrate(references, sources, [wrong(0, r) for r in references], None, options).rig
    fits = 0

    def count() -> None:
        nonlocal fits
        fits += 1

    found = fit_plane(references, sources, wrong, start, options, count)
    assert fits > 5
    assert (found.camera_height, found.far, found.hfov_deg) == (1.6, 60.0, hfov)

    def error(plane: PlaneDepth) -> float:
        """Of inverse depth against the rendered street, where it is known [1/m]."""
        off = [1 / plane(0, f.reference)[f.depth > 0] - 1 / f.depth[f.depth > 0] for f in frames]
        return float(np.abs(np.concatenate(off)).mean())

    assert error(found) < 0.75 * error(wrong)
