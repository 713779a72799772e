"""The verdict: in the report, in the rig file, and in what every command does with the rig."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

import xcalib
from conftest import FRAMES, Process, run
from xcalib import Rig, metrics
from xcalib.depth import PlaneDepth, read_depth
from xcalib.frames import Image, list_files, read_image


def folders(scene: Path) -> tuple[str | Path, ...]:
    return scene / "visible", scene / "thermal", "--depth", scene / "depth"


@pytest.fixture(scope="module")
def refused(calibrated: tuple[Path, Result], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calibrated rig, as if it were not to be trusted."""
    text = (calibrated[0] / "rig.yaml").read_text()
    assert text.count("trusted: true") == 1
    path = tmp_path_factory.mktemp("refused") / "rig.yaml"
    text = text.replace("trusted: true", "trusted: false")
    path.write_text(text.replace("  expected_error_px", "  advice: turn it\n  expected_error_px"))
    return path


def test_the_rig_file_has_the_verdict(calibrated: tuple[Path, Result]) -> None:
    folder, _ = calibrated
    verdict = Rig.load(folder / "rig.yaml").verdict
    report = json.loads((folder / "report.json").read_text())["verdict"]
    assert verdict is not None
    assert verdict.trusted
    assert verdict.found
    assert verdict.frames == FRAMES
    assert verdict.software == f"xcalib {xcalib.__version__}"
    assert verdict.reason == report["reason"]
    assert verdict.expected_error.median == report["expected_error_px"]["median"]
    assert list(verdict.by_depth) == [2, 3, 5, 10, 20, 50, math.inf]
    assert [row["p95"] for row in report["error_by_depth"]] == [
        error.p95 for error in verdict.by_depth.values()
    ]
    for depth, error in verdict.by_depth.items():
        assert 0 < error.median < error.p95
        assert tuple(verdict.error_at(depth)) == pytest.approx(tuple(error))


def test_a_saved_rig_keeps_it(calibrated: tuple[Path, Result], tmp_path: Path) -> None:
    rig = Rig.load(calibrated[0] / "rig.yaml")
    rig.save(tmp_path / "again.yaml")
    text = (calibrated[0] / "rig.yaml").read_text()
    assert (tmp_path / "again.yaml").read_text() == text
    assert text.startswith("format: xcalib-rig\nversion: 2\n")
    plain = Rig(rig.reference, rig.source, rig.R, rig.t)
    assert plain.verdict is None
    plain.save(tmp_path / "plain.yaml")
    assert "version: 1\n" in (tmp_path / "plain.yaml").read_text()


def test_the_expected_error_is_near_the_true_one(
    calibrated: tuple[Path, Result], rendered: Path
) -> None:
    rig, truth = Rig.load(calibrated[0] / "rig.yaml"), Rig.load(rendered / "rig.yaml")
    assert rig.verdict is not None
    to_640 = 640 / rig.reference.width * rig.reference.fx / rig.source.fx
    errors = np.concatenate(
        [
            metrics.end_point_error(rig, truth, read_depth(path)).ravel()
            for path in sorted((rendered / "depth").iterdir())
        ]
    )
    true = to_640 * np.nanquantile(errors, [0.5, 0.95])
    assert 0.4 < rig.verdict.expected_error.median / true[0] < 2.5
    assert 0.4 < rig.verdict.expected_error.p95 / true[1] < 3


def test_inspect_prints_it(calibrated: tuple[Path, Result], refused: Path) -> None:
    text = run("inspect", calibrated[0] / "rig.yaml").stdout
    assert "trusted" in text
    assert "NOT TRUSTED" not in text
    assert f"calibrated on {FRAMES} frames" in text
    assert "expected error" in text
    assert "NOT TRUSTED" in run("inspect", refused).stdout
    assert "turn it" in run("inspect", refused).stdout
    assert json.loads(run("inspect", "--json", refused).stdout)["verdict"]["trusted"] is False


def test_commands_that_use_an_untrusted_rig_say_so(
    both: Callable[..., tuple[Process, Result]], refused: Path, rendered: Path, tmp_path: Path
) -> None:
    for arguments in (
        ("register", refused, *folders(rendered), "-o", tmp_path / "OUT", "--quiet"),
        ("evaluate", refused, *folders(rendered), "--quiet"),
    ):
        first, second = both(*arguments)
        assert first.returncode == 3
        assert first.stderr == second.stderr
        *before, last = first.stderr.splitlines()
        assert last.startswith(f"not to be trusted: {refused}: expected error")
        assert last.endswith("; turn it")
        differs = f"warning: {refused} is not to be trusted by its calibration, but is on these"
        assert [line.startswith(differs) for line in before] == [True] * (
            arguments[0] == "evaluate"
        )
    assert len(list((tmp_path / "c").glob("*.png"))) == FRAMES


