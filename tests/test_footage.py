"""Footage of every kind: streams, pairing by time, clock offset, and the commands on them."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from bags import write_bag
from conftest import FRAMES, run
from xcalib import Lens, Pinhole, Rig, metrics
from xcalib._core import parse_time_offset
from xcalib.depth import FolderDepth, PlaneDepth, read_depth
from xcalib.footage import (
    OffsetEstimate,
    Pairs,
    Stream,
    camera_infos,
    encoder,
    estimate_offset,
    lens_of_topic,
    match_depths,
    offsets_around,
    open_matched_depth,
    open_pairs,
    open_stream,
    pair_streams,
    pair_times,
    read_times,
    refine_offset,
)
from xcalib.frames import DecodeError, Image, InputError, list_files, read_image, write_image

Refused = Callable[..., str]


def moving(count: int, dtype: type = np.uint8, channels: int = 1) -> list[Image]:
    """Frames that differ, smooth enough for lossy codecs."""
    rng = np.random.default_rng(2)
    wide = cv2.GaussianBlur(rng.random((120, 160 + 3 * count), np.float32), (0, 0), 6)
    wide = cv2.normalize(wide, None, 0, 1, cv2.NORM_MINMAX)
    top = np.iinfo(dtype).max
    frames = [(wide[:, 3 * i : 3 * i + 160] * top).astype(dtype) for i in range(count)]
    return [np.dstack([f, f // 2, f // 3]) if channels == 3 else f for f in frames]


def write_video(path: Path, frames: list[Image], codec: str, rate: float = 20) -> Path:
    height, width = frames[0].shape[:2]
    depth = cv2.CV_16U if frames[0].dtype == np.uint16 else cv2.CV_8U
    flags = (
        *(cv2.VIDEOWRITER_PROP_IS_COLOR, int(frames[0].ndim == 3)),
        *(cv2.VIDEOWRITER_PROP_DEPTH, depth),
    )
    fourcc = cv2.VideoWriter.fourcc(*codec)
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, fourcc, rate, (width, height), flags)
    assert writer.isOpened()
    for frame in frames:
        writer.write(frame)
    writer.release()
    return path


# -- Files


def test_patterns_and_numbers(tmp_path: Path) -> None:
    for name in ("a_2", "a_10", "a_x", "b_3"):
        write_image(tmp_path / f"{name}.png", moving(1)[0])
    starred = open_stream(tmp_path / "a_*.png")
    assert [starred.name(i) for i in range(len(starred))] == ["a_2", "a_10", "a_x"]
    numbered = open_stream(tmp_path / "a_%d.png")
    assert [numbered.name(i) for i in range(len(numbered))] == ["a_2", "a_10"]
    assert [numbered[1:].name(0), len(numbered[1:])] == ["a_10", 1]
    with pytest.raises(InputError, match=r"c_\*\.png: no image file matches"):
        open_stream(tmp_path / "c_*.png")
    with pytest.raises(InputError, match="none: no such folder"):
        open_stream(tmp_path / "none")


def test_tiff_stack_keeps_16_bit(tmp_path: Path) -> None:
    frames = moving(4, np.uint16)
    cv2.imwritemulti(str(tmp_path / "s.tiff"), frames)
    stack = open_stream(tmp_path / "s.tiff")
    assert len(stack) == 4
    np.testing.assert_array_equal(stack[2], frames[2])


@pytest.mark.parametrize(
    ("names", "seconds"),
    [
        (["1699999999.123456", "1699999999.223456"], [1699999999.123456, 1699999999.223456]),
        (
            ["t_1699999999123456789", "t_1699999999223456789"],
            [1699999999.123457, 1699999999.2234567],
        ),
        (["1699999999123", "1699999999223"], [1699999999.123, 1699999999.223]),
        (["000001", "000002"], None),
        (["1699999999.2", "1699999999.1x", "1699999999.0y"], None),
    ],
)
def test_times_in_names(tmp_path: Path, names: list[str], seconds: list[float] | None) -> None:
    for name in names:
        write_image(tmp_path / f"{name}.png", moving(1)[0])
    times = open_stream(tmp_path).times
    if seconds is None or len(names) == 3:
        # The three rise in natural order: 0y, 1x, 2.
        assert (times is None) == (seconds is None and len(names) == 2)
    else:
        np.testing.assert_allclose(times, seconds, rtol=0, atol=1e-6)


def test_times_from_tables(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_image(tmp_path / f"{name}.png", moving(1)[0])
    (tmp_path / "timestamps.csv").write_text("name,timestamp\na.png, 2.5\nb.png, 2.75\n")
    np.testing.assert_array_equal(open_stream(tmp_path).times, [2.5, 2.75])
    table = tmp_path / "other.txt"
    stream = open_stream(tmp_path)
    table.write_text("# ns\na 1700000000000000000\nb 1700000000500000000\n")
    np.testing.assert_allclose(read_times(table, stream), [1.7e9, 1.7e9 + 0.5], rtol=0, atol=1e-6)
    for text, problem in (
        ("a 1\n", "no time of b"),
        ("a 1\nb x\n", "line 2: 'b x'"),
        ("a 2\nb 1\n", "b is earlier than a"),
    ):
        table.write_text(text)
        with pytest.raises(InputError, match=f"other.txt.*{problem}"):
            read_times(table, stream)


# -- Videos


@pytest.mark.parametrize(
    ("name", "codec", "dtype", "channels", "tolerance"),
    [
        ("a.mkv", "FFV1", np.uint8, 1, 0),
        ("a.mkv", "FFV1", np.uint8, 3, 0),
        ("a.mkv", "FFV1", np.uint16, 1, 0),
        ("a.mp4", "mp4v", np.uint8, 3, 4),
        ("a.avi", "MJPG", np.uint8, 3, 4),
    ],
)
def test_video_in_any_order(
    tmp_path: Path, name: str, codec: str, dtype: type, channels: int, tolerance: int
) -> None:
    frames = moving(90, dtype, channels)
    video = open_stream(write_video(tmp_path / name, frames, codec))
    assert len(video) == 90
    np.testing.assert_allclose(video.times, np.arange(90) / 20, atol=2e-3)
    in_order = list(video)
    assert in_order[0].dtype == dtype and in_order[0].shape == frames[0].shape
    for found, true in zip(in_order, frames, strict=True):
        assert np.abs(found.astype(int) - true.astype(int)).mean() <= tolerance
    for index in (77, 3, 4, 4, 89, 0, 70, 5):
        np.testing.assert_array_equal(video[index], in_order[index])
    with pytest.raises(IndexError):
        video[90]


@pytest.mark.parametrize(
    ("name", "codec"), [("a.avi", "MJPG"), ("a.mkv", "FFV1"), ("a.mp4", "mp4v")]
)
def test_truncated_video(tmp_path: Path, name: str, codec: str) -> None:
    path = write_video(tmp_path / name, moving(30), codec)
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 2 // 3])
    with pytest.raises(InputError, match=rf"{name}: cannot decode frame \d+.*truncated"):
        open_stream(path)


def test_a_seek_that_leads_astray_is_not_believed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Astray:
        def __init__(self, *arguments: Any) -> None:
            self.capture = capture(*arguments)

        def __getattr__(self, name: str) -> Any:
            return getattr(self.capture, name)

        def set(self, key: int, value: float) -> bool:
            off = 3 if key == cv2.CAP_PROP_POS_FRAMES else 0
            return bool(self.capture.set(key, value + off))

    capture = cv2.VideoCapture
    frames = moving(90)
    path = write_video(tmp_path / "a.mkv", frames, "FFV1")
    monkeypatch.setattr(cv2, "VideoCapture", Astray)
    video = open_stream(path)
    for index in (80, 2, 79):
        np.testing.assert_array_equal(video[index], frames[index])


def test_h264() -> None:
    """Thirty frames with B-frames between; each is lighter than the last by 6 levels."""
    video = open_stream(Path(__file__).parent / "data" / "h264.mp4")
    assert len(video) == 30
    np.testing.assert_allclose(video.times, np.arange(30) / 20, atol=2e-3)
    assert video[0].shape == (48, 64, 3)
    for index in (*range(30), 29, 2, 17, 0):
        assert np.median(video[index]) == pytest.approx(30 + 6 * index, abs=4)


def test_halves(tmp_path: Path) -> None:
    frames = moving(3)
    path = write_video(tmp_path / "w.mkv", frames, "FFV1")
    left, bottom = open_stream(f"{path}#left"), open_stream(f"{path}#bottom")
    np.testing.assert_array_equal(left[1], frames[1][:, :80])
    np.testing.assert_array_equal(bottom[2], frames[2][60:])
    assert left.times is not None and len(left) == 3
    with pytest.raises(InputError, match=r"w\.mkv#middle: expected.*#left"):
        open_stream(f"{path}#middle")
    write_image(tmp_path / "odd" / "1.png", np.zeros((5, 7), np.uint8))
    with pytest.raises(InputError, match=r"1\.png: its width is 7 px, expected an even one"):
        open_stream(f"{tmp_path / 'odd'}#right")[0]


def write_parts(path: Path, frames: list[Image]) -> None:
    """A video joined of a part for each of the frames."""
    parts = []
    for index, frame in enumerate(frames):
        parts.append((path.with_name(f"{index}"), 1))
        part = encoder.Encoder(parts[-1][0], path, frame, 10)
        part.write(frame)
        part.close(1)
    encoder.join(parts, path, path, 10, lambda: None)


def test_a_video_has_all_its_frames_or_is_an_error(tmp_path: Path) -> None:
    """What is not whole is for the sink to remove: it has no name of the output yet."""
    frames = moving(3, np.uint16)
    write_parts(tmp_path / "a.mkv", frames)
    assert {path.name for path in tmp_path.iterdir()} == {"0", "1", "2", "a.mkv"}
    for found, frame in zip(open_stream(tmp_path / "a.mkv"), frames, strict=True):
        np.testing.assert_array_equal(found, frame)
    part = encoder.Encoder(tmp_path / "b", tmp_path / "b.mkv", frames[0], 10)
    part.write(frames[0])
    with pytest.raises(OSError, match=r"b\.mkv: 1 of 2 frames could be written"):
        part.close(2)
    part.end()
    with pytest.raises(OSError, match="coded otherwise"):
        write_parts(tmp_path / "c.mkv", [frames[0], moving(1)[0]])


def test_a_video_may_have_any_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """FFmpeg would take ``a:`` for a protocol."""
    monkeypatch.chdir(tmp_path)
    frames = moving(2)
    write_parts(Path("a:b.c.mkv"), frames)
    np.testing.assert_array_equal(open_stream(tmp_path / "a:b.c.mkv")[1], frames[1])


# -- Bags


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
def test_bags(tmp_path: Path, kind: str) -> None:
    colour, deep = moving(6, channels=3), moving(6, np.uint16)
    topics = {"/visible": ("rgb8", colour), "/thermal": ("mono16", deep), "/png": ("png", deep)}
    bag = write_bag(tmp_path / ("drive.bag" if kind == "ros1" else "drive"), kind, topics)
    visible, thermal = open_stream(f"{bag}#/visible"), open_stream(f"{bag}#/thermal")
    np.testing.assert_allclose(visible.times, 1.7e9 + 0.1 * np.arange(6), rtol=0, atol=1e-6)
    for found, true in zip(visible, colour, strict=True):
        np.testing.assert_array_equal(found, true)
    for index in (4, 5, 1, 0, 3):
        np.testing.assert_array_equal(thermal[index], deep[index])
    np.testing.assert_array_equal(open_stream(f"{bag}#/png")[5], deep[5])
    assert pair_streams(visible, thermal).gap == pytest.approx(0.01, abs=1e-6)
    with pytest.raises(InputError, match="with a topic of images; it has /png, /thermal, /visible"):
        open_stream(f"{bag}#/depth")
    (info,) = camera_infos(bag)
    assert (info.width, info.height, info.model) == (320, 240, "plumb_bob")
    assert info.K[1, 1] == 301 and info.D[0] == 0.1
    result = run("inspect", bag)
    assert result.exit_code == 0, result.output
    assert "FX,FY,CX,CY 300,301,160,120 px, lens brown:0.1,0,0,0,0" in result.stdout
    lens = Lens("brown", [0.1, 0, 0, 0, 0])
    assert info.lens == lens_of_topic(f"{bag}#/visible") == lens
    assert lens_of_topic(f"{bag}#/thermal") is None and lens_of_topic(tmp_path.parent) is None


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer(tmp_path: Path, pattern: str, dtype: type) -> None:
    (colour,) = moving(1, dtype, channels=3)
    y, x = np.mgrid[:120, :160]
    channel = np.array(["bgr".index(letter) for letter in pattern])[y % 2 * 2 + x % 2]
    mosaic = np.take_along_axis(colour, channel[..., None], axis=2)[..., 0]
    encoding = f"bayer_{pattern}{8 * np.dtype(dtype).itemsize}"
    stream = open_stream(write_bag(tmp_path / "b", "sqlite", {"/raw": (encoding, [mosaic])}))
    assert stream[0].dtype == dtype
    error = np.abs(stream[0].astype(int) - colour.astype(int))[2:-2, 2:-2]
    assert error.max() < 0.03 * np.iinfo(dtype).max


def compressed_depth(values: Image, scale: float = 0, shift: float = 0) -> Image:
    """As image_transport's compressed_depth writes it: a header of 12 bytes, and a PNG."""
    header = np.array([scale, shift], "<f4").view(np.uint8)
    png = cv2.imencode(".png", values)[1].ravel()
    return np.concatenate([np.zeros(4, np.uint8), header, png])


