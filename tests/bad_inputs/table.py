"""What a row of the table is, and the small scene that rows spoil."""

from __future__ import annotations

import os
import shlex
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from xcalib.frames import encode_image

Content = bytes | str | None | Callable[[bytes], bytes]
"""Of a file: new, none, or made of what it is in the scene."""

RIG = """format: xcalib-rig
version: 1
reference: {width: 64, height: 48, fx: 60, fy: 60, cx: 31.5, cy: 23.5, skew: 0}
source: {width: 48, height: 36, fx: 45, fy: 45, cx: 23.5, cy: 17.5, skew: 0}
source_from_reference:
  quaternion_wxyz: [1, 0, 0, 0]
  translation_m: [-0.1, 0, 0]
"""

REGISTER = "register rig.yaml visible thermal --depth depth -o out"
EVALUATE = "evaluate rig.yaml visible thermal --depth depth"
CALIBRATE = "calibrate visible thermal --depth depth -o new.yaml"
INSPECT = "inspect rig.yaml"


@dataclass(frozen=True)
class Row:
    """A command on a scene that is spoiled, and how it must end."""

    name: str
    command: str
    message: str
    """Part of the one line on stderr."""
    files: Mapping[str, Content] = field(default_factory=dict)
    links: Mapping[str, str] = field(default_factory=dict)
    """Symbolic links, made after the files: where they are, and where they lead."""
    pipes: tuple[str, ...] = ()
    code: int = 2
    leaves: bool = False
    """Whether what was whole before is kept in the output."""
    only: str = ""
    """python or cli: what the other one does not have."""
    api: Callable[[], object] | None = None
    """The same in Python, where `api.call_of` cannot tell it from the command."""

    def words(self) -> list[str]:
        return shlex.split(self.command)

    def spoil(self, scene: Path) -> None:
        """Apply the row to a copy of the scene."""
        for name, content in self.files.items():
            path = scene / name
            if content is None:
                path.unlink()
                continue
            path.parent.mkdir(parents=True, exist_ok=True)
            if callable(content):
                content = content(path.read_bytes())
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        for name, target in self.links.items():
            (scene / name).parent.mkdir(parents=True, exist_ok=True)
            (scene / name).symlink_to(target)
        for name in self.pipes:
            os.mkfifo(scene / name)


def rig(old: str, new: str) -> Mapping[str, Content]:
    """The rig file with one text in place of another."""
    assert old in RIG, old
    return {"rig.yaml": RIG.replace(old, new, 1)}


def npy(header: str, data: bytes = b"", version: int = 1) -> bytes:
    """A .npy file of any header."""
    text = header.encode("latin1")
    return b"\x93NUMPY" + bytes([version, 0]) + struct.pack("<H", len(text)) + text + data


def cut(share: float) -> Callable[[bytes], bytes]:
    """The first part of a file."""
    return lambda data: data[: int(share * len(data))]


def picture(width: int, height: int, seed: int, channels: int = 1) -> NDArray[np.uint8]:
    """Blobs: edges everywhere, and some more in one place than in another."""
    random = np.random.default_rng(seed)
    noise = random.integers(0, 256, (height // 6, width // 6, channels), np.uint8)
    return np.asarray(cv2.resize(noise, (width, height)), np.uint8).squeeze()


def write_scene(folder: Path) -> None:
    """Two small frames, their depth, a rig, and a video of two cameras side by side."""
    images = {
        "visible": [picture(64, 48, seed, 3) for seed in (1, 2)],
        "thermal": [picture(48, 36, seed) for seed in (3, 4)],
        "depth": [np.full((48, 64), 256 * metres, np.uint16) for metres in (4, 5)],
    }
    for kind, frames in images.items():
        (folder / kind).mkdir(parents=True)
        for index, image in enumerate(frames):
            path = folder / kind / f"{index}.png"
            path.write_bytes(encode_image(path, image))
    (folder / "rig.yaml").write_text(RIG)
    code = cv2.VideoWriter.fourcc(*"FFV1")
    writer = cv2.VideoWriter(str(folder / "w.mkv"), cv2.CAP_FFMPEG, code, 10, (128, 48))
    for image in images["visible"]:
        writer.write(np.hstack([image, image[::-1]]))
    writer.release()
