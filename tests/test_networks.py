"""Depth networks: small graphs whose output is a known function of their input."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import onnx
import pytest
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from conftest import run
from xcalib import Rig, metrics
from xcalib.cache import ResultCache
from xcalib.depth import NetworkDepth, NetworkOptions, open_depth
from xcalib.depth.network import normalization, to_aspect
from xcalib.depth.recipes import RECIPES, Recipe, find_recipe
from xcalib.frames import InputError
from xcalib.onnx import ImageInput, Network, available_providers

FLOAT, HALF, BYTE = TensorProto.FLOAT, TensorProto.FLOAT16, TensorProto.UINT8
RANDOM = np.random.default_rng(3)
REFERENCE = RANDOM.integers(0, 256, (48, 64, 3), np.uint8)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XCALIB_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[tuple[int, ...]]]:
    """Shapes of what networks were run on."""
    shapes: list[tuple[int, ...]] = []
    original = Network.run

    def counted(self: Network, feeds: Any, outputs: Any) -> Any:
        shapes.extend(value.shape for value in feeds.values())
        return original(self, feeds, outputs)

    monkeypatch.setattr(Network, "run", counted)
    return shapes


def save_graph(
    path: Path,
    nodes: Sequence[onnx.NodeProto],
    shape: Sequence[int | str] = ("b", 3, "h", "w"),
    type_: int = FLOAT,
    outputs: Sequence[str] = ("depth",),
    constants: dict[str, NDArray[Any]] | None = None,
    inputs: int = 1,
    **save: Any,
) -> Path:
    names = ["image", *(f"image{i}" for i in range(1, inputs))]
    graph = helper.make_graph(
        list(nodes),
        "toy",
        [helper.make_tensor_value_info(name, type_, shape) for name in names],
        [helper.make_tensor_value_info(name, FLOAT, None) for name in outputs],
        [numpy_helper.from_array(value, name) for name, value in (constants or {}).items()],
    )
    domains = {node.domain for node in nodes} | {""}
    opsets = [helper.make_opsetid(domain, 17 if not domain else 1) for domain in domains]
    model = helper.make_model(graph, opset_imports=opsets)
    model.ir_version = 9
    onnx.save(model, path, **save)
    return path


def channel(path: Path, which: int = 0, axis: int = 1, cast: bool = False, **graph: Any) -> Path:
    """A graph whose output is one channel of its input."""
    nodes = [helper.make_node("Gather", ["image", "which"], ["part"], axis=axis)]
    nodes += [helper.make_node("Cast", ["part"], ["depth"], to=FLOAT)]
    return save_graph(path, nodes, constants={"which": np.array(which)}, **graph)


def depth_of(model: Path, recipe: Recipe, monkeypatch: pytest.MonkeyPatch, **options: Any) -> Any:
    """The provider of a model with a recipe that no file has."""
    monkeypatch.setattr("xcalib.depth.network.find_recipe", lambda *_: ("toy", recipe))
    return NetworkDepth(model, NetworkOptions(**options))


PLAIN = Recipe("metric", resize="stretch", size=(24, 32), multiple=1, interpolation="linear")


# -- What graphs say of themselves -----------------------------------------------------------------


def unit_rgb(size: tuple[int, int], how: int = cv2.INTER_LINEAR) -> NDArray[np.float32]:
    rgb = np.float32(REFERENCE[..., ::-1]) / np.float32(255)
    return np.asarray(cv2.resize(np.ascontiguousarray(rgb), size, interpolation=how), np.float32)


@pytest.mark.parametrize(
    ("axis", "shape", "type_", "size", "tolerance"),
    [
        (1, ("b", 3, "h", "w"), FLOAT, (32, 24), 0),
        (1, (1, 3, "h", "w"), FLOAT, (32, 24), 0),
        (1, (1, 3, 518, 518), FLOAT, (518, 518), 0),
        (3, ("b", "h", "w", 3), FLOAT, (32, 24), 0),
        (3, (1, 40, 30, 3), FLOAT, (30, 40), 0),
        (1, (1, 3, 24, 32), HALF, (32, 24), 1e-3),
        (2, (1, "n", 3, 28, 42), FLOAT, (42, 28), 0),
    ],
    ids=["dynamic", "one", "518", "nhwc", "fixed-nhwc", "half", "views"],
)
def test_signatures(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    axis: int,
    shape: tuple[int | str, ...],
    type_: int,
    size: tuple[int, int],
    tolerance: float,
) -> None:
    mean, std = (0.1, 0.2, 0.3), (0.5, 0.25, 2.0)
    recipe = dataclasses.replace(PLAIN, mean=mean, std=std)
    for which in range(3):
        model = channel(tmp_path / f"{which}.onnx", which, axis, shape=shape, type_=type_)
        raw = depth_of(model, recipe, monkeypatch).raw(0, REFERENCE)
        expected = (unit_rgb(size)[..., which] - np.float32(mean[which])) / np.float32(std[which])
        assert raw.dtype == np.float32
        np.testing.assert_allclose(raw, expected, rtol=0, atol=max(tolerance * 4, 1e-6))


def test_colour_order_and_value_range(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = channel(tmp_path / "m.onnx", 0)
    recipe = dataclasses.replace(PLAIN, colour="bgr", value_range=255.0)
    raw = depth_of(model, recipe, monkeypatch).raw(0, REFERENCE)
    np.testing.assert_allclose(raw, 255 * unit_rgb((32, 24))[..., 2], rtol=1e-6)


def test_uint8_graphs_get_counts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = channel(tmp_path / "m.onnx", 1, shape=(1, 3, 48, 64), type_=BYTE)
    recipe = dataclasses.replace(PLAIN, mean=(9.0, 9.0, 9.0))
    raw = depth_of(model, recipe, monkeypatch).raw(0, REFERENCE)
    np.testing.assert_array_equal(raw, REFERENCE[..., 1])


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_gray_images_of_every_type(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dtype: type[np.generic]
) -> None:
    top = 1 if dtype is np.float32 else np.iinfo(dtype).max  # type: ignore[type-var]
    image = (RANDOM.random((24, 32)) * top).astype(dtype)
    three, one = channel(tmp_path / "3.onnx", 2), channel(tmp_path / "1.onnx", shape=(1, 1, 24, 32))
    for model in (three, one):
        raw = depth_of(model, PLAIN, monkeypatch).raw(0, image)
        np.testing.assert_allclose(raw, np.float32(image) / np.float32(top), rtol=1e-6)


def test_outputs_by_name_and_index(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nodes = [
        helper.make_node("ReduceMean", ["image"], ["confidence"], axes=[1], keepdims=1),
        helper.make_node("ReduceMax", ["image"], ["depth"], axes=[1], keepdims=1),
    ]
    model = save_graph(tmp_path / "m.onnx", nodes, outputs=["confidence", "depth"])
    rgb = unit_rgb((32, 24))
    for output, expected in ((0, rgb.mean(2)), ("depth", rgb.max(2)), (1, rgb.max(2))):
        recipe = dataclasses.replace(PLAIN, output=output)
        raw = depth_of(model, recipe, monkeypatch).raw(0, REFERENCE)
        np.testing.assert_allclose(raw, expected, rtol=1e-5)
    for output in ("disparity", 2):
        recipe = dataclasses.replace(PLAIN, output=output)
        with pytest.raises(InputError, match=r"no output .* expected one of confidence, depth"):
            depth_of(model, recipe, monkeypatch)


@pytest.mark.parametrize(
    ("recipe", "image", "fed"),
    [
        # Larger than 518 on the shorter side, both multiples of 14: 480x640 -> 518x690.67 -> 686.
        (Recipe("metric"), (480, 640), (518, 686)),
        (Recipe("metric"), (1000, 500), (1036, 518)),
        (Recipe("metric", resize="longer", size=504), (480, 640), (378, 504)),
        (Recipe("metric", resize="longer", size=504), (100, 1000), (56, 504)),
        (Recipe("metric", resize="stretch", size=(30, 50)), (480, 640), (30, 50)),
        (Recipe("metric", resize="letterbox", size=(30, 50)), (480, 640), (30, 50)),
        (Recipe("metric", size=384, multiple=32), (480, 640), (384, 512)),
    ],
)
def test_sizes_of_dynamic_graphs(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    calls: list[tuple[int, ...]],
    recipe: Recipe,
    image: tuple[int, int],
    fed: tuple[int, int],
) -> None:
    depth_of(channel(tmp_path / "m.onnx"), recipe, monkeypatch).raw(0, np.ones(image, np.uint8))
    assert calls == [(1, 3, *fed)]


def test_letterbox_is_cut_out_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = dataclasses.replace(PLAIN, resize="letterbox")
    model = channel(tmp_path / "m.onnx", shape=(1, 3, 60, 32))
    provider = depth_of(model, recipe, monkeypatch)
    np.testing.assert_allclose(provider.raw(0, REFERENCE), unit_rgb((32, 24))[..., 0], rtol=1e-6)
    # The border is the mean colour: below it is what the whole canvas holds.
    canvas, inner = provider._sizes((64, 48))
    prepared = provider._prepare(REFERENCE, canvas, inner)
    assert prepared.shape == (60, 32, 3)
    np.testing.assert_allclose(prepared[:18], np.tile((0.485, 0.456, 0.406), (18, 32, 1)), 1e-6)


def test_coarser_output_of_a_letterbox(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nodes = [helper.make_node("MaxPool", ["image"], ["pool"], kernel_shape=[4, 4], strides=[4, 4])]
    nodes += [helper.make_node("ReduceMean", ["pool"], ["depth"], axes=[1], keepdims=0)]
    model = save_graph(tmp_path / "m.onnx", nodes, shape=(1, 3, 64, 64))
    recipe = dataclasses.replace(PLAIN, resize="letterbox")
    image = np.full((48, 64), 255, np.uint8)
    raw = depth_of(model, recipe, monkeypatch).raw(0, image)
    np.testing.assert_array_equal(raw, np.ones((12, 16)))


@pytest.mark.parametrize(
    ("graph", "problem"),
    [
        ({"inputs": 2}, r"has 2 inputs: image \(\?, 3, \?, \?\).*expected one image input"),
        ({"shape": (3, "h", "w")}, r"input is image \(3, \?, \?\).*expected one image input"),
        ({"shape": (1, 2, 3, 24, 32)}, "takes 2 views"),
        ({"shape": (1, 4, 24, 32)}, r"input is image \(1, 4, 24, 32\)"),
        ({"type_": TensorProto.INT64}, r"int64.*of float32, float16 or uint8"),
    ],
)
def test_graphs_of_another_kind_are_refused(
    tmp_path: Path, graph: dict[str, Any], problem: str
) -> None:
    model = channel(tmp_path / "m.onnx", **graph)
    with pytest.raises(InputError, match=rf"m\.onnx: .*{problem}"):
        ImageInput.of(Network(model))


def test_files_that_are_no_models(tmp_path: Path) -> None:
    whole = channel(tmp_path / "whole.onnx").read_bytes()
    for name, data in (("empty", b""), ("text", b"not a model " * 9), ("cut", whole[:60])):
        path = tmp_path / f"{name}.onnx"
        path.write_bytes(data)
        with pytest.raises(InputError, match=rf"{name}\.onnx: not an ONNX model, or truncated"):
            Network(path)
    with pytest.raises(InputError, match=r"none\.onnx: no such file"):
        Network(tmp_path / "none.onnx")


def test_custom_operators_are_refused(tmp_path: Path) -> None:
    nodes = [helper.make_node("Magic", ["image"], ["depth"], domain="my.ops")]
    model = save_graph(tmp_path / "m.onnx", nodes)
    with pytest.raises(InputError, match=r"m\.onnx: needs operators that .* my\.ops:Magic"):
        Network(model)


@pytest.mark.parametrize(
    ("ir", "opset", "problem"),
    [
        (99, 17, "is of ONNX's IR version 99, this ONNX Runtime reads up to"),
        (9, 99, "is of opset 99, this ONNX Runtime knows up to"),
    ],
)
def test_models_of_the_future(tmp_path: Path, ir: int, opset: int, problem: str) -> None:
    model = onnx.load(channel(tmp_path / "m.onnx"))
    model.ir_version, model.opset_import[0].version = ir, opset
    onnx.save(model, tmp_path / "m.onnx")
    with pytest.raises(InputError, match=rf"m\.onnx: {problem} .* newer onnxruntime") as caught:
        Network(tmp_path / "m.onnx")
    assert "onnxruntime/core" not in str(caught.value)


def test_graphs_that_are_not_valid(tmp_path: Path) -> None:
    nodes = [helper.make_node("Add", ["image", "nowhere"], ["depth"])]
    with pytest.raises(InputError, match=r"m\.onnx: its graph is not valid .*'nowhere'"):
        Network(save_graph(tmp_path / "m.onnx", nodes))


def test_missing_weights_are_named(tmp_path: Path) -> None:
    model = weighted(tmp_path / "m.onnx", 1.0)
    (tmp_path / "m.weights").unlink()
    with pytest.raises(InputError, match=r"m\.onnx: a file of its weights is missing.*m\.weights"):
        Network(model)


def test_providers_are_checked(tmp_path: Path) -> None:
    model = channel(tmp_path / "m.onnx")
    assert "cpu" in available_providers()
    assert "azure" not in available_providers()
    with pytest.raises(InputError, match=r"provider 'abacus' is not available, expected .*cpu"):
        Network(model, ["abacus", "cpu"])


def test_sizes_a_graph_was_not_made_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nodes = [helper.make_node("Add", ["image", "w"], ["depth"])]
    weights = {"w": np.ones((3, 20, 20), np.float32)}
    model = save_graph(tmp_path / "m.onnx", nodes, constants=weights)
    provider = depth_of(model, PLAIN, monkeypatch)
    with pytest.raises(
        InputError,
        match=r"m\.onnx: cannot run on image \(1, 3, 24, 32\): its step Add '' fails .*`multiple`",
    ):
        provider(0, REFERENCE)


def test_output_of_several_channels_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = save_graph(tmp_path / "m.onnx", [helper.make_node("Abs", ["image"], ["depth"])])
    with pytest.raises(InputError, match=r"output depth has shape \(1, 3, 24, 32\)"):
        depth_of(model, PLAIN, monkeypatch)(0, REFERENCE)


# -- What outputs mean ----------------------------------------------------------------------------


def ramp() -> NDArray[np.uint8]:
    """24 x 32 gray, 0 to 255."""
    return np.linspace(0, 255, 24 * 32).reshape(24, 32).astype(np.uint8)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"kind": "metric", "scale": 50.0}, lambda r: 50 * r),
        ({"kind": "inverse", "shift": 0.25}, lambda r: 1 / (r + 0.25)),
        ({"kind": "relative", "scale": 2.0, "shift": 0.5}, lambda r: 1 / (2 * r + 0.5)),
        ({"kind": "disparity", "scale": 0.1}, lambda r: np.where(r > 0, 10 / np.fmax(r, 1e-9), 0)),
        (
            {"kind": "inverse", "shift": -0.5, "max_depth": 30.0},
            lambda r: np.where(r > 0.5 + 1 / 30, 1 / np.fmax(r - 0.5, 1e-9), 30),
        ),
        (
            {"kind": "metric", "scale": 50.0, "min_depth": 10.0, "max_depth": 40.0},
            lambda r: np.where(50 * r >= 10, np.fmin(50 * r, 40), 0),
        ),
    ],
    ids=["metric", "inverse", "relative", "disparity", "beyond-infinity", "limits"],
)
def test_output_kinds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fields: dict[str, Any], expected: Any
) -> None:
    recipe = dataclasses.replace(PLAIN, **fields)
    depth = depth_of(channel(tmp_path / "m.onnx"), recipe, monkeypatch)(0, ramp())
    assert depth.dtype == np.float32
    np.testing.assert_allclose(depth, expected(ramp() / 255.0), rtol=1e-4)


def test_options_override_scale_and_shift(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = dataclasses.replace(PLAIN, kind="relative")
    provider = depth_of(channel(tmp_path / "m.onnx"), recipe, monkeypatch, scale=0.5, shift=0.1)
    np.testing.assert_allclose(provider(0, ramp()), 1 / (ramp() / 510.0 + 0.1), rtol=1e-4)


def test_relative_depth_without_scale_keeps_the_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recipe = dataclasses.replace(PLAIN, kind="relative")
    provider = depth_of(channel(tmp_path / "m.onnx"), recipe, monkeypatch)
    raw, depth = provider.raw(0, ramp()), provider(0, ramp())
    known = depth > 0
    assert np.all(np.diff(depth[known]) <= 0)  # the ramp comes nearer
    far, near = np.percentile(raw, (2, 98))
    found = normalization(raw)
    assert 1 / (found.scale * far + found.shift) == pytest.approx(80)
    assert 1 / (found.scale * near + found.shift) == pytest.approx(2)
    assert math.isfinite(normalization(np.full((3, 4), 7, np.float32)).shift)


def test_canonical_focal_length(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = channel(tmp_path / "m.onnx")
    recipe = dataclasses.replace(PLAIN, canonical_focal=1000.0)
    with pytest.raises(InputError, match=r"scales with the focal length.*--depth-focal"):
        depth_of(model, recipe, monkeypatch)
    image = cv2.resize(ramp(), (64, 48))
    plain = depth_of(model, PLAIN, monkeypatch)(0, image)
    # 600 px at 64 px width are 300 px at the 32 px the network sees.
    depth = depth_of(model, recipe, monkeypatch, focal=600.0)(0, image)
    np.testing.assert_allclose(depth, 0.3 * plain, rtol=1e-5)
    with pytest.raises(InputError, match="focal length is -1, expected above 0 px"):
        depth_of(model, recipe, monkeypatch, focal=-1.0)


@pytest.mark.parametrize("matrix", [False, True])
def test_estimated_focal_length(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, matrix: bool
) -> None:
    camera = np.float32([[[40, 0, 9], [0, 41, 9], [0, 0, 1]]]) if matrix else np.float32([40])
    nodes = [
        helper.make_node("ReduceMean", ["image"], ["depth"], axes=[1]),
        helper.make_node("Identity", ["camera"], ["focal"]),
    ]
    outputs, shape = ["depth", "focal"], (1, 3, "h", "w")
    model = save_graph(
        tmp_path / "m.onnx", nodes, shape, outputs=outputs, constants={"camera": camera}
    )
    recipe = dataclasses.replace(PLAIN, focal_output="focal")
    image = cv2.resize(ramp(), (64, 48))
    own = depth_of(model, recipe, monkeypatch)(0, image)
    known = depth_of(model, recipe, monkeypatch, focal=120.0)(0, image)
    np.testing.assert_allclose(known, own * 60 / 40, rtol=1e-5)


def test_depth_gets_the_aspect_of_the_image(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A network of square input sees a stretched image; a ramp of rows comes back a ramp."""
    recipe = dataclasses.replace(PLAIN, size=(40, 40), scale=100.0)
    model = channel(tmp_path / "m.onnx")
    rows = np.repeat(np.linspace(0.5, 0.6, 48, dtype=np.float32)[:, None], 64, axis=1)
    depth = depth_of(model, recipe, monkeypatch)(0, rows)
    assert depth.shape == (30, 40)
    expected = np.interp((np.arange(30) + 0.5) * 48 / 30 - 0.5, np.arange(48), 100 * rows[:, 0])
    np.testing.assert_allclose(depth[1:-1], np.repeat(expected[1:-1, None], 40, 1), rtol=1e-4)