def test_compressed_depth(tmp_path: Path) -> None:
    millimetres = np.arange(0, 60000, 50, np.uint16).reshape(30, 40)
    metres = (millimetres * np.float32(1e-3)).clip(0, 10)
    # As compressed_depth_image_transport quantizes: nearer is finer, 0 is unknown.
    shift = 1 - 100.0 * (100.0 + 1) / 10
    scale = 100.0 * (100.0 + 1)
    with np.errstate(divide="ignore"):
        codes = np.where(metres > 0, np.clip(scale / metres + shift, 0, 65535), 0)
    topics = {
        "/mm": ("16UC1; compressedDepth png", [compressed_depth(millimetres)]),
        "/m": (
            "32FC1; compressedDepth",
            [compressed_depth(codes.astype(np.uint16), scale, shift)],
        ),
        "/rvl": ("16UC1; compressedDepth rvl", [np.zeros(40, np.uint8)]),
    }
    bag = write_bag(tmp_path / "b", "mcap", topics)
    np.testing.assert_array_equal(open_stream(f"{bag}#/mm")[0], millimetres)
    found = open_stream(f"{bag}#/m")[0]
    assert found.dtype == np.float32
    known = metres > 0.2  # codes end at 65535
    np.testing.assert_allclose(found[known], metres[known], rtol=0.002)
    assert found[0, 0] == 0
    with pytest.raises(DecodeError, match=r"frame 0: cannot decode 28 bytes, .* rvl"):
        open_stream(f"{bag}#/rvl")[0]


