"""The ``xcalib`` command: from frames to registered frames, and every refusal on the way."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import Result

from conftest import FRAMES, run
from xcalib import CalibrationOptions, Pinhole, Rig, evaluate, metrics, pipeline
from xcalib.depth import read_depth
from xcalib.frames import Image, list_files, read_image, write_image
from xcalib.inspection import describe

Refused = Callable[..., str]


def folders(scene: Path) -> tuple[str | Path, ...]:
    return scene / "visible", scene / "thermal", "--depth", scene / "depth"


def calibration(scene: Path) -> tuple[str | Path, ...]:
    """Arguments of a calibration that would write below the scene's parent."""
    return "calibrate", *folders(scene), "-o", scene.parent / "out" / "rig.yaml"


def rewrite(path: Path, change: Callable[[Image], Image]) -> None:
    write_image(path, change(read_image(path)))


def files(folder: Path) -> list[Path]:
    return list_files(folder)


def not_trusted(result: Result) -> str:
    assert result.exit_code == 3, result.output
    assert result.stderr.startswith("not to be trusted: ")
    assert result.stderr.count("\n") == 1, result.stderr
    return result.stderr


# -- The whole path


def test_version() -> None:
    assert run("--version").stdout.strip().endswith(version("xcalib-rgbt"))


def test_defaults_are_those_of_the_options() -> None:
    text = " ".join(run("calibrate", "--help").stdout.split())
    options = CalibrationOptions()
    assert re.search(rf"--frames N .*?default: {options.max_frames}\b", text)
    assert re.search(rf"--working-width PX .*?default: {options.working_width}\b", text)
    assert re.search(rf"--search .*?default: {options.search.mode}\]", text)


def test_calibrate_finds_the_rig(calibrated: tuple[Path, Result], rendered: Path) -> None:
    folder, result = calibrated
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    assert str(folder / "rig.yaml") in result.stdout
    rig, truth = Rig.load(folder / "rig.yaml"), Rig.load(rendered / "rig.yaml")
    depth = read_depth(files(rendered / "depth")[0])
    assert np.nanmedian(metrics.end_point_error(rig, truth, depth)) < 0.5


def test_report_prints_what_calibrate_wrote(calibrated: tuple[Path, Result]) -> None:
    folder, _ = calibrated
    document = json.loads((folder / "report.json").read_text())
    result = run("report", folder / "report.json")
    assert result.exit_code == 0
    assert f"converged: {document['converged']}" in result.stdout
    assert document["message"] in result.stdout
    assert len(document["files"]) == FRAMES


