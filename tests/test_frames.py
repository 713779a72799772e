"""Folders of images: order, pairing, reading, writing."""

from __future__ import annotations

import os
import re
import resource
import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from xcalib import Pinhole, Rig, _core
from xcalib.footage import ImageFiles
from xcalib.frames import (
    Image,
    InputError,
    check_file_writable,
    check_folder_writable,
    fit_rig,
    gray,
    list_files,
    overlay,
    pair,
    read_image,
    same_aspect,
    write_bytes,
    write_image,
)


def touch(folder: Path, *names: str) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).touch()
    return list_files(folder)


def noise(*shape: int) -> Image:
    return np.random.default_rng(3).integers(0, 256, shape, np.uint8)


def encoded(suffix: str, image: Image) -> bytes:
    done, data = cv2.imencode(suffix, image)
    assert done
    return data.tobytes()


# -- Order and pairing


def test_natural_order(tmp_path: Path) -> None:
    names = ["a10.png", "a2.PNG", "A1.jpeg", "b1.bmp", "b01.bmp", ".a3.png", "notes.txt"]
    (tmp_path / "folder.png").mkdir()
    found = [path.name for path in touch(tmp_path, *names)]
    assert found == ["A1.jpeg", "a2.PNG", "a10.png", "b01.bmp", "b1.bmp"]


def test_pair_by_stem_whatever_the_suffix(tmp_path: Path) -> None:
    first = touch(tmp_path / "v", "1.png", "02.png", "10.png")
    second = touch(tmp_path / "t", "10.tiff", "1.tiff", "02.tiff")
    assert [(a.name, b.name) for a, b in pair(first, second)] == [
        ("1.png", "1.tiff"),
        ("02.png", "02.tiff"),
        ("10.png", "10.tiff"),
    ]


def test_pair_by_numbers_in_the_names(tmp_path: Path) -> None:
    first = touch(tmp_path / "v", "FLIR_00007_Z.jpg", "FLIR_08863_Z.jpg")
    second = touch(tmp_path / "t", "FLIR_08863_T.jpg", "FLIR_00007_T.jpg")
    assert [(a.stem[:10], b.stem[:10]) for a, b in pair(first, second)] == [
        ("FLIR_00007", "FLIR_00007"),
        ("FLIR_08863", "FLIR_08863"),
    ]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("cam0_1.png", "cam0_2.png"), ("cam1_1.png", "cam1_2.png")),
        (("left.png", "right.png"), ("one.png", "two.png")),
        (("100.png", "200.png"), ("101.png", "201.png")),
    ],
)
def test_pair_by_order_when_no_name_agrees(
    tmp_path: Path, first: tuple[str, ...], second: tuple[str, ...]
) -> None:
    pairs = pair(touch(tmp_path / "v", *first), touch(tmp_path / "t", *second))
    assert [(a.name, b.name) for a, b in pairs] == list(zip(first, second, strict=True))


@pytest.mark.parametrize(
    ("first", "second", "named"),
    [
        (["a1.png", "a2.png", "a3.png"], ["a1.png", "a3.png", "a4.png"], ["v/a2.png", "t/a4.png"]),
        (["a1.png", "a2.png", "a3.png"], ["a1.png", "a3.png"], ["(3 files)", "(2 files)", "a2"]),
        (["v1.png", "v2.png"], ["t2.png", "t3.png"], ["v/v1.png", "t/t3.png"]),
        (["a.png", "b.png"], ["c.png"], ["v has 2 files", "t has 1"]),
        (["a.png", "a.jpg"], ["a.png", "b.png"], ["a.jpg and a.png"]),
        (
            [f"{i}.png" for i in range(9)],
            ["0.png", "x.png"],
            ["v/1.png, v/2.png, v/3.png and 6 more"],
        ),
    ],
)
def test_pair_refuses_what_does_not_match(
    tmp_path: Path, first: list[str], second: list[str], named: list[str]
) -> None:
    paths = touch(tmp_path / "v", *first), touch(tmp_path / "t", *second)
    with pytest.raises(InputError) as error:
        pair(*paths)
    message = str(error.value)
    assert str(tmp_path / "v") in message
    for text in named:
        assert text in message


