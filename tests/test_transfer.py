"""Labels of one image on the other: what a scene of known depth makes of them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from conftest import run
from xcalib import Pinhole, Registrar, Rig
from xcalib.convert.fields import Fields
from xcalib.labels import Shapes
from xcalib.labels.coco import counts_of, mask_of

CAMERA = Pinhole(120, 80, 500, 500, 59.5, 39.5)
RIG = Rig(CAMERA, CAMERA, None, [-0.2, 0, 0])
"""What is at d m lies 100 / d px further to the left in the source."""


def post_before_wall() -> Any:
    """A wall at 20 m (5 px), and a post at 5 m (20 px) in the columns 60 to 79."""
    depth = np.full((80, 120), 20, np.float32)
    depth[:, 60:80] = 5
    return depth


def test_points_by_hand() -> None:
    depth = post_before_wall()
    points = [[30, 10], [70, 10], [3, 10], [200, 10]]
    found = RIG.transfer(points, depth)
    np.testing.assert_allclose(found[:2], [[25, 10], [50, 10]], atol=1e-4)
    assert np.isnan(found[2:]).all()
    np.testing.assert_allclose(RIG.transfer_back(found[:2], depth), points[:2], atol=1e-3)
    np.testing.assert_allclose(RIG.transfer(points[:3], [20, 5, 10])[:2], found[:2], atol=1e-4)
    np.testing.assert_allclose(RIG.transfer(points[2:3], 20, beyond=True), [[-2, 10]], atol=1e-9)
    with pytest.raises(
        ValueError, match=r"depth has shape \(2\) float64, expected a number, \(4,\)"
    ):
        RIG.transfer(points, [1, 2])
    with pytest.raises(ValueError, match=r"points have shape \(3\) float64, expected \(N, 2\)"):
        RIG.transfer([1, 2, 3], depth)


def test_a_box_goes_with_what_is_in_it() -> None:
    """And not with the wall that its corners are on."""
    shapes = Shapes(RIG, post_before_wall(), "source")
    moved = shapes.box((58, 20, 81, 60))
    assert moved.box is not None and moved.notes == ()
    np.testing.assert_allclose(moved.box, (38, 20, 61, 60), atol=1e-3)
    assert moved.depth == pytest.approx(5)
    back = Shapes(RIG, post_before_wall(), "reference").box(moved.box)
    assert back.box is not None
    np.testing.assert_allclose(back.box, (58, 20, 81, 60), atol=1e-3)


def test_what_cannot_be_told_is_said() -> None:
    depth = post_before_wall()
    shapes = Shapes(RIG, depth, "source")
    assert shapes.box((0, 20, 3, 30)).notes == ("outside",)
    cut = shapes.box((0, 20, 20, 30))
    assert cut.notes == ("clipped",) and cut.box is not None
    np.testing.assert_allclose(cut.box, (-0.5, 20, 15, 30), atol=1e-3)
    assert shapes.box((46, 20, 58, 30)).notes == ("occluded",)  # the post is in front of it there
    slope = np.tile(np.linspace(2.0, 6.0, 120, dtype=np.float32), (80, 1))
    assert "ambiguous" in Shapes(RIG, slope, "source").box((40, 20, 90, 30)).notes
    depth[:, :50] = 0
    assert Shapes(RIG, depth, "source").box((10, 20, 30, 30)).notes == ("no depth",)


def test_a_mask_is_what_the_registrar_makes_of_it() -> None:
    depth = post_before_wall()
    mask = np.zeros((80, 120), np.uint8)
    mask[20:60, 30:100] = 7
    registered, _ = Registrar(RIG, nearest=True, occlusion="hide").register(mask, depth)
    moved = Shapes(RIG, depth, "reference").mask(mask)
    assert np.mean(moved == registered) > 0.995
    there = Shapes(RIG, depth, "source").mask(mask)
    assert set(np.unique(there)) == {0, 7}
    assert (there[30, 45:55] == 7).all(), "the post"
    assert (there[30, 62:74] == 0).all(), "seen by the source alone"


def test_run_lengths() -> None:
    mask = (np.random.default_rng(0).random((7, 9)) > 0.6).astype(np.uint8)
    fields = Fields("a.json", {"size": [7, 9], "counts": counts_of(mask)})
    np.testing.assert_array_equal(mask_of(fields, (9, 7)), mask)
    # As pycocotools packs a square of 2x2 at (1, 1) of 4x4: runs 5 2 2 2 5.
    square = np.zeros((4, 4), np.uint8)
    square[1:3, 1:3] = 1
    packed = Fields("a.json", {"size": [4, 4], "counts": "52203"})
    np.testing.assert_array_equal(mask_of(packed, (4, 4)), square)


# -- The command ---------------------------------------------------------------------------------


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """Two frames of the post, of images whose names differ."""
    random = np.random.default_rng(2)
    for kind, word in (("visible", "VIS"), ("thermal", "IR")):
        (tmp_path / kind).mkdir()
        for i in range(2):
            image = random.integers(0, 256, (80, 120), np.uint8)
            cv2.imwrite(str(tmp_path / kind / f"{word}_{i}.png"), image)
    (tmp_path / "depth").mkdir()
    for i in range(2):
        np.save(tmp_path / "depth" / f"VIS_{i}.npy", post_before_wall())
    RIG.save(tmp_path / "rig.yaml")
    (tmp_path / "yolo").mkdir()
    # The box of the post, (58, 20) to (81, 60), and one that leaves the source.
    box = f"3 {70 / 120:.6f} {40.5 / 80:.6f} {23 / 120:.6f} {40 / 80:.6f}"
    (tmp_path / "yolo" / "VIS_0.txt").write_text(f"{box}\n0 0.01 0.5 0.01 0.1\n")
    coco = {
        "images": [{"id": 9, "file_name": "VIS_1.png", "width": 120, "height": 80}],
        "annotations": [
            {
                "id": 1,
                "image_id": 9,
                "category_id": 4,
                "bbox": [58.5, 20.5, 23, 40],
                "segmentation": [[58.5, 20.5, 81.5, 20.5, 81.5, 60.5, 58.5, 60.5]],
                "keypoints": [70, 30, 2, 55, 30, 2, 3, 30, 2, 0, 0, 0],
                "area": 920,
            }
        ],
        "categories": [{"id": 4, "name": "post"}],
    }
    (tmp_path / "coco.json").write_text(json.dumps(coco))
    (tmp_path / "points.csv").write_text("image,x,y,who\nVIS_0.png,70,30,a\nVIS_0.png,3,30,b\n")
    return tmp_path


def transfer(scene: Path, labels: str, output: str, *more: Any) -> Any:
    folders = (scene / "visible", scene / "thermal", "--depth", scene / "depth")
    given = ("--labels", scene / labels, "-o", scene / output)
    return run("transfer", scene / "rig.yaml", *folders, *given, "--quiet", *more)


def test_yolo(scene: Path) -> None:
    result = transfer(scene, "yolo", "out")
    assert result.exit_code == 0, result.output
    assert "2 labels: 1 outside" in result.output
    (line,) = (scene / "out" / "IR_0.txt").read_text().splitlines()
    found = [float(word) for word in line.split()]
    np.testing.assert_allclose(found, [3, 50 / 120, 40.5 / 80, 23 / 120, 40 / 80], atol=1e-5)
    # And back to where it was.
    assert transfer(scene, "out", "back", "--to", "reference").exit_code == 0
    first = (scene / "yolo" / "VIS_0.txt").read_text().splitlines()[0]
    back = (scene / "back" / "VIS_0.txt").read_text().split()
    np.testing.assert_allclose(list(map(float, back)), list(map(float, first.split())), atol=1e-5)


def test_coco(scene: Path) -> None:
    assert transfer(scene, "coco.json", "out.json").exit_code == 0
    document = json.loads((scene / "out.json").read_text())
    assert document["images"] == [{"id": 9, "file_name": "IR_1.png", "width": 120, "height": 80}]
    assert document["categories"] == [{"id": 4, "name": "post"}]
    (label,) = document["annotations"]
    np.testing.assert_allclose(label["bbox"], [38.5, 20.5, 23, 40], atol=0.011)
    outline = np.reshape(label["segmentation"][0], (-1, 2))
    np.testing.assert_allclose(outline.min(axis=0), [38.5, 20.5], atol=0.011)
    assert label["area"] == pytest.approx(920, abs=1)
    # Seen, hidden behind the post, outside, not labelled.
    assert label["keypoints"] == [50, 30, 2, 50, 30, 1, 0, 0, 0, 0, 0, 0]
    assert label["num_keypoints"] == 2
    assert label["xcalib"] == {"notes": [], "depth_m": 5.0} and label["id"] == 1


def test_points_and_masks(scene: Path) -> None:
    assert transfer(scene, "points.csv", "out.csv").exit_code == 0
    assert (scene / "out.csv").read_text() == (
        "image,x,y,who,transfer\nIR_0.png,50.000,30.000,a,valid\nIR_0.png,,,b,outside\n"
    )
    (scene / "masks").mkdir()
    mask = np.zeros((80, 120), np.uint8)
    mask[20:60, 60:80] = 255
    cv2.imwrite(str(scene / "masks" / "VIS_0.png"), mask)
    assert transfer(scene, "masks", "moved").exit_code == 0
    moved = cv2.imread(str(scene / "moved" / "IR_0.png"), cv2.IMREAD_UNCHANGED)
    ys, xs = np.nonzero(moved)
    assert (xs.min(), xs.max(), ys.min(), ys.max()) == (40, 59, 20, 59)


def edit(name: str, old: str, new: str) -> Callable[[Path], None]:
    def apply(scene: Path) -> None:
        text = (scene / name).read_text()
        assert old in text
        (scene / name).write_text(text.replace(old, new, 1))

    return apply


@pytest.mark.parametrize(
    ("labels", "spoil", "message"),
    [
        ("coco.json", edit("coco.json", '"width": 120', '"width": 121'), "is 121x80 px there"),
        ("coco.json", edit("coco.json", "VIS_1", "VIS_7"), "'VIS_7.png' is none of the frames"),
        ("coco.json", edit("coco.json", '"image_id": 9', '"image_id": 8'), "image_id = 8"),
        ("coco.json", edit("coco.json", "[58.5, 20.5, 23", "[58.5, NaN, 23"), "bbox"),
        ("coco.json", edit("coco.json", "[[58.5, 20.5, 81.5", "[[20.5, 81.5"), "segmentation"),
        ("coco.json", edit("coco.json", '"images"', '"pictures"'), "images is missing"),
        ("yolo", edit("yolo/VIS_0.txt", "3 0.5", "3 7.5"), "VIS_0.txt:1"),
        ("yolo", edit("yolo/VIS_0.txt", "3 0.5", "car 0.5"), "expected class cx cy w h"),
        ("points.csv", edit("points.csv", "70", "seventy"), "points.csv:2"),
        ("points.csv", edit("points.csv", "image,", "file,"), "expected image, x and y"),
        ("rig.yaml", lambda scene: None, "expected COCO's .json"),
        ("none.json", lambda scene: None, "none.json"),
    ],
)
def test_bad_labels(scene: Path, labels: str, spoil: Callable[[Path], None], message: str) -> None:
    spoil(scene)
    before = sorted(scene.rglob("*"))
    result = transfer(scene, labels, "out")
    assert result.exit_code == 2, result.output
    assert message in result.stderr and result.stderr.count("\n") == 1
    assert sorted(scene.rglob("*")) == before