@pytest.mark.parametrize("kind", ["16UC1", "32FC1", "16UC1; compressedDepth"])
def test_depth_from_a_topic(rendered: Path, tmp_path: Path, kind: str) -> None:
    names = "visible", "thermal", "depth"
    files = [list_files(rendered / name) for name in names]
    visible, thermal = ([read_image(path) for path in paths] for paths in files[:2])
    metres = [read_depth(path) for path in files[2]]
    depth = metres
    if kind != "32FC1":
        depth = [np.where(m < 65, 1e3 * m, 0).round().astype(np.uint16) for m in metres]
    if ";" in kind:
        depth = [compressed_depth(values) for values in depth]
    topics = {"/v": ("bgr8", visible), "/t": ("mono8", thermal), "/depth": (kind, depth)}
    bag = write_bag(tmp_path / "drive.bag", "ros1", topics)
    rig, out = rendered / "rig.yaml", tmp_path / "out"
    frames = (f"{bag}#/v", f"{bag}#/t", "--depth", f"{bag}#/depth")
    result = run("register", rig, *frames, "-o", out)
    assert result.exit_code == 0, result.output
    inputs = (rendered / "visible", rendered / "thermal", "--depth", rendered / "depth")
    assert run("register", rig, *inputs, "-o", tmp_path / "true").exit_code == 0
    for found, true in zip(list_files(out), list_files(tmp_path / "true"), strict=True):
        error = np.abs(read_image(found).astype(int) - read_image(true).astype(int))
        assert np.percentile(error[read_image(out / "masks" / found.name) == 0], 99) <= 2


