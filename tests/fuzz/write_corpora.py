"""Write the corpora that fuzzing begins with: `write_corpora.py FOLDER`, a folder a target.

With the folders of tests and of bad inputs in PYTHONPATH: rows of their table are seeds.
"""

import io
import struct
import sys
from pathlib import Path

import cv2
import journals
import numbers_in_files
import numpy as np
from table import RIG, Row

from flir import radiometric

CALIBRATED = (
    RIG.replace("version: 1", "version: 2")
    + """calibration:
  trusted: true
  found: true
  reason: two halves agree
  expected_error_px: [0.1, 0.5]
  error_by_depth:
    - {depth_m: 2, error_px: [0.1, 0.5]}
    - {depth_m: .inf, error_px: [0.1, .inf]}
  frames: 8
  date: 2026-01-01
  software: xcalib 0.1.0
"""
)


def seeds_of(rows: list[Row], suffix: str) -> list[bytes]:
    """What rows of the table write into files of a suffix."""
    found = []
    for row in rows:
        for name, content in row.files.items():
            if name.endswith(suffix) and isinstance(content, str | bytes):
                found.append(content.encode() if isinstance(content, str) else content)
    return found


def arrays() -> list[bytes]:
    seeds = []
    for dtype in ("<f4", ">f8", "<f2", "<i4"):
        for order in "CF":
            file = io.BytesIO()
            np.save(file, np.ones((3, 4), dtype, order=order))
            seeds.append(file.getvalue())
    return seeds


def archives() -> list[bytes]:
    seeds = []
    for save in (np.savez, np.savez_compressed):
        for names in (["depth"], ["depth", "other"]):
            file = io.BytesIO()
            save(file, **dict.fromkeys(names, np.ones((3, 4), np.float32)))
            seeds.append(file.getvalue())
    pixels = np.ones((3, 4), np.float32).tobytes()
    return [*seeds, b"Pf\n4 3\n-1\n" + pixels, b"Pf 4 3 1.0 " + pixels, b"PF\n1 1\n-1\n" + pixels]


def images() -> list[bytes]:
    image = np.ones((6, 8), np.uint8)
    return [cv2.imencode(suffix, image)[1].tobytes() for suffix in (".png", ".jpg", ".tiff")]


def radiometric_images() -> list[bytes]:
    counts, colour = np.ones((6, 8), np.uint16), np.ones((6, 8, 3), np.uint8)
    kinds = ((colour, "png"), (None, "png"), (colour, "plain"))
    return [radiometric(counts, visible, raw) for visible, raw in kinds]


def depth_maps() -> list[bytes]:
    maps = np.ones((3, 4), np.uint16), np.ones((3, 4), np.float32)
    heads = [struct.pack("<4sIIIdQ", b"XCDP", 4, 3, kind, 1.0, 7) for kind in (1, 2)]
    one, two = (head + array.tobytes() for head, array in zip(heads, maps, strict=True))
    return [one, two, one + two, one[:-1]]


def stacks(folder: Path) -> list[bytes]:
    seeds = []
    for dtype in (np.uint8, np.uint16, np.float32):
        path = folder / "stack.tiff"
        cv2.imwritemulti(str(path), [np.ones((6, 8), dtype), np.zeros((6, 8), dtype)])
        seeds.append(path.read_bytes())
        path.unlink()
    return seeds


def videos(folder: Path) -> list[bytes]:
    seeds = []
    for suffix, code in ((".mkv", "FFV1"), (".avi", "MJPG"), (".mp4", "mp4v")):
        path = folder / f"video{suffix}"
        writer = cv2.VideoWriter(
            str(path), cv2.CAP_FFMPEG, cv2.VideoWriter.fourcc(*code), 10, (16, 16)
        )
        for value in range(3):
            writer.write(np.full((16, 16, 3), 50 * value, np.uint8))
        writer.release()
        seeds.append(path.read_bytes())
        path.unlink()
    return seeds


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    rows = numbers_in_files.ROWS
    corpora = {
        "npy": arrays() + seeds_of(rows, ".npy"),
        "rig_file": [RIG.encode(), CALIBRATED.encode(), *seeds_of(rows, ".yaml")],
        "journal": seeds_of(journals.ROWS, ".jsonl"),
        "times_table": [b"# t\n0,1.5\n1;2.5\n", *seeds_of(rows, ".csv")],
        "depth_stream": depth_maps(),
        "arrays": archives(),
        "headers": images() + stacks(folder),
        "flir": radiometric_images(),
        "tiff_stack": stacks(folder),
        "video": videos(folder),
    }
    for target, seeds in corpora.items():
        (folder / target).mkdir(exist_ok=True)
        for index, seed in enumerate(seeds):
            (folder / target / f"seed{index}").write_bytes(seed)


main(Path(sys.argv[1]))
