"""Rigs in other tools' files: what the peers' readers and OpenCV's projection make of them."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import yaml
from click import Command, Context, Option

from conftest import run
from xcalib import Lens, Pinhole, Registrar, Rig
from xcalib.cli.calibrate import intrinsics, known_camera
from xcalib.convert import FORMATS, read_camera, read_rig, write_rig
from xcalib.convert.format import NAMES
from xcalib.frames import InputError
from xcalib.reprojection import pixels_of

BROWN4 = Lens("brown", [-0.31, 0.12, 0.002, -0.003])
BROWN5 = Lens("brown", [-0.31, 0.12, 0.002, -0.003, 0.05])
BROWN8 = Lens("brown", [-0.31, 0.12, 0.002, -0.003, 0.05, 0.01, -0.02, 0.003])
FISHEYE = Lens("fisheye", [0.03, -0.01, 0.002, -0.0005])
NONE = Lens()

WRITTEN = [name for name, kind in FORMATS.items() if kind.write is not None]
HOLDS = [
    (name, lens)
    for name in WRITTEN
    for lens in (NONE, BROWN4, BROWN5, BROWN8, FISHEYE)
    if len(lens.coefficients) <= (FORMATS[name].lenses.get(lens.model, 0))
]

POINTS = np.random.default_rng(4).uniform([-1.2, -0.9, 2], [1.2, 0.9, 9], (1000, 3))
"""In the axes of the reference [m]."""


def rig_with(lens: Lens, **changes: float) -> Rig:
    reference = Pinhole(1280, 960, 1101.5, 1098.25, 650.125, 470.75, lens=lens)
    source = Pinhole(640, 512, 701.5, 699.0, 310.25, 260.5, lens=lens)
    for name, value in changes.items():
        setattr(source, name, value)
    R = cv2.Rodrigues(np.array([0.02, -0.11, 0.3]))[0]
    return Rig(reference, source, R, [-0.124, 0.013, 0.042])


def projected(camera: Pinhole, points: Any) -> Any:
    return pixels_of(camera, points[:, :2] / points[:, 2:])


def in_source(rig: Rig) -> Any:
    return POINTS @ np.asarray(rig.R).T + np.asarray(rig.t)


def by_opencv(K: Any, lens: Lens, points: Any) -> Any:
    zero, D = np.zeros(3), np.array(lens.coefficients or [0.0] * 5)
    project = cv2.fisheye.projectPoints if lens.model == "fisheye" else cv2.projectPoints
    arguments = (points.reshape(-1, 1, 3), zero, zero, np.asarray(K, np.float64), D)
    return project(*arguments)[0].reshape(-1, 2)


def far_apart(a: Any, b: Any) -> float:
    assert np.isfinite(a).all() and a.shape == b.shape == (1000, 2)
    return float(np.abs(a - b).max())


@pytest.mark.parametrize(("name", "lens"), HOLDS, ids=lambda value: str(value)[:24])
def test_points_fall_where_they_did(tmp_path: Path, name: str, lens: Lens) -> None:
    rig = rig_with(lens)
    assert write_rig(rig, tmp_path / ("rig" + SUFFIX.get(name, "")), name) == []
    back = read_rig(tmp_path / ("rig" + SUFFIX.get(name, "")))
    assert (back.source.width, back.source.height) == (640, 512)
    assert (
        far_apart(projected(back.reference, POINTS), by_opencv(rig.reference.K, lens, POINTS))
        < 1e-8
    )
    assert (
        far_apart(
            projected(back.source, in_source(back)), by_opencv(rig.source.K, lens, in_source(rig))
        )
        < 1e-8
    )


SUFFIX = {"opencv": ".yml", "kalibr": ".yaml", "nerfstudio": ".json", "foxglove": ".json"}


# -- The peers' own readers ----------------------------------------------------------------------


@pytest.mark.parametrize("lens", [NONE, BROWN5, BROWN8, FISHEYE])
def test_opencv_reads_its_file(tmp_path: Path, lens: Lens) -> None:
    rig = rig_with(lens)
    write_rig(rig, tmp_path / "stereo.yml", "opencv")
    storage = cv2.FileStorage(str(tmp_path / "stereo.yml"), cv2.FILE_STORAGE_READ)
    M, D, R, T = (storage.getNode(name).mat() for name in ("M2", "D2", "R", "T"))
    project = cv2.fisheye.projectPoints if lens.model == "fisheye" else cv2.projectPoints
    shown = project(POINTS.reshape(-1, 1, 3), cv2.Rodrigues(R)[0], T, M, D)[0].reshape(-1, 2)
    assert far_apart(shown, projected(rig.source, in_source(rig))) < 1e-8


@pytest.mark.parametrize("lens", [NONE, BROWN4, BROWN8, FISHEYE])
def test_pycolmap_reads_the_rig(tmp_path: Path, lens: Lens) -> None:
    pycolmap = pytest.importorskip("pycolmap", reason="no pycolmap: `pip install pycolmap`")
    rig = rig_with(lens)
    write_rig(rig, tmp_path, "colmap")
    for name in ("images.txt", "points3D.txt", "frames.txt"):
        (tmp_path / name).write_text("")
    found = pycolmap.Reconstruction()
    found.read_text(str(tmp_path))
    (theirs,) = found.rigs.values()
    T = theirs.sensor_from_rig(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, 2))
    moved = POINTS @ T.rotation.matrix().T + T.translation
    for camera, points, ours in (
        (found.cameras[1], POINTS, rig.reference),
        (found.cameras[2], moved, rig.source),
    ):
        shown = np.array([camera.img_from_cam(point) for point in points])
        truth = POINTS if ours is rig.reference else in_source(rig)
        # COLMAP's first pixel has its centre at (0.5, 0.5).
        assert far_apart(shown - 0.5, projected(ours, truth)) < 1e-8
    (config,) = pycolmap.read_rig_config(str(tmp_path / "rig_config.json"))
    assert [c.image_prefix for c in config.cameras] == ["visible/", "thermal/"]
    assert [c.ref_sensor for c in config.cameras] == [True, False]
    T = config.cameras[1].cam_from_rig
    assert np.allclose(T.rotation.matrix(), rig.R, atol=1e-12)
    assert np.allclose(T.translation, rig.t, atol=1e-12)


MRCAL = """
import json, mrcal, numpy, sys
points = numpy.array(json.load(sys.stdin))
shown = []
for name in sys.argv[1:]:
    model = mrcal.cameramodel(name)
    moved = mrcal.transform_point_Rt(model.extrinsics_Rt_fromref(), points)
    shown.append(mrcal.project(moved, *model.intrinsics()).tolist())