def test_register_writes_images_and_masks(
    calibrated: tuple[Path, Result], scene: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    arguments = ("register", calibrated[0] / "rig.yaml", *folders(scene), "-o", out)
    result = run(*arguments, "--overlay")
    assert result.exit_code == 0, result.output
    assert f"{FRAMES} frames" in result.stdout
    names = [path.name for path in files(scene / "visible")]
    for folder in (out, out / "masks", out / "overlays"):
        assert [path.name for path in files(folder)] == names
    reference = read_image(scene / "visible" / names[0])
    assert read_image(out / names[0]).shape == reference.shape[:2]
    mask = read_image(out / "masks" / names[0])
    assert mask.shape == reference.shape[:2]
    assert set(np.unique(mask)) <= {0, 1, 2, 3}
    assert (mask == 0).mean() > 0.3
    unknown = read_depth(scene / "depth" / names[0]) == 0
    assert (mask[unknown] == 3).all()


@pytest.mark.parametrize(
    ("dtype", "suffix", "channels"),
    [(np.uint16, ".png", 1), (np.float32, ".tiff", 1), (np.uint8, ".png", 3)],
)
def test_register_keeps_the_type_of_the_source(
    calibrated: tuple[Path, Result],
    scene: Path,
    tmp_path: Path,
    dtype: type,
    suffix: str,
    channels: int,
) -> None:
    for path in files(scene / "thermal"):
        image: Image = read_image(path).astype(dtype)
        path.unlink()
        if channels == 3:
            image = np.dstack([image] * 3)
        write_image(path.with_suffix(suffix), image * dtype(100 if dtype == np.uint16 else 1))
    out = tmp_path / "out"
    result = run("register", calibrated[0] / "rig.yaml", *folders(scene), "-o", out)
    assert result.exit_code == 0, result.output
    written = files(out)
    assert len(written) == FRAMES
    image = read_image(written[0])
    assert written[0].suffix == suffix
    assert image.dtype == dtype
    assert image.ndim == (3 if channels == 3 else 2)
    assert image.max() > (2000 if dtype == np.uint16 else 20)


def test_register_rescales_the_rig_to_smaller_images(
    calibrated: tuple[Path, Result], scene: Path, tmp_path: Path
) -> None:
    for path in files(scene / "visible"):
        rewrite(path, lambda image: cv2.resize(image, None, fx=0.5, fy=0.5))
    out = tmp_path / "out"
    result = run("register", calibrated[0] / "rig.yaml", *folders(scene), "-o", out)
    assert result.exit_code == 0, result.output
    half = read_image(files(scene / "visible")[0]).shape[:2]
    assert read_image(files(out)[0]).shape == half


def test_plane_depth_needs_no_files(
    calibrated: tuple[Path, Result], scene: Path, tmp_path: Path
) -> None:
    visible, thermal = scene / "visible", scene / "thermal"
    rig, out = calibrated[0] / "rig.yaml", tmp_path / "out"
    result = run("register", rig, visible, thermal, "--depth", "plane", "--far", "40", "-o", out)
    assert result.exit_code == 0, result.output
    assert not (read_image(files(out / "masks")[0]) == 3).any()


def test_evaluate_prefers_the_registered_source(
    calibrated: tuple[Path, Result], rendered: Path, tmp_path: Path
) -> None:
    rig, scores = calibrated[0] / "rig.yaml", tmp_path / "scores.json"
    result = run("evaluate", rig, *folders(rendered), "--json", scores)
    assert result.exit_code == 0, result.output
    for label in ("NEC", "GC", "SSIM", "NCC", "RMSE", "PSNR", "patch median", "patch < 2 px"):
        assert label in result.stdout
    document = json.loads(scores.read_text())
    assert len(document["frames"]) == len(document["files"]) == FRAMES
    registered, unregistered = document["registered"], document["unregistered"]
    assert registered["nec"] > unregistered["nec"]
    assert registered["gc"] > unregistered["gc"]
    assert 0.2 < document["valid_share"] <= 1


def test_evaluate_by_hand() -> None:
    """A source that is the reference, 5 px further right, is undone exactly."""
    rng = np.random.default_rng(0)
    wide = cv2.GaussianBlur(rng.random((120, 170), np.float32), (0, 0), 2)
    reference, source = wide[:, 5:165], wide[:, :160]
    camera = Pinhole(160, 120, 150, 150, 79.5, 59.5)
    rig = Rig(camera, Pinhole(160, 120, 150, 150, 84.5, 59.5))
    depth = np.full((120, 160), 10, np.float32)
    result = evaluate(rig, [reference], [source], [depth])
    assert result.size == (160, 120)
    assert result.valid_share == pytest.approx((160 - 7) / 160, abs=0.03)
    assert result.registered["rmse"] == pytest.approx(0, abs=1e-4)
    assert result.registered["ncc"] == pytest.approx(1, abs=1e-4)
    assert result.unregistered["ncc"] < 0.5
    assert result.gain_percent["rmse"] == pytest.approx(-100, abs=1)
    # At half the size the shift is no whole number of pixels any more.
    assert evaluate(rig, [reference], [source], [depth], width=80).size == (80, 60)


def test_demo(tmp_path: Path) -> None:
    out = tmp_path / "demo"
    result = run("demo", "-o", out, "--frames", FRAMES, "--width", 320)
    assert result.exit_code == 0, result.output
    found = re.search(r"end-point error +([0-9.]+) median", result.stdout)
    assert found and float(found[1]) < 0.5
    for name in ("rig.yaml", "before.png", "after.png"):
        assert (out / name).is_file()
        assert str(out / name) in result.stdout
    assert (out / "data" / "rig.yaml").is_file()
    before, after = read_image(out / "before.png"), read_image(out / "after.png")
    assert before.shape == after.shape == (240, 3 * 320, 3)
    # Again, shorter: what the first left behind is not taken for its own.
    result = run("demo", "-o", out, "--frames", 2, "--width", 320)
    assert "2 frames" in result.stdout


# -- inspect


def test_inspect_by_hand() -> None:
    pan = np.deg2rad(10)
    reference_from_source = np.array(
        [[np.cos(pan), 0, np.sin(pan)], [0, 1, 0], [-np.sin(pan), 0, np.cos(pan)]]
    )
    turn = reference_from_source.T
    camera = Pinhole(640, 480, 500, 500, 319.5, 239.5)
    facts = describe(Rig(camera, camera, turn, turn @ [-0.2, 0, 0]))
    assert facts["rotation_deg"]["pan"] == pytest.approx(10)
    assert facts["rotation_deg"]["tilt"] == pytest.approx(0, abs=1e-9)
    assert facts["rotation_deg"]["roll"] == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(facts["position_m"], [0.2, 0, 0], atol=1e-12)
    assert facts["baseline_m"] == pytest.approx(0.2)
    far = facts["centre"][-1]
    assert far["depth_m"] is None
    assert far["parallax_px"] == 0
    # Looking to the right, the source sees the reference's centre on its left.
    assert far["point_px"][0] == pytest.approx(319.5 - 500 * np.tan(pan))
    straight = describe(Rig(camera, camera, np.eye(3), [-0.2, 0, 0]))
    assert straight["centre"][0]["parallax_px"] == pytest.approx(500 * 0.2 / 2)


@pytest.mark.parametrize(("axis", "name"), [((1, 0, 0), "tilt"), ((0, 0, 1), "roll")])
def test_inspect_turns_up_and_clockwise(axis: tuple[int, int, int], name: str) -> None:
    # x right, y down, z forward: a positive turn about x lifts the axis, about z is clockwise.
    reference_from_source, _ = cv2.Rodrigues(np.deg2rad(7.0) * np.array(axis, float))
    camera = Pinhole(640, 480, 500, 500, 319.5, 239.5)
    turn = describe(Rig(camera, camera, reference_from_source.T))["rotation_deg"]
    expected = {"pan": 0, "tilt": 0, "roll": 0, name: 7}
    assert turn == pytest.approx(expected, abs=1e-6)


def test_inspect_prints_a_rig(rendered: Path) -> None:
    result = run("inspect", rendered / "rig.yaml")
    assert result.exit_code == 0
    for word in ("reference", "source", "HFoV", "pan", "baseline", "infinity"):
        assert word in result.stdout
    facts = json.loads(run("inspect", "--json", rendered / "rig.yaml").stdout)
    assert facts["reference"]["width"] == 320


# -- Refused input: exit 2, one line that names it, nothing written


def test_mismatched_counts(scene: Path, refused: Refused) -> None:
    files(scene / "thermal")[-1].unlink()
    line = refused(*calibration(scene))
    assert f"({FRAMES} files)" in line and f"({FRAMES - 1} files)" in line
    assert files(scene / "visible")[-1].name in line


def test_unpaired_names(scene: Path, refused: Refused) -> None:
    lost = files(scene / "thermal")[2]
    lost.rename(lost.with_name("977.png"))
    line = refused(*calibration(scene))
    assert f"visible/{lost.name}" in line and "thermal/977.png" in line


@pytest.mark.parametrize("kind", ["visible", "thermal", "depth"])
def test_missing_depth_or_image_folder(scene: Path, refused: Refused, kind: str) -> None:
    (scene / kind).rename(scene / "elsewhere")
    assert str(scene / kind) in refused(*calibration(scene))


def test_file_for_folder_and_empty_folder(scene: Path, refused: Refused) -> None:
    image = files(scene / "visible")[0]
    arguments = ("--depth", "plane", "-o", scene / "rig.yaml")
    line = refused("calibrate", image, scene / "thermal", *arguments)
    assert f"{image} is a file" in line
    (scene / "none").mkdir()
    line = refused("calibrate", scene / "visible", scene / "none", *arguments)
    assert f"{scene / 'none'}: empty" in line


@pytest.mark.parametrize(
    ("command", "kind"),
    [
        ("register", "thermal"),
        ("register", "depth"),
        *(("evaluate", kind) for kind in ("visible", "thermal", "depth")),
    ],
)
def test_truncated_image(scene: Path, rendered: Path, kind: str, command: str) -> None:
    """In a process of its own: image libraries print past Python's stderr."""
    path = files(scene / kind)[0]
    path.write_bytes(path.read_bytes()[:-20])
    arguments = {
        "register": ("register", rendered / "rig.yaml", *folders(scene), "-o", scene / "out"),
        "evaluate": ("evaluate", rendered / "rig.yaml", *folders(scene)),
    }[command]
    before = sorted(scene.parent.rglob("*"))
    result = subprocess.run(
        [sys.executable, "-c", "from xcalib.cli import main; main()", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 2
    assert re.fullmatch(
        rf"error: {re.escape(str(path))}: cannot decode .*truncated.*\n", result.stderr
    )
    assert sorted(scene.parent.rglob("*")) == before


def test_a_truncated_reference_that_nobody_looks_at(scene: Path, rendered: Path) -> None:
    path = files(scene / "visible")[0]
    path.write_bytes(path.read_bytes()[:-20])
    result = run("register", rendered / "rig.yaml", *folders(scene), "-o", scene / "out")
    assert result.exit_code == 0, result.stderr
    assert len(files(scene / "out")) == FRAMES


def test_truncated_jpeg(scene: Path, refused: Refused) -> None:
    for path in files(scene / "visible"):
        write_image(path.with_suffix(".JPG"), read_image(path))
        path.unlink()
    path = files(scene / "visible")[3]
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 3 // 4])
    line = refused("evaluate", scene / "rig.yaml", *folders(scene))
    assert f"{path}: cannot decode" in line


def test_images_of_two_sizes(scene: Path, refused: Refused) -> None:
    path = files(scene / "visible")[1]
    rewrite(path, lambda image: image[:-2])
    assert re.search(rf"{path.name} is 320x238, expected 320x240", refused(*calibration(scene)))


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda depth: depth[:, :-9], "depth is 311x240, but the reference image is 320x240"),
        (lambda depth: depth.astype(np.uint8), "expected a 16-bit PNG"),
    ],
)
def test_bad_depth(
    scene: Path, refused: Refused, change: Callable[[Image], Image], problem: str
) -> None:
    path = files(scene / "depth")[1]
    rewrite(path, change)
    line = refused(*calibration(scene))
    assert str(path) in line and problem in line


