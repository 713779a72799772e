"""How figures are kept and published, and that the peer computes what we do."""

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
    figures.details({"raw": [1, 2]})
    ratio, error, peer, raw = (json.loads(line) for line in kept.read_text().splitlines())
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
    assert raw == {"details": {"raw": [1, 2]}}
    assert "NOT met" in capsys.readouterr().out
    with pytest.raises(ValueError, match=r"target is '1\.5'"):
        figures.meets(1, "1.5")


def record(**parts: object) -> dict[str, object]:
    made: dict[str, object] = {
        "commit": "abc1234",
        "date": "2026-01-02 03:04 UTC",
        "cpu": "a processor, 2 cores",
        "load_average": [0.5, 1, 2],
        "software": {"numpy": "2.0"},
        "figures": [],
    }
    return made | parts


@pytest.mark.usefixtures("bench")
def test_docs_are_written_from_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import run

    page = tmp_path / "page.md"
    page.write_text(
        "before\n<!-- software -->\n<!-- /software -->\n<!-- night_rig -->\nold\n"
        "<!-- /night_rig -->\nbetween\n<!-- flir_rig -->\nstays\n<!-- /flir_rig -->\nafter\n"
    )
    monkeypatch.setattr(run, "DOCS", page)
    figure = {"name": "a time", "value": 1.5, "unit": "s", "low": 1, "high": 2}
    missed = {"name": "a share", "value": 0.5, "unit": "", "target": "<= 0.25", "met": False}
    records = {
        "night_rig": record(figures=[figure, missed]),
        "patch_flow": record(figures=[figure]),
    }
    for _ in range(2):  # the markers are still there
        run.write_docs(records)
    text = page.read_text()
    assert "Commit abc1234, 2026-01-02 03:04 UTC, a processor, 2 cores, load average" in text
    assert "- night_rig: numpy 2.0." in text
    assert "| a time | 1.5 s | 1 - 2 |  |" in text
    assert "| a share | 0.5 |  | <= 0.25: **not met** |" in text
    assert "old" not in text
    assert "stays" in text
    assert text.startswith("before\n") and text.endswith("after\n")
    page.write_text("no place for it\n")
    with pytest.raises(SystemExit, match="expected one place between <!-- night_rig -->"):
        run.write_docs(records)


@pytest.mark.usefixtures("bench")
def test_the_newest_run_of_each_benchmark_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import run

    script = tmp_path / "one.py"
    monkeypatch.setattr(run, "ROOT", tmp_path)
    monkeypatch.setattr(run, "KEPT", tmp_path / "latest.json")
    monkeypatch.setattr(run, "ALL", {"one": script, "two": script})

    def after(code: str, *arguments: str) -> tuple[int, dict[str, list[dict[str, object]]]]:
        script.write_text(f'"""Counts."""\nimport sys, figures\n{code}\n')
        monkeypatch.setattr(sys, "argv", ["run.py", *arguments])
        code_of_exit = run.main()
        kept = json.loads(run.KEPT.read_text()) if run.KEPT.is_file() else {}
        return code_of_exit, {name: record["figures"] for name, record in kept.items()}

    one = [{"name": "a count", "value": 1.0, "unit": ""}]
    assert after("figures.figure('a count', 1)", "one") == (0, {"one": one})
    assert "a count" in run.KEPT.with_suffix(".md").read_text()
    two = [{"name": "a count", "value": 2.0, "unit": ""}]
    counted = "figures.figure('a count', 2)"
    assert after(counted, "two") == (0, {"one": one, "two": two})
    assert after(counted, "one") == (0, {"one": two, "two": two})
    # Nothing to replace it by: no data, a failure, options of its own.
    assert after("figures.skipped('a count', 'no data')", "two") == (0, {"one": two, "two": two})
    assert after("figures.figure('a count', 3); sys.exit(1)", "two")[1] == {"one": two, "two": two}
    assert "error: two failed" in capsys.readouterr().err
    three = "figures.figure('a count', float(sys.argv[1]))"
    assert after(three, "two", "--", "3") == (0, {"one": two, "two": two})
    for wrong in (["three"], ["one", "two", "--", "3"]):
        with pytest.raises(SystemExit, match="2"):
            after(counted, *wrong)
    assert "no benchmark three, expected some of" in capsys.readouterr().err


@pytest.mark.usefixtures("bench")
def test_each_benchmark_is_listed_and_has_its_place() -> None:
    import pages
    import run

    assert pages.marked(run.DOCS) == {"software", *run.PUBLISHED}
    scripts = [
        path for folder in ("speed", "accuracy", "scale") for path in (BENCH / folder).glob("*.py")
    ]
    assert sorted(run.ALL.values()) == sorted(scripts)
    kept = json.loads(run.KEPT.read_text())
    assert set(run.PUBLISHED) <= set(kept) <= set(run.ALL)
    text = run.DOCS.read_text()
    for name in run.PUBLISHED:
        assert run.section(name, kept[name]) in text
    for line in run.listing().splitlines()[:-1]:
        assert line in ("published:", "others:") or len(line.split(maxsplit=1)[1]) > 20


@pytest.mark.usefixtures("bench")
def test_kernels_from_repetitions() -> None:
    from speed import kernels

    common = {"run_type": "iteration", "cpu_time": 2.0}
    frame = {"run_name": "register/f32/ignore", "family_index": 0, "pixels": 4e6, "bytes": 8e6}
    copy = {"run_name": "copy/8000000", "family_index": 1, "bytes": 8e6, "cpu_time": 1.0}
    large = {"run_name": "copy/80000000", "family_index": 2, "bytes": 8e7, "cpu_time": 20.0}
    peak = {"run_name": "multiply_add", "family_index": 3, "flops": 3e11}
    aggregate = {**frame, "run_type": "aggregate", "cpu_time": 99.0}
    found = kernels.samples(
        [common | peak, common | large, common | copy, *[common | frame] * 3, aggregate]
    )
    assert list(found) == ["register/f32/ignore", "copy/8000000", "copy/80000000", "multiply_add"]
    assert found["register/f32/ignore"] == {"pixels": 4e6, "bytes": 8e6, "ms": [2.0, 2.0, 2.0]}
    (row,) = kernels.rows(found)
    assert row.speed == pytest.approx(4e9) and row.share == pytest.approx(0.5)
    flops = kernels.flops_per_pixel("register/f32/ignore", 0.0)
    assert flops is not None
    assert row.flops == pytest.approx(flops * 2e9) and row.intensity == pytest.approx(flops / 2)
    assert kernels.roofs(found) == pytest.approx((3e11, 8e9, 4e9))
    assert "| register/f32/ignore | 2 | 2 - 2 | 4.00 | 50.0% |" in kernels.table({"kernels": found})


@pytest.mark.usefixtures("bench")
def test_arithmetic_of_the_kernels() -> None:
    from speed import kernels

    plain = kernels.flops_per_pixel("register/f32/ignore", 0.0)
    colour = kernels.flops_per_pixel("register/u8x3/ignore", 0.0)
    assert plain is not None and colour is not None
    assert colour - plain == 2 * kernels.BILINEAR
    # By hand, at an edge in every pixel: the Gram matrix of 13 columns has 91 products, in x and y.
    with_edges = kernels.normal_equations(11, 1.0) - kernels.normal_equations(11, 0.0)
    assert with_edges == 11 + 14 * 11 + 9 + 2 * 2 * 91
    assert kernels.flops_per_pixel("search", 0.0) is None


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
    ours = xcalib.metrics.nec(peer.gray(frame.reference), image, mask, floor=floor)
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