json.dump(shown, sys.stdout)
"""


@pytest.mark.parametrize("lens", [NONE, BROWN8])
def test_mrcal_reads_its_files(tmp_path: Path, lens: Lens) -> None:
    rig = rig_with(lens)
    write_rig(rig, tmp_path, "mrcal")
    names = [str(tmp_path / f"{name}.cameramodel") for name in NAMES]
    result = subprocess.run(  # Debian's package is for Debian's Python
        ["/usr/bin/python3", "-c", MRCAL, *names],
        input=json.dumps(POINTS.tolist()),
        capture_output=True,
        text=True,
        check=False,
    )
    if "No module named 'mrcal'" in result.stderr:
        pytest.skip("no mrcal: `apt-get install python3-mrcal`")
    assert result.returncode == 0, result.stderr
    first, second = map(np.array, json.loads(result.stdout))
    assert far_apart(first, projected(rig.reference, POINTS)) < 1e-6
    assert far_apart(second, projected(rig.source, in_source(rig))) < 1e-6


# -- The formats without a reader here, by the letter of their definitions ------------------------


def quaternion_matrix(x: float, y: float, z: float, w: float) -> Any:
    """Of the textbook: rotate the axes by q v q*."""
    q = np.array([x, y, z])
    return np.array([v + 2 * np.cross(q, np.cross(q, v) + w * v) for v in np.eye(3)]).T


def test_ros_by_the_letter(tmp_path: Path) -> None:
    rig = rig_with(BROWN5)
    write_rig(rig, tmp_path, "ros")
    info = yaml.safe_load((tmp_path / "thermal.yaml").read_text())
    assert info["distortion_model"] == "plumb_bob" and info["camera_name"] == "thermal"
    assert (info["image_width"], info["image_height"]) == (640, 512)
    K = np.reshape(info["camera_matrix"]["data"], (3, 3))
    assert info["distortion_coefficients"]["data"] == BROWN5.coefficients
    (tf,) = yaml.safe_load((tmp_path / "tf_static.yaml").read_text())["transforms"]
    assert (tf["header"]["frame_id"], tf["child_frame_id"]) == (
        "visible_optical",
        "thermal_optical",
    )
    # The pose of the child in its parent takes points of the child to the parent.
    R = quaternion_matrix(**tf["transform"]["rotation"])
    t = np.array([tf["transform"]["translation"][axis] for axis in "xyz"])
    moved = (POINTS - t) @ R
    shown = cv2.projectPoints(
        moved.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), K, np.array(BROWN5.coefficients)
    )
    assert far_apart(shown[0].reshape(-1, 2), projected(rig.source, in_source(rig))) < 1e-8


def test_ros_reads_what_a_robot_prints(tmp_path: Path) -> None:
    """With several documents, frames the other way about, and the old tool's word for a fisheye."""
    rig = rig_with(FISHEYE)
    write_rig(rig, tmp_path, "ros")
    text = (tmp_path / "thermal.yaml").read_text()
    (tmp_path / "thermal.yaml").write_text(text.replace("equidistant", "fisheye"))
    document = yaml.safe_load((tmp_path / "tf_static.yaml").read_text())
    (tf,) = document["transforms"]
    tf["header"]["frame_id"], tf["child_frame_id"] = "thermal_optical", "visible_optical"
    q = rig.quaternion_wxyz
    tf["transform"]["rotation"] = dict(zip("wxyz", map(float, q), strict=True))
    tf["transform"]["translation"] = dict(zip("xyz", map(float, rig.t), strict=True))
    (tmp_path / "tf_static.yaml").write_text(yaml.safe_dump(document) + "---\n")
    back = read_rig(tmp_path)
    assert np.allclose(back.R, rig.R, atol=1e-12) and np.allclose(back.t, rig.t, atol=1e-12)
    assert back.source.lens == FISHEYE


