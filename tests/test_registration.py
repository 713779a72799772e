"""`xcalib register` as a stream: overlapped, interrupted at any moment, taken up again."""

from __future__ import annotations

import json
import os
import pty
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import Result

from conftest import FRAMES, run
from drive import COPIES, arguments, contents, files_below, same_frames
from xcalib import Rig, progress, registration
from xcalib.depth import FolderDepth
from xcalib.footage import ImageFiles, Stream, encoder, open_stream
from xcalib.footage.opening import PickedDepth
from xcalib.frames import DecodeError, Image, InputError, list_files, read_image, write_image
from xcalib.inputs import Inputs
from xcalib.pipeline import Frames
from xcalib.registration import run_registration

Refused = Callable[..., str]
PART = 16
STOPS = 3
COMMAND = f"""
from xcalib import cli, registration
registration.PART_FRAMES = {PART}
cli.main()
"""


def register(folder: Path, out: Path, *more: str | Path) -> Result:
    return run(*arguments(folder, out, *more))


def process(*given: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", COMMAND, *given]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def threads() -> list[threading.Thread]:
    """All but tqdm's watchdog."""
    return [thread for thread in threading.enumerate() if not thread.daemon]


# -- Overlapped


@pytest.mark.parametrize("overlay", [(), ("--overlay",)])
def test_threads_change_nothing(drive: Path, tmp_path: Path, overlay: tuple[str, ...]) -> None:
    before = threads()
    for count in ("1", "4"):
        result = register(drive, tmp_path / count, "--threads", count, *overlay)
        assert result.exit_code == 0, result.output
    assert threads() == before
    one = contents(tmp_path / "1")
    assert len(one) == FRAMES * COPIES * (3 if overlay else 2)
    assert one == contents(tmp_path / "4")


def test_references_that_nobody_looks_at_are_not_decoded(drive: Path, tmp_path: Path) -> None:
    """What is behind the header of the second one is found only where it is used."""
    folder = tmp_path / "drive"
    shutil.copytree(drive, folder)
    path = list_files(folder / "visible")[1]
    data = path.read_bytes()
    path.write_bytes(data[:40])
    result = register(folder, tmp_path / "out")
    assert result.exit_code == 0, result.output
    assert contents(tmp_path / "out") == contents_of(drive, tmp_path / "whole")
    for more in (("--overlay",), ("--depth-steady",)):
        result = register(folder, tmp_path / more[0], *more)
        assert result.exit_code == 2
        assert f"{path}: cannot decode" in result.stderr
    path.write_bytes(data[:20] + bytes([0, 0, 0, 9]) + data[24:])  # its height
    result = register(folder, tmp_path / "size")
    assert result.exit_code == 2
    assert f"{path} is " in result.stderr


def contents_of(drive: Path, out: Path) -> dict[str, bytes]:
    assert register(drive, out).exit_code == 0
    return contents(out)


def test_the_summary_tells_where_the_time_goes(drive: Path, tmp_path: Path) -> None:
    line = register(drive, tmp_path / "out").stdout
    assert re.match(r"120 frames, [0-9.]+ % valid, [0-9.]+ frames/s with files", line)
    assert re.search(r"busy: decode \d+ %, depth \d+ %, warp \d+ %, encode \d+ %", line)


def test_lines_of_progress_where_there_is_no_terminal(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "EVERY", 0)
    lines = register(drive, tmp_path / "a").stderr.splitlines()
    assert lines
    for line in lines:
        assert re.fullmatch(
            r"registering: \d+ of \d+ frames, [0-9.]+ frames/s, \d+ s left,"
            r" busy: decode \d+ %, depth \d+ %, warp \d+ %, encode \d+ %",
            line,
        )
    assert register(drive, tmp_path / "b", "--quiet").stderr == ""


def test_a_bar_on_a_terminal(drive: Path, tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 160))
    command = [sys.executable, "-c", COMMAND, *arguments(drive, tmp_path / "out")]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=theirs)
    os.close(theirs)
    shown = b""
    while True:
        try:
            data = os.read(ours, 4096)
        except OSError:  # how Linux says that the other end is closed
            break
        if not data:
            break
        shown += data
    os.close(ours)
    assert child.wait() == 0
    assert re.search(rb"registering: +\d+%.*/120 \[.*frame/s, decode \d+ %.*encode \d+ %", shown)


