"""A source that is late by whole frames: told, named, and taken up."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import Result

from conftest import Process, run
from xcalib import Registrar, Rig, synthetic
from xcalib.depth import read_depth
from xcalib.frames import Image, write_image
from xcalib.synthetic.rigs import rotation_z, turned_towards

FRAMES, LATE = 16, 1


class Uneven(synthetic.Street):
    """As a car drives: no two frames are as far apart as the next two."""

    def pose(self, index: int) -> tuple[Image, Image]:
        way = self.speed * (index + 2 * np.sin(index / 3))
        yaw, pitch = 0.03 * np.sin(index / 6), -0.02 + 0.006 * np.sin(0.9 * index)
        R = rotation_z(0.005 * np.sin(index / 3))
        R = R @ turned_towards(np.array([np.sin(yaw), np.sin(pitch), 1.0])).T
        return R, -R @ np.array([1.6, -1.45, way])


@pytest.fixture(scope="session")
def late(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with visible, thermal and depth of a drive, thermal a frame late, and rig.yaml."""
    folder = tmp_path_factory.mktemp("late")
    rig = synthetic.random_rig(
        seed=2,
        **{"width": 256, "height": 192, "source_width": 256, "source_height": 200},
        **{"hfov_deg": (45, 60), "fov_ratio": (0.8, 1.1)},
        **{"max_offset": 0.1, "max_baseline": 0.2},
    )
    street = Uneven(rig, num_frames=FRAMES + LATE, seed=2, speed=0.5)
    frames = [street.frame(index) for index in range(FRAMES + LATE)]
    for index in range(LATE, FRAMES + LATE):
        name = f"{index:04d}"
        write_image(folder / "visible" / f"{name}.png", frames[index].reference)
        write_image(folder / "thermal" / f"{name}.png", frames[index - LATE].source)
        counts = np.rint(256 * frames[index].depth).clip(0, 65535).astype(np.uint16)
        write_image(folder / "depth" / f"{name}.png", counts)
    rig.save(folder / "rig.yaml")
    return folder


def given(folder: Path, out: Path, *more: str) -> tuple[str, ...]:
    footage = folder / "visible", folder / "thermal", "--depth", folder / "depth"
    return tuple(map(str, ("calibrate", *footage, "-o", out, *more)))


def error(found: Path, folder: Path) -> float:
    """Median distance of where a rig and the true one map the pixels of a frame [source px]."""
    depth = read_depth(folder / "depth" / "0006.png")
    maps = [Registrar(Rig.load(rig)).map(depth) for rig in (found, folder / "rig.yaml")]
    return float(np.nanmedian(np.linalg.norm(maps[0] - maps[1], axis=-1)))


NAMED = re.compile(
    r"not to be trusted: (.*; )?the source is 1 frame late \(NEC \+[0-9.]+ \+- [0-9.]+ over 1\d"
    r" frames\); try --time-offset 1f, or auto"
)


def test_a_late_source_is_named_by_both_commands(
    late: Path, tmp_path: Path, both: Callable[..., tuple[Process, Result]]
) -> None:
    report = tmp_path / "OUT.json"
    ours, theirs = both(*given(late, tmp_path / "OUT.yaml", "--report", str(report)))
    assert ours.returncode == 3
    assert NAMED.search(ours.stderr), ours.stderr
    assert NAMED.search(theirs.stderr), theirs.stderr
    assert error(tmp_path / "p.yaml", late) > 1.5
    for name in ("c", "p"):
        lag = json.loads((tmp_path / f"{name}.json").read_text())["lag"]
        assert lag["frames"] == 1
        fits = {fit["lag"]: fit for fit in lag["fits"]}
        assert fits[0]["gain"] == 0 and fits[1]["gain"] > 3 * fits[1]["error"]
        # The way of a frame looks like a source that stands so much further ahead.
        ahead = (fits[lag]["translation_m"][2] for lag in (0, 1))
        assert 0.1 < np.subtract(*ahead) < 1.0
        assert {"pan_deg", "tilt_deg", "skew_px"} <= fits[0].keys()


def test_the_lag_is_taken_up_when_asked_for(late: Path, tmp_path: Path) -> None:
    result = run(*given(late, tmp_path / "auto.yaml", "--time-offset", "auto"))
    assert result.exit_code == 0, result.output
    assert "clock offset: the source is 1 frame late (NEC +" in result.stderr
    assert error(tmp_path / "auto.yaml", late) < 0.4


def test_the_lag_can_be_given_and_then_none_is_left(
    late: Path, tmp_path: Path, cli: Callable[..., Process]
) -> None:
    report = tmp_path / "report.json"
    more = ("--time-offset", "1f", "--report", str(report))
    done = cli(*given(late, tmp_path / "given.yaml", *more))
    assert done.returncode == 0, done.stderr
    assert json.loads(report.read_text())["lag"]["frames"] == 0
    assert error(tmp_path / "given.yaml", late) < 0.4
    assert "15 pairs by name; source late by +1 of its frames" in done.stderr


def test_stills_are_not_looked_at(late: Path, tmp_path: Path) -> None:
    """Names that rise by two: nothing says that the next frame is the next moment."""
    for kind in ("visible", "thermal", "depth"):
        (tmp_path / kind).mkdir()
        for path in (late / kind).iterdir():
            (tmp_path / kind / f"{2 * int(path.stem):04d}.png").symlink_to(path)
    result = run(*given(tmp_path, tmp_path / "rig.yaml", "--report", str(tmp_path / "report.json")))
    assert "late" not in result.stderr
    assert json.loads((tmp_path / "report.json").read_text())["lag"] is None


def test_a_rig_tells_lags_of_frames_without_times(
    late: Path, tmp_path: Path, both: Callable[..., tuple[Process, Result]]
) -> None:
    """`evaluate` and `register` have the rig: they take the lag that registers best."""
    footage = late / "visible", late / "thermal", "--depth", late / "depth"
    arguments = ("evaluate", late / "rig.yaml", *footage)
    right = both(*arguments, "--time-offset", "auto")
    for stderr in (right[0].stderr, right[1].stderr):
        assert "clock offset: frames register best with the source 1 frame late\n" in stderr
        assert "15 pairs by name; source late by +1 of its frames" in stderr