def test_resampling_invents_nothing_at_steps() -> None:
    depth = np.float32([[5] * 8] * 4 + [[50] * 8] * 3 + [[0] * 8])
    resampled = to_aspect(depth, (80, 50))
    assert resampled.shape == (5, 8)
    assert set(np.unique(np.round(resampled, 3))) <= {0.0, 5.0, 50.0}


# -- Batches and the cache ------------------------------------------------------------------------


def images(count: int) -> list[NDArray[np.uint8]]:
    return list(RANDOM.integers(1, 256, (count, 24, 32, 3), np.uint8))


@pytest.mark.parametrize(
    ("batch", "runs"), [("b", [3, 1]), (1, [1, 1, 1, 1]), (2, [2, 2, 2])], ids=str
)
def test_batches(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    calls: list[tuple[int, ...]],
    batch: int | str,
    runs: list[int],
) -> None:
    model = channel(tmp_path / "m.onnx", shape=(batch, 3, "h", "w"))
    references = [*images(3), np.full((30, 32), 7, np.uint8)]
    depths = depth_of(model, PLAIN, monkeypatch).batch(references)
    assert [shape[0] for shape in calls] == runs
    for reference, depth in zip(references[:3], depths[:3], strict=True):
        np.testing.assert_allclose(depth, reference[..., 2] / 255, rtol=1e-5)
    np.testing.assert_allclose(depths[3], 7 / 255, rtol=1e-5)


