"""Residual flow: the built-in one, and ONNX networks with known answers made on the fly."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from xcalib.flow import FlowOptions, FlowProvider, NetworkFlow, PatchFlow, patch_flow
from xcalib.frames import Image, InputError

SHIFT = np.float32([3.3, -2.6])


def texture(width: int = 240, height: int = 180) -> Image:
    noise = np.random.default_rng(1).random((height, width), dtype=np.float32)
    image = cv2.GaussianBlur(noise, (0, 0), 2.5)
    low, high = image.min(), image.max()
    return (255 * (image - low) / (high - low)).astype(np.uint8)


def shifted(image: Image) -> Image:
    """What lies at p lies at p + SHIFT here, in another modality: dark is bright."""
    move = np.float32([[1, 0, SHIFT[0]], [0, 1, SHIFT[1]]])
    return 255 - cv2.warpAffine(image, move, image.shape[1::-1], borderMode=cv2.BORDER_REFLECT_101)


# -- Patches -------------------------------------------------------------------------------------


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_patches_find_a_shift_with_its_sign(dtype: type) -> None:
    reference = texture()
    scale = {np.uint8: 1, np.uint16: 257, np.float32: 1 / 255}[dtype]
    warped = (shifted(reference).astype(np.float32) * scale).astype(dtype)
    reference = (reference.astype(np.float32) * scale).astype(dtype)
    flow, confidence = PatchFlow()(reference, warped, None)
    assert flow.shape == (180, 240, 2) and flow.dtype == np.float32
    assert confidence.shape == (180, 240) and confidence.dtype == np.float32
    assert confidence.min() >= 0 and confidence.max() <= 1
    known = confidence > 0.5
    assert known.mean() > 0.6
    error = np.linalg.norm(flow - SHIFT, axis=-1)[known]
    assert np.median(error) < 0.15
    assert np.mean(error < 0.5) > 0.95


def test_patches_are_not_confident_without_the_source() -> None:
    reference = texture()
    warped, mask = shifted(reference), np.ones(reference.shape, bool)
    mask[:, 120:] = False
    warped[~mask] = 0
    _, confidence = patch_flow(reference, warped, mask)
    assert (confidence[:, :90] > 0.5).mean() > 0.5
    assert not (confidence[:, 135:] > 0.5).any()


def test_patch_options_reach_the_search() -> None:
    reference = texture()
    near = PatchFlow(FlowOptions(levels=1, max_shift=1))(reference, shifted(reference), None)
    assert np.abs(near[0]).max() < 3  # what it cannot reach it does not report
    with pytest.raises(ValueError, match="flow step is 4, expected an odd number"):
        PatchFlow(FlowOptions(step=4))(reference, reference, None)
    with pytest.raises(ValueError, match="registered is 10x10"):
        patch_flow(reference, reference[:10, :10])


# -- Networks ------------------------------------------------------------------------------------

Build = Callable[..., Path]


@pytest.fixture
def build(tmp_path: Path) -> Build:
    """Writes an ONNX file: nodes from inputs `a` and `b` to the named outputs."""
    onnx = pytest.importorskip("onnx")
    pytest.importorskip("onnxruntime")

    def write(
        nodes: list[tuple[str, list[str], list[str], dict[str, Any]]],
        outputs: list[str],
        constants: dict[str, np.ndarray] | None = None,
        size: tuple[int | str, int | str] = ("H", "W"),
        channels: int = 3,
        inputs: tuple[str, ...] = ("a", "b"),
        kind: int = onnx.TensorProto.FLOAT,
    ) -> Path:
        info = onnx.helper.make_tensor_value_info
        graph = onnx.helper.make_graph(
            [onnx.helper.make_node(op, *wires, **extra) for op, *wires, extra in nodes],
            "flow",
            [info(name, kind, [1, channels, *size]) for name in inputs],
            [info(name, onnx.TensorProto.FLOAT, ["n", "c", "h", "w"]) for name in outputs],
            [onnx.numpy_helper.from_array(v, k) for k, v in (constants or {}).items()],
        )
        opset = [onnx.helper.make_opsetid("", 17)]
        model = onnx.helper.make_model(graph, opset_imports=opset, ir_version=8)
        onnx.checker.check_model(model)
        path = tmp_path / "model.onnx"
        onnx.save(model, path)
        return path

    return write


# The difference of the inputs' first two channels, second less first: antisymmetric as flow is.
DIFFERENCE = [
    ("Sub", ["b", "a"], ["d"], {}),
    ("Slice", ["d", "zero", "two", "axis"], ["flow"], {}),
]
SLICE = {"zero": np.array([0]), "two": np.array([2]), "axis": np.array([1])}
# The same answer whichever way: never consistent, unless it is 0.
CONSTANT = [
    *DIFFERENCE,
    ("Mul", ["flow", "none"], ["empty"], {}),
    ("Add", ["empty", "c"], ["k"], {}),
]


def constant(x: float, y: float) -> dict[str, np.ndarray]:
    vector = np.array([x, y], np.float32).reshape(1, 2, 1, 1)
    return {**SLICE, "none": np.zeros(1, np.float32), "c": vector}


def flat(*bgr: int, size: tuple[int, int] = (53, 37)) -> Image:
    return np.full((size[1], size[0], 3), bgr, np.uint8)


def test_a_network_gets_red_green_blue_and_its_flow_is_from_reference_to_source(
    build: Build,
) -> None:
    network: FlowProvider = NetworkFlow(build(DIFFERENCE, ["flow"], SLICE))
    flow, confidence = network(flat(9, 20, 30), flat(7, 21, 33), None)
    assert flow.shape == (37, 53, 2) and flow.dtype == np.float32
    np.testing.assert_allclose(flow, np.broadcast_to([3, 1], flow.shape), atol=1e-4)
    # Consistent, where the flow stays inside.
    np.testing.assert_allclose(confidence[:36, :50], 1, atol=1e-4)
    assert not confidence[:, 50:].any() and not confidence[36:].any()


def test_the_flow_may_stand_on_the_second_input(build: Build) -> None:
    path = build(DIFFERENCE, ["flow"], SLICE)
    path.with_suffix(".yaml").write_text("flow_from: 2\n")
    flow, _ = NetworkFlow(path)(flat(9, 20, 30), flat(7, 21, 33), None)
    np.testing.assert_allclose(flow, np.broadcast_to([-3, -1], flow.shape), atol=1e-4)


def test_gray_is_replicated_and_scaled_by_the_yaml(build: Build) -> None:
    path = build(DIFFERENCE, ["flow"], SLICE)
    path.with_suffix(".yaml").write_text("range: [-1, 1]\nmean: [0.5, 0, 0]\nstd: [0.5, 0.25, 1]\n")
    black, white = np.zeros((16, 24), np.uint8), np.full((16, 24), 255, np.uint8)
    flow, _ = NetworkFlow(path)(black, white, None)
    np.testing.assert_allclose(flow, np.broadcast_to([4, 8], flow.shape), atol=1e-5)


def test_what_is_inconsistent_or_not_valid_is_not_confident(build: Build) -> None:
    image = flat(0, 0, 0)
    _, confidence = NetworkFlow(build(CONSTANT, ["k"], constant(0.5, 0)))(image, image, None)
    # There and back misses by 1 px of the 2 px tolerated.
    np.testing.assert_allclose(confidence[:, :52], 0.5, atol=1e-5)
    valid = np.ones(image.shape[:2], bool)
    valid[10, 20] = False
    _, confidence = NetworkFlow(build(CONSTANT, ["k"], constant(0, 0)))(image, image, valid)
    assert confidence[10, 20] == 0
    assert confidence.sum() == valid.sum()


def test_a_flow_that_is_nowhere_a_number_is_said(build: Build) -> None:
    image = flat(0, 0, 0)
    with pytest.raises(InputError, match=r"\.onnx: its flow is not a number anywhere; expected"):
        NetworkFlow(build(CONSTANT, ["k"], constant(np.nan, 0)))(image, image, None)


def test_the_last_output_of_full_size_is_taken(build: Build) -> None:
    nodes = [
        *DIFFERENCE,
        ("Add", ["flow", "one"], ["later"], {}),
        ("AveragePool", ["later"], ["small"], {"kernel_shape": [8, 8], "strides": [8, 8]}),
        ("Identity", ["d"], ["features"], {}),
    ]
    outputs = ["flow", "later", "small", "features"]
    path = build(nodes, outputs, {**SLICE, "one": np.ones(1, np.float32)})
    flow, _ = NetworkFlow(path)(flat(0, 0, 0), flat(0, 0, 0), None)
    np.testing.assert_array_equal(flow, 1)
    stacked = [*nodes, ("Concat", ["flow", "later"], ["all"], {"axis": 0})]
    path = build(stacked, ["all"], {**SLICE, "one": np.ones(1, np.float32)})
    np.testing.assert_array_equal(NetworkFlow(path)(flat(0, 0, 0), flat(0, 0, 0), None)[0], 1)


def test_free_sizes_are_padded_to_multiples_of_8_by_the_last_row_and_column(build: Build) -> None:
    # The mean over everything tells what was appended: of 53 columns the last, white, thrice.
    nodes = [
        *DIFFERENCE,
        ("Mul", ["flow", "none"], ["empty"], {}),
        ("Slice", ["b", "zero", "two", "axis"], ["pair"], {}),
        ("ReduceMean", ["pair"], ["mean"], {"axes": [2, 3], "keepdims": 1}),
        ("Add", ["empty", "mean"], ["k"], {}),
    ]
    path = build(nodes, ["k"], {**SLICE, "none": np.zeros(1, np.float32)})
    image = np.zeros((40, 53), np.uint8)
    image[:, -1] = 255
    flow, _ = NetworkFlow(path)(np.zeros_like(image), image, None)
    np.testing.assert_allclose(flow, 255 * 4 / 56, rtol=1e-5)


def test_a_fixed_size_is_resized_to_and_the_flow_back(build: Build) -> None:
    path = build(CONSTANT, ["k"], constant(2, 3), size=(20, 30))
    flow, _ = NetworkFlow(path)(flat(0, 0, 0, size=(60, 80)), flat(0, 0, 0, size=(60, 80)), None)
    assert flow.shape == (80, 60, 2)
    np.testing.assert_allclose(flow, np.broadcast_to([4, 12], flow.shape), rtol=1e-6)


def test_a_network_of_one_channel_gets_gray(build: Build) -> None:
    nodes = [("Sub", ["b", "a"], ["d"], {}), ("Concat", ["d", "d"], ["flow"], {"axis": 1})]
    path = build(nodes, ["flow"], channels=1)
    flow, _ = NetworkFlow(path)(flat(50, 50, 50), np.full((37, 53), 52, np.uint8), None)
    np.testing.assert_allclose(flow, 2, atol=1e-4)
    path.with_suffix(".yaml").write_text("mean: [1, 2, 3]\n")
    with pytest.raises(InputError, match=r"model\.yaml: mean and std.* the network has 1"):
        NetworkFlow(path)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[1, 2]", "expected keys and values"),
        ("{", "not YAML"),
        ("scale: 2", "unknown key 'scale', expected range, mean, std, flow_from"),
        ("range: 255", "range is 255, expected two numbers"),
        ("range: [0, high]", r"range is \[0, 'high'\], expected two numbers"),
        ("mean: [1, 2]", r"mean is \[1, 2\], expected one number or three"),
        ("std: [1, 0, 1]", r"std is \[1, 0, 1\], expected none that is 0"),
        ("std: .nan", "std is nan, expected one number or three"),
        ("flow_from: 0", "flow_from is 0, expected 1 or 2"),
    ],
)
def test_bad_yaml_is_named(build: Build, text: str, problem: str) -> None:
    path = build(DIFFERENCE, ["flow"], SLICE)
    path.with_suffix(".yaml").write_text(text)
    with pytest.raises(InputError, match=rf"model\.yaml: {problem}"):
        NetworkFlow(path)


def test_networks_of_another_kind_are_refused(build: Build, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.onnx: no such file"):
        NetworkFlow(tmp_path / "none.onnx")
    (tmp_path / "bad.onnx").write_bytes(b"not a graph")
    with pytest.raises(InputError, match=r"bad\.onnx: "):
        NetworkFlow(tmp_path / "bad.onnx")
    one = build([("Identity", ["a"], ["k"], {})], ["k"], inputs=("a",))
    with pytest.raises(InputError, match=r"model\.onnx: inputs are a; expected two images"):
        NetworkFlow(one)
    five = build([("Add", ["a", "b"], ["k"], {})], ["k"], channels=5)
    with pytest.raises(InputError, match=r"model\.onnx: input a is tensor\(float\) \[1, 5"):
        NetworkFlow(five)
    no_flow = build([("Add", ["a", "b"], ["k"], {})], ["k"])
    image = flat(0, 0, 0)
    with pytest.raises(InputError, match=r"outputs are \(1, 3, 40, 56\), expected"):
        NetworkFlow(no_flow)(image, image, None)
    with pytest.raises(InputError, match="warped image is 10x37, expected the reference's 53x37"):
        NetworkFlow(no_flow)(image, image[:, :10], None)
    with pytest.raises(InputError, match="flow tolerance is 0, expected above 0 px"):
        NetworkFlow(no_flow, tolerance=0)


def test_a_flow_network_runs_on_the_providers_named(
    build: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    import onnxruntime

    path, opened = build(DIFFERENCE, ["flow"], SLICE), []
    session = onnxruntime.InferenceSession

    def watched(*arguments: Any, providers: list[str]) -> Any:
        opened.append(providers)
        return session(*arguments, providers=["CPUExecutionProvider"])

    monkeypatch.setattr(onnxruntime, "InferenceSession", watched)
    names = ["CUDAExecutionProvider", "CPUExecutionProvider"]
    monkeypatch.setattr(onnxruntime, "get_available_providers", lambda: names)
    with pytest.raises(InputError, match=r"provider CUDAExecutionProvider cannot be started"):
        NetworkFlow(path, providers="cuda, cpu")
    NetworkFlow(path)
    assert opened == [names, names[1:]]
    with pytest.raises(InputError, match="provider 'tpu' is not available, expected cuda, cpu"):
        NetworkFlow(path, providers=("tpu",))


def test_raft_of_torchvision(tmp_path: Path) -> None:
    """RAFT with random weights, exported: twelve outputs, the last as PyTorch computes it."""
    torch = pytest.importorskip("torch", reason="needs the extra test-networks")
    models = pytest.importorskip(
        "torchvision.models.optical_flow", reason="needs the extra test-networks"
    )
    torch.manual_seed(0)
    raft = models.raft_small(weights=None).eval()
    path = tmp_path / "raft.onnx"
    blank = torch.zeros(1, 3, 128, 160)
    # The graph of the newer exporter, torch 2.13's, is not the network: it answers otherwise.
    torch.onnx.export(raft, (blank, blank), str(path), dynamo=False, opset_version=17)
    path.with_suffix(".yaml").write_text("range: [-1, 1]\n")

    gray = texture(160, 128)
    reference = np.dstack([gray, gray // 2, 255 - gray])
    warped = np.dstack([np.roll(gray, 3, axis=1), gray, gray // 3])
    network = NetworkFlow(path)
    flow, confidence = network(reference, warped, None)
    assert len(network._network.outputs) == 12

    def pixels(image: Image) -> Any:
        return torch.from_numpy(image[..., ::-1].transpose(2, 0, 1)[None] / np.float32(127.5) - 1)

    with torch.no_grad():
        expected = raft(pixels(reference), pixels(warped))[-1][0].numpy().transpose(1, 2, 0)
    np.testing.assert_allclose(flow, expected, rtol=1e-3, atol=1e-3 * np.abs(expected).max())
    assert np.ptp(expected) > 0.01  # it answers to its images
    assert confidence.shape == (128, 160)
