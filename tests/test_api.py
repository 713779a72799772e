"""The Python API: what it accepts, what it refuses and how, and one rig from end to end."""

from __future__ import annotations

import errno
import threading
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import xcalib
from xcalib import (
    CalibrationOptions,
    Pinhole,
    Registrar,
    Rig,
    SearchOptions,
    _core,
    metrics,
    synthetic,
)

Array = NDArray[Any]
WIDTH, HEIGHT, FRAMES = 320, 240, 6


def rotation(x: float, y: float, z: float) -> Array:
    """R = Rz Ry Rx [rad]."""
    cx, sx, cy, sy, cz, sz = np.cos(x), np.sin(x), np.cos(y), np.sin(y), np.cos(z), np.sin(z)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x)


def some_rig(width: int = 64, height: int = 48) -> Rig:
    reference = Pinhole(width, height, 0.9 * width, 0.91 * width, 0.5 * width, 0.48 * height, 0.3)
    source = Pinhole.from_hfov(width - 8, height - 6, 60)
    return Rig(reference, source, rotation(0.02, -0.03, 0.05), [-0.1, 0.02, 0.03])


def mapped(rig: Rig, depth: Array) -> Array:
    """Eq. (3d_mapping), (H, W, 2) float64, NaN where the depth is unknown."""
    y, x = np.mgrid[: depth.shape[0], : depth.shape[1]]
    ones = np.ones_like(x)
    rays = np.stack([x, y, ones], -1) @ np.linalg.inv(rig.reference.K).T
    known = np.where(np.isfinite(depth) & (depth > 0), depth, np.nan).astype(np.float64)
    points = (known[..., None] * rays) @ rig.R.T + rig.t
    pixels = points @ rig.source.K.T
    return np.asarray(pixels[..., :2] / pixels[..., 2:])


# --- Cameras and rigs -----------------------------------------------------------------------------


def test_a_pinhole_is_what_it_was_given() -> None:
    camera = Pinhole(640, 480, 500.0, 510.0, 320.5, 239.5, 1.5)
    assert (camera.width, camera.height, camera.skew) == (640, 480, 1.5)
    np.testing.assert_array_equal(camera.K, [[500, 1.5, 320.5], [0, 510, 239.5], [0, 0, 1]])
    assert camera.K.dtype == np.float64
    assert camera.hfov_deg == pytest.approx(np.degrees(2 * np.arctan(0.64)))
    assert camera.vfov_deg == pytest.approx(np.degrees(2 * np.arctan(240 / 510)))
    assert "fx=500" in repr(camera)


def test_a_pinhole_of_a_field_of_view() -> None:
    camera = Pinhole.from_hfov(640, 480, 90)
    assert camera.fx == pytest.approx(320) and camera.fy == camera.fx
    assert (camera.cx, camera.cy) == (319.5, 239.5)
    half = camera.resized(320, 240)
    assert (half.cx, half.cy, half.fx) == (159.5, 119.5, pytest.approx(160))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"width": 0}, "width = 0"),
        ({"height": -1}, "height = -1"),
        ({"fx": 0.0}, "fx = 0, expected a finite number > 0"),
        ({"fy": float("nan")}, "fy = nan"),
        ({"cx": float("inf")}, "cx = inf"),
        ({"skew": float("nan")}, "skew = nan"),
    ],
    ids=str,
)
def test_impossible_pinholes_are_refused(changed: dict[str, Any], message: str) -> None:
    good = {"width": 64, "height": 48, "fx": 60.0, "fy": 60.0, "cx": 32.0, "cy": 24.0}
    with pytest.raises(ValueError, match=message):
        Pinhole(**(good | changed))


def test_impossible_fields_of_view_are_refused() -> None:
    for hfov in (0, 180, -10, float("nan")):
        with pytest.raises(ValueError, match="hfov"):
            Pinhole.from_hfov(64, 48, hfov)


def test_a_rig_is_what_it_was_given() -> None:
    rig = some_rig()
    np.testing.assert_allclose(rig.R, rotation(0.02, -0.03, 0.05), atol=1e-14)
    np.testing.assert_array_equal(rig.t, [-0.1, 0.02, 0.03])
    assert rig.R.shape == (3, 3) and rig.t.shape == (3,)
    assert np.linalg.norm(rig.quaternion_wxyz) == pytest.approx(1)
    expected = rig.source.K @ rig.R @ np.linalg.inv(rig.reference.K)
    np.testing.assert_allclose(rig.infinite_homography, expected, atol=1e-12)
    plain = Rig(rig.reference, rig.source)
    np.testing.assert_array_equal(plain.R, np.eye(3))
    np.testing.assert_array_equal(plain.t, np.zeros(3))


