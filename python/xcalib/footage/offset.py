"""By how much one camera's clock is late, from the footage itself.

When the rig moves, edges move in both images, and the amount of that rises and falls together. The
change of the edges from frame to frame is taken in the cells of a coarse grid, so that different
parts of the scene tell, and correlated over time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .. import metrics
from .._core import Registrar, Rig
from ..depth import DepthProvider
from ..frames import Image, InputError, fit_rig, gray, size_of
from .pairing import median_period, pair_times
from .stream import Stream, Times

GRID = (4, 6)
"""Rows and columns of cells."""
WIDTH = 160
"""Width at which edges are taken [px]."""
MIN_CORRELATION = 0.2
"""Of a peak that tells."""
MIN_CONTRAST = 0.12
"""What a peak that tells stands above every other [correlation]."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OffsetEstimate:
    """A clock offset, and what speaks for it."""

    offset: float
    """By how much the source's clock is late [s]; 0 where the footage does not tell."""
    trusted: bool
    correlation: float
    """Height of the peak, in [-1, 1]."""
    contrast: float
    """What it stands above the best peak elsewhere."""
    peak: float
    """Where the peak is [s], trusted or not."""

    def line(self) -> str:
        """In one line."""
        figures = f"correlation {self.correlation:.2f}, {self.contrast:.2f} above the next peak"
        if self.trusted:
            return f"source late by {self.offset:+.4f} s ({figures})"
        return f"the footage moves too little to tell a clock offset, 0 s is used ({figures})"


