"""Does the registered source move as the visible image does?

Flow from frame to frame of the visible image, and of the registered source, by the same estimator:
their difference where both are valid. Rendered drives, with depth that is noisy and flickers.
"""

from collections.abc import Callable

import cv2
import numpy as np
from baselines import NotFound, dense, homographies, unregistered
from baselines.phase_congruency import rift
from judge import EROSION, sampled
from rendered import HEIGHT, SOURCE_HEIGHT, SOURCE_WIDTH, WIDTH, Drive, mean_gray
from results import Results

import xcalib
from xcalib import synthetic
from xcalib.depth.conditioning import SteadyDepth

NOISE, FLICKER = 0.05, 0.03
"""Relative errors of the depth: smooth and new in each frame; common to a whole frame."""

SKY = 200.0
"""Its depth [m], as a network would give one: flow does badly at holes, whatever registered."""


DRIVES = {
    "day": {"metres": 0.3, "night": False},
    "night": {"metres": 0.3, "night": True},
    "low frame rate": {"metres": 1.5, "night": False},
}


def dis(here: np.ndarray, there: np.ndarray) -> np.ndarray:
    method = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    images = (np.uint8(255 * one) for one in (here, there))
    return method.calc(*images, np.zeros((*here.shape, 2), np.float32))


def noisy(depth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    small = rng.standard_normal((depth.shape[0] // 16, depth.shape[1] // 16)).astype(np.float32)
    field = cv2.resize(small, depth.shape[::-1], interpolation=cv2.INTER_CUBIC)
    return (depth * np.exp(NOISE * field + FLICKER * rng.standard_normal())).astype(np.float32)


def registered(frames, references, sources, depths) -> dict[str, list]:
    """Image and mask of each frame, by method."""
    fit = [frames[i] for i in np.linspace(0, len(frames) - 1, min(8, len(frames))).astype(int)]
    of_fit = {id(f): d for f, d in zip(frames, depths, strict=True)}

    def rig(depth_of: Callable) -> xcalib.Registrar:
        result = xcalib.calibrate(
            [f.reference for f in fit], [f.source for f in fit], [depth_of(f) for f in fit]
        )
        return xcalib.Registrar(result.rig)

    ours = rig(lambda f: of_fit[id(f)])
    flat = rig(lambda f: np.full_like(f.depth, 20.0))
    steady = SteadyDepth(lambda i, _: depths[i])
    steadied = [steady(i, f.reference) for i, f in enumerate(frames)]
    out: dict[str, list] = {}

    def by_rig(label: str, registrar: xcalib.Registrar, maps: list[np.ndarray]) -> None:
        for source, depth in zip(sources, maps, strict=True):
            image, mask = registrar.register(source, depth)
            out.setdefault(label, []).append((image, mask == 0))

    by_rig("ours, depth as it comes", ours, depths)
    by_rig("ours, depth steadied", ours, steadied)
    by_rig("ours, exact depth", ours, [f.depth for f in frames])
    by_rig("one homography for the rig", flat, [np.full_like(d, 20.0) for d in depths])
    for label, method in {
        "unregistered": unregistered,
        "homography a pair, ECC on edges": homographies.ecc,
        "homography a pair, RIFT-like": rift,
        "flow a pair, patches": dense.patches,
        "flow a pair, DIS on edges": dense.dis,
    }.items():
        for reference, source in zip(references, sources, strict=True):
            try:
                at = method(reference, source)
            except NotFound:
                at = unregistered(reference, source)
            out.setdefault(label, []).append(sampled(source, at))
    return out


def run(results: Results, part: str | None, flow: Callable = dis) -> None:
    rows = []
    count = results.of(12, 2)
    rig = synthetic.demo_rig().resized(WIDTH, HEIGHT, SOURCE_WIDTH, SOURCE_HEIGHT)
    for name, drive in list(DRIVES.items())[: results.of(None, 1)]:
        street = Drive(rig, count, drive["metres"], seed=5, night=drive["night"], sky_depth=SKY)
        frames = [street.frame(i) for i in range(count)]
        rng = np.random.default_rng(1)
        depths = [noisy(f.depth, rng) for f in frames]
        references = [mean_gray(f.reference) for f in frames]
        sources = [f.source.astype(np.float32) / 255 for f in frames]
        for label, images in registered(frames, references, sources, depths).items():
            errors = []
            for i in range(count - 1):
                (here, valid), (there, valid_there) = images[i], images[i + 1]
                both = cv2.erode((valid & valid_there).astype(np.uint8), EROSION) > 0
                difference = flow(here, there) - flow(references[i], references[i + 1])
                errors.append(np.linalg.norm(difference, axis=-1)[both])
            e = np.concatenate(errors)
            shares = [f"{np.mean(e < limit):.2f}" for limit in (1, 3, 5)]
            rows.append([name, label, f"{e.mean():.2f}", f"{np.median(e):.2f}", *shares])
            print(rows[-1], flush=True)
    results.table(
        "consistency",
        ["drive", "", "EPE [px]", "its median", "< 1 px", "< 3 px", "< 5 px"],
        rows,
        f"Rendered drives of {count} frames, 320x240; 0.3 m a frame, with the low frame rate 1.5 m."
        f" Depth with {NOISE:.0%} of smooth noise, new in every frame, {FLICKER:.0%} of flicker;"
        " rigs fitted on 8 of the frames with it. Flow by OpenCV's DIS for both images.",
    )
