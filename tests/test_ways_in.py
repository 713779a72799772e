"""What people have: depth of other kinds, images of other kinds, names and times of other kinds."""

from __future__ import annotations

import re
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from conftest import run
from flir import radiometric
from xcalib import CalibrationOptions, Pinhole, Rig, calibrate
from xcalib._core import (
    DepthUnits,
    depth_unit_of,
    distrust,
    joined_images,
    load_frames,
    pair_files,
    read_times,
    times_of_names,
)
from xcalib.convert import is_foreign, read_rig
from xcalib.depth import open_depth, read_depth
from xcalib.footage import Matching, open_pairs, open_stream
from xcalib.frames import DecodeError, InputError, list_files, read_image

Array = NDArray[Any]

HEIGHT, WIDTH, FRAMES = 48, 64, 6
METRES = np.linspace(2, 20, HEIGHT * WIDTH, dtype=np.float32).reshape(HEIGHT, WIDTH)


def texture(index: int) -> Array:
    """The image of a frame: which it is can be told from its mean."""
    noise = np.random.default_rng(index).integers(0, 20, (HEIGHT, WIDTH))
    return (noise + 20 * index + 30).astype(np.uint8)


def png(image: Array) -> bytes:
    return cv2.imencode(".png", image)[1].tobytes()


def write_names(folder: Path, names: list[str]) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for index, name in enumerate(names):
        (folder / name).write_bytes(png(texture(index)))


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    camera = Pinhole(WIDTH, HEIGHT, 60, 60, 31.5, 23.5)
    Rig(camera, camera, t=[-0.05, 0, 0]).save(tmp_path / "rig.yaml")
    return tmp_path / "rig.yaml"


@pytest.fixture
def folders(tmp_path: Path) -> tuple[Path, Path]:
    names = [f"{index:04d}.png" for index in range(FRAMES)]
    for camera in ("visible", "thermal"):
        write_names(tmp_path / camera, names)
    return tmp_path / "visible", tmp_path / "thermal"


# -- Depth -----------------------------------------------------------------------------------------


def write_pfm(path: Path, depth: Array, order: str = "<") -> None:
    head = f"Pf\n{depth.shape[1]} {depth.shape[0]}\n{-1.0 if order == '<' else 1.0}\n"
    path.write_bytes(head.encode() + depth[::-1].astype(order + "f4").tobytes())


WRITERS: dict[str, Callable[[Path], None]] = {
    "a.pfm": lambda path: write_pfm(path, METRES),
    "b.pfm": lambda path: write_pfm(path, METRES, ">"),
    "a.npz": lambda path: np.savez(path, METRES),
    "b.npz": lambda path: np.savez_compressed(path, depth=METRES, other=np.zeros(3)),
    "a.npy": lambda path: np.save(path, METRES.astype(">f8")),
}


@pytest.mark.parametrize("name", WRITERS)
def test_depth_in_metres(tmp_path: Path, name: str) -> None:
    WRITERS[name](tmp_path / name)
    np.testing.assert_array_equal(read_depth(tmp_path / name), METRES)


