"""The synthetic drives are the truth other tests lean on, so their own geometry is checked here
first."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from xcalib import Pinhole, Rig, synthetic

Array = NDArray[Any]


def small_rig() -> Rig:
    """Both cameras alike in resolution, so that neither's pixels limit a comparison."""
    reference = Pinhole(320, 240, 290.0, 291.0, 160.0, 118.5, 0.0)
    source = Pinhole(336, 264, 300.0, 299.0, 166.0, 133.0, 0.0)
    R = cv2.Rodrigues(np.array([0.02, -0.05, 0.03]))[0]
    return Rig(reference, source, R, np.array([-0.3, 0.02, 0.05]))


def projected(rig: Rig, depth: Array) -> Array:
    """The mapping of the paper, written out once more: (H, W, 3) x, y [px], z [m] in the source."""
    height, width = depth.shape
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    homogeneous = np.stack([x, y, np.ones_like(x)], -1).astype(np.float64)
    D = np.where(depth > 0, depth, np.nan)[..., None].astype(np.float64)
    rotated = homogeneous @ (rig.source.K @ rig.R @ np.linalg.inv(rig.reference.K)).T
    point = D * rotated + rig.source.K @ np.asarray(rig.t).reshape(3)
    return np.concatenate([point[..., :2] / point[..., 2:], point[..., 2:]], -1)


def patch_shifts(a: Array, b: Array, valid: Array, size: int = 24) -> Array:
    """Least-squares shift [px] of b against a in every patch with corners in it, (N, 2)."""
    a, b = (cv2.GaussianBlur(cv2.cvtColor(i, cv2.COLOR_BGR2GRAY), (0, 0), 1.0) for i in (a, b))
    valid = cv2.erode(valid.astype(np.uint8), np.ones((9, 9))) > 0
    gx, gy = (cv2.Sobel((a + b) / 2, -1, *order, ksize=3) / 8 for order in ((1, 0), (0, 1)))
    shifts = []
    for y in range(0, a.shape[0] - size, size):
        for x in range(0, a.shape[1] - size, size):
            patch = np.s_[y : y + size, x : x + size]
            use = valid[patch]
            if use.mean() < 0.6:
                continue
            J = np.stack([gx[patch][use], gy[patch][use]], 1)
            if np.linalg.eigvalsh(J.T @ J)[0] > 400:
                shifts.append(np.linalg.lstsq(J, (a - b)[patch][use], rcond=None)[0])
    return np.array(shifts)


def test_frames_have_the_documented_sizes_and_types() -> None:
    frames = list(synthetic.render(small_rig(), num_frames=2))
    assert [frame.name for frame in frames] == ["000000", "000001"]
    for frame in frames:
        assert frame.reference.shape == (240, 320, 3) and frame.reference.dtype == np.uint8
        assert frame.source.shape == (264, 336) and frame.source.dtype == np.uint8
        assert frame.depth.shape == (240, 320) and frame.depth.dtype == np.float32
        assert np.isfinite(frame.depth).all() and (frame.depth >= 0).all()
    change = cv2.absdiff(frames[0].reference, frames[1].reference)
    assert change.mean() > 10


def test_raw_counts_follow_the_eight_bit_image() -> None:
    (raw,) = synthetic.render(small_rig(), 1, noise=0, source_dtype=np.uint16)
    (shown,) = synthetic.render(small_rig(), 1, noise=0)
    assert raw.source.dtype == np.uint16
    assert np.abs((raw.source.astype(float) - 7000) / 24 - shown.source).max() <= 0.55


def test_a_seed_is_a_street() -> None:
    first, again, other = (next(synthetic.render(small_rig(), 2, seed=s)) for s in (3, 3, 4))
    for field in ("reference", "source", "depth"):
        np.testing.assert_array_equal(getattr(first, field), getattr(again, field))
        assert not np.array_equal(getattr(first, field), getattr(other, field))


def test_noise_zero_is_the_rendering_itself() -> None:
    street = synthetic.Street(small_rig(), 1, noise=0)
    image, depth = street.render_view(0, "visible", "reference")
    frame = street.frame(0)
    np.testing.assert_array_equal(frame.reference, np.rint(image).astype(np.uint8))
    np.testing.assert_array_equal(frame.depth, depth)
    noisy = next(synthetic.render(small_rig(), 1))
    assert 0.8 < (noisy.reference.astype(float) - frame.reference)[frame.reference > 20].std() < 3