def test_the_pose_of_a_rig_may_be_set() -> None:
    rig = some_rig()
    rig.R = rotation(0.1, 0.2, 0.3)
    rig.t = [1, 2, 3]
    np.testing.assert_allclose(rig.R, rotation(0.1, 0.2, 0.3), atol=1e-14)
    np.testing.assert_array_equal(rig.t, [1, 2, 3])
    rig.source.fx = 99.0
    assert rig.source.fx == 99


@pytest.mark.parametrize(
    "R", [2 * np.eye(3), np.diag([1.0, 1, -1]), np.ones((3, 3)), np.full((3, 3), np.nan)], ids=str
)
def test_what_is_not_a_rotation_is_refused(R: Array) -> None:
    rig = some_rig()
    with pytest.raises(ValueError, match="rotation"):
        Rig(rig.reference, rig.source, R)
    with pytest.raises(ValueError, match="rotation"):
        rig.R = R
    np.testing.assert_allclose(rig.R, rotation(0.02, -0.03, 0.05), atol=1e-14)


def test_wrong_shapes_of_a_pose_are_errors() -> None:
    rig = some_rig()
    for R in (np.eye(2), np.zeros(3), np.eye(4)):
        with pytest.raises(ValueError, match="R"):
            Rig(rig.reference, rig.source, R)
    for t in ([1, 2], np.zeros((3, 3)), [0, 0, 0, 1]):
        with pytest.raises(ValueError, match="t"):
            Rig(rig.reference, rig.source, None, t)
    with pytest.raises(ValueError, match="translation = nan"):
        Rig(rig.reference, rig.source, None, [0, np.nan, 0])


# --- The rig file ---------------------------------------------------------------------------------


def test_a_rig_comes_back_from_its_file_bit_by_bit(tmp_path: Path) -> None:
    rig, path = some_rig(), tmp_path / "rig.yaml"
    rig.save(path)
    for back in (Rig.load(path), Rig.load(str(path))):
        np.testing.assert_array_equal(back.quaternion_wxyz, rig.quaternion_wxyz)
        np.testing.assert_array_equal(back.t, rig.t)
        np.testing.assert_array_equal(back.reference.K, rig.reference.K)
        np.testing.assert_array_equal(back.source.K, rig.source.K)
        assert (back.source.width, back.source.height) == (56, 42)
    assert [entry.name for entry in tmp_path.iterdir()] == ["rig.yaml"]


def test_a_missing_rig_file_is_not_found(tmp_path: Path) -> None:
    path = tmp_path / "missing.yaml"
    with pytest.raises(FileNotFoundError) as caught:
        Rig.load(path)
    assert caught.value.filename == str(path) and caught.value.errno == errno.ENOENT


def test_a_folder_is_not_a_rig_file(tmp_path: Path) -> None:
    with pytest.raises(IsADirectoryError) as caught:
        Rig.load(tmp_path)
    assert caught.value.filename == str(tmp_path)


