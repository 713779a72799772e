"""Registered frames as a recording: an MCAP file of ROS 2 messages, as Foxglove and ROS read it.

Topics: /visible/image_raw and /thermal/registered (both on the visible camera's pixels, in its
frame), /thermal/mask, camera_info of both cameras, and the pose between them on /tf_static.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ._core import InputError, Rig, keep_file
from .convert.format import NAMES
from .convert.loss import held
from .convert.pose import reference_from_source, wxyz_of
from .convert.ros import FORMAT, distortion
from .frames import Image
from .view import Registered

ENCODINGS = {
    ("uint8", 2): "mono8",
    ("uint16", 2): "mono16",
    ("float32", 2): "32FC1",
    ("uint8", 3): "bgr8",
    ("uint16", 3): "bgr16",
    ("float32", 3): "32FC3",
}


def write_recording(frames: Iterator[Registered], rig: Rig, output: Path) -> tuple[int, list[str]]:
    """Write all frames; returns how many there are, and what of the rig ROS cannot hold. The file
    appears under its name when it is whole.
    """
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise InputError(
            f"{output}: recordings need the library rosbags, `pip install rosbags`"
        ) from None
    # A recording is looked at, so that what ROS cannot hold is said, and no more.
    rig, lines = held(rig, FORMAT.title, FORMAT.lenses, math.inf)
    store = get_typestore(Stores.ROS2_HUMBLE)
    messages = Messages(store, rig)
    output.parent.mkdir(parents=True, exist_ok=True)
    count = 0
    with tempfile.TemporaryDirectory(dir=output.parent, prefix=".xcalib-view-") as folder:
        bag = Path(folder) / "bag"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connections: dict[str, Any] = {}

            def put(topic: str, message: Any, stamp: int) -> None:
                if topic not in connections:
                    kind = message.__msgtype__
                    connections[topic] = writer.add_connection(topic, kind, typestore=store)
                data = store.serialize_cdr(message, message.__msgtype__)
                writer.write(connections[topic], stamp, data)

            for frame in frames:
                stamp = round(frame.time * 1e9)
                if not count:
                    put("/tf_static", messages.pose(stamp), stamp)
                for name in NAMES:
                    put(f"/{name}/camera_info", messages.camera_info(name, stamp), stamp)
                put("/visible/image_raw", messages.image(frame.reference, stamp), stamp)
                put("/thermal/registered", messages.image(frame.image, stamp), stamp)
                put("/thermal/mask", messages.image(frame.mask, stamp), stamp)
                count += 1
        keep_file(next(bag.glob("*.mcap")), output)
    return count, lines


class Messages:
    """ROS 2 messages of a rig and its images."""

    def __init__(self, store: Any, rig: Rig) -> None:
        self._types, self._rig = store.types, rig

    def header(self, stamp: int, name: str) -> Any:
        """A stamp [ns] and the optical frame of a camera."""
        time = self._types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9))
        return self._types["std_msgs/msg/Header"](time, f"{name}_optical")

    def image(self, image: Image, stamp: int) -> Any:
        """An image on the reference's pixels."""
        encoding = ENCODINGS[str(image.dtype), image.ndim]
        rows = np.ascontiguousarray(image)
        height, width = rows.shape[:2]
        data = rows.view(np.uint8).ravel()
        return self._types["sensor_msgs/msg/Image"](
            *(self.header(stamp, NAMES[0]), height, width, encoding, 0, data.size // height, data)
        )

    def camera_info(self, name: str, stamp: int) -> Any:
        """A camera, not rectified."""
        camera = self._rig.reference if name == NAMES[0] else self._rig.source
        model, D = distortion(camera.lens)
        K = np.asarray(camera.K, np.float64)
        return self._types["sensor_msgs/msg/CameraInfo"](
            header=self.header(stamp, name),
            height=camera.height,
            width=camera.width,
            distortion_model=model,
            d=np.array(D, np.float64),
            k=K.ravel(),
            r=np.eye(3).ravel(),
            p=np.column_stack([K, np.zeros(3)]).ravel(),
            binning_x=0,
            binning_y=0,
            roi=self._types["sensor_msgs/msg/RegionOfInterest"](0, 0, 0, 0, False),
        )

    def pose(self, stamp: int) -> Any:
        """The source camera in the reference's axes."""
        T = reference_from_source(self._rig)
        w, x, y, z = wxyz_of(T)
        place = self._types["geometry_msgs/msg/Vector3"](*map(float, T[:3, 3]))
        turn = self._types["geometry_msgs/msg/Quaternion"](x, y, z, w)
        transform = self._types["geometry_msgs/msg/TransformStamped"](
            self.header(stamp, NAMES[0]),
            f"{NAMES[1]}_optical",
            self._types["geometry_msgs/msg/Transform"](place, turn),
        )
        return self._types["tf2_msgs/msg/TFMessage"]([transform])