def test_kalibr_by_the_letter(tmp_path: Path) -> None:
    rig = rig_with(BROWN4)
    write_rig(rig, tmp_path / "camchain.yaml", "kalibr")
    chain = yaml.safe_load((tmp_path / "camchain.yaml").read_text())
    for name in ("cam0", "cam1"):
        assert all(type(value) is float for value in chain[name]["intrinsics"])
        assert chain[name]["distortion_model"] == "radtan"
        assert all(type(side) is int for side in chain[name]["resolution"])
    T = np.array(chain["cam1"]["T_cn_cnm1"])
    fu, fv, pu, pv = chain["cam1"]["intrinsics"]
    moved = POINTS @ T[:3, :3].T + T[:3, 3]
    shown = by_opencv([[fu, 0, pu], [0, fv, pv], [0, 0, 1]], BROWN4, moved)
    assert far_apart(shown, projected(rig.source, in_source(rig))) < 1e-8


def test_nerfstudio_by_the_letter(tmp_path: Path) -> None:
    rig = rig_with(BROWN5)
    write_rig(rig, tmp_path / "transforms.json", "nerfstudio")
    document = json.loads((tmp_path / "transforms.json").read_text())
    frame = document["frames"][1]
    world_from_gl = np.array(frame["transform_matrix"])
    reference_gl = np.array(document["frames"][0]["transform_matrix"])
    in_world = (POINTS * [1, -1, -1]) @ reference_gl[:3, :3].T + reference_gl[:3, 3]
    in_gl = (in_world - world_from_gl[:3, 3]) @ world_from_gl[:3, :3]
    moved = in_gl * [1, -1, -1]  # y up, z back
    K = [[frame["fl_x"], 0, frame["cx"]], [0, frame["fl_y"], frame["cy"]], [0, 0, 1]]
    lens = Lens("brown", [frame[name] for name in ("k1", "k2", "p1", "p2", "k3")])
    assert far_apart(by_opencv(K, lens, moved) - 0.5, projected(rig.source, in_source(rig))) < 1e-8


