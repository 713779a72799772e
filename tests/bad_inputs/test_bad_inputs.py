"""Bad inputs, which the commands and the API refuse in one line, and which harm nothing.

The three take turns from row to row; `make test-bad-inputs` runs each row on all that have it.
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
from api import call_of
from table import Row, write_scene

from conftest import run

ROWS = [
    row
    for module in (arguments, images, journals, numbers_in_files, outputs)
    for row in module.ROWS
]


def ways_of(row: Row) -> list[str]:
    """How the row can be run."""
    ways = [row.only] if row.only else ["python", "cli"]
    return [*ways, "api"] if call_of(row) else ways


CASES = [
    pytest.param(row, way, id=f"{row.name}-{way}")
    for i, row in enumerate(ROWS)
    for j, way in enumerate(ways_of(row))
    if "XCALIB_ALL_ROWS" in os.environ or j == i % len(ways_of(row))
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


@pytest.mark.parametrize(("row", "way"), CASES)
def test_is_refused_in_one_line_and_harms_nothing(
    row: Row,
    way: str,
    small_scene: Path,
    tmp_path: Path,
    binary: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    scene = Path(shutil.copytree(small_scene, tmp_path / "scene"))
    row.spoil(scene)
    monkeypatch.chdir(scene)
    before = state(scene)
    if way == "api":
        line = raised(row)
    else:
        code, errors = ended(way, row, binary)
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
        assert word not in line
    assert row.code == 0 or row.leaves or state(scene) == before


def raised(row: Row) -> str:
    """The message of the call; '' where it is to go on."""
    call = call_of(row)
    assert call is not None
    if row.code == 0:
        call()
        return ""
    with pytest.raises((ValueError, OSError)) as caught:
        call()
    error = caught.value
    message = str(error)
    if isinstance(error, OSError) and error.filename:
        message = f"{error.filename}: {error.strerror}"
    assert row.message in message
    assert "\n" not in message
    return message


def test_rows_are_many_and_named_apart() -> None:
    assert len(ROWS) >= 150
    assert sum("api" in ways_of(row) for row in ROWS) >= 150
    assert len({row.name for row in ROWS}) == len(ROWS)
