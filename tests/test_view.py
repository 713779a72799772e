"""Overlays as images and videos, and recordings that others read."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from conftest import FRAMES, run
from xcalib import Registrar, Rig
from xcalib.footage import camera_infos
from xcalib.frames import read_image
from xcalib.overlays import EDGE


def view(rendered: Path, output: Path, *more: Any) -> Any:
    folders = (rendered / "visible", rendered / "thermal", "--depth", rendered / "depth")
    return run("view", rendered / "rig.yaml", *folders, "-o", output, "--quiet", *more)


def test_edges_on_the_reference(rendered: Path, tmp_path: Path) -> None:
    result = view(rendered, tmp_path / "out")
    assert result.exit_code == 0, result.output
    files = sorted((tmp_path / "out").iterdir())
    references = sorted((rendered / "visible").iterdir())
    assert [file.stem for file in files] == [file.stem for file in references]
    shown, reference = read_image(files[0]), read_image(references[0])
    drawn = (shown == EDGE).all(axis=2)
    assert 0.01 < drawn.mean() < 0.3
    np.testing.assert_array_equal(shown[~drawn], reference[~drawn])


@pytest.mark.parametrize("name", ["a.mp4", "a.mkv"])
def test_a_video(rendered: Path, tmp_path: Path, name: str) -> None:
    assert view(rendered, tmp_path / name, "--overlay", "side").exit_code == 0
    assert [file.name for file in tmp_path.iterdir()] == [name]
    video = cv2.VideoCapture(str(tmp_path / name))
    frames = []
    while (read := video.read())[0]:
        frames.append(read[1])
    reference = read_image(sorted((rendered / "visible").iterdir())[0])
    assert len(frames) == FRAMES and frames[0].shape[1] == 2 * reference.shape[1]
    left = frames[0][:, : reference.shape[1]].astype(float)
    assert np.abs(left - reference).mean() < 6


def test_a_recording_is_read_again(rendered: Path, tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    from rosbags.highlevel import AnyReader

    result = view(rendered, tmp_path / "a.mcap")
    assert result.exit_code == 0, result.output
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]
    rig = Rig.load(rendered / "rig.yaml")
    for info in camera_infos(tmp_path / "a.mcap"):
        camera = rig.reference if "visible" in info.topic else rig.source
        K = np.array(camera.K)
        K[0, 1] = 0  # which ROS cannot hold
        np.testing.assert_array_equal(info.K, K)
        assert (info.width, info.height) == (camera.width, camera.height)
    folders = {
        kind: sorted((rendered / kind).iterdir()) for kind in ("visible", "thermal", "depth")
    }
    depth = read_image(folders["depth"][0]).astype(np.float32) / 256
    image, mask = Registrar(rig).register(read_image(folders["thermal"][0]), depth)
    first = {}
    with AnyReader([tmp_path / "a.mcap"]) as bag:
        for connection, _, data in bag.messages():
            first.setdefault(connection.topic, bag.deserialize(data, connection.msgtype))
        counts = {c.topic: c.msgcount for c in bag.connections}
    assert counts["/thermal/registered"] == counts["/visible/image_raw"] == FRAMES
    for topic, truth in (("/thermal/registered", image), ("/thermal/mask", mask)):
        message = first[topic]
        pixels = np.asarray(message.data).view(truth.dtype).reshape(message.height, message.width)
        np.testing.assert_array_equal(pixels, truth)
        assert message.header.frame_id == "visible_optical"
    (tf,) = first["/tf_static"].transforms
    assert (tf.header.frame_id, tf.child_frame_id) == ("visible_optical", "thermal_optical")
    place = [getattr(tf.transform.translation, axis) for axis in "xyz"]
    np.testing.assert_allclose(place, -rig.R.T @ rig.t, atol=1e-12)


def test_bad_usage(refused: Callable[..., str], rendered: Path, tmp_path: Path) -> None:
    folders = (rendered / "visible", rendered / "thermal", "--depth", rendered / "depth")
    rig = rendered / "rig.yaml"
    assert "visible" in refused("view", rig, *folders, "-o", rendered / "visible")
    assert "--overlay" in refused("view", rig, *folders, "-o", tmp_path / "o", "--overlay", "x")


def test_a_rerun_recording(rendered: Path, tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="no rerun: `pip install rerun-sdk`")
    result = view(rendered, tmp_path / "a.rrd")
    assert result.exit_code == 0, result.output
    checked = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "print", str(tmp_path / "a.rrd")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stderr
    for entity in ("/visible/image", "/rig/thermal/image", "/cloud", "/metrics/nec"):
        assert entity in checked.stdout