def test_night_is_dark_to_the_eye_alone() -> None:
    day, night = (next(synthetic.render(small_rig(), 1, night=n, noise=0)) for n in (False, True))
    assert night.reference.mean() < 0.4 * day.reference.mean()
    assert night.reference.max() > 150
    np.testing.assert_array_equal(day.source, night.source)
    np.testing.assert_array_equal(day.depth, night.depth)


@pytest.mark.parametrize("seed", [0, 5])
def test_depth_of_the_road_is_that_of_a_plane(seed: int) -> None:
    rig = small_rig()
    street = synthetic.Street(rig, 3, seed)
    depth = street.frame(2).depth
    R, t = street.pose(2)
    x, y = np.meshgrid(np.arange(320), np.arange(240))
    rays = np.stack([x, y, np.ones_like(x)], -1) @ np.linalg.inv(rig.reference.K).T @ R
    centre = -R.T @ t
    height = np.where(depth > 0, centre[1] + depth * rays[..., 1], np.nan)
    road = np.abs(height) < 0.004  # the road surface is y = 0 in the street
    assert road.mean() > 0.15
    analytic = -centre[1] / rays[..., 1][road]
    assert np.quantile(np.abs(depth[road] / analytic - 1), 0.99) < 1e-6


@pytest.mark.parametrize("night", [False, True])
@pytest.mark.parametrize("sky_depth", [0.0, 200.0])
def test_depth_maps_one_view_onto_the_other(sky_depth: float, night: bool) -> None:
    """The same modality from both cameras, warped by the equation: nothing may be left to move."""
    rig = small_rig()
    street = synthetic.Street(rig, 4, seed=1, night=night, sky_depth=sky_depth)
    shifts = []
    for index in (0, 2, 3):
        reference, depth = street.render_view(index, "visible", "reference")
        source, _ = street.render_view(index, "visible", "source")
        target = projected(rig, depth)
        at = np.nan_to_num(target[..., :2], nan=-99).astype(np.float32)
        warped = cv2.remap(source, at[..., 0], at[..., 1], cv2.INTER_CUBIC)
        inside = (at >= 2).all(-1) & (at[..., 0] < 333) & (at[..., 1] < 261)
        shifts.append(patch_shifts(reference, warped, inside & ~street.occluded(index)))
    every = np.concatenate(shifts)
    assert len(every) > (15 if night else 40)
    assert np.median(np.hypot(*every.T)) < 0.05
    # A half-pixel or sampling-grid error would shift all patches alike.
    assert np.abs(np.median(every, axis=0)).max() < 0.02


def test_sky_has_the_depth_asked_for_and_nothing_else_changes() -> None:
    unknown = next(synthetic.render(small_rig(), 1)).depth
    known = next(synthetic.render(small_rig(), 1, sky_depth=150.0)).depth
    assert 0.02 < (unknown == 0).mean() < 0.6
    np.testing.assert_array_equal(known[unknown == 0], np.float32(150))
    np.testing.assert_array_equal(known[unknown > 0], unknown[unknown > 0])


def test_near_and_far_are_both_in_view() -> None:
    depth = next(synthetic.render(small_rig(), 1)).depth
    assert depth[depth > 0].min() < 6 and depth.max() > 50


def test_depth_noise_is_smooth_and_of_the_given_size() -> None:
    exact = next(synthetic.render(small_rig(), 1)).depth
    noisy = next(synthetic.render(small_rig(), 1, depth_noise=0.05)).depth
    np.testing.assert_array_equal(exact == 0, noisy == 0)
    error = np.where(exact > 0, noisy / np.maximum(exact, 1e-6) - 1, np.nan)
    assert 0.03 < np.nanstd(error) < 0.07
    assert np.nanmedian(np.abs(np.diff(error, axis=1))) < 0.01


