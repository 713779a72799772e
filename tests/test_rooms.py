"""`scripts/check_rooms.py`, which `make lint` runs, sees what breaks its rules."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[1]
SCRIPT = REPOSITORY / "scripts/check_rooms.py"

spec = importlib.util.spec_from_file_location("check_rooms", SCRIPT)
assert spec and spec.loader
check_rooms = importlib.util.module_from_spec(spec)
spec.loader.exec_module(check_rooms)

SOUND = {
    "src/base/format.hpp": "",
    "src/geometry/camera.cpp": '#include "xcalib/camera.hpp"\n#include "base/format.hpp"',
    "src/register/register.cpp": '#include "xcalib/register.hpp"',
    "src/solve/solve.hpp": '#include <ceres/ceres.h>\n#include "xcalib/camera.hpp"',
    "src/solve/solve.cpp": '#include "solve/solve.hpp"',
    "src/judge/metrics.cpp": '#include "xcalib/judge/metrics.hpp"\n#include "solve/solve.hpp"',
    "src/footage/pairing.cpp": '#include "xcalib/footage/pairing.hpp"',
    "include/xcalib.hpp": "#include <xcalib/camera.hpp>",
    "include/xcalib/error.hpp": "",
    "include/xcalib/camera.hpp": "#include <Eigen/Core>",
    "include/xcalib/register.hpp": '#include "xcalib/camera.hpp"\n#include "xcalib/error.hpp"',
    "include/xcalib/judge/metrics.hpp": "",
    "include/xcalib/footage/pairing.hpp": "",
}


def breaches(root: Path, changed: dict[str, str]) -> list[str]:
    for name, text in {**SOUND, **changed}.items():
        path = root / "cpp" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text + "\n", encoding="utf-8")
    found: list[str] = check_rooms.breaches(root)
    return found


def test_a_sound_tree_has_no_breach(tmp_path: Path) -> None:
    assert breaches(tmp_path, {}) == []


@pytest.mark.parametrize(
    ("changed", "expected"),
    [
        pytest.param(
            {"src/attic/old.cpp": ""}, "cpp/src/attic/old.cpp: in none of the rooms", id="no room"
        ),
        pytest.param(
            {"include/xcalib/lonely.hpp": ""},
            "xcalib/lonely.hpp: a public header without a room",
            id="public header without a source",
        ),
        pytest.param(
            {"src/base/format.hpp": '#include "solve/solve.hpp"'},
            "base/format.hpp: base includes solve/solve.hpp of solve, which stands below it",
            id="against the order",
        ),
        pytest.param(
            {"src/geometry/camera.cpp": '  #  include  "xcalib/register.hpp"'},
            "geometry/camera.cpp: geometry includes xcalib/register.hpp of register, which stands",
            id="against the order, by a public header",
        ),
        pytest.param(
            {"src/footage/pairing.cpp": '#include "xcalib/judge/metrics.hpp"'},
            "footage/pairing.cpp: footage includes xcalib/judge/metrics.hpp of judge: these stand",
            id="rooms apart",
        ),
        pytest.param(
            {"src/judge/metrics.cpp": "#include <ceres/ceres.h>"},
            "judge/metrics.cpp: includes <ceres/ceres.h>, which only solve may",
            id="Ceres outside solve",
        ),
        pytest.param(
            {"src/solve/solve.cpp": '#include "xcalib.hpp"'},
            "solve/solve.cpp: includes xcalib.hpp, which is for users",
            id="umbrella",
        ),
        pytest.param(
            {
                "src/solve/a.hpp": '#include "solve/b.hpp"',
                "src/solve/b.hpp": '#include "solve/c.hpp"',
                "src/solve/c.hpp": '#include "solve/a.hpp"',
            },
            "cycle: ",
            id="cycle",
        ),
        pytest.param(
            {
                "include/xcalib/camera.hpp": '#include "base/format.hpp"',
                "src/base/format.hpp": "#include <ceres/jet.h>",
            },
            "xcalib/register.hpp: of the register library, leads to ceres/jet.h",
            id="register leads to Ceres",
        ),
        pytest.param(
            {"include/xcalib/register.hpp": '#include "xcalib/judge/metrics.hpp"'},
            "xcalib/register.hpp: of the register library, leads to xcalib/judge/metrics.hpp",
            id="register leads to another library",
        ),
    ],
)
def test_a_breach_is_found(tmp_path: Path, changed: dict[str, str], expected: str) -> None:
    found = breaches(tmp_path, changed)
    assert any(line.startswith(expected) for line in found), found


def test_the_command_prints_breaches_and_fails(tmp_path: Path) -> None:
    breaches(tmp_path, {"src/attic/old.cpp": ""})
    run = subprocess.run(
        [sys.executable, SCRIPT, tmp_path], capture_output=True, text=True, check=False
    )
    assert run.returncode == 1
    assert run.stdout.startswith("cpp/src/attic/old.cpp: in none of the rooms")


def test_the_repository_keeps_to_its_rooms() -> None:
    assert check_rooms.breaches(REPOSITORY) == []
