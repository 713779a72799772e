"""What the benchmarks rest on: how figures are kept, and that the peer computes what we do."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import xcalib
from xcalib import Pinhole, Rig, synthetic

BENCH = Path(__file__).resolve().parents[1] / "bench"


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The scripts of bench/ can be imported, as they import one another."""
    monkeypatch.syspath_prepend(str(BENCH))
    before = set(sys.modules)
    yield
    for name in set(sys.modules) - before:
        if str(getattr(sys.modules[name], "__file__", "")).startswith(str(BENCH)):
            del sys.modules[name]


@pytest.mark.usefixtures("bench")
def test_figures_are_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import figures

    kept = tmp_path / "figures"
    monkeypatch.setenv(figures.KEPT_IN, str(kept))
    figures.spread("a ratio", [1.0, 2.0, 3.0], "x", target="<= 1.5")
    figures.figure("an error", 0.25, "px", target="< 0.3")
    figures.skipped("a peer", "not installed")
    ratio, error, peer = (json.loads(line) for line in kept.read_text().splitlines())
    assert ratio["value"] == 2 and ratio["unit"] == "x" and ratio["met"] is False
    assert ratio["low"] == pytest.approx(1.2) and ratio["high"] == pytest.approx(2.8)
    assert error == {
        "name": "an error",
        "value": 0.25,
        "unit": "px",
        "target": "< 0.3",
        "met": True,
    }
    assert peer == {"name": "a peer", "skipped": "not installed"}
    assert "NOT met" in capsys.readouterr().out
    with pytest.raises(ValueError, match=r"target is '1\.5'"):
        figures.meets(1, "1.5")


@pytest.mark.usefixtures("bench")
def test_docs_are_written_from_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import run

    page = tmp_path / "page.md"
    page.write_text(
        "before\n<!-- figures: night_rig -->\nold\n<!-- end -->\nbetween\n"
        "<!-- figures: patch_flow -->\nstays\n<!-- end -->\nafter\n"
    )
    monkeypatch.setattr(run, "DOCS", page)
    figure = {"name": "a time", "value": 1.5, "unit": "s", "low": 1, "high": 2}
    missed = {"name": "a share", "value": 0.5, "unit": "", "target": "<= 0.25", "met": False}
    for _ in range(2):  # the markers are still there
        run.write_docs({"figures": {"night_rig": [figure, missed]}})
    text = page.read_text()
    assert "| a time | 1.5 s | 1 - 2 |  |" in text
    assert "| a share | 0.5 |  | <= 0.25: **not met** |" in text
    assert "old" not in text
    assert "stays" in text
    assert text.startswith("before\n") and text.endswith("after\n")


@pytest.mark.usefixtures("bench")
def test_the_docs_have_a_place_for_each_published_benchmark() -> None:
    import run

    text = run.DOCS.read_text()
    places = {match[2] for match in run.FIGURES_OF.finditer(text)}
    assert places == {"machine", *run.SHORT}
    for name in (*run.SHORT, *run.LONG):
        assert name == "kernels" or (BENCH / f"{name}.py").is_file()


@pytest.mark.usefixtures("bench")
def test_arithmetic_of_the_kernels() -> None:
    import roofline

    plain = roofline.flops_per_pixel("register/f32/ignore", 0.0)
    colour = roofline.flops_per_pixel("register/u8x3/ignore", 0.0)
    assert plain is not None and colour is not None
    assert colour - plain == 2 * roofline.BILINEAR
    # By hand, at an edge in every pixel: the Gram matrix of 13 columns has 91 products, in x and y.
    with_edges = roofline.normal_equations(11, 1.0) - roofline.normal_equations(11, 0.0)
    assert with_edges == 11 + 14 * 11 + 9 + 2 * 2 * 91
    assert roofline.flops_per_pixel("search", 0.0) is None


@pytest.fixture
def peer(bench: None) -> ModuleType:
    pytest.importorskip("torch")
    from peers import torch_calibration

    return torch_calibration


@pytest.fixture(scope="module")
def pair() -> tuple[Rig, synthetic.Frame]:
    rig = synthetic.random_rig(
        1, 160, 120, 160, 128, hfov_deg=(44, 46), fov_ratio=(0.98, 1.02), max_offset=0.02
    )
    return rig, next(iter(synthetic.render(rig, num_frames=1, seed=1)))


@pytest.mark.parametrize("floor", ["none", "printed"])
def test_the_peer_has_our_metric(
    peer: ModuleType, pair: tuple[Rig, synthetic.Frame], floor: str
) -> None:
    rig, frame = pair
    registrar = xcalib.Registrar(rig, occlusion="ignore")
    image, mask = registrar.register(peer.gray(frame.source), frame.depth)
    frames = peer.Frames.of([frame.reference], [frame.source], [frame.depth])
    warped, seen = peer.warp(frames, *peer.rig_mapping(rig))
    valid = mask == 0
    assert np.mean(seen.numpy()[0, 0] != valid) < 1e-3
    assert np.abs(warped.numpy()[0, 0] - image)[valid].max() < 1e-3
    ours = xcalib.metrics.nec(peer.gray(frame.reference), image, valid, floor=floor)
    theirs = peer.nec_terms(frames.references, warped, seen, floor)[0].item()
    assert theirs == pytest.approx(ours, abs=1e-3)
    if floor == "none":
        assert peer.image_loss_of(rig, frames) == pytest.approx(1 - ours, abs=1e-3)


def test_the_peer_has_the_papers_parameters(peer: ModuleType) -> None:
    """At its start, and off it: the rig that it says is the one that it warps by."""
    import torch

    p = peer.Parameters((160, 120), (160, 128))
    start = p.rig()
    expected = Rig(Pinhole.from_hfov(160, 120, 45), Pinhole.from_hfov(160, 128, 45))
    np.testing.assert_allclose(start.reference.K, expected.reference.K, rtol=1e-5)
    np.testing.assert_allclose(start.source.K, expected.source.K, rtol=1e-5)
    np.testing.assert_allclose(start.R, np.eye(3), atol=1e-6)
    with torch.no_grad():
        for i, variable in enumerate(p.dominant() + p.others()):
            variable += 0.01 * (i + 1)
    h, k = p.mapping()
    rig_h, rig_k = peer.rig_mapping(p.rig())
    np.testing.assert_allclose(h.detach(), rig_h, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(k.detach(), rig_k, rtol=1e-3, atol=1e-4)


def test_the_peer_keeps_the_papers_stages(
    peer: ModuleType, pair: tuple[Rig, synthetic.Frame]
) -> None:
    """What stage 1 freezes has moved by the three steps of stage 2 only, each 5e-4 at most."""
    _, frame = pair
    frames = peer.Frames.of([frame.reference], [frame.source], [frame.depth])
    result = peer.calibrate(frames, epochs=12)
    assert len(result.losses) == 12
    assert np.isfinite(result.losses).all()
    rig = result.rig
    roll = rig.quaternion_wxyz[3]
    for moved, scale in ((rig.source.skew, 1.0), (rig.t[2], 11.0), (roll, 1.0)):
        assert 0 < abs(moved) <= 1.01 * 3 * 5e-4 * scale
    assert np.hypot(rig.t[0], rig.t[1]) > 2 * 3 * 5e-4 * 11
