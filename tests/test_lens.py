"""Lenses, against OpenCV's own projection, and rendered through."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

import xcalib
from conftest import run
from xcalib.metrics import end_point_error
from xcalib.reprojection import targets
from xcalib.synthetic import Street, random_rig


def random_lens(rng: np.random.Generator, kind: str) -> xcalib.Lens:
    """A lens as strong as real ones; of 'brown5' there are five coefficients."""
    p1, p2 = rng.uniform(-0.004, 0.004, 2)
    k1, k2 = rng.uniform(-0.35, 0.1), rng.uniform(0.08, 0.15)
    if kind == "fisheye":
        return xcalib.Lens("fisheye", rng.uniform(-0.03, 0.03, 4))
    if kind == "brown8":
        rest = [0.01, rng.uniform(0, 0.3), rng.uniform(-0.05, 0.05), 0.005]
        return xcalib.Lens("brown", [rng.uniform(-0.2, 0.2), k2, p1, p2, *rest])
    return xcalib.Lens("brown", [k1, k2, p1, p2, *([0.01] if kind == "brown5" else [])])


def shown_by_opencv(camera: xcalib.Pinhole, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Pixels (N, 2) of points (N, 3) in the camera's axes."""
    D = np.array(camera.lens.coefficients)
    still = np.zeros(3)
    if camera.lens.model == "fisheye":
        pixels, _ = cv2.fisheye.projectPoints(points[:, None], still, still, camera.K, D)
    else:
        pixels, _ = cv2.projectPoints(points, still, still, camera.K, D)
    return np.asarray(pixels[:, 0], np.float64)


@pytest.mark.parametrize("reference_kind", ["none", "brown4", "brown8", "fisheye"])
@pytest.mark.parametrize("source_kind", ["none", "brown5", "brown8", "fisheye"])
def test_the_map_is_opencvs_everywhere(reference_kind: str, source_kind: str) -> None:
    rng = np.random.default_rng([len(reference_kind), ord(source_kind[-1])])
    lenses = [
        None if kind == "none" else random_lens(rng, kind) for kind in (reference_kind, source_kind)
    ]
    rig = random_rig(
        int(rng.integers(1000)),
        hfov_deg=(40, 65),
        fov_ratio=(0.9, 1.3),
        max_offset=0.1,
        reference_lens=lenses[0],
        source_lens=lenses[1],
    )
    width, height = rig.reference.width, rig.reference.height
    depth = rng.uniform(1, 30, (height, width)).astype(np.float32)
    at = xcalib.Registrar(rig, occlusion="ignore").map(depth)
    ys, xs = (part.ravel() for part in np.indices((height, width), np.float64))
    K_inverse = np.linalg.inv(rig.reference.K)
    shown = (K_inverse @ np.stack([xs, ys, np.ones(len(xs))]))[:2].T
    rays = np.column_stack([rig.reference.lens.undistort(shown), np.ones(len(xs))])
    assert np.isfinite(rays).all(), "the corners too"
    # The rays are right if OpenCV shows them where they were taken from.
    back = shown_by_opencv(rig.reference, rays)
    np.testing.assert_allclose(back, np.column_stack([xs, ys]), rtol=0, atol=1e-8)
    points = (rays * depth.reshape(-1, 1)) @ rig.R.T + rig.t
    expected = shown_by_opencv(rig.source, points).reshape(height, width, 2)
    limit = (rig.source.width - 1, rig.source.height - 1)
    inside = ((expected >= 0) & (expected <= limit)).all(axis=-1)
    assert inside.mean() > 0.3
    well_inside = ((expected >= 0.01) & (expected <= np.subtract(limit, 0.01))).all(axis=-1)
    assert np.isfinite(at[well_inside]).all()
    both = inside & np.isfinite(at[..., 0])
    assert np.abs(at - expected)[both].max() < 1e-3
    np.testing.assert_allclose(targets(rig, depth)[both][:, :2], expected[both], atol=1e-6)


def test_lens_is_what_was_given_and_refuses_what_is_none() -> None:
    lens = xcalib.Lens("brown", [-0.3, 0.1, 0, 0.001])
    assert lens.model == "brown" and lens.coefficients == [-0.3, 0.1, 0, 0.001]
    assert repr(lens) == "Lens('brown', [-0.3, 0.1, 0.0, 0.001])"
    assert lens == xcalib.Lens("brown", (-0.3, 0.1, 0, 0.001)) != xcalib.Lens()
    assert lens.bends and not xcalib.Lens().bends
    np.testing.assert_allclose(lens.undistort(lens.distort([[0.4, -0.3]])), [[0.4, -0.3]])
    folded = xcalib.Lens("brown", [-1 / 3, 0, 0, 0])
    assert folded.max_radius == pytest.approx(1)
    assert (
        np.isnan(folded.distort([[1.01, 0]])).all()
        and np.isfinite(folded.distort([[0.9, 0]])).all()
    )
    with pytest.raises(ValueError, match="model = 'tele', expected none, brown or fisheye"):
        xcalib.Lens("tele", [])
    with pytest.raises(ValueError, match="brown has 3 coefficients, expected 4"):
        xcalib.Lens("brown", [1, 2, 3])
    with pytest.raises(ValueError, match="lens k2 = nan, expected a finite number"):
        xcalib.Lens("fisheye", [0, np.nan, 0, 0])
    with pytest.raises(ValueError, match="an angle in rad that its lens shows"):
        xcalib.Pinhole.from_hfov(640, 480, 100, folded)


