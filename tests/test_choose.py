"""The frames that a calibration is made on."""

from __future__ import annotations

import json
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import Result

import xcalib
from conftest import run
from xcalib.choose import Choice, choose_informed
from xcalib.depth import read_depth
from xcalib.footage import open_stream
from xcalib.frames import DecodeError, Image, InputError, list_files, read_image, write_image

Frame = tuple[Image, Image, np.ndarray]


def frame(seed: int, boxes: int = 30, area: tuple[int, int] = (0, 160)) -> Frame:
    """A pair with the same edges at columns of ``area``, in other values, and its depth."""
    random = np.random.default_rng(seed)
    reference = np.full((120, 160), 90, np.uint8)
    source = np.full((120, 160), 120, np.uint8)
    depth = np.full((120, 160), 40.0, np.float32)
    for _ in range(boxes):
        x, y = random.integers(*area), random.integers(0, 120)
        w, h = random.integers(5, 30, 2)
        cell = np.s_[y : y + h, x : min(x + w, area[1])]
        reference[cell], source[cell] = random.integers(30, 220, 2)
        depth[cell] = random.uniform(3, 40)
    noise = random.normal(0, 1.5, (2, 120, 160))
    return (
        (reference + noise[0]).clip(0, 255).astype(np.uint8),
        (source + noise[1]).clip(0, 255).astype(np.uint8),
        depth,
    )


def choose(frames: list[Frame], wanted: int, seed: int = 0) -> Choice:
    return choose_informed(len(frames), wanted, seed, lambda index: frames[index])


@pytest.fixture
def footage() -> list[Frame]:
    return [frame(seed) for seed in range(8)]


def test_sound_frames_are_all_taken_if_as_many_are_wanted(footage: list[Frame]) -> None:
    choice = choose(footage, 8)
    assert choice.indices == list(range(8))
    assert all(candidate.agreement > 0.5 for candidate in choice.candidates)


def damaged(kind: str, frames: list[Frame], at: int) -> Frame:
    reference, source, depth = frames[at]
    random = np.random.default_rng(99)
    noise = random.normal(0, 1.5, source.shape)
    return {
        "source is flat": (reference, (120 + noise).astype(np.uint8), depth),
        "reference is flat": ((90 + 0.2 * noise).astype(np.uint8), source, depth),
        "source is saturated": (reference, np.where(source > 40, 255, 0).astype("u1"), depth),
        "source is frozen": (reference, frames[at - 2][1], depth),
        "do not agree": (reference, frame(55)[1], depth),
    }[kind]


@pytest.mark.parametrize(
    "kind",
    [
        "source is flat",
        "reference is flat",
        "source is saturated",
        "source is frozen",
        "do not agree",
    ],
)
def test_a_frame_that_cannot_help_is_left_and_says_why(footage: list[Frame], kind: str) -> None:
    footage[5] = damaged(kind, footage, 5)
    choice = choose(footage, 8)
    assert choice.indices == [0, 1, 2, 3, 4, 6, 7]
    assert kind in choice.candidates[5].reason


def test_dead_pixels_cost_their_frame_only_where_they_are_most_of_it(footage: list[Frame]) -> None:
    frames = [(ref, source.astype(np.float32) + 280, depth) for ref, source, depth in footage]
    whole = choose(frames, 8)
    frames[4][1][7, 7] = np.nan
    frames[5][1][:, 1:] = np.nan
    choice = choose(frames, 8)
    assert choice.indices == [0, 1, 2, 3, 4, 6, 7]
    assert "pixels that are not finite, expected at most half" in choice.candidates[5].reason
    assert choice.candidates[4].agreement == pytest.approx(whole.candidates[4].agreement, abs=0.02)


def turned(image: Image, quarters: int, mirrored: bool) -> Image:
    """As a camera sees it that is turned clockwise, in quarters, and then mirrored."""
    image = np.rot90(image, -quarters)
    return np.ascontiguousarray(image[:, ::-1] if mirrored else image)


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("quarters", range(4))
def test_the_choice_does_not_depend_on_the_mount(
    footage: list[Frame], quarters: int, mirrored: bool
) -> None:
    footage[5] = damaged("do not agree", footage, 5)
    frames = [(ref, turned(source, quarters, mirrored), depth) for ref, source, depth in footage]
    choice = choose(frames, 8)
    assert choice.indices == [0, 1, 2, 3, 4, 6, 7]
    for candidate in choice.candidates:
        assert (candidate.agreement > 0.25) == (candidate.index != 5)


