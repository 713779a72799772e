"""Slightly wrong calls: each ends in one line that says what it was and what was expected."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import xcalib
from xcalib import CalibrationOptions, Lens, Pinhole, Registrar, Rig, metrics

CAMERA = Pinhole(64, 48, 60.0, 60.0, 31.5, 23.5)
RIG = Rig(CAMERA, CAMERA, t=[0.1, 0, 0])
IMAGE = np.random.default_rng(0).integers(0, 255, (48, 64), np.uint8)
DEPTH = np.full((48, 64), 5, np.float32)
CODES = np.zeros((48, 64), np.uint8)
IMAGES, DEPTHS = [IMAGE] * 2, [DEPTH] * 2
REGISTRAR = Registrar(RIG, num_threads=1)
NONE: Any = None


def options_with(name: str, value: Any) -> Callable[[], None]:
    return lambda: setattr(CalibrationOptions(), name, value)


# What is called, and words of its message.
WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    # Names
    "misspelt argument": (
        lambda: xcalib.calibrate(references=IMAGES, sources=IMAGES, depth=DEPTHS),  # type: ignore
        "calibrate() has no argument 'depth', did you mean 'depths'?",
    ),
    "missing argument": (
        lambda: xcalib.calibrate(IMAGES, IMAGES),  # type: ignore[call-arg]
        "calibrate() lacks its argument 'depths', it takes references, sources, depths",
    ),
    "too many": (
        lambda: REGISTRAR.map(DEPTH, DEPTH),  # type: ignore[call-arg]
        "Registrar.map() was given 2 arguments, it takes depth",
    ),
    "twice": (
        lambda: REGISTRAR.map(DEPTH, depth=DEPTH),  # type: ignore[misc]
        "Registrar.map() was given 'depth' twice",
    ),
    "an option of the options": (
        lambda: xcalib.calibrate(IMAGES, IMAGES, DEPTHS, max_frames=4),  # type: ignore[call-arg]
        "has no argument 'max_frames', options=xcalib.CalibrationOptions(max_frames=4) has",
    ),
    "two numbers for three": (
        lambda: setattr(copy.deepcopy(RIG), "t", (1, 2)),
        "Rig.t is a tuple, expected as many numbers as it has",
    ),
    "half a thread": (
        lambda: Registrar(RIG, 2.5),  # type: ignore[arg-type]
        "num_threads is 2.5, expected a whole number",
    ),
    "paths to evaluate": (
        lambda: xcalib.evaluate(RIG, "visible", IMAGES, DEPTHS),  # type: ignore[arg-type]
        "evaluate(): references is the path 'visible', expected images; xcalib.footage.open_stream",
    ),
    "a path of a rig to evaluate": (
        lambda: xcalib.evaluate("rig.yaml", IMAGES, IMAGES, DEPTHS),  # type: ignore[arg-type]
        "evaluate(): rig is 'rig.yaml', expected an xcalib.Rig; xcalib.Rig.load reads one",
    ),
    "misspelt option": (
        lambda: CalibrationOptions(max_frame=8),
        "CalibrationOptions: unknown option 'max_frame', did you mean 'max_frames'?",
    ),
    "unknown option": (
        lambda: CalibrationOptions(zzz=8),
        "unknown option 'zzz', expected one of max_frames",
    ),
    # Values of options
    "text for a number": (
        options_with("max_frames", "8"),
        "CalibrationOptions.max_frames is '8', expected a whole number",
    ),
    "text in the constructor": (
        lambda: CalibrationOptions(max_frames="8"),
        "CalibrationOptions.max_frames is '8', expected a whole number",
    ),
    "a fraction": (
        options_with("max_frames", 8.5),
        "CalibrationOptions.max_frames is 8.5, expected a whole number",
    ),
    "below its range": (
        options_with("max_frames", 0),
        "max_frames = 0, expected at least 1",
    ),
    "beyond its type": (
        options_with("seed", -1),
        "CalibrationOptions.seed is -1, out of the range of its type",
    ),
    "no word": (options_with("solver", "ceress"), "solver is 'ceress', expected ceres or adam"),
    "no angle": (options_with("reference_hfov_deg", 200), "expected an angle in (0, 180) deg"),
    "a dict for search": (
        options_with("search", {"mode": "off"}),
        "expected an xcalib.SearchOptions; xcalib.SearchOptions(**options) makes one of a dict",
    ),
    "a search option": (
        lambda: setattr(CalibrationOptions().search, "max_fov_ratio", 0.5),
        "search.max_fov_ratio = 0.5, expected a ratio in (1, 10]",
    ),
    "a list for a camera": (
        options_with("reference_camera", [500, 500, 320, 240]),
        "CalibrationOptions.reference_camera is a list, expected an xcalib.Pinhole or None",
    ),
    "a list for a lens": (
        options_with("source_lens", [-0.3, 0.1, 0, 0]),
        "CalibrationOptions.source_lens is a list, expected an xcalib.Lens or None",
    ),
    "a dict for options": (
        lambda: xcalib.calibrate(IMAGES, IMAGES, DEPTHS, options={"seed": 1}),  # type: ignore
        "calibrate(): options is a dict, expected an xcalib.CalibrationOptions;"
        " xcalib.CalibrationOptions(**options)",
    ),
    # Rigs and cameras
    "a path for a rig": (
        lambda: Registrar("rig.yaml"),  # type: ignore[arg-type]
        "Registrar(): rig is 'rig.yaml', expected an xcalib.Rig; xcalib.Rig.load reads one",
    ),
    "a path to start from": (
        lambda: xcalib.calibrate(IMAGES, IMAGES, DEPTHS, Path("rig.yaml")),  # type: ignore
        "expected an xcalib.Rig or None; xcalib.Rig.load reads one",
    ),
    "a matrix for a camera": (
        lambda: Rig(CAMERA.K, CAMERA),  # type: ignore[arg-type]
        "Rig(): reference is an array of shape (3, 3) float64, expected an xcalib.Pinhole",
    ),
    "a number for a path": (lambda: Rig.load(3), "path is 3, expected a path"),  # type: ignore
    "a focal length": (
        lambda: setattr(Pinhole(64, 48, 60, 60, 31, 23), "fx", -1),
        "fx = -1, expected a finite number > 0",
    ),
    "half a pixel": (
        lambda: Pinhole(64.5, 48, 60, 60, 31, 23),  # type: ignore[arg-type]
        "Pinhole(): width is 64.5, expected a whole number",
    ),
    "a field of the rig": (
        lambda: setattr(RIG, "reference", RIG.reference.K),
        "Rig.reference is an array of shape (3, 3) float64, expected an xcalib.Pinhole",
    ),
    "a matrix in place": (lambda: RIG.R.__setitem__((0, 0), 2), "read-only"),
    "a vector in place": (lambda: RIG.t.__setitem__(0, 2), "read-only"),
    "an intrinsic in place": (lambda: CAMERA.K.__setitem__((0, 0), 2), "read-only"),
    "coefficients": (
        lambda: Lens("brown", "0.1"),  # type: ignore[arg-type]
        "Lens(): coefficients is '0.1', expected a list",
    ),
    # Images
    "nothing for an image": (
        lambda: REGISTRAR.register(NONE, DEPTH),
        "source is None, expected an array (H, W) or (H, W, 3) of uint8, uint16 or float32;"
        " cv2.imread returns None",
    ),
    "a path for an image": (
        lambda: REGISTRAR.register("a.png", DEPTH),  # type: ignore[arg-type]
        "source is the path 'a.png', expected an array",
    ),
    "alpha": (
        lambda: REGISTRAR.register(np.dstack([IMAGE] * 4), DEPTH),
        "source has shape (48, 64, 4) uint8, expected shape (H, W) or (H, W, 3);"
        " image[..., :3] drops the alpha channel",
    ),
    "whole numbers": (
        lambda: REGISTRAR.register(IMAGE.astype(np.int64), DEPTH),
        "source has shape (48, 64) int64, expected dtype uint8, uint16 or float32",
    ),
    "masked bytes": (
        lambda: REGISTRAR.register(np.ma.masked_greater(IMAGE, 100), DEPTH),
        "source has masked pixels and dtype uint8, which has no value for them",
    ),
    "another size": (lambda: REGISTRAR.register(IMAGE[:, :50], DEPTH), "50x48"),
    "nothing in a list": (
        lambda: xcalib.calibrate([IMAGE, NONE], IMAGES, DEPTHS),
        "reference frame 1 is None",
    ),
    "a folder for images": (
        lambda: xcalib.calibrate("visible", IMAGES, DEPTHS),  # type: ignore[arg-type]
        "references is the path 'visible', expected a list of images, one a frame;"
        " xcalib.footage.open_stream opens",
    ),
    "an image for images": (
        lambda: xcalib.calibrate(IMAGE, IMAGES, DEPTHS),  # type: ignore[arg-type]
        "references is one array of shape (48, 64) uint8, expected a list of images",
    ),
    "nothing for images": (
        lambda: xcalib.calibrate(NONE, IMAGES, DEPTHS),
        "references is None, expected a list of images",
    ),
    "a dict for images": (
        lambda: xcalib.calibrate({}, IMAGES, DEPTHS),  # type: ignore[arg-type]
        "references is a dict, expected a list of images",
    ),
    # Depth
    "counts for depth": (
        lambda: REGISTRAR.register(IMAGE, DEPTH.astype(np.uint16)),
        "depth has shape (48, 64) uint16, expected shape (h, w) float32 in metres; counts have no"
        " unit: Registrar(rig, depth_scale=1 / 256)",
    ),
    "a number for depth": (
        lambda: REGISTRAR.register(IMAGE, 5.0),  # type: ignore[arg-type]
        "depth has shape () float32, expected shape (h, w)",
    ),
    "a path for depth": (
        lambda: REGISTRAR.map(Path("depth.png")),  # type: ignore[arg-type]
        "depth is the path PosixPath('depth.png'), expected an array (h, w)",
    ),
    "colour for depth": (
        lambda: REGISTRAR.map(np.dstack([DEPTH] * 3)),
        "depth has shape (48, 64, 3) float32, expected shape (h, w)",
    ),
    # Metrics
    "the old mask": (
        lambda: metrics.nec(IMAGE, IMAGE, CODES == 0),
        "mask is bool, expected the registrar's: 0 where valid",
    ),
    "a mask of 255": (
        lambda: metrics.gc(IMAGE, IMAGE, CODES + np.uint8(255)),
        "mask has the value 255, expected the registrar's",
    ),
    "floats of 255": (
        lambda: metrics.psnr(IMAGE.astype(np.float32), IMAGE.astype(np.float32)),
        "expected values in [0, 1], or data_range",
    ),
    "frames of evaluate": (
        lambda: xcalib.evaluate(RIG, IMAGES, IMAGES, DEPTHS[:1]),
        "depths: 1 frames, fewer than of the others",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_call_is_told_in_one_line(name: str) -> None:
    call, words = WRONG[name]
    with pytest.raises((TypeError, ValueError)) as caught:
        call()
    message = str(caught.value)
    assert words in message
    assert "\n" not in message and len(message) < 350
    assert "incompatible" not in message and "Invoked with" not in message


def test_the_table_is_long() -> None:
    assert len(WRONG) >= 40


# -- What is taken as it comes


def test_arrays_of_other_kinds_are_the_same_images() -> None:
    image, mask = REGISTRAR.register(IMAGE.astype(np.float32), DEPTH)
    swapped = IMAGE.astype(np.float32).astype(">f4"), DEPTH.astype(">f8")
    halves = np.repeat(IMAGE, 2, axis=1)[:, ::2].astype(np.float64), DEPTH.astype(np.float16)
    for others in (swapped, halves):
        other, other_mask = REGISTRAR.register(*others)
        assert other.dtype == np.float32
        np.testing.assert_array_equal(other, image)
        np.testing.assert_array_equal(other_mask, mask)
    counts = IMAGE.astype(np.uint16) * 7
    np.testing.assert_array_equal(
        REGISTRAR.register(counts.astype(">u2"), DEPTH)[0], REGISTRAR.register(counts, DEPTH)[0]
    )


def test_what_is_masked_is_unknown() -> None:
    hidden = np.zeros(DEPTH.shape, bool)
    hidden[10:20, 10:20] = True
    _, mask = REGISTRAR.register(IMAGE, np.ma.array(DEPTH, mask=hidden))
    assert (mask[hidden] == 3).all() and (mask[~hidden] != 3).all()
    _, mask = REGISTRAR.register(np.ma.array(IMAGE.astype(np.float32), mask=hidden), DEPTH)
    assert (mask[12:18, 14:16] == 1).all()
    np.testing.assert_array_equal(
        REGISTRAR.register(np.ma.array(IMAGE), DEPTH)[0], REGISTRAR.register(IMAGE, DEPTH)[0]
    )


# -- Values that behave like values


def some_report() -> xcalib.CalibrationReport:
    rng = np.random.default_rng(3)
    images = [rng.integers(0, 255, (96, 128), np.uint8) for _ in range(2)]
    depths = [np.full((96, 128), 5, np.float32)] * 2
    options = CalibrationOptions(max_iterations=1, flow="off", num_threads=1)
    options.search.mode = "off"
    return xcalib.calibrate(images, images, depths, options=options).report


VALUES = {
    "Lens": Lens("brown", [-0.3, 0.1, 0.001, 0.002]),
    "Pinhole": Pinhole(64, 48, 60.1, 60.2, 31.3, 23.4, 0.1, Lens("fisheye", [0.1, 0, 0, 0])),
    "Rig": Rig(CAMERA, CAMERA, t=[0.1, -1 / 3, 1e-9]),
    "RelativeDepth": xcalib.RelativeDepth(0.1, 0.02),
    "SearchOptions": xcalib.SearchOptions(mode="local", max_roll_deg=7),
    "AdamOptions": xcalib.AdamOptions(epochs=3),
    "CalibrationOptions": CalibrationOptions(
        max_frames=8, reference_camera=CAMERA, mount="90", search=xcalib.SearchOptions(mode="off")
    ),
}


@pytest.mark.parametrize("name", VALUES)
def test_values_are_compared_copied_pickled_and_shown(name: str) -> None:
    value = VALUES[name]
    for other in (copy.copy(value), copy.deepcopy(value), pickle.loads(pickle.dumps(value))):
        assert other == value and other is not value and type(other) is type(value)
        assert repr(other) == repr(value)
    assert repr(value).startswith(name) and "object at 0x" not in repr(value)
    assert value != 3
    if name.endswith("Options"):
        assert value != type(value)()
        assert eval(repr(value), vars(xcalib)) == value  # what it says makes the same


def test_a_camera_of_a_matrix() -> None:
    lens = Lens("brown", [-0.3, 0.1, 0, 0])
    camera = Pinhole.from_K(64, 48, 2 * CAMERA.K, lens)  # of any scale, as homogeneous matrices are
    assert pytest.approx(CAMERA.K) == camera.K and camera.lens == lens
    with pytest.raises(ValueError, match="fx"):
        Pinhole.from_K(64, 48, np.diag([-1.0, 1, 1]))


def test_results_are_shown_in_a_line() -> None:
    result = xcalib.evaluate(RIG, IMAGES, IMAGES, DEPTHS)
    assert repr(result).startswith("Evaluation(2 frames, ") and "NEC" in repr(result)
    choice = xcalib.choose_frames(IMAGES, IMAGES, DEPTHS, 1, 0)
    assert "Choice(" in repr(choice)


def test_a_copy_is_changed_alone() -> None:
    rig = copy.deepcopy(RIG)
    rig.source.fx = 99
    rig.t = [1, 2, 3]
    assert RIG.source.fx == 60 and RIG.t[0] == 0.1 and rig != RIG


def test_a_report_is_a_value_too() -> None:
    report = some_report()
    other = pickle.loads(pickle.dumps(report))
    assert other == report and other.full() == report.full() and other.time == report.time
    assert "\n" not in repr(report) and len(repr(report)) < 2000
    np.testing.assert_array_equal(other.expected_error_map(5), report.expected_error_map(5))


def test_registrars_go_to_other_processes() -> None:
    other = pickle.loads(pickle.dumps(Registrar(RIG, 1, True, "hide", 0.001)))
    depth = np.full((48, 64), 5000, np.uint16)
    expected = Registrar(RIG, 1, True, "hide", 0.001).register(IMAGE, depth)
    for one, two in zip(other.register(IMAGE, depth), expected, strict=True):
        np.testing.assert_array_equal(one, two)


def test_a_notebook_shows_a_rig() -> None:
    html = RIG._repr_html_()
    assert html.count("<polygon") == 3 and "far away" in html
