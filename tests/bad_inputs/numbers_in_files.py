"""Rig files, .npy files and tables of times that are not what they should be."""

from __future__ import annotations

import struct

from table import EVALUATE, INSPECT, REGISTER, Content, Row, npy, rig

SIX = struct.pack("<6f", *range(1, 7))


def of_rig(name: str, old: str, new: str, message: str) -> Row:
    return Row(f"rig-{name}", INSPECT, message, files=rig(old, new))


def depth_of(name: str, content: bytes, message: str) -> Row:
    """Both frames have this for depth."""
    files: dict[str, Content] = {f"depth/{i}.png": None for i in (0, 1)}
    files.update({f"depth/{i}.npy": content for i in (0, 1)})
    return Row(f"npy-{name}", REGISTER, f"depth/0.npy: {message}", files=files)


def array(descr: str, shape: str, data: bytes = SIX) -> bytes:
    return npy(f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}", data)


def times_of(name: str, table: Content, message: str) -> Row:
    return Row(
        f"times-{name}",
        f"{EVALUATE} --reference-times t.csv --source-times t.csv",
        message,
        files={"t.csv": table},
    )


DAMAGED = "cannot decode, truncated or not a .npy array"
FINITE = "expected a finite number"

ROWS = [
    # -- numbers
    of_rig("too-large", "fx: 60", "fx: 1e400", f"reference.fx = 1e400, {FINITE}"),
    of_rig("too-small", "fx: 60", "fx: 1e-400", f"reference.fx = 1e-400, {FINITE}"),
    of_rig("infinite", "fx: 60", "fx: .inf", f"reference.fx = .inf, {FINITE}"),
    of_rig("no-number", "fx: 60", "fx: .nan", f"reference.fx = .nan, {FINITE}"),
    of_rig("word", "fx: 60", "fx: many", f"reference.fx = many, {FINITE}"),
    of_rig("empty-value", "fx: 60", "fx: ", f"reference.fx = (not a single value), {FINITE}"),
    of_rig("hexadecimal", "fx: 60", "fx: 0x3c", f"reference.fx = 0x3c, {FINITE}"),
    of_rig("comma", "cx: 31.5", "cx: '31,5'", f"reference.cx = 31,5, {FINITE}"),
    of_rig("list", "fx: 60", "fx: [60]", f"(not a single value), {FINITE}"),
    of_rig("digits", "fx: 60", "fx: x" + "1" * 300, f"... (301 characters), {FINITE}"),
    Row(
        "rig-many-digits",
        INSPECT,
        "1.1111111111111112e+299 is not plausible",
        files=rig("fx: 60", "fx: " + "1" * 300),
        code=0,
    ),
    of_rig("negative-focal", "fx: 60", "fx: -60", "reference: fx = -60"),
    of_rig("zero-focal", "fy: 60", "fy: 0", "reference: fy = 0"),
    of_rig(
        "width-decimal",
        "width: 64",
        "width: 64.0",
        "width = 64.0, expected a whole number of px, at least 1, as in 640",
    ),
    of_rig("width-zero", "width: 64", "width: 0", "width = 0, expected a whole number"),
    of_rig("width-negative", "width: 64", "width: -64", "width = -64, expected a whole number"),
    of_rig("width-huge", "width: 64", "width: 99999999999", "width = 99999999999, expected"),
    of_rig("translation-large", "[-0.1, 0, 0]", "[1e400, 0, 0]", f"= 1e400, {FINITE}"),
    of_rig("translation-short", "[-0.1, 0, 0]", "[-0.1, 0]", "2 values, expected a list of 3"),
    of_rig("translation-scalar", "[-0.1, 0, 0]", "7", "= 7, expected a list of 3 numbers"),
    of_rig("quaternion-long", "[1, 0, 0, 0]", "[1.1, 0, 0, 0]", "of length 1.1, expected w, x,"),
    of_rig("quaternion-zero", "[1, 0, 0, 0]", "[0, 0, 0, 0]", "of length 0, expected w, x, y, z"),
    of_rig("quaternion-three", "[1, 0, 0, 0]", "[1, 0, 0]", "3 values, expected a list of 4"),
    # -- fields
    of_rig("twice", "fx: 60,", "fx: 60, fx: 61,", "'fx' is given again in line 3"),
    of_rig(
        "section-twice", "version: 1", "version: 1\nreference: {}", "'reference' is given again"
    ),
    of_rig("no-skew", ", skew: 0", "", "fx, fy, cx, cy, skew; write skew: 0 for none"),
    of_rig("no-pose", "  translation_m: [-0.1, 0, 0]\n", "", "missing field 'translation_m'"),
    of_rig("notes", "version: 1", "version: 1\nnotes: mine", "calibration; notes go behind a #"),
    of_rig("unknown", "fx: 60", "zoom: 2, fx: 60", "unknown field 'zoom' in reference, expected"),
    of_rig(
        "mirrored", "version: 1", "version: 2\nsource_mirrored: maybe", "expected true or false"
    ),
    of_rig("version", "version: 1", "version: 99", "version = 99, expected 1 or 2"),
    of_rig("format", "xcalib-rig", "kalibr", "format = kalibr, expected xcalib-rig"),
    # -- documents
    of_rig("second", "format", "---\na: 1\n---\nformat", "a second document (---) in it"),
    of_rig("deep", "[-0.1, 0, 0]", "[" * 50, "nested more than 16 deep in line"),
    of_rig("very-deep", "[-0.1, 0, 0]", "[" * 100000, "rig.yaml: "),
    of_rig("alias", "fx: 60, fy: 60", "fx: &a 60, fy: *a", "an alias (*) in line 3"),
    of_rig("large", "format", "#" + " " * (1 << 20) + "\nformat", "expected at most 1048576"),
    of_rig("keys", "format", "k: " + "[" + "1," * 20000 + "1]\nformat", "more than 10000 values"),
    of_rig("unbalanced", "[-0.1, 0, 0]", "[-0.1, 0", "not a YAML rig file"),
    of_rig("tab", "format", "\tformat", "rig.yaml: "),
    Row("rig-file-empty", INSPECT, "rig.yaml: expected a mapping", files={"rig.yaml": ""}),
    Row("rig-binary", INSPECT, "rig.yaml: ", files={"rig.yaml": bytes(range(256))}),
    Row("rig-is-an-image", "inspect visible/0.png", "visible/0.png: "),
    Row("rig-missing", "inspect none.yaml", "none.yaml: No such file or directory"),
    Row(
        "rig-is-a-folder",
        "register visible visible thermal --depth plane -o out",
        "visible: Is a directory",
    ),
    Row(
        "rig-pipe",
        "register pipe visible thermal --depth plane -o out",
        "pipe is a pipe or a device, expected a file",
        pipes=("pipe",),
    ),
    Row(
        "rig-device",
        "register /dev/zero visible thermal --depth plane -o out",
        "/dev/zero is a pipe or a device, expected a file",
    ),
    Row("rig-empty-name", "register '' visible thermal --depth plane -o out", "RIG"),
    Row("rig-other-size", REGISTER, "the rig", files=rig("width: 64", "width: 90")),
    # -- not plausible, but possible: a warning
    Row(
        "rig-millimetres",
        INSPECT,
        "warning: rig.yaml: the length of translation_m = 100",
        files=rig("-0.1, 0, 0", "-100, 0, 0"),
        code=0,
    ),
    Row(
        "rig-far-centre",
        INSPECT,
        "warning: rig.yaml: reference.cx = 58250 is not plausible",
        files=rig("cx: 31.5", "cx: 58250"),
        code=0,
    ),
    Row(
        "rig-short-quaternion", INSPECT, "", files=rig("[1, 0, 0, 0]", "[0.9995, 0, 0, 0]"), code=0
    ),
    # -- .npy
    depth_of("long-header", npy("{'descr': '<f4', " + "(" * 40000), DAMAGED),
    depth_of("deep-header", npy("(" * 9000), DAMAGED),
    depth_of("empty", b"", DAMAGED),
    depth_of("text", b"no array at all, but text", DAMAGED),
    depth_of("cut-header", array("'<f4'", "(2, 3)")[:40], DAMAGED),
    depth_of("cut-data", array("'<f4'", "(2, 3)")[:-1], DAMAGED),
    depth_of("version-9", npy("{}", SIX, 9), DAMAGED),
    depth_of("no-shape", npy("{'descr': '<f4', 'fortran_order': False}", SIX), DAMAGED),
    depth_of(
        "shape-twice",
        npy("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), 'shape': (2, 3)}", SIX),
        DAMAGED,
    ),
    depth_of("exbibytes", array("'<f8'", "(1000000000, 400000000)"), DAMAGED),
    depth_of("overflow", array("'<f8'", "(4294967296, 4294967296)"), DAMAGED),
    depth_of("negative", array("'<f4'", "(-2, 3)"), DAMAGED),
    depth_of("records", array("[('a', '<f4')]", "(2, 3)"), DAMAGED),
    depth_of("code", array("__import__('os')", "(2, 3)"), DAMAGED),
    depth_of("objects", array("'|O'", "(2, 3)"), "depth is of type O, expected floats in metres"),
    depth_of("integers", array("'<i4'", "(2, 3)"), "depth is int32, expected floats in metres"),
    depth_of("bytes", array("'|u1'", "(2, 3)"), "depth is uint8, expected floats in metres"),
    depth_of("complex", array("'<c8'", "(1, 3)"), "depth is complex64, expected floats in metres"),
    depth_of("flat", array("'<f4'", "(6,)"), "depth has shape (6,), expected one channel (h, w)"),
    depth_of("channels", array("'<f4'", "(1, 3, 2)"), "depth has shape (1, 3, 2), expected one"),
    depth_of("no-pixels", array("'<f4'", "(0, 3)"), "depth has shape (0, 3), expected one channel"),
    depth_of("unknown", array("'<f4'", "(2, 3)", bytes(24)), "all depth is unknown"),
    depth_of("aspect", array("'<f4'", "(3, 2)"), "depth is 2x3, but the reference image is 64x48"),
    # -- tables of times
    times_of("words", "0 soon\n1 later\n", "t.csv"),
    times_of("empty", "", "t.csv"),
    times_of("binary", bytes(range(256)), "t.csv"),
    times_of("falling", "0 5.0\n1 4.0\n", "t.csv"),
    times_of("a-frame-missing", "0 0.0\n", "t.csv"),
    times_of("infinite", "0 0.0\n1 inf\n", "t.csv"),
    times_of("twice", "0 0.0\n0 1.0\n1 2.0\n", "t.csv"),
    Row("times-missing", f"{EVALUATE} --reference-times none.csv", "none.csv"),
    Row(
        "times-pipe",
        f"{EVALUATE} --reference-times pipe",
        "pipe is a pipe or a device",
        pipes=("pipe",),
    ),
    Row("times-folder", f"{EVALUATE} --reference-times visible", "visible: Is a directory"),
]