def test_frames_of_a_mount_in_between_are_all_taken(footage: list[Frame]) -> None:
    """Where edges meet nowhere, nothing is known of which frames are out of sync."""
    middle = cv2.getRotationMatrix2D((79.5, 59.5), 40, 1)

    def tilted(image: Image) -> Image:
        return cv2.warpAffine(image, middle, (160, 120), borderMode=cv2.BORDER_REFLECT)

    frames = [(ref, tilted(source), depth) for ref, source, depth in footage]
    assert choose(frames, 8).indices == list(range(8))


def test_near_duplicates_come_last(footage: list[Frame]) -> None:
    random = np.random.default_rng(1)
    reference, source, depth = footage[0]
    again = [
        tuple((i + random.normal(0, 1, i.shape)).clip(0, 255).astype("u1") for i in footage[0][:2])
        for _ in range(3)
    ]
    frames = [(reference, source, depth), *((*pair, depth) for pair in again), *footage[1:5]]
    choice = choose(frames, 5)
    assert choice.indices[-4:] == [4, 5, 6, 7]
    assert sum(index < 4 for index in choice.indices) == 1
    assert sum("near-duplicate" in c.reason for c in choice.candidates) == 3


def test_edges_all_over_are_taken_among_edges_at_one_side(footage: list[Frame]) -> None:
    sides = [frame(20 + seed, area=(0, 50)) for seed in range(6)]
    for at in (0, 3, 6):
        assert at in choose([*sides[:at], footage[0], *sides[at:]], 2).indices


def test_frames_that_complete_each_other_are_taken_together() -> None:
    left = [frame(30 + seed, area=(0, 60)) for seed in range(3)]
    right = [frame(40 + seed, area=(100, 160)) for seed in range(3)]
    first, second = choose([*left, *right], 2).indices
    assert first < 3 <= second


def test_few_candidates_are_read_each_once_and_drawn_by_the_seed(footage: list[Frame]) -> None:
    def read(index: int) -> Frame:
        seen.append(index)
        return footage[index % 8]

    drawn = []
    for seed in (1, 1, 2):
        seen: list[int] = []
        choose_informed(10_000, 3, seed, read)
        assert len(seen) == len(set(seen)) == 3 * 4
        assert seen == sorted(seen)
        drawn.append(seen)
    assert drawn[0] == drawn[1] != drawn[2]


def test_frames_that_cannot_be_read_are_left_and_told(footage: list[Frame]) -> None:
    def read(index: int) -> Frame:
        if index == 3:
            raise DecodeError("3.png: cannot decode")
        return footage[index]

    choice = choose_informed(8, 8, 0, read)
    assert [candidate.index for candidate in choice.unusable] == [3]
    assert choice.indices == [0, 1, 2, 4, 5, 6, 7]
    assert "3.png: cannot decode" in choice.table(str)


def test_unknown_depth_is_no_obstacle(footage: list[Frame]) -> None:
    choice = choose_informed(8, 4, 0, lambda index: (*footage[index][:2], None))
    assert len(choice.indices) == 4


# -- In Python ------------------------------------------------------------------------------------


def test_python_chooses_as_the_command_does(scene: Path) -> None:
    """The example of docs/inputs_frames.md, on streams whose images are read when asked for."""
    cut(list_files(scene / "thermal")[4])
    result = calibrate(scene, "--frames", 3, "--report", scene / "report.json")
    assert result.exit_code in (0, 3), result.output
    files = json.loads((scene / "report.json").read_text())["files"]

    visible, thermal = open_stream(scene / "visible"), open_stream(scene / "thermal")
    depths = [read_depth(path) for path in list_files(scene / "depth")]
    choice = xcalib.choose_frames(visible, thermal, depths, max_frames=3)
    chosen = choice.indices
    assert [visible.where(i) for i in chosen] == files
    assert [candidate.index for candidate in choice.unusable] == [4]
    given = ([images[i] for i in chosen] for images in (visible, thermal, depths))
    options = xcalib.CalibrationOptions(max_frames=3, working_width=160)
    rig = xcalib.calibrate(*given, options=options).rig
    np.testing.assert_allclose(rig.t, xcalib.Rig.load(scene / "rig.yaml").t, atol=1e-6)