class Repeated(Stream):
    """One image without end; notes how much memory there is in use when it is asked for."""

    def __init__(self, image: Image, count: int) -> None:
        super().__init__()
        self.image, self.count = image, count
        self.resident: list[float] = []

    def __len__(self) -> int:
        return self.count

    def read(self, index: int) -> Image:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        self.resident.append(pages * resource.getpagesize() / 1e6)
        return self.image.copy()

    def name(self, index: int) -> str:
        return f"{index:05d}"

    def where(self, index: int) -> str:
        return f"frame {index}"


@pytest.mark.parametrize("out", ["out", "out.mkv"])
def test_memory_is_flat(rendered: Path, tmp_path: Path, out: str) -> None:
    count = 400
    references, sources = (
        Repeated(read_image(list_files(rendered / kind)[0]), count)
        for kind in ("visible", "thermal")
    )
    depth = FolderDepth(rendered / "depth", list_files(rendered / "visible"))
    frames = Frames(references, sources, PickedDepth(depth, [0] * count))
    run_registration(frames, Rig.load(rendered / "rig.yaml"), tmp_path / out, quiet=True)
    frame = (references.image.nbytes + 4 * 320 * 240 + 2 * 320 * 240) / 1e6
    grown = max(references.resident[100:]) - max(references.resident[:100])
    assert grown < 0.1 * frame * count  # of 160 MB


# -- Interrupted, and taken up again


def interrupted(
    given: tuple[str, ...], journal: Path, how: signal.Signals, delay: float
) -> tuple[int, str]:
    """Run the command, and send the signal some time after it has noted something new."""
    size = journal.stat().st_size if journal.exists() else 0
    child = process(*given)
    while child.poll() is None and (not journal.exists() or journal.stat().st_size <= size):
        time.sleep(0.001)
    time.sleep(delay)
    child.send_signal(how)
    output, errors = child.communicate(timeout=60)
    # The signal may come after the last frame, even when the process is ending.
    return 0 if "120 frames" in output else child.returncode, errors


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_an_interrupted_folder_loses_and_repeats_nothing(
    drive: Path, tmp_path: Path, how: signal.Signals
) -> None:
    out, rng = tmp_path / "out", random.Random(int(how))
    journal = out / "register.jsonl"
    for _ in range(STOPS):
        before = {name: path.stat().st_mtime_ns for name, path in files_below(out).items()}
        noted = journal.read_text().splitlines()[1:] if before else []
        code, errors = interrupted(arguments(drive, out), journal, how, rng.random() * 0.2)
        after = files_below(out)
        for line in noted:
            try:
                files = json.loads(line)["files"]
            except ValueError:
                assert how == signal.SIGKILL  # half a line
                continue
            for name in files:
                assert after[name].stat().st_mtime_ns == before[name], f"{name} was made again"
        if code == 0:
            break
        assert code == (-how if how == signal.SIGKILL else 1)
        if how != signal.SIGKILL:
            done = len(journal.read_text().splitlines()) - 1
            line = (
                r"error: interrupted; (\d+) of 120 frames are done, the same command goes on .*\n"
            )
            told = re.fullmatch(line, errors)
            assert told and int(told[1]) <= done
            assert len(after) == 2 * done + 1  # every frame that is there is whole, and is noted
    assert register(drive, out).exit_code == 0
    assert register(drive, tmp_path / "whole").exit_code == 0
    assert contents(out) == contents(tmp_path / "whole")


