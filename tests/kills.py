"""Runs of `register` killed at random moments, and resumed: `kills.py [--kills N] [--seed S]`.

Both commands, folders and videos, killed one after another on one output. At no moment may a file
under its name be other than that of a run without interruption, and the run that ends at last must
have made the same, byte for byte, or frame for frame in a video. Then what else goes wrong in the
middle: a limit on the size of files in place of a full disk, an input that vanishes or is not yet
written whole. Inputs are never touched. Exit 0 if all of it holds.
"""

import argparse
import hashlib
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bad_inputs.table import RIG, picture
from drive import same_frames
from xcalib.frames import write_image

FRAMES = 150
BINARY = Path(__file__).resolve().parents[1] / "build/release/cpp/cli/xcalib-cli"
COMMANDS = {
    "xcalib": [sys.executable, "-m", "xcalib.cli"],
    "xcalib-cli": [os.environ.get("XCALIB_CLI", str(BINARY))],
}
OUTPUTS = ("out", "out.mkv", "out.avi")
NOISE = np.random.default_rng(0)


def write_inputs(folder: Path) -> None:
    """Frames that are all different, and hard to compress."""
    for kind, width, height, channels in (("visible", 160, 120, 3), ("thermal", 120, 90, 1)):
        for index in range(FRAMES):
            image = picture(width, height, index, channels) // 2
            image += NOISE.integers(0, 100, image.shape, np.uint8)
            write_image(folder / kind / f"{index:04d}.png", image)
    scaled = RIG.replace("width: 64, height: 48", "width: 160, height: 120")
    (folder / "rig.yaml").write_text(
        scaled.replace("width: 48, height: 36", "width: 120, height: 90")
    )


def checksums(folder: Path) -> dict[str, str]:
    """Of all files below a folder, but of journals and what is not complete."""
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix not in (".jsonl", ".partial")
    }


class Trial:
    """One command and one output."""

    def __init__(self, inputs: Path, folder: Path, command: str, output: str) -> None:
        self.inputs, self.folder, self.output = inputs, folder, output
        self.name = f"{command} -o {output}"
        self.given = [
            *COMMANDS[command],
            *(
                "register",
                str(inputs / "rig.yaml"),
                str(inputs / "visible"),
                str(inputs / "thermal"),
            ),
            *("--depth", "plane", "--overlay", "-o", str(folder / output)),
        ]
        self.is_video = "." in output
        self.whole = folder.with_name(f"{folder.name} whole")
        self.whole.mkdir(parents=True)
        started = time.perf_counter()
        subprocess.run(
            [*self.given[:-1], str(self.whole / output)], check=True, capture_output=True
        )
        self.seconds = time.perf_counter() - started
        self.expected = checksums(self.whole)
        self.fresh()

    def fresh(self) -> None:
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)

    def run(self, **more: object) -> subprocess.CompletedProcess[str]:
        return subprocess.run(self.given, capture_output=True, text=True, check=False, **more)  # type: ignore[call-overload]

    def killed(self, delay: float) -> bool:
        """Whether the run was still at work after that time."""
        child = subprocess.Popen(self.given, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        time.sleep(delay)
        child.send_signal(signal.SIGKILL)
        _, errors = child.communicate()
        assert child.returncode in (0, -signal.SIGKILL), errors
        return child.returncode != 0

    def check_what_is_there(self) -> None:
        """Nothing has a name of the output but what belongs there."""
        for name, found in checksums(self.folder).items():
            if ".parts/" in name:
                continue
            assert name in self.expected, f"{self.name}: {name} is not of the output"
            if not self.is_video:
                assert found == self.expected[name], f"{self.name}: {name} is broken"

    def check_result(self) -> None:
        found = checksums(self.folder)
        assert found.keys() == self.expected.keys(), f"{self.name}: {found.keys()}"
        assert not [*self.folder.rglob("*.partial"), *self.folder.glob("*.parts")]
        if not self.is_video:
            assert found == self.expected, self.name
            return
        for name in self.expected:
            same_frames(self.folder / name, self.whole / name)

    def finish(self) -> None:
        result = self.run()
        assert result.returncode == 0, f"{self.name}: {result.stderr}"
        self.check_result()


def kill_all(trials: list[Trial], kills: int, draw: random.Random) -> int:
    """Kill runs in turn; returns how many outputs came to their end."""
    ends = 0
    for count in range(kills):
        trial = trials[count % len(trials)]
        done = not trial.killed(draw.uniform(0.1, 1.1) * trial.seconds)
        trial.check_what_is_there()
        if done or draw.random() < 0.2:
            trial.finish()
            trial.fresh()
            ends += 1
    for trial in trials:
        trial.finish()
        trial.fresh()
    return ends + len(trials)


def disk_that_is_full(trial: Trial, draw: random.Random) -> None:
    largest = max(path.stat().st_size for path in trial.whole.rglob("*") if path.is_file())
    limit = int(draw.uniform(0.1, 0.9) * largest)

    def limited() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))

    result = trial.run(preexec_fn=limited)
    assert result.returncode == 2 and result.stderr.count("error: ") == 1, result.stderr
    trial.check_what_is_there()


def input_that_vanishes(trial: Trial, draw: random.Random) -> None:
    path = trial.inputs / "thermal" / f"{draw.randrange(FRAMES // 2, FRAMES):04d}.png"
    with_another(trial, path, None)


def input_that_is_half_written(trial: Trial, draw: random.Random) -> None:
    path = trial.inputs / "visible" / f"{draw.randrange(FRAMES // 2, FRAMES):04d}.png"
    with_another(trial, path, path.read_bytes()[:-30])


def with_another(trial: Trial, path: Path, content: bytes | None) -> None:
    """A run that meets this in place of an input, begun while it was whole."""
    about, data = path.stat(), path.read_bytes()
    child = subprocess.Popen(
        trial.given, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )
    if content is None:
        path.unlink()
    else:
        path.write_bytes(content)
    _, errors = child.communicate()
    path.write_bytes(data)
    os.utime(path, ns=(about.st_atime_ns, about.st_mtime_ns))
    # It may have been read before, or not even be missed.
    assert child.returncode in (0, 2), errors
    assert child.returncode == 0 or errors.count("error: ") == 1, errors
    trial.check_what_is_there()


ACCIDENTS: tuple[Callable[[Trial, random.Random], None], ...] = (
    disk_that_is_full,
    input_that_vanishes,
    input_that_is_half_written,
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    draw = random.Random(arguments.seed)
    with tempfile.TemporaryDirectory() as scratch:
        inputs = Path(scratch) / "inputs"
        write_inputs(inputs)
        before = checksums(inputs)
        trials = [
            Trial(inputs, Path(scratch) / f"{command} {output}", command, output)
            for command in COMMANDS
            for output in OUTPUTS
        ]
        ends = kill_all(trials, arguments.kills, draw)
        print(f"{arguments.kills} kills, {ends} outputs resumed to their end: all as without")
        for accident in ACCIDENTS:
            for trial in trials:
                accident(trial, draw)
                trial.finish()
                trial.fresh()
            print(f"{accident.__name__.replace('_', ' ')}: resumed to the same")
        assert checksums(inputs) == before, "inputs were changed"


if __name__ == "__main__":
    main()
