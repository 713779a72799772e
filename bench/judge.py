"""How a registered image is judged against its reference, whatever registered it."""

from dataclasses import dataclass

import cv2
import numpy as np

import xcalib
from xcalib import metrics

EROSION = np.ones((5, 5), np.uint8)
"""Pixels within 2 of an invalid one are not judged: the rim of a warp is not an edge."""

METRICS = {"NEC": metrics.nec, "GC": metrics.gc, "SSIM": metrics.ssim, "NCC": metrics.ncc}


@dataclass(frozen=True)
class View:
    """A registered frame as it is judged: gray images (H, W) in [0, 1] on the reference's grid."""

    reference: np.ndarray
    unregistered: np.ndarray
    """The source only resized."""
    registered: np.ndarray
    inside: np.ndarray
    """Nonzero where a pixel is judged."""

    @property
    def mask(self) -> np.ndarray:
        """The same as a registrar's mask."""
        return np.where(self.inside, 0, 1).astype(np.uint8)


@dataclass(frozen=True)
class Judged:
    """Scores of one registered frame."""

    before: dict[str, float]
    """Of the source only resized, over the same pixels."""
    after: dict[str, float]
    patches: metrics.PatchResidual
    valid: float
    """Share of the pixels judged."""
    whole: dict[str, float]
    """Of the source only resized, over the whole frame with its rim."""
    epe: np.ndarray
    """End-point errors [px of the reference] where the truth is known, of the judged pixels."""


def sampled(source: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The source at the places of a map (H, W, 2), and where that lies inside it."""
    height, width = source.shape[:2]
    x, y = at[..., 0], at[..., 1]
    with np.errstate(invalid="ignore"):
        inside = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    x, y = (np.where(inside, v, -1).astype(np.float32) for v in (x, y))
    return cv2.remap(source, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), inside


def counted_map(registrar: xcalib.Registrar, source: np.ndarray, depth: np.ndarray):
    """A registrar's map, and where it counts: seen, not hidden, of known depth."""
    at = registrar.map(depth)
    _, mask = registrar.register(source, depth)
    return at, mask == 0


def scored(view: View, epe: np.ndarray | None = None) -> Judged:
    plain, inside = view.unregistered, view.inside
    epe = np.empty(0, np.float32) if epe is None else epe
    whole = {name: score(view.reference, plain) for name, score in METRICS.items()}
    if inside.mean() < 0.01:  # nothing is left to judge: a failure that must not vanish
        nothing = dict.fromkeys(METRICS, 0.0)
        empty = np.empty((0, 2), np.float32)
        return Judged(whole, nothing, metrics.PatchResidual(empty, empty), 0.0, whole, epe)
    return Judged(
        {name: score(view.reference, plain, view.mask) for name, score in METRICS.items()},
        {
            name: score(view.reference, view.registered, view.mask)
            for name, score in METRICS.items()
        },
        metrics.patch_residual(view.reference, view.registered, view.mask),
        float(inside.mean()),
        whole,
        epe,
    )


def judge(
    reference: np.ndarray,
    source: np.ndarray,
    at: np.ndarray,
    mask: np.ndarray | None = None,
    truth: np.ndarray | None = None,
    scale: float = 1.0,
) -> Judged:
    """`at` and `truth`: maps into the source; `mask`: where `at` counts; `scale`: see EPE."""
    registered, inside = sampled(source, at)
    if mask is not None:
        inside &= mask
    inside = cv2.erode(inside.astype(np.uint8), EROSION, borderValue=0) > 0
    plain = cv2.resize(source, reference.shape[::-1])
    epe = None
    if truth is not None:
        error = np.linalg.norm(at - truth, axis=-1) * scale
        epe = error[inside & np.isfinite(error)]
    return scored(View(reference, plain, registered, inside), epe)


def systematic(patches: list[metrics.PatchResidual], size: tuple[int, int]) -> float:
    """Median over a 6 x 5 grid of the length of each cell's median shift [px].

    Over the patches of all frames, of shifts under 6 px: the measure's own noise averages away.
    """
    centers = np.concatenate([p.centers for p in patches])
    shifts = np.concatenate([p.shifts for p in patches])
    small = np.hypot(*shifts.T) < 6
    column = np.clip(centers[:, 0] * 6 // size[0], 0, 5).astype(int)
    row = np.clip(centers[:, 1] * 5 // size[1], 0, 4).astype(int)
    lengths = []
    for cell in range(30):
        inside = small & (row * 6 + column == cell)
        if inside.sum() >= 3:
            lengths.append(np.hypot(*np.median(shifts[inside], axis=0)))
    return float(np.median(lengths)) if lengths else float("nan")


def mean_score(judged: list[Judged], of: str, name: str) -> float:
    """Over the frames; `of`: before, after or whole."""
    return float(np.nanmean([getattr(j, of)[name] for j in judged]))


def gain(judged: list[Judged], name: str, over: str = "before") -> float:
    """Change of the mean score by registration, relative to `before` or `whole`."""
    before, after = mean_score(judged, over, name), mean_score(judged, "after", name)
    return (after - before) / abs(before)


def patch_lengths(judged: list[Judged]) -> np.ndarray:
    """Lengths of the patch residual over all frames [px]."""
    return np.concatenate([j.patches.norms for j in judged])


def patch_cells(judged: list[Judged]) -> list[str]:
    """Median of the patch residual [px], and its share under 2 px; dashes where no patch is."""
    lengths = patch_lengths(judged)
    if not len(lengths):
        return ["-", "-"]
    return [f"{np.median(lengths):.2f}", f"{np.mean(lengths < 2):.0%}"]


SCORE_COLUMNS = ["NEC", "GC", "SSIM", "NCC", "patch [px]", "< 2 px", "systematic [px]", "valid"]


def score_cells(judged: list[Judged], size: tuple[int, int]) -> list[str]:
    """Cells of `SCORE_COLUMNS`."""
    found = []
    for name in METRICS:
        change = f"{gain(judged, name):+.0%}".replace("-0%", "+0%")
        found.append(f"{mean_score(judged, 'after', name):.3f} ({change})")
    found += patch_cells(judged)
    found.append(f"{systematic([j.patches for j in judged], size):.2f}")
    found.append(f"{np.mean([j.valid for j in judged]):.0%}")
    return found