def test_python_reads_each_image_once_and_keeps_none() -> None:
    frames = [frame(seed) for seed in range(6)]
    alive: list[weakref.ref[Image]] = []

    class Images(Sequence[Image]):
        def __init__(self, kind: int) -> None:
            self.kind, self.asked = kind, []

        def __len__(self) -> int:
            return 6

        def __getitem__(self, index: int) -> Image:
            self.asked.append(index)
            assert sum(image() is not None for image in alive) <= 3
            image = frames[index][self.kind].copy()
            alive.append(weakref.ref(image))
            return image

    streams = [Images(kind) for kind in range(3)]
    assert len(xcalib.choose_frames(*streams, max_frames=2).indices) == 2
    assert all(stream.asked == list(range(6)) for stream in streams)


def test_python_names_what_cannot_be_chosen_from() -> None:
    reference, source, depth = frame(0)
    with pytest.raises(InputError, match="depths are 2, 2, 1 frames, expected as many of each"):
        xcalib.choose_frames([reference] * 2, [source] * 2, [depth])
    with pytest.raises(InputError, match="are 0, 0 frames, expected as many of each, at least 1"):
        xcalib.choose_frames([], [])
    with pytest.raises(InputError, match=r"source 1 has shape \(9, 160\), expected \(120, 160\)"):
        xcalib.choose_frames([reference] * 2, [source, source[:9]])
    with pytest.raises(InputError, match="max_frames is 0, expected at least 1"):
        xcalib.choose_frames([reference], [source], max_frames=0)


# -- The command ---------------------------------------------------------------------------------


def calibrate(scene: Path, *more: str | int | Path) -> Result:
    return run(
        *("calibrate", scene / "visible", scene / "thermal", "--depth", scene / "depth"),
        *("-o", scene / "rig.yaml", "--working-width", 160, *more),
    )


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-20])


@pytest.mark.parametrize("kind", ["visible", "thermal", "depth"])
@pytest.mark.parametrize("choose", ["spread", "informed"])
def test_calibrate_leaves_out_what_it_cannot_read(scene: Path, kind: str, choose: str) -> None:
    path = list_files(scene / kind)[1]
    cut(path)
    result = calibrate(scene, "--choose", choose)
    assert result.exit_code in (0, 3), result.output
    lines = [line for line in result.stderr.splitlines() if line.startswith("warning: ")]
    assert len(lines) == 1
    assert "1 unusable frame is left out" in lines[0]
    assert str(path) in lines[0]
    assert (scene / "rig.yaml").exists()


@pytest.mark.parametrize("choose", ["spread", "informed"])
def test_no_readable_frame_is_an_error(
    scene: Path, refused: Callable[..., str], choose: str
) -> None:
    paths = list_files(scene / "thermal")
    for path in paths:
        cut(path)
    line = refused(
        *("calibrate", scene / "visible", scene / "thermal", "--depth", scene / "depth"),
        *("-o", scene / "rig.yaml", "--choose", choose),
    )
    assert f"{paths[0]}: cannot decode" in line


def test_explain_prints_every_frame(scene: Path) -> None:
    path = list_files(scene / "thermal")[2]
    shut = np.full_like(read_image(path), 128)
    write_image(path, cv2.randn(shut.copy(), 128, 1))
    result = calibrate(scene, "--choose", "informed", "--explain")
    assert result.exit_code in (0, 3), result.output
    for reference in list_files(scene / "visible"):
        assert reference.stem in result.stdout
    assert "source is flat" in result.stdout
    assert "1 unusable frame is left out" in result.stderr


def test_explain_wants_the_informed_choice(scene: Path, refused: Callable[..., str]) -> None:
    line = refused(
        *("calibrate", scene / "visible", scene / "thermal", "--depth", "plane"),
        *("-o", scene / "rig.yaml", "--choose", "spread", "--explain"),
    )
    assert "--choose informed" in line
