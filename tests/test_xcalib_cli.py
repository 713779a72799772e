"""xcalib-cli beside the Python command: the same files, messages and exit codes."""

from __future__ import annotations

import json
import os
import re
import signal
import struct
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
import pytest
from click.testing import Result

from conftest import FRAMES, WIDTH, Process, run
from xcalib import Rig
from xcalib.cli import cli as python_command
from xcalib.depth import read_depth
from xcalib.frames import Image, list_files, read_image, write_image
from xcalib.thermal import KNOWN


def folders(scene: Path) -> tuple[str | Path, ...]:
    return scene / "visible", scene / "thermal", "--depth", scene / "depth"


def rewrite(folder: Path, change: Callable[[Image], Image], suffix: str = ".png") -> None:
    for path in list_files(folder):
        image = change(read_image(path))
        path.unlink()
        write_image(path.with_suffix(suffix), image)


def assert_same_pixels(first: Path, second: Path, count: int = FRAMES) -> None:
    names = [path.name for path in list_files(first)]
    assert names == [path.name for path in list_files(second)]
    assert len(names) == count
    for name in names:
        one, other = read_image(first / name), read_image(second / name)
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)


# -- calibrate


@pytest.mark.parametrize(
    "more",
    [
        (),
        ("--frames", 3, "--seed", 2, "--explain"),
        ("--choose", "spread", "--frames", 3, "--seed", 5),
        ("--search", "off", "--flow", "patch", "--reference-hfov", 50),
        ("--solver", "adam", "--frames", 2, "--optimize-lens"),
        ("--source-intrinsics", "277,278,105,85.5", "--optimize-reference"),
        ("--depth-steady", "--choose", "spread"),
        (
            *(
                "--reference-intrinsics",
                "343,343,160,120",
                "--reference-lens",
                "fisheye:0.01,0,0,0",
            ),
            *("--source-lens", "brown:-0.05,0.01,0,0,0.001"),
        ),
    ],
)
def test_calibrate_writes_the_same_rig(
    both: Callable[..., tuple[Process, Result]], rendered: Path, tmp_path: Path, more: Any
) -> None:
    arguments = ("--working-width", 160, "-o", tmp_path / "OUT.yaml", "--quiet")
    first, second = both("calibrate", *folders(rendered), *arguments, *more)
    assert (tmp_path / "c.yaml").read_bytes() == (tmp_path / "p.yaml").read_bytes()
    assert first.stderr == second.stderr
    one, other = (text.splitlines() for text in (first.stdout, second.stdout))
    if "--explain" in more:
        assert one[: FRAMES + 1] == other[: FRAMES + 1]


def test_calibrate_with_a_plane_that_is_refined(
    both: Callable[..., tuple[Process, Result]], rendered: Path, tmp_path: Path
) -> None:
    arguments = ("--depth", "plane", "--refine-plane", "--horizon", 0.47, "--far", 80)
    first, second = both(
        *("calibrate", rendered / "visible", rendered / "thermal", *arguments),
        *("--working-width", 160, "-o", tmp_path / "OUT.yaml"),
    )
    assert (tmp_path / "c.yaml").read_bytes() == (tmp_path / "p.yaml").read_bytes()
    assert first.stdout.splitlines()[0] == second.stdout.splitlines()[0]
    assert first.stdout.startswith("plane: --horizon ")


def test_calibrate_with_what_needs_preparing(
    both: Callable[..., tuple[Process, Result]], scene: Path, tmp_path: Path
) -> None:
    """False colour, sparse depth that is completed, a frame that cannot be read, a first guess."""
    rewrite(scene / "thermal", lambda image: KNOWN["inferno"].curve[image])
    random = np.random.default_rng(0)
    for path in list_files(scene / "depth"):
        depth = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        depth[random.random(depth.shape) < 0.7] = 0
        write_image(path, depth)
    path = list_files(scene / "thermal")[2]
    path.write_bytes(path.read_bytes()[:-20])
    first, second = both(
        *("calibrate", *folders(scene), "--complete", "--initial", scene / "rig.yaml"),
        *("--working-width", 160, "-o", tmp_path / "OUT.yaml", "--report", tmp_path / "OUT.json"),
    )
    assert (tmp_path / "c.yaml").read_bytes() == (tmp_path / "p.yaml").read_bytes()
    assert first.stderr == second.stderr
    assert "false colour (map: inferno)" in first.stderr
    assert "1 unusable frame is left out" in first.stderr
    ours, theirs = (json.loads((tmp_path / f"{name}.json").read_text()) for name in "cp")
    assert [report["run"].pop("program") for report in (ours, theirs)] == ["xcalib-cli", "xcalib"]
    for report in (ours, theirs):  # what differs: names and times
        assert report.pop("rig") in report["run"].pop("arguments")
        del report["seconds"], report["time"]
        for level in report["levels"]:
            del level["seconds"]
    assert ours == theirs
    assert run("report", tmp_path / "c.json").exit_code == 0