def test_a_path_with_a_colon_is_named_whole(tmp_path: Path) -> None:
    path = tmp_path / "a: b.yaml"
    with pytest.raises(FileNotFoundError) as caught:
        Rig.load(path)
    assert caught.value.filename == str(path)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("version: 1", "version: 3", "version"),
        ("  skew: 0.3", "  squint: 0.3", "squint"),
        ("  fx: 57.6\n", "", "fx"),
        ("  fx: 57.6", "  fx: .inf", "fx"),
        ("format: xcalib-rig", "format: rig", "format"),
    ],
)
def test_a_spoilt_rig_file_is_a_value_error(tmp_path: Path, old: str, new: str, named: str) -> None:
    path = tmp_path / "rig.yaml"
    some_rig().save(path)
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(ValueError, match=named) as caught:
        Rig.load(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("content", ["", "hello", "[1, 2", "{}", "\0\1\2"], ids=repr)
def test_what_is_not_a_rig_file_is_a_value_error(tmp_path: Path, content: str) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(content)
    with pytest.raises(ValueError, match=r"rig\.yaml"):
        Rig.load(path)


def test_saving_into_a_missing_folder_leaves_nothing(tmp_path: Path) -> None:
    path = tmp_path / "missing" / "rig.yaml"
    with pytest.raises(FileNotFoundError) as caught:
        some_rig().save(path)
    assert caught.value.filename == str(path)
    assert list(tmp_path.iterdir()) == []


# --- Options --------------------------------------------------------------------------------------


def test_options_are_set_by_keyword() -> None:
    options = CalibrationOptions(
        max_frames=4, seed=7, reference_hfov_deg=50.0, search=SearchOptions(mode="off")
    )
    assert (options.max_frames, options.seed, options.reference_hfov_deg) == (4, 7, 50)
    assert options.search.mode == "off"
    assert CalibrationOptions().max_frames == 32
    assert CalibrationOptions().reference_camera is None
    options.search.mode = "full"
    assert options.search.mode == "full"
    options.validate()


def test_unknown_options_are_errors() -> None:
    with pytest.raises(TypeError, match="unknown option 'max_frame'"):
        CalibrationOptions(max_frame=4)
    with pytest.raises(TypeError, match="unknown option 'modus'"):
        SearchOptions(modus="off")
    with pytest.raises((TypeError, AttributeError), match="validate"):
        CalibrationOptions(validate=None)
    with pytest.raises(TypeError):
        CalibrationOptions(4)
    options = CalibrationOptions()
    with pytest.raises(AttributeError):
        options.max_frame = 4


def test_options_of_the_wrong_type_are_errors() -> None:
    with pytest.raises(TypeError):
        CalibrationOptions(max_frames="many")
    with pytest.raises(
        ValueError, match="search mode is 'fast', expected auto, full, local or off"
    ):
        SearchOptions(mode="fast")


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"max_frames": 0}, "max_frames = 0, expected at least 1"),
        ({"num_threads": -1}, "num_threads = -1"),
        ({"working_width": 3}, "working_width = 3"),
        ({"prior_weight": -1.5}, "prior_weight = -1.5"),
        ({"reference_hfov_deg": 200.0}, "reference_hfov_deg = 200"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_values_are_checked_when_they_are_set(changed: dict[str, Any], message: str) -> None:
    options = CalibrationOptions()
    for name, value in changed.items():
        with pytest.raises(ValueError, match=message):
            CalibrationOptions(**changed)
        with pytest.raises(ValueError, match=message):
            setattr(options, name, value)
    assert options == CalibrationOptions()


def test_values_of_the_search_are_checked() -> None:
    for name, value in (("min_overlap", 0.0), ("candidates", 0)):
        with pytest.raises(ValueError, match=f"search.{name} = 0, expected"):
            SearchOptions(**{name: value})


def test_draw_frames() -> None:
    assert _core.draw_frames(3, 32, 0) == [0, 1, 2]
    chosen = _core.draw_frames(100, 10, seed=5)
    assert [index // 10 for index in chosen] == list(range(10))
    assert chosen == _core.draw_frames(100, 10, seed=5) != _core.draw_frames(100, 10, seed=6)


# --- The registrar --------------------------------------------------------------------------------


def some_depth(shape: tuple[int, int] = (48, 64)) -> Array:
    depth = np.random.default_rng(1).uniform(2, 20, shape).astype(np.float32)
    depth[5, 5:9] = 0, np.nan, np.inf, -1
    return depth


def test_map_is_the_equation_of_the_paper() -> None:
    rig, depth = some_rig(), some_depth()
    found = Registrar(rig, occlusion="ignore").map(depth)
    assert found.shape == (48, 64, 2) and found.dtype == np.float32
    expected = mapped(rig, depth)
    inside = (expected > 1e-3).all(-1) & (expected < (55 - 1e-3, 41 - 1e-3)).all(-1)
    assert 0.5 < inside.mean() < 1
    np.testing.assert_allclose(found[inside], expected[inside], atol=1e-3)
    assert np.isnan(found[5, 5:9]).all()
    outside = (expected < -1e-3).any(-1) | (expected > (55 + 1e-3, 41 + 1e-3)).any(-1)
    assert np.isnan(found[outside]).all()


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("channels", [(), (1,), (3,)], ids=str)
def test_register_keeps_type_and_channels(
    dtype: type[np.generic], channels: tuple[int, ...]
) -> None:
    rig, depth = some_rig(), some_depth()
    rng = np.random.default_rng(2)
    source = rng.uniform(0, 200, (42, 56, *channels)).astype(dtype)
    registrar = Registrar(rig, occlusion="hide")
    image, mask = registrar.register(source, depth)
    assert (mask == 2).any()  # of depths drawn at random
    assert image.dtype == dtype and image.shape == (48, 64, *channels)
    assert mask.dtype == np.uint8 and mask.shape == (48, 64)
    assert (mask[5, 5:9] == 3).all() and set(np.unique(mask)) == {0, 1, 2, 3}
    places = registrar.map(depth)
    np.testing.assert_array_equal(mask == 0, np.isfinite(places).all(-1))
    assert not image[mask != 0].any()
    x, y = np.moveaxis(places[mask == 0].astype(np.float64), -1, 0)
    x0, y0 = np.minimum(x.astype(int), 54), np.minimum(y.astype(int), 40)
    a, b = (x - x0), (y - y0)
    if channels:
        a, b = a[:, None], b[:, None]
    s = source.astype(np.float64)
    expected = (1 - b) * ((1 - a) * s[y0, x0] + a * s[y0, x0 + 1]) + b * (
        (1 - a) * s[y0 + 1, x0] + a * s[y0 + 1, x0 + 1]
    )
    tolerance = 0.501 if np.issubdtype(dtype, np.integer) else 1e-3
    np.testing.assert_allclose(image[mask == 0], expected, atol=tolerance)


def test_inputs_need_not_be_contiguous_and_depth_may_be_float64() -> None:
    registrar = Registrar(some_rig())
    rng = np.random.default_rng(3)
    big, deep = rng.integers(0, 256, (84, 112, 3), np.uint8), some_depth((96, 128))
    source, depth = big[::2, ::2], deep[::2, ::2]
    assert not source.flags.c_contiguous and not depth.flags.c_contiguous
    image, mask = registrar.register(source.copy(), depth.copy())
    others = [(source, depth), (np.asfortranarray(source), np.asfortranarray(depth))]
    others += [(source, depth.astype(np.float64)), (source[..., ::-1][..., ::-1], depth)]
    others += [(source.copy()[::-1][::-1], depth)]
    for other_source, other_depth in others:
        other_image, other_mask = registrar.register(other_source, other_depth)
        np.testing.assert_array_equal(other_image, image)
        np.testing.assert_array_equal(other_mask, mask)
    np.testing.assert_array_equal(registrar.map(depth.astype(np.float64)), registrar.map(depth))


def test_results_may_go_to_arrays_of_the_caller() -> None:
    registrar, depth = Registrar(some_rig()), some_depth()
    source = np.random.default_rng(6).integers(0, 256, (42, 56, 3), np.uint8)
    image, mask = registrar.register(source, depth)
    out, codes = np.full_like(image, 77), np.full_like(mask, 77)
    found = registrar.register(source, depth, out=out, mask=codes)
    assert found[0] is out and found[1] is codes
    np.testing.assert_array_equal(out, image)
    np.testing.assert_array_equal(codes, mask)
    with pytest.raises(
        ValueError, match=r"out has shape \(48, 64\) uint8, expected shape \(48, 64, 3"
    ):
        registrar.register(source, depth, out=codes)
    with pytest.raises(ValueError, match=r"mask has shape \(48, 64\) float32, expected .* uint8"):
        registrar.register(source, depth, mask=depth)
    with pytest.raises(ValueError, match=r"out has .*contiguous, aligned and writeable"):
        registrar.register(source, depth, out=np.empty((48, 64, 6), np.uint8)[..., ::2])
    out.flags.writeable = False
    with pytest.raises(ValueError, match=r"out has .*contiguous, aligned and writeable"):
        registrar.register(source, depth, out=out)
    with pytest.raises(ValueError, match="mask is not a numpy array"):
        registrar.register(source, depth, mask=[0])


def test_results_may_not_go_to_what_is_read() -> None:
    pinhole = Pinhole.from_hfov(64, 48, 45)
    registrar, depth = Registrar(Rig(pinhole, pinhole)), some_depth()
    source = np.random.default_rng(6).integers(0, 256, (48, 64), np.uint8)
    for name, other, arrays in [
        ("out", "source", {"out": source}),
        ("mask", "source", {"mask": source}),
        ("mask", "depth", {"mask": depth.view(np.uint8).reshape(-1, 64)[48:96]}),
        ("out", "mask", dict.fromkeys(("out", "mask"), np.empty_like(source))),
    ]:
        with pytest.raises(ValueError, match=f"{name} overlaps {other}, expected memory of its"):
            registrar.register(source, depth, **arrays)
    both = np.empty((96, 64), np.uint8)  # side by side is fine
    registrar.register(source, depth, out=both[:48], mask=both[48:])


def test_numbers_need_not_be_aligned_where_they_are_read() -> None:
    registrar, depth = Registrar(some_rig()), some_depth()
    source = np.random.default_rng(8).integers(0, 65536, (42, 56), np.uint16)
    image, mask = registrar.register(source, depth)

    def odd(array: np.ndarray) -> np.ndarray:
        return np.frombuffer(bytearray(b"?" + array.tobytes()), array.dtype, offset=1).reshape(
            array.shape
        )

    found = registrar.register(odd(source), odd(depth))
    np.testing.assert_array_equal(found[0], image)
    np.testing.assert_array_equal(found[1], mask)
    with pytest.raises(ValueError, match=r"out has .*contiguous, aligned and writeable"):
        registrar.register(source, depth, out=odd(image))


def test_integer_depth_needs_its_unit() -> None:
    rig = some_rig()
    units = np.random.default_rng(7).integers(0, 5000, (48, 64), np.uint16)
    metres = units.astype(np.float32) / 256
    source = np.random.default_rng(8).random((42, 56), np.float32)
    image, mask = Registrar(rig).register(source, metres)
    for depth in (units, metres):  # metres stay metres
        other_image, other_mask = Registrar(rig, depth_scale=1 / 256).register(source, depth)
        np.testing.assert_array_equal(other_image, image)
        np.testing.assert_array_equal(other_mask, mask)
    with pytest.raises(ValueError, match=r"depth has shape .* uint16, expected .* metres"):
        Registrar(rig).register(source, units)
    with pytest.raises(ValueError, match=r"depth has shape .* int32, expected .* metres"):
        Registrar(rig, depth_scale=0.01).register(source, units.astype(np.int32))
    for scale in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(ValueError, match="depth_scale is"):
            Registrar(rig, depth_scale=scale)
    small = units[::2, ::2].copy()
    np.testing.assert_allclose(
        Registrar(rig, depth_scale=1 / 256).map(small),
        Registrar(rig).map(small.astype(np.float32) / 256),
        atol=1e-4,
    )


@pytest.mark.parametrize("t", [(-0.15, 0.01, 0.02), (0.01, 0.15, -0.02)], ids=["right", "above"])
def test_occlusion_is_what_the_rays_of_a_rendered_street_say(t: tuple[float, ...]) -> None:
    """A street has many hidden strips thinner than a pixel of its depth map, which it cannot
    show. Where it can, a pixel's neighbours are hidden as well."""
    cameras = Pinhole.from_hfov(1280, 960, 50), Pinhole.from_hfov(640, 512, 48)
    street = synthetic.Street(Rig(*cameras, t=t), 3, seed=0)
    _, depth = street.render_view(1, "visible", "reference")
    depth = depth.astype(np.float32)
    source = np.ones((512, 640), np.uint8)
    _, mask = Registrar(street.rig).register(source, depth)
    _, seen = Registrar(street.rig, occlusion="ignore").register(source, depth)
    np.testing.assert_array_equal(mask[mask != 2], seen[mask != 2])
    known = seen == 0
    hidden = street.occluded(1) & known
    clear = cv2.erode(hidden.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    assert clear.sum() > 1000
    assert (mask[clear] == 2).mean() > 0.97
    assert (mask[hidden] == 2).mean() > 0.8
    assert (mask[known & ~hidden] == 2).mean() < 0.005


def test_the_number_of_threads_has_no_say() -> None:
    rig, depth = some_rig(), some_depth()
    source = np.random.default_rng(4).integers(0, 65536, (42, 56), np.uint16)
    image, mask = Registrar(rig, num_threads=1).register(source, depth)
    for threads in (0, 2, 3, 100):
        other_image, other_mask = Registrar(rig, threads).register(source, depth)
        np.testing.assert_array_equal(other_image, image)
        np.testing.assert_array_equal(other_mask, mask)


def test_the_registrar_refuses_what_does_not_fit() -> None:
    registrar = Registrar(some_rig())
    source, depth = np.zeros((42, 56), np.uint8), some_depth()
    with pytest.raises(ValueError, match="source is 42x56, expected the rig's 56x42"):
        registrar.register(source.T, depth)
    with pytest.raises(ValueError, match="depth is 64x60, expected the aspect of 64x48"):
        registrar.register(source, np.ones((60, 64), np.float32))
    with pytest.raises(ValueError, match=r"source has shape \(42, 56\) int64.*uint8"):
        registrar.register(source.astype(np.int64), depth)
    with pytest.raises(ValueError, match=r"source has shape \(42, 56, 4\)"):
        registrar.register(np.zeros((42, 56, 4), np.uint8), depth)
    with pytest.raises(ValueError, match=r"depth has shape \(48, 64\) uint16.*float32 in metres"):
        registrar.map(np.ones((48, 64), np.uint16))
    with pytest.raises(ValueError, match=r"depth has shape \(48, 64, 1\)"):
        registrar.map(depth[..., None])
    with pytest.raises(ValueError, match="num_threads is -1"):
        Registrar(some_rig(), num_threads=-1)
    with pytest.raises(ValueError, match="Pinhole: fx = -1"):
        some_rig().source.fx = -1.0


def test_a_registrars_rig_is_a_copy() -> None:
    rig = some_rig()
    registrar = Registrar(rig)
    rig.source.fx = 1.0
    registrar.rig.source.fx = 2.0
    assert registrar.rig.source.fx == some_rig().source.fx


# --- Calibration: what it refuses -----------------------------------------------------------------


def footage(count: int = 3) -> tuple[list[Array], list[Array], list[Array]]:
    """Images with edges, small; no calibration would come out of them."""
    rng = np.random.default_rng(5)
    references = [rng.integers(0, 256, (48, 64, 3), np.uint8) for _ in range(count)]
    sources = [rng.integers(0, 256, (42, 56), np.uint8) for _ in range(count)]
    depths = [np.full((24, 32), 5, np.float32) for _ in range(count)]
    return references, sources, depths


def refused(*lists: list[Array], **options: Any) -> str:
    with pytest.raises(ValueError, match="expected") as caught:
        xcalib.calibrate(*lists, options=CalibrationOptions(**options))
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_unequal_numbers_of_frames_are_refused() -> None:
    references, sources, depths = footage()
    message = refused(references, sources[:2], depths)
    assert "3 references, 2 sources and 3 depth maps" in message
    assert "at least 1" in refused([], [], [])


def test_wrong_types_are_refused_by_frame() -> None:
    references, sources, depths = footage()
    references[1] = references[1].astype(np.int32)
    assert "reference frame 1 has shape (48, 64, 3) int32" in refused(references, sources, depths)
    references, sources, depths = footage()
    sources[2] = sources[2].astype(np.int32)
    assert "source frame 2 has shape (42, 56) int32" in refused(references, sources, depths)
    references, sources, depths = footage()
    depths[0] = depths[0].astype(np.uint16)
    assert "depth frame 0 has shape (24, 32) uint16" in refused(references, sources, depths)
    references, sources, depths = footage()
    references[0] = np.zeros(7, np.uint8)
    assert "reference frame 0 has shape (7) uint8" in refused(references, sources, depths)


def test_unusable_frames_are_named() -> None:
    references, sources, depths = footage()
    sources[1][:] = 77
    message = refused(references, sources, depths)
    assert "source frame 1" in message and "constant" in message

    references, sources, depths = footage()
    depths[2][:] = np.nan
    message = refused(references, sources, depths)
    assert "depth frame 2" in message and "no depth is known" in message

    references, sources, depths = footage()
    depths[1] = np.ones((32, 32), np.float32)
    message = refused(references, sources, depths)
    assert "depth frame 1" in message and "32x32" in message and "64x48" in message

    references, sources, depths = footage()
    references[1] = references[1][:, :-1]
    assert "reference frame 1 is 63x48, expected 64x48" in refused(references, sources, depths)

    references, sources, depths = footage()
    sources[2] = np.full_like(sources[2], np.nan, np.float32)
    assert "source frame 2" in refused(references, sources, depths)


def test_a_frame_that_is_not_chosen_is_checked_too() -> None:
    references, sources, depths = footage(8)
    chosen = _core.draw_frames(8, 2, 0)
    unused = next(i for i in range(8) if i not in chosen)
    sources[unused] = sources[unused][:-1]
    assert f"source frame {unused}" in refused(references, sources, depths, max_frames=2)


def test_bad_options_and_a_bad_initial_rig_are_refused() -> None:
    lists = footage()
    assert "max_frames = 0" in refused(*lists, max_frames=0)
    with pytest.raises(ValueError, match="Pinhole: fx = nan"):
        some_rig().source.fx = float("nan")


def test_cameras_of_another_size_than_the_images_are_refused() -> None:
    lists = footage()  # 64x48 and 56x42
    wide = Pinhole.from_hfov(100, 48, 60)
    assert "reference_camera" in refused(*lists, reference_camera=wide)
    assert "source_camera" in refused(*lists, source_camera=wide)
    with pytest.raises(ValueError, match=r"100x48.*64x48"):
        xcalib.calibrate(*lists, initial=Rig(wide, Pinhole.from_hfov(56, 42, 60)))
    with pytest.raises(ValueError, match=r"100x48.*56x42"):
        xcalib.calibrate(*lists, initial=Rig(Pinhole.from_hfov(64, 48, 60), wide))


# --- Calibration: one rig from end to end ---------------------------------------------------------


@pytest.fixture(scope="module")
def truth() -> Rig:
    return synthetic.demo_rig().resized(WIDTH, HEIGHT, 320, 256)


@pytest.fixture(scope="module")
def frames(truth: Rig) -> list[synthetic.Frame]:
    return list(synthetic.render(truth, num_frames=FRAMES, seed=1))


def lists_of(frames: list[synthetic.Frame]) -> tuple[list[Array], list[Array], list[Array]]:
    return [f.reference for f in frames], [f.source for f in frames], [f.depth for f in frames]


@pytest.fixture(scope="module")
def reported() -> list[tuple[str, float]]:
    return []


@pytest.fixture(scope="module")
def result(
    frames: list[synthetic.Frame], reported: list[tuple[str, float]]
) -> xcalib.CalibrationResult:
    return xcalib.calibrate(
        *lists_of(frames), progress=lambda stage, share: reported.append((stage, share))
    )


def test_a_rendered_rig_is_found(
    result: xcalib.CalibrationResult, truth: Rig, frames: list[synthetic.Frame]
) -> None:
    errors = [metrics.end_point_error(result.rig, truth, frame.depth) for frame in frames]
    assert np.nanmedian(errors) < 0.5
    assert result.converged and result.report.converged


def test_the_report_is_complete(result: xcalib.CalibrationResult) -> None:
    report = result.report
    assert report.message and "\n" not in report.message
    assert report.frames == list(range(FRAMES))
    assert (report.working_width, report.working_height) == (WIDTH, HEIGHT)
    assert 0 < report.baseline_nec < report.nec < 1
    assert 0 < report.valid_share <= 1
    time = report.time
    assert set(time) == {"prepare", "search", "warp", "value", "jacobian", "solver"}
    assert min(time.values()) > 0 and sum(time.values()) < 1.05 * report.seconds
    assert report.candidates and report.levels
    assert {level.stage for level in report.levels} == {1, 2}
    for level in report.levels:
        assert level.final_cost <= level.initial_cost * (1 + 1e-9)
        assert level.iterations >= 1 and level.condition_number >= 1 and level.stopped
    assert report.levels[-1].factor == 1 and report.levels[-1].stage == 2
    plain = report.to_dict()
    assert len(plain["levels"]) == len(report.levels) and plain["frames"] == report.frames
    assert "\n" not in report.brief() and report.brief() in report.full()


def test_progress_is_told_in_order(
    result: xcalib.CalibrationResult, reported: list[tuple[str, float]]
) -> None:
    assert len(reported) >= 5
    shares = [share for _, share in reported]
    assert shares == sorted(shares)
    assert 0 <= shares[0] < 0.2 and shares[-1] == pytest.approx(1)
    stages = [stage for stage, _ in reported]
    assert sorted(set(stages), key=stages.index) == ["prepare", "search", "refine", "judge"]


def test_a_seed_gives_the_same_rig_again(
    frames: list[synthetic.Frame],
) -> None:
    options = CalibrationOptions(max_frames=2, seed=3, working_width=160)
    one, other = (xcalib.calibrate(*lists_of(frames), options=options) for _ in range(2))
    assert one.report.frames == other.report.frames == _core.draw_frames(FRAMES, 2, 3)
    np.testing.assert_array_equal(one.rig.R, other.rig.R)
    np.testing.assert_array_equal(one.rig.t, other.rig.t)
    np.testing.assert_array_equal(one.rig.source.K, other.rig.source.K)


def test_images_need_not_be_contiguous(frames: list[synthetic.Frame]) -> None:
    options = CalibrationOptions(max_frames=2, working_width=160)
    references, sources, depths = lists_of(frames[:2])
    one = xcalib.calibrate(references, sources, depths, options=options)
    other = xcalib.calibrate(
        tuple(np.asfortranarray(image) for image in references),
        tuple(image[::-1].copy()[::-1] for image in sources),
        tuple(depth.astype(np.float64) for depth in depths),
        options=options,
    )
    np.testing.assert_array_equal(one.rig.R, other.rig.R)
    np.testing.assert_array_equal(one.rig.source.K, other.rig.source.K)


def test_known_cameras_stay_as_they_are(frames: list[synthetic.Frame], truth: Rig) -> None:
    options = CalibrationOptions(
        max_frames=2,
        working_width=160,
        reference_camera=truth.reference,
        source_camera=truth.source,
    )
    rig = xcalib.calibrate(*lists_of(frames[:2]), options=options).rig
    np.testing.assert_allclose(rig.reference.K, truth.reference.K, atol=1e-9)
    np.testing.assert_allclose(rig.source.K, truth.source.K, atol=1e-9)


def test_a_good_initial_rig_is_refined_without_a_search(
    frames: list[synthetic.Frame], truth: Rig
) -> None:
    start = Rig(truth.reference, truth.source, rotation(0.004, -0.004, 0) @ truth.R, 0.7 * truth.t)
    options = CalibrationOptions(search=SearchOptions(mode="off"))
    result = xcalib.calibrate(*lists_of(frames), initial=start, options=options)
    errors, before = (
        [metrics.end_point_error(rig, truth, frame.depth) for frame in frames]
        for rig in (result.rig, start)
    )
    assert np.nanmedian(before) > 1
    assert np.nanmedian(errors) < 0.5


@pytest.mark.parametrize("off", [(-0.6, 0.1, 0.1), (0.3, -0.4, 0.0)])
def test_a_wrong_initial_translation_is_not_kept(
    frames: list[synthetic.Frame], truth: Rig, off: tuple[float, float, float]
) -> None:
    """Half a metre off moves the images by more than 10 px: two frames must show it."""
    start = Rig(truth.reference, truth.source, truth.R, truth.t + off)
    result = xcalib.calibrate(*lists_of(frames[:2]), initial=start)
    errors, before = (
        [metrics.end_point_error(rig, truth, frame.depth) for frame in frames[:2]]
        for rig in (result.rig, start)
    )
    assert np.nanmedian(before) > 10
    assert np.nanmedian(errors) < 0.5
    assert result.converged
    np.testing.assert_array_equal(result.rig.reference.K, truth.reference.K)


def test_an_exception_in_progress_ends_the_calibration(frames: list[synthetic.Frame]) -> None:
    class Enough(Exception):
        pass

    def progress(stage: str, share: float) -> None:
        if stage == "search":
            raise Enough

    with pytest.raises(Enough):
        xcalib.calibrate(*lists_of(frames[:2]), progress=progress)


def test_other_threads_run_meanwhile(frames: list[synthetic.Frame]) -> None:
    """The GIL is released: a thread that only counts gets on while a calibration runs."""
    ticks, done = [], threading.Event()

    def count() -> None:
        while not done.is_set():
            ticks.append(time.perf_counter())
            time.sleep(0.002)

    thread = threading.Thread(target=count)
    times: list[float] = []
    thread.start()
    try:
        options = CalibrationOptions(max_frames=2, working_width=160)
        xcalib.calibrate(
            *lists_of(frames[:2]),
            options=options,
            progress=lambda *_: times.append(time.perf_counter()),
        )
    finally:
        done.set()
        thread.join()
    # Between the first and the last call of progress there is little but C++.
    assert sum(times[0] < tick < times[-1] for tick in ticks) > 10 * len(times)


@pytest.mark.parametrize("num_threads", [1, 3])
def test_two_threads_may_register_with_one_registrar(num_threads: int) -> None:
    registrar = Registrar(some_rig(), num_threads)
    depth = some_depth()
    sources = [np.random.default_rng(i).integers(0, 256, (42, 56), np.uint8) for i in range(4)]
    expected = [registrar.register(source, depth)[0] for source in sources]
    wrong: list[int] = []

    def work(index: int) -> None:
        for _ in range(50):
            image, _mask = registrar.register(sources[index], depth)
            if not np.array_equal(image, expected[index]):
                wrong.append(index)
                return

    threads = [threading.Thread(target=work, args=(index,)) for index in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong
