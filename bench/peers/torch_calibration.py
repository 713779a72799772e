"""The paper's calibration in PyTorch, written from the paper: autograd, Adam, two stages.

Without the flow term, since we may not ship its network. Equation names are the paper's; where the
paper leaves something open, this follows docs/method.md: gradients are forward differences, a pixel
counts where the source camera sees its whole stencil, and the lower clamp of
Eq. (gradient_clamping) is off unless asked for. Pixel centres lie at integer coordinates. The same
in C++ is `CalibrationOptions(solver="adam")`, with the objective of this library.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from common import gray
from torch import Tensor
from torch.nn.functional import grid_sample, huber_loss, normalize

import xcalib

TRANSLATION_SCALE = 10.0  # lambda_t


@dataclass(frozen=True)
class Frames:
    """(N, 1, h, w) float32 gray images in [0, 1], and depth (N, 1, H, W) [m], 0 unknown."""

    references: Tensor
    sources: Tensor
    depths: Tensor

    @staticmethod
    def of(
        references: Sequence[np.ndarray],
        sources: Sequence[np.ndarray],
        depths: Sequence[np.ndarray],
    ) -> "Frames":
        def stack(images: Sequence[np.ndarray]) -> Tensor:
            return torch.from_numpy(np.stack([gray(image) for image in images]))[:, None]

        depth = torch.from_numpy(np.stack(depths).astype(np.float32))[:, None]
        return Frames(stack(references), stack(sources), depth)

    def batch(self, indices: Tensor) -> "Frames":
        return Frames(self.references[indices], self.sources[indices], self.depths[indices])


class Camera:
    """Eqs. (intrinsic) and (focal_lengths): unconstrained variables, and their matrix."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.focal = torch.ones(2, requires_grad=True)
        self.center = torch.full((2,), 0.5, requires_grad=True)
        self.skew = torch.zeros(1, requires_grad=True)

    def matrix(self) -> Tensor:
        w, h = self.width, self.height
        half = torch.tensor([math.pi / 8, math.atan(h / w * math.tan(math.pi / 8))])
        size = torch.tensor([float(w), float(h)])
        f = size / (2 * torch.tan(self.focal * half))
        c = self.center * size - 0.5
        zero, one = torch.zeros(1), torch.ones(1)
        rows = [f[:1], self.skew, c[:1], zero, f[1:], c[1:], zero, zero, one]
        return torch.cat(rows).view(3, 3)

    def pinhole(self) -> xcalib.Pinhole:
        k = self.matrix().detach().double().numpy()
        return xcalib.Pinhole(
            self.width, self.height, k[0, 0], k[1, 1], k[0, 2], k[1, 2], skew=k[0, 1]
        )


