"""Bags that tests write."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from xcalib.frames import Image


def encoded(image: Image, encoding: str) -> Image:
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB) if encoding == "rgb8" else image


def write_bag(path: Path, kind: str, topics: dict[str, tuple[str, list[Image]]]) -> str:
    """A bag with topics of (encoding, images), 0.1 s apart, and a camera_info; what to open.

    Compressed: ``png``, or ``KIND; CODEC`` with the bytes themselves for images.
    """
    pytest.importorskip("rosbags")
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
    types = store.types
    pack: Any = store.serialize_ros1 if kind == "ros1" else store.serialize_cdr

    def header(stamp: int) -> Any:
        time = types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
        extra = (0,) if kind == "ros1" else ()
        return types["std_msgs/msg/Header"](*extra, stamp=time, frame_id="c")

    if kind == "ros1":
        writer: Any = rosbag1.Writer(path)
    else:
        plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
        writer = rosbag2.Writer(path, version=9, storage_plugin=plugin)
    with writer:
        for number, (topic, (encoding, images)) in enumerate(topics.items()):
            compressed = encoding == "png" or ";" in encoding
            name = "sensor_msgs/msg/" + ("CompressedImage" if compressed else "Image")
            connection = writer.add_connection(topic, name, typestore=store)
            for index, image in enumerate(images):
                stamp = 1_700_000_000_000_000_000 + index * 100_000_000 + number * 10_000_000
                if compressed:
                    data = cv2.imencode(".png", image)[1].ravel() if encoding == "png" else image
                    message = types[name](header(stamp), encoding, data)
                else:
                    pixels = np.ascontiguousarray(encoded(image, encoding))
                    height, width = image.shape[:2]
                    message = types[name](
                        *(header(stamp), height, width, encoding, 0),
                        *(pixels.nbytes // height, pixels.view(np.uint8).ravel()),
                    )
                # Two messages share a time of recording; the header tells them apart.
                writer.write(connection, stamp // 200_000_000 * 200_000_000, pack(message, name))
        name = "sensor_msgs/msg/CameraInfo"
        connection = writer.add_connection("/visible/camera_info", name, typestore=store)
        K = np.array([300.0, 0, 160, 0, 301, 120, 0, 0, 1])
        roi = types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False)
        info = types[name](
            *(header(0), 240, 320, "plumb_bob", np.array([0.1, 0, 0, 0, 0])),
            *(K, np.eye(3).ravel(), np.zeros(12), 0, 0, roi),
        )
        writer.write(connection, 1_700_000_000_000_000_000, pack(info, name))
    return str(next(path.glob("*.mcap")) if kind == "mcap" else path)