def test_second_run_does_not_call_the_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, calls: list[tuple[int, ...]]
) -> None:
    model = channel(tmp_path / "m.onnx")
    references = images(3)
    first = depth_of(model, PLAIN, monkeypatch).batch(references)
    assert len(calls) == 1
    again = depth_of(model, PLAIN, monkeypatch)
    np.testing.assert_array_equal(again.batch(references), first)
    # What is only done with the output does not need the network either.
    scaled = depth_of(model, dataclasses.replace(PLAIN, scale=2.0), monkeypatch)
    np.testing.assert_allclose(scaled(0, references[0]), 2 * first[0], rtol=1e-6)
    assert len(calls) == 1
    # Another image, another recipe, another model do.
    again.batch([references[0], *images(1)])
    assert calls[1:] == [(1, 3, 24, 32)]
    depth_of(model, dataclasses.replace(PLAIN, mean=(1.0, 1.0, 1.0)), monkeypatch)(0, references[0])
    other = depth_of(channel(tmp_path / "other.onnx", 1), PLAIN, monkeypatch)(0, references[0])
    assert len(calls) == 4
    np.testing.assert_allclose(other, references[0][..., 1] / 255, rtol=1e-5)


@pytest.mark.parametrize("damage", ["cut", "flip", "empty", "other"])
def test_damaged_results_are_computed_again(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    cache: Path,
    calls: list[tuple[int, ...]],
    damage: str,
) -> None:
    provider = depth_of(channel(tmp_path / "m.onnx"), PLAIN, monkeypatch)
    image = images(1)[0]
    depth = provider(0, image)
    (entry,) = cache.rglob("*.npz")
    data = bytearray(entry.read_bytes())
    data[len(data) // 3] ^= 1
    entry.write_bytes({"cut": data[:-30], "flip": data, "empty": b"", "other": b"PK"}[damage])
    np.testing.assert_array_equal(provider(0, image), depth)
    assert len(calls) == 2
    np.testing.assert_array_equal(provider(0, image), depth)
    assert len(calls) == 2
    assert not list(cache.rglob("*.partial"))


@pytest.mark.parametrize(
    "arrays",
    [
        {"values": np.ones(3, np.float32), "camera": np.ones(2)},
        {"values": np.ones((3, 4)), "camera": np.ones(2)},
        {"values": np.ones((3, 4), np.float32), "camera": np.ones(3)},
        {"values": np.ones((0, 4), np.float32), "camera": np.ones(2)},
        {"values": np.ones((3, 4), np.float32), "camera": np.array(["a", "b"])},
        {"values": np.ones((3, 4), np.float32)},
        {},
    ],
)
def test_results_of_another_shape_are_computed_again(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    cache: Path,
    calls: list[tuple[int, ...]],
    arrays: dict[str, np.ndarray],
) -> None:
    provider = depth_of(channel(tmp_path / "m.onnx"), PLAIN, monkeypatch)
    image = images(1)[0]
    depth = provider(0, image)
    (entry,) = cache.rglob("*.npz")
    np.savez(entry, allow_pickle=False, **arrays)
    np.testing.assert_array_equal(provider(0, image), depth)
    assert len(calls) == 2


def test_cache_that_cannot_be_written_does_not_stop_a_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("in the way")
    provider = depth_of(channel(tmp_path / "m.onnx"), PLAIN, monkeypatch, cache=tmp_path / "file")
    with pytest.warns(RuntimeWarning, match="results are not cached"):
        assert provider(0, images(1)[0]).any()


def weighted(path: Path, value: float) -> Path:
    """A graph with its weights in m.weights."""
    nodes = [
        helper.make_node("Mul", ["image", "w"], ["scaled"]),
        helper.make_node("ReduceMean", ["scaled"], ["depth"], axes=[1]),
    ]
    weights = {"w": np.full((3, 24, 32), value, np.float32)}
    external = {"save_as_external_data": True, "location": "m.weights", "size_threshold": 0}
    (path.parent / "m.weights").unlink(missing_ok=True)
    return save_graph(path, nodes, constants=weights, **external)


def test_weights_in_other_files_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model, image = weighted(tmp_path / "m.onnx", 2.0), ramp()
    once = depth_of(model, PLAIN, monkeypatch)(0, image)
    graph = model.read_bytes()
    weighted(model, 6.0)
    assert model.read_bytes() == graph
    np.testing.assert_allclose(depth_of(model, PLAIN, monkeypatch)(0, image), 3 * once, rtol=1e-5)


def test_cache_command(cache: Path) -> None:
    ResultCache("depth").store("ab12", {"values": np.zeros(1000)})
    result = run("models", "cache")
    assert result.stdout.startswith("1 results, 0.0 MB: ")
    assert str(cache) in result.stdout
    assert "removed" in run("models", "cache", "--clear").stdout
    assert run("models", "cache").stdout.startswith("0 results")
    assert not list(cache.rglob("*.npz"))


# -- Recipes --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("file", "recipe"),
    [
        ("depth_anything_v2_metric_hypersim_vits", "depth-anything-v2-metric-indoor"),
        ("Depth-Anything-V2-Metric-Outdoor-Small", "depth-anything-v2-metric-outdoor"),
        ("depth_anything_v2_vitl_dynamic", "depth-anything-v2-relative"),
        ("da3metric-large_504", "depth-anything-3-metric"),
        ("DepthPro_fp16", "depth-pro"),
        ("unidepthv2", "unidepth-v2"),
        ("unidepth-v2-vitl14", "unidepth-v2"),
        ("metric3d_vit_small", "metric3d-v2"),
        ("midas_v21_small_256", "midas-v21"),
        ("model-f6b98070", "midas-v21"),
        ("dpt_large_384", "midas-dpt"),
        ("zoedepth-nyu-kitti", "zoedepth"),
    ],
)
def test_recipe_by_file_name(tmp_path: Path, file: str, recipe: str) -> None:
    assert find_recipe(tmp_path / f"{file}.onnx") == (recipe, RECIPES[recipe].recipe)


