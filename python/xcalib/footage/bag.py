"""Image topics of ROS 1 and ROS 2 bags and of MCAP files, through the library rosbags."""

from __future__ import annotations

import contextlib
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from .._core import Lens, natural_order
from ..frames import DecodeError, Image, InputError, as_image, is_truncated, quiet_opencv
from .stream import Stream, Times

if TYPE_CHECKING:
    from rosbags.highlevel import AnyReader

BAG_SUFFIXES = (".bag", ".mcap", ".db3")

RAW, COMPRESSED = "sensor_msgs/msg/Image", "sensor_msgs/msg/CompressedImage"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
# Lenses by the distortion models of camera_info.
LENSES = {
    "plumb_bob": "brown",
    "rational_polynomial": "brown",
    "equidistant": "fisheye",
    "fisheye": "fisheye",
}

HEADER_STAMPS, RECORDING_TIMES = "header stamps", "times of recording"
MAX_REPEATS = 0.05
"""Share of a topic's header stamps that may repeat the one before."""

# Type, channels, and how to get to gray or to blue-green-red.
ENCODINGS: dict[str, tuple[type[np.generic], int, int | None]] = {
    "mono8": (np.uint8, 1, None),
    "8UC1": (np.uint8, 1, None),
    "mono16": (np.uint16, 1, None),
    "16UC1": (np.uint16, 1, None),
    "32FC1": (np.float32, 1, None),
    "bgr8": (np.uint8, 3, None),
    "8UC3": (np.uint8, 3, None),
    "rgb8": (np.uint8, 3, cv2.COLOR_RGB2BGR),
    "bgra8": (np.uint8, 4, cv2.COLOR_BGRA2BGR),
    "rgba8": (np.uint8, 4, cv2.COLOR_RGBA2BGR),
    "bgr16": (np.uint16, 3, None),
    "rgb16": (np.uint16, 3, cv2.COLOR_RGB2BGR),
    **{
        f"bayer_{pattern}{bits}": (dtype, 1, getattr(cv2, f"COLOR_BAYER_{pattern.upper()}2BGR"))
        for pattern in ("rggb", "bggr", "gbrg", "grbg")
        for bits, dtype in ((8, np.uint8), (16, np.uint16))
    },
    "8UC4": (np.uint8, 4, cv2.COLOR_BGRA2BGR),
    "16SC1": (np.int16, 1, None),
    "yuv422_yuy2": (np.uint8, 2, cv2.COLOR_YUV2BGR_YUY2),
    "yuyv": (np.uint8, 2, cv2.COLOR_YUV2BGR_YUY2),
    "yuv422": (np.uint8, 2, cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": (np.uint8, 2, cv2.COLOR_YUV2BGR_UYVY),
    "nv21": (np.uint8, 1, cv2.COLOR_YUV2BGR_NV21),
}
PLANAR = {"nv21": 1.5}
"""Encodings with planes below each other: rows of the message for each row of the image."""

REPAIR = {
    ".bag": "`rosbag reindex` (of ROS 1) repairs those that were cut short",
    ".mcap": "`mcap recover` repairs those that were cut short",
}
"""By suffix."""


def is_bag(path: Path) -> bool:
    """Whether the path is a bag: a file of its suffixes (also a pattern of them, the parts of a
    split one), a ROS 2 folder, or a folder with the parts of a ROS 1 bag and nothing else.
    """
    if path.suffix.lower() in BAG_SUFFIXES:
        return True
    if path.is_dir():
        files = [file for file in path.iterdir() if not file.name.startswith(".")]
        if files and all(file.suffix.lower() == ".bag" for file in files):
            return True
    metadata = path / "metadata.yaml"  # a name that folders of images may use too
    return metadata.is_file() and b"rosbag2_bagfile_information" in metadata.read_bytes()


class BagImages(Stream):
    """The images of one topic; their times are the header stamps, else the times of recording.

    Topics that are paired go by the same of the two, see `one_clock`.
    """

    clocks: dict[str, Times]
    """The times that can be used, by their names, the better first."""
    clock: str
    """The name of those in use; ``""``: none."""
    flaws: str
    """What is wrong with the header stamps, or ''."""

    def __init__(self, path: Path, topic: str) -> None:
        super().__init__()
        self.path = path
        self._bag = _opened(path)
        self.topic, self._kind = _image_topic(self._bag, path, topic)
        self._connections = [c for c in self._bag.connections if c.topic == self.topic]
        self._logged: list[int] = []
        stamps: list[int] = []
        try:
            for _, logged, data in self._bag.messages(self._connections):
                self._logged.append(logged)
                stamps.append(self._stamp(data, len(stamps)))
        except InputError:
            raise
        except Exception as error:  # each storage of rosbags has errors of its own
            where = self.where(len(stamps))
            raise InputError(
                f"{where}: not readable, the bag is damaged: {error}{repair_hint(path)}"
            ) from None
        if not stamps:
            raise InputError(f"{path}#{self.topic}: no message, expected images")
        self.flaws, usable = _flaws(stamps)
        self.clocks = {}
        if usable:
            self.clocks[HEADER_STAMPS] = np.array(stamps, np.int64) * np.float64(1e-9)
        if (np.diff(self._logged) > 0).all():
            self.clocks[RECORDING_TIMES] = np.array(self._logged, np.int64) * np.float64(1e-9)
        self.use_clock(next(iter(self.clocks), ""))
        self._messages: Iterator[tuple[Any, int, bytes]] = iter(())
        self._next = -1

    def use_clock(self, name: str) -> None:
        """Go by the times of this name, of `clocks`; by none where it is not there."""
        self.clock = name if name in self.clocks else ""
        self.times = self.clocks.get(name)

    def _stamp(self, data: bytes, index: int) -> int:
        """Nanoseconds of the header, which stands first in both kinds of image."""
        if len(data) < 12:
            raise InputError(f"{self.where(index)}: {len(data)} bytes, expected an image message")
        if self._bag.is2:
            seconds, nanoseconds = struct.unpack_from("<iI" if data[1] & 1 else ">iI", data, 4)
        else:
            seconds, nanoseconds = struct.unpack_from("<II", data, 4)
        return int(seconds) * 10**9 + int(nanoseconds)

    def __len__(self) -> int:
        return len(self._logged)

    def read(self, index: int) -> Image:
        try:
            if index != self._next:
                # Messages of one time of recording come in the order of the bag.
                logged = self._logged[index]
                self._messages = self._bag.messages(self._connections, start=logged)
                for _ in range(index - self._logged.index(logged)):
                    next(self._messages)
            self._next = -1  # nowhere known, unless this message comes
            connection, _, data = next(self._messages)
            self._next = index + 1
            message: Any = self._bag.deserialize(data, connection.msgtype)
        except Exception as error:  # numpy's, struct's and rosbags' own
            raise DecodeError(f"{self.where(index)}: cannot decode the message: {error}") from None
        if self._kind != COMPRESSED:
            return _unpacked(message, self.where(index))
        if "compresseddepth" in message.format.lower():
            return _decompressed_depth(message, self.where(index))
        return _decompressed(message, self.where(index))

    def name(self, index: int) -> str:
        return f"{index:06d}"

    def where(self, index: int) -> str:
        return f"{self.path}#{self.topic} frame {index}"

    def file(self, index: int) -> Path:
        return self.path


def _flaws(stamps: list[int]) -> tuple[str, bool]:
    """What is wrong with header stamps, or '', and whether they can be used all the same.

    A stamp that repeats is one frame's matter: pairing by time leaves the second of the two out.
    """
    if stamps[0] <= 0:
        return "are not set", False
    steps = np.diff(np.array(stamps, np.int64))
    if (steps < 0).any():
        return f"fall at frame {int(np.argmax(steps < 0)) + 1}", False
    repeats = int((steps == 0).sum())
    if not repeats:
        return "", True
    first = int(np.argmax(steps == 0)) + 1
    text = f"repeat {repeats} time{'s' * (repeats > 1)}, first at frame {first}"
    return text, repeats <= max(1, MAX_REPEATS * len(stamps))


def one_clock(*streams: Stream) -> None:
    """Let the topics of bags among the streams go by one kind of time.

    By header stamps where all can, else by the times of recording where all can, else by none: two
    kinds differ by what the recorder waited, which is no offset of the cameras.
    """
    topics = [stream for stream in streams if isinstance(stream, BagImages)]
    for name in (HEADER_STAMPS, RECORDING_TIMES, ""):
        if all(name in topic.clocks for topic in topics) or not name:
            for topic in topics:
                topic.use_clock(name)
            break


def clock_line(*streams: Stream) -> str:
    """By which times the topics of bags among the streams go, where that needs saying, or ''."""
    topics = [stream for stream in streams if isinstance(stream, BagImages)]
    flaws = [f"the header stamps of {t.topic} {t.flaws}" for t in topics if t.flaws]
    if not flaws:
        return ""
    used = {
        HEADER_STAMPS: "header stamps are used; frames whose stamp repeats are left out",
        RECORDING_TIMES: "the times of recording are used for all topics",
        "": "nor do the times of recording rise: no times are used",
    }
    return f"clock: {'; '.join(flaws)}; {used[topics[0].clock]}"


def _opened(path: Path) -> AnyReader:
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise InputError(f"{path}: bags need the library rosbags, `pip install rosbags`") from None
    paths = _parts(path)
    try:
        # Bags in sqlite before ROS Iron carry no definitions of their messages.
        bag = AnyReader(paths, default_typestore=get_typestore(Stores.ROS2_HUMBLE))
        bag.open()
    except Exception as error:  # each storage of rosbags has errors of its own
        raise InputError(f"{path}: not a readable bag: {error}{repair_hint(path)}") from None
    return bag


def _parts(path: Path) -> list[Path]:
    """The files of a bag that is split in several, by a pattern or in a folder; else itself."""
    if path.is_dir() and not (path / "metadata.yaml").is_file():
        parts = list(path.glob("*.bag"))
    elif not path.exists() and "*" in path.name:
        parts = list(path.parent.glob(path.name))
    else:
        parts = [path]
    if not parts or not parts[0].exists():
        raise InputError(f"{path}: no such bag")
    return [parts[index] for index in natural_order([str(part) for part in parts])]


def repair_hint(path: Path) -> str:
    """The tool that repairs a bag of this kind, to end a message with."""
    hint = REPAIR.get(path.suffix.lower(), "`ros2 bag reindex` repairs those that were cut short")
    return f"; {hint}"


def _topics(bag: AnyReader, *kinds: str) -> dict[str, str]:
    return {c.topic: c.msgtype for c in bag.connections if c.msgtype in kinds}


def _one_slash(topic: str) -> str:
    """As ROS takes names: slashes that follow each other are one."""
    return re.sub("/+", "/", topic)


def _image_topic(bag: AnyReader, path: Path, topic: str) -> tuple[str, str]:
    """A topic with images and its message type; without a name, the only one there is."""
    found = _topics(bag, RAW, COMPRESSED)
    if not topic and len(found) == 1:
        return next(iter(found.items()))
    for name, kind in found.items():
        if topic and _one_slash(name).strip("/") == _one_slash(topic).strip("/"):
            return name, kind
    if topic not in found:
        names = ", ".join(sorted(found)) or "none"
        raise InputError(
            f"{path}#{topic}: expected {path}#TOPIC with a topic of images; it has {names}"
        )
    return topic, found[topic]


def _unpacked(message: Any, where: str) -> Image:
    """The pixels of a sensor_msgs/Image."""
    if message.encoding not in ENCODINGS:
        raise InputError(
            f"{where}: encoding is {message.encoding!r}, expected one of {', '.join(ENCODINGS)}"
        )
    dtype, channels, conversion = ENCODINGS[message.encoding]
    width, height, step = message.width, message.height, message.step
    pixel = np.dtype(dtype).itemsize * channels
    data: NDArray[np.uint8] = np.asarray(message.data, np.uint8)
    all_rows = int(height * PLANAR.get(message.encoding, 1))
    if min(width, height) < 1 or step < width * pixel or data.size < step * all_rows:
        raise DecodeError(
            f"{where}: {data.size} bytes, rows of {step}, are no {width}x{height}"
            f" {message.encoding} image"
        )
    rows = np.ascontiguousarray(data[: step * all_rows].reshape(all_rows, step)[:, : width * pixel])
    order: Literal["<", ">"] = ">" if message.is_bigendian else "<"
    image: Image = rows.view(np.dtype(dtype).newbyteorder(order)).astype(dtype, copy=False)
    if channels > 1:
        image = image.reshape(height, width, channels)
    if dtype == np.int16:
        return image.astype(np.float32)  # which holds all of it
    return image.copy() if conversion is None else cv2.cvtColor(image, conversion)


def _decompressed(message: Any, where: str) -> Image:
    """The pixels of a sensor_msgs/CompressedImage: JPEG, PNG or what else OpenCV decodes."""
    return _decoded(np.asarray(message.data, np.uint8), message.format, where)


def _decompressed_depth(message: Any, where: str) -> Image:
    """A depth image of image_transport's compressed_depth: ``(h, w)``, uint16 [mm] or float32 [m].

    Three numbers of 4 bytes, then a PNG. Of a 16UC1 image that is the depth itself; of a 32FC1 one
    its inverse: depth = A / (value - B) with the second and third number, 0 unknown.
    """
    data = np.asarray(message.data, np.uint8)
    values = _decoded(data[12:], message.format, where)
    if values.ndim != 2 or values.dtype != np.uint16:
        shape = "x".join(map(str, values.shape))
        raise DecodeError(f"{where}: depth is {shape} {values.dtype}, expected a 16-bit gray PNG")
    if not message.format.startswith("32FC1"):
        return values
    scale, shift = data[4:12].view("<f4").tolist()
    inverse = values.astype(np.float32) - np.float32(shift)
    known = (values > 0) & (inverse > 0)
    depth: Image = np.divide(np.float32(scale), inverse, out=np.zeros_like(inverse), where=known)
    return depth


def _decoded(data: NDArray[np.uint8], kind: str, where: str) -> Image:
    """An encoded image, without alpha."""
    image: Image | None = None
    with quiet_opencv(), contextlib.suppress(cv2.error):
        image = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    if image is None or is_truncated(data.tobytes()):
        raise DecodeError(
            f"{where}: cannot decode {data.size} bytes, format {kind!r}; expected a JPEG or PNG"
        )
    return as_image(image, where)


@dataclass(frozen=True)
class CameraInfo:
    """What a driver says of its camera."""

    topic: str
    width: int
    height: int
    """[px]"""
    K: NDArray[np.float64]
    """(3, 3) intrinsic matrix [px]."""
    model: str
    """Distortion model, such as plumb_bob."""
    D: NDArray[np.float64]
    """Coefficients of the model."""

    @property
    def is_calibrated(self) -> bool:
        """Whether it says anything: drivers without a calibration leave K at 0."""
        return bool(self.K[0, 0] != 0)

    @property
    def lens(self) -> Lens | None:
        """The lens of the model; None where there is no such, or no calibration."""
        if not self.is_calibrated:
            return None
        model = LENSES.get(self.model)
        if not self.D.any() and model != "fisheye":
            return Lens()
        try:
            return None if model is None else Lens(model, self.D.tolist())
        except ValueError:  # not so many coefficients
            return None

    def line(self) -> str:
        """In words; the intrinsics and the lens as the options of ``calibrate`` take them."""
        fx, fy, cx, cy = self.K[0, 0], self.K[1, 1], self.K[0, 2], self.K[1, 2]
        numbers = ",".join(f"{value:.6g}" for value in self.D)
        bent = f"distortion {self.model} {numbers}, which no lens here is"
        if (lens := self.lens) is not None:
            bent = f"lens {lens.model}" + (f":{numbers}" if lens.coefficients else "")
        if not self.is_calibrated:
            return f"{self.topic}: {self.width}x{self.height} px, uncalibrated (K is all 0)"
        return (
            f"{self.topic}: {self.width}x{self.height} px,"
            f" FX,FY,CX,CY {fx:.6g},{fy:.6g},{cx:.6g},{cy:.6g} px, {bent}"
        )


def lens_of_topic(name: str | Path) -> Lens | None:
    """The lens that the camera_info beside a topic of images, ``BAG#TOPIC``, has; None if none."""
    path, _, topic = str(name).partition("#")
    if not is_bag(Path(path)):
        return None
    try:
        infos = camera_infos(path)
    except InputError:
        return None
    for info in infos:
        beside = info.topic.rpartition("/")[0]
        if f"{topic}/".startswith(f"{beside}/") or (not topic and len(infos) == 1):
            # What is rectified has been through the lens, and P is its camera.
            return Lens() if is_rectified(topic) and info.is_calibrated else info.lens
    return None


def is_rectified(topic: str) -> bool:
    """Whether the images of a topic are rectified, by ROS' names for them: image_rect, ..."""
    return "rect" in topic.rpartition("/")[2].split("_")


def _on_its_image(message: Any, K: NDArray[np.float64]) -> tuple[int, int, NDArray[np.float64]]:
    """Size and matrix of the image that is published: camera_info's are of the full sensor, of
    which a region may be read out, and pixels binned.
    """
    roi = message.roi
    width, height = roi.width or message.width, roi.height or message.height
    bins = np.array([max(1, message.binning_x), max(1, message.binning_y)], np.float64)
    on_image = K.copy()
    on_image[:2, 2] -= (roi.x_offset, roi.y_offset)
    on_image[:2, :2] /= bins[:, None]
    on_image[:2, 2] = (on_image[:2, 2] + 0.5) / bins - 0.5
    return int(width // bins[0]), int(height // bins[1]), on_image


def camera_infos(path: str | Path) -> list[CameraInfo]:
    """The first message of every camera_info topic of a bag, by topic; `InputError` if none."""
    bag = _opened(Path(path))
    try:
        infos = []
        for topic in sorted(_topics(bag, CAMERA_INFO)):
            connections = [c for c in bag.connections if c.topic == topic]
            for connection, _, data in bag.messages(connections):
                message: Any = bag.deserialize(data, connection.msgtype)
                # ROS 1 has capital names for what ROS 2 has in small ones.
                K, D = (getattr(message, n, getattr(message, n.upper(), None)) for n in "kd")
                matrix = np.asarray(K, np.float64).reshape(3, 3)
                width, height = message.width, message.height
                if matrix[0, 0] != 0:
                    width, height, matrix = _on_its_image(message, matrix)
                infos.append(
                    CameraInfo(
                        topic,
                        width,
                        height,
                        matrix,
                        message.distortion_model,
                        np.asarray(D, np.float64),
                    )
                )
                break
    finally:
        bag.close()
    if not infos:
        raise InputError(f"{path}: no camera_info with messages in it")
    return infos
