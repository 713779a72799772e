"""COCO's annotation file: boxes, polygons, run lengths and key points.

Boxes and polygons count from the outer edge of the first pixel, whose centre is at (0.5, 0.5); key
points are pixels.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .._core import InputError
from ..convert.fields import Fields
from ..convert.text import json_of
from .frames import LabelledFrames
from .shapes import OCCLUDED, VALID, Mask, Moved, Points, Shapes

HALF = 0.5
SMALLEST = 6
"""Numbers of a polygon."""


def transfer_coco(path: Path, labelled: LabelledFrames) -> str:
    """The annotations of the other images: those of a file, carried over, with what is to be known
    of each in ``xcalib``: notes and depth. What has no place there is left out.
    """
    document = Fields(str(path), json_of(path))
    images, annotations = (records(document, key) for key in ("images", "annotations"))
    by_id = {}
    for image in images:
        index, name = labelled.partner(image.text("file_name"), str(path))
        by_id[image.get("id")] = (image, index, name)
    moved_images, moved_annotations = [], []
    for key, (image, index, name) in by_id.items():
        shapes = labelled.shapes(index)
        size = image.size("width"), image.size("height")
        if size != shapes.size:
            raise InputError(
                f"{path}: {image.text('file_name')} is {size[0]}x{size[1]} px there, and"
                f" {shapes.size[0]}x{shapes.size[1]} px in the frames"
            )
        width, height = shapes.other_size
        moved_images.append(image.node | {"file_name": name, "width": width, "height": height})
        for annotation in annotations:
            if annotation.get("image_id") == key:
                moved = of_annotation(annotation, shapes, labelled)
                moved_annotations += [moved] if moved else []
    for annotation in annotations:
        if annotation.get("image_id") not in by_id:
            annotation.fail("image_id", "the id of one of the images")
    document.node["images"], document.node["annotations"] = moved_images, moved_annotations
    return json.dumps(document.node, indent=1) + "\n"


def records(document: Fields, key: str) -> list[Fields]:
    """A list of mappings."""
    found = document.get(key)
    if not isinstance(found, list):
        document.fail(key, "a list")
    return [Fields(document.where, node, f"{key}[{i}]") for i, node in enumerate(found)]


def of_annotation(
    annotation: Fields, shapes: Shapes, labelled: LabelledFrames
) -> dict[str, Any] | None:
    """An annotation of the other image, None where nothing of it is there."""
    out = dict(annotation.node)
    moved: Moved | None = None
    if "bbox" in annotation:
        x, y, width, height = annotation.numbers("bbox", (4,))
        if width < 0 or height < 0:
            annotation.fail("bbox", "x, y, width and height, not below 0")
        moved = shapes.box((x - HALF, y - HALF, x + width - HALF, y + height - HALF))
        out["bbox"] = bbox_of(moved)
        out["area"] = out["bbox"][2] * out["bbox"][3] if moved.points is not None else 0
    segmentation = annotation.node.get("segmentation")
    if isinstance(segmentation, dict):
        mask = shapes.mask(mask_of(annotation.fields("segmentation"), shapes.size))
        out["segmentation"] = {"size": [mask.shape[0], mask.shape[1]], "counts": counts_of(mask)}
        out["area"] = int(mask.sum())
        found = np.argwhere(mask)[:, ::-1].astype(np.float64)
        moved = moved or Moved(found if len(found) else None)
    elif segmentation:
        outlines = [outline(annotation, part) for part in segmentation]
        parts = [shapes.polygon(points - HALF) for points in outlines]
        kept = [part.points for part in parts if part.points is not None]
        out["segmentation"] = [[round(float(v), 2) for v in (p + HALF).ravel()] for p in kept]
        out["area"] = sum(area_of(points) for points in kept)
        if moved is None or not moved.notes:
            moved = Moved(np.vstack(kept) if kept else None, parts[0].notes, parts[0].depth)
    if "keypoints" in annotation:
        out["keypoints"], out["num_keypoints"] = key_points(annotation, shapes)
        moved = moved or Moved(np.zeros((1, 2)) if out["num_keypoints"] else None)
    if moved is None:
        annotation.fail("bbox", "a bbox, a segmentation or keypoints")
    labelled.count(moved.notes)
    if moved.points is None:
        return None
    depth = round(moved.depth, 3) if np.isfinite(moved.depth) else None
    return out | {"xcalib": {"notes": list(moved.notes), "depth_m": depth}}


def bbox_of(moved: Moved) -> list[float]:
    """x, y, width and height."""
    if moved.box is None:
        return [0.0] * 4
    left, top, right, bottom = moved.box
    return [round(v, 2) for v in (left + HALF, top + HALF, right - left, bottom - top)]


def outline(annotation: Fields, part: object) -> Points:
    """A polygon of a segmentation."""
    if not isinstance(part, list) or len(part) < SMALLEST or len(part) % 2:
        annotation.fail("segmentation", "lists of x, y, at least three points each")
    values = Fields(annotation.where, {"part": part}, annotation.path("segmentation"))
    return np.array(values.numbers("part")).reshape(-1, 2)


def area_of(points: Points) -> float:
    """Of a polygon, by the shoelace formula."""
    x, y = points.T
    return round(float(abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1))) / 2), 2)


def key_points(annotation: Fields, shapes: Shapes) -> tuple[list[float], int]:
    """x, y and visibility each: 0 not labelled, 1 labelled but hidden, 2 seen."""
    values = np.array(annotation.numbers("keypoints"))
    if values.size % 3:
        annotation.fail("keypoints", "x, y and visibility of each")
    values = values.reshape(-1, 3)
    found, codes = shapes.points(values[:, :2])
    out: list[float] = []
    for (x, y), code, seen in zip(found, codes, values[:, 2], strict=True):
        if seen == 0 or code not in (VALID, OCCLUDED):
            out += [0, 0, 0]
        else:
            out += [round(float(x), 2), round(float(y), 2), 1 if code == OCCLUDED else int(seen)]
    return out, sum(1 for v in out[2::3] if v)


# -- Run lengths: column by column, off and on in turn ---------------------------------------------


def mask_of(segmentation: Fields, size: tuple[int, int]) -> Mask:
    """A mask of a segmentation's run lengths."""
    height, width = (int(v) for v in segmentation.numbers("size", (2,)))
    counts = segmentation.get("counts")
    if isinstance(counts, str):
        counts = unpacked(counts, segmentation)
    runs = Fields(segmentation.where, {"counts": counts}, segmentation.name).numbers("counts")
    if (width, height) != size or sum(runs) != width * height or min(runs, default=0) < 0:
        segmentation.fail("counts", f"runs over {size[0]}x{size[1]} px")
    on = np.arange(len(runs)) % 2
    flat = np.repeat(on.astype(np.uint8), np.array(runs, np.int64))
    return np.ascontiguousarray(flat.reshape(width, height).T)


def counts_of(mask: Mask) -> list[int]:
    """The run lengths of a mask."""
    flat = np.concatenate([[0], (mask.T.ravel() != 0).astype(np.int8)])
    changes = np.flatnonzero(np.diff(flat))
    return [int(v) for v in np.diff([0, *changes, mask.size])]


def unpacked(text: str, segmentation: Fields) -> Sequence[int]:
    """Run lengths of COCO's packed text: 5 bits a character from '0' on, a sixth where more follow,
    signed, and each from the third on less the one two before.
    """
    counts: list[int] = []
    value, shift = 0, 0
    for character in text:
        bits = ord(character) - 48
        if not 0 <= bits < 64:
            segmentation.fail("counts", "packed run lengths")
        value |= (bits & 31) << shift
        shift += 5
        if bits & 32:
            continue
        if bits & 16:
            value -= 1 << shift
        counts.append(value + (counts[-2] if len(counts) > 2 else 0))
        value, shift = 0, 0
    return counts