@pytest.mark.parametrize(
    "file", ["model", "depth_anything_v2_metric_vits", "da3-large", "unidepth"]
)
def test_no_recipe_is_guessed(tmp_path: Path, file: str) -> None:
    with pytest.raises(InputError, match=rf"{file}\.onnx: .*--depth-recipe.*depth-pro"):
        find_recipe(tmp_path / f"{file}.onnx")


def test_recipe_file_comes_first(tmp_path: Path) -> None:
    model = tmp_path / "zoedepth.onnx"
    (tmp_path / "zoedepth.yaml").write_text("recipe: midas-dpt\nsize: 256\nmean: [0, 0.5, 1]\n")
    name, recipe = find_recipe(model, "depth-pro")
    base = RECIPES["midas-dpt"].recipe
    assert name == "midas-dpt with zoedepth.yaml"
    assert recipe == dataclasses.replace(base, size=256, mean=(0.0, 0.5, 1.0))
    (tmp_path / "zoedepth.yaml").write_text("max_depth: 12\n")
    zoe = dataclasses.replace(RECIPES["zoedepth"].recipe, max_depth=12.0)
    assert find_recipe(model)[1] == zoe
    pro = dataclasses.replace(RECIPES["depth-pro"].recipe, max_depth=12.0)
    assert find_recipe(model, "depth-pro")[1] == pro