def test_nan_and_inf_depth_are_unknown(rendered: Path, scene: Path, tmp_path: Path) -> None:
    for number, path in enumerate(files(scene / "depth")):
        depth = read_depth(path)
        depth[depth == 0] = (np.nan, np.inf, -1)[number % 3]
        np.save(path.with_suffix(".npy"), depth)
        path.unlink()
    rig = rendered / "rig.yaml"
    for name, folder in (("a", rendered), ("b", scene)):
        assert run("register", rig, *folders(folder), "-o", tmp_path / name).exit_code == 0
    for first, second in zip(files(tmp_path / "a"), files(tmp_path / "b"), strict=True):
        np.testing.assert_array_equal(read_image(first), read_image(second))


@pytest.mark.parametrize("kind", ["visible", "thermal"])
def test_constant_images(scene: Path, refused: Refused, kind: str) -> None:
    for path in files(scene / kind):
        rewrite(path, lambda image: np.full_like(image, 90))
    refused(*calibration(scene))


def test_an_unknown_depth_spec_says_what_is_accepted(scene: Path, refused: Refused) -> None:
    visible, thermal, out = scene / "visible", scene / "thermal", scene / "rig.yaml"
    line = refused("calibrate", visible, thermal, "--depth", "model.pt", "-o", out)
    assert "model.pt" in line and "`plane`" in line


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (("--reference-intrinsics", "1,2,3"), "'1,2,3' is not four numbers"),
        (("--source-intrinsics", "-1,2,3,4"), "FX and FY above 0"),
        (
            ("--source-lens", "brown:1,2"),
            "--source-lens is 'brown:1,2', expected auto, none, brown:",
        ),
        (("--reference-lens", "fisheye:0,0,0,x"), "--reference-lens is 'fisheye:0,0,0,x'"),
        (("--frames", "0"), "--frames"),
        (("--seed", "-1"), "--seed"),
        (("--far", "0"), "plane far is 0"),
        (("--search", "wild"), "wild"),
        (("--reference-hfov", "180"), "--reference-hfov"),
        (("--depth-scale", "0"), "depth scale is 0"),
        (("--initial", "/nowhere/rig.yaml"), "/nowhere/rig.yaml"),
        (
            ("--reference-intrinsics", "1,1,0,0", "--optimize-reference"),
            "--reference-intrinsics are kept",
        ),
    ],
)
def test_bad_options(scene: Path, refused: Refused, arguments: tuple[str, ...], named: str) -> None:
    assert named in refused(*calibration(scene), *arguments)


