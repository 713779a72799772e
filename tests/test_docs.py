"""Every printed command and snippet of README and docs runs, on a small rendered rig."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import xcalib
from bags import write_bag
from conftest import ROOT, run
from xcalib.convert import write_rig
from xcalib.depth import read_depth
from xcalib.frames import list_files, read_image

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]

NOT_HERE = {
    "make ": "what a fresh machine does: .ci runs it",
    "pip install": "the same",
    "cmake ": "the same",
    "python bench": "tests/test_bench.py and test_experiments.py run them",
    "xcalib demo": "tests/test_cli.py runs it",
    "xcalib models fetch": "needs the network",
    ".onnx": "needs a network's file: tests/test_networks.py and test_flow.py",
    "--live": "needs cameras",
    "xcalib-cli": "tests/test_xcalib_cli.py runs both commands on the same arguments",
    "export ": "an environment",
}
"""What of a line keeps it from being run here, and why."""


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    """Language and text of the fenced blocks; indented ones are ``sh`` or output."""
    text = page.read_text(encoding="utf-8")
    for found in re.finditer(r"^```(\w*)\n(.*?)^```", text, re.MULTILINE | re.DOTALL):
        yield found[1], found[2]
    plain = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    for found in re.finditer(r"(?:^    \S.*\n|^        .*\n)+", plain, re.MULTILINE):
        yield "", re.sub("^    ", "", found[0], flags=re.MULTILINE)


def commands() -> Iterator[Any]:
    for page in PAGES:
        for language, text in blocks(page):
            if language not in ("sh", "bash", ""):
                continue
            for line in text.replace("\\\n", " ").splitlines():
                if re.match(r"xcalib(-cli)? \w|make |pip |cmake |python ", line):
                    yield pytest.param(line, id=f"{page.stem}: {line[:50]}")


def snippets() -> Iterator[Any]:
    for page in PAGES:
        for number, (language, text) in enumerate(blocks(page)):
            if language == "python":
                yield pytest.param(text, id=f"{page.stem} {number}")


def lay_out(folder: Path, here: Path) -> None:
    """Folders are linked, and files copied: commands write over them."""
    for path in folder.iterdir():
        if path.is_dir():
            (here / path.name).symlink_to(path)
        else:
            shutil.copy(path, here / path.name)


def files_of_others(folder: Path, names: list[str]) -> None:
    """The rig as other tools have it, labels of the visible images, and a report."""
    rig = xcalib.Rig.load(folder / "rig.yaml")
    write_rig(rig, folder / "camchain.yaml", "kalibr")
    write_rig(rig, folder, "mrcal")
    write_rig(rig, folder, "ros")
    images = [
        {"id": i, "file_name": name, "width": rig.reference.width, "height": rig.reference.height}
        for i, name in enumerate(names)
    ]
    box = {"id": 1, "image_id": 0, "category_id": 1, "bbox": [100, 80, 40, 30]}
    coco = {"images": images, "annotations": [box], "categories": [{"id": 1, "name": "car"}]}
    (folder / "coco.json").write_text(json.dumps(coco))
    (folder / "yolo").mkdir()
    for name in names:
        (folder / "yolo" / name).with_suffix(".txt").write_text("0 0.5 0.5 0.2 0.2\n")
    footage = (folder / "visible", folder / "thermal", "--depth", folder / "depth")
    small = ("--frames", 4, "--working-width", 160, "--quiet")
    made = run(
        *("calibrate", *footage, *small, "-o", folder / "fit.yaml"),
        *("--report", folder / "report.json"),
    )
    assert made.exit_code in (0, 3), made.stderr


@pytest.fixture(scope="module")
def folder(rendered: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What the pages' commands find: footage of one small rig under all their names."""
    folder = tmp_path_factory.mktemp("docs")
    for name in ("visible", "thermal", "depth"):
        (folder / name).symlink_to(rendered / name)
    for name in ("rig.yaml", "my_rig.yaml"):
        shutil.copy(rendered / "rig.yaml", folder / name)
    (folder / "data").symlink_to(rendered)
    (jobs,) = (text for language, text in blocks(ROOT / "docs" / "scale.md") if language == "yaml")
    (folder / "jobs.yaml").write_text(jobs)
    files_of_others(folder, [path.name for path in list_files(folder / "visible")])
    visible, thermal = (
        [read_image(path) for path in list_files(folder / name)] for name in ("visible", "thermal")
    )
    width, height = 160, 120
    size = (2 * width, height)
    writer = cv2.VideoWriter(str(folder / "drive.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 10, size)
    for left, right in zip(visible, thermal, strict=True):
        halves = [cv2.resize(image, (width, height)) for image in (left, right)]
        halves[1] = cv2.cvtColor(halves[1], cv2.COLOR_GRAY2BGR)
        writer.write(np.hstack(halves))
    writer.release()
    for name, images in (("visible", visible), ("thermal", thermal)):
        size = images[0].shape[1::-1]
        codec = cv2.VideoWriter.fourcc(*"mp4v")
        writer = cv2.VideoWriter(str(folder / f"{name}.mp4"), codec, 10, size)
        for image in images:
            writer.write(image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2BGR))
        writer.release()
    topics = {"/visible/image_raw": ("bgr8", visible), "/thermal/image_raw": ("mono8", thermal)}
    bag = write_bag(folder / "bag", "mcap", topics)
    (folder / "drive.mcap").symlink_to(bag)
    return folder


@pytest.mark.parametrize("line", list(commands()))
def test_printed_commands_run(
    line: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if any(part in line for part in NOT_HERE):
        return
    lay_out(folder, tmp_path)
    monkeypatch.chdir(tmp_path)
    words = shlex.split(re.sub(r"\s#\s.*", "", line))[1:]
    # They open, pair and choose all that they name; README's own are run to their end.
    long = ("batch", "calibrate", "register", "evaluate", "view", "transfer")
    dry = words[0] in long and line not in README_COMMANDS
    result = run(*words, *(["--dry-run"] if dry else []))
    assert result.exit_code in (0, 3), result.stderr


README_COMMANDS = [
    line
    for _, text in blocks(ROOT / "README.md")
    for line in text.splitlines()
    if re.match("xcalib (register|evaluate|inspect)", line)
]


def test_what_is_not_run_here_is_still_printed() -> None:
    printed = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert [part for part in NOT_HERE if part not in printed and part != "export "] == []
    assert len(README_COMMANDS) == 3


@pytest.mark.parametrize("text", list(snippets()))
def test_printed_snippets_run(
    text: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if ".onnx" in text and "PatchFlow" not in text:
        return  # tests/test_networks.py
    lay_out(folder, tmp_path)
    monkeypatch.chdir(tmp_path)
    visible, thermal = (
        [read_image(path) for path in list_files(folder / name)] for name in ("visible", "thermal")
    )
    depths = [read_depth(path) for path in list_files(folder / "depth")]
    rig = xcalib.Rig.load(folder / "rig.yaml")
    warped, mask = xcalib.Registrar(rig).register(thermal[0], depths[0])
    from xcalib.footage import open_stream

    names: dict[str, Any] = {
        "np": np,
        "xcalib": xcalib,
        "open_stream": open_stream,
        "visible": visible[:3],
        "thermal": thermal[:3],
        "depths": depths,
        "visible_images": visible[:3],
        "thermal_images": thermal[:3],
        "depth_maps": depths[:3],
        "thermal_image": thermal[0],
        "depth_map": depths[0],
        "rig": rig,
        "points": np.array([[150.0, 100.0], [200.0, 140.0]]),
        **{"left": 100, "top": 80, "right": 140, "bottom": 110},
        "reference": visible[0],
        "warped": warped,
        "mask": mask,
        "relative": [np.where(depth > 0, 1 / np.maximum(depth, 1), 0) for depth in depths[:3]],
    }
    exec(compile(text, "snippet", "exec"), names)
