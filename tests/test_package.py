"""What is installed: the package as built, no more and no less, and not the source tree."""

from __future__ import annotations

import subprocess
import sys
import sysconfig
import tomllib
from importlib.metadata import files, metadata
from pathlib import Path, PurePosixPath

import pytest

import xcalib

DISTRIBUTION = "xcalib-rgbt"
ROOT = Path(__file__).resolve().parents[1]


def test_the_tests_import_the_installed_package() -> None:
    assert Path(xcalib.__file__).is_relative_to(sysconfig.get_path("platlib"))


def test_the_version_stands_in_pyproject_alone() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert xcalib.__version__ == metadata(DISTRIBUTION)["Version"] == project["version"]


def test_the_wheel_holds_the_package_and_nothing_else() -> None:
    installed = {PurePosixPath(path) for path in files(DISTRIBUTION) or []}
    inside = {str(path.relative_to("xcalib")) for path in installed if path.parts[0] == "xcalib"}
    root = ROOT / "python" / "xcalib"
    sources = {
        path.relative_to(root).as_posix()
        for path in root.rglob("*")
        if path.is_file() and path.suffix in (".css", ".html", ".js", ".py", ".pyi", ".typed")
    }
    module = "_core" + sysconfig.get_config_var("EXT_SUFFIX")
    assert {path for path in inside if not path.endswith(".pyc")} == sources | {module}
    assert {"py.typed", "_core.pyi"} <= inside
    info = next(path.parts[0] for path in installed if path.name == "METADATA")
    tops = {path.parts[0] for path in installed}
    assert tops == {"xcalib", "xcalib_rgbt", info, ".."}  # .. leads to the environment's bin/xcalib
    licences = {path.name for path in installed if "licenses" in path.parts}
    assert licences == {"LICENSE", "README.md"}


def test_the_command_says_that_the_package_is_anothers(tmp_path: Path) -> None:
    (tmp_path / "xcalib.py").write_text("")
    code = f"import sys; sys.path.insert(0, {str(tmp_path)!r}); import xcalib_rgbt"
    run = subprocess.run(
        [sys.executable, "-c", f"{code}; xcalib_rgbt.main()"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert run.returncode == 2 and run.stderr.count("\n") == 1
    assert str(tmp_path / "xcalib.py") in run.stderr and "not that of xcalib-rgbt" in run.stderr


def test_the_command_has_three_names() -> None:
    beside = Path(sys.executable).parent
    commands = ([sys.executable, "-m", "xcalib"], [beside / "xcalib"], [beside / "xcalib-rgbt"])
    said = {
        subprocess.run([*command, "--version"], capture_output=True, text=True, check=True).stdout
        for command in commands
    }
    assert len(said) == 1 and "xcalib" in said.pop()


def test_what_is_not_used_is_not_imported() -> None:
    code = """
import sys
import xcalib, xcalib.cli
xcalib.cli.cli(["--version"], standalone_mode=False)
heavy = {"numpy", "cv2", "av", "tqdm", "yaml", "xcalib._core"} & sys.modules.keys()
assert not heavy, heavy
"""
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


def test_every_public_name_is_there() -> None:
    assert set(xcalib.__all__) <= set(dir(xcalib))
    for name in xcalib.__all__:
        assert getattr(xcalib, name) is not None
    with pytest.raises(AttributeError, match="module 'xcalib' has no attribute 'Rigg'"):
        xcalib.Rigg  # type: ignore[attr-defined]  # noqa: B018


def test_two_opencvs_live_in_one_process() -> None:
    """The core links the system's OpenCV, the package imports another one from PyPI."""
    code = """
import cv2, numpy as np, xcalib
image = cv2.GaussianBlur(np.random.default_rng(0).random((48, 64), np.float32), (5, 5), 1)
assert xcalib.metrics.nec(image, image) > 0.999
rig = xcalib.Rig(*[xcalib.Pinhole(64, 48, 60, 60, 31.5, 23.5)] * 2)
out, mask = xcalib.Registrar(rig).register(image, np.full((48, 64), 5, np.float32))
assert abs(cv2.resize(out, (32, 24)) - cv2.resize(image, (32, 24))).max() < 1e-3
"""
    for order in (
        code,
        code.replace("import cv2, numpy as np, xcalib", "import xcalib, numpy as np, cv2"),
    ):
        subprocess.run([sys.executable, "-c", order], check=True, timeout=120)
