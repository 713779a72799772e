"""Bags as people record them: other encodings, split ones, camera_info of a part of the sensor."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from bags import write_bag
from xcalib.footage import open_stream
from xcalib.footage.bag import CameraInfo, _on_its_image, _unpacked, is_rectified
from xcalib.frames import DecodeError, InputError

Array = NDArray[Any]
HEIGHT, WIDTH = 24, 32


def message(encoding: str, data: Array, step: int) -> SimpleNamespace:
    return SimpleNamespace(
        encoding=encoding,
        width=WIDTH,
        height=HEIGHT,
        step=step,
        is_bigendian=False,
        data=np.ascontiguousarray(data).view(np.uint8).ravel(),
    )


def smooth_colour() -> Array:
    noise = np.random.default_rng(0).integers(0, 255, (HEIGHT, WIDTH, 3), np.uint8)
    return cv2.GaussianBlur(noise, (0, 0), 4)


def packed_yuv(colour: Array, order: tuple[int, ...]) -> Array:
    """Pairs of pixels with one U and V: bytes Y0 U Y1 V in another order."""
    yuv = cv2.cvtColor(colour, cv2.COLOR_BGR2YUV)
    parts = (yuv[:, ::2, 0], yuv[:, ::2, 1], yuv[:, 1::2, 0], yuv[:, ::2, 2])
    return np.stack([parts[index] for index in order], axis=-1).reshape(HEIGHT, 2 * WIDTH)


@pytest.mark.parametrize("encoding", ["yuyv", "uyvy", "nv21"])
def test_yuv_becomes_colour(encoding: str) -> None:
    colour = smooth_colour()
    if encoding == "nv21":
        planar = cv2.cvtColor(colour, cv2.COLOR_BGR2YUV_I420)
        u, v = planar[HEIGHT:].reshape(2, -1)
        data = np.concatenate([planar[:HEIGHT].ravel(), np.stack([v, u], axis=-1).ravel()])
        step = WIDTH
    else:
        data = packed_yuv(colour, (0, 1, 2, 3) if encoding == "yuyv" else (1, 0, 3, 2))
        step = 2 * WIDTH
    found = _unpacked(message(encoding, data, step), "m")
    assert np.abs(found.astype(int) - colour).mean() < 6
    with pytest.raises(DecodeError, match="are no 32x24"):
        _unpacked(message(encoding, data.ravel()[:-8], step), "m")


def test_signed_counts_and_a_fourth_channel() -> None:
    counts = np.arange(-300, HEIGHT * WIDTH - 300).reshape(HEIGHT, WIDTH).astype(np.int16)
    found = _unpacked(message("16SC1", counts, 2 * WIDTH), "m")
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, counts)
    four = np.dstack([smooth_colour(), np.full((HEIGHT, WIDTH), 9, np.uint8)])
    np.testing.assert_array_equal(_unpacked(message("8UC4", four, 4 * WIDTH), "m"), four[..., :3])


def test_the_parts_of_a_bag_are_one(tmp_path: Path) -> None:
    images = [np.full((HEIGHT, WIDTH), 9 * i, np.uint8) for i in range(3)]
    for part in range(2):
        write_bag(tmp_path / f"drive_{part}.bag", "ros1", {"/a//image": ("mono8", images)})
    for spec in (f"{tmp_path}/drive_*.bag#/a/image", f"{tmp_path}#/a//image", str(tmp_path)):
        assert len(open_stream(spec)) == 6


@pytest.mark.parametrize(
    ("name", "tool"), [("a.bag", "rosbag reindex"), ("a.mcap", "mcap recover")]
)
def test_a_damaged_bag_names_what_repairs_it(tmp_path: Path, name: str, tool: str) -> None:
    pytest.importorskip("rosbags")
    (tmp_path / name).write_bytes(b"#ROSBAG V2.0\n" + bytes(99))
    with pytest.raises(InputError, match=f"not a readable bag.*`{tool}`"):
        open_stream(tmp_path / name)


def test_camera_info_is_brought_to_the_image() -> None:
    roi = SimpleNamespace(width=400, height=200, x_offset=100, y_offset=50)
    info: Any = SimpleNamespace(width=1280, height=960, binning_x=2, binning_y=0, roi=roi)
    K = np.array([[1000.0, 2, 300], [0, 900, 150], [0, 0, 1]])
    width, height, on_image = _on_its_image(info, K)
    assert (width, height) == (200, 200)
    # A point of the sensor, by its full matrix and by that of the image.
    x, y = (K @ (0.1, -0.05, 1))[:2] - (100, 50)
    expected = ((x + 0.5) / 2 - 0.5, y)
    np.testing.assert_allclose((on_image @ (0.1, -0.05, 1))[:2], expected)


def test_what_says_nothing_is_uncalibrated() -> None:
    info = CameraInfo("/c", 640, 480, np.zeros((3, 3)), "plumb_bob", np.zeros(5))
    assert info.line() == "/c: 640x480 px, uncalibrated (K is all 0)" and info.lens is None
    assert is_rectified("/c/image_rect_color") and not is_rectified("/correct/image_raw")