@pytest.mark.parametrize(
    ("suffix", "how", "tolerance"),
    [
        (".mkv", signal.SIGINT, 0),
        (".mkv", signal.SIGKILL, 0),
        (".avi", signal.SIGINT, 0),
        (".mp4", signal.SIGTERM, 2),
    ],
)
def test_an_interrupted_video_loses_and_repeats_nothing(
    drive: Path, tmp_path: Path, suffix: str, how: signal.Signals, tolerance: float
) -> None:
    out, rng = tmp_path / f"out{suffix}", random.Random(1)
    journal = tmp_path / f"out{suffix}.register.jsonl"
    done: list[str] = []
    code = 1
    for stop in range(STOPS + 1):
        if stop < STOPS:
            code, _ = interrupted(arguments(drive, out), journal, how, rng.random() * 0.1)
        else:
            code = register(drive, out).exit_code
        lines = [json.loads(line) for line in journal.read_text().splitlines()[1:]]
        noted = [key for line in lines if out.name not in line["files"] for key in line["frames"]]
        assert len(noted) == len(set(noted)), "a frame was made again"
        assert noted[: len(done)] == done, "a frame was lost"
        done = noted
        if code == 0:
            break
        assert code == (-how if how == signal.SIGKILL else 1)
        assert not out.exists()
        left = {path.name for path in (tmp_path / f"out{suffix}.parts").iterdir()}
        if how != signal.SIGKILL:
            assert not any("partial" in name for name in left)
    assert len(done) == FRAMES * COPIES
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == sorted([out.name, "out.masks.mkv", journal.name])
    whole = tmp_path / f"whole{suffix}"
    assert register(drive, whole).exit_code == 0
    same_frames(out, whole, tolerance)
    same_frames(tmp_path / "out.masks.mkv", tmp_path / "whole.masks.mkv")
    # And both are what a folder holds.
    register(drive, tmp_path / "folder")
    if suffix == ".mkv":
        same_frames(out, tmp_path / "folder")
    same_frames(tmp_path / "out.masks.mkv", tmp_path / "folder" / "masks")


def test_interrupted_while_parts_are_joined(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(registration, "PART_FRAMES", PART)
    join = encoder.join

    def late(*given: object) -> None:
        os.kill(os.getpid(), signal.SIGTERM)
        join(*given)  # type: ignore[arg-type]

    monkeypatch.setattr(encoder, "join", late)
    result = register(drive, tmp_path / "out.mkv")
    assert result.exit_code == 1
    assert "all frames are done, but not yet in one video" in result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "out.mkv.parts",
        "out.mkv.register.jsonl",
    ]
    monkeypatch.setattr(encoder, "join", join)
    result = register(drive, tmp_path / "out.mkv")
    assert result.exit_code == 0
    assert f"({FRAMES * COPIES} from before)" in result.stdout
    assert len(open_stream(tmp_path / "out.mkv")) == FRAMES * COPIES


class Tired:
    """Calls a function a number of times, then raises; of what is not asked for it is that."""

    def __init__(self, wrapped: Callable[..., object], calls: int, error: BaseException) -> None:
        self.wrapped, self.left, self.error = wrapped, calls, error

    def __call__(self, *given: object) -> object:
        self.left -= 1
        if self.left < 0:
            raise self.error
        return self.wrapped(*given)


@pytest.mark.parametrize(
    "error",
    [
        ValueError("a"),
        InputError("b"),
        DecodeError("c"),
        OSError(28, "full", "d"),
        MemoryError(),
        KeyboardInterrupt("e"),
    ],
    ids=lambda error: type(error).__name__,
)
@pytest.mark.parametrize("place", ["read", "depth", "encode_image"])
def test_what_python_raises_is_carried_through_the_core(
    drive: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, place: str, error: BaseException
) -> None:
    """With its type and message; what came before is kept, and the same call goes on."""
    inputs = Inputs(drive / "visible", drive / "thermal", drive / "depth")
    rig, before = Rig.load(drive / "rig.yaml"), threads()
    frames = Frames.open(inputs)
    owner, name = {
        "read": (ImageFiles, "read"),
        "depth": (FolderDepth, "__call__"),
        "encode_image": (encoder, "encode_image"),
    }[place]
    tired = Tired(getattr(owner, name), 50, error)
    with monkeypatch.context() as patched:
        patched.setattr(owner, name, lambda *given: tired(*given))
        with pytest.raises(type(error)) as caught:
            run_registration(frames, rig, tmp_path / "out", quiet=True)
    assert str(caught.value) == str(error)
    assert threads() == before
    total = run_registration(frames, rig, tmp_path / "out", quiet=True)
    assert total.frames == FRAMES * COPIES and 15 < total.earlier < 60