def test_recipe_file_alone_is_enough(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("kind: inverse\noutput: 1\nsize: [24, 32]\nresize: stretch")
    recipe = Recipe("inverse", output=1, size=(24, 32), resize="stretch")
    assert find_recipe(tmp_path / "mine.onnx") == ("mine.yaml", recipe)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("kind: metric\nsise: 518", "unknown key 'sise', expected .*size"),
        ("kind: log", "kind is 'log', expected one of metric"),
        ("kind: [metric]", "kind is .*expected a word"),
        ("kind: metric\nsize: wide", "size is 'wide', expected pixels"),
        ("kind: metric\nsize: true", "size is True, expected pixels"),
        ("kind: metric\nsize: [1, 2, 3]\nresize: stretch", "size is .*expected pixels"),
        ("kind: metric\nsize: [24, 32]", "size is .*expected one number for resize shorter"),
        ("kind: metric\nsize: 0", "size is 0, expected at least 1 px"),
        ("kind: metric\nmean: 0.5", "mean is 0.5, expected three numbers"),
        ("kind: metric\nstd: [1, 0, 1]", "std is .*expected numbers above 0"),
        ("kind: metric\nscale: .nan", "scale is nan, expected a number above 0"),
        ("kind: metric\nshift: 1", "shift is 1.0, expected none"),
        ("kind: disparity", "scale is None, expected a number: a disparity"),
        ("kind: relative\nshift: 1", "shift is 1.0, expected none without a scale"),
        ("kind: metric\nmin_depth: 9\nmax_depth: 8", "min_depth is 9.0, expected .*max_depth"),
        ("kind: metric\ninterpolation: best", "interpolation is 'best', expected one of"),
        ("kind: metric\nresize: fit", "resize is 'fit', expected one of shorter"),
        ("kind: metric\ncolour: hsv", "colour is 'hsv', expected rgb or bgr"),
        ("recipe: resnet", "depth recipe 'resnet' is not known, expected .*zoedepth"),
        ("- kind", "expected keys and values, one a line: .*kind"),
        ("kind: [", "not YAML"),
        ("!!python/object/apply:os.system ['true']", "not YAML"),
    ],
)
def test_recipe_files_are_strict(tmp_path: Path, text: str, problem: str) -> None:
    (tmp_path / "m.yaml").write_text(text)
    with pytest.raises(InputError, match=problem):
        find_recipe(tmp_path / "m.onnx")


