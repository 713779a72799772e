"""How well a rig registers real frames, beside the source that is only resized.

Every pair is judged as gray in [0, 1] on a reference grid of about 600 px width, the registered
and the unregistered source over the *same* pixels: those the registration can fill, eroded by
2 px, because the rim of a warp is not an edge.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields

import cv2
import numpy as np
from numpy.typing import NDArray

from . import metrics
from ._core import Registrar, Rig
from .frames import Image, fit_rig, gray, size_of

EROSION = 2
"""Valid pixels this close to an invalid one are not judged [px]."""


@dataclass(frozen=True)
class Scores:
    """Agreement of one image, or the mean of many, with the reference; NaN where undefined."""

    nec: float
    gc: float
    ssim: float
    ncc: float
    rmse: float
    psnr: float
    """[dB]"""
    patch_median: float
    """Median length of the patch residual over the patches of all frames [px]."""
    patch_under_2px: float
    """Share of patches whose residual is shorter than 2 px, [0, 1]."""


@dataclass(frozen=True)
class Evaluation:
    """Scores of the registered and the unregistered source, together and frame by frame."""

    size: tuple[int, int]
    """Width and height the images are judged at [px]."""
    valid_share: float
    """Mean share of the pixels judged, [0, 1]."""
    registered: Scores
    unregistered: Scores
    frames: tuple[tuple[Scores, Scores], ...]
    """Registered and unregistered scores of each frame."""

    def gain(self, score: str) -> float:
        """Change of a score by registration [%], NaN where undefined."""
        before, after = getattr(self.unregistered, score), getattr(self.registered, score)
        return 100 * (after - before) / abs(before) if before else math.nan

    def to_dict(self) -> dict[str, object]:
        """Everything as plain numbers, for JSON."""
        return {
            "size": list(self.size),
            "valid_share": self.valid_share,
            "registered": asdict(self.registered),
            "unregistered": asdict(self.unregistered),
            "gain_percent": {field.name: self.gain(field.name) for field in fields(Scores)},
            "frames": [
                {"registered": asdict(registered), "unregistered": asdict(unregistered)}
                for registered, unregistered in self.frames
            ],
        }

    def table(self) -> str:
        """The scores as text, one line each."""
        rows = [f"{'':<18}{'unregistered':>14}{'registered':>14}{'change':>10}"]
        for label, score, scale, digits in (
            ("NEC", "nec", 1, 4),
            ("GC", "gc", 1, 4),
            ("SSIM", "ssim", 1, 4),
            ("NCC", "ncc", 1, 4),
            ("RMSE", "rmse", 1, 4),
            ("PSNR [dB]", "psnr", 1, 2),
            ("patch median [px]", "patch_median", 1, 2),
            ("patch < 2 px [%]", "patch_under_2px", 100, 1),
        ):
            before, after = (
                f"{scale * getattr(scores, score):.{digits}f}"
                for scores in (self.unregistered, self.registered)
            )
            gain = self.gain(score)
            change = "-" if math.isnan(gain) else f"{gain:+.1f} %"
            rows.append(f"{label:<18}{before:>14}{after:>14}{change:>10}")
        width, height = self.size
        rows.append(
            f"{len(self.frames)} frames at {width}x{height},"
            f" {100 * self.valid_share:.1f} % of the pixels judged"
        )
        return "\n".join(rows)


def evaluate(
    rig: Rig,
    references: Iterable[Image],
    sources: Iterable[Image],
    depths: Iterable[Image],
    width: int = 640,
    num_threads: int = 0,
) -> Evaluation:
    """Judge a rig on frames; they are taken one by one, so iterators do.

    Parameters
    ----------
    rig
        The calibration; rescaled to the images if they have its aspects.
    references, sources
        ``(H, W)`` or ``(H, W, 3)`` images, uint8, uint16 or float32 in [0, 1].
    depths
        ``(h, w)`` float32 [m], of any size of the reference's aspect, 0 unknown.
    width
        The reference is reduced by the smallest integer that makes it at most this wide [px].
    num_threads
        0 means all cores.
    """
    if width < 1:
        raise ValueError(f"width is {width}, expected at least 1 px")
    registrar: Registrar | None = None
    source_size = size = (0, 0)
    frames: list[tuple[Scores, Scores]] = []
    shifts: list[tuple[NDArray[np.float32], NDArray[np.float32]]] = []
    shares: list[float] = []

    for reference, source, depth in zip(references, sources, depths, strict=True):
        if registrar is None:
            full = fit_rig(rig, size_of(reference), size_of(source))
            size = _reduced(size_of(reference), -(-reference.shape[1] // width))
            small = full.resized(*size, *size_of(source))
            # A source much finer than the grid would be sampled with aliasing.
            finer = max(1, int(small.source.fx / small.reference.fx))
            source_size = _reduced(size_of(source), finer)
            registrar = Registrar(full.resized(*size, *source_size), num_threads)

        target = _resized(gray(reference), size)
        plain = gray(source)
        registered, mask = registrar.register(_resized(plain, source_size), depth)
        kernel = np.ones((2 * EROSION + 1, 2 * EROSION + 1), np.uint8)
        valid = cv2.erode((mask == 0).astype(np.uint8), kernel).astype(bool)

        after, after_shifts = _scores(target, registered, valid)
        before, before_shifts = _scores(target, _resized(plain, size), valid)
        frames.append((after, before))
        shifts.append((after_shifts, before_shifts))
        shares.append(float(valid.mean()))

    if not frames:
        raise ValueError("no frames to evaluate")
    return Evaluation(
        size=size,
        valid_share=float(np.mean(shares)),
        registered=_pooled([after for after, _ in frames], [after for after, _ in shifts]),
        unregistered=_pooled([before for _, before in frames], [before for _, before in shifts]),
        frames=tuple(frames),
    )


def _reduced(size: tuple[int, int], factor: int) -> tuple[int, int]:
    return max(1, round(size[0] / factor)), max(1, round(size[1] / factor))


def _resized(image: NDArray[np.float32], size: tuple[int, int]) -> NDArray[np.float32]:
    how = cv2.INTER_AREA if size[0] < image.shape[1] else cv2.INTER_LINEAR
    return cv2.resize(image, size, interpolation=how).astype(np.float32, copy=False)


def _scores(
    reference: NDArray[np.float32], image: NDArray[np.float32], valid: NDArray[np.bool_]
) -> tuple[Scores, NDArray[np.float32]]:
    """Scores of one frame and the patch shifts ``(N, 2)`` [px] behind two of them."""
    if not valid.any():
        return Scores(*[math.nan] * len(fields(Scores))), np.empty((0, 2), np.float32)
    patches = metrics.patch_residual(reference, image, valid)
    scores = Scores(
        nec=metrics.nec(reference, image, valid),
        gc=metrics.gc(reference, image, valid),
        ssim=metrics.ssim(reference, image, valid),
        ncc=metrics.ncc(reference, image, valid),
        rmse=metrics.rmse(reference, image, valid),
        psnr=metrics.psnr(reference, image, valid),
        patch_median=patches.median,
        patch_under_2px=patches.share_under_2px,
    )
    return scores, patches.shifts


def _pooled(frames: list[Scores], shifts: list[NDArray[np.float32]]) -> Scores:
    """Means over the frames where a score is defined; patches of all frames count alike."""
    lengths = np.linalg.norm(np.concatenate(shifts), axis=1)
    means = {}
    for field in fields(Scores):
        values = np.array([getattr(frame, field.name) for frame in frames])
        values = values[np.isfinite(values)]
        means[field.name] = float(values.mean()) if values.size else math.nan
    means["patch_median"] = float(np.median(lengths)) if lengths.size else math.nan
    means["patch_under_2px"] = float((lengths < 2).mean()) if lengths.size else math.nan
    return Scores(**means)