def test_json_lines_tell_progress_and_result(
    cli: Callable[..., Process], rendered: Path, tmp_path: Path
) -> None:
    result = cli(
        *("calibrate", *folders(rendered), "-o", tmp_path / "rig.yaml", "--json"),
        *("--working-width", 160),
    )
    events = [json.loads(line) for line in result.stdout.splitlines()]
    kinds = [event["event"] for event in events]
    stages = {event["stage"] for event in events if event["event"] == "progress"}
    assert stages >= {"choosing", "loading", "search", "refine", "judge"}
    assert kinds.count("candidate") == FRAMES
    assert kinds.count("result") == 1
    found = events[kinds.index("result")]
    assert found["rig"] == str(tmp_path / "rig.yaml")
    assert len(found["files"]) == FRAMES
    assert found["converged"] == (result.returncode == 0)
    assert events[-1]["event"] == "end"
    assert events[-1]["exit_code"] == result.returncode


# -- register


@pytest.mark.parametrize(
    "more",
    [
        (),
        ("--occlusion", "hide"),
        ("--nearest", "--threads", 1),
        ("--depth-steady",),
        ("--depth-steady", "--complete"),
    ],
)
def test_register_writes_the_same_frames(
    both: Callable[..., tuple[Process, Result]], rendered: Path, tmp_path: Path, more: Any
) -> None:
    arguments = ("register", rendered / "rig.yaml", *folders(rendered), "-o", tmp_path / "OUT")
    first, _ = both(*arguments, "--overlay", *more)
    assert first.stdout.startswith(f"{FRAMES} frames, ")
    for folder in ("", "masks", "overlays"):
        assert_same_pixels(tmp_path / "c" / folder, tmp_path / "p" / folder)


@pytest.mark.parametrize(
    ("dtype", "suffix", "channels"),
    [(np.uint16, ".png", 1), (np.float32, ".tiff", 1), (np.uint8, ".bmp", 3)],
)
def test_register_keeps_the_type_of_the_source(
    both: Callable[..., tuple[Process, Result]],
    scene: Path,
    tmp_path: Path,
    dtype: type,
    suffix: str,
    channels: int,
) -> None:
    def change(image: Image) -> Image:
        changed = image.astype(dtype) * dtype(100 if dtype == np.uint16 else 1)
        return np.dstack([changed] * 3) if channels == 3 else changed

    rewrite(scene / "thermal", change, suffix)
    both("register", scene / "rig.yaml", *folders(scene), "-o", tmp_path / "OUT")
    assert read_image(list_files(tmp_path / "c")[0]).dtype == dtype
    assert_same_pixels(tmp_path / "c", tmp_path / "p")


@pytest.mark.parametrize("kind", [".npy", "fortran", ">f8", "f2", ".tiff", ".exr"])
def test_depth_files(
    both: Callable[..., tuple[Process, Result]], scene: Path, tmp_path: Path, kind: str
) -> None:
    for path in list_files(scene / "depth"):
        depth = read_depth(path)
        depth[:3, :3] = (np.nan, np.inf, -1)
        if kind == ".exr":
            openexr = pytest.importorskip("OpenEXR")
            header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}
            openexr.File(header, {"Y": depth}).write(str(path.with_suffix(".exr")))
        elif kind == ".tiff":
            write_image(path.with_suffix(kind), depth)
        elif kind == "fortran":
            np.save(path.with_suffix(".npy"), np.asfortranarray(depth))
        else:
            given = depth if kind == ".npy" else depth.astype(kind)
            np.save(path.with_suffix(".npy"), given)
        path.unlink()
    both("register", scene / "rig.yaml", *folders(scene), "-o", tmp_path / "OUT")
    assert_same_pixels(tmp_path / "c", tmp_path / "p")
    assert_same_pixels(tmp_path / "c" / "masks", tmp_path / "p" / "masks")


