"""Registering a frame as one would write it in PyTorch: the map, then grid_sample."""

from collections.abc import Callable

import numpy as np
import torch

import xcalib


def registrar(
    rig: xcalib.Rig, source: np.ndarray, threads: int = 1
) -> Callable[[np.ndarray], torch.Tensor]:
    """A call that registers `source` (h, w) float32 through a depth map (H, W) float32 [m]."""
    torch.set_num_threads(threads)
    y, x = torch.meshgrid(
        torch.arange(rig.reference.height, dtype=torch.float32),
        torch.arange(rig.reference.width, dtype=torch.float32),
        indexing="ij",
    )
    h = torch.from_numpy(rig.infinite_homography.astype(np.float32))
    k = torch.from_numpy((rig.source.K @ rig.t).astype(np.float32))
    rays = [h[i, 0] * x + h[i, 1] * y + h[i, 2] for i in range(3)]
    image = torch.from_numpy(source)[None, None]
    scale = 2 / (source.shape[1] - 1), 2 / (source.shape[0] - 1)

    def run(depth: np.ndarray) -> torch.Tensor:
        d = torch.from_numpy(depth)
        u, v, z = (d * ray + k[i] for i, ray in enumerate(rays))
        grid = torch.stack([u / z * scale[0] - 1, v / z * scale[1] - 1], -1)[None]
        with torch.no_grad():
            return torch.nn.functional.grid_sample(image, grid, align_corners=True)

    return run