def test_depth_topics_are_matched_by_time_or_in_order(tmp_path: Path) -> None:
    metres = [np.full((30, 40), 1 + i, np.float32) for i in range(6)]
    bag = write_bag(tmp_path / "b", "sqlite", {"/depth": ("32FC1", metres)})
    stamps = 1_700_000_000.0 + 0.1 * np.arange(6)
    image = np.zeros((60, 80), np.uint8)
    for times, used, expected in (
        (stamps[[1, 4]] + 0.02, [0, 1], [2, 5]),
        (None, [0, 2, 3], [1, 3, 4]),
    ):
        references = Listed([image] * (6 if times is None else 2), times)
        depth = open_matched_depth(references, used, f"{bag}#/depth")
        assert [depth(i, image).mean() for i in range(len(used))] == expected
    four = Listed([image] * 4)
    with pytest.raises(InputError, match="first of 6 depth maps, memory frame 0 of 4 reference"):
        open_matched_depth(four, [0, 1, 2], f"{bag}#/depth")
    with pytest.raises(InputError, match="depth is 40x30, but the reference image is 80x80"):
        depth(0, np.zeros((80, 80), np.uint8))
    grey = write_bag(tmp_path / "c", "sqlite", {"/grey": ("mono8", [image] * 4)})
    with pytest.raises(InputError, match="depth is 60x80 uint8, expected 32FC1 in metres or 16UC1"):
        open_matched_depth(four, [0, 2, 3], grey)(0, image)


def test_bags_without_the_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.highlevel", None)
    with pytest.raises(InputError, match="need the library rosbags, `pip install rosbags`"):
        open_stream(f"{tmp_path / 'a.mcap'}#/x")


def test_a_folder_of_images_may_hold_metadata(tmp_path: Path) -> None:
    write_image(tmp_path / "1.png", moving(1)[0])
    (tmp_path / "metadata.yaml").write_text("camera: thermal\n")
    assert len(open_stream(tmp_path)) == 1


@pytest.mark.parametrize("kind", ["ros1", "sqlite"])
def test_a_bag_with_a_hole_is_named(tmp_path: Path, kind: str) -> None:
    topics = {"/x": ("mono8", moving(20))}
    bag = write_bag(tmp_path / ("b.bag" if kind == "ros1" else "b"), kind, topics)
    file = Path(bag) if kind == "ros1" else next(Path(bag).glob("*.db3"))
    data = bytearray(file.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 3000] = bytes(3000)
    whole = open_stream(f"{bag}#/x")
    file.write_bytes(data)
    with pytest.raises(InputError, match=r"#/x frame \d+: not readable, the bag is damaged: "):
        open_stream(f"{bag}#/x")
    if kind == "sqlite":  # the other keeps what it has read
        with pytest.raises(DecodeError, match=r"#/x frame \d+: cannot decode the message"):
            list(whole)


