"""Topics of bags that are paired go by one kind of time."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from conftest import run
from xcalib import Rig
from xcalib.footage import open_pairs, open_stream
from xcalib.footage.bag import HEADER_STAMPS, clock_line, one_clock
from xcalib.frames import list_files, read_image

START, FRAME = 1_700_000_000_000_000_000, 100_000_000


def write_bag(path: Path, topics: dict[str, tuple[list[np.ndarray], list[int], list[int]]]) -> str:
    """A bag of gray topics: images, header stamps and times of recording [ns since the start]."""
    pytest.importorskip("rosbags")
    from rosbags import rosbag2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types, name = store.types, "sensor_msgs/msg/Image"
    plugin = rosbag2.StoragePlugin.MCAP
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        for topic, (images, stamps, logged) in topics.items():
            connection = writer.add_connection(topic, name, typestore=store)
            for image, stamp, log in zip(images, stamps, logged, strict=True):
                time = types["builtin_interfaces/msg/Time"](
                    (START + stamp) // 10**9 if stamp >= 0 else 0, max(stamp, 0) % 10**9
                )
                header: Any = types["std_msgs/msg/Header"](stamp=time, frame_id="c")
                height, width = image.shape[:2]
                kind = "mono8" if image.dtype == np.uint8 else "32FC1"
                pixels = np.ascontiguousarray(image).view(np.uint8).ravel()
                message = types[name](header, height, width, kind, 0, pixels.size // height, pixels)
                writer.write(connection, START + log, store.serialize_cdr(message, name))
    return str(next(path.glob("*.mcap")))


def numbered(count: int) -> list[np.ndarray]:
    return [np.full((40, 60), 10 * i, np.uint8) for i in range(count)]


def steady(count: int) -> list[int]:
    return [i * FRAME for i in range(count)]


def recorded(stamps: list[int], wait: int) -> list[int]:
    """The recorder waits longer for one topic than for the other."""
    return [i * FRAME + wait for i in range(len(stamps))]


LATE = 2 * FRAME
"""What the recorder waits longer for thermal than for visible frames."""


def bag_with(path: Path, thermal: list[int], visible: list[int] | None = None) -> str:
    visible = visible or steady(len(thermal))
    count = len(thermal)
    return write_bag(
        path,
        {
            "/v": (numbered(count), visible, recorded(visible, 0)),
            "/t": (numbered(count), thermal, recorded(thermal, LATE)),
        },
    )


def test_a_stamp_that_repeats_once_does_not_part_the_clocks(tmp_path: Path) -> None:
    """Recording times of one topic beside stamps of the other are two frames apart."""
    stamps = steady(12)
    stamps[5] = stamps[4]
    bag = bag_with(tmp_path / "bag", stamps)
    pairs = open_pairs(f"{bag}#/v", f"{bag}#/t")
    pairing = pairs.pairing
    assert pairing.method == "time" and pairing.gap == 0
    # Frame 5 of the thermal topic has the time of frame 4, which is wrong: it is left out.
    rest = [i for i in range(12) if i != 5]
    assert pairing.references.tolist() == rest and pairing.sources.tolist() == rest
    line = clock_line(pairs.all_references, pairs.all_sources)
    assert line == (
        "clock: the header stamps of /t repeat 1 time, first at frame 5; header stamps are used;"
        " frames whose stamp repeats are left out"
    )


@pytest.mark.parametrize(
    ("spoilt", "why"),
    [
        ({5: 3 * FRAME}, "of /t fall at frame 5"),
        ({5: 4 * FRAME, 8: 7 * FRAME, 10: 9 * FRAME}, "of /t repeat 3 times, first at frame 5"),
        (dict.fromkeys(range(12), -1), "of /t are not set"),
    ],
)
def test_stamps_that_cannot_be_used_send_both_topics_to_recording_time(
    tmp_path: Path, spoilt: dict[int, int], why: str
) -> None:
    stamps = steady(12)
    for index, stamp in spoilt.items():
        stamps[index] = stamp
    bag = bag_with(tmp_path / "bag", stamps)
    alone = open_stream(f"{bag}#/v")
    assert alone.clock == HEADER_STAMPS  # type: ignore[attr-defined]
    pairs = open_pairs(f"{bag}#/v", f"{bag}#/t")
    # By what the recorder wrote, thermal frame i came with visible frame i + 2.
    assert pairs.pairing.references.tolist() == list(range(2, 12))
    assert pairs.pairing.sources.tolist() == list(range(10))
    line = clock_line(pairs.all_references, pairs.all_sources)
    assert line == f"clock: the header stamps {why}; the times of recording are used for all topics"


def test_good_stamps_need_no_word_and_other_footage_is_left_alone(
    tmp_path: Path, rendered: Path
) -> None:
    bag = bag_with(tmp_path / "bag", steady(6))
    visible, thermal = open_stream(f"{bag}#/v"), open_stream(f"{bag}#/t")
    folder = open_stream(rendered / "visible")
    one_clock(visible, folder)
    assert clock_line(visible, thermal, folder) == "" and folder.times is None


def test_recording_times_that_rise_not_either_are_no_times(tmp_path: Path) -> None:
    stamps = steady(6)
    stamps[3] = 0
    images = numbered(6)
    topics = {"/v": (images, steady(6), steady(6)), "/t": (images, stamps, [0] * 6)}
    bag = write_bag(tmp_path / "bag", topics)
    pairs = open_pairs(f"{bag}#/v", f"{bag}#/t")
    assert pairs.pairing.method == "order"
    assert clock_line(pairs.all_references, pairs.all_sources).endswith("no times are used")


def test_the_commands_say_by_which_clock(rendered: Path, tmp_path: Path) -> None:
    """And a depth topic goes by the same."""
    visible, thermal = (
        [read_image(p) for p in list_files(rendered / kind)] for kind in ("visible", "thermal")
    )
    visible = [image[..., 1] for image in visible]
    metres = [np.full(image.shape, 9, np.float32) for image in visible]
    stamps = steady(len(visible))
    stamps[2] = stamps[3]
    late = recorded(stamps, LATE)
    topics = {
        "/v": (visible, steady(len(visible)), recorded(stamps, 0)),
        "/t": (thermal, stamps, recorded(stamps, 0)),
        "/d": (metres, steady(len(visible)), recorded(stamps, 0)),
        "/bad": (metres, [-1] * len(visible), late),
    }
    bag = write_bag(tmp_path / "bag", topics)
    Rig.load(rendered / "rig.yaml").save(tmp_path / "rig.yaml")
    given = ("evaluate", tmp_path / "rig.yaml", f"{bag}#/v", f"{bag}#/t", "--depth")
    result = run(*given, f"{bag}#/d")
    assert result.exit_code == 0, result.output
    assert "clock: the header stamps of /t repeat 1 time, first at frame 3" in result.stderr
    refused = run(*given, f"{bag}#/bad")
    assert refused.exit_code == 2
    assert "go by header stamps, which the depth topic cannot" in refused.stderr
    assert "its header stamps are not set; expected one clock" in refused.stderr