def test_bad_folders_are_named(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "file").touch()
    for name, problem in (("none", "no such folder"), ("empty", "empty"), ("file", "is a file")):
        with pytest.raises(InputError, match=f"{name}.*{problem}"):
            list_files(tmp_path / name)


# -- Reading and writing


@pytest.mark.parametrize(
    ("suffix", "dtype", "shape"),
    [
        (".png", np.uint8, (5, 7)),
        (".png", np.uint16, (5, 7)),
        (".png", np.uint8, (5, 7, 3)),
        (".png", np.uint16, (5, 7, 3)),
        (".bmp", np.uint8, (5, 7, 3)),
        (".tiff", np.uint16, (5, 7)),
        (".tiff", np.float32, (5, 7)),
        (".tiff", np.float32, (5, 7, 3)),
    ],
)
def test_written_images_read_back(
    tmp_path: Path, suffix: str, dtype: type, shape: tuple[int, ...]
) -> None:
    image: Image = (noise(*shape) * np.float64(200.5 if dtype != np.uint8 else 1)).astype(dtype)
    write_image(tmp_path / "made" / f"image{suffix}", image)
    back = read_image(tmp_path / "made" / f"image{suffix}")
    assert back.dtype == dtype
    np.testing.assert_array_equal(back, image)
    assert os.listdir(tmp_path / "made") == [f"image{suffix}"]


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_sizes_come_from_headers(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    write_image(path, noise(5, 7, 3))
    assert _core.header_size(path) == (7, 5)
    data = path.read_bytes()
    for count in (0, 10, 23):
        path.write_bytes(data[:count])
        assert _core.header_size(path) is None
    write_image(tmp_path / "a.tiff", noise(5, 7))
    assert _core.header_size(tmp_path / "a.tiff") is None


def test_alpha_is_dropped(tmp_path: Path) -> None:
    image = noise(5, 7, 4)
    (tmp_path / "a.png").write_bytes(encoded(".png", image))
    np.testing.assert_array_equal(read_image(tmp_path / "a.png"), image[..., :3])


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("said", [1, 2, None], ids=["unsigned", "signed", "unsaid"])
def test_32_bit_counts_become_floats(tmp_path: Path, order: str, said: int | None) -> None:
    counts = np.array([[0, 7, 70000], [1 << 24, 3 << 30, 5]], np.uint32)
    if said == 2:
        counts = counts.astype(np.int32)
    path = tmp_path / "a.tiff"
    values = {256: 3, 257: 2, 258: 32, 259: 1, 262: 1, 273: 200, 277: 1, 278: 2, 279: 24}
    if said is not None:
        values[339] = said
    fields = [
        struct.pack(f"{order}HHIHH", tag, 3, 1, value, 0) for tag, value in sorted(values.items())
    ]
    head = (b"II" if order == "<" else b"MM") + struct.pack(f"{order}HIH", 42, 8, len(fields))
    data = (head + b"".join(fields) + bytes(4)).ljust(200, b"\0")
    path.write_bytes(data + counts.astype(f"{order}i4").tobytes())
    image = read_image(path)
    assert image.dtype == np.float32
    np.testing.assert_array_equal(image, counts.astype(np.float32))


@pytest.mark.parametrize("suffix", [".png", ".jpg", ".tiff", ".bmp"])
@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.9, 0.9999])
def test_truncated_images_are_refused(tmp_path: Path, suffix: str, share: float) -> None:
    data = encoded(suffix, cv2.GaussianBlur(noise(60, 80, 3), (0, 0), 2))
    path = tmp_path / f"cut{suffix}"
    path.write_bytes(data[: int(share * len(data))])
    with pytest.raises(InputError, match=rf"cut\{suffix}: cannot decode"):
        read_image(path)