def test_foxglove_by_the_letter(tmp_path: Path) -> None:
    rig = rig_with(FISHEYE)
    write_rig(rig, tmp_path / "rig.json", "foxglove")
    _, thermal, tf = (m["message"] for m in json.loads((tmp_path / "rig.json").read_text()))
    assert thermal["distortion_model"] == "kannala_brandt" and thermal["D"] == FISHEYE.coefficients
    assert (tf["parent_frame_id"], tf["child_frame_id"]) == ("visible_optical", "thermal_optical")
    moved = (POINTS - [tf["translation"][axis] for axis in "xyz"]) @ quaternion_matrix(
        **tf["rotation"]
    )
    shown = by_opencv(np.reshape(thermal["K"], (3, 3)), FISHEYE, moved)
    assert far_apart(shown, projected(rig.source, in_source(rig))) < 1e-8


AUTHORS = """
cameras:
  IR:
    intrinsics: [[786.5, 0, 320.5, 0], [0, 784, 240, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    extrinsics: [[1, 0, 0, 0.078], [0, 1, 0, 0.004], [0, 0, 1, -0.02], [0, 0, 0, 1]]
    resolution: [480, 640]
    pixelSize: [1.25e-05, 1.25e-05]
    modality: Any
  RGB:
    intrinsics: [[1604.5, 0, 638, 0], [0, 1591, 480, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    extrinsics: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    resolution: [960, 1280]
    pixelSize: [6.25e-06, 6.25e-06]
    modality: Visible
"""


def test_the_authors_rig(tmp_path: Path) -> None:
    """A source on the right has t_x below 0; half a pixel lies between the two origins."""
    (tmp_path / "XCalib.yaml").write_text(AUTHORS)
    rig = read_rig(tmp_path / "XCalib.yaml")
    assert rig.t.tolist() == [-0.078, -0.004, 0.02]
    assert (rig.reference.width, rig.reference.height) == (1280, 960)
    assert (rig.source.cx, rig.source.cy) == (320, 239.5)


# -- What a format cannot hold -------------------------------------------------------------------


def test_what_cannot_be_held_is_refused_or_told(tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"Kalibr.* cannot hold k3 of the reference .* by [\d.]+ px"
    ):
        write_rig(rig_with(BROWN5), tmp_path / "a.yaml", "kalibr")
    with pytest.raises(InputError, match=r"OpenCV.* cannot hold the skew of the source"):
        write_rig(rig_with(NONE, skew=3.0), tmp_path / "a.yaml", "opencv")
    with pytest.raises(InputError, match=r"mrcal's \.cameramodel has no fisheye lens"):
        write_rig(rig_with(FISHEYE), tmp_path / "a", "mrcal")
    mirrored = rig_with(NONE)
    mirrored.source_mirrored = True
    with pytest.raises(InputError, match="mirrored"):
        write_rig(mirrored, tmp_path / "a", "ros")
    assert list(tmp_path.iterdir()) == []
    # 0.1 px of skew moves a corner of 512 rows by 0.1 * 260 / 699 = 0.037 px.
    (line,) = write_rig(rig_with(NONE, skew=0.1), tmp_path / "a.yaml", "opencv")
    assert line.startswith("the skew of the source camera is left out, which moves a corner")
    assert line.endswith("by 0.037 px")
    assert write_rig(rig_with(NONE, skew=3.0), tmp_path / "a.yaml", "opencv", tolerance=2)


# -- The command ---------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rig in every format. Read only: `files` is a copy."""
    folder = tmp_path_factory.mktemp("written")
    rig_with(BROWN4).save(folder / "rig.yaml")
    for name in WRITTEN:
        write_rig(rig_with(BROWN4), folder / f"rig_{name}{SUFFIX.get(name, '')}", name)
    return folder


@pytest.fixture
def files(written: Path, tmp_path: Path) -> Path:
    """A copy that a test may spoil."""
    return Path(shutil.copytree(written, tmp_path, dirs_exist_ok=True))


