"""Lenses of the source in a calibration: k1 estimated where there is one, and one that is given."""

from functools import cache

import numpy as np
import pytest

import xcalib
from xcalib import synthetic

NONE = xcalib.Lens("none", [])


def rig_with(lens: xcalib.Lens) -> xcalib.Rig:
    return synthetic.random_rig(
        seed=200,
        max_offset=0.1,
        hfov_deg=(40, 65),
        fov_ratio=(0.7, 1.4),
        max_baseline=0.2,
        width=320,
        height=240,
        source_width=320,
        source_height=256,
        source_lens=lens,
    )


@cache
def footage(k1: float) -> tuple[xcalib.Rig, list[synthetic.Frame]]:
    rig = rig_with(xcalib.Lens("brown", [k1, 0, 0, 0]) if k1 else NONE)
    street = synthetic.Street(rig, num_frames=10, seed=200, speed=6.0)
    return rig, [street.frame(i) for i in range(10)]


def calibrated(k1: float, lens: xcalib.Lens | None) -> tuple[xcalib.CalibrationResult, float]:
    """With this lens given, and the 95 % error of the mapping [px of the source]."""
    rig, frames = footage(k1)
    options = xcalib.CalibrationOptions()
    options.source_lens = lens
    result = xcalib.calibrate(
        [frame.reference for frame in frames],
        [frame.source for frame in frames],
        [frame.depth for frame in frames],
        options=options,
    )
    maps = [xcalib.Registrar(r).map(frames[5].depth) for r in (result.rig, rig)]
    return result, float(np.nanpercentile(np.linalg.norm(maps[0] - maps[1], axis=-1), 95))


@pytest.mark.parametrize("k1", [0.0, -0.3])
def test_a_lens_is_found_where_there_is_one(k1: float) -> None:
    result, error = calibrated(k1, None)
    assert result.report.lens.tried
    assert (result.report.lens.coefficients > 0) == (k1 != 0)
    assert error < 0.5


def test_none_is_looked_for_where_none_is_said_to_be() -> None:
    result, error = calibrated(-0.3, NONE)
    assert not result.report.lens.tried
    assert result.rig.source.lens.model == "none"
    assert error > 0.5


def test_a_lens_that_is_given_stays_and_the_focal_length_goes_with_it() -> None:
    lens = xcalib.Lens("brown", [-0.3, 0, 0, 0])
    result, error = calibrated(-0.3, lens)
    assert not result.report.lens.tried
    assert result.rig.source.lens == lens
    assert result.rig.reference.fx == pytest.approx(result.rig.reference.fy)
    assert error < 0.5


def test_a_lens_moves_on_request() -> None:
    rig, frames = footage(-0.3)
    images = [[getattr(f, name) for f in frames] for name in ("reference", "source", "depth")]
    options = xcalib.CalibrationOptions(optimize_lens=True)
    options.source_lens = xcalib.Lens("brown", [-0.1, 0, 0, 0])
    found = xcalib.calibrate(*images, options=options).rig.source.lens
    assert found.coefficients[0] == pytest.approx(-0.3, abs=0.1)
    assert found.coefficients[1] != 0
    options.solver = "adam"
    options.adam.epochs, options.adam.fine_from = 30, 0.1
    options.adam.fine_learning_rate = 0.01
    few = [some[:4] for some in images]
    by_adam = xcalib.calibrate(*few, initial=rig, options=options)
    assert by_adam.report.lens.coefficients == 2
    assert by_adam.rig.source.lens.coefficients[0] < -0.15


def test_lenses_that_cannot_move_are_refused() -> None:
    options = xcalib.CalibrationOptions(optimize_lens=True)
    options.source_lens = xcalib.Lens("fisheye", [0, 0, 0, 0])
    with pytest.raises(ValueError, match="optimize_lens with source_lens = fisheye:0,0,0,0"):
        options.validate()
    options.source_lens = None
    options.source_camera = rig_with(NONE).source
    with pytest.raises(ValueError, match="optimize_lens beside source_camera"):
        options.validate()
