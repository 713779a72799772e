"""Images, videos, depth maps and folders that cannot be used."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray
from table import CALIBRATE, EVALUATE, REGISTER, Content, Row, cut, picture

from xcalib.frames import encode_image


def encoded(suffix: str, image: NDArray[np.generic]) -> bytes:
    return encode_image(f"x{suffix}", image)


def source(name: str, content: Content, message: str, suffix: str = ".png", code: int = 2) -> Row:
    """The first source image is this."""
    files: dict[str, Content] = {"thermal/0.png": None, f"thermal/0{suffix}": content}
    if suffix == ".png":
        files = {"thermal/0.png": content}
    return Row(f"image-{name}", REGISTER, message, files=files, code=code)


def depth(name: str, content: Content, message: str, suffix: str = ".png") -> Row:
    files: dict[str, Content] = {}
    for index in (0, 1):
        files[f"depth/{index}.png"] = None
        files[f"depth/{index}{suffix}"] = content
    return Row(f"depth-{name}", REGISTER, message, files=files)


def opened(name: str, reference: str, message: str, **files: Content) -> Row:
    return Row(
        f"open-{name}", f"evaluate rig.yaml {reference} thermal --depth plane", message, files=files
    )


def tiff(bits: int, sample_format: int) -> bytes:
    """A page of 48x36 pixels of any type, all 0."""
    size = 48 * 36 * bits // 8
    values = {256: 48, 257: 36, 258: bits, 259: 1, 262: 1, 273: 200, 277: 1, 278: 36, 279: size}
    values[339] = sample_format
    fields = [struct.pack("<HHIHH", tag, 3, 1, value, 0) for tag, value in sorted(values.items())]
    head = b"II" + struct.pack("<HIH", 42, 8, len(fields)) + b"".join(fields) + bytes(4)
    return head.ljust(200, b"\0") + bytes(size)


CANNOT = "cannot decode"
FLAT = np.zeros((48, 64), np.float32)

ROWS = [
    # -- images
    source("cut-png", cut(0.6), f"thermal/0.png: {CANNOT}"),
    source("empty", "", f"thermal/0.png: {CANNOT} 0 bytes"),
    source("text", "no image", f"thermal/0.png: {CANNOT} 8 bytes"),
    source("zeros", bytes(1000), f"thermal/0.png: {CANNOT}"),
    source(
        "cut-jpeg", encoded(".jpg", picture(48, 36, 5))[:400], f"thermal/0.jpg: {CANNOT}", ".jpg"
    ),
    source("cut-bmp", encoded(".bmp", picture(48, 36, 5))[:30], f"thermal/0.bmp: {CANNOT}", ".bmp"),
    source(
        "uint64-tiff",
        tiff(64, 1),
        "thermal/0.tiff: pixels are uint64, expected uint8, uint16 or float32",
        ".tiff",
    ),
    source(
        "float16-tiff",
        tiff(16, 3),
        "thermal/0.tiff: pixels are float16, expected uint8, uint16 or float32",
        ".tiff",
    ),
    source(
        "cut-tiff", encoded(".tiff", picture(48, 36, 5))[:200], f"thermal/0.tiff: {CANNOT}", ".tiff"
    ),
    source("other-size", encoded(".png", picture(40, 36, 5)), "the rig"),
    Row(
        "image-second-of-other-size",
        EVALUATE,
        "thermal/1.png is 40x36, expected 48x36 as 0.png",
        files={"thermal/1.png": encoded(".png", picture(40, 36, 5))},
    ),
    Row(
        "image-second-of-other-kind",
        "register rig.yaml visible thermal --depth depth -o o.mkv",
        "a frame is 64x48 uint16 gray, the first is 64x48 uint8 gray",
        files={"thermal/1.png": encoded(".png", picture(48, 36, 5).astype(np.uint16))},
        leaves=True,
    ),
    Row(
        "image-all-cut",
        CALIBRATE,
        f"thermal/0.png: {CANNOT}",
        files={"thermal/0.png": cut(0.6), "thermal/1.png": cut(0.5)},
    ),
    Row(
        "image-all-constant",
        f"{CALIBRATE} --choose spread",
        "image is constant",
        files={f"thermal/{i}.png": encoded(".png", np.full((36, 48), 7, np.uint8)) for i in (0, 1)},
    ),
    Row(
        "image-tiny",
        f"{CALIBRATE} --choose spread",
        "expected",
        files={f"thermal/{i}.png": encoded(".png", picture(6, 6, 1)) for i in (0, 1)},
    ),
    # -- folders and patterns
    opened("none", "none", "none: no such folder"),
    opened("camera", "0", "0: no such folder; cameras are read by `xcalib-cli register --live`"),
    opened("address", "rtsp://cam/1", "; cameras are read by `xcalib-cli register --live`"),
    opened("empty-name", "''", "REFERENCE"),
    opened("a-file", "rig.yaml", "rig.yaml is a file, expected a folder of"),
    opened("an-image", "visible/0.png", "visible/0.png is a file, expected a folder of"),
    opened("empty-folder", "new", "new: empty, expected png, jpg", **{"new/notes.txt": ""}),
    opened("pattern", "'visible/*.jpg'", "visible/*.jpg: no image file matches"),
    opened("number", "visible/%06d.png", "visible/%06d.png: no image file matches"),
    opened("half-of-nothing", "visible#middle", "visible#middle: expected"),
    opened(
        "odd-half",
        "odd#left",
        "its width is 7 px, expected an even one to take the left half",
        **{f"odd/{i}.png": encoded(".png", picture(7, 6, 1)) for i in (0, 1)},
    ),
    opened(
        "counts",
        "three",
        "three",
        **{f"three/{i}.png": encoded(".png", picture(64, 48, 1)) for i in (0, 1, 2)},
    ),
    opened(
        "two-of-a-name",
        "visible",
        "visible",
        **{"visible/0.bmp": encoded(".bmp", picture(64, 48, 1))},
    ),
    Row("open-not-utf8", EVALUATE, "the name is not UTF-8", files={"visible/\udcff.png": "x"}),
    Row("open-source-none", "evaluate rig.yaml visible none --depth plane", "none: no such folder"),
    # -- videos and stacks
    opened("video-none", "none.mp4", "none.mp4: no such file"),
    opened("video-text", "v.mp4", f"v.mp4: {CANNOT} frame 0", **{"v.mp4": "no video"}),
    opened("video-empty", "v.mkv", f"v.mkv: {CANNOT} frame 0", **{"v.mkv": ""}),
    Row(
        "open-video-cut",
        "evaluate rig.yaml w.mkv#left w.mkv#right --depth plane",
        f"w.mkv: {CANNOT}",
        files={"w.mkv": cut(0.3)},
    ),
    opened(
        "stack-text", "s.tiff", "s.tiff: cannot decode, truncated or not a TIFF", **{"s.tiff": "no"}
    ),
    opened(
        "stack-empty", "s.tif", "s.tif: cannot decode, truncated or not a TIFF", **{"s.tif": ""}
    ),
    opened("bag-none", "none.mcap", "none.mcap: "),
    # -- depth
    Row("depth-none", "evaluate rig.yaml visible thermal --depth none", "depth none: expected"),
    Row("depth-a-file", "evaluate rig.yaml visible thermal --depth rig.yaml", "depth rig.yaml"),
    Row("depth-missing", "evaluate rig.yaml visible thermal", "--depth"),
    Row("depth-network-none", "evaluate rig.yaml visible thermal --depth none.onnx", "none.onnx"),
    depth("8-bit", encoded(".png", picture(64, 48, 1)), "depth is uint8, expected a 16-bit PNG"),
    depth(
        "colour",
        encoded(".png", picture(64, 48, 1, 3).astype(np.uint16)),
        "depth has shape (48, 64, 3), expected one channel",
    ),
    depth("zero", encoded(".png", np.zeros((48, 64), np.uint16)), "all depth is unknown"),
    depth("nan", encoded(".tiff", FLAT + np.nan), "all depth is unknown", ".tiff"),
    depth("negative", encoded(".tiff", FLAT - 1), "all depth is unknown", ".tiff"),
    depth(
        "byte-tiff",
        encoded(".tiff", picture(64, 48, 1)),
        "depth is uint8, expected floats",
        ".tiff",
    ),
    depth("uint32-tiff", tiff(32, 1), "depth is uint32, expected floats in metres", ".tiff"),
    depth("int32-tiff", tiff(32, 2), "depth is int32, expected floats in metres", ".tiff"),
    depth(
        "aspect",
        encoded(".png", np.full((48, 48), 999, np.uint16)),
        "depth is 48x48, but the reference image is 64x48; expected the same aspect",
    ),
    Row("depth-cut", REGISTER, f"depth/0.png: {CANNOT}", files={"depth/0.png": cut(0.5)}),
    depth("exr-text", "no", "depth/0.exr: cannot decode", ".exr"),
]
