"""Depth from scans and stereo pairs, its completion and its conditioning."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from conftest import run, small
from xcalib import Rig, synthetic
from xcalib.depth import FolderDepth, MeasuredDepth, open_depth, read_depth
from xcalib.depth.completion import CompletedDepth, complete
from xcalib.depth.conditioning import SteadyDepth
from xcalib.depth.lidar import LidarCalibration, project, read_lidar_calibration, without_hidden
from xcalib.depth.points import read_points
from xcalib.depth.stereo import StereoGeometry, disparity
from xcalib.frames import InputError, read_image, write_image

POINTS = np.array([[1.5, -2, 3], [4, 5, -6.25], [0.125, 0, 7]], np.float32)
K = np.array([[100.0, 0, 20], [0, 100, 15], [0, 0, 1]])
STRAIGHT = np.eye(3, 4)
YAML = "intrinsics: [100, 100, 20, 15]\ncamera_from_lidar: {pose}\n"
QUARTER_TURN = [[0, -1, 0, 0], [0, 0, -1, -0.1], [1, 0, 0, 0.2]]  # lidar x ahead, z up


# -- Point clouds --------------------------------------------------------------------------------


def pcd(encoding: str, body: bytes) -> bytes:
    return (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS intensity x y z\nSIZE 1 4 4 4\nTYPE U F F F\n"
        f"COUNT 2 1 1 1\nWIDTH 3\nHEIGHT 1\nPOINTS 3\nDATA {encoding}\n"
    ).encode() + body


def ply(encoding: str, body: bytes) -> bytes:
    return (
        f"ply\nformat {encoding} 1.0\ncomment made here\nelement vertex 3\nproperty float x\n"
        "property float y\nproperty uchar red\nproperty double z\nelement face 1\n"
        "property list uchar int vertex_indices\nend_header\n"
    ).encode() + body


def packed(order: str, kind: str) -> bytes:
    if kind == "pcd":
        layout = np.dtype([("i", "u1", 2), ("x", "<f4"), ("y", "<f4"), ("z", "<f4")])
    else:
        layout = np.dtype([(n, order + t) for n, t in zip("xyrz", ("f4", "f4", "u1", "f8"))])  # noqa: B905
    records = np.zeros(3, layout)
    for axis, column in zip("xyz", POINTS.T, strict=True):
        records[axis] = column
    return records.tobytes()


CLOUDS = {
    "a.bin": np.column_stack([POINTS, [9, 9, 9]]).astype("<f4").tobytes(),
    "text.pcd": pcd("ascii", b"".join(b"7 8 %g %g %g\n" % tuple(p) for p in POINTS)),
    "binary.pcd": pcd("binary", packed("<", "pcd")),
    "text.ply": ply("ascii", b"".join(b"%g %g 255 %g\n" % tuple(p) for p in POINTS) + b"3 0 1 2"),
    "little.ply": ply("binary_little_endian", packed("<", "ply") + b"\x03" + bytes(12)),
    "big.ply": ply("binary_big_endian", packed(">", "ply") + b"\x03" + bytes(12)),
}


@pytest.mark.parametrize("name", CLOUDS)
def test_every_format_gives_the_same_points(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(CLOUDS[name])
    np.testing.assert_array_equal(read_points(tmp_path / name), POINTS)


@pytest.mark.parametrize("name", CLOUDS)
def test_truncated_clouds_are_named(tmp_path: Path, name: str) -> None:
    data = CLOUDS[name]
    (tmp_path / name).write_bytes(data[: data.rindex(b"3 0 1 2")] if name == "text.ply" else data)
    cut = (tmp_path / name).read_bytes()[: -(1 + 12 + 12 if "ply" in name else 7)]
    (tmp_path / name).write_bytes(cut)
    with pytest.raises(InputError, match=f"{name}.*expected"):
        read_points(tmp_path / name)


@pytest.mark.parametrize(
    ("name", "data", "problem"),
    [
        ("a.pcd", pcd("binary_compressed", b""), "DATA is binary_compressed, expected ascii or"),
        ("a.pcd", b"FIELDS x y z\nDATA ascii\n", "bad .pcd header"),
        ("a.pcd", b"\x00" * 40, "header does not end"),
        ("a.ply", b"plum\n", "expected `ply`"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement face 1\n", "expected vertex first"),
        ("a.ply", CLOUDS["text.ply"].replace(b"uchar red", b"list uchar int red"), "not underst"),
        ("a.ply", CLOUDS["text.ply"].replace(b"double z", b"double w"), "expected x, y and z"),
        ("a.bin", bytes(16), "no point in it"),
        ("a.bin", np.full(4, np.nan, "<f4").tobytes(), "no point in it"),
        ("a.xyz", b"1 2 3", "expected a .bin, .pcd or .ply"),
    ],
)
def test_bad_clouds_are_named(tmp_path: Path, name: str, data: bytes, problem: str) -> None:
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=f"{name}.*{problem}"):
        read_points(tmp_path / name)


# -- Lidar ---------------------------------------------------------------------------------------


def test_projection_by_hand() -> None:
    points = np.array(
        [
            [0, 0, 10],  # the principal point
            [0, 0, 4],  # before it
            [1, 0.5, 10],  # 10 px right, 5 px down
            [0.0049, 0, 1],  # 0.49 px right rounds back
            [0, 0, -5],  # behind the camera
            [10, 0, 10],  # outside
        ]
    )
    depth = project(points, LidarCalibration(K, STRAIGHT), (40, 30))
    expected = np.zeros((30, 40), np.float32)
    expected[15, 20], expected[20, 30] = 1, 10
    np.testing.assert_array_equal(depth, expected)
    without = project(np.delete(points, 3, axis=0), LidarCalibration(K, STRAIGHT), (40, 30))
    assert without[15, 20] == 4


def test_both_ways_of_a_pose_agree_and_sizes_scale(tmp_path: Path) -> None:
    (tmp_path / "rows.yaml").write_text(YAML.format(pose=QUARTER_TURN) + "image_size: [40, 30]\n")
    quaternion = "{quaternion_wxyz: [0.5, 0.5, -0.5, 0.5], translation_m: [0, -0.1, 0.2]}"
    (tmp_path / "quaternion.yaml").write_text(YAML.format(pose=quaternion))
    rows, turned = (
        read_lidar_calibration(tmp_path / f"{name}.yaml") for name in ("rows", "quaternion")
    )
    np.testing.assert_allclose(rows.camera_from_lidar, turned.camera_from_lidar, atol=1e-12)
    depth = project(np.array([[9.8, 0, -0.1]]), rows, (40, 30))  # 9.8 m ahead of the lidar
    assert depth[15, 20] == pytest.approx(10)
    # At twice the size pixel 20 is 2 * 20 + 1/2.
    np.testing.assert_allclose(rows.at((80, 60))[:2, 2], [40.5, 30.5])
    with pytest.raises(InputError, match="40x30, the reference image is 80x50"):
        rows.at((80, 50))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("intrinsics: [1, 1, 1, 1]", "camera_from_lidar is missing"),
        (YAML.format(pose=QUARTER_TURN) + "extra: 1", "unknown key 'extra'"),
        (YAML.format(pose=[[1, 0, 0, 0]] * 3), "no rotation"),
        (YAML.format(pose=[[1, 0], [0, 1]]), "expected 3x4 numbers"),
        (YAML.format(pose="{quaternion_wxyz: [1, 0, 0, 1]}"), "quaternion_wxyz and translation_m"),
        (YAML.format(pose="{quaternion_wxyz: [1, 1, 0, 0], translation_m: [0, 0, 0]}"), "unit len"),
        (YAML.format(pose=QUARTER_TURN).replace("[100, ", "[-100, "), "expected above 0"),
        ("[", "not YAML"),
        ("just words", "expected keys and values"),
    ],
)
def test_bad_lidar_calibrations_are_named(tmp_path: Path, text: str, problem: str) -> None:
    (tmp_path / "c.yaml").write_text(text)
    with pytest.raises(InputError, match=f"c.yaml.*{problem}"):
        read_lidar_calibration(tmp_path / "c.yaml")


def test_points_showing_through_are_removed_and_edges_and_roads_are_kept() -> None:
    rng = np.random.default_rng(0)
    row = np.arange(300)[:, None] + np.zeros((1, 400))
    scene = np.where(row > 160, 200 / np.maximum(row - 150, 1), 30)  # a road and a wall
    box = (slice(80, 200), slice(120, 220))
    scene[box] = 5
    sparse = np.where(rng.random(scene.shape) < 0.3, scene, 0).astype(np.float32)
    through = rng.random(scene.shape) < 0.01
    through[: box[0].start] = through[box[0].stop :] = False
    through[:, : box[1].start] = through[:, box[1].stop :] = False
    spoilt = np.where(through, 30, sparse).astype(np.float32)
    cleaned = without_hidden(spoilt)
    assert (cleaned[through] == 0).mean() > 0.9
    kept = (cleaned > 0) & (sparse > 0) & ~through
    assert kept.sum() > 0.995 * ((sparse > 0) & ~through).sum()


def test_kitti_scans_fit_their_images(xcalib_data: Path) -> None:
    folder = xcalib_data / "kitti"
    images = sorted((folder / "image_2").iterdir())
    lidar = MeasuredDepth(lidar_calibration=folder / "calib")
    depth = open_depth(folder / "velodyne", images, measured=lidar)(0, read_image(images[0]))
    assert depth.shape == (370, 1224)
    assert 0.03 < (depth > 0).mean() < 0.06
    # The ground in front of the car: the camera is mounted 1.65 m above it, and pitches a little.
    y, x = np.nonzero(depth[340:] > 0)
    height = (y + 340 - 180.5) * depth[340:][y, x] / 707.05
    assert np.median(height) == pytest.approx(1.65, abs=0.2)


# -- Stereo --------------------------------------------------------------------------------------


def test_disparity_of_a_rendered_pair() -> None:
    camera = synthetic.demo_rig().reference.resized(480, 360)
    pair = Rig(camera, camera, np.eye(3), [-0.4, 0, 0])  # the partner stands to the right
    street = synthetic.Street(pair, num_frames=1, seed=2)
    left, depth = street.render_view(0, "visible", "reference")
    right, _ = street.render_view(0, "visible", "source")
    found = disparity(left.astype(np.uint8), right.astype(np.uint8), span=112)
    known = np.isfinite(found) & (depth > 0)
    error = np.abs(found - camera.fx * 0.4 / np.where(depth > 0, depth, 1))[known]
    assert known.sum() > 0.6 * (depth > 0).sum()
    assert np.median(error) < 0.3
    assert (error > 2).mean() < 0.06


def test_disparity_of_the_motorcycle(xcalib_data: Path, tmp_path: Path) -> None:
    folder = xcalib_data / "motorcycle"
    left = read_image(folder / "motorcycle_left.png")
    (tmp_path / "right").mkdir()
    (tmp_path / "right" / "1.png").symlink_to(folder / "motorcycle_right.png")
    (tmp_path / "s.yaml").write_text("baseline: 0.193001\nfocal: 994.978\ndoffs: 31.086\n")
    stereo = MeasuredDepth(stereo_calibration=tmp_path / "s.yaml")
    depth = open_depth(f"stereo:{tmp_path / 'right'}", [Path("v/1.png")], measured=stereo)(0, left)
    truth = np.load(folder / "motorcycle_disp.npz")["arr_0"]
    known = (depth > 0) & np.isfinite(truth)
    assert known.mean() > 0.75
    exact = 994.978 * 0.193001 / (truth[known] + 31.086)
    assert np.median(np.abs(depth[known] / exact - 1)) < 0.004
    found = 994.978 * 0.193001 / depth[known] - 31.086
    assert (np.abs(found - truth[known]) > 2).mean() < 0.06


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"stereo_baseline": 0.2}, "expected --stereo-baseline and --stereo-focal"),
        ({"stereo_baseline": -0.2, "stereo_focal": 500}, "stereo baseline is -0.2, expected above"),
        ({"stereo_calibration": Path("s.yaml"), "stereo_focal": 5}, "no other stereo options"),
        ({"stereo_calibration": Path("s.yaml")}, "s.yaml: no such file"),
        ({"lidar_calibration": Path("c.yaml")}, "goes with scans"),
    ],
)
def test_stereo_options_must_fit(tmp_path: Path, options: dict[str, object], problem: str) -> None:
    with pytest.raises(InputError, match=problem):
        open_depth(f"stereo:{tmp_path}", [Path("v/1.png")], measured=MeasuredDepth(**options))


def test_stereo_doffs_must_be_finite() -> None:
    with pytest.raises(InputError, match="doffs is nan"):
        StereoGeometry(0.1, 100, float("nan"))


# -- EXR -----------------------------------------------------------------------------------------

needs_exr = pytest.mark.skipif(
    not importlib.util.find_spec("OpenEXR"), reason="the extra `exr` (OpenEXR) is not installed"
)


def write_exr(path: Path, channels: dict[str, np.ndarray]) -> Path:
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(path))
    return path


@needs_exr
@pytest.mark.parametrize("dtype", [np.float32, np.float16])
def test_exr_holds_metres(tmp_path: Path, dtype: type) -> None:
    values = np.array([[1.5, 2, np.nan], [0, -1, 96]], dtype)
    depth = read_depth(write_exr(tmp_path / "a.exr", {"V": values}))
    np.testing.assert_array_equal(depth, [[1.5, 2, 0], [0, 0, 96]])
    more = write_exr(tmp_path / "b.exr", {"Z": values, "A": np.ones_like(values)})
    np.testing.assert_array_equal(read_depth(more), depth)


@needs_exr
def test_bad_exr_is_named(tmp_path: Path) -> None:
    values = np.ones((2, 3), np.float32)
    path = write_exr(tmp_path / "a.exr", {"R": values, "G": values, "B": values})
    with pytest.raises(InputError, match=r"a\.exr: channels are .*expected only one, or .* Z"):
        read_depth(path)
    path.write_bytes(path.read_bytes()[:150])
    with pytest.raises(InputError, match=r"a\.exr.*cannot decode"):
        read_depth(path)


# -- Completion ----------------------------------------------------------------------------------


def test_completion_keeps_what_is_known_and_finds_a_plane() -> None:
    rng = np.random.default_rng(0)
    y, x = np.mgrid[0:120, 0:160]
    plane = (1 / (0.02 + 0.001 * y + 0.0003 * x)).astype(np.float32)
    depth = np.where(rng.random(plane.shape) < 0.05, plane, 0).astype(np.float32)
    dense, confidence = complete(depth, np.full((240, 320, 3), 90, np.uint8))
    known = depth > 0
    np.testing.assert_array_equal(dense[known], plane[known])
    assert np.median(np.abs(dense / plane - 1)[~known]) < 0.01
    assert (confidence[known] == 1).all()
    assert confidence.min() >= 0 and confidence.max() <= 1


def test_completion_follows_image_edges_and_doubts_what_is_far() -> None:
    guide = np.full((96, 128), 60, np.uint8)
    guide[:, 70:] = 180
    depth = np.zeros((96, 128), np.float32)
    depth[::4, 0:56] = 5
    depth[::4, 76:] = 20  # unknown from 56 to 75, the edge off its middle
    dense, confidence = complete(depth, guide)
    assert (dense[20:76, 58:68] < 8).mean() > 0.95
    assert (dense[20:76, 72:75] > 12.5).mean() > 0.95
    blind = np.full_like(guide, 90)
    assert (complete(depth, blind)[0][20:76, 66:68] > 8).mean() > 0.5
    assert confidence[48, 66] < 0.1 < 0.3 < confidence[46, 20]


def test_low_confidence_stays_unknown(tmp_path: Path) -> None:
    depth = np.zeros((100, 200), np.float32)
    depth[:, :20] = 4
    np.save(tmp_path / "1.npy", depth)
    folder = FolderDepth(tmp_path, [Path("v/1.png")])
    reference = np.zeros((200, 400), np.uint8)
    some, full = (CompletedDepth(folder, c)(0, reference) > 0 for c in (0.3, 0.0))
    assert full.all()
    assert some[:, :22].all() and not some[:, 40:].any()
    with pytest.raises(InputError, match=r"completion confidence is 1\.5, expected"):
        CompletedDepth(folder, 1.5)


def test_nothing_known_cannot_be_completed() -> None:
    with pytest.raises(InputError, match="unknown everywhere"):
        complete(np.zeros((30, 40), np.float32), np.zeros((30, 40), np.uint8))
    with pytest.raises(InputError, match="40x30, its guide 40x20"):
        complete(np.ones((30, 40), np.float32), np.zeros((20, 40), np.uint8))


def test_night_depth_is_completed_within_a_percent(xcalib_data: Path) -> None:
    folder = xcalib_data / "lynred_night"
    name = sorted(path.name for path in (folder / "depth").iterdir())[3]
    depth, guide = read_depth(folder / "depth" / name), read_image(folder / "visible" / name)
    hidden = (np.random.default_rng(0).random(depth.shape) < 0.1) & (depth > 0)
    dense, confidence = complete(np.where(hidden, np.float32(0), depth), guide)
    error = np.abs(dense / np.where(hidden, depth, 1) - 1)[hidden]
    assert np.median(error) < 0.01
    sure = confidence[hidden] > 0.5
    assert (error[sure] > 0.1).mean() < 0.2 * (error[~sure] > 0.1).mean()


# -- Conditioning --------------------------------------------------------------------------------


def test_steady_averages_noise_and_starts_anew_where_depth_changes() -> None:
    rng = np.random.default_rng(0)
    truth = np.full((60, 80), 10, np.float32)
    texture = cv2.GaussianBlur(rng.integers(0, 255, (60, 80)).astype(np.uint8), (0, 0), 1.5)
    truths = [truth.copy() for _ in range(9)]
    for moved in truths[8:]:
        moved[20:40, 20:40] = 4  # something has come
    noisy = [(t * np.exp(0.05 * rng.standard_normal(t.shape))).astype(np.float32) for t in truths]
    steady = SteadyDepth(lambda index, reference: noisy[index])
    found = [steady(i, texture) for i in range(9)]
    np.testing.assert_allclose(found[0], noisy[0], rtol=1e-6)
    assert np.abs(found[7] / 10 - 1).mean() < 0.65 * np.abs(noisy[7] / 10 - 1).mean()
    np.testing.assert_allclose(found[8][24:36, 24:36], noisy[8][24:36, 24:36], rtol=1e-5)
    # A frame that does not follow starts anew.
    np.testing.assert_allclose(steady(3, texture), noisy[3], rtol=1e-6)


# -- Commands ------------------------------------------------------------------------------------


def test_register_with_scans_and_completion(rendered: Path, tmp_path: Path) -> None:
    rig = small(synthetic.demo_rig())
    (tmp_path / "scans").mkdir()
    for path in sorted((rendered / "depth").iterdir()):
        depth = read_depth(path)
        y, x = np.nonzero(depth * (np.arange(depth.shape[0]) % 4 == 0)[:, None])
        rays = np.linalg.solve(rig.reference.K, [x, y, np.ones(len(x))])
        points = (rays * depth[y, x]).T
        np.column_stack([points, np.zeros(len(points))]).astype("<f4").tofile(
            tmp_path / "scans" / f"{path.stem}.bin"
        )
    c = rig.reference
    (tmp_path / "c.yaml").write_text(
        f"intrinsics: [{c.fx}, {c.fy}, {c.cx}, {c.cy}]\n"
        "camera_from_lidar: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]]\n"
    )
    common = (rendered / "rig.yaml", rendered / "visible", rendered / "thermal")
    scans = ("--depth", tmp_path / "scans", "--lidar-calibration", tmp_path / "c.yaml")
    valid = {}
    for name, more in (("sparse", ()), ("dense", ("--complete", "--depth-steady"))):
        result = run("register", *common, *scans, *more, "-o", tmp_path / name)
        assert result.exit_code == 0, result.output
        masks = sorted((tmp_path / name / "masks").iterdir())
        valid[name] = np.mean([cv2.imread(str(mask), -1) == 0 for mask in masks])
    assert valid["sparse"] < 0.25 < 0.5 < valid["dense"]


def test_commands_refuse_what_does_not_fit(
    rendered: Path, tmp_path: Path, refused: Callable[..., str]
) -> None:
    common = ("register", rendered / "rig.yaml", rendered / "visible", rendered / "thermal")
    out = ("-o", tmp_path / "out")
    partners = tmp_path / "right"
    for path in (rendered / "visible").iterdir():
        write_image(partners / path.name, np.zeros((90, 160), np.uint8))
    stereo = ("--depth", f"stereo:{partners}", "--stereo-baseline", "0.1", "--stereo-focal", "300")
    assert "expected 320x240 as its reference" in refused(*common, *stereo, *out)
    given = ("--depth", rendered / "depth", "--stereo-focal", "300")
    assert "go with --depth stereo:FOLDER" in refused(*common, *given, *out)
    lidar = ("--depth", rendered / "depth", "--lidar-calibration", tmp_path / "no.yaml")
    assert "expected bin, pcd, ply files" in refused(*common, *lidar, *out).replace(".", "")
    lidar = ("--depth", "plane", "--lidar-calibration", tmp_path / "no.yaml")
    line = refused(*common, *lidar, *out)
    assert "--lidar-calibration: --depth plane is no folder, expected one with scans" in line


@pytest.mark.parametrize(
    ("flag", "named"),
    [
        ("--complete", "--refine-plane fits the plane itself, which --complete would change"),
        ("--depth-steady", "which --depth-steady would change"),
        ("--depth=depth", "--refine-plane goes with --depth plane, not depth"),
    ],
)
def test_refining_the_plane_refuses_what_it_does_not_go_with_at_once(
    tmp_path: Path, refused: Callable[..., str], flag: str, named: str
) -> None:
    """Before anything is opened: the footage is not there."""
    arguments = (
        "nowhere",
        "nowhere",
        "--depth=plane",
        flag,
        "--refine-plane",
        "-o",
        tmp_path / "r",
    )
    assert named in refused("calibrate", *arguments)
