"""Which frames to calibrate on: those that say most about the rig together.

A cheap pass over a seeded sample of the footage keeps two small edge fields and the inverse depth
of each candidate, never the images. Frames that cannot help are left out: undecodable, flat
(a closed shutter), saturated, frozen, and pairs whose edges do not agree as the others' do (out of
sync). Of the rest, frames are taken one by one, each the one that adds most to ``log det`` of the
information about the rig's eleven parameters, summed over the frames taken: a measure that grows
with edges common to both images, with their spread over the image and their directions, and with
the spread of depth, and that gives a second frame of the same kind less than the first.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from ._core import CalibrationOptions
from ._core import choose_frames as draw_frames
from .depth.provider import reciprocal
from .frames import DecodeError, Image, InputError, gray

Floats = NDArray[np.float32]
Read = Callable[[int], tuple[Image, Image, Floats | None]]
"""Reference, source and depth (None: not known, or too dear to ask for) of one frame."""

CANDIDATES = 4
"""Candidates read for each frame wanted, at most."""
WIDTH = 96
"""Width of the edge fields [px]."""
SCALES = tuple(float(s) for s in np.geomspace(0.4, 2.5, 17))
"""Trial widths of the source's view on the reference, equal fields of view at 1."""
POOLED = 16
"""Frames that vote on the one alignment, at most."""
PRIOR = 0.1
"""What is known beforehand, as a share of what one frame tells."""
FLAT = 0.15
"""Edges below this share of the median frame's: a closed shutter, or no light at all."""
CONSTANT = 1e-6
"""Edges below this, in the image's units, are rounding: a constant image."""
SATURATED = 0.5
"""Share of pixels at the end of the range from which an image is not used."""
DISAGREES = 0.25
"""Agreement of a pair below this share of the median pair's: not the same moment."""
DUPLICATE = 0.97
"""Correlation of both edge fields with those of a frame already taken, from which it is one."""


@dataclass
class Candidate:
    """What is kept of one frame, and what became of it."""

    index: int
    """Index of the frame in the footage."""
    reason: str = ""
    """Why it was taken or left."""
    taken: bool = False
    agreement: float = math.nan
    """Normalized correlation of the two images' edges where the footage as a whole aligns."""
    gain: float = math.nan
    """What it added, or at the end would have added, to the log-determinant of the information."""
    edges: tuple[float, float] = (0.0, 0.0)
    """Root mean square gradient of reference and source, in their own units."""
    fields: tuple[Floats, Floats] | None = field(default=None, repr=False)
    """Edge fields of reference and source, ``(2, h, w)``, see `edge_field`."""
    inverse_depth: Floats | None = field(default=None, repr=False)
    """[1/m], on the reference field's grid; 0 unknown."""
    source_digest: bytes = field(default=b"", repr=False)

    @property
    def usable(self) -> bool:
        """Whether nothing has been found against the frame."""
        return self.fields is not None and not self.reason


@dataclass(frozen=True)
class Choice:
    """The frames to calibrate on, and what was found out on the way."""

    indices: list[int]
    """Indices of the frames taken, sorted."""
    candidates: list[Candidate]
    """Every frame looked at, in order."""

    @property
    def unusable(self) -> list[Candidate]:
        """Candidates that something was found against: they never were in the choice."""
        return [candidate for candidate in self.candidates if math.isnan(candidate.gain)]

    def table(self, names: Callable[[int], str]) -> str:
        """One line per candidate: its name, what was measured, why it was taken or left."""
        rows = [f"{'frame':<24}{'':<7}{'agreement':>10}{'gain':>8}  why"]
        for c in self.candidates:
            agreement, gain = (
                "-" if math.isnan(value) else f"{value:.3f}" for value in (c.agreement, c.gain)
            )
            verdict = "taken" if c.taken else "left"
            rows.append(f"{names(c.index):<24}{verdict:<7}{agreement:>10}{gain:>8}  {c.reason}")
        return "\n".join(rows)


