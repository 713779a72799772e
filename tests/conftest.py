"""What the tests share: a small rendered rig, its calibration, and the real data if present."""

from __future__ import annotations

import math
import os
import shutil
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from drive import write_drive
from xcalib import Rig, progress, synthetic
from xcalib.cli import cli as python_command

# A shell lets its background jobs, and all that they start, ignore SIGINT.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parents[1]
Process = subprocess.CompletedProcess[str]

FRAMES = 6
WIDTH = 320


def run(*arguments: str | int | Path) -> Result:
    """Run the ``xcalib`` command in this process."""
    return CliRunner().invoke(python_command, [str(argument) for argument in arguments])


def small(rig: Rig) -> Rig:
    """The rig with a reference camera of 320 px width, the source in proportion."""
    factor = WIDTH / rig.reference.width
    return rig.resized(
        *(
            round(factor * side)
            for camera in (rig.reference, rig.source)
            for side in (camera.width, camera.height)
        )
    )


@pytest.fixture(autouse=True)
def no_lines_of_progress(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a busy machine they would come between what tests expect on stderr."""
    monkeypatch.setattr(progress, "EVERY", math.inf)


@pytest.fixture(scope="session")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with visible, thermal, depth and the true rig.yaml. Read only: `scene` is a copy."""
    folder = tmp_path_factory.mktemp("rendered")
    rig = small(synthetic.demo_rig())
    synthetic.write(folder, synthetic.render(rig, num_frames=FRAMES, seed=1), rig)
    return folder


@pytest.fixture
def scene(rendered: Path, tmp_path: Path) -> Path:
    """A copy of `rendered` that a test may spoil."""
    return Path(shutil.copytree(rendered, tmp_path / "scene"))


@pytest.fixture(scope="session")
def drive(rendered: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A drive of `rendered`'s frames, each with noise of its own. Read only."""
    folder = tmp_path_factory.mktemp("drive")
    write_drive(rendered, folder)
    return folder


@pytest.fixture(scope="session")
def calibrated(rendered: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    """Folder with rig.yaml and report.json as `xcalib calibrate` left them, and its result."""
    folder = tmp_path_factory.mktemp("calibrated")
    result = run(
        *("calibrate", rendered / "visible", rendered / "thermal", "--depth", rendered / "depth"),
        *("-o", folder / "rig.yaml", "--report", folder / "report.json"),
    )
    return folder, result


@pytest.fixture(scope="session")
def xcalib_data() -> Path:
    """Folder of the real data: XCALIB_DATA, or ../shared/data beside the repository."""
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    folder = Path(os.environ.get("XCALIB_DATA", beside))
    if not folder.is_dir():
        pytest.skip(f"no real data at {folder} (set XCALIB_DATA)")
    return folder


@pytest.fixture(scope="session")
def binary() -> Path:
    """xcalib-cli: XCALIB_CLI, or where `make` builds it."""
    built = ROOT / "build" / "release" / "cpp" / "cli" / "xcalib-cli"
    path = Path(os.environ.get("XCALIB_CLI", built)).resolve()
    if not path.is_file():
        pytest.skip(f"no {path}: `make cli`, or name it in XCALIB_CLI")
    return path


@pytest.fixture
def cli(binary: Path) -> Callable[..., Process]:
    """Run xcalib-cli."""

    def call(*arguments: Any, **more: Any) -> Process:
        command = [str(binary), *map(str, arguments)]
        return subprocess.run(command, capture_output=True, text=True, check=False, **more)

    return call


@pytest.fixture
def both(cli: Callable[..., Process]) -> Callable[..., tuple[Process, Result]]:
    """Run both commands, each with ``OUT`` in its arguments replaced by a name of its own."""

    def call(*arguments: Any) -> tuple[Process, Result]:
        ours, theirs = (
            [str(argument).replace("OUT", name) for argument in arguments] for name in ("c", "p")
        )
        first, second = cli(*ours), run(*theirs)
        assert first.returncode == second.exit_code, first.stderr + second.output
        return first, second

    return call


@pytest.fixture
def refused(tmp_path: Path) -> Callable[..., str]:
    """Run a command that must be refused: exit 2, one line, nothing written. Returns the line."""

    def check(*arguments: str | Path) -> str:
        before = sorted(tmp_path.rglob("*"))
        result = run(*arguments)
        assert result.exit_code == 2, result.output
        assert result.stderr.startswith("error: ")
        assert result.stderr.endswith("\n")
        assert result.stderr.count("\n") == 1, result.stderr
        assert result.stdout == ""
        assert sorted(tmp_path.rglob("*")) == before
        return result.stderr

    return check