def test_there_and_back(files: Path) -> None:
    for name in WRITTEN:
        path = files / ("rig_" + name + SUFFIX.get(name, ""))
        result = run("convert", path, "-o", files / "back.yaml")
        assert result.exit_code == 0, result.output
        back = Rig.load(files / "back.yaml")
        assert (
            far_apart(
                projected(back.source, in_source(back)),
                projected(rig_with(BROWN4).source, in_source(rig_with(BROWN4))),
            )
            < 1e-8
        )


def edit(name: str, old: str, new: str) -> Callable[[Path], None]:
    def apply(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new, 1))

    return apply


BAD = [
    ("rig_opencv.yml", edit("rig_opencv.yml", "M2:", "N2:"), "M2 is missing"),
    ("rig_opencv.yml", edit("rig_opencv.yml", "image_width1", "w"), "--reference-size gives it"),
    ("rig_opencv.yml", edit("rig_opencv.yml", "rows: 3", "rows: ["), "not a file of OpenCV"),
    ("rig_ros", edit("rig_ros/thermal.yaml", "plumb_bob", "wild"), "distortion_model = 'wild'"),
    ("rig_ros", edit("rig_ros/thermal.yaml", "rows: 3", "rows: 3, rows: ["), "not YAML"),
    ("rig_ros/visible.yaml", lambda folder: None, "1 files, expected the reference's camera_info"),
    ("rig_kalibr.yaml", edit("rig_kalibr.yaml", "radtan", "fov"), "distortion_model = 'fov'"),
    (
        "rig_kalibr.yaml",
        edit("rig_kalibr.yaml", "[1280, 960]", "[1280]"),
        "resolution has 1 numbers",
    ),
    (
        "rig_kalibr.yaml",
        edit("rig_kalibr.yaml", "[1280, 960]", "[1000000000, 960]"),
        "width = 1000000000.0",
    ),
    ("rig_kalibr.yaml", edit("rig_kalibr.yaml", "1101.5", ".nan"), "a list of finite numbers"),
    ("rig_kalibr.yaml", edit("rig_kalibr.yaml", "1101.5", "-5"), "cam0"),
    ("rig_kalibr.yaml", edit("rig_kalibr.yaml", "cam1:", "cam7:"), "cam1 is missing"),
    ("rig_mrcal", edit("rig_mrcal/thermal.cameramodel", "OPENCV4", "CAHVOR"), "lensmodel"),
    (
        "rig_mrcal",
        edit("rig_mrcal/thermal.cameramodel", "{", "__import__('os').abort() or {"),
        "Python literal",
    ),
    ("rig_colmap", edit("rig_colmap/rigs.txt", "1 2 CAMERA", "1 3 CAMERA"), "two sensors"),
    (
        "rig_colmap",
        edit("rig_colmap/cameras.txt", "2 OPENCV", "2 OPENCV_X"),
        "the model is OPENCV_X",
    ),
    ("rig_nerfstudio.json", edit("rig_nerfstudio.json", '"fl_x"', '"f"'), "rig_nerfstudio.json"),
    ("rig_nerfstudio.json", edit("rig_nerfstudio.json", "{", "["), "not JSON"),
    (
        "rig_foxglove.json",
        edit("rig_foxglove.json", '"thermal_optical"', '"x"'),
        "transform is from",
    ),
    ("rig.yaml", edit("rig.yaml", "xcalib-rig", "a-rig"), "not recognised"),
]


@pytest.mark.parametrize(("name", "spoil", "message"), BAD, ids=[row[2] for row in BAD])
def test_bad_files(
    refused: Callable[..., str], files: Path, name: str, spoil: Callable[[Path], None], message: str
) -> None:
    spoil(files)
    assert message in refused("convert", files / name, "-o", files / "new.yaml")


