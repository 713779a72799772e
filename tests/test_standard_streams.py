"""Both commands where nobody hears them: full disks, closed pipes and streams."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from drive import arguments, contents

Command = list[str]


@pytest.fixture(params=["python", "cli"])
def command(request: pytest.FixtureRequest, binary: Path) -> Command:
    if request.param == "python":
        return [sys.executable, "-m", "xcalib.cli"]
    return [str(binary)]


@pytest.fixture
def shell(command: Command, rendered: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run a shell line in which XCALIB is the command, and RIG a rig file."""

    def call(line: str) -> subprocess.CompletedProcess[str]:
        line = line.replace("XCALIB", " ".join(command))
        line = line.replace("RIG", str(rendered / "rig.yaml"))
        return subprocess.run(
            ["bash", "-c", line], capture_output=True, text=True, check=False, timeout=60
        )

    return call


Shell = Callable[..., subprocess.CompletedProcess[str]]


def test_a_full_stdout_is_one_line(shell: Shell) -> None:
    result = shell("XCALIB inspect RIG > /dev/full")
    assert result.returncode == 2
    assert result.stderr == "error: stdout: No space left on device\n"


def test_a_closed_pipe_is_quiet(shell: Shell) -> None:
    result = shell("(sleep 0.5; XCALIB inspect RIG; echo $? >&2) | true")
    assert result.stderr == "1\n"


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&-", ">&- 2>&- <&-"])
def test_closed_streams_change_nothing(shell: Shell, closed: str) -> None:
    expected = "" if ">&-" in closed.split() else shell("XCALIB inspect RIG").stdout
    result = shell(f"XCALIB inspect RIG {closed}")
    assert (result.returncode, result.stdout, result.stderr) == (0, expected, "")


def test_errors_that_nobody_hears_have_their_exit_code(shell: Shell) -> None:
    for ignored in ("2>&-", "2> /dev/full", ">&- 2>&-", "> /dev/full 2>&1"):
        assert shell(f"XCALIB inspect none.yaml {ignored}").returncode == 2, ignored


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&- <&-"])
def test_closed_streams_are_not_written_into_files(
    shell: Shell, rendered: Path, tmp_path: Path, closed: str
) -> None:
    """A file that is opened would take the number of a closed stream."""
    for name, more in (("open", ""), ("closed", closed)):
        given = " ".join(arguments(rendered, tmp_path / name))
        assert shell(f"XCALIB {given} {more}").returncode == 0
    assert contents(tmp_path / "open") == contents(tmp_path / "closed")


def test_a_report_may_go_to_a_pipe(shell: Shell, rendered: Path) -> None:
    """By the name that the shell gives it, or by that of stdout itself."""
    given = f"RIG {rendered}/visible {rendered}/thermal --depth {rendered}/depth"
    result = shell(
        f"XCALIB evaluate {given} --json >(grep -c gain_percent > /dev/stderr); sleep 0.3"
    )
    assert result.returncode == 0 and result.stderr.strip() == "1", result.stderr
    result = shell(f"XCALIB evaluate {given} --json /dev/stdout")
    assert result.returncode == 0 and '"gain_percent"' in result.stdout
    assert "pixels judged" in result.stdout


def test_devices_stay_what_they_are(shell: Shell, rendered: Path) -> None:
    given = f"RIG {rendered}/visible {rendered}/thermal --depth {rendered}/depth"
    assert shell(f"XCALIB evaluate {given} --json /dev/null").returncode == 0
    assert Path("/dev/null").is_char_device()


def test_names_that_are_not_utf8_are_one_line(command: Command, tmp_path: Path) -> None:
    name = os.fsencode(tmp_path) + b"/\xff.yaml"
    result = subprocess.run([*command, "inspect", name], capture_output=True, check=False)
    assert result.returncode == 2
    assert result.stderr.startswith(b"error: ") and result.stderr.count(b"\n") == 1
    assert b"the name is not UTF-8" in result.stderr
