"""Bad inputs, which the commands refuse in one line, and which harm nothing.

The commands take turns from row to row; `make test-bad-inputs` runs each row on both.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
from pathlib import Path

import arguments
import images
import journals
import numbers_in_files
import outputs
import pytest
from table import Row, write_scene

from conftest import run

ROWS = [
    row
    for module in (arguments, images, journals, numbers_in_files, outputs)
    for row in module.ROWS
]

COMMANDS = ("python", "cli")
CASES = [
    pytest.param(row, command, id=f"{row.name}-{command}")
    for i, row in enumerate(ROWS)
    for command in COMMANDS
    if row.only == command
    or (not row.only and ("XCALIB_ALL_ROWS" in os.environ or command == COMMANDS[i % 2]))
]


@pytest.fixture(scope="session")
def small_scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("small") / "scene"
    write_scene(folder)
    return folder


def state(folder: Path) -> dict[str, str]:
    """All that is in a folder: contents of files, and where links lead."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_symlink():
            found[name] = f"-> {path.readlink()}"
        elif path.is_file():
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
        else:
            found[name] = "folder or pipe"
    return found


def ended(command: str, row: Row, binary: Path) -> tuple[int, str]:
    """Exit code and stderr."""
    if command == "python":
        result = run(*row.words())
        return result.exit_code, result.stderr
    done = subprocess.run(
        [binary, *row.words()], capture_output=True, text=True, check=False, timeout=60
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize(("row", "command"), CASES)
def test_is_refused_in_one_line_and_harms_nothing(
    row: Row,
    command: str,
    small_scene: Path,
    tmp_path: Path,
    binary: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = Path(shutil.copytree(small_scene, tmp_path / "scene"))
    row.spoil(scene)
    monkeypatch.chdir(scene)
    before = state(scene)
    code, errors = ended(command, row, binary)
    assert code == row.code, errors
    assert row.message in errors
    if code == 0:
        assert "error" not in errors
        return
    *notes, line = errors.splitlines()
    assert line.startswith("not to be trusted: " if code == 3 else "error: ")
    assert all(note.startswith(("warning: ", "frames: ", "--depth ")) for note in notes), errors
    assert len(line) < 700, line
    for word in ("Traceback", "cv::", "OpenCV(", "std::"):
        assert word not in errors
    assert row.leaves or state(scene) == before


def test_rows_are_many_and_named_apart() -> None:
    assert len(ROWS) >= 150
    assert len({row.name for row in ROWS}) == len(ROWS)