def test_bad_usage(refused: Callable[..., str], files: Path) -> None:
    rig = files / "rig.yaml"
    assert "expected --depth" in refused("convert", rig, "--to", "flo", "-o", files / "a.flo")
    assert "goes with a map" in refused("convert", rig, "--depth", 3, "-o", files / "a.yaml")
    assert "is read" in refused("convert", rig, "--to", "kalibr", "-o", rig)
    assert "no size WxH" in refused("convert", rig, "--source-size", "9", "-o", files / "a.yaml")
    assert "no such file" in refused("convert", files / "none.yaml", "-o", files / "a.yaml")
    wrong = refused("convert", rig, "--to", "flo", "--depth", 3, "-o", files / "a.png")
    assert "ends in .flo" in wrong
    assert "-1 m" in refused("convert", rig, "--to", "flo", "--depth=-1", "-o", files / "a.flo")


def test_configuration_of_colmap_needs_sizes(refused: Callable[..., str], files: Path) -> None:
    config = files / "rig_colmap" / "rig_config.json"
    assert "--reference-size" in refused("convert", config, "-o", files / "a.yaml")
    sizes = ("--reference-size", "1280x960", "--source-size", "640x512")
    assert run("convert", config, *sizes, "-o", files / "a.yaml").exit_code == 0
    assert np.allclose(Rig.load(files / "a.yaml").t, rig_with(BROWN4).t, atol=1e-12)


# -- Maps ----------------------------------------------------------------------------------------


def test_maps(tmp_path: Path) -> None:
    rig = rig_with(NONE).resized(64, 48, 32, 26)
    rig.save(tmp_path / "rig.yaml")
    depth = np.full((48, 64), 4, np.float32)
    depth[:, 30:] = 0
    np.save(tmp_path / "depth.npy", depth)
    truth = Registrar(rig).map(depth)
    known = np.isfinite(truth).all(axis=2)
    assert 100 < known.sum() < 1700
    for kind, name in (("remap", "m.npy"), ("flo", "m.flo"), ("kitti-flow", "m.png")):
        result = run(
            "convert",
            tmp_path / "rig.yaml",
            "--to",
            kind,
            "--depth",
            tmp_path / "depth.npy",
            "-o",
            tmp_path / name,
        )
        assert result.exit_code == 0, result.output
    grid = np.dstack(np.meshgrid(np.arange(64), np.arange(48)))
    np.testing.assert_array_equal(np.load(tmp_path / "m.npy"), truth)
    flow = cv2.readOpticalFlow(str(tmp_path / "m.flo"))
    np.testing.assert_allclose((flow + grid)[known], truth[known], atol=1e-4)
    assert (flow[~known] > 1e9).all()
    code = cv2.imread(str(tmp_path / "m.png"), cv2.IMREAD_UNCHANGED)
    valid, v, u = np.moveaxis(code.astype(np.float64), -1, 0)
    np.testing.assert_array_equal(valid.astype(bool), known)
    kitti = np.dstack([(u - 2**15) / 64, (v - 2**15) / 64]) + grid
    np.testing.assert_allclose(kitti[known], truth[known], atol=1 / 128 + 1e-4)


def test_one_camera_of_a_file(files: Path) -> None:
    assert read_camera(files / "rig_ros" / "thermal.yaml", "source").fx == 701.5
    assert read_camera(files / "rig_kalibr.yaml", "reference").fx == 1101.5


def test_an_initial_rig_of_another_tool(files: Path) -> None:
    """Every command that takes a rig takes these."""
    ours, theirs = (run("inspect", files / name) for name in ("rig.yaml", "rig_kalibr.yaml"))
    assert theirs.exit_code == 0 and theirs.stdout == ours.stdout


def test_a_known_camera_of_a_file(files: Path) -> None:
    """Kept as it is, its lens too, and rescaled to the images."""
    option = Option(["--source-intrinsics"])
    given = intrinsics(Context(Command("calibrate")), option, str(files / "rig_ros/thermal.yaml"))
    assert isinstance(given, Pinhole) and (given.fx, given.lens) == (701.5, BROWN4)
    half = known_camera(given, np.zeros((256, 320), np.uint8), "thermal", "auto")
    assert (half.width, half.fx, half.lens) == (320, 350.75, BROWN4)
    with pytest.raises(InputError, match="640x512 px, the images are 320x240; expected the same a"):
        known_camera(given, np.zeros((240, 320), np.uint8), "thermal", "auto")