@pytest.mark.parametrize("out", ["file/rig.yaml", "file/deep/rig.yaml", "/proc/none/rig.yaml", "."])
def test_unwritable_rig(
    scene: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch, out: str
) -> None:
    def too_late(*_: object) -> None:
        raise AssertionError("calibrated before looking at the output")

    monkeypatch.setattr(pipeline, "calibrate", too_late)
    (scene / "file").touch()
    line = refused("calibrate", *folders(scene), "-o", scene / out)
    assert "cannot write" in line and str((scene / out).parent) in line


@pytest.mark.parametrize("out", ["file", "file/deep", "/proc/none"])
def test_unwritable_output_folder(scene: Path, refused: Refused, out: str) -> None:
    (scene / "file").touch()
    line = refused("register", scene / "rig.yaml", *folders(scene), "-o", scene / out)
    assert f"cannot write to {scene / out}" in line
    line = refused("demo", "-o", scene / out)
    assert f"cannot write to {scene / out}" in line


def test_input_is_not_overwritten(scene: Path, refused: Refused) -> None:
    visible = scene / "visible"
    line = refused("register", scene / "rig.yaml", *folders(scene), "-o", visible)
    assert f"{visible} is an input folder" in line


def test_images_that_are_not_the_rigs(scene: Path, refused: Refused) -> None:
    for path in files(scene / "thermal"):
        rewrite(path, lambda image: image[:, :-20])
    rig = scene / "rig.yaml"
    line = refused("register", rig, *folders(scene), "-o", scene / "out")
    assert "source images are" in line and "the rig's source camera is" in line


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda text: text.replace("version: 1", "version: 3"), "version"),
        (lambda text: text.replace("xcalib-rig", "other-rig"), "format"),
        (lambda text: re.sub(r"(\n *)?fx: [^,\n}]+,? ?", "", text, count=1), "fx"),
        (lambda text: text.rstrip() + "\nsurprise: 1\n", "surprise"),
        (lambda text: re.sub(r"fy: [^,\n}]+", "fy: .nan", text, count=1), "fy"),
        (lambda text: re.sub(r"fx: [^,\n}]+", "fx: .inf", text, count=1), "fx"),
        (lambda text: re.sub(r"fx: [^,\n}]+", "fx: wide", text, count=1), "fx"),
        (lambda text: "{" + text, ""),
        (lambda text: "", ""),
    ],
)
def test_bad_rig_file(
    scene: Path, refused: Refused, change: Callable[[str], str], named: str
) -> None:
    path = scene / "rig.yaml"
    text = path.read_text()
    path.write_text(change(text))
    assert path.read_text() != text
    for arguments in (
        ("inspect", path),
        ("register", path, *folders(scene), "-o", scene / "out"),
        ("evaluate", path, *folders(scene)),
        (*calibration(scene), "--initial", path),
    ):
        line = refused(*arguments)
        assert str(path) in line and named in line