def test_shipped_recipes_fit_their_families(tmp_path: Path) -> None:
    """Signatures as the projects' own exports have them; see docs/inputs_networks.md."""
    mean = helper.make_node("ReduceMean", ["image"], ["depth"], axes=[1], keepdims=1)
    camera = helper.make_node("Identity", ["camera"], ["out_K"])
    focal = np.float32([[[300, 0, 308], [0, 300, 231], [0, 0, 1]]])
    unidepth = save_graph(
        tmp_path / "unidepthv2.onnx",
        [camera, mean],
        ("batch", 3, 462, 616),
        outputs=["out_K", "depth"],
        constants={"camera": focal},
    )
    metric3d = save_graph(tmp_path / "metric3d_vit_small.onnx", [mean], (1, 3, 616, 1064))
    image = np.full((480, 640, 3), 128, np.uint8)
    normalized = (128 / 255 - np.array((0.485, 0.456, 0.406))) / np.array((0.229, 0.224, 0.225))
    depth = NetworkDepth(unidepth)(0, image)
    np.testing.assert_allclose(depth, normalized.mean(), rtol=1e-4)
    # Counts go in as they are; 640 px become 821 px in the letterbox.
    depth = NetworkDepth(metric3d, NetworkOptions(focal=500.0))(0, image)
    np.testing.assert_allclose(depth, 128 * 500 * 821 / 640 / 1000, rtol=1e-4)