def estimate_offset(
    references: Stream, sources: Stream, max_offset: float = 2.0, max_frames: int = 1500
) -> OffsetEstimate:
    """Estimate a constant offset between the clocks of two streams, neither registered.

    Parameters
    ----------
    references, sources
        Both with times.
    max_offset
        The largest offset looked for, either way [s]; also at most a third of the footage.
    max_frames
        References read at most, from the middle of the footage.

    Raises
    ------
    InputError
        Without times, or where they do not overlap.
    """
    if references.times is None or sources.times is None:
        raise InputError("a clock offset needs times of both streams' frames; expected them")
    middle = max(0, (len(references) - max_frames) // 2)
    own = np.arange(len(references))[middle : middle + max_frames]
    begin, end = references.times[own[0]], references.times[own[-1]]
    inside = (sources.times >= begin - max_offset) & (sources.times <= end + max_offset)
    other = np.flatnonzero(inside)
    if len(own) < 16 or len(other) < 16:
        if not inside.any():
            raise InputError(
                f"source times {sources.times[0]:.3f} to {sources.times[-1]:.3f} s are more than"
                f" {max_offset:g} s from reference times {begin:.3f} to {end:.3f} s"
            )
        return OffsetEstimate(0.0, False, 0.0, 0.0, 0.0)
    periods = median_period(references.times[own]), median_period(sources.times[other])
    step = max(periods) / 2
    first = _resampled(*_edge_motion(references, own), step)
    second = _resampled(*_edge_motion(sources, other), step)
    return _peak(first, second, step, min(max_offset, (end - begin) / 3))


def _edge_motion(stream: Stream, indices: NDArray[np.intp]) -> tuple[Times, Array]:
    """Times (N - 1,) between frames, and the change of edges per cell (N - 1, cells)."""
    assert stream.times is not None
    before: NDArray[np.float32] | None = None
    changes = []
    for index in indices:
        edges = _edges(stream[int(index)])
        if before is not None:
            cells = cv2.resize(np.abs(edges - before), GRID[::-1], interpolation=cv2.INTER_AREA)
            changes.append(cells.ravel())
        before = edges
    times = stream.times[indices]
    return (times[1:] + times[:-1]) / 2, np.array(changes, np.float64)


def _edges(image: Image) -> NDArray[np.float32]:
    """Magnitude of the gradient of a small gray image, about 1 on an edge whatever the gain."""
    width, height = size_of(image)
    small = (WIDTH, max(GRID[0], round(WIDTH * height / width)))
    plain = cv2.resize(gray(image), small, interpolation=cv2.INTER_AREA)
    plain = cv2.GaussianBlur(np.nan_to_num(plain), (0, 0), 1.0)
    across = cv2.Sobel(plain, cv2.CV_32F, 1, 0)
    down = cv2.Sobel(plain, cv2.CV_32F, 0, 1)
    magnitude = cv2.magnitude(across, down)
    # Gain control scales all of them; a few hot edges must not set the scale.
    scale = float(np.percentile(magnitude, 90))
    edges: NDArray[np.float32] = np.minimum(magnitude / max(scale, 1e-6), 2.0)
    return edges


def _resampled(times: Times, values: Array, step: float) -> tuple[float, Array]:
    """The first time of a grid of ``step`` [s], and the values on it, cleaned, (T, cells + 1).

    The last column is the mean over the cells.
    """
    values = np.column_stack([values, values.mean(axis=1)])
    # A jump of the gain, or a frame shown twice, is one frame's matter: of three neighbours take
    # the median, and of the rest what lies within three deviations.
    padded = np.pad(values, ((1, 1), (0, 0)), mode="edge")
    values = np.median([padded[:-2], padded[1:-1], padded[2:]], axis=0)
    middle = np.median(values, axis=0)
    spread = 1.4826 * np.median(np.abs(values - middle), axis=0) + 1e-9
    values = np.clip(values, middle - 3 * spread, middle + 3 * spread)
    first, last = np.ceil(times[0] / step), np.floor(times[-1] / step)
    grid = np.arange(first, last + 1) * step
    return float(first * step), np.column_stack(
        [np.interp(grid, times, column) for column in values.T]
    )


def _peak(
    first: tuple[float, Array], second: tuple[float, Array], step: float, limit: float
) -> OffsetEstimate:
    """The offset at which two sampled signals correlate best."""
    apart = round((second[0] - first[0]) / step)
    a, b = first[1], second[1]
    lags = np.arange(-int(limit / step), int(limit / step) + 1)
    scores = np.array([_correlation(a, b, int(lag) - apart) for lag in lags])
    best = int(np.argmax(scores))
    # The lobe of the peak ends where the curve turns up again on either side.
    left = right = best
    while left > 0 and scores[left - 1] < scores[left]:
        left -= 1
    while right + 1 < len(scores) and scores[right + 1] < scores[right]:
        right += 1
    outside = np.concatenate([scores[:left], scores[right + 1 :]])
    height = float(scores[best])
    contrast = height - float(outside.max(initial=-1.0)) if outside.size else 0.0
    shift = 0.0
    if 0 < best < len(scores) - 1:
        below, above = scores[best - 1], scores[best + 1]
        bend = below - 2 * height + above
        shift = float(0.5 * (below - above) / bend) if bend < 0 else 0.0
    peak = float((lags[best] + shift) * step)
    inner = 0 < best < len(scores) - 1
    trusted = inner and height >= MIN_CORRELATION and contrast >= MIN_CONTRAST
    return OffsetEstimate(peak if trusted else 0.0, trusted, height, contrast, peak)


def _correlation(a: Array, b: Array, shift: int) -> float:
    """Half of the whole, half of the cells: correlation of a[k] with b[k + shift]."""
    begin, end = max(0, -shift), min(len(a), len(b) - shift)
    if end - begin < 16:
        return -1.0
    x, y = a[begin:end], b[begin + shift : end + shift]
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    power = np.sqrt((x * x).sum(axis=0) * (y * y).sum(axis=0))
    each = (x * y).sum(axis=0) / np.maximum(power, 1e-12)
    return float((each[:-1].mean() + each[-1]) / 2)


def refine_offset(
    rig: Rig,
    references: Stream,
    sources: Stream,
    depth: DepthProvider,
    candidates: Sequence[float],
    max_frames: int = 12,
) -> tuple[float, list[float]]:
    """Choose among candidate offsets by how well the frames register with a rig.

    Parameters
    ----------
    rig
        The calibration; rescaled to the frames.
    references, sources
        Both with times.
    depth
        Of the reference frames.
    candidates
        Offsets [s]; those that pair the same frames score the same.
    max_frames
        References judged, spread over the footage; the same ones for every candidate.

    Returns
    -------
    offset, scores
        The candidate of the largest mean NEC (the middle one of equals), and the NEC of each.
    """
    if not candidates:
        raise InputError("no candidate offsets, expected some")
    if references.times is None or sources.times is None:
        raise InputError("a clock offset needs times of both streams' frames; expected them")
    partners = []
    for offset in candidates:
        found = pair_times(references.times, sources.times, offset)
        partners.append(dict(zip(found.references.tolist(), found.sources.tolist(), strict=True)))
    common = sorted(set.intersection(*(set(partner) for partner in partners)))
    if not common:
        raise InputError("no reference frame has a partner at every candidate offset")
    spread = np.linspace(0, len(common) - 1, min(max_frames, len(common))).round().astype(int)
    registrar = Registrar(fit_rig(rig, size_of(references[0]), size_of(sources[0])))
    totals = np.zeros(len(candidates))
    for index in (common[place] for place in spread):
        reference = references[index]
        metres = depth(index, reference)
        scores: dict[int, float] = {}
        for place, partner in enumerate(partners):
            other = partner[index]
            if other not in scores:
                image, mask = registrar.register(sources[other], metres)
                value = metrics.nec(reference, image, mask == 0) if (mask == 0).any() else 0.0
                scores[other] = float(np.nan_to_num(value))
            totals[place] += scores[other]
    means = (totals / len(spread)).tolist()
    top = np.flatnonzero(totals >= totals.max() - 1e-12)
    return float(candidates[int(top[len(top) // 2])]), means