def test_missing_rig_file(scene: Path, refused: Refused) -> None:
    assert str(scene / "no.yaml") in refused("inspect", scene / "no.yaml")


@pytest.mark.parametrize("text", ["", "[]", '{"format": "xcalib-report", "version": 2}'])
def test_bad_report_file(tmp_path: Path, refused: Refused, text: str) -> None:
    (tmp_path / "r.json").write_text(text)
    assert str(tmp_path / "r.json") in refused("report", tmp_path / "r.json")


# -- Done, but not to be trusted: exit 3; failed: exit 1


def test_one_frame_is_not_trusted(scene: Path) -> None:
    result = run(*calibration(scene), "--frames", 1)
    assert re.search(r"\b(one|1|single)\b", not_trusted(result))
    assert (scene.parent / "out" / "rig.yaml").is_file()


def test_unrelated_images_are_not_trusted(scene: Path) -> None:
    rng = np.random.default_rng(0)
    for path in [*files(scene / "visible"), *files(scene / "thermal")]:
        rewrite(
            path,
            lambda image: cv2.GaussianBlur(rng.integers(0, 256, image.shape, np.uint8), (0, 0), 2),
        )
    not_trusted(run(*calibration(scene)))


def test_nothing_valid_is_not_trusted(scene: Path, tmp_path: Path) -> None:
    rig = Rig.load(scene / "rig.yaml")
    rig.R = np.diag([-1.0, 1.0, -1.0])  # looks the other way
    rig.save(scene / "rig.yaml")
    result = run("register", scene / "rig.yaml", *folders(scene), "-o", tmp_path / "out")
    assert "no pixel" in not_trusted(result)
    result = run("evaluate", scene / "rig.yaml", *folders(scene))
    assert "no pixel" in not_trusted(result)


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (KeyboardInterrupt(), "error: interrupted\n"),
        (RuntimeError("solver\nbroke"), "error: solver broke\n"),
    ],
)
def test_failures_leave_no_rig(
    scene: Path, monkeypatch: pytest.MonkeyPatch, error: BaseException, line: str
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr(pipeline, "calibrate", fail)
    result = run(*calibration(scene))
    assert result.exit_code == 1
    assert result.stderr == line
    assert not (scene.parent / "out").exists()


def test_errors_of_the_core_name_the_file(
    scene: Path, monkeypatch: pytest.MonkeyPatch, refused: Refused
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("reference of frame 2 is constant")

    monkeypatch.setattr(pipeline, "calibrate", fail)
    assert str(files(scene / "visible")[2]) in refused(*calibration(scene))


def test_occluded_pixels_are_black_on_request(rendered: Path, tmp_path: Path) -> None:
    images = {}
    for occlusion in ("mark", "hide"):
        out = tmp_path / occlusion
        arguments = ("register", rendered / "rig.yaml", *folders(rendered), "-o", out)
        assert run(*arguments, "--occlusion", occlusion).exit_code == 0
        images[occlusion] = read_image(files(out)[0]), read_image(files(out / "masks")[0])
    (marked, mask), (hidden, same) = images["mark"], images["hide"]
    np.testing.assert_array_equal(mask, same)
    occluded = mask == 2
    assert occluded.any()
    assert (hidden[occluded] == 0).all()
    assert (marked[occluded] > 0).mean() > 0.9
    np.testing.assert_array_equal(marked[~occluded], hidden[~occluded])
