"""How well two images are registered, and how far a rig is from the true one.

Images are (H, W) or (H, W, 3), uint8, uint16 (both scaled to [0, 1]) or float32, colour as
blue-green-red. A mask is that of `Registrar.register`: (H, W), 0 where valid, 1 to 3 where not and
why. A pixel counts where its whole stencil is valid.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xcalib._core import Rig, gc, ncc, nec, patch_shifts, psnr, rmse, ssim
from xcalib.reprojection import inside_image, targets

__all__ = [
    "PatchResidual",
    "end_point_error",
    "gc",
    "ncc",
    "nec",
    "patch_residual",
    "psnr",
    "rmse",
    "ssim",
]


@dataclass(frozen=True)
class PatchResidual:
    """Shifts that remain between two registered images, one per patch with a distinct peak."""

    centers: NDArray[np.float32]  #: (N, 2) patch centres [px]
    shifts: NDArray[np.float32]  #: (N, 2) the registered image is displaced by this [px]

    @property
    def norms(self) -> NDArray[np.float32]:
        """(N,) lengths of the shifts [px]."""
        return np.hypot(self.shifts[:, 0], self.shifts[:, 1])

    @property
    def median(self) -> float:
        """Median length [px]; NaN without a patch."""
        return float(np.median(self.norms)) if len(self.shifts) else float("nan")

    @property
    def share_under_2px(self) -> float:
        """Share of the patches shifted by less than 2 px; NaN without a patch."""
        return float(np.mean(self.norms < 2)) if len(self.shifts) else float("nan")


def patch_residual(
    reference: NDArray[np.generic],
    registered: NDArray[np.generic],
    mask: NDArray[np.generic] | None = None,
) -> PatchResidual:
    """Measure what is left of the misalignment, with neither NEC nor the solver.

    On a grid of 48 x 48 patches (step 32) of 6-bin unsigned orientation-energy maps, the shift
    within 14 px of the best normalized correlation; a patch counts if that peak stands 0.03
    above the best outside 5 px. Meant for images about 580 px wide.

    Parameters
    ----------
    reference, registered : (H, W) or (H, W, 3) uint8, uint16 or float32 in [0, 1]
    mask : (H, W), 0 where valid, as `Registrar.register` gives it

    Raises
    ------
    ValueError
        Where shapes differ or a dtype is none of these.
    """
    rows = patch_shifts(reference, registered, mask)
    return PatchResidual(centers=rows[:, :2], shifts=rows[:, 2:])


def end_point_error(rig: Rig, truth: Rig, depth: NDArray[Any]) -> NDArray[np.float32]:
    """How far from its true place in the source image `rig` puts every reference pixel.

    Parameters
    ----------
    rig, truth : Rig
        Both with a reference camera of the depth's size.
    depth : (H, W)
        Depth in the reference camera [m]; 0, negative, NaN and inf mean unknown.

    Returns
    -------
    (H, W) float32
        [px of the source image]; NaN where the depth is unknown, where the true target lies outside
        the source image (beyond its outermost pixel centres), or where either puts the point behind
        the source camera.

    Raises
    ------
    ValueError
        A depth that is not 2-d or not of the size of both reference cameras.
    """
    depth = np.asarray(depth)
    for name, each in (("rig", rig), ("truth", truth)):
        size = (each.reference.height, each.reference.width)
        if depth.shape != size:
            raise ValueError(
                f"depth.shape is {depth.shape}, expected the (height, width) of {name}.reference,"
                f" {size}"
            )
    estimated, true = targets(rig, depth), targets(truth, depth)
    with np.errstate(invalid="ignore"):
        judged = inside_image(true, truth.source.width, truth.source.height) & (
            estimated[..., 2] > 0
        )
        error = np.hypot(*np.moveaxis(estimated[..., :2] - true[..., :2], -1, 0))
    return np.where(judged, error, np.nan).astype(np.float32)
