"""The metrics against scikit-image and plain numpy, shifts that are known, and geometry by hand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from skimage.metrics import structural_similarity

from xcalib import Pinhole, Rig, metrics

Array = NDArray[Any]
Metric = Callable[..., float]


def texture(seed: int, height: int = 90, width: int = 120, sigma: float = 2.0) -> Array:
    """(H, W) float32 in [0, 1], smooth noise."""
    noise = np.random.default_rng(seed).standard_normal((height, width))
    smooth = cv2.GaussianBlur(noise, (0, 0), sigma)
    low, high = smooth.min(), smooth.max()
    return ((smooth - low) / (high - low)).astype(np.float32)


def holes(seed: int, height: int = 90, width: int = 120) -> Array:
    """A mask as the registrar gives it, with some blocks that are not valid."""
    rng = np.random.default_rng(seed)
    mask = np.zeros((height, width), np.uint8)
    for _ in range(4):
        y, x = rng.integers(0, height - 10), rng.integers(0, width - 10)
        mask[y : y + 9, x : x + 7] = rng.integers(1, 4)
    return mask


def stencil(mask: Array | None, shape: tuple[int, ...]) -> Array:
    """Where a forward difference has all of its pixels: (H - 1, W - 1) bool."""
    valid = np.ones(shape, bool) if mask is None else mask == 0
    return valid[:-1, :-1] & valid[:-1, 1:] & valid[1:, :-1]


def forward(image: Array) -> tuple[Array, Array]:
    image = image.astype(np.float64)
    here = image[:-1, :-1]
    return image[:-1, 1:] - here, image[1:, :-1] - here


def plain_nec(a: Array, b: Array, mask: Array | None, printed: bool = False) -> float:
    use = stencil(mask, a.shape)
    magnitudes, angles = [], []
    for image in (a, b):
        gx, gy = (g[use] for g in forward(image))
        g = np.hypot(gx, gy)
        low = 2 * g.mean() / np.mean(g > 0) if printed else 0.0
        magnitudes.append(np.maximum(np.minimum(g, 5 * g.mean()), low))
        angles.append(np.arctan2(gy, gx))
    (ga, gb), (ta, tb) = magnitudes, angles
    return float(np.sum(ga * gb * np.abs(np.cos(ta - tb))) / np.sqrt(np.sum(ga**2) * np.sum(gb**2)))


def plain_gc(a: Array, b: Array, mask: Array | None) -> float:
    use = stencil(mask, a.shape)
    pairs = zip(forward(a), forward(b), strict=True)
    return float(np.mean([np.corrcoef(np.abs(p[use]), np.abs(q[use]))[0, 1] for p, q in pairs]))


def valid_pixels(a: Array, b: Array, mask: Array | None) -> tuple[Array, Array]:
    use = np.ones(a.shape, bool) if mask is None else mask == 0
    return a[use].astype(np.float64), b[use].astype(np.float64)


def plain_ncc(a: Array, b: Array, mask: Array | None) -> float:
    p, q = valid_pixels(a, b, mask)
    return float(np.corrcoef(p, q)[0, 1])


def plain_rmse(a: Array, b: Array, mask: Array | None) -> float:
    p, q = valid_pixels(a, b, mask)
    return float(np.sqrt(np.mean((p - q) ** 2)))


def plain_psnr(a: Array, b: Array, mask: Array | None) -> float:
    return float(-20 * np.log10(plain_rmse(a, b, mask)))


def plain_ssim(a: Array, b: Array, mask: Array | None) -> float:
    """scikit-image's map, over pixels whose 11 x 11 window is in the image and valid."""
    _, values = structural_similarity(
        a.astype(np.float64),
        b.astype(np.float64),
        gaussian_weights=True,
        sigma=1.5,
        use_sample_covariance=False,
        data_range=1.0,
        full=True,
    )
    valid = np.ones(a.shape, np.uint8) if mask is None else (mask == 0).astype(np.uint8)
    inside = cv2.erode(valid, np.ones((11, 11)), borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    assert not inside[:5].any() and inside[5:-5, 5:-5].any()
    return float(values[inside].mean())


PLAIN = {
    metrics.nec: plain_nec,
    metrics.gc: plain_gc,
    metrics.ncc: plain_ncc,
    metrics.rmse: plain_rmse,
    metrics.psnr: plain_psnr,
    metrics.ssim: plain_ssim,
}
each_metric = pytest.mark.parametrize("metric", PLAIN, ids=lambda m: m.__name__)
#: A mask's holes take away the windows of SSIM around them too: both must do so alike.
each_mask = pytest.mark.parametrize("mask", [None, holes(1)], ids=["whole", "masked"])


@each_metric
@each_mask
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_float_images_agree_with_numpy(metric: Metric, mask: Array | None, seed: int) -> None:
    a, b = texture(seed), 0.6 * texture(seed) + 0.4 * texture(seed + 100)
    assert metric(a, b, mask) == pytest.approx(PLAIN[metric](a, b, mask), abs=1e-6)


@each_metric
@each_mask
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_integers_are_taken_to_zero_to_one(
    metric: Metric, mask: Array | None, dtype: type[np.generic]
) -> None:
    top = np.iinfo(dtype).max
    a, b = ((top * texture(seed)).astype(dtype) for seed in (4, 5))
    expected = PLAIN[metric](a / top, b / top, mask)
    assert metric(a, b, mask) == pytest.approx(expected, abs=2e-6)


@each_metric
def test_colour_counts_as_its_luma(metric: Metric) -> None:
    rng = np.random.default_rng(6)
    a, b = (rng.integers(0, 256, (40, 50, 3), np.uint8) for _ in range(2))
    b = (a // 2 + b // 2).astype(np.uint8)
    luma = np.array([0.114, 0.587, 0.299])  # B, G, R
    expected = PLAIN[metric](a @ luma / 255, b @ luma / 255, None)
    assert metric(a, b) == pytest.approx(expected, abs=2e-6)


@each_metric
def test_the_mask_is_the_registrars(metric: Metric) -> None:
    a, b, mask = texture(7), texture(8), holes(7)
    expected = metric(a, b, mask)
    assert np.isfinite(expected) and expected != metric(a, b)
    for same in (mask.astype(np.int64), np.asfortranarray(mask), np.minimum(mask, 1)):
        assert metric(a, b, same) == expected
    # Where it is valid, as masks of earlier versions said, is told from why it is not.
    for other in (mask == 0, (mask > 0) * 1.0, np.uint8(255) * (mask > 0)):
        with pytest.raises(ValueError, match=r"mask .*expected the registrar's: 0 where valid"):
            metric(a, b, other)


RANGED = (metrics.rmse, metrics.psnr, metrics.ssim)


@pytest.mark.parametrize("metric", RANGED, ids=lambda m: m.__name__)
def test_what_depends_on_the_range_of_the_values_wants_to_know_it(metric: Metric) -> None:
    a, b = 100 * texture(7), 100 * texture(8)
    with pytest.raises(ValueError, match=r"reference is float32 with the value .*data_range"):
        metric(a, b)
    expected = metric(a / 100, b / 100)
    assert metric(a, b, data_range=100) == pytest.approx(expected, abs=1e-5)
    counts, others = (np.round(2.55 * image).astype(np.uint8) for image in (a, b))
    assert metric(counts, others, data_range=255) == metric(counts, others)
    with pytest.raises(ValueError, match="two types"):
        metric(counts, b, data_range=255)


@each_metric
def test_no_image_is_more_like_itself_than_the_same(metric: Metric) -> None:
    for seed in range(5):
        image = texture(seed, 40, 50)
        assert metric is metrics.psnr or metric(image, image) <= 1


@each_metric
def test_views_need_not_be_contiguous(metric: Metric) -> None:
    a, b = texture(9), texture(10)
    expected = metric(a[::2, ::3].copy(), b[::2, ::3].copy())
    assert metric(a[::2, ::3], b[::2, ::3]) == expected
    assert metric(np.asfortranarray(a[::2, ::3]), b[::2, ::3]) == expected


@each_metric
def test_pixels_outside_the_mask_have_no_say(metric: Metric) -> None:
    a, b, mask = texture(11), texture(12), holes(11)
    spoilt = np.where(mask == 0, b, 1.0).astype(np.float32)
    assert metric(a, spoilt, mask) == pytest.approx(metric(a, b, mask), abs=1e-9)
    assert metric(a, spoilt) != pytest.approx(metric(a, b), abs=1e-3)


@each_metric
def test_without_valid_pixels_there_is_no_value(metric: Metric) -> None:
    a, b = texture(13), texture(14)
    assert np.isnan(metric(a, b, np.ones(a.shape, np.uint8)))


@each_mask
@pytest.mark.parametrize("seed", [15, 16])
def test_the_printed_floor_of_nec(mask: Array | None, seed: int) -> None:
    a, b = texture(seed), texture(seed + 100)
    a[:20], b[:, :30] = a[0, 0], 0.5  # no gradient there
    found = metrics.nec(a, b, mask, floor="printed")
    assert found == pytest.approx(plain_nec(a, b, mask, printed=True), abs=1e-6)
    assert found > metrics.nec(a, b, mask, floor="none") + 0.01
    assert metrics.nec(a, b, mask) == metrics.nec(a, b, mask, floor="none")


def test_an_image_and_itself() -> None:
    a = texture(17)
    assert metrics.nec(a, a) == pytest.approx(1)
    assert metrics.nec(a, 1 - a) == pytest.approx(1, abs=1e-4)
    assert metrics.gc(a, 1 - a) == pytest.approx(1, abs=1e-4)
    assert metrics.ncc(a, 1 - a) == pytest.approx(-1)
    assert metrics.ssim(a, a) == pytest.approx(1)
    assert metrics.rmse(a, a) == 0
    assert metrics.psnr(a, a) == np.inf


def test_the_range_of_the_data_may_be_given() -> None:
    a, b = texture(18), texture(19)
    ten = [(10 * image).astype(np.float32) for image in (a, b)]
    assert metrics.psnr(*ten, data_range=10) == pytest.approx(metrics.psnr(a, b), abs=1e-4)
    assert metrics.ssim(*ten, data_range=10) == pytest.approx(metrics.ssim(a, b), abs=1e-5)
    with pytest.raises(ValueError, match="data_range is -1"):
        metrics.psnr(a, b, data_range=-1)


every_function = pytest.mark.parametrize(
    "function", [*PLAIN, metrics.patch_residual], ids=lambda m: m.__name__
)


@every_function
def test_bad_arguments_are_named_with_their_shapes(function: Callable[..., Any]) -> None:
    a = texture(20)
    with pytest.raises(ValueError, match=r"registered is 119x90, expected the reference's 120x90"):
        function(a, a[:, :-1])
    with pytest.raises(ValueError, match=r"mask has shape \(89, 120\).*120x90"):
        function(a, a, np.zeros((89, 120), np.uint8))
    with pytest.raises(ValueError, match=r"mask has shape \(90, 120, 1\)"):
        function(a, a, np.zeros((90, 120, 1), np.uint8))
    with pytest.raises(ValueError, match=r"reference has shape \(90, 120\) int64"):
        function(a.astype(np.int64), a)
    with pytest.raises(ValueError, match=r"registered has shape \(90, 120\) int32"):
        function(a, a.astype(np.int32))
    with pytest.raises(ValueError, match=r"reference has shape \(90, 120, 4\).*\(H, W, 3\)"):
        function(np.dstack([a] * 4), a)
    with pytest.raises(ValueError, match=r"reference has shape \(0, 5\)"):
        function(np.zeros((0, 5), np.float32), a)
    spoilt = a.copy()
    spoilt[3, 4] = np.nan
    with pytest.raises(ValueError, match="x = 4, y = 3"):
        function(a, spoilt)
    with pytest.raises(TypeError):
        function(a)


def test_an_unknown_floor_is_an_error() -> None:
    a = texture(21)
    with pytest.raises(ValueError, match="floor is 'high', expected none or printed"):
        metrics.nec(a, a, floor="high")


# --- The patch residual ---------------------------------------------------------------------------


def shifted(image: Array, dx: float, dy: float) -> Array:
    """What lies at x lies at x + (dx, dy): by the Fourier transform, so exact between pixels."""
    fy = np.fft.fftfreq(image.shape[0])[:, None]
    fx = np.fft.fftfreq(image.shape[1])[None]
    turned = np.fft.fft2(image) * np.exp(-2j * np.pi * (fx * dx + fy * dy))
    return np.fft.ifft2(turned).real.astype(np.float32)


SHIFTS = [(0.0, 0.0), (3.0, -2.0), (-7.0, 9.0), (0.5, 0.25), (-2.3, 1.6), (4.75, -0.4)]


@pytest.mark.parametrize("contrast", [1, -1], ids=["same contrast", "reversed contrast"])
@pytest.mark.parametrize("shift", SHIFTS, ids=str)
def test_patches_find_a_known_shift(shift: tuple[float, float], contrast: int) -> None:
    a = texture(22, 300, 400, sigma=2.5)
    b = shifted(a, *shift)
    found = metrics.patch_residual(a, np.clip(0.5 + contrast * (b - 0.5), 0, 1))
    assert len(found.shifts) > 20
    np.testing.assert_allclose(np.median(found.shifts, axis=0), shift, atol=0.15)
    assert found.median == pytest.approx(np.hypot(*shift), abs=0.15)
    assert found.share_under_2px == (1 if np.hypot(*shift) < 1.9 else 0)


def test_the_result_has_one_row_per_patch_and_its_own_statistics() -> None:
    a = texture(23, 200, 300, sigma=2.5)
    found = metrics.patch_residual(a, shifted(a, 1.0, 0.0))
    n = len(found.shifts)
    assert found.shifts.shape == found.centers.shape == (n, 2)
    assert (found.centers > 20).all() and (found.centers < (280, 180)).all()
    assert found.median == np.median(np.hypot(*found.shifts.T))


def test_patches_of_unrelated_images_do_not_tell() -> None:
    a, b = texture(24, 300, 400, sigma=2.5), texture(25, 300, 400, sigma=2.5)
    known = len(metrics.patch_residual(a, b).shifts)
    assert known < 0.5 * len(metrics.patch_residual(a, a).shifts)


def test_masked_patches_are_left_out() -> None:
    a = texture(26, 200, 400, sigma=2.5)
    mask = np.zeros(a.shape, np.uint8)
    mask[:, :200] = 3
    centers = metrics.patch_residual(a, a, mask).centers
    assert len(centers) > 3 and (centers[:, 0] > 190).all()


@pytest.mark.parametrize("size", [(80, 60), (76, 76), (40, 30), (8, 8), (3, 400)], ids=str)
def test_an_image_too_small_for_patches_has_none(size: tuple[int, int]) -> None:
    a = texture(27, size[1], size[0])
    found = metrics.patch_residual(a, a, np.zeros(a.shape, np.uint8))
    assert len(found.shifts) == (1 if size == (76, 76) else 0)
    if size != (76, 76):
        assert np.isnan(found.median) and np.isnan(found.share_under_2px)


def test_flat_images_have_no_patches_that_tell() -> None:
    flat = np.full((200, 200), 0.5, np.float32)
    assert len(metrics.patch_residual(flat, flat).shifts) == 0
    assert len(metrics.patch_residual(texture(28, 200, 200), flat).shifts) == 0


def test_end_point_error_of_a_shift_is_focal_length_times_shift_over_depth() -> None:
    camera = Pinhole(40, 30, 50.0, 50.0, 19.5, 14.5, 0.0)
    truth = Rig(camera, camera, np.eye(3), np.zeros(3))
    moved = Rig(camera, camera, np.eye(3), np.array([0.1, 0.0, 0.0]))
    depth = np.full((30, 40), 2.0, np.float32)
    depth[0, :5] = (0, -1, np.nan, np.inf, 4)
    error = metrics.end_point_error(moved, truth, depth)
    assert error.dtype == np.float32 and np.isnan(error[0, :4]).all()
    assert error[0, 4] == pytest.approx(50 * 0.1 / 4)
    np.testing.assert_allclose(error[1:], 2.5, rtol=1e-6)
    # Whether a pixel counts is up to the true rig alone, unless the point goes behind the other
    # camera.
    reverse = metrics.end_point_error(truth, moved, depth)
    assert np.isnan(reverse[5, 38:]).all() and np.isfinite(reverse[5, :37]).all()
    behind = Rig(camera, camera, np.eye(3), np.array([0.0, 0.0, -3.0]))
    assert np.isnan(metrics.end_point_error(behind, truth, depth[1:2].repeat(30, 0))).all()
    with pytest.raises(ValueError, match=r"depth.shape is \(3, 4\), expected .*\(30, 40\)"):
        metrics.end_point_error(truth, truth, np.ones((3, 4), np.float32))
