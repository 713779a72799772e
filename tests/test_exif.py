"""Image files that say how their picture is to be turned: pixels are taken as stored, and it is
said."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from conftest import Process, run
from xcalib.footage import Matching, open_pairs
from xcalib.frames import Image, list_files, read_image, write_image

TURN = 6
"""To be turned by 90 deg clockwise."""


def entry(orientation: int) -> bytes:
    """A TIFF with nothing but an orientation, as EXIF has it."""
    return struct.pack("<4sIHHHIHHI", b"II*\0", 8, 1, 274, 3, 1, orientation, 0, 0)


def write_jpeg(path: Path, image: Image, orientation: int) -> None:
    data = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 100])[1].tobytes()
    exif = b"Exif\0\0" + entry(orientation)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + data[2:])


def write_tiff(path: Path, image: Image, orientation: int) -> None:
    """One strip of one channel, as cameras write it."""
    height, width = image.shape
    pixels = image.tobytes()
    tags = {
        **{256: width, 257: height, 258: 8 * image.itemsize, 259: 1, 262: 1, 273: 8},
        **{274: orientation, 277: 1, 278: height, 279: len(pixels)},
        339: 3 if image.dtype == np.float32 else 1,
    }
    entries = b"".join(struct.pack("<HHII", tag, 4, 1, value) for tag, value in tags.items())
    head = struct.pack("<4sI", b"II*\0", 8 + len(pixels))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(head + pixels + struct.pack("<H", len(tags)) + entries + bytes(4))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_pixels_of_a_tiff_come_as_they_are_stored(tmp_path: Path, dtype: type) -> None:
    """OpenCV turns them, whatever it is told."""
    image = np.arange(40 * 60).reshape(40, 60).astype(dtype)
    for orientation in range(1, 9):
        path = tmp_path / f"{orientation}.tiff"
        write_tiff(path, image, orientation)
        np.testing.assert_array_equal(read_image(path), image)


def test_pictures_are_turned_on_request(tmp_path: Path) -> None:
    image = np.arange(40 * 60, dtype=np.uint16).reshape(40, 60)
    for name in ("v", "t"):
        write_tiff(tmp_path / name / "0.tiff", image, TURN)
    as_stored = open_pairs(tmp_path / "v", tmp_path / "t")
    np.testing.assert_array_equal(as_stored.sources[0], image)
    turned = open_pairs(tmp_path / "v", tmp_path / "t", Matching(exif_orientation="apply"))
    for stream in (turned.references, turned.sources):
        np.testing.assert_array_equal(stream[0], np.rot90(image, -1))
    assert turned.pairing.method == "name"


@pytest.fixture
def turned(rendered: Path, tmp_path: Path) -> Path:
    """The rendered frames with sources that are stored turned, and say so."""
    for path in list_files(rendered / "visible"):
        write_image(tmp_path / "visible" / path.name, read_image(path))
    for path in list_files(rendered / "thermal"):
        stored = np.rot90(read_image(path), 1)
        write_jpeg(tmp_path / "thermal" / f"{path.stem}.jpg", np.ascontiguousarray(stored), TURN)
    return tmp_path


def given(rendered: Path, folder: Path) -> tuple[str, ...]:
    footage = folder / "visible", folder / "thermal", "--depth", rendered / "depth"
    return tuple(map(str, ("evaluate", rendered / "rig.yaml", *footage)))


SAID = (
    "000000.jpg says that its picture is to be turned by 90 deg clockwise; pixels are taken as they"
    " are stored (--exif-orientation apply turns them)\n"
)


def test_both_commands_say_it_and_turn_on_request(
    rendered: Path, turned: Path, cli: Callable[..., Process]
) -> None:
    arguments = given(rendered, turned)
    ours, theirs = cli(*arguments), run(*arguments)
    for stderr in (ours.stderr, theirs.stderr):
        assert SAID in stderr and stderr.count("000000.jpg says") == 1
        assert "fit" in stderr.splitlines()[-1] or "expected" in stderr.splitlines()[-1]
    assert ours.returncode == theirs.exit_code == 2  # portrait sources do not fit the rig
    arguments += ("--exif-orientation", "apply")
    ours, theirs = cli(*arguments), run(*arguments)
    assert ours.returncode == theirs.exit_code == 0, theirs.output
    for stderr in (ours.stderr, theirs.stderr):
        assert "which is done; depth must be that of the turned picture" in stderr


def test_footage_that_says_nothing_is_not_talked_about(rendered: Path) -> None:
    result = run(*given(rendered, rendered))
    assert result.exit_code == 0 and "picture" not in result.stderr