def test_occluded_means_something_nearer_is_in_the_way() -> None:
    rig = small_rig()
    street = synthetic.Street(rig, 3, seed=2)
    _, depth = street.render_view(1, "visible", "reference")
    _, seen = street.render_view(1, "visible", "source")
    target = projected(rig, depth)
    hidden = street.occluded(1)
    assert hidden.dtype == bool and 0.005 < hidden.mean() < 0.3
    x, y = (np.rint(np.nan_to_num(target[..., axis], nan=-99)).astype(int) for axis in (0, 1))
    inside = (x >= 1) & (y >= 1) & (x < 335) & (y < 263) & (depth > 0)
    assert not hidden[depth == 0].any()
    # At a silhouette the grid does not decide; where a neighbourhood agrees, so must the rays.
    far_away = np.where(seen > 0, seen, 1e6)
    least, most = (f(far_away, np.ones((3, 3))) for f in (cv2.erode, cv2.dilate))
    z, least, most = target[..., 2][inside], least[y[inside], x[inside]], most[y[inside], x[inside]]
    behind, free = most < 0.97 * z, least > 0.97 * z
    assert behind.sum() > 100 and free.sum() > 10000
    assert hidden[inside][behind].mean() > 0.96  # leaves have gaps finer than a pixel
    assert hidden[inside][free].mean() < 0.002


def test_occlusions_do_not_depend_on_the_size_of_the_images() -> None:
    """Every third pixel centre of images of three times the size is one of the small images."""
    small = synthetic.demo_rig().resized(430, 320, 320, 256)
    large = small.resized(3 * 430, 3 * 320, 3 * 320, 3 * 256)
    for seed in (1, 2, 3):
        few, many = (synthetic.Street(rig, 1, seed=seed).occluded(0) for rig in (small, large))
        assert few.mean() > 0.002
        # The source image ends at its outermost pixel centres, which lie further out in the large.
        assert (few & ~many[1::3, 1::3]).sum() <= 2
        assert (few != many[1::3, 1::3]).mean() < 1e-3


def test_one_camera_in_two_places_at_once_hides_nothing() -> None:
    camera = small_rig().reference
    street = synthetic.Street(Rig(camera, camera, np.eye(3), np.zeros(3)), 1)
    # All but a few pixels on the very rim of a leaf, which rounding decides.
    assert street.occluded(0).mean() < 2e-4


def test_modalities_share_structure_and_not_contrast() -> None:
    street = synthetic.Street(small_rig(), 1, seed=1)
    visible = cv2.cvtColor(street.render_view(0, "visible", "reference")[0], cv2.COLOR_BGR2GRAY)
    thermal, _ = street.render_view(0, "thermal", "reference")
    gradients = [
        np.stack([cv2.Sobel(i, -1, 1, 0, ksize=3), cv2.Sobel(i, -1, 0, 1, ksize=3)]) / 8
        for i in (cv2.GaussianBlur(visible, (0, 0), 0.7), thermal)
    ]
    strong = (np.hypot(*gradients[0]) > 8) & (np.hypot(*gradients[1]) > 4)
    assert strong.mean() > 0.02
    a, b = (g[:, strong] / np.hypot(*g[:, strong]) for g in gradients)
    cosine = (a * b).sum(0)
    assert np.mean(np.abs(cosine) > 0.9) > 0.6  # edges run alike, random ones would give 0.29
    assert 0.15 < np.mean(cosine > 0) < 0.85  # yet with either sign


def test_random_rigs_stay_within_their_ranges() -> None:
    offsets, ratios = [], []
    for seed in range(200):
        rig = synthetic.random_rig(seed)
        assert (rig.reference.width, rig.reference.height) == (640, 480)
        assert (rig.source.width, rig.source.height) == (640, 512)
        hfovs = []
        for camera in (rig.reference, rig.source):
            hfovs.append(float(np.rad2deg(2 * np.arctan(camera.width / 2 / camera.fx))))
            assert 30 - 1e-9 <= hfovs[-1] <= 90 + 1e-9
            assert abs(camera.fy / camera.fx - 1) <= 0.005 and camera.skew == 0
            assert abs(camera.cx - (camera.width - 1) / 2) <= 0.01 * camera.width
            assert abs(camera.cy - (camera.height - 1) / 2) <= 0.01 * camera.width
        ratios.append(hfovs[1] / hfovs[0])
        R, t = np.asarray(rig.R), np.asarray(rig.t).reshape(3)
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(R) > 0
        at = rig.reference.K @ R.T @ (0, 0, 1)
        offsets.append((at[:2] / at[2] - (319.5, 239.5)) / (640, 480))
        length = np.linalg.norm(t)
        assert 0.02 <= length <= 0.5 and abs(t[2]) <= 0.3 * length + 1e-12
        assert abs(t[0]) > 0.8 * length
        again = synthetic.random_rig(seed)
        np.testing.assert_array_equal(again.R, rig.R)
    assert np.abs(offsets).max(axis=0).min() > 0.27 and np.abs(offsets).max() <= 0.3 + 1e-9
    assert 0.5 <= min(ratios) < 0.6 and 1.6 < max(ratios) <= 2.0