def test_videos_in_and_out(
    both: Callable[..., tuple[Process, Result]], rendered: Path, tmp_path: Path
) -> None:
    """Without loss, so that what comes out is what went in."""
    for name in ("visible", "thermal"):
        images = [read_image(path) for path in list_files(rendered / name)]
        images = [image[: image.shape[0] // 2 * 2, : image.shape[1] // 2 * 2] for image in images]
        size = images[0].shape[1], images[0].shape[0]
        flags = [cv2.VIDEOWRITER_PROP_IS_COLOR, int(images[0].ndim == 3)]
        code = cv2.VideoWriter.fourcc(*"FFV1")
        writer = cv2.VideoWriter(
            str(tmp_path / f"{name}.mkv"), cv2.CAP_FFMPEG, code, 10, size, flags
        )
        for image in images:
            writer.write(image)
        writer.release()
    footage = (tmp_path / "visible.mkv", tmp_path / "thermal.mkv", "--depth", "plane")
    first, second = both("register", rendered / "rig.yaml", *footage, "-o", tmp_path / "OUT")
    assert_same_pixels(tmp_path / "c", tmp_path / "p")
    assert first.stderr == second.stderr
    assert f"{FRAMES} pairs by time" in first.stderr
    both("register", rendered / "rig.yaml", *footage, "-o", tmp_path / "OUT.mkv")
    for name in ("c.mkv", "c.masks.mkv"):
        ours, theirs = (cv2.VideoCapture(str(tmp_path / file)) for file in (name, "p" + name[1:]))
        for _ in range(FRAMES):
            np.testing.assert_array_equal(ours.read()[1], theirs.read()[1])
    assert not list(tmp_path.glob(".*partial*"))


def test_video_of_16_bits_is_not_cut_to_8(
    cli: Callable[..., Process], rendered: Path, tmp_path: Path
) -> None:
    images = [read_image(path).astype(np.uint16) * 200 for path in list_files(rendered / "thermal")]
    height, width = images[0].shape[0] // 2 * 2, images[0].shape[1] // 2 * 2
    flags = [cv2.VIDEOWRITER_PROP_IS_COLOR, 0, cv2.VIDEOWRITER_PROP_DEPTH, cv2.CV_16U]
    code, film = cv2.VideoWriter.fourcc(*"FFV1"), tmp_path / "thermal.mkv"
    writer = cv2.VideoWriter(str(film), cv2.CAP_FFMPEG, code, 10, (width, height), flags)
    for image in images:
        writer.write(np.ascontiguousarray(image[:height, :width]))
    writer.release()
    out = tmp_path / "out"
    arguments = ("--depth", "plane", "--pair", "order", "-o", out)
    result = cli("register", rendered / "rig.yaml", rendered / "visible", film, *arguments)
    # OpenCV 4.8 and later decode all bits, those before it 8.
    if result.returncode == 0:
        assert read_image(list_files(out)[0]).dtype == np.uint16
    else:
        assert result.returncode == 2 and "16-bit gray" in result.stderr


def test_patterns_halves_and_stacks(
    both: Callable[..., tuple[Process, Result]], rendered: Path, tmp_path: Path
) -> None:
    thermal = [read_image(path) for path in list_files(rendered / "thermal")]
    names = [path.stem for path in list_files(rendered / "visible")]
    for name, image in zip(names, thermal, strict=True):
        write_image(tmp_path / "wide" / f"{name}.png", np.hstack([np.zeros_like(image), image]))
    cv2.imwritemulti(str(tmp_path / "thermal.tiff"), thermal)
    rig, depth = rendered / "rig.yaml", ("--depth", rendered / "depth")
    pattern = rendered / "visible" / "*.png"
    for number, source in enumerate((f"{tmp_path / 'wide'}#right", tmp_path / "thermal.tiff")):
        out = tmp_path / f"OUT{number}"
        both("register", rig, pattern, source, *depth, "--pair", "order", "-o", out)
        assert_same_pixels(tmp_path / f"c{number}", tmp_path / f"p{number}")


# -- evaluate, inspect, bench


def test_evaluate_gives_the_same_scores(
    both: Callable[..., tuple[Process, Result]], rendered: Path, tmp_path: Path
) -> None:
    arguments = ("evaluate", rendered / "rig.yaml", *folders(rendered))
    first, second = both(*arguments, "--json", tmp_path / "OUT.json")
    assert first.stdout == second.stdout
    assert "patch median" in first.stdout
    assert (tmp_path / "c.json").read_bytes() == (tmp_path / "p.json").read_bytes()
    assert json.loads((tmp_path / "c.json").read_text())["registered"]["nec"] > 0


def test_inspect_prints_the_same(
    both: Callable[..., tuple[Process, Result]], rendered: Path
) -> None:
    first, second = both("inspect", rendered / "rig.yaml")
    assert first.stdout == second.stdout
    first, second = both("inspect", rendered / "rig.yaml", "--json")
    assert first.stdout == second.stdout
    assert json.loads(first.stdout)["reference"]["width"] == WIDTH


def test_bench_times_frames(cli: Callable[..., Process], rendered: Path) -> None:
    result = cli("bench", "--rig", rendered / "rig.yaml", "--frames", 20, "--json")
    assert result.returncode == 0, result.stderr
    results = [json.loads(line) for line in result.stdout.splitlines()][:-1]
    assert len(results) > 2
    assert all(0 < r["median_ms"] <= r["p99_ms"] <= r["worst_ms"] for r in results)
    assert results[0]["reference_size"] == [320, 240]
    assert "320x240" in cli("bench", "--reference", "320x240", "--frames", 5).stdout


# -- Refused input: exit 2, the line of the Python command


@pytest.mark.parametrize(
    "arguments",
    [
        ("calibrate", "visible", "nowhere", "--depth", "depth", "-o", "OUT.yaml"),
        ("calibrate", "visible", "empty", "--depth", "depth", "-o", "OUT.yaml"),
        ("calibrate", "visible", "lost", "--depth", "depth", "-o", "OUT.yaml"),
        ("calibrate", "visible", "renamed", "--depth", "depth", "-o", "OUT.yaml"),
        ("calibrate", "visible", "twice", "--depth", "depth", "-o", "OUT.yaml"),
        ("calibrate", "visible", "sizes", "--depth", "depth", "-o", "OUT.yaml"),
        ("calibrate", "visible", "thermal", "--depth", "cut", "-o", "OUT.yaml"),
        ("calibrate", "visible", "thermal", "--depth", "unknown", "-o", "OUT.yaml"),
        ("calibrate", "visible", "thermal", "--depth", "bytes", "-o", "OUT.yaml"),
        ("calibrate", "visible", "thermal", "--depth", "depth", "-o", "rig.yaml/x/OUT.yaml"),
        ("calibrate", "visible", "thermal", "--depth", "plane", "-o", "r", "--far", "0"),
        ("calibrate", "visible", "thermal", "--depth", "plane", "-o", "r", "--horizon", "nan"),
        ("calibrate", "visible", "thermal", "--depth", "depth", "-o", "r", "--depth-scale", "0"),
        ("calibrate", "visible", "thermal", "--depth", "depth", "-o", "r", "--refine-plane"),
        ("calibrate", "visible", "thermal", "--depth", "depth", "-o", "r", "--initial", "no.yaml"),
        ("calibrate", "visible", "thermal", "--depth", "depth", "-o", "r", "--time-offset", "1"),
        ("calibrate", "visible", "thermal", "--depth", "depth", "-o", "r", "--time-offset", "1s"),
        ("calibrate", "visible", "thermal", "--depth", "depth", "-o", "r", "--time-offset", "9f"),
        (
            "register",
            "rig.yaml",
            "visible",
            "thermal",
            "--depth",
            "depth",
            "-o",
            "OUT",
            "--time-offset",
            "auto",
            "--pair",
            "time",
        ),
        (
            "calibrate",
            "visible",
            "thermal",
            "--depth",
            "plane",
            "-o",
            "r",
            "--refine-plane",
            "--depth-steady",
        ),
        (
            *("calibrate", "visible", "thermal", "--depth", "depth", "-o", "r"),
            *("--reference-intrinsics", "1,1,0,0", "--optimize-reference"),
        ),
        (
            *("calibrate", "visible", "thermal", "--depth", "depth", "-o", "r"),
            *("--optimize-lens", "--source-lens", "fisheye:0.1,0,0,0"),
        ),
        (
            *("calibrate", "visible", "thermal", "--depth", "depth", "-o", "r"),
            *("--choose", "spread", "--explain"),
        ),
        (
            *("calibrate", "visible", "thermal", "--depth", "depth", "-o", "r"),
            *("--source-colormap", "mud"),
        ),
        (
            *("calibrate", "visible", "thermal", "--depth", "depth", "-o", "r"),
            *("--source-lens", "brown:1,2,3"),
        ),
        ("register", "rig.yaml", "visible", "thermal", "--depth", "depth", "-o", "visible"),
        ("register", "other.yaml", "visible", "thermal", "--depth", "depth", "-o", "OUT"),
        ("register", "rig.yaml", "visible", "short", "--depth", "depth", "-o", "OUT"),
        ("register", "rig.yaml", "visible", "thermal", "--depth", "wide", "-o", "OUT"),
        ("evaluate", "rig.yaml", "visible/*.gif", "thermal", "--depth", "depth"),
        ("evaluate", "rig.yaml", "visible#middle.mp4", "thermal#left", "--depth", "depth"),
        ("evaluate", "rig.yaml", "visible", "broken.mp4", "--depth", "depth"),
        ("inspect", "other.yaml"),
        ("inspect", "no.yaml"),
    ],
)
def test_both_refuse_with_the_same_line(
    both: Callable[..., tuple[Process, Result]],
    scene: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
) -> None:
    monkeypatch.chdir(scene)

    def copied(folder: str, source: str, change: Callable[[int, Image], Image | None]) -> None:
        for number, path in enumerate(list_files(scene / source)):
            image = change(number, cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
            if image is not None:
                write_image(scene / folder / path.name, image)

    Path("empty").mkdir()
    copied("lost", "thermal", lambda number, image: image if number else None)
    copied("renamed", "thermal", lambda number, image: image)
    list_files(scene / "renamed")[1].rename("renamed/977.png")
    copied("twice", "thermal", lambda number, image: image)
    write_image(list_files(scene / "twice")[0].with_suffix(".bmp"), np.zeros((9, 9), np.uint8))
    copied("sizes", "thermal", lambda number, image: image[number:])
    copied("cut", "depth", lambda number, image: image)
    for path in list_files(scene / "cut"):
        path.write_bytes(path.read_bytes()[:-20])
    copied("unknown", "depth", lambda number, image: 0 * image)
    copied("bytes", "depth", lambda number, image: image.astype(np.uint8))
    copied("wide", "depth", lambda number, image: image[:100])
    copied("short", "thermal", lambda number, image: image[:, :-20])
    Path("other.yaml").write_text(Path("rig.yaml").read_text().replace("version: 1", "version: 7"))
    Path("broken.mp4").write_bytes(b"no video")

    before = sorted(scene.rglob("*"))
    first, second = both(*arguments)
    assert first.returncode == 2
    ours, theirs = (text.replace("/p.", "/c.") for text in (first.stderr, second.stderr))
    assert ours.startswith("error: ") and ours.count("\n") == 1
    # Only what names the kinds of input that one of them knows differs.
    if "expected #TOPIC behind a bag" in theirs:
        assert "expected one of #left" in ours
    else:
        assert ours == theirs
    assert first.stdout == ""
    assert sorted(scene.rglob("*")) == before


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--depth", "model.onnx"), "model.onnx"),
        (("--depth", "stereo:right"), "stereo:right"),
        (("--depth", "drive.mcap#/depth"), "drive.mcap"),
        (("--depth", "depth", "--lidar-calibration", "x"), "--lidar-calibration"),
        (("--depth", "depth", "--flow", "raft.onnx"), "raft.onnx"),
        (("--depth", "depth", "--providers", "cuda"), "--providers"),
    ],
)
def test_what_only_python_does_is_named(
    cli: Callable[..., Process], rendered: Path, arguments: tuple[str, ...], named: str
) -> None:
    result = cli("calibrate", "visible", "thermal", *arguments, "-o", "r.yaml", cwd=rendered)
    assert result.returncode == 2
    assert named in result.stderr and "the Python command, `xcalib`" in result.stderr
    many = cli(
        *("register", "rig.yaml", "visible", "thermal", "--depth", "depth", "-o", "o"),
        *("--scheduler", "tcp://localhost:1"),
        cwd=rendered,
    )
    assert many.returncode == 2 and "--scheduler: several workers are used by the" in many.stderr
    bag = cli("evaluate", "rig.yaml", "a.mcap#/v", "thermal", "--depth", "plane", cwd=rendered)
    assert bag.returncode == 2 and "Python command" in bag.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("calibrate",),
        ("calibrate", "a", "b", "--depth", "plane", "-o", "r", "--wild"),
        ("calibrate", "a", "b", "--depth", "plane", "-o", "r", "--frames", "0"),
        ("calibrate", "a", "b", "--depth", "plane", "-o", "r", "--search", "wild"),
        ("calibrate", "a", "b", "--depth", "plane", "-o", "r", "--seed", "-1"),
        ("calibrate", "a", "b", "--depth", "plane", "-o", "r", "--source-intrinsics", "1,2,3"),
        ("calibrate", "a", "b", "--depth", "plane", "-o", "r", "--report", "page.html"),
        ("register", "r", "a", "b", "--depth-sync", "each", "-o", "x"),
        ("bench", "--reference", "wide"),
    ],
)
def test_wrong_usage(cli: Callable[..., Process], tmp_path: Path, arguments: Any) -> None:
    result = cli(*arguments, cwd=tmp_path)
    assert result.returncode == 2
    assert result.stderr.startswith("error: ") and result.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_stereo_calibration_is_the_three_numbers(
    both: Callable[..., tuple[Process, Result]], scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(scene)
    Path("disparity").mkdir()
    for path in list_files("depth"):
        depth = read_depth(path)
        with np.errstate(divide="ignore"):
            disparity = np.where(depth > 0, 0.5 * 300 / depth - 0.1, np.nan).astype(np.float32)
        np.save(Path("disparity") / path.with_suffix(".npy").name, disparity)
    Path("stereo.yaml").write_text("baseline: 0.5\nfocal: 300\ndoffs: 0.1\n")
    given = ("evaluate", "rig.yaml", "visible", "thermal", "--width", "80", "--depth")
    first, second = both(*given, "disparity:disparity", "--stereo-calibration", "stereo.yaml")
    plain = run(*given, "depth")
    tables = [r.stdout.split("depth:")[0].splitlines()[1:4] for r in (first, second, plain)]
    assert tables[0] == tables[1] == tables[2] and len(tables[0]) == 3
    for text, problem in (
        ("baseline: 0.5\n", "stereo.yaml: focal is missing"),
        ("baseline: x\nfocal: 3\n", "stereo.yaml: baseline is 'x', expected a number"),
        ("baseline: 1\nfocal: 3\nz: 1\n", "unknown key 'z', expected baseline, focal, doffs"),
        ("baseline: -1\nfocal: 3\n", "stereo baseline is -1, expected above 0 m"),
    ):
        Path("stereo.yaml").write_text(text)
        first, second = both(*given, "disparity:disparity", "--stereo-calibration", "stereo.yaml")
        assert first.returncode == 2 and problem in first.stderr
        assert first.stderr == second.stderr


def test_help_and_version(cli: Callable[..., Process]) -> None:
    assert cli("--version").stdout == f"xcalib-cli, version {run('--version').stdout.split()[-1]}\n"
    for command in ("calibrate", "register", "evaluate", "inspect", "bench"):
        result = cli(command, "--help")
        assert result.returncode == 0
        assert f"{command}" in result.stdout


# What the Python command alone does, docs/cli.md.
ONLY_PYTHON = {
    *("--depth-recipe", "--depth-focal", "--inverse-scale", "--inverse-shift", "--providers"),
    *("--lidar-calibration", "--workers", "--scheduler"),
}


@pytest.mark.parametrize("command", ["calibrate", "register", "evaluate", "inspect"])
def test_the_options_are_those_of_the_python_command(
    cli: Callable[..., Process], command: str
) -> None:
    python = python_command.get_command(click.Context(python_command), command)
    assert python is not None
    theirs = {flag for option in python.params for flag in option.opts}
    ours = set(re.findall(r"-[\w-]+", cli(command, "--help").stdout))
    assert {flag for flag in theirs - ours if flag.startswith("-")} == ONLY_PYTHON & theirs


def test_nothing_valid_is_not_trusted(
    both: Callable[..., tuple[Process, Result]], scene: Path, tmp_path: Path
) -> None:
    rig = Rig.load(scene / "rig.yaml")
    rig.R = np.diag([-1.0, 1.0, -1.0])  # looks the other way
    rig.save(scene / "rig.yaml")
    for command, more in (("register", ("-o", tmp_path / "OUT")), ("evaluate", ())):
        first, second = both(command, scene / "rig.yaml", *folders(scene), *more)
        assert first.returncode == 3
        assert first.stderr == second.stderr.replace("/p is", "/c is")
        assert first.stderr.startswith("not to be trusted: no pixel")


def test_interrupted(binary: Path, rendered: Path, tmp_path: Path) -> None:
    arguments = ["calibrate", *folders(rendered), "-o", tmp_path / "rig.yaml", "--json"]
    with subprocess.Popen(
        [str(binary), *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None and process.stderr is not None
        for line in process.stdout:
            if '"search"' in line:
                break
        process.send_signal(signal.SIGINT)
        process.stdout.read()
        assert process.stderr.read() == "error: interrupted\n"
        assert process.wait() == 1
    assert not (tmp_path / "rig.yaml").exists()


# -- Live cameras, without cameras: patterns of images and a pipe


def packed(depth: Image, stamp: int = 0, scale: float = 1 / 256, magic: bytes = b"XCDP") -> bytes:
    kind = {np.dtype("uint16"): 1, np.dtype("float32"): 2}[depth.dtype]
    height, width = depth.shape
    return struct.pack("<4sIIIdQ", magic, width, height, kind, scale, stamp) + depth.tobytes()


@pytest.fixture
def cameras(rendered: Path, tmp_path: Path) -> tuple[str, str]:
    """Two sources as OpenCV opens them, of gray and colour images."""
    for name in ("visible", "thermal"):
        for number, path in enumerate(list_files(rendered / name)):
            write_image(tmp_path / name / f"{number:04d}.png", read_image(path))
    return tuple(str(tmp_path / name / "%04d.png") for name in ("visible", "thermal"))


def live(
    binary: Path, cameras: tuple[str, str], stream: bytes | list[bytes], *arguments: Any
) -> Process:
    """Run `register --live` with a pipe for its depth; a list is written with a pause between."""
    reading, writing = os.pipe()

    def write() -> None:
        with os.fdopen(writing, "wb") as pipe:
            for part in [stream] if isinstance(stream, bytes) else stream:
                try:
                    pipe.write(part)
                    pipe.flush()
                except BrokenPipeError:
                    return
                if isinstance(stream, list):
                    time.sleep(5)

    feeder = threading.Thread(target=write)
    feeder.start()
    command = [binary, "register", *arguments[:1], *cameras, "--live", "--depth-fd", reading]
    result = subprocess.run(
        [*map(str, command), *map(str, arguments[1:])],
        capture_output=True,
        text=True,
        check=False,
        pass_fds=[reading],
        timeout=120,
    )
    os.close(reading)
    feeder.join()
    return result


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_live_frames_are_those_of_files(
    binary: Path, cameras: tuple[str, str], rendered: Path, tmp_path: Path, dtype: type
) -> None:
    counts = [
        cv2.imread(str(path), cv2.IMREAD_UNCHANGED) for path in list_files(rendered / "depth")
    ]
    scale = 1 / 256 if dtype == np.uint16 else 1.0
    maps = counts if dtype == np.uint16 else [map_ / np.float32(256) for map_ in counts]
    stream = b"".join(packed(map_, 100 * i, scale) for i, map_ in enumerate(maps))
    out = tmp_path / "live"
    result = live(
        *(binary, cameras, stream, rendered / "rig.yaml"),
        *("--depth-sync", "each", "-o", out, "--json", "--overlay"),
    )
    assert result.returncode == 0, result.stderr
    events = [json.loads(line) for line in result.stdout.splitlines()]
    frames = [event for event in events if event["event"] == "frame"]
    assert [frame["depth_timestamp_us"] for frame in frames] == [100 * i for i in range(FRAMES)]
    # OpenCV reads patterns as colour: the files' thermal images, with three channels.
    rewrite(tmp_path / "thermal", lambda image: np.dstack([image] * 3))
    arguments = ("--depth", rendered / "depth", "--pair", "order", "-o", tmp_path / "files")
    files = (tmp_path / "visible", tmp_path / "thermal")
    assert run("register", rendered / "rig.yaml", *files, *arguments).exit_code == 0
    for folder in ("", "masks"):
        pairs = zip(list_files(out / folder), list_files(tmp_path / "files" / folder), strict=True)
        for ours, theirs in pairs:
            np.testing.assert_array_equal(read_image(ours), read_image(theirs))
    assert len(list_files(out / "overlays")) == FRAMES


def test_live_takes_the_latest_map_and_stops_where_asked(
    binary: Path, cameras: tuple[str, str], rendered: Path, tmp_path: Path
) -> None:
    height, width = read_image(list_files(rendered / "visible")[0]).shape[:2]
    ones = np.full((height // 2, width // 2), 2560, np.uint16)
    # The pipe stays open, and silent: the one map is used again.
    result = live(
        *(binary, cameras, [packed(ones, 7)], rendered / "rig.yaml"),
        *("-o", tmp_path / "live", "--frames", 3, "--json"),
    )
    assert result.returncode == 0, result.stderr
    events = [json.loads(line) for line in result.stdout.splitlines()]
    stamps = [event["depth_timestamp_us"] for event in events if event["event"] == "frame"]
    assert stamps == [7, 7, 7]
    assert len(list_files(tmp_path / "live")) == 3


@pytest.mark.parametrize(
    ("stream", "problem"),
    [
        (packed(np.ones((4, 4), np.uint16), magic=b"JPEG"), "no header"),
        (packed(np.ones((4, 4), np.uint16))[:-1], "ends inside of a depth map"),
        (packed(np.ones((4, 4), np.uint16))[:20], "ends inside of a depth map"),
        (packed(np.ones((4, 4), np.uint16), scale=0.0), "scale is 0"),
        (struct.pack("<4sIIIdQ", b"XCDP", 0, 4, 1, 1.0, 0), "depth is 0x4"),
        (struct.pack("<4sIIIdQ", b"XCDP", 99999, 4, 1, 1.0, 0), "depth is 99999x4"),
        (struct.pack("<4sIIIdQ", b"XCDP", 4, 4, 9, 1.0, 0), "type is 9"),
        (packed(np.ones((4, 400), np.uint16)), "400x4"),
    ],
)
def test_bad_depth_streams(
    binary: Path,
    cameras: tuple[str, str],
    rendered: Path,
    tmp_path: Path,
    stream: bytes,
    problem: str,
) -> None:
    arguments = ("--depth-sync", "each", "-o", tmp_path / "live")
    result = live(binary, cameras, stream, rendered / "rig.yaml", *arguments)
    assert result.returncode == 2
    assert result.stderr.startswith("error: ") and result.stderr.count("\n") == 1
    assert problem in result.stderr


def test_live_needs_what_it_needs(
    cli: Callable[..., Process], cameras: tuple[str, str], rendered: Path, tmp_path: Path
) -> None:
    rig, out = rendered / "rig.yaml", ("-o", tmp_path / "live", "--live")
    result = cli("register", rig, *cameras, *out)
    assert result.returncode == 2 and "--depth-fd N or --depth plane" in result.stderr
    nowhere = tmp_path / "none.mp4"
    result = cli("register", rig, nowhere, cameras[1], "--depth", "plane", *out)
    assert result.returncode == 2 and f"{nowhere}: OpenCV cannot open it" in result.stderr
    result = cli("register", rig, *cameras, "--depth", "plane", *out)
    assert result.returncode == 0, result.stderr
    assert len(list_files(tmp_path / "live")) == FRAMES