def choose_frames(
    references: Sequence[Image],
    sources: Sequence[Image],
    depths: Sequence[Floats] | None = None,
    max_frames: int = CalibrationOptions().max_frames,
    seed: int = CalibrationOptions().seed,
) -> Choice:
    """The frames to give to `calibrate`: those that say most about the rig together.

    >>> chosen = choose_frames(visible, thermal, depths).indices
    >>> given = ([images[i] for i in chosen] for images in (visible, thermal, depths))
    >>> result = calibrate(*given)

    Parameters
    ----------
    references, sources
        Images in any form that `calibrate` takes, in sequences of one length. At most
        ``CANDIDATES * max_frames`` of each are looked at, one by one and none is kept, so that a
        sequence may read or render its images when they are asked for, as `footage.Stream` does.
    depths
        Depth maps ``(h, w)`` float32 [m] of the references; None leaves depth out of the choice.
    max_frames
        Frames wanted, at least 1.
    seed
        Draws the frames that are looked at.

    Returns the choice: ``indices``, rising, and ``candidates`` with what became of each frame.

    Raises
    ------
    InputError
        Sequences of different lengths, no frames, images of one camera that differ in size, or
        ``max_frames`` below 1.
    """
    count = len(references)
    counts = [len(items) for items in (references, sources, depths) if items is not None]
    if not count or set(counts) != {count}:
        raise InputError(
            f"references, sources and depths are {', '.join(map(str, counts))} frames,"
            " expected as many of each, at least 1"
        )
    if max_frames < 1:
        raise InputError(f"max_frames is {max_frames}, expected at least 1")

    shapes: list[tuple[int, ...]] = []

    def read(index: int) -> tuple[Image, Image, Floats | None]:
        images = references[index], sources[index]
        for name, image, first in zip(("reference", "source"), images, shapes, strict=False):
            if image.shape[:2] != first:
                raise InputError(
                    f"{name} {index} has shape {image.shape}, expected {first} as those before it"
                )
        shapes[:] = [image.shape[:2] for image in images]
        return *images, None if depths is None else depths[index]

    return choose_informed(count, max_frames, seed, read)


def choose_informed(
    count: int,
    max_frames: int,
    seed: int,
    read: Read,
    watch: Callable[[list[int]], Iterator[int]] = iter,
) -> Choice:
    """Choose at most ``max_frames`` of ``count`` frames by what they say about the rig.

    Parameters
    ----------
    count, max_frames
        Frames in the footage, frames wanted; at least 1.
    seed
        Draws the candidates: one of each of ``CANDIDATES * max_frames`` equal parts.
    read
        Called with the index of each candidate once, in order. A `frames.DecodeError` it raises
        leaves the frame out; other errors pass through.
    watch
        Hands on the indices of the candidates as they are read, for a progress bar.

    Returns the choice; without a usable frame it is empty.
    """
    drawn = draw_frames(count, min(CANDIDATES * max_frames, count), seed)
    candidates = [_candidate(index, read) for index in watch(drawn)]
    _leave_bad_images(candidates)
    usable = [candidate for candidate in candidates if candidate.usable]
    if usable:
        aligned = _align([c.fields for c in usable if c.fields is not None])
        _leave_disagreeing(usable, aligned)
        pairs = [(c, field) for c, field in zip(usable, aligned, strict=True) if c.usable]
        _take_greedily([c for c, _ in pairs], [field for _, field in pairs], max_frames)
    indices = sorted(candidate.index for candidate in candidates if candidate.taken)
    return Choice(indices, candidates)


# -- One frame -----------------------------------------------------------------------------------


def _candidate(index: int, read: Read) -> Candidate:
    try:
        reference, source, depth = read(index)
    except DecodeError as error:
        return Candidate(index, str(error))
    dark, heat = gray(reference), gray(source)
    broken = [
        f"{name} has pixels that are not finite"
        for name, image in (("reference", dark), ("source", heat))
        if not np.isfinite(image).all()
    ]
    dark, heat = (np.nan_to_num(image, posinf=0, neginf=0) for image in (dark, heat))
    if reference.dtype != np.float32:
        # As the objective does, for the edges of a night image lie in its darkest tenth.
        dark = np.log1p(20 * dark).astype(np.float32)
    first, second = _small(dark), _small(heat)
    found = Candidate(
        index,
        edges=(_contrast(first), _contrast(second)),
        fields=(edge_field(first), edge_field(second)),
        source_digest=hashlib.blake2b(source.tobytes(), digest_size=16).digest(),
    )
    if depth is not None:
        size = first.shape[1], first.shape[0]
        near = cv2.resize(reciprocal(depth), size, interpolation=cv2.INTER_NEAREST)
        found.inverse_depth = near.astype(np.float32, copy=False)
    for name, image, ends in (("reference", reference, "top"), ("source", source, "both")):
        if _share_at_end(image, ends) > SATURATED:
            found.reason = f"{name} is saturated"
    found.reason = broken[0] if broken else found.reason
    return found


def _small(image: Floats) -> Floats:
    height = max(8, round(image.shape[0] * WIDTH / image.shape[1]))
    return cv2.resize(image, (WIDTH, height), interpolation=cv2.INTER_AREA).astype(np.float32)


def _gradient(image: Floats) -> tuple[Floats, Floats]:
    blurred = cv2.GaussianBlur(image, (0, 0), 0.7)
    dx = cv2.Sobel(blurred, cv2.CV_32F, 1, 0, scale=1 / 8)
    dy = cv2.Sobel(blurred, cv2.CV_32F, 0, 1, scale=1 / 8)
    return dx.astype(np.float32), dy.astype(np.float32)