def test_random_rigs_roll_as_asked() -> None:
    for seed in range(20):
        R = np.asarray(synthetic.random_rig(seed, max_offset=0, max_roll_deg=2).R)
        assert abs(np.rad2deg(np.arctan2(R[1, 0], R[0, 0]))) < 2.1


def test_the_demo_rig_is_plausible() -> None:
    rig = synthetic.demo_rig()
    assert (rig.reference.width, rig.reference.height) == (960, 720)
    assert np.rad2deg(2 * np.arctan(480 / rig.reference.fx)) == pytest.approx(50)
    assert np.rad2deg(2 * np.arctan(320 / rig.source.fx)) == pytest.approx(42)
    assert np.linalg.norm(rig.t) == pytest.approx(0.15)


def test_written_frames_read_back(tmp_path: Path) -> None:
    rig = small_rig()
    frame = next(synthetic.render(rig, 1, source_dtype=np.uint16))
    depth = frame.depth.copy()
    depth[0, :5] = (300.0, 0.0005, np.nan, np.inf, -2)
    synthetic.write(
        tmp_path / "a", [synthetic.Frame(frame.reference, frame.source, depth, "000007")], rig
    )
    assert sorted(
        p.relative_to(tmp_path / "a").as_posix() for p in (tmp_path / "a").rglob("*.*")
    ) == ["depth/000007.png", "rig.yaml", "thermal/000007.png", "visible/000007.png"]
    visible = cv2.imread(str(tmp_path / "a/visible/000007.png"), cv2.IMREAD_UNCHANGED)
    thermal = cv2.imread(str(tmp_path / "a/thermal/000007.png"), cv2.IMREAD_UNCHANGED)
    np.testing.assert_array_equal(visible, frame.reference)
    np.testing.assert_array_equal(thermal, frame.source)
    stored = cv2.imread(str(tmp_path / "a/depth/000007.png"), cv2.IMREAD_UNCHANGED)
    assert stored is not None and stored.dtype == np.uint16
    assert stored[0, :5].tolist() == [65535, 1, 0, 0, 0]
    np.testing.assert_allclose(stored[1:] / 256, frame.depth[1:], atol=1 / 512 + 1e-6)
    np.testing.assert_allclose(Rig.load(tmp_path / "a/rig.yaml").R, rig.R, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"num_frames": 0}, "num_frames is 0, expected"),
        ({"seed": -1}, "seed is -1, expected"),
        ({"noise": -0.5}, "noise is -0.5, expected"),
        ({"speed": 99}, "speed is 99, expected"),
        ({"depth_noise": 0.9}, "depth_noise is 0.9, expected"),
        ({"sky_depth": 0.2}, "sky_depth is 0.2, expected"),
        ({"source_dtype": np.float32}, "source_dtype is .*float32.*, expected uint8 or uint16"),
    ],
)
def test_bad_options_are_named(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        synthetic.render(small_rig(), **options)


def test_other_bad_arguments_are_named() -> None:
    with pytest.raises(ValueError, match=r"hfov_deg is .* expected 0 < low <= high < 170"):
        synthetic.random_rig(0, hfov_deg=(50, 40))
    with pytest.raises(ValueError, match=r"fov_ratio is .* expected"):
        synthetic.random_rig(0, fov_ratio=(4.0, 5.0))
    with pytest.raises(ValueError, match=r"max_baseline is 0\.01, expected at least 0.02"):
        synthetic.random_rig(0, max_baseline=0.01)
    street = synthetic.Street(small_rig(), 1)
    with pytest.raises(ValueError, match="index is 1, expected"):
        street.frame(1)
    with pytest.raises(ValueError, match="modality is sonar, expected visible or thermal"):
        street.render_view(0, "sonar")
    with pytest.raises(ValueError, match="camera is third, expected reference or source"):
        street.render_view(0, "visible", "third")