@pytest.mark.parametrize("name", ["a.pfm", "a.npz", "b.npz"])
def test_damaged_depth_is_named(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    WRITERS[name](path)
    data = path.read_bytes()
    for spoilt in (data[:-9], data[: len(data) // 2], b"", data[:60] + b"\xff" * (len(data) - 60)):
        path.write_bytes(spoilt)
        if name == "a.pfm" and len(spoilt) == len(data):
            continue  # any floats are
        with pytest.raises(InputError, match=rf"{name}: cannot decode"):
            read_depth(path)


def test_of_several_arrays_one_is_meant(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", left=METRES, right=METRES)
    with pytest.raises(InputError, match=r"a\.npz: arrays are left, right, expected only one"):
        read_depth(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("units", "expected"),
    [
        (DepthUnits(), [0, 256 / 256, 1000 / 256, 0]),
        (DepthUnits(scale=depth_unit_of("mm")), [0, 0.256, 1, 0]),
        (DepthUnits(invalid=[256]), [0, 0, 1000 / 256, 0]),
        (DepthUnits(baseline=0.5, focal=100, doffs=2, scale=1), [0, 50 / 258, 50 / 1002, 0]),
    ],
    ids=["1/256", "mm", "invalid", "disparity"],
)
def test_what_counts_mean(tmp_path: Path, units: DepthUnits, expected: list[float]) -> None:
    path = tmp_path / "a.png"
    path.write_bytes(png(np.array([[0, 256, 1000, 65535]], np.uint16)))
    np.testing.assert_allclose(read_depth(path, units)[0], expected, rtol=1e-6)


def test_counts_of_other_files_want_a_unit(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.full((3, 4), 2000, np.uint16))
    with pytest.raises(InputError, match="unit is not known; expected --depth-unit"):
        read_depth(tmp_path / "a.npy")
    assert read_depth(tmp_path / "a.npy", DepthUnits(scale=0.001)).max() == 2
    with pytest.raises(InputError, match="--depth-unit is 'feet', expected mm, cm, m, or 1/256"):
        depth_unit_of("feet")


def test_one_distance_for_all() -> None:
    depth = open_depth("12.5", [])(0, np.zeros((3, 4), np.uint8))
    assert depth.shape == (3, 4) and (depth == 12.5).all() and depth.dtype == np.float32
    with pytest.raises(InputError, match=r"depth is -1.0*, expected a distance above 0 m"):
        open_depth("-1", [])


def test_depth_left_out_lists_the_choices(folders: tuple[Path, Path], rig: Path) -> None:
    result = run("register", rig, *folders, "-o", rig.parent / "out")
    assert result.exit_code == 2
    *choices, line = result.stderr.splitlines()
    assert line == "error: --depth is missing, expected one of those above" and len(choices) == 8
    assert all(choice.startswith("--depth ") and ": " in choice for choice in choices)


def test_what_depth_was_taken_for_is_said(folders: tuple[Path, Path], rig: Path) -> None:
    depth, out = rig.parent / "depth", rig.parent / "out"
    depth.mkdir()
    counts = np.full((HEIGHT, WIDTH), 5000, np.uint16)
    counts[:24] = 65535
    for path in folders[0].iterdir():
        (depth / path.name).write_bytes(png(counts))
    given = ("register", rig, *folders, "--depth", depth, "-o", out)
    result = run(*given)
    assert result.exit_code == 0
    assert "depth: 19.5 to 19.5 m by counts of 1/256 m (--depth-unit mm" in result.stdout
    assert "50.0 % is unknown, of which 65535, the largest count, in 50.0 %" in result.stdout
    assert (read_image(out / "masks" / "0000.png")[:24] == 3).all()
    result = run(*given, "--depth-unit", "mm", "--overwrite")
    assert "depth: 5 to 5 m by counts of 0.001 m;" in result.stdout
    result = run(*given, "--depth-unit", "mm", "--depth-scale", "1")
    assert result.exit_code == 2 and "both say the unit" in result.stderr


def test_a_frame_without_depth_is_left_out(folders: tuple[Path, Path]) -> None:
    references, sources = map(open_stream, folders)
    depth = folders[0].parent / "depth"
    depth.mkdir()
    for index, path in enumerate(sorted(folders[0].iterdir())):
        (depth / path.name).write_bytes(png(np.full((48, 64), 999 * (index != 1), np.uint16)))
    provider = open_depth(depth, list_files(folders[0]))
    used, *_, line = load_frames(references, sources, provider, [0, 1, 2], lambda done: None)
    assert used == [0, 2]
    assert re.match(r"1 unusable frame is left out; .*0001\.png: all depth is unknown", line)


# -- Images ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [".pgm", ".webp", ".jp2"])
def test_images_of_other_kinds(tmp_path: Path, suffix: str) -> None:
    if not cv2.haveImageWriter(f"a{suffix}"):
        pytest.skip(f"this OpenCV writes no {suffix}")
    image = texture(1)
    for index in range(2):
        (tmp_path / f"{index}{suffix}").write_bytes(cv2.imencode(suffix, image)[1].tobytes())
    stream = open_stream(tmp_path)
    assert len(stream) == 2
    found = stream[1] if stream[1].ndim == 2 else stream[1][..., 0]
    assert np.abs(found.astype(int) - image).mean() < 8


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_arrays_are_images(tmp_path: Path, dtype: type[np.generic]) -> None:
    image = texture(1).astype(dtype)
    np.save(tmp_path / "a.npy", image)
    np.save(tmp_path / "b.npy", np.asfortranarray(np.dstack([image] * 3)))
    found = read_image(tmp_path / "a.npy")
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, image)
    np.testing.assert_array_equal(read_image(tmp_path / "b.npy"), np.dstack([image] * 3))
    np.save(tmp_path / "c.npy", image.astype(np.int64))
    with pytest.raises(InputError, match=r"c\.npy: pixels are int64, expected uint8"):
        read_image(tmp_path / "c.npy")


def test_arrays_beside_images_are_not_theirs(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", texture(0))
    assert len(open_stream(tmp_path)) == 1
    (tmp_path / "a.png").write_bytes(png(texture(1)))
    assert open_stream(tmp_path).where(0).endswith("a.png")


def tiff_of(*pages: Array) -> bytes:
    """An uncompressed TIFF of gray pages."""
    data = b"II*\0\0\0\0\0"
    at_link = 4
    for page in pages:
        height, width = page.shape
        pixels, data = len(data), data + page.tobytes() + b"\0" * (page.size % 2)
        entries = [(256, 4, width), (257, 4, height), (258, 3, 8), (259, 3, 1), (262, 3, 1)]
        entries += [(273, 4, pixels), (277, 3, 1), (278, 4, height), (279, 4, page.size)]
        directory = struct.pack("<H", len(entries))
        for tag, kind, value in entries:
            directory += struct.pack("<HHII", tag, kind, 1, value)
        data = data[:at_link] + struct.pack("<I", len(data)) + data[at_link + 4 :]
        data += directory
        at_link = len(data)
        data += b"\0\0\0\0"
    return data


def test_of_a_tiff_with_a_thumbnail_the_full_page_is_taken(tmp_path: Path) -> None:
    path, image = tmp_path / "a.tiff", texture(1)
    for pages in ((image[::2, ::2], image), (image, image[::2, ::2]), (image,)):
        path.write_bytes(tiff_of(*pages))
        np.testing.assert_array_equal(read_image(path), image)
    path.write_bytes(tiff_of(image, image, image[::2, ::2]))
    with pytest.raises(InputError, match=r"a\.tiff: 2 pages of 64x48, expected one image; a TIFF"):
        read_image(path)


def test_a_link_that_leads_nowhere_is_a_frame_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "0.png").write_bytes(png(texture(0)))
    (tmp_path / "1.png").symlink_to("nowhere.png")
    stream = open_stream(tmp_path)
    assert len(stream) == 2
    with pytest.raises(DecodeError, match=r"1\.png: a link to a file that is not there"):
        stream[1]


def test_two_images_in_one_frame_are_told() -> None:
    rng = np.random.default_rng(0)
    noise = (rng.integers(0, 255, (120, 160), np.uint8) for _ in range(3))
    scenes = [cv2.GaussianBlur(each, (0, 0), 3) for each in noise]
    raws = [(scene.astype(np.uint16) * 16 + 17000).astype(np.uint8) for scene in scenes]
    high = [np.vstack(pair) for pair in zip(scenes, raws, strict=True)]
    wide = [np.hstack([scene, scene]) for scene in scenes]
    reason, advice = joined_images(high, "SOURCE")
    assert reason == "SOURCE's frames, 160x240, look like two images one above the other"
    assert advice == "expected SOURCE#top or SOURCE#bottom"
    reason_beside, advice_beside = joined_images(wide, "REFERENCE")
    assert reason_beside.endswith("side by side")
    assert advice_beside.startswith("expected REFERENCE#left")
    high_scenes = [cv2.resize(scene, (160, 240)) for scene in scenes]
    for whole in (scenes, high_scenes, [np.vstack([s, s[::-1]]) for s in scenes]):
        assert joined_images(whole, "SOURCE") == ("", "")
    options = CalibrationOptions(max_iterations=1, flow="off", num_threads=1)
    options.search.mode = "off"
    metres = [np.full((120, 160), 5, np.float32)] * 3
    result = calibrate(scenes, high, metres, options=options)
    before = result.report.message
    distrust(result, "", "")
    assert result.report.message == before
    distrust(result, reason, advice)
    assert not result.converged
    assert result.report.message.startswith(f"{reason}; {advice}")
    assert result.report.verdict.line().startswith(f"{reason}; {advice}; besides: ")


# -- Radiometric JPEGs -----------------------------------------------------------------------------


@pytest.fixture
def flir(tmp_path: Path) -> tuple[Path, Array, Array]:
    rng = np.random.default_rng(0)
    thermal = rng.integers(9000, 20000, (180, 240)).astype(np.uint16)
    visible = cv2.GaussianBlur(rng.integers(0, 255, (240, 320, 3), np.uint8), (0, 0), 3)
    folder = tmp_path / "flir"
    folder.mkdir()
    for index, raw in enumerate(("png", "plain")):
        (folder / f"FLIR{index}.jpg").write_bytes(radiometric(thermal + index, visible, raw))
    return folder, thermal, visible


def test_the_parts_of_a_radiometric_jpeg(flir: tuple[Path, Array, Array]) -> None:
    folder, thermal, visible = flir
    for index in range(2):
        np.testing.assert_array_equal(open_stream(f"{folder}#thermal")[index], thermal + index)
    assert np.abs(open_stream(f"{folder}#visible")[1].astype(int) - visible).mean() < 3
    celsius = open_stream(f"{folder}#temperature")[0]
    kelvin = 1428.0 / np.log(16556.0 / (0.0466 * (thermal - 342.0)) + 1.0)
    np.testing.assert_allclose(celsius, kelvin - 273.15, atol=0.01)
    write_names(folder.parent / "plain", ["a.png"])
    with pytest.raises(InputError, match="expected radiometric JPEGs"):
        open_stream(f"{folder.parent}/plain#thermal")


def test_a_folder_of_radiometric_jpegs_is_both_cameras(flir: tuple[Path, Array, Array]) -> None:
    folder, thermal, _ = flir
    pairs = open_pairs(folder, folder)
    assert pairs.references[0].shape == (240, 320, 3)
    np.testing.assert_array_equal(pairs.sources[0], thermal)
    assert any("radiometric JPEGs" in note for note in pairs.notes)


def test_a_cameras_own_alignment_is_a_start(flir: tuple[Path, Array, Array], binary: Path) -> None:
    folder, _, _ = flir
    rig = read_rig(folder / "FLIR1.jpg")
    assert (rig.reference.width, rig.source.width) == (320, 240)
    # The thermal middle is off the visible one's, and the width takes 1 / 1.3 of the visible one's.
    points = np.array([[159.5 + 12, 119.5 - 7], [159.5 + 12 - 100 / 240 * 320 / 1.3, 119.5 - 7]])
    np.testing.assert_allclose(
        rig.transfer(points, np.full(2, 50.0)), [[119.5, 89.5], [19.5, 89.5]], atol=0.01
    )
    assert is_foreign(folder / "FLIR0.jpg")
    (folder.parent / "none.jpg").write_bytes(cv2.imencode(".jpg", np.zeros((9, 9), np.uint8))[1])
    with pytest.raises(InputError, match=r"none\.jpg: no rig file and no radiometric JPEG"):
        read_rig(folder.parent / "none.jpg")
    given = [folder, folder, "--depth", "5", "--dry-run", "-o", folder.parent / "new.yaml"]
    for start, code in ((folder / "FLIR0.jpg", 0), (folder.parent / "none.jpg", 2)):
        words = [*map(str, given), "--initial", str(start)]
        command = [binary, "calibrate", *words]
        cli = subprocess.run(command, capture_output=True, text=True, check=False)
        python = run("calibrate", *words)
        assert python.exit_code == cli.returncode == code, (python.stderr, cli.stderr)
        assert python.stderr == cli.stderr


def test_a_truncated_radiometric_jpeg_is_named(flir: tuple[Path, Array, Array]) -> None:
    folder, _, _ = flir
    path = folder / "FLIR0.jpg"
    data = path.read_bytes()
    at = data.index(b"FFF\0") + 64 + 16  # the first record's length
    path.write_bytes(data[:at] + struct.pack(">I", 1 << 30) + data[at + 4 :])
    with pytest.raises(InputError, match=r"FLIR0\.jpg.*truncated"):
        open_stream(f"{folder}#thermal")[0]


# -- Pairing ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "times"),
    [
        (["1699999999_900000000", "1700000000_000000000"], [1699999999.9, 1700000000]),
        (["a_1699999999-5", "a_1699999999-50000000"], [1699999999.000000005, 1699999999.05]),
        (["1699999999_000250", "1699999999_500000"], [1699999999.00025, 1699999999.5]),
        (["20231114_221319.500", "20231114_221320.250"], [1699999999.5, 1700000000.25]),
        (["v2023-11-14T22-13-19-500000x", "v2023-11-14T22-13-20-000000x"], [1699999999.5, 1.7e9]),
        (["20231114_221319", "20231114_221320"], None),
        (["1700000000_000000000", "1699999999_900000000"], None),
        (["0001", "0002"], None),
    ],
    ids=str,
)
def test_times_in_names(names: list[str], times: list[float] | None) -> None:
    found = times_of_names(names)
    if times is None:
        assert found is None
    else:
        np.testing.assert_allclose(found, times, atol=1e-6, rtol=0)


@pytest.mark.parametrize(
    "lines",
    [
        "{0:.6f}\n",
        "2011-09-26 13:02:{1:012.9f}\n",
        "  {0}  \n# a comment\n",
    ],
)
def test_times_in_the_order_of_the_files(folders: tuple[Path, Path], lines: str) -> None:
    visible, thermal = folders
    for folder, late in ((visible, 0.0), (thermal, 0.004)):
        times = [0.05 * index + late for index in range(FRAMES)]
        (folder / "timestamps.txt").write_text("".join(lines.format(t, 25 + t) for t in times))
    pairs = open_pairs(visible, thermal)
    assert pairs.pairing.method == "time" and pairs.pairing.gap == pytest.approx(0.004, abs=1e-6)


def test_a_table_of_other_frames_is_not_used(folders: tuple[Path, Path]) -> None:
    visible, thermal = folders
    for folder in folders:
        (folder / "timestamps.txt").write_text("".join(f"{0.1 * i}\n" for i in range(2 * FRAMES)))
    pairs = open_pairs(visible, thermal)
    assert pairs.pairing.method == "name"
    assert sum("12 times without names, for 6 frames; not used" in n for n in pairs.notes) == 2
    with pytest.raises(InputError, match="12 times without names, for 6 frames; expected as many"):
        read_times(visible / "timestamps.txt", open_stream(visible))


def test_a_missing_frame_is_left_out_with_a_note(tmp_path: Path) -> None:
    visible, thermal = tmp_path / "visible", tmp_path / "thermal"
    for folder in (visible, thermal):
        write_names(folder, [f"{index:04d}.png" for index in range(12)])
    (thermal / "0002.png").unlink()
    pairs = open_pairs(visible, thermal)
    assert pairs.pairing.references.tolist() == [0, 1, *range(3, 12)]
    assert pairs.pairing.sources.tolist() == list(range(11))
    assert any(
        "11 pairs by name; without a partner, and left out: visible/0002.png" in note
        for note in pairs.notes
    )
    (thermal / "0003.png").unlink()
    with pytest.raises(InputError, match=r"visible/0002.png, .*--pair order, or --pair time with"):
        open_pairs(visible, thermal)


def test_falling_back_to_order_is_said(folders: tuple[Path, Path]) -> None:
    visible, thermal = folders
    for path in list(thermal.iterdir()):
        path.rename(thermal / f"x{chr(97 + int(path.stem))}.png")
    pairs = open_pairs(visible, thermal)
    assert pairs.pairing.method == "order"
    assert any("6 pairs by order, for neither names nor numbers agree" in n for n in pairs.notes)
    with pytest.raises(InputError, match=r"do not pair by name.*expected --pair order"):
        open_pairs(visible, thermal, Matching("name"))


def test_names_of_drones_pair_by_their_index(tmp_path: Path) -> None:
    visible = [Path(f"v/DJI_2024013112000{i}_{i:04d}_V.JPG") for i in range(1, 6)]
    thermal = [Path(f"t/DJI_2024013112000{i + i % 2}_{i:04d}_T.JPG") for i in range(1, 6)]
    assert pair_files(visible, thermal) == [0, 1, 2, 3, 4]
    assert pair_files(visible, thermal[::-1]) == [4, 3, 2, 1, 0]


def test_one_camera_twice_is_refused(folders: tuple[Path, Path]) -> None:
    with pytest.raises(InputError, match=r"REFERENCE and SOURCE are the same frames.*#left"):
        open_pairs(folders[0], folders[0])


# -- Arguments -------------------------------------------------------------------------------------


def test_arguments_in_a_file(folders: tuple[Path, Path], rig: Path) -> None:
    job, out = rig.parent / "job.yaml", rig.parent / "out"
    job.write_text(
        f"rig: {rig}\nreference: {folders[0]}\nsource: {folders[1]}\n"
        f"depth: 7\noutput: {out}\noverlay: true\nthreads: 1\n"
    )
    result = run("register", "--config", job, "--quiet")
    assert result.exit_code == 0, result.stderr
    assert len(list((out / "overlays").iterdir())) == FRAMES
    # What is typed goes before what the file says.
    result = run("register", f"--config={job}", "-o", rig.parent / "other", "--dry-run")
    assert result.exit_code == 0 and f"would be written: {rig.parent / 'other'}" in result.stdout
    assert not (rig.parent / "other").exists()
    job.write_text("rig: a\ndepht: 7\n")
    result = run("register", "--config", job)
    assert result.exit_code == 2
    assert "unknown key 'depht', expected rig, reference, source, depth," in result.stderr


def test_view_transfer_and_report_take_a_file_and_run_dry(
    folders: tuple[Path, Path], rig: Path, calibrated: tuple[Path, Any]
) -> None:
    job, out, page = (rig.parent / name for name in ("job.yaml", "look.mp4", "page.html"))
    labels, report = rig.parent / "labels", calibrated[0] / "report.json"
    labels.mkdir()
    frames = f"rig: {rig}\nreference: {folders[0]}\nsource: {folders[1]}\ndepth: 7\n"
    for command, text, first, last in (
        ("view", f"{frames}output: {out}", "6 pairs:", f"would be written: {out}"),
        ("transfer", f"{frames}output: new\nlabels: {labels}", "6 pairs:", f"labels: {labels}"),
        ("report", f"run: {report}\noutput: {page}", "6 pairs:", f"would be written: {page}"),
        ("report", f"run: {report}", f"would be printed: {report}", ""),
    ):
        job.write_text(text)
        result = run(command, "--config", job, "--dry-run")
        assert result.exit_code == 0, result.stderr
        assert result.stdout.startswith(first) and last in result.stdout
    assert not out.exists() and not page.exists()


def test_a_dry_run_says_what_would_be_done(folders: tuple[Path, Path], rig: Path) -> None:
    out = rig.parent / "new.yaml"
    given = ("calibrate", *folders, "--depth", 5, "-o", out, "--frames", 4, "--choose", "spread")
    result = run(*given, "--dry-run")
    assert result.exit_code == 0 and not out.exists()
    lines = result.stdout.splitlines()
    assert lines[0] == "6 pairs:"
    assert lines[1].strip() == f"{folders[0] / '0000.png'} + {folders[1] / '0000.png'}"
    assert any(line.startswith("to calibrate on, 4: ") for line in lines)
    assert lines[-1] == f"would be written: {out}"


def test_help_has_sections() -> None:
    for command in ("calibrate", "register", "evaluate"):
        text = run(command, "--help").stdout
        places = [text.index(f"\n{title}:\n") for title in ("Options", "Depth")]
        places.append(text.index("\nDepth by a plane, a network, lidar or stereo:\n"))
        assert places == sorted(places)
        assert text.index("--camera-height") > places[2] > text.index("--depth-unit")