def test_text_is_no_image(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("not an image")
    with pytest.raises(InputError, match=r"a\.png: cannot decode"):
        read_image(tmp_path / "a.png")


def test_jpeg_with_thumbnail_is_truncated_only_if_its_own_end_is_missing(tmp_path: Path) -> None:
    data = encoded(".jpg", noise(60, 80))
    thumbnail = encoded(".jpg", noise(6, 8))
    segment = b"\xff\xe1" + (len(thumbnail) + 2).to_bytes(2, "big") + thumbnail
    whole = data[:2] + segment + data[2:]
    path = tmp_path / "a.jpg"
    path.write_bytes(whole + b"trailing bytes of some camera")
    assert read_image(path).shape == (60, 80)
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="truncated"):
        read_image(path)


def test_images_of_a_folder_have_one_size(tmp_path: Path) -> None:
    write_image(tmp_path / "1.png", noise(5, 7))
    write_image(tmp_path / "2.png", noise(5, 8))
    images = ImageFiles(list_files(tmp_path))
    assert images[0].shape == (5, 7)
    with pytest.raises(InputError, match=r"2\.png is 8x5, expected 7x5 as 1\.png"):
        images[1]


def test_a_failed_write_leaves_the_old_file(tmp_path: Path) -> None:
    """A limit on the size of files stands for a full disk."""
    path = tmp_path / "a.txt"
    write_bytes(path, b"old")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        with pytest.raises(OSError, match="large") as caught:
            write_bytes(path, bytes(1000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert caught.value.filename == str(path)
    assert path.read_bytes() == b"old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_writability_is_known_before_and_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    check_folder_writable(tmp_path / "new" / "deep")
    check_file_writable(tmp_path / "new" / "rig.yaml")
    for folder in (tmp_path / "file", tmp_path / "file" / "out", Path("/proc/none/out")):
        with pytest.raises(InputError, match=re.escape(f"cannot write to {folder}")):
            check_folder_writable(folder)
    with pytest.raises(InputError, match="expected a file name"):
        check_file_writable(tmp_path)
    assert os.listdir(tmp_path) == ["file"]


# -- Sizes and gray


def test_aspect_may_be_off_by_rounding_only() -> None:
    assert same_aspect((583, 473), (1166, 946))
    assert same_aspect((97, 79), (1166, 946))
    assert not same_aspect((579, 477), (1166, 946))


def test_rig_is_fitted_to_the_images_or_refused() -> None:
    rig = Rig(Pinhole.from_hfov(640, 480, 60), Pinhole.from_hfov(320, 256, 50))
    assert repr(fit_rig(rig, (640, 480), (320, 256))) == repr(rig)
    half = fit_rig(rig, (320, 240), (320, 256))
    assert (half.reference.width, half.reference.height) == (320, 240)
    assert half.reference.fx == pytest.approx(rig.reference.fx / 2)
    assert half.reference.cx == pytest.approx(159.5)
    assert half.source.fx == rig.source.fx
    with pytest.raises(InputError, match=r"source images are 300x256.*320x256"):
        fit_rig(rig, (640, 480), (300, 256))


def test_gray_spans_zero_to_one() -> None:
    assert gray(np.full((2, 2), 255, np.uint8)).max() == 1
    assert gray(np.full((2, 2, 3), 65535, np.uint16)).max() == pytest.approx(1)
    values = np.array([[-1, 300]], np.float32)
    np.testing.assert_array_equal(gray(values), values)


def test_overlay_is_red_where_only_the_reference_is_bright() -> None:
    left = np.zeros((4, 4), np.uint8)
    left[:, :2] = np.arange(200, 208).reshape(4, 2)
    right = left[:, ::-1]
    picture = overlay(left, right)
    assert picture.shape == (4, 4, 3)
    blue, green, red = picture[-1, 1]
    assert red > 200 and blue == green == 0
    blue, green, red = picture[-1, 2]
    assert blue == green > 200 and red == 0
    # What is not valid is no difference: the reference is shown there, in gray.
    picture = overlay(left, right, np.full(left.shape, 3, np.uint8))
    assert (picture == picture[..., 2:]).all()