def test_a_camera_keeps_its_lens(tmp_path: Path) -> None:
    lens = xcalib.Lens("brown", [-0.3, 0.1, 0, 0.001])
    camera = xcalib.Pinhole.from_hfov(640, 480, 60, lens)
    assert camera.resized(320, 240).lens == lens
    straight = xcalib.Lens("brown", [-0.3, 0.1, 0, 0])
    assert xcalib.Pinhole.from_hfov(640, 480, 60, straight).hfov_deg == pytest.approx(60)
    assert "lens=Lens('brown', [-0.3, 0.1, 0.0, 0.001])" in repr(camera)
    rig = xcalib.Rig(camera, xcalib.Pinhole(640, 480, 600, 600, 320, 240, lens=lens))
    rig.save(tmp_path / "rig.yaml")
    back = xcalib.Rig.load(tmp_path / "rig.yaml")
    assert back.reference.lens == back.source.lens == lens
    result = run("inspect", tmp_path / "rig.yaml")
    assert result.output.count("lens brown:-0.3,0.1,0,0.001") == 2


def test_words_of_lenses() -> None:
    parse = xcalib.Lens.parse
    assert parse("--source-lens", "auto") is None
    assert parse("--source-lens", "none") == xcalib.Lens()
    assert parse("x", "fisheye:0.1,-2e-2,0,0") == xcalib.Lens("fisheye", [0.1, -0.02, 0, 0])
    for word in (
        "brown",
        "brown:",
        "brown:1,2,3",
        "none:1",
        "brown:1,2,3,x",
        "brown:1,,2,3",
        "tele:1",
    ):
        with pytest.raises(
            ValueError, match=f"--source-lens is '{word}', expected auto, none, brown:"
        ):
            parse("--source-lens", word)


STRONG = xcalib.Lens("brown", [-0.35, 0.12, 0.001, -0.001])
WIDE = xcalib.Lens("fisheye", [0.02, -0.01, 0, 0])


@pytest.mark.parametrize(
    ("reference_lens", "source_lens"), [(None, STRONG), (WIDE, None), (STRONG, WIDE)]
)
def test_rendered_through_lenses(
    reference_lens: xcalib.Lens | None, source_lens: xcalib.Lens | None
) -> None:
    size = {"width": 320, "height": 240, "source_width": 320, "source_height": 240}
    rig = random_rig(
        7,
        hfov_deg=(70, 80),
        fov_ratio=(0.9, 1.1),
        max_offset=0.05,
        max_baseline=0.1,
        reference_lens=reference_lens,
        source_lens=source_lens,
        **size,
    )
    street = Street(rig, num_frames=1, seed=3, noise=0)
    image, depth = street.render_view(0, "visible", "reference")
    # What the source camera has before it, in the visible, registered.
    from_source, _ = street.render_view(0, "visible", "source")
    registrar = xcalib.Registrar(rig, occlusion="hide")
    registered, mask = registrar.register(from_source[..., 1].copy(), depth)
    seen = mask == 0
    assert seen.mean() > 0.4
    right = np.median(np.abs(registered - image[..., 1])[seen])
    straight = xcalib.Rig(rig.reference, rig.source, rig.R, rig.t)
    for camera in (straight.reference, straight.source):
        camera.lens = xcalib.Lens()
    other, other_mask = xcalib.Registrar(straight, occlusion="hide").register(
        from_source[..., 1].copy(), depth
    )
    wrong = np.median(np.abs(other - image[..., 1])[other_mask == 0])
    assert right < 3 and right < 0.5 * wrong
    # Occlusion by rays agrees with the registrar's.
    hidden = street.occluded(0)
    known = (mask == 0) | (mask == 2)
    assert (hidden == (mask == 2))[known].mean() > 0.98


def test_given_lenses_are_kept_and_used_throughout() -> None:
    """With both lenses known, a calibration is as good as without them."""
    rig = random_rig(
        2,
        hfov_deg=(45, 75),
        fov_ratio=(0.9, 1.1),
        max_offset=0.1,
        max_baseline=0.2,
        width=320,
        height=240,
        source_width=320,
        source_height=256,
        reference_lens=WIDE,
        source_lens=STRONG,
    )
    street = Street(rig, num_frames=8, seed=2)
    frames = [street.frame(i) for i in range(8)]
    result = xcalib.calibrate(
        [f.reference for f in frames],
        [f.source for f in frames],
        [f.depth for f in frames],
        options=xcalib.CalibrationOptions(
            reference_camera=rig.reference, source_lens=STRONG, flow="off"
        ),
    )
    assert result.rig.reference.lens == WIDE and result.rig.source.lens == STRONG
    errors = [end_point_error(result.rig, rig, frame.depth) for frame in frames]
    assert np.nanmedian(errors) < 0.15
    assert np.nanpercentile(errors, 95) < 0.5