def _contrast(image: Floats) -> float:
    dx, dy = _gradient(image)
    return float(np.sqrt((dx**2 + dy**2).mean()))


def edge_field(image: Floats) -> Floats:
    """Edges as ``(2, h, w)``: m cos 2a and m sin 2a, with m the gradient's length, a its angle.

    Doubling the angle makes opposite gradients the same, as thermal polarity wants, and lets edges
    that meet by chance cancel. m has a soft floor and a cap in units of its mean, and unit norm
    over the image.
    """
    dx, dy = _gradient(image)
    length = np.hypot(dx, dy)
    mean = max(float(length.mean()), 1e-12)
    m = np.maximum(np.minimum(length, 5 * mean) - mean, 0)
    m /= max(float(np.linalg.norm(m)), 1e-12)
    safe = np.maximum(length, 1e-12) ** 2
    return np.stack([m * (dx**2 - dy**2) / safe, m * 2 * dx * dy / safe]).astype(np.float32)


def _share_at_end(image: Image, ends: str) -> float:
    """Share of the pixels at the highest, or at either end of an integer type's range."""
    if image.dtype == np.float32:
        return 0.0
    level = image[..., 1] if image.ndim == 3 else image
    top = float((level == np.iinfo(level.dtype).max).mean())
    return max(top, float((level == 0).mean())) if ends == "both" else top


# -- What is wrong with a frame beside the others ------------------------------------------------


def _leave_bad_images(candidates: list[Candidate]) -> None:
    usable = [candidate for candidate in candidates if candidate.usable]
    for camera, name in enumerate(("reference", "source")):
        if not usable:
            return
        usual = float(np.median([candidate.edges[camera] for candidate in usable]))
        for candidate in usable:
            least = max(FLAT * usual, CONSTANT)
            if candidate.usable and not candidate.edges[camera] > least:
                candidate.reason = f"{name} is flat"
    groups: dict[bytes, list[Candidate]] = {}
    for candidate in candidates:
        if candidate.usable:
            groups.setdefault(candidate.source_digest, []).append(candidate)
    for same in groups.values():
        # The same pixels twice beside a visible image that changed: the thermal stream hung. The
        # first may have been in time.
        for candidate in same[1:]:
            if _likeness(candidate, same[0], 0) < DUPLICATE:
                candidate.reason = f"source is frozen since frame {same[0].index}"


def _likeness(one: Candidate, other: Candidate, camera: int) -> float:
    """Correlation of two frames' edge fields of one camera, [-1, 1]."""
    assert one.fields is not None
    assert other.fields is not None
    return float((one.fields[camera] * other.fields[camera]).sum())


# -- Where the two images' edges meet ------------------------------------------------------------