@pytest.fixture(scope="module")
def stale(calibrated: tuple[Path, Result], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The calibrated rig, as if its source had been turned by 0.5 degrees since."""
    text = (calibrated[0] / "rig.yaml").read_text()
    rig = Rig.load(calibrated[0] / "rig.yaml")
    c, s = np.cos(np.deg2rad(0.5)), np.sin(np.deg2rad(0.5))
    pan = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    path = tmp_path_factory.mktemp("stale") / "rig.yaml"
    Rig(rig.reference, rig.source, pan @ rig.R, pan @ rig.t).save(path)
    turned = path.read_text().replace("version: 1", "version: 2")
    path.write_text(turned + text[text.index("calibration:") :])
    return path


def test_evaluate_says_where_the_verdict_on_these_frames_differs(
    both: Callable[..., tuple[Process, Result]],
    calibrated: tuple[Path, Result],
    stale: Path,
    rendered: Path,
) -> None:
    for rig, is_stale in ((calibrated[0] / "rig.yaml", False), (stale, True)):
        for result in both("evaluate", rig, *folders(rendered), "--quiet"):
            line = next(x for x in result.stdout.splitlines() if x.startswith("on these frames: "))
            assert ("NOT TRUSTED: these frames have the source" in line) == is_stale, line
            said = f"warning: {rig} was trusted when it was calibrated, but is not on these frames"
            assert result.stderr.startswith(said) == is_stale


def test_a_tolerance_that_is_not_met_is_named(rendered: Path, tmp_path: Path) -> None:
    result = run(
        *("calibrate", *folders(rendered), "--working-width", 160, "--tolerance", "0.001"),
        *("-o", tmp_path / "rig.yaml"),
    )
    assert result.exit_code == 3, result.output
    assert "more than the tolerance of 0.001 and 0.0025 px" in result.stderr
    verdict = Rig.load(tmp_path / "rig.yaml").verdict
    assert verdict is not None
    assert verdict.found
    assert not verdict.trusted
    assert "--tolerance" in verdict.advice


def of_the_next_frame(depths: list[Image]) -> list[Image]:
    return [*depths[1:], depths[0]]


def inverse(depths: list[Image]) -> list[Image]:
    return [np.where(d > 0, 30 / np.maximum(d, 0.1), 0).astype(np.float32) for d in depths]


def constant(depths: list[Image]) -> list[Image]:
    return [np.full_like(depth, 10) for depth in depths]


def mirrored(depths: list[Image]) -> list[Image]:
    return [np.ascontiguousarray(depth[:, ::-1]) for depth in depths]


def of_one_frame(depths: list[Image]) -> list[Image]:
    return [depths[0]] * len(depths)


@pytest.mark.parametrize(
    ("spoil", "reason", "advice"),
    [
        (mirrored, "the depth maps fit better when they are mirrored", "as the reference images"),
        (of_one_frame, "all frames have the same depth map", "each frame its own"),
        (of_the_next_frame, "the depth of the last frame fits better", "late or early"),
        (inverse, "inverse depth fits better than the given depth", "disparity"),
        (constant, "every depth is the same", "give the depth of each pixel"),
    ],
)
def test_depth_that_is_wrong_is_named(
    rendered: Path, spoil: Callable[[list[Image]], list[Image]], reason: str, advice: str
) -> None:
    references, sources = (
        [read_image(path) for path in list_files(rendered / name)]
        for name in ("visible", "thermal")
    )
    depths = [read_depth(path) for path in list_files(rendered / "depth")]
    verdict = xcalib.calibrate(references, sources, spoil(depths)).report.verdict
    assert not verdict.trusted
    assert reason in verdict.reason
    assert advice in verdict.advice


def test_a_road_plane_is_not_called_mirrored(rendered: Path) -> None:
    references, sources = (
        [read_image(path) for path in list_files(rendered / name)]
        for name in ("visible", "thermal")
    )
    plane = [PlaneDepth()(0, references[0])] * len(references)  # it is its own mirror image
    verdict = xcalib.calibrate(references, sources, plane).report.verdict
    assert verdict.found
    assert "mirrored" not in verdict.reason


def test_the_same_footage_twice_is_named(rendered: Path) -> None:
    references = [read_image(path) for path in list_files(rendered / "visible")]
    depths = [read_depth(path) for path in list_files(rendered / "depth")]
    verdict = xcalib.calibrate(references, references, depths).report.verdict
    assert not verdict.trusted
    assert "edges of both images have the same sign" in verdict.reason
    assert "MSX" in verdict.advice


@pytest.mark.parametrize("word", ["x", "1,2,3", "-1", "0", "1,", "2,nan", "1 2"])
def test_a_tolerance_that_is_none_is_refused(
    both: Callable[..., tuple[Process, Result]], rendered: Path, tmp_path: Path, word: str
) -> None:
    first, second = both(
        "calibrate", *folders(rendered), f"--tolerance={word}", "-o", tmp_path / "OUT.yaml"
    )
    assert first.returncode == 2
    assert first.stderr == second.stderr
    assert f"--tolerance is '{word}', expected MEDIAN or MEDIAN,P95" in first.stderr


@pytest.mark.parametrize(
    ("good", "bad", "said"),
    [
        ("trusted: true", "trusted: maybe", "calibration.trusted = maybe, expected true or false"),
        ("frames: 6", "frames: 0", "calibration.frames = 0, expected a whole number, at least 1"),
        ("depth_m: 3,", "depth_m: 2,", "depth_m = 2, expected more than that of the row before"),
        ("depth_m: 2,", "depth_m: -2,", "depth_m = -2, expected a length >= 0 or .inf"),
        ("  found: true\n", "", "missing field 'found' in calibration"),
        ("  found: true", "  found: true\n  moon: 1", "unknown field 'moon' in calibration"),
    ],
)
def test_a_verdict_that_cannot_be_read_is_named(
    calibrated: tuple[Path, Result], tmp_path: Path, good: str, bad: str, said: str
) -> None:
    text = (calibrated[0] / "rig.yaml").read_text()
    assert good in text
    path = tmp_path / "rig.yaml"
    path.write_text(text.replace(good, bad, 1))
    with pytest.raises(ValueError, match=rf"^{path}: ") as error:
        Rig.load(path)
    assert said in str(error.value)