class Parameters:
    """The rig. Roll and t_z stand apart, since stage 1 freezes them."""

    def __init__(self, reference_size: tuple[int, int], source_size: tuple[int, int]) -> None:
        self.reference, self.source = Camera(*reference_size), Camera(*source_size)
        self.q_wxy = torch.tensor([1.0, 0.0, 0.0], requires_grad=True)
        self.q_z = torch.zeros(1, requires_grad=True)
        self.t_xy = [torch.zeros(2, requires_grad=True) for _ in range(2)]  # fine, coarse
        self.t_z = [torch.zeros(1, requires_grad=True) for _ in range(2)]

    def dominant(self) -> list[Tensor]:
        return [self.reference.focal, self.source.focal, self.q_wxy, *self.t_xy]

    def others(self) -> list[Tensor]:
        cameras = (self.reference, self.source)
        return [v for c in cameras for v in (c.center, c.skew)] + [self.q_z, *self.t_z]

    def quaternion(self) -> Tensor:
        return normalize(torch.cat([self.q_wxy, self.q_z]), dim=0)

    def rotation(self) -> Tensor:
        """Eq. (rotation_matrix)."""
        w, x, y, z = self.quaternion()
        rows = [
            (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
            (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
            (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
        ]
        return torch.stack([torch.stack(row) for row in rows])

    def translation(self) -> Tensor:
        """Eq. (translation)."""
        fine, coarse = (torch.cat([self.t_xy[i], self.t_z[i]]) for i in range(2))
        return fine + TRANSLATION_SCALE * coarse

    def mapping(self) -> tuple[Tensor, Tensor]:
        """Infinite homography and K_S t, Eq. (3d_wrapper)."""
        k = self.source.matrix()
        inverse = torch.linalg.inv(self.reference.matrix())
        return k @ self.rotation() @ inverse, k @ self.translation()

    def rig(self) -> xcalib.Rig:
        with torch.no_grad():
            r, t = self.rotation().double().numpy(), self.translation().double().numpy()
        u, _, v = np.linalg.svd(r)  # to double precision a rotation
        return xcalib.Rig(self.reference.pinhole(), self.source.pinhole(), R=u @ v, t=t)


def rig_mapping(rig: xcalib.Rig) -> tuple[Tensor, Tensor]:
    h = torch.from_numpy(rig.infinite_homography.astype(np.float32))
    return h, torch.from_numpy((rig.source.K @ rig.t).astype(np.float32))


def warp(frames: Frames, h: Tensor, k: Tensor) -> tuple[Tensor, Tensor]:
    """Eq. (warping), and where it holds: the warped sources and a mask, (N, 1, H, W) each."""
    depth = frames.depths[:, 0]
    height, width = depth.shape[1:]
    y, x = torch.meshgrid(
        torch.arange(height, dtype=torch.float32),
        torch.arange(width, dtype=torch.float32),
        indexing="ij",
    )
    rays = torch.einsum("ij,jhw->ihw", h, torch.stack([x, y, torch.ones_like(x)]))
    known = torch.isfinite(depth) & (depth > 0)
    points = torch.where(known, depth, 1.0)[:, None] * rays + k[:, None, None]
    z = points[:, 2]
    front = z > 1e-3
    at = points[:, :2] / torch.where(front, z, 1.0)[:, None]
    last = torch.tensor([frames.sources.shape[3] - 1.0, frames.sources.shape[2] - 1.0])
    grid = (2 * at / last[:, None, None] - 1).permute(0, 2, 3, 1)
    inside = (grid.abs() <= 1).all(-1)
    warped = grid_sample(frames.sources, grid, align_corners=True, padding_mode="border")
    return warped, (known & front & inside)[:, None]


def gradient(image: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Forward differences x, y and their magnitude, (N, H - 1, W - 1)."""
    here = image[:, 0, :-1, :-1]
    x, y = image[:, 0, :-1, 1:] - here, image[:, 0, 1:, :-1] - here
    return x, y, torch.sqrt(x * x + y * y + 1e-14)  # a slope of 0, not NaN, where it is flat


def clamped(g: Tensor, counts: Tensor, floor: str) -> Tensor:
    """Eq. (gradient_clamping) over the pixels that count; 0 elsewhere."""
    total = counts.sum((1, 2), keepdim=True).clamp(min=1)
    mean = (g * counts).sum((1, 2), keepdim=True) / total
    out = torch.minimum(g, 5 * mean)
    if floor == "printed":
        active = ((g > 1e-6) * counts).sum((1, 2), keepdim=True) / total
        out = torch.maximum(out, 2 * mean / active.clamp(min=1e-6))
    return out * counts


def nec_terms(
    references: Tensor, warped: Tensor, mask: Tensor, floor: str = "none"
) -> tuple[Tensor, Tensor]:
    """Eq. (nec) and Eq. (nec_coefficient) of each pair, (N,)."""
    valid = mask[:, 0]
    counts = (valid[:, :-1, :-1] & valid[:, :-1, 1:] & valid[:, 1:, :-1]).float()
    ax, ay, a = gradient(references)
    bx, by, b = gradient(warped)
    ax, bx = (torch.where(g > 1e-6, x / g, 1.0) for x, g in ((ax, a), (bx, b)))  # atan2(0, 0) = 0
    cosine = (ax * bx + ay / a * (by / b)).abs()  # Eq. (gradient_orientation)
    a, b = clamped(a, counts, floor), clamped(b, counts, floor)
    weight = torch.sqrt((a * a).sum((1, 2)) * (b * b).sum((1, 2)) + 1e-12)
    return (a * b * cosine).sum((1, 2)) / weight, weight


def image_loss(frames: Frames, h: Tensor, k: Tensor, floor: str = "none") -> Tensor:
    """Eq. (image_loss)."""
    warped, mask = warp(frames, h, k)
    nec, weight = nec_terms(frames.references, warped, mask, floor)
    return (weight * (1 - nec)).sum() / weight.sum()


def image_loss_of(rig: xcalib.Rig, frames: Frames, floor: str = "none") -> float:
    """The same of any rig, over all frames, eight at a time."""
    losses, weights = [], []
    with torch.no_grad():
        for indices in torch.arange(len(frames.depths)).split(8):
            some = frames.batch(indices)
            warped, mask = warp(some, *rig_mapping(rig))
            nec, weight = nec_terms(some.references, warped, mask, floor)
            losses.append(1 - nec)
            weights.append(weight)
    loss, weight = torch.cat(losses), torch.cat(weights)
    return float((weight * loss).sum() / weight.sum())


def huber(x: Tensor, x0: Tensor, delta: float) -> Tensor:
    """Eq. (huber) of the length of x - x0."""
    length = torch.sqrt(((x - x0) ** 2).sum() + 1e-20)
    return huber_loss(length, torch.zeros(()), delta=delta)


@dataclass(frozen=True)
class Result:
    rig: xcalib.Rig
    losses: list[float]  # Eq. (total_loss) of each step's batch, before the step


def calibrate(
    frames: Frames, epochs: int = 15, batch: int = 4, floor: str = "none", seed: int = 0
) -> Result:
    """The published schedule: 120 steps on 32 frames."""
    sizes = [images.shape[3:1:-1] for images in (frames.references, frames.sources)]
    p = Parameters(*((int(w), int(h)) for w, h in sizes))
    t0, q0 = torch.zeros(3), torch.tensor([1.0, 0.0, 0.0, 0.0])
    adam = torch.optim.Adam(p.dominant(), lr=5e-3)
    generator = torch.Generator().manual_seed(seed)
    count = len(frames.depths)
    steps = epochs * math.ceil(count / batch)
    fine_from = int(0.75 * steps)
    losses: list[float] = []
    for _ in range(epochs):
        for indices in torch.randperm(count, generator=generator).split(batch):
            step = len(losses)
            if step == fine_from:  # stage 2
                adam.add_param_group({"params": p.others()})
            first = step < fine_from
            for group in adam.param_groups:
                group["lr"] = 5e-3 * 0.98**step if first else 5e-4 * 0.98 ** (step - fine_from)
            adam.zero_grad()
            loss = image_loss(frames.batch(indices), *p.mapping(), floor)
            if first:  # Eq. (camera_regularization), gamma = 1
                loss = loss + huber(p.translation(), t0, 0.1) + huber(p.quaternion(), q0, 0.05)
            loss.backward(inputs=p.dominant() if first else p.dominant() + p.others())
            adam.step()
            losses.append(loss.item())
    return Result(p.rig(), losses)