# -- The commands ---------------------------------------------------------------------------------


def street_network(path: Path) -> Path:
    """Depth from the row alone, as of a flat road, in a graph of dynamic size.

    Height 1.5 m, horizon in the middle; above it everything is far.
    """
    nodes = [
        helper.make_node("ReduceMean", ["image"], ["gray"], axes=[1], keepdims=1),
        helper.make_node("Mul", ["gray", "zero"], ["none"]),
        helper.make_node("Add", ["none", "rows"], ["depth"]),
    ]
    below = np.arange(96) - 47.5
    inverse = np.fmax(below / (1.5 * 96), 1 / 60)
    constants = {
        "zero": np.zeros(1, np.float32),
        "rows": inverse.astype(np.float32).reshape(1, 1, 96, 1),
    }
    (path.with_suffix(".yaml")).write_text(
        "kind: inverse\nresize: stretch\nsize: [96, 128]\nmultiple: 1\n"
    )
    return save_graph(path, nodes, (1, 3, 96, "w"), constants=constants)


def test_calibrate_and_register_with_a_network(
    scene: Path, tmp_path: Path, calls: list[tuple[int, ...]]
) -> None:
    model = street_network(tmp_path / "road.onnx")
    folders = scene / "visible", scene / "thermal"
    depth = ("--depth", model, "--quiet")
    result = run("calibrate", *folders, *depth, "-o", tmp_path / "rig.yaml")
    assert result.exit_code in (0, 3), result.output
    assert "rig: " in result.stdout
    assert len(calls) == 6
    truth, rig = Rig.load(scene / "rig.yaml"), Rig.load(tmp_path / "rig.yaml")
    provider = open_depth(scene / "depth", sorted((scene / "visible").iterdir()))
    image = cv2.imread(str(scene / "visible" / min(p.name for p in (scene / "visible").iterdir())))
    error = metrics.end_point_error(rig, truth, provider(0, image))
    # The scene is no flat road: this is near, not exact.
    assert np.nanmedian(error) < 6
    result = run("register", tmp_path / "rig.yaml", *folders, *depth, "-o", tmp_path / "out")
    assert result.exit_code == 3, result.output  # it gives every frame the same depth
    assert "all frames have the same depth map" in result.stderr
    assert len(calls) == 6  # every depth map comes from the cache
    assert len(list((tmp_path / "out").glob("*.png"))) == 6


