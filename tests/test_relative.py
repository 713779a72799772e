"""Relative inverse depth: from a network's raw output to a rig that registers with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import xcalib
from conftest import run
from xcalib import CalibrationOptions, Registrar, RelativeDepth, Rig
from xcalib.depth import NetworkDepth, NetworkOptions, read_depth
from xcalib.depth.completion import CompletedDepth
from xcalib.depth.conditioning import SteadyDepth
from xcalib.footage.opening import PickedDepth
from xcalib.frames import list_files, read_image, write_image

NEAREST = 0.5  # [1/m] that 255 stands for

pytestmark = pytest.mark.filterwarnings("ignore:divide by zero")  # 0 is unknown depth


@pytest.fixture
def cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))


@pytest.fixture
def blue(scene: Path, cache: None) -> Path:
    """A scene whose blue channel is inverse depth, and a network that takes blue for it."""
    onnx = pytest.importorskip("onnx")
    for image, depth in zip(
        list_files(scene / "visible"), list_files(scene / "depth"), strict=True
    ):
        inverse = 255 / NEAREST / read_depth(depth)
        picture = read_image(image)
        picture[..., 0] = np.clip(np.round(inverse), 0, 255)
        write_image(image, picture)
    helper = onnx.helper
    graph = helper.make_graph(
        [helper.make_node("Gather", ["image", "blue"], ["inverse"], axis=1)],
        "blue",
        [helper.make_tensor_value_info("image", onnx.TensorProto.FLOAT, [1, 3, "h", "w"])],
        [helper.make_tensor_value_info("inverse", onnx.TensorProto.FLOAT, None)],
        [onnx.numpy_helper.from_array(np.array([2]), "blue")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    onnx.save(model, scene / "blue.onnx")
    (scene / "blue.yaml").write_text(
        "kind: relative\nresize: stretch\nsize: [240, 320]\nmultiple: 1\n"
    )
    return scene


def mapping_error(rig: Rig, scene: Path) -> float:
    """Median distance between where the rig maps and where the truth does [px]."""
    truth = Rig.load(scene / "rig.yaml")
    relative = rig.relative_depth
    assert relative is not None
    errors = []
    for path in list_files(scene / "depth"):
        depth = read_depth(path)
        r = np.round(255 / NEAREST / depth) / 255
        scaled = (1 / np.maximum(relative.scale * r + relative.shift, 1e-4)).astype(np.float32)
        maps: list[NDArray[np.float32]] = [
            Registrar(one, occlusion="ignore").map(of)
            for one, of in ((rig, scaled), (truth, depth))
        ]
        errors.append(np.linalg.norm(maps[0] - maps[1], axis=-1))
    return float(np.nanmedian(np.stack(errors)))


def test_calibrate_and_register_with_relative_depth(blue: Path) -> None:
    arguments = (blue / "visible", blue / "thermal", "--depth", blue / "blue.onnx")
    out = blue / "out"
    result = run("calibrate", *arguments, "-o", out / "rig.yaml")
    assert result.exit_code in (0, 3), result.output
    rig = Rig.load(out / "rig.yaml")
    assert mapping_error(rig, blue) < 1.0
    verdict = result.exit_code
    result = run("register", out / "rig.yaml", *arguments, "-o", out)
    assert result.exit_code == verdict, result.output  # the rig's own
    assert "guess" not in result.stderr
    # What was registered is what the rig's own scale and shift give.
    reference = read_image(list_files(blue / "visible")[0])
    network = NetworkDepth(blue / "blue.onnx", NetworkOptions())
    network.relative_depth = rig.relative_depth
    registrar = Registrar(rig)
    source = read_image(list_files(blue / "thermal")[0])
    expected, _ = registrar.register(source, network(0, reference))
    np.testing.assert_array_equal(read_image(sorted(out.glob("*.png"))[0]), expected)


def test_images_that_none_can_read_are_named(blue: Path) -> None:
    for image in list_files(blue / "visible"):
        image.write_bytes(b"no image")
    arguments = (blue / "visible", blue / "thermal", "--depth", blue / "blue.onnx")
    result = run("calibrate", *arguments, "--choose", "spread", "-o", blue / "out.yaml")
    assert result.exit_code == 2
    assert str(blue / "visible") in result.stderr


def test_depth_and_rig_that_do_not_go_together_are_told(blue: Path) -> None:
    images = blue / "visible", blue / "thermal", "--depth"
    out = blue / "out"
    result = run("register", blue / "rig.yaml", *images, blue / "blue.onnx", "-o", out)
    assert "depth is relative, the rig metric" in result.stderr
    rig = Rig.load(blue / "rig.yaml")
    rig.relative_depth = RelativeDepth(0.5, 0.01)
    rig.save(blue / "relative.yaml")
    result = run("register", blue / "relative.yaml", *images, blue / "depth", "-o", out)
    assert "calibrated with relative depth" in result.stderr


def test_arrays_of_relative_depth(rendered: Path) -> None:
    """The API: any scale and shift to start from leads to the same registration."""
    truth = Rig.load(rendered / "rig.yaml")
    images = [
        [read_image(path) for path in list_files(rendered / kind)[:3]]
        for kind in ("visible", "thermal")
    ]
    depths = [read_depth(path) for path in list_files(rendered / "depth")[:3]]
    start = RelativeDepth(3.0, 0.02)
    given = [(1 / (3 * (1 / depth) + 0.02)).astype(np.float32) for depth in depths]
    options = CalibrationOptions(relative_depth=start, reference_camera=truth.reference)
    rig = xcalib.calibrate(*images, given, options=options).rig
    relative = rig.relative_depth
    assert relative is not None
    assert relative.scale == 3.0
    errors = []
    for depth in depths:
        scaled = 1 / (relative.scale / depth + relative.shift)
        maps = [Registrar(rig, occlusion="ignore").map(scaled.astype(np.float32))]
        maps.append(Registrar(truth, occlusion="ignore").map(depth))
        errors.append(np.linalg.norm(maps[0] - maps[1], axis=-1))
    assert np.nanmedian(np.stack(errors)) < 0.5
    assert Rig(truth.reference, truth.source).relative_depth is None


def test_pooled_normalization_and_bad_values(blue: Path) -> None:
    network = NetworkDepth(blue / "blue.onnx")
    images = [read_image(path) for path in list_files(blue / "visible")]
    assert network.relative is network and not network.is_parallel
    pooled = network.pooled(images)
    raw = np.concatenate([network.raw(i, image).ravel() for i, image in enumerate(images)])
    far, near = np.percentile(raw, (2, 98))
    assert 1 / (pooled.scale * far + pooled.shift) == pytest.approx(80, rel=1e-4)
    assert 1 / (pooled.scale * near + pooled.shift) == pytest.approx(2, rel=1e-4)
    assert NetworkDepth(blue / "blue.onnx", NetworkOptions(scale=1.0)).relative is None
    assert PickedDepth(CompletedDepth(SteadyDepth(network)), [0]).relative is network
    with pytest.raises(ValueError, match="scale = 0, expected a finite number > 0"):
        RelativeDepth(0.0, 1.0)
    with pytest.raises(ValueError, match="shift = nan"):
        RelativeDepth(1.0, float("nan"))
