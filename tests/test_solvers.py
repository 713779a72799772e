"""The flow term and the paper's solver, from Python and from the command line."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import xcalib
from conftest import run
from xcalib import (
    AdamOptions,
    CalibrationOptions,
    Pinhole,
    Rig,
    SearchOptions,
    _core,
    metrics,
    synthetic,
)

Floats = NDArray[np.float32]


@pytest.fixture(scope="module")
def truth() -> Rig:
    """Axes off by up to a tenth of the width, fields of view near the paper's start."""
    return synthetic.random_rig(
        1, 320, 240, 320, 256, hfov_deg=(41, 49), fov_ratio=(0.95, 1.05), max_offset=0.1
    )


@pytest.fixture(scope="module")
def frames(truth: Rig) -> list[synthetic.Frame]:
    return list(synthetic.render(truth, num_frames=4, seed=1))


def calibrate(
    frames: list[synthetic.Frame],
    provider: Any = None,
    initial: Rig | None = None,
    without: str | None = None,
    **options: Any,
) -> Any:
    """`xcalib.calibrate`, if need be with a part of the method off."""
    call = (
        partial(_core._calibrate, _core._Parts(**{without: False})) if without else xcalib.calibrate
    )
    return call(
        [frame.reference for frame in frames],
        [frame.source for frame in frames],
        [frame.depth for frame in frames],
        initial,
        options=CalibrationOptions(**options),
        flow=provider,
    )


def error(rig: Rig, truth: Rig, frames: list[synthetic.Frame]) -> float:
    maps = [metrics.end_point_error(rig, truth, frame.depth) for frame in frames]
    return float(np.nanmedian(np.stack(maps)))


def paper_start(truth: Rig) -> Rig:
    cameras = (
        Pinhole.from_hfov(camera.width, camera.height, 45)
        for camera in (truth.reference, truth.source)
    )
    return Rig(*cameras)


# -- The flow term -------------------------------------------------------------------------------


def test_flow_leads_to_the_rig_without_a_search(truth: Rig, frames: list[synthetic.Frame]) -> None:
    assert error(paper_start(truth), truth, frames) > 10
    result = calibrate(frames[:2], search=SearchOptions(mode="off"))
    assert error(result.rig, truth, frames) < 0.3


def test_a_provider_gives_the_flow(truth: Rig, frames: list[synthetic.Frame]) -> None:
    """One that knows the truth: where the paper's start puts things, and where they belong."""
    calls = []

    def constant(reference: Floats, warped: Floats, valid: NDArray[np.uint8]) -> Any:
        calls.append(reference.shape)
        assert reference.dtype == warped.dtype == np.float32
        assert reference.shape == warped.shape == valid.shape
        assert reference.min() >= 0 and reference.max() <= 1
        assert set(np.unique(valid)) <= {0, 1}
        flow = np.zeros((*reference.shape, 2), np.float64)
        flow[..., 0] = 10 * reference.shape[1] / 320
        return flow, np.ones(reference.shape)

    start = paper_start(truth)
    options = {"search": SearchOptions(mode="off"), "flow": "on", "flow_rounds": 1}
    pushed = calibrate(frames, constant, flow_weight=1e4, **options).rig
    assert len(calls) == 16  # four stages at levels, one round, four pairs
    # Five times over, the source is to be found 10 px further right, whatever edges say.
    centre = np.array([160.0, 120.0, 1.0])
    moved = pushed.infinite_homography @ centre
    before = start.infinite_homography @ centre
    assert moved[0] / moved[2] - before[0] / before[2] > 25


@pytest.mark.parametrize(
    ("returned", "problem"),
    [
        (None, "NoneType"),
        ((np.zeros((3, 3, 2)), np.zeros((3, 3))), r"flow of shape \(3, 3, 2\)"),
        ((np.zeros((120, 160, 2)), np.zeros((3, 3))), r"confidence of shape \(3, 3\)"),
    ],
)
def test_what_is_no_flow_is_refused(
    frames: list[synthetic.Frame], returned: Any, problem: str
) -> None:
    with pytest.raises(ValueError, match=rf"flow provider: expected .*160x120, got {problem}"):
        calibrate(frames, lambda *_: returned, search=SearchOptions(mode="off"))


def test_an_exception_of_the_provider_is_passed_on(frames: list[synthetic.Frame]) -> None:
    def broken(*_: Any) -> Any:
        raise ZeroDivisionError("of the provider")

    with pytest.raises(ZeroDivisionError, match="of the provider"):
        calibrate(frames[:2], broken)  # given, it is used
    calibrate(frames[:2], broken, flow="off", search=SearchOptions(mode="off"))  # not called


# -- Adam ----------------------------------------------------------------------------------------