def test_done_is_done(drive: Path, tmp_path: Path) -> None:
    for out in (tmp_path / "out", tmp_path / "out.mp4"):
        register(drive, out)
        before = {name: p.stat().st_mtime_ns for name, p in files_below(tmp_path).items()}
        result = register(drive, out)
        assert result.exit_code == 0
        assert re.match(r"120 frames \(120 from before\), [0-9.]+ % valid: ", result.stdout)
        after = {name: p.stat().st_mtime_ns for name, p in files_below(tmp_path).items()}
        assert after == before


@pytest.mark.parametrize("out", ["out", "out.mkv"])
def test_made_otherwise(drive: Path, tmp_path: Path, out: str) -> None:
    """Neither mixed nor thrown away, unless that is asked for."""
    rig = tmp_path / "rig" / "rig.yaml"
    rig.parent.mkdir()
    other = Rig.load(drive / "rig.yaml")
    other.t = [0.01, 0, 0]
    other.save(rig)
    assert register(drive, tmp_path / out).exit_code == 0
    before = contents(tmp_path)
    for more, named in (
        (("--nearest",), "nearest no, now yes"),
        (("--far", "40"), "far 60.0, now 40.0"),
        (("--overlay",), "overlay no, now yes"),
    ):
        result = register(drive, tmp_path / out, *more)
        assert result.exit_code == 2
        assert named in result.stderr and "--overwrite" in result.stderr
    given = [
        str(rig) if name.endswith("rig.yaml") else name for name in arguments(drive, tmp_path / out)
    ]
    result = run(*given)
    assert result.exit_code == 2
    assert "(rig " in result.stderr
    assert contents(tmp_path) == before
    assert register(drive, tmp_path / out, "--nearest", "--overwrite").exit_code == 0
    after = contents(tmp_path)
    assert after.keys() == before.keys() and after != before
    # It is now the output of that command, and the other is refused.
    assert "(120 from before)" in register(drive, tmp_path / out, "--nearest").stdout
    assert register(drive, tmp_path / out).exit_code == 2


@pytest.mark.parametrize("out", ["out", "out.mkv"])
def test_frames_whose_files_have_changed(rendered: Path, tmp_path: Path, out: str) -> None:
    scene = Path(shutil.copytree(rendered, tmp_path / "scene"))
    register(scene, tmp_path / out)
    path = list_files(scene / "thermal")[2]
    write_image(path, 255 - read_image(path))
    result = register(scene, tmp_path / out)
    # A video's frames cannot be taken apart again.
    there = FRAMES - 1 if out == "out" else 0
    assert f"({there} from before)" in result.stdout or not there
    register(scene, tmp_path / f"new{out}")
    same_frames(tmp_path / out, tmp_path / f"new{out}")