def _align(fields: list[tuple[Floats, Floats]]) -> list[Floats]:
    """Source edge fields on the reference grid, under the one scale and shift that fits all.

    The coarse twin of the calibration's search: edge fields correlated at every shift by Fourier
    products, over a range of scales, pooled over the frames and divided by the norms in the
    overlap. Displacements by depth remain: the fields are coarse enough to bear them.
    """
    _, height, width = fields[0][0].shape
    few = fields[:: -(-len(fields) // POOLED)]
    best = (-math.inf, 1.0, 0, 0)
    for scale in SCALES:
        sources = [_scaled(source, scale) for _, source in few]
        score = _pooled_score([reference for reference, _ in few], sources)
        row, column = np.unravel_index(int(score.argmax()), score.shape)
        # A shift beyond the reference is one to the left, or up, in a circular correlation.
        y = int(row) if row < height else int(row) - score.shape[0]
        x = int(column) if column < width else int(column) - score.shape[1]
        best = max(best, (float(score[row, column]), scale, x, y))
    _, scale, x, y = best
    shift = np.array([[1, 0, x], [0, 1, y]], np.float32)
    return [
        np.stack([cv2.warpAffine(p, shift, (width, height)) for p in _scaled(source, scale)])
        for _, source in fields
    ]


def _pooled_score(references: list[Floats], sources: list[Floats]) -> Floats:
    """Normalized correlation of all pairs together at every shift of the sources, circular."""
    (height, width), (rows, columns) = references[0].shape[1:], sources[0].shape[1:]
    # Room for every shift at which the two overlap.
    shape = cv2.getOptimalDFTSize(height + rows), cv2.getOptimalDFTSize(width + columns)

    def correlation(a: Floats, b: Floats) -> Floats:
        product = np.fft.rfft2(a, shape) * np.fft.rfft2(b, shape).conj()
        return np.fft.irfft2(product.sum(axis=0), shape).astype(np.float32)

    agreement = correlation(np.concatenate(references), np.concatenate(sources))
    of_references = np.sum(np.square(references), axis=(0, 1))[None]
    of_sources = np.sum(np.square(sources), axis=(0, 1))[None]
    seen = correlation(of_references, np.ones_like(of_sources)).clip(0)
    covered = correlation(np.ones_like(of_references), of_sources).clip(0)
    # A few edges in a narrow overlap agree easily: the floor makes them count for little.
    floor = 0.2 * math.sqrt(float(of_references.sum()) * float(of_sources.sum()))
    score: Floats = agreement / (np.sqrt(seen * covered) + np.float32(floor))
    return score


def _scaled(field: Floats, scale: float) -> Floats:
    size = round(scale * field.shape[2]), round(scale * field.shape[1])
    return np.stack([cv2.resize(part, size, interpolation=cv2.INTER_AREA) for part in field])


def _leave_disagreeing(candidates: list[Candidate], aligned: list[Floats]) -> None:
    for candidate, source in zip(candidates, aligned, strict=True):
        assert candidate.fields is not None
        reference = candidate.fields[0]
        overlap = (source != 0).any(axis=0)
        norm = np.linalg.norm(reference[:, overlap]) * np.linalg.norm(source)
        candidate.agreement = float((reference * source).sum()) / max(float(norm), 1e-12)
    usual = float(np.median([candidate.agreement for candidate in candidates]))
    for candidate in candidates:
        if candidate.agreement < DISAGREES * usual:
            candidate.reason = "edges of the two images do not agree: out of sync, or too few"


# -- Taking the frames that add most -------------------------------------------------------------


def _information(reference: Floats, source: Floats, near: Floats | None) -> NDArray[np.float64]:
    """Information of one pair on the rig's 11 parameters, ``(11, 11)``, to a common factor.

    The Gauss-Newton matrix of the edge correlation at the identity: common edges weigh
    ``|reference| |source|``, and each sees the motion of its point along its own gradient.
    """
    _, height, width = reference.shape
    weight = np.hypot(*reference) * cv2.GaussianBlur(np.hypot(*source), (0, 0), 1.5)
    half = 0.5 * np.arctan2(reference[1], reference[0])
    nx, ny = np.cos(half), np.sin(half)
    x, y = np.meshgrid(
        (np.arange(width) - (width - 1) / 2) / (width / 2),
        (np.arange(height) - (height - 1) / 2) / (width / 2),
    )
    # Inverse depth in units of 1/10 m, so that it spreads as the image coordinates do.
    z = np.full_like(x, 0.5) if near is None else np.minimum(10.0 * near, 3.0)
    one, none = np.ones_like(x), np.zeros_like(x)
    motions = (
        *((one, none), (none, one), (x, none), (none, y), (y, none), (-y, x)),
        *((x * x, x * y), (x * y, y * y), (z, none), (none, z), (x * z, y * z)),
    )
    known = weight if near is None else weight * (near > 0)
    rows = np.stack([(nx * u + ny * v).ravel() for u, v in motions])
    information: NDArray[np.float64] = (rows * known.ravel()) @ rows.T
    return information


def _take_greedily(candidates: list[Candidate], aligned: list[Floats], wanted: int) -> None:
    informations = []
    for candidate, source in zip(candidates, aligned, strict=True):
        assert candidate.fields is not None
        matrix = _information(candidate.fields[0], source, candidate.inverse_depth)
        informations.append(max(candidate.agreement, 0.0) * matrix)
    # A little is known of every parameter, or the first frames would all add without end.
    total = np.full((11, 11), 0.0)
    total += PRIOR * np.diag(np.mean([np.diag(matrix) for matrix in informations], axis=0))
    left = list(range(len(candidates)))
    taken: list[int] = []

    def gain(i: int) -> float:
        before, after = (np.linalg.slogdet(m)[1] for m in (total, total + informations[i]))
        return float(after - before)

    while left and len(taken) < wanted:
        fresh = [i for i in left if not any(_twins(candidates[i], candidates[j]) for j in taken)]
        best = max(fresh or left, key=gain)
        candidates[best].gain = gain(best)
        candidates[best].taken = True
        candidates[best].reason = f"adds most, number {len(taken) + 1}"
        total += informations[best]
        taken.append(best)
        left.remove(best)
    for i in left:
        candidates[i].gain = gain(i)
        twin = next((j for j in taken if _twins(candidates[i], candidates[j])), None)
        candidates[i].reason = (
            "adds less than those taken"
            if twin is None
            else f"near-duplicate of frame {candidates[twin].index}"
        )


def _twins(one: Candidate, other: Candidate) -> bool:
    return all(_likeness(one, other, camera) > DUPLICATE for camera in (0, 1))
