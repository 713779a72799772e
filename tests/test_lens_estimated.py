"""k1 of the source, estimated from footage: kept where there is one, and only there."""

import numpy as np
import pytest

import xcalib
from xcalib import synthetic


@pytest.mark.parametrize("k1", [0.0, -0.3])
def test_a_lens_is_found_where_there_is_one(k1: float) -> None:
    lens = xcalib.Lens("brown", [k1, 0, 0, 0]) if k1 else xcalib.Lens("none", [])
    rig = synthetic.random_rig(
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
    street = synthetic.Street(rig, num_frames=10, seed=200, speed=6.0)
    frames = [street.frame(i) for i in range(10)]
    result = xcalib.calibrate(
        [frame.reference for frame in frames],
        [frame.source for frame in frames],
        [frame.depth for frame in frames],
    )
    assert result.report.lens.tried
    assert (result.report.lens.coefficients > 0) == (k1 != 0)
    maps = [xcalib.Registrar(r).map(frames[5].depth) for r in (result.rig, rig)]
    error = np.linalg.norm(maps[0] - maps[1], axis=-1)
    assert np.nanmedian(error) < 0.3
    assert np.nanpercentile(error, 95) < 1.5
    given = xcalib.CalibrationOptions()
    given.source_lens = xcalib.Lens("none", [])
    pinhole = xcalib.calibrate(
        [frame.reference for frame in frames],
        [frame.source for frame in frames],
        [frame.depth for frame in frames],
        options=given,
    )
    assert not pinhole.report.lens.tried
    assert pinhole.rig.source.lens.model == "none"