def test_missing_and_damaged_files_are_made_again(drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    register(drive, out)
    whole = contents(out)
    (out / "0003.png").unlink()
    (out / "masks" / "0007.png").write_bytes(b"")
    journal = out / "register.jsonl"
    journal.write_text(journal.read_text() + '{"frames": {"12')  # as a power cut leaves it
    result = register(drive, out)
    assert "(118 from before)" in result.stdout
    assert contents(out) == whole
    assert "(120 from before)" in register(drive, out).stdout


def test_more_frames_than_before(rendered: Path, tmp_path: Path) -> None:
    scene = Path(shutil.copytree(rendered, tmp_path / "scene"))
    last = {kind: list_files(scene / kind)[-1] for kind in ("visible", "thermal", "depth")}
    for kind, path in last.items():
        path.rename(tmp_path / kind)
    register(scene, tmp_path / "out")
    for kind, path in last.items():
        (tmp_path / kind).rename(path)
    result = register(scene, tmp_path / "out")
    assert f"{FRAMES} frames ({FRAMES - 1} from before)" in result.stdout
    register(scene, tmp_path / "new")
    assert contents(tmp_path / "out") == contents(tmp_path / "new")


def test_two_runs_at_one_output(drive: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    child = process(*arguments(drive, out))
    journal = out / "register.jsonl"
    # A line stands in it: it is locked by then.
    while not (journal.exists() and journal.read_text().count("\n") > 1):
        time.sleep(0.001)
    child.send_signal(signal.SIGSTOP)
    try:
        result = register(drive, out)
    finally:
        child.send_signal(signal.SIGCONT)
    child.communicate(timeout=60)
    assert child.returncode == 0
    assert result.exit_code == 2
    assert "another run is writing to this output" in result.stderr


@pytest.mark.parametrize("text", ["{}\n", "no\n", '{"format": "x"}\n{"frames": {}}\n'])
def test_a_file_that_is_no_journal(
    drive: Path, tmp_path: Path, refused: Refused, text: str
) -> None:
    (tmp_path / "register.jsonl").write_text(text)
    assert "not a journal" in refused(*arguments(drive, tmp_path))


def test_a_journal_cannot_remove_files_elsewhere(drive: Path, tmp_path: Path) -> None:
    (tmp_path / "mine").touch()
    out = tmp_path / "out"
    register(drive, out)
    journal = out / "register.jsonl"
    journal.write_text(journal.read_text() + '{"frames": {}, "files": {"../mine": 0}}\n')
    assert register(drive, out, "--overwrite").exit_code == 2
    assert (tmp_path / "mine").exists()


def test_steadied_depth_goes_on_as_if_never_interrupted(drive: Path, tmp_path: Path) -> None:
    register(drive, tmp_path / "whole", "--depth-steady")
    plain, steady = tmp_path / "plain", tmp_path / "steady"
    register(drive, plain)
    assert contents(plain) != contents(tmp_path / "whole")
    register(drive, steady, "--depth-steady")
    lines = (steady / "register.jsonl").read_text().splitlines()
    (steady / "register.jsonl").write_text("\n".join(lines[:50]) + "\n")
    for name in [name for line in lines[50:] for name in json.loads(line)["files"]]:
        (steady / name).unlink()
    assert "(49 from before)" in register(drive, steady, "--depth-steady").stdout
    assert contents(steady) == contents(tmp_path / "whole")


# -- A full disk


@pytest.mark.parametrize("out", ["out", "out.mkv", "out.mp4"])
def test_what_cannot_be_written_is_an_error(drive: Path, tmp_path: Path, out: str) -> None:
    """A limit on the size of files stands for a full disk: writes fail just so."""
    limit = 20_000 if out == "out" else 150_000

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    command = [sys.executable, "-c", COMMAND.replace(str(PART), "250")]
    child = subprocess.run(
        [*command, *arguments(drive, tmp_path / out)],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=limited,
    )
    assert child.returncode == 2, child.stderr
    assert child.stderr.startswith(f"error: {tmp_path / out}")
    assert child.stderr.count("\n") == 1
    assert not (tmp_path / out).is_file()
    assert not [name for name in files_below(tmp_path) if "partial" in name]
    result = register(drive, tmp_path / out)
    assert result.exit_code == 0, result.output
    register(drive, tmp_path / f"new{out}")
    same_frames(tmp_path / out, tmp_path / f"new{out}", 2 if out.endswith(".mp4") else 0)