def test_commands_refuse_in_one_line(rendered: Path, tmp_path: Path, refused: Any) -> None:
    model = channel(tmp_path / "m.onnx")
    folders = rendered / "visible", rendered / "thermal"
    arguments = ("calibrate", *folders, "--depth", model, "-o", tmp_path / "rig.yaml")
    assert "matches no depth recipe" in refused(*arguments)
    assert "--depth-focal" in refused(*arguments, "--depth-recipe", "metric3d-v2")
    assert "'abacus'" in refused(
        *arguments, "--depth-recipe", "zoedepth", "--providers", "abacus,cpu"
    )


def test_onnx_is_not_imported_without_need() -> None:
    import subprocess
    import sys

    code = (
        "import sys, xcalib.cli.calibrate, xcalib.cli.register;"
        " sys.exit('onnxruntime' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


# -- A real architecture --------------------------------------------------------------------------


def test_depth_anything_of_transformers(tmp_path: Path, calls: list[tuple[int, ...]]) -> None:
    """A tiny Depth Anything with random weights, exported; the same numbers as PyTorch's."""
    torch = pytest.importorskip("torch", reason="needs the extra test-networks")
    transformers = pytest.importorskip("transformers", reason="needs the extra test-networks")
    torch.manual_seed(0)
    backbone = transformers.Dinov2Config(
        hidden_size=24,
        num_hidden_layers=4,
        num_attention_heads=2,
        image_size=70,
        patch_size=14,
        out_features=["stage1", "stage2", "stage3", "stage4"],
        reshape_hidden_states=False,
        apply_layernorm=True,
    )
    config = transformers.DepthAnythingConfig(
        backbone_config=backbone,
        reassemble_hidden_size=24,
        neck_hidden_sizes=[8, 12, 16, 20],
        fusion_hidden_size=12,
        head_hidden_size=8,
        depth_estimation_type="metric",
        max_depth=20,
    )
    network = transformers.DepthAnythingForDepthEstimation(config).eval()

    path = tmp_path / "depth_anything_v2_metric_indoor_tiny.onnx"
    config.return_dict = False  # the depth alone, as a tuple
    torch.onnx.export(
        network,
        (torch.zeros(1, 3, 70, 98),),
        str(path),
        input_names=["pixel_values"],
        output_names=["predicted_depth"],
    )
    image = RANDOM.integers(0, 256, (48, 64, 3), np.uint8)
    provider = NetworkDepth(path)
    raw, depth = provider.raw(0, image), provider(0, image)
    assert calls == [(1, 3, 70, 98)]
    rgb = cv2.resize(np.float32(image[..., ::-1]) / 255, (98, 70), interpolation=cv2.INTER_CUBIC)
    pixels = (rgb - np.float32((0.485, 0.456, 0.406))) / np.float32((0.229, 0.224, 0.225))
    with torch.no_grad():
        expected = network(torch.from_numpy(pixels.transpose(2, 0, 1)[None]))[0][0]
    np.testing.assert_allclose(raw, expected.numpy(), rtol=1e-3, atol=1e-4)
    assert abs(depth.shape[1] * 48 - depth.shape[0] * 64) <= 64
    assert 0 < depth.min() <= depth.max() <= 20