def test_adam_comes_nearer_and_tells_its_losses(truth: Rig, frames: list[synthetic.Frame]) -> None:
    result = calibrate(frames[:2], solver="adam", adam=AdamOptions(epochs=12))
    start = error(paper_start(truth), truth, frames)
    assert error(result.rig, truth, frames) < 0.8 * start
    steps = result.report.steps
    assert len(steps) == 12
    assert steps[-1].flow < steps[0].flow
    assert steps[0].total == pytest.approx(steps[0].image + 2.5 * steps[0].flow)
    assert result.report.to_dict()["steps"][0]["image"] == steps[0].image
    assert [level.stage for level in result.report.levels] == [1, 2]
    assert result.report.candidates == []


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"search": SearchOptions(mode="full")}, "adam searches nothing"),
        ({"adam": {"epochs": 0}}, "adam.epochs = 0"),
        ({"adam": {"batch": 0}}, "adam.batch = 0"),
        ({"adam": {"learning_rate": 0.0}}, "adam.learning_rate = 0"),
        ({"adam": {"fine_learning_rate": -1.0}}, "adam.fine_learning_rate = -1"),
        ({"adam": {"decay": 1.1}}, "adam.decay = 1.1"),
        ({"adam": {"fine_from": 2.0}}, "adam.fine_from = 2"),
        ({"adam": {"translation_scales": 4}}, "adam.translation_scales = 4"),
        ({"flow_weight": 0.0}, "flow_weight = 0"),
        ({"flow_rounds": 0}, "flow_rounds = 0"),
    ],
)
def test_options_out_of_range(options: dict[str, Any], message: str) -> None:
    def make() -> None:
        schedule = {name: AdamOptions(**of) for name, of in options.items() if name == "adam"}
        CalibrationOptions(solver="adam", **(options | schedule))

    with pytest.raises(ValueError, match=message):
        make()


def test_words_of_the_options() -> None:
    options = CalibrationOptions()
    assert (options.flow, options.solver) == ("auto", "ceres")
    with pytest.raises(ValueError, match="flow is 'patch', expected auto, on or off"):
        CalibrationOptions(flow="patch")
    with pytest.raises(ValueError, match="solver is 'sgd', expected ceres or adam"):
        CalibrationOptions(solver="sgd")


# -- The command ---------------------------------------------------------------------------------


def arguments(scene: Path, *more: str) -> tuple[str | Path, ...]:
    return (
        *("calibrate", scene / "visible", scene / "thermal", "--depth", scene / "depth"),
        *("-o", scene / "out.yaml", "--report", scene / "report.json", "--frames", "2", *more),
    )


def test_the_solver_by_command(scene: Path) -> None:
    result = run(*arguments(scene, "--solver", "adam", "--flow", "off"))
    assert result.exit_code in (0, 3), result.output
    steps = json.loads((scene / "report.json").read_text())["steps"]
    assert len(steps) == 15
    assert all(step["flow"] == 0 for step in steps)


def test_a_network_of_flow_by_command(scene: Path) -> None:
    """A graph that takes what differs between the first two channels of both images for flow."""
    onnx = pytest.importorskip("onnx")
    helper, float32 = onnx.helper, onnx.TensorProto.FLOAT
    graph = helper.make_graph(
        [
            helper.make_node("Sub", ["b", "a"], ["difference"]),
            helper.make_node("Gather", ["difference", "two"], ["flow"], axis=1),
        ],
        "flow",
        [helper.make_tensor_value_info(name, float32, [1, 3, "H", "W"]) for name in ("a", "b")],
        [helper.make_tensor_value_info("flow", float32, [1, 2, "H", "W"])],
        [onnx.numpy_helper.from_array(np.int64([0, 1]), "two")],
    )
    opset = [helper.make_opsetid("", 17)]
    onnx.save(helper.make_model(graph, opset_imports=opset, ir_version=8), scene / "flow.onnx")
    (scene / "flow.yaml").write_text("range: [0, 20]\n")
    result = run(*arguments(scene, "--flow", str(scene / "flow.onnx"), "--solver", "adam"))
    assert result.exit_code in (0, 3), result.output
    steps = json.loads((scene / "report.json").read_text())["steps"]
    assert any(step["flow"] > 0 for step in steps)


@pytest.mark.parametrize(
    ("more", "named"),
    [
        (("--flow", "raft.pt"), "'raft.pt', expected auto, off, patch or a .onnx file"),
        (("--flow", "/nowhere/raft.onnx"), "/nowhere/raft.onnx"),
        (("--solver", "adam", "--search", "full"), "adam searches nothing"),
    ],
)
def test_bad_options(scene: Path, more: tuple[str, ...], named: str) -> None:
    result = run(*arguments(scene, *more))
    assert result.exit_code == 2
    assert named in result.stderr
    assert not (scene / "out.yaml").exists()


# -- Parts of the method off, for ablation studies -------------------------------------------------


@pytest.mark.parametrize(
    ("part", "steps"),
    [
        ("pyramid", {(1, 1), (1, 2)}),
        ("stages", {(4, 2), (2, 2), (1, 2)}),
    ],
)
def test_a_schedule_without_a_part(
    frames: list[synthetic.Frame], part: str, steps: set[tuple[int, int]]
) -> None:
    result = calibrate(frames[:2], without=part, search=SearchOptions(candidates=1))
    assert {(level.factor, level.stage) for level in result.report.levels} == steps


def test_without_images_and_flow_a_rig_stays_as_it_was_given(
    truth: Rig, frames: list[synthetic.Frame]
) -> None:
    result = calibrate(
        frames[:2], initial=truth, without="images", search=SearchOptions(mode="off"), flow="off"
    )
    assert error(result.rig, truth, frames) < 1e-6
