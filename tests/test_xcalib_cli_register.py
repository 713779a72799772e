"""xcalib-cli register interrupted and taken up again; offsets of clocks that both commands find."""

from __future__ import annotations

import fcntl
import json
import random
import re
import resource
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import Result

from conftest import FRAMES, Process, run
from drive import COPIES, arguments, contents, files_below, same_frames
from test_footage import IDENTITY, THERMAL, VISIBLE, Pan
from xcalib.footage import journal_of, open_stream
from xcalib.frames import Image, list_files, read_image, write_image

TOTAL = FRAMES * COPIES
Both = Callable[..., tuple[Process, Result]]


def pixels(out: Path) -> dict[str, Image]:
    """The same, decoded: both commands' OpenCV pack PNG differently."""
    names = files_below(out)
    return {name: read_image(p) for name, p in names.items() if not name.endswith(".jsonl")}


def assert_equal(first: dict[str, Image], second: dict[str, Image]) -> None:
    assert first.keys() == second.keys()
    for name, image in first.items():
        np.testing.assert_array_equal(image, second[name], name)


def interrupted(
    command: tuple[Any, ...], begun: Callable[[], bool], how: signal.Signals, delay: float
) -> tuple[int, str]:
    """Run a command, and send the signal some time after it has begun."""
    given = list(map(str, command))
    child = subprocess.Popen(given, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while child.poll() is None and not begun():
        time.sleep(0.0005)
    time.sleep(delay)
    child.send_signal(how)
    output, errors = child.communicate(timeout=60)
    # The signal may come after the last frame, even when the process is ending.
    return 0 if " frames" in output else child.returncode, errors


def grows(journal: Path) -> Callable[[], bool]:
    """Whether something new is noted."""
    size = journal.stat().st_size if journal.exists() else 0
    return lambda: journal.exists() and journal.stat().st_size > size


def whole_lines(journal: Path) -> list[str]:
    """The units of a journal, without half a line that a killed run may leave."""
    text = journal.read_text() if journal.exists() else ""
    return text[: text.rfind("\n") + 1].splitlines()[1:]


# -- Interrupted, and taken up again


@pytest.mark.parametrize(
    ("how", "more"),
    [
        (signal.SIGINT, ()),
        (signal.SIGTERM, ()),
        (signal.SIGKILL, ("--overlay",)),
    ],
)
def test_an_interrupted_folder_loses_and_repeats_nothing(
    binary: Path,
    cli: Callable[..., Process],
    drive: Path,
    tmp_path: Path,
    how: signal.Signals,
    more: tuple[str, ...],
) -> None:
    out, rng = tmp_path / "out", random.Random(int(how))
    journal, stopped = out / "register.jsonl", 0
    for _ in range(4):
        before = {name: path.stat().st_mtime_ns for name, path in files_below(out).items()}
        noted = [json.loads(line) for line in whole_lines(journal)]
        command = (binary, *arguments(drive, out, *more))
        code, errors = interrupted(command, grows(journal), how, rng.random() * 0.03)
        after = files_below(out)
        for line in noted:
            for name in line["files"]:
                assert after[name].stat().st_mtime_ns == before[name], f"{name} was made again"
        if code == 0:
            break
        stopped += 1
        assert code == (-how if how == signal.SIGKILL else 1)
        if how != signal.SIGKILL:
            done = len(whole_lines(journal))
            line = re.fullmatch(
                r"error: interrupted; (\d+) of 120 frames are done, the same command goes on from"
                r" there\n",
                errors,
            )
            assert line and int(line[1]) == done
            # Every frame that is there is whole, and is noted.
            assert len(after) == (3 if more else 2) * done + 1
    assert stopped
    result = cli(*arguments(drive, out, *more))
    assert result.returncode == 0, result.stderr
    assert cli(*arguments(drive, tmp_path / "whole", *more)).returncode == 0
    assert contents(out) == contents(tmp_path / "whole")
    # And it is what Python makes, threads or none.
    assert run(*arguments(drive, tmp_path / "python", *more)).exit_code == 0
    assert_equal(pixels(out), pixels(tmp_path / "python"))


@pytest.mark.parametrize("out", ["out", "out.mkv"])
def test_neither_command_goes_on_with_what_the_other_began(
    cli: Callable[..., Process], rendered: Path, tmp_path: Path, out: str
) -> None:
    given = arguments(rendered, tmp_path / out)
    assert cli(*given).returncode == 0
    before = contents(tmp_path)
    result = run(*given)
    assert result.exit_code == 2
    assert (
        "(command xcalib-cli, now xcalib); expected the same, another output, or --overwrite"
        in (result.stderr)
    )
    assert result.stderr.count("\n") == 1 and contents(tmp_path) == before
    assert run(*given, "--overwrite").exit_code == 0
    refused = cli(*given)
    assert refused.returncode == 2 and "(command xcalib, now xcalib-cli)" in refused.stderr
    assert cli(*given, "--overwrite").returncode == 0
    assert contents(tmp_path).keys() == before.keys()


def test_paths_may_be_written_otherwise(
    cli: Callable[..., Process], drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of both commands: what a run was made with is the files, not how they were named."""
    monkeypatch.chdir(drive)
    given = ("register", "rig.yaml", "./visible/", f"{drive}//thermal", "--depth", "depth/")
    for name, command in (("c", cli), ("p", run)):
        out = tmp_path / name
        command(*arguments(drive, out))
        again = command(*given, "-o", str(out))
        assert f"({TOTAL} from before)" in again.stdout, again.stderr


@pytest.fixture(scope="module")
def film(rendered: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    """A rig, and two lossless videos of 600 small frames, each with noise of its own."""
    folder = tmp_path_factory.mktemp("film")
    rng = np.random.default_rng(0)
    for kind in ("visible", "thermal"):
        images = [cv2.resize(read_image(path), (120, 80)) for path in list_files(rendered / kind)]
        flags = [cv2.VIDEOWRITER_PROP_IS_COLOR, int(images[0].ndim == 3)]
        size = images[0].shape[1], images[0].shape[0]
        code = cv2.VideoWriter.fourcc(*"FFV1")
        writer = cv2.VideoWriter(str(folder / f"{kind}.mkv"), cv2.CAP_FFMPEG, code, 30, size, flags)
        for index in range(600):
            image = images[index % FRAMES]
            writer.write(image // 2 + rng.integers(0, 120, image.shape, np.uint8))
        writer.release()
    IDENTITY.save(folder / "rig.yaml")
    return folder / "rig.yaml", folder / "visible.mkv", folder / "thermal.mkv"


@pytest.mark.parametrize(
    ("suffix", "how"),
    [
        (".mkv", signal.SIGKILL),
        (".avi", signal.SIGTERM),
        (".mp4", signal.SIGINT),
    ],
)
def test_an_interrupted_video_loses_and_repeats_nothing(
    binary: Path,
    cli: Callable[..., Process],
    film: tuple[Path, ...],
    tmp_path: Path,
    suffix: str,
    how: signal.Signals,
) -> None:
    given = ("register", *film, "--depth", "plane", "--overlay", "-o")
    out, journal = tmp_path / f"out{suffix}", tmp_path / f"out{suffix}.register.jsonl"
    command, parts, rng = (binary, *given, out), tmp_path / f"out{suffix}.parts", random.Random(1)
    code, done, stopped = 1, list[str](), 0
    for _ in range(2 if how == signal.SIGKILL else 4):
        begun = grows(journal)
        if how != signal.SIGKILL:  # which loses the open part
            begun = lambda: any(parts.glob("*.partial"))  # noqa: E731
        code, _ = interrupted(command, begun, how, 0.1 * rng.random())
        lines = [json.loads(line) for line in whole_lines(journal)]
        noted = [key for line in lines if out.name not in line["files"] for key in line["frames"]]
        assert len(noted) == len(set(noted)), "a frame was made again"
        assert noted[: len(done)] == done, "a frame was lost"
        done = noted
        if code == 0:
            break
        stopped += 1
        assert code == (-how if how == signal.SIGKILL else 1)
        assert not out.exists()
        if how != signal.SIGKILL:
            assert not any(parts.glob("*.partial"))
    assert stopped > 1
    if code != 0:
        result = cli(*given, out)
        assert result.returncode == 0, result.stderr
    made = {path.name for path in tmp_path.iterdir()}
    overlay = f"out.overlay{suffix}"
    assert made == {out.name, "out.masks.mkv", overlay, journal.name}
    again = cli(*given, out)
    assert again.stdout.startswith("600 frames (600 from before), ")
    whole = tmp_path / f"whole{suffix}"
    assert cli(*given, whole).returncode == 0
    tolerance = 2 if suffix == ".mp4" else 0
    same_frames(out, whole, tolerance)
    same_frames(tmp_path / "out.masks.mkv", tmp_path / "whole.masks.mkv")
    same_frames(tmp_path / overlay, tmp_path / f"whole.overlay{suffix}", tolerance)
    if suffix == ".mkv":
        assert cli(*given, tmp_path / "folder").returncode == 0
        same_frames(out, tmp_path / "folder")
        same_frames(tmp_path / overlay, tmp_path / "folder" / "overlays")
        assert run(*given, tmp_path / "python.mkv").exit_code == 0
        same_frames(out, tmp_path / "python.mkv")
    else:  # of one quality
        assert run(*given, tmp_path / f"python{suffix}").exit_code == 0
        same_frames(out, tmp_path / f"python{suffix}", 2)
        ratio = out.stat().st_size / (tmp_path / f"python{suffix}").stat().st_size
        assert 0.9 < ratio < 1.1


def test_a_video_is_gone_on_with_by_the_same_encoder_only(
    cli: Callable[..., Process], rendered: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out.mkv"
    assert cli(*arguments(rendered, out)).returncode == 0
    journal = journal_of(out)
    text = journal.read_text()
    assert re.search(r'"encoder":"libavcodec [0-9.]+"', text)
    journal.write_text(re.sub(r"libavcodec [0-9.]+", "libavcodec 1.2.3", text))
    result = cli(*arguments(rendered, out))
    assert result.returncode == 2 and "(encoder libavcodec 1.2.3, now libavcodec" in result.stderr


def test_16_bits_in_a_video(cli: Callable[..., Process], scene: Path, tmp_path: Path) -> None:
    for path in list_files(scene / "thermal"):
        write_image(path, read_image(path).astype(np.uint16) * 200)
    given = ("register", scene / "rig.yaml", scene / "visible", scene / "thermal")
    given = (*given, "--depth", scene / "depth", "-o")
    assert cli(*given, tmp_path / "out.mkv").returncode == 0
    assert cli(*given, tmp_path / "out").returncode == 0
    images = open_stream(tmp_path / "out.mkv")
    assert images[0].dtype == np.uint16 and images[0].max() > 255
    same_frames(tmp_path / "out.mkv", tmp_path / "out")
    refused = cli(*given, tmp_path / "other.mp4")
    assert refused.returncode == 2 and ".mp4 holds uint8, a folder holds any" in refused.stderr


@pytest.mark.parametrize("out", ["OUT", "OUT.mkv"], ids=["folder", "video"])
def test_made_otherwise(both: Both, drive: Path, tmp_path: Path, out: str) -> None:
    """Neither mixed nor thrown away, unless that is asked for."""
    given = arguments(drive, tmp_path / out)
    both(*given)
    before = contents(tmp_path)
    for more, named in (
        (("--nearest",), "nearest no, now yes"),
        (("--far", "40"), "now 40"),
        (("--overlay",), "overlay no, now yes"),
        (("--far", "40", "--time-offset", "auto", "--pair", "time"), "needs times of both"),
    ):
        first, second = both(*given, *more)
        assert first.returncode == 2
        assert named in first.stderr and named in second.stderr
    assert contents(tmp_path) == before
    first, _ = both(*given, "--nearest", "--overwrite")
    assert first.returncode == 0
    after = contents(tmp_path)
    assert after.keys() == before.keys() and after != before
    # It is now the output of that command, and the other is refused.
    first, second = both(*given, "--nearest")
    assert first.stdout == second.stdout.replace("/p.", "/c.").replace("/p\n", "/c\n")
    assert first.stdout.startswith(f"{TOTAL} frames ({TOTAL} from before), ")
    assert both(*given)[0].returncode == 2


def test_changed_missing_and_damaged_files_are_made_again(
    cli: Callable[..., Process], rendered: Path, tmp_path: Path
) -> None:
    scene = Path(shutil.copytree(rendered, tmp_path / "scene"))
    out = tmp_path / "out"
    assert cli(*arguments(scene, out)).returncode == 0
    whole, journal = contents(out), out / "register.jsonl"
    names = [path.name for path in list_files(out)]
    (out / names[3]).unlink()
    (out / "masks" / names[4]).write_bytes(b"")
    (out / "masks" / f".{names[5]}.0123456789abcdef.partial").write_bytes(b"half")
    journal.write_text(journal.read_text() + '{"frames": {"12')  # as a power cut leaves it
    result = cli(*arguments(scene, out))
    assert f"({FRAMES - 2} from before)" in result.stdout
    assert contents(out) == whole
    path = list_files(scene / "thermal")[2]
    write_image(path, 255 - read_image(path))
    assert f"({FRAMES - 1} from before)" in cli(*arguments(scene, out)).stdout
    assert contents(out) != whole
    for text in ("{}\n", "no\n", '{"format": "x"}\n{"frames": {}}\n'):
        journal.write_text(text)
        assert "not a journal" in cli(*arguments(scene, out)).stderr


def test_a_journal_cannot_remove_files_elsewhere(
    cli: Callable[..., Process], rendered: Path, tmp_path: Path
) -> None:
    (tmp_path / "mine").touch()
    out = tmp_path / "out"
    assert cli(*arguments(rendered, out)).returncode == 0
    journal = out / "register.jsonl"
    journal.write_text(journal.read_text() + '{"frames": {"a": 1}, "files": {"../mine": 0}}\n')
    assert cli(*arguments(rendered, out, "--overwrite")).returncode == 2
    assert (tmp_path / "mine").exists()


def test_two_runs_at_one_output(
    binary: Path, cli: Callable[..., Process], drive: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    given = [str(binary), *arguments(drive, out, "--threads", "1")]
    child = subprocess.Popen(given, stdout=subprocess.DEVNULL)
    while not whole_lines(out / "register.jsonl"):
        time.sleep(0.0005)
    child.send_signal(signal.SIGSTOP)
    try:
        results = cli(*arguments(drive, out)), run(*arguments(drive, out))
    finally:
        child.send_signal(signal.SIGCONT)
    assert child.wait(timeout=60) == 0
    for code, text in (
        (results[0].returncode, results[0].stderr),
        (results[1].exit_code, results[1].stderr),
    ):
        assert code == 2 and "another run is writing to this output" in text


def test_two_runs_that_begin_one_video(
    cli: Callable[..., Process], drive: Path, tmp_path: Path
) -> None:
    out = tmp_path / "new" / "out.mkv"
    out.parent.mkdir()
    with journal_of(out).open("w") as journal:  # nothing is written yet
        fcntl.flock(journal, fcntl.LOCK_EX)
        results = cli(*arguments(drive, out)), run(*arguments(drive, out))
    assert (results[0].returncode, results[1].exit_code) == (2, 2)
    for result in results:
        assert "another run is writing to this output" in result.stderr
    assert list(out.parent.iterdir()) == [journal_of(out)]


def test_a_link_to_what_is_not_there_is_kept(
    cli: Callable[..., Process], drive: Path, tmp_path: Path
) -> None:
    link = tmp_path / "out"
    link.symlink_to(tmp_path / "away" / "out")
    results = cli(*arguments(drive, link)), run(*arguments(drive, link))
    assert (results[0].returncode, results[1].exit_code) == (2, 2)
    assert link.is_symlink()


def test_a_journal_of_many_frames(cli: Callable[..., Process], drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.mkv"
    assert cli(*arguments(drive, out)).returncode == 0
    journal = journal_of(out)
    first, *units = journal.read_text().splitlines()
    unit = json.loads(units[-1])
    others = {f"{i:016x}": 1 for i in range(300_000)}  # looked up one by one: an hour
    longer = json.dumps({"frames": unit["frames"] | others, "files": unit["files"]})
    journal.write_text("\n".join([first, *units[:-1], longer, units[-1], ""]))
    assert cli(*arguments(drive, out)).returncode == 0


@pytest.mark.parametrize("out", ["out", "out.mkv", "out.mp4"])
def test_what_cannot_be_written_is_an_error(
    binary: Path, cli: Callable[..., Process], drive: Path, tmp_path: Path, out: str
) -> None:
    """A limit on the size of files stands for a full disk: writes fail just so."""
    limit = 20_000 if out == "out" else 150_000
    child = subprocess.run(
        [str(binary), *arguments(drive, tmp_path / out)],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )
    assert child.returncode == 2, child.stderr
    assert child.stderr.startswith(f"error: {tmp_path / out}")
    assert child.stderr.count("\n") == 1
    assert not (tmp_path / out).is_file()
    assert not [name for name in files_below(tmp_path) if "partial" in name]
    result = cli(*arguments(drive, tmp_path / out))
    assert result.returncode == 0, result.stderr
    cli(*arguments(drive, tmp_path / f"new{out}"))
    same_frames(tmp_path / out, tmp_path / f"new{out}", 2 if out.endswith(".mp4") else 0)


def test_an_error_keeps_what_came_before(
    cli: Callable[..., Process], drive: Path, tmp_path: Path
) -> None:
    """Exit 2 with the line of the first frame that fails; of a video nothing comes after it."""
    scene = Path(shutil.copytree(drive, tmp_path / "scene"))
    broken = [list_files(scene / "thermal")[index] for index in (40, 42)]
    data = [path.read_bytes() for path in broken]
    for path in broken:
        path.write_bytes(path.read_bytes()[:-20])
    for out in ("out", "out.mkv"):
        result = cli(*arguments(scene, tmp_path / out, "--threads", "4"))
        assert result.returncode == 2
        assert result.stderr.startswith(f"error: {broken[0]}: cannot decode")
        assert result.stderr.count("\n") == 1
    for path, bytes_ in zip(broken, data, strict=True):
        path.write_bytes(bytes_)
    assert "(40 from before)" in cli(*arguments(scene, tmp_path / "out.mkv")).stdout
    there = re.search(r"\((\d+) from before\)", cli(*arguments(scene, tmp_path / "out")).stdout)
    assert there and 40 <= int(there[1]) <= 44


def test_live_frames_do_not_mix_with_others(
    cli: Callable[..., Process], rendered: Path, film: tuple[Path, ...], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    assert cli(*arguments(rendered, out)).returncode == 0
    before = contents(out)
    given = ("register", *film, "--depth", "plane", "--live", "--frames", 3, "-o", out)
    result = cli(*given)
    assert result.returncode == 2 and "--overwrite" in result.stderr
    assert contents(out) == before
    assert cli(*given, "--overwrite").returncode == 0
    assert sorted(contents(out)) == sorted(
        name for i in range(3) for name in (f"{i:06d}.png", f"masks/{i:06d}.png")
    )
    assert not (out / "register.jsonl").exists()
    video = tmp_path / "live.mkv"
    assert cli(*given[:-1], video).returncode == 0
    assert len(open_stream(video)) == 3
    assert {path.name for path in tmp_path.iterdir()} == {"out", "live.mkv", "live.masks.mkv"}


def test_a_killed_live_video_is_made_of_its_parts(
    binary: Path, cli: Callable[..., Process], film: tuple[Path, ...], tmp_path: Path
) -> None:
    out = tmp_path / "out.mkv"
    given = ("register", *film, "--depth", "plane", "--live", "-o", out)
    some = lambda: bool(whole_lines(journal_of(out)))  # noqa: E731
    code, _ = interrupted((binary, *given), some, signal.SIGKILL, 0)
    assert code == -signal.SIGKILL and not out.exists()
    noted = [len(json.loads(line)["frames"]) for line in whole_lines(journal_of(out))]
    assert noted and set(noted) == {250}
    again = cli(*given)
    assert again.returncode == 2 and "`xcalib-cli join` makes a video of what" in again.stderr
    joined = cli("join", out)
    assert joined.returncode == 0, joined.stderr
    assert joined.stdout == f"{sum(noted)} frames: {out}\n"
    assert cli("register", *film, "--depth", "plane", "-o", tmp_path / "whole.mkv").returncode == 0
    for name in ("out.mkv", "out.masks.mkv"):
        made = open_stream(tmp_path / name)
        whole = open_stream(tmp_path / name.replace("out", "whole"))
        assert len(made) == sum(noted)
        for index in (0, 249):
            gray = cv2.extractChannel(made[index], 0)  # a live file is read as colour
            np.testing.assert_array_equal(gray, whole[index])
    assert not (tmp_path / "out.mkv.parts").exists()
    assert "is joined already" in cli("join", out).stderr
    refused = cli("join", tmp_path / "whole.mkv")
    assert refused.returncode == 2 and "expected those of a live run" in refused.stderr


# -- The offset of two clocks


@pytest.fixture(scope="module")
def pans(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    """Both containers start at zero; the source shows ten frames later what happened."""
    folder = tmp_path_factory.mktemp("pans")
    times = np.arange(150) / 30
    scenes = {
        "v": Pan(VISIBLE, times, 0, True, 3, 0),
        "t": Pan(THERMAL, times - 1 / 3, 0, True, 6, 1),
    }
    for name, pan in scenes.items():
        code = cv2.VideoWriter.fourcc(*"FFV1")
        flags = [cv2.VIDEOWRITER_PROP_IS_COLOR, 0]
        path = str(folder / f"{name}.mkv")
        writer = cv2.VideoWriter(path, cv2.CAP_FFMPEG, code, 30, (240, 160), flags)
        for image in pan:
            writer.write(image)
        writer.release()
    IDENTITY.save(folder / "rig.yaml")
    return folder / "rig.yaml", folder / "v.mkv", folder / "t.mkv"


def test_both_register_with_the_clock_offset_they_find(
    both: Both, pans: tuple[Path, ...], tmp_path: Path
) -> None:
    given = ("register", *pans, "--depth", "plane", "--time-offset", "auto")
    first, second = both(*given, "-o", tmp_path / "OUT", "--quiet")
    assert first.returncode == 0
    assert first.stderr == second.stderr
    found = re.findall(r"source late by ([+0-9.]+) s", first.stderr)
    assert len(found) == 3
    for offset in found:
        assert float(offset) == pytest.approx(1 / 3, abs=0.02)
    assert "140 pairs by time" in first.stderr
    assert_equal(pixels(tmp_path / "c"), pixels(tmp_path / "p"))
    assert len(pixels(tmp_path / "c")) == 280


def test_both_calibrate_with_the_clock_offset_they_find(
    both: Both, pans: tuple[Path, ...], tmp_path: Path
) -> None:
    rig, *footage = pans
    first, second = both(
        *("calibrate", *footage, "--depth", "plane", "--time-offset", "auto", "--initial", rig),
        *("--frames", 4, "--search", "off", "-o", tmp_path / "OUT.yaml", "--quiet"),
    )
    assert first.stderr == second.stderr
    assert "clock offset: source late by +0.3" in first.stderr
    assert "frames register best with" in first.stderr
    assert (tmp_path / "c.yaml").read_bytes() == (tmp_path / "p.yaml").read_bytes()


def test_both_say_that_too_few_frames_tell_no_offset(
    both: Both, rendered: Path, tmp_path: Path
) -> None:
    times = []
    for kind, name in (("visible", "reference"), ("thermal", "source")):
        lines = [f"{p.name} {0.1 * i}\n" for i, p in enumerate(list_files(rendered / kind))]
        (tmp_path / f"{kind}.txt").write_text("".join(lines))
        times.append(f"--{name}-times={tmp_path / kind}.txt")
    given = ("register", rendered / "rig.yaml", rendered / "visible", rendered / "thermal")
    given = (*given, "--depth", rendered / "depth", *times, "--time-offset", "auto", "--quiet")
    first, second = both(*given, "-o", tmp_path / "OUT")
    assert first.returncode == 0
    assert first.stderr == second.stderr
    assert "moves too little to tell a clock offset, 0 s is used" in first.stderr
    assert "too few frames overlap to confirm" in first.stderr


def named(rendered: Path, folder: Path, names: tuple[str, str]) -> tuple[str, ...]:
    """Arguments of two frames whose visible images have these names."""
    for kind in ("visible", "thermal"):
        for index, name in enumerate(names if kind == "visible" else ("1.png", "2.png")):
            image = read_image(list_files(rendered / kind)[index])
            (folder / kind).mkdir(parents=True, exist_ok=True)
            assert cv2.imwrite(str(folder / kind / name), image)
    inputs = (rendered / "rig.yaml", folder / "visible", folder / "thermal")
    return tuple(map(str, ("register", *inputs, "--depth", "plane", "-o", folder / "out")))


def test_two_dots_within_a_name_are_no_way_out(
    rendered: Path, tmp_path: Path, cli: Callable[..., Process]
) -> None:
    command = named(rendered, tmp_path, ("cam..1.png", "cam..2.png"))
    assert cli(*command).returncode == 0
    again = cli(*command)
    assert again.returncode == 0, again.stderr
    assert "(2 from before)" in again.stdout + again.stderr


def test_a_live_run_that_does_not_start_leaves_what_was_there(
    rendered: Path, tmp_path: Path, cli: Callable[..., Process]
) -> None:
    command = named(rendered, tmp_path, ("1.png", "2.png"))
    assert cli(*command).returncode == 0
    before = contents(tmp_path / "out")
    live = ("register", rendered / "rig.yaml", tmp_path / "no", tmp_path / "camera", "--live")
    out = ("--depth", "plane", "-o", tmp_path / "out", "--overwrite")
    assert cli(*map(str, (*live, *out))).returncode != 0
    assert contents(tmp_path / "out") == before
