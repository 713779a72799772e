"""By how much one camera's clock is late, from the footage itself.

When the rig moves, edges move in both images, and the amount of that rises and falls together. The
change of the edges from frame to frame is taken in the cells of a coarse grid, so that different
parts of the scene tell, and correlated over time.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .. import metrics
from .._core import Registrar, Rig
from ..depth import Depth, DepthProvider
from ..frames import DecodeError, Image, InputError, fit_rig, gray, size_of
from .pairing import median_period, pair_times
from .stream import Stream, Times

GRID = (4, 6)
"""Rows and columns of cells."""
WIDTH = 160
"""Width at which edges are taken [px]."""
NO_TIMES = "a clock offset needs times of both streams' frames; expected them"
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
        raise InputError(NO_TIMES)
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
    motions = _edge_motion(references, own), _edge_motion(sources, other)
    if min(len(times) for times, _ in motions) < 15:
        return OffsetEstimate(0.0, False, 0.0, 0.0, 0.0)
    first, second = (_resampled(*motion, step) for motion in motions)
    return _peak(first, second, step, min(max_offset, (end - begin) / 3))


def _edge_motion(stream: Stream, indices: NDArray[np.intp]) -> tuple[Times, Array]:
    """Times (N - 1,) between frames, and the change of edges per cell (N - 1, cells)."""
    assert stream.times is not None
    before: NDArray[np.float32] | None = None
    changes, times = [], []
    for index in indices:
        with contextlib.suppress(DecodeError):  # named when its turn comes; the next ones tell
            edges = _edges(stream[int(index)])
            if before is not None:
                cells = cv2.resize(np.abs(edges - before), GRID[::-1], interpolation=cv2.INTER_AREA)
                changes.append(cells.ravel())
            before = edges
            times.append(stream.times[index])
    seconds = np.array(times)
    return (seconds[1:] + seconds[:-1]) / 2, np.array(changes, np.float64)


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


@dataclass(frozen=True)
class RefinedOffset:
    """A clock offset chosen by how well frames register, and what speaks for it."""

    offset: float
    """By how much the source's clock is late [s]; the middle candidate where nothing is told."""
    told: bool
    """Whether the frames register worse at both ends of the candidates."""
    scores: list[float]
    """Mean NEC of the frames judged, at each candidate; empty if fewer than two can be."""

    def line(self) -> str:
        """In one line."""
        if not self.scores:
            return "too few frames overlap to confirm or refine it by registration"
        figures = (
            f"NEC up to {max(self.scores):.3f}, at the ends of the offsets tried"
            f" {self.scores[0]:.3f} and {self.scores[-1]:.3f}"
        )
        if self.told:
            return f"frames register best with the source late by {self.offset:+.4f} s ({figures})"
        return f"registered frames change too little to confirm or refine it ({figures})"


def offsets_around(guess: float, references: Stream, sources: Stream) -> list[float]:
    """Candidates for `refine_offset`: 6 frames of the faster stream either way, in quarters [s]."""
    if references.times is None or sources.times is None:
        raise InputError(NO_TIMES)
    period = min(median_period(references.times), median_period(sources.times))
    return [guess + period * quarters / 4 for quarters in range(-24, 25)]


def refine_offset(
    rig: Rig,
    references: Stream,
    sources: Stream,
    depth: DepthProvider,
    candidates: Sequence[float],
    max_frames: int = 12,
) -> RefinedOffset:
    """Choose among candidate offsets by how well the frames register with a rig.

    Of the candidates that differ from the best by less than the frames do among each other (two
    standard errors of the mean), the one nearest to the middle is taken: the guess, unless the
    frames speak against it. Those that pair the same frames score the same.

    Parameters
    ----------
    rig
        The calibration; rescaled to the frames.
    references, sources
        Both with times.
    depth
        Of the reference frames.
    candidates
        Offsets [s], rising, around a guess in their middle.
    max_frames
        Frames of the slower stream judged, spread over the footage; the same ones for every
        candidate. Those with an image that cannot be decoded are left out.

    Raises
    ------
    InputError
        Without candidates or times.
    """
    if not candidates:
        raise InputError("no candidate offsets, expected some")
    if references.times is None or sources.times is None:
        raise InputError(NO_TIMES)
    # A frame of the slower stream, and the pair it is in at each candidate.
    slower = int(len(references) > len(sources))
    pairs: list[dict[int, tuple[int, int]]] = []
    # Wider than pairing itself: jitter must not take a frame's partner away between two others.
    gap = 0.75 * max(median_period(references.times), median_period(sources.times)) or None
    for offset in candidates:
        try:
            found = pair_times(references.times, sources.times, offset, gap)
        except InputError:
            return RefinedOffset(float(candidates[len(candidates) // 2]), False, [])
        both = zip(found.references.tolist(), found.sources.tolist(), strict=True)
        pairs.append({pair[slower]: pair for pair in both})
    common = sorted(set.intersection(*(set(each) for each in pairs)))
    spread = np.linspace(0, len(common) - 1, min(max_frames, len(common))).round().astype(int)
    judge = _Judge(rig, references, sources, depth)
    rows = []
    for frame in (common[place] for place in spread):
        with contextlib.suppress(DecodeError):
            scores = {pair: judge(*pair) for pair in sorted({each[frame] for each in pairs})}
            rows.append([scores[each[frame]] for each in pairs])
    return _chosen(candidates, np.array(rows).reshape(-1, len(candidates)))


class _Judge:
    """NEC of a reference and a source frame, registered."""

    def __init__(self, rig: Rig, references: Stream, sources: Stream, depth: DepthProvider) -> None:
        self._rig, self._references, self._sources, self._depth = rig, references, sources, depth
        self._registrar: Registrar | None = None
        self._last: tuple[int, Image, Depth] | None = None

    def __call__(self, index: int, other: int) -> float:
        if self._last is None or self._last[0] != index:
            image = self._references[index]
            self._last = index, image, self._depth(index, image)
        _, reference, metres = self._last
        source = self._sources[other]
        if self._registrar is None:
            self._registrar = Registrar(fit_rig(self._rig, size_of(reference), size_of(source)))
        registered, mask = self._registrar.register(source, metres)
        valid = mask == 0
        return float(np.nan_to_num(metrics.nec(reference, registered, valid))) if valid.any() else 0


def _chosen(candidates: Sequence[float], scores: Array) -> RefinedOffset:
    """The verdict on ``scores``, the NEC of each frame (N,) at each of the candidates."""
    middle = len(candidates) // 2
    if len(scores) < 2:
        return RefinedOffset(float(candidates[middle]), False, [])
    means = scores.mean(axis=0)
    lost = scores[:, [int(means.argmax())]] - scores
    error = lost.std(axis=0, ddof=1) / np.sqrt(len(scores))
    worse = lost.mean(axis=0) > np.maximum(2 * error, 1e-12)
    told = bool(worse[0] and worse[-1])
    near = min(np.flatnonzero(~worse).tolist(), key=lambda place: abs(place - middle))
    return RefinedOffset(float(candidates[near if told else middle]), told, means.tolist())