def test_bad_bags(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n")
    with pytest.raises(InputError, match=r"a\.mcap: not a readable bag"):
        open_stream(f"{tmp_path / 'a.mcap'}#/x")
    with pytest.raises(InputError, match=r"none\.bag: no such bag"):
        open_stream(f"{tmp_path / 'none.bag'}#/x")
    stream = open_stream(write_bag(tmp_path / "b.bag", "ros1", {"/x": ("strange", moving(1))}))
    with pytest.raises(InputError, match="encoding is 'strange', expected one of mono8"):
        stream[0]


def test_frames_that_cannot_be_decoded_are_told_from_wrong_input(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What `calibrate` may leave out: a page, a frame of a video, a message."""
    frames = moving(4, np.uint16)
    cv2.imwritemulti(str(tmp_path / "s.tiff"), frames)
    pages = open_stream(tmp_path / "s.tiff")
    data = bytearray((tmp_path / "s.tiff").read_bytes())
    data[8:2000] = bytes(1992)  # pixels of the first page
    (tmp_path / "s.tiff").write_bytes(data)
    with pytest.raises(DecodeError, match=r"s\.tiff page 0: cannot decode"):
        pages[0]
    np.testing.assert_array_equal(pages[3], frames[3])

    topics = {"/png": ("png", frames), "/jpg": ("bgr8; jpeg compressed bgr8", [])}
    jpeg = cv2.imencode(".jpg", moving(1)[0])[1].ravel()
    topics["/jpg"][1].extend([jpeg, jpeg[: len(jpeg) // 2], np.zeros(0, np.uint8), jpeg])
    stream = open_stream(write_bag(tmp_path / "b", "sqlite", topics) + "#/jpg")
    for index in (1, 2):
        with pytest.raises(DecodeError, match=f"frame {index}: cannot decode .* bytes"):
            stream[index]
    assert stream[3].shape == (120, 160)

    video = open_stream(write_video(tmp_path / "v.mkv", moving(90), "FFV1"))
    video[0]
    capture = video._capture  # type: ignore[attr-defined]

    class Broken:
        def __getattr__(self, name: str) -> Any:
            return getattr(capture, name)

        def grab(self) -> bool:
            return False

    monkeypatch.setattr(video, "_capture", Broken())
    with pytest.raises(DecodeError, match=r"v\.mkv frame 1: cannot decode"):
        video[1]
    monkeypatch.setattr(video, "_capture", capture)
    for index in (2, 70):
        np.testing.assert_array_equal(video[index], moving(90)[index])


def test_calibrate_leaves_out_messages_that_cannot_be_decoded(
    rendered: Path, tmp_path: Path
) -> None:
    visible, thermal = (
        [cv2.imencode(".png", read_image(path))[1].ravel() for path in list_files(rendered / name)]
        for name in ("visible", "thermal")
    )
    thermal[2] = thermal[2][: len(thermal[2]) // 2]
    kind = "bgr8; png compressed bgr8"
    bag = write_bag(tmp_path / "b", "mcap", {"/v": (kind, visible), "/t": (kind, thermal)})
    frames = (f"{bag}#/v", f"{bag}#/t", "--depth", rendered / "depth", "--working-width", 160)
    for choose in ("informed", "spread"):
        result = run("calibrate", *frames, "--choose", choose, "-o", tmp_path / "rig.yaml")
        assert result.exit_code in (0, 3), result.output
        assert "1 unusable frame is left out;" in result.stderr
        assert "#/t frame 2: cannot decode" in result.stderr


# -- Pairing


def test_times_pair_nearest_one_to_one() -> None:
    fast, slow = np.arange(0, 2, 1 / 30), np.arange(0.004, 2, 1 / 9)
    found = pair_times(fast, slow)
    assert found.dropped == (60 - 18, 0)
    np.testing.assert_array_equal(found.sources, np.arange(18))
    nearest = np.abs(fast[:, None] - slow).argmin(axis=0)
    np.testing.assert_array_equal(found.references, nearest)
    swapped = pair_times(slow, fast)
    np.testing.assert_array_equal(swapped.sources, found.references)


def test_dropped_frames_and_offset() -> None:
    times = np.arange(20) / 10
    late = np.delete(times + 0.3, [4, 5, 11]) + np.random.default_rng(0).normal(0, 0.005, 17)
    found = pair_times(times, late, offset=0.3)
    np.testing.assert_array_equal(found.references, np.delete(np.arange(20), [4, 5, 11]))
    assert found.dropped == (3, 0) and found.gap < 0.02
    assert "17 pairs by time" in found.line() and "3 reference, 0 source" in found.line()
    assert len(pair_times(times, late, offset=0.3, max_gap=0.004).references) < 17
    with pytest.raises(InputError, match="no two frames are within"):
        pair_times(times, late + 1e9)


class Listed(Stream):
    """Images in memory."""

    def __init__(self, images: list[Image], times: Any = None) -> None:
        super().__init__()
        self.images, self.times = images, times

    def __len__(self) -> int:
        return len(self.images)

    def read(self, index: int) -> Image:
        return self.images[index]

    def name(self, index: int) -> str:
        return f"{index:06d}"

    def where(self, index: int) -> str:
        return f"memory frame {index}"


def test_methods_need_what_they_need() -> None:
    four, three = Listed(moving(4)), Listed(moving(3))
    assert pair_streams(four, four).method == "order"
    for arguments, problem in (
        ((four, three), "first of 4 frames, memory frame 0 of 3"),
        ((four, four, "time"), "reference frames have no times"),
        ((four, four, "name"), "needs two folders"),
        ((four, four, "order", 0.5), "offset of 0.5 s needs frames paired by time"),
    ):
        with pytest.raises(InputError, match=problem):
            pair_streams(*arguments)


def test_depth_of_the_frames_in_use(tmp_path: Path) -> None:
    used = [1, 3]
    stream = Listed(moving(4), 50.0 + 0.1 * np.arange(4))

    def found(*names: str) -> list[int]:
        depths = [Path("depth") / f"{name}.npy" for name in names]
        return match_depths(stream, used, depths)

    assert found("000000", "000001", "000003") == [1, 2]  # by name, one is left over
    assert found("d0", "d1", "d2", "d3") == [1, 3]  # by number, of all frames
    assert found("x", "y") == [0, 1]  # in order, of those in use
    with pytest.raises(InputError, match="expected as many"):
        found("x", "y", "z")
    stream.times = 1.7e9 + 0.1 * np.arange(4)
    assert found("1700000000.11", "1700000000.20", "1700000000.31") == [0, 2]
    with pytest.raises(InputError, match="no depth map near the time of memory frame 3"):
        found("1700000000.11", "1700000000.20")


# -- Clock offset


def textured(seed: int) -> Image:
    rng = np.random.default_rng(seed)
    image = np.full((400, 1000), 90, np.float32)
    for _ in range(200):
        x, y, w, h = (int(v) for v in rng.integers((0, 0, 8, 8), (1000, 400, 90, 90)))
        cv2.rectangle(image, (x, y), (x + w, y + h), float(rng.uniform(0, 255)), -1)
    return cv2.GaussianBlur(image, (0, 0), 1.2)


VISIBLE = textured(0)
THERMAL = 255 - np.abs(VISIBLE * 1.7 % 510 - 255)
CAMERA = Pinhole(240, 160, 200, 200, 119.5, 79.5)
IDENTITY = Rig(CAMERA, CAMERA)
"""The rig of two `pans`."""


class Pan(Stream):
    """A window that wanders over a picture; gain and level jump now and then."""

    def __init__(
        self, picture: Image, scene_times: Any, late: float, moves: bool, noise: float, seed: int
    ) -> None:
        super().__init__()
        self.picture, self.scene_times, self.noise = picture, scene_times, noise
        self.times = scene_times + late
        self.seed, self.moves = seed, moves
        rng = np.random.default_rng(seed)
        self.gain, self.level = np.ones(len(self)), np.zeros(len(self))
        for at in rng.integers(0, len(self), max(2, len(self) // 50)) if seed else ():
            self.gain[at:], self.level[at:] = rng.uniform(0.4, 1.3), rng.uniform(-30, 30)

    def __len__(self) -> int:
        return len(self.scene_times)

    def read(self, index: int) -> Image:
        knots = np.cumsum(np.random.default_rng(9).normal(0, 12, (100, 2)), axis=0)
        at = 6 * (self.scene_times[index] + 1) * self.moves
        x, y = (np.interp(at, np.arange(100), column) for column in knots.T)
        move = np.array([[1.0, 0, 450 + x], [0, 1, 150 + y / 4]])
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        image = cv2.warpAffine(
            self.picture, move, (240, 160), flags=flags, borderMode=cv2.BORDER_REFLECT
        )
        rng = np.random.default_rng((self.seed, index))
        image = (
            image * self.gain[index] + self.level[index] + rng.normal(0, self.noise, image.shape)
        )
        return image.clip(0, 255).astype(np.uint8)

    def name(self, index: int) -> str:
        return f"{index:06d}"

    def where(self, index: int) -> str:
        return f"pan frame {index}"


def pans(late: float, rate: float = 30, moves: bool = True) -> tuple[Stream, Stream]:
    visible = Pan(VISIBLE, np.arange(0, 7, 1 / 30), 0, moves, 3, 0)
    return visible, Pan(THERMAL, np.arange(0.01, 7, 1 / rate), late, moves, 6, 1)


@pytest.mark.parametrize("late", [10 / 30, -0.2, 0.047])
def test_clock_offset_to_a_fraction_of_a_frame(late: float) -> None:
    estimate = estimate_offset(*pans(late))
    assert estimate.trusted
    assert estimate.offset == pytest.approx(late, abs=0.008)
    assert f"late by {estimate.offset:+.4f} s" in estimate.line()


def test_clock_offset_of_a_slow_camera() -> None:
    estimate = estimate_offset(*pans(0.15, rate=9))
    assert estimate.trusted
    assert estimate.offset == pytest.approx(0.15, abs=0.03)


def test_a_rig_that_stands_still_tells_no_offset() -> None:
    estimate = estimate_offset(*pans(0.15, moves=False))
    assert not estimate.trusted and estimate.offset == 0
    assert "moves too little" in estimate.line() and "0 s is used" in estimate.line()


def test_offset_is_refined_by_registration(rendered: Path) -> None:
    rig = Rig.load(rendered / "rig.yaml")
    visible, thermal = open_stream(rendered / "visible"), open_stream(rendered / "thermal")
    visible.times, thermal.times = np.arange(FRAMES) * 0.5, np.arange(FRAMES) * 0.5 + 0.5
    provider = FolderDepth(rendered / "depth", list_files(rendered / "visible"))
    found = refine_offset(rig, visible, thermal, provider, [0, 0.5, 1.0], 3)
    assert found.decided and found.offset == 0.5
    assert found.scores[1] > max(found.scores[0], found.scores[2])
    # The guess, in the middle, is a frame off.
    assert refine_offset(rig, visible, thermal, provider, [0, 0.5, 1.0, 1.5], 3).offset == 0.5


# -- The commands


@pytest.fixture(scope="session")
def filmed(rendered: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`rendered`, cut to even sizes, as visible.mkv and thermal.mkv, and as folders."""
    folder = tmp_path_factory.mktemp("filmed")
    for kind in ("visible", "thermal"):
        images = []
        for path in list_files(rendered / kind):
            image = read_image(path)
            image = image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2]
            images.append(np.ascontiguousarray(image))
            write_image(folder / kind / path.name, image)
        write_video(folder / f"{kind}.mkv", images, "FFV1", 10)
    return folder


def test_calibrate_two_videos(filmed: Path, rendered: Path, tmp_path: Path) -> None:
    visible, thermal, out = filmed / "visible.mkv", filmed / "thermal.mkv", tmp_path / "rig.yaml"
    inputs = ("--depth", rendered / "depth", "--working-width", 160)
    result = run("calibrate", visible, thermal, *inputs, "-o", out)
    assert result.exit_code == 0, result.output
    assert f"{FRAMES} pairs by time" in result.stderr
    depth = read_depth(list_files(rendered / "depth")[0])
    error = metrics.end_point_error(Rig.load(out), Rig.load(rendered / "rig.yaml"), depth)
    assert np.nanmedian(error) < 0.5


@pytest.mark.parametrize("suffix", [".mkv", ".mp4"])
def test_register_a_video_into_a_video(
    filmed: Path, rendered: Path, tmp_path: Path, suffix: str
) -> None:
    inputs = ("--depth", rendered / "depth", "--quiet")
    rig, film = rendered / "rig.yaml", tmp_path / f"out{suffix}"
    visible, thermal = filmed / "visible.mkv", filmed / "thermal.mkv"
    result = run("register", rig, visible, thermal, *inputs, "-o", film)
    assert result.exit_code == 0, result.output
    folder = tmp_path / "images"
    result = run("register", rig, filmed / "visible", filmed / "thermal", *inputs, "-o", folder)
    assert result.exit_code == 0, result.output
    images, masks = open_stream(film), open_stream(tmp_path / "out.masks.mkv")
    assert images.times is not None and images.times[1] == pytest.approx(0.1, abs=1e-3)
    for index, path in enumerate(list_files(folder)):
        found = images[index] if suffix == ".mkv" else images[index][..., 0]
        error = np.abs(found.astype(int) - read_image(path).astype(int))
        assert error.mean() <= (0 if suffix == ".mkv" else 4)
        np.testing.assert_array_equal(masks[index], read_image(folder / "masks" / path.name))


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_register_and_evaluate_a_bag(rendered: Path, tmp_path: Path, kind: str) -> None:
    visible, thermal = (
        [read_image(path) for path in list_files(rendered / name)]
        for name in ("visible", "thermal")
    )
    topics = {"/visible": ("rgb8", visible), "/thermal": ("mono8", thermal)}
    bag = write_bag(tmp_path / ("drive.bag" if kind == "ros1" else "drive"), kind, topics)
    frames = (f"{bag}#/visible", f"{bag}#/thermal", "--depth", rendered / "depth")
    rig, out = rendered / "rig.yaml", tmp_path / "out"
    result = run("register", rig, *frames, "-o", out)
    assert result.exit_code == 0, result.output
    assert "median gap 10.0 ms" in result.stderr
    assert [path.stem for path in list_files(out)] == [f"{i:06d}" for i in range(FRAMES)]
    result = run("evaluate", rig, *frames)
    assert result.exit_code == 0, result.output
    change = re.search(r"NEC .* ([+-][0-9.]+)", result.stdout)
    assert change and float(change[1]) > 0.02


def test_late_source_is_paired_with_its_scene(rendered: Path, tmp_path: Path) -> None:
    """The offset given, a reference without a partner falls out, and depth goes with the rest."""
    for name, late in (("visible", 0.0), ("thermal", 0.5)):
        lines = []
        for index, path in enumerate(list_files(rendered / name)):
            write_image(tmp_path / name / path.name, read_image(path))
            lines.append(f"{path.name} {0.5 * index + late}\n")
        (tmp_path / name / "timestamps.txt").write_text("".join(lines))
    list_files(tmp_path / "thermal")[2].unlink()
    frames = (tmp_path / "visible", tmp_path / "thermal", "--depth", rendered / "depth")
    rig, out = rendered / "rig.yaml", tmp_path / "out"
    result = run("register", rig, *frames, "--time-offset", 0.5, "-o", out)
    assert result.exit_code == 0, result.output
    assert "1 reference, 0 source frames" in result.stderr
    names = [path.name for path in list_files(tmp_path / "visible")]
    assert [path.name for path in list_files(out)] == names[:2] + names[3:]
    inputs = (rendered / "visible", rendered / "thermal", "--depth", rendered / "depth")
    assert run("register", rig, *inputs, "-o", tmp_path / "true").exit_code == 0
    for path in list_files(out):
        np.testing.assert_array_equal(read_image(path), read_image(tmp_path / "true" / path.name))


def test_register_estimates_how_late_the_source_is(tmp_path: Path) -> None:
    """Both containers start at zero; the source shows ten frames later what happened."""
    times = np.arange(150) / 30
    scenes = {
        "v": Pan(VISIBLE, times, 0, True, 3, 0),
        "t": Pan(THERMAL, times - 1 / 3, 0, True, 6, 1),
    }
    v, t = (
        write_video(tmp_path / f"{name}.mkv", list(pan), "FFV1", 30) for name, pan in scenes.items()
    )
    IDENTITY.save(tmp_path / "rig.yaml")
    arguments = ("register", tmp_path / "rig.yaml", v, t, "--depth", "plane")
    result = run(*arguments, "--time-offset", "auto", "-o", tmp_path / "out.mkv")
    assert result.exit_code == 0, result.output
    found = re.search(r"clock offset: source late by ([+0-9.]+) s", result.stderr)
    assert found and float(found[1]) == pytest.approx(1 / 3, abs=0.008)
    refined = re.search(r"register best with the source late by ([+0-9.]+) s", result.stderr)
    assert refined and float(refined[1]) == pytest.approx(1 / 3, abs=0.02)
    assert "140 pairs by time" in result.stderr
    assert "10 reference, 10 source frames" in result.stderr
    # The rig is the identity: what is registered first is the source's eleventh frame.
    np.testing.assert_array_equal(open_stream(tmp_path / "out.mkv")[0], open_stream(t)[10])


@pytest.mark.parametrize(("late", "rate"), [(1 / 3, 30), (0.15, 9)])
def test_a_rig_corrects_the_estimated_offset(late: float, rate: float) -> None:
    """Two frames off, trusted or not: registration leads back; without motion it says so."""
    visible, thermal = pans(late, rate)
    for trusted in (True, False):
        peak = late + 2 / 30
        wrong = OffsetEstimate(peak * trusted, trusted, 0.5 * trusted, 0.2, peak)
        pairs = Pairs(visible, thermal, time_offset=None, estimate=wrong)
        assert pairs.pairing.offset == wrong.offset
        pairs.refine(IDENTITY, lambda _: PlaneDepth())
        assert pairs.pairing.offset == pytest.approx(late, abs=0.03)
        assert len(pairs.notes) == 2 + trusted
        assert "frames register best with the source late by" in pairs.notes[-2]
        assert f"{pairs.pairing.offset:+.4f} s" in pairs.notes[-1]


def test_a_rig_finds_clocks_that_agree_behind_a_wrong_estimate() -> None:
    wrong = OffsetEstimate(1.1, True, 0.5, 0.2, 1.1)
    pairs = Pairs(*pans(0.02), time_offset=None, estimate=wrong)
    pairs.refine(IDENTITY, lambda _: PlaneDepth())
    assert pairs.pairing.offset == pytest.approx(0.02, abs=0.03)


def test_a_rig_that_stands_still_tells_no_offset_by_registration() -> None:
    visible, thermal = pans(0.15, moves=False)
    candidates = offsets_around(0.1, visible, thermal)
    found = refine_offset(IDENTITY, visible, thermal, PlaneDepth(), candidates)
    assert not found.decided and found.offset == pytest.approx(0.1)
    assert "change too little to confirm" in found.line()


@pytest.mark.parametrize("command", ["register", "evaluate", "calibrate"])
def test_too_few_frames_tell_no_offset_and_every_command_says_so(
    rendered: Path, tmp_path: Path, command: str
) -> None:
    for name in ("visible", "thermal"):
        lines = [f"{p.name} {0.1 * i}\n" for i, p in enumerate(list_files(rendered / name))]
        (tmp_path / f"{name}.txt").write_text("".join(lines))
    rig, out = rendered / "rig.yaml", tmp_path / "out.yaml"
    frames = (rendered / "visible", rendered / "thermal", "--depth", rendered / "depth")
    times = [
        f"--{k}-times={tmp_path / n}.txt"
        for k, n in (("reference", "visible"), ("source", "thermal"))
    ]
    given = {
        "register": (rig, *frames, "-o", tmp_path / "out"),
        "evaluate": (rig, *frames),
        "calibrate": (*frames, "--initial", rig, "-o", out, "--working-width", 160),
    }[command]
    result = run(command, *given, *times, "--time-offset", "auto")
    assert result.exit_code == 0, result.output
    assert "moves too little to tell a clock offset, 0 s is used" in result.stderr
    assert "clock offset: too few frames overlap to confirm" in result.stderr
    assert f"{FRAMES} pairs by time" in result.stderr


def test_frames_that_cannot_be_decoded_do_not_hinder_the_offset() -> None:
    visible, thermal = pans(0.2)
    whole = thermal.read

    def read(index: int) -> Image:
        if index % 50 == 10:
            raise DecodeError(f"pan frame {index}: cannot decode")
        return whole(index)

    thermal.read = read  # type: ignore[method-assign]
    assert estimate_offset(visible, thermal).offset == pytest.approx(0.2, abs=0.008)
    candidates = offsets_around(0.2, visible, thermal)
    assert refine_offset(IDENTITY, visible, thermal, PlaneDepth(), candidates, 40).decided


@pytest.mark.parametrize("text", ["auto", "0.25", "-2f", "0.0"])
def test_an_offset_reads_as_it_is_written(text: str) -> None:
    """The journal of `register` has it so."""
    assert str(parse_time_offset(text)) == text


def test_refused_footage(rendered: Path, tmp_path: Path, refused: Refused) -> None:
    visible, thermal = rendered / "visible", rendered / "thermal"
    rest = ("--depth", rendered / "depth", "-o", tmp_path / "o")
    rig = rendered / "rig.yaml"
    for arguments, named in (
        ((visible, thermal, "--time-offset", "soon"), "'soon' is neither `auto` nor a number"),
        ((visible, thermal, "--time-offset", "1"), "needs frames paired by time; they are by name"),
        ((visible, thermal, "--time-offset", "auto", "--pair", "time"), "needs times of both"),
        ((visible, thermal, "--pair", "time"), "reference frames have no times"),
        ((visible, tmp_path / "no.mp4"), "no.mp4: no such file"),
        ((visible, f"{thermal}#down"), "thermal#down: expected #TOPIC"),
    ):
        assert named in refused("register", rig, *arguments, *rest)


def test_pairs_are_streams_of_the_partners(tmp_path: Path) -> None:
    frames = moving(12)
    path = write_video(tmp_path / "w.mkv", frames, "FFV1")
    pairs = open_pairs(f"{path}#left", f"{path}#right")
    assert len(pairs.references) == len(pairs.sources) == 12
    np.testing.assert_array_equal(pairs.sources[7], frames[7][:, 80:])
