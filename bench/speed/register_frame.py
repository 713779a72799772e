"""Registering a frame, beside numpy + cv2.remap, PyTorch and a plain copy.

One of 1280x960 from a source of 640x512.

The depth changes with every frame. Each round runs every contestant once, on the same depth, in
another order, since one leaves the caches as the next finds them; a ratio is the median over the
rounds of the ratio within a round, so that a busy machine slows both.
All write to existing arrays where their interface allows it. One thread unless a name says more.
"""

import time
from collections.abc import Callable

import cv2
import numpy as np
from common import machine
from figures import skipped, spread

import xcalib

ROUNDS = 150
WIDTH, HEIGHT = 1280, 960


def depths() -> list[np.ndarray]:
    """A road with posts: smooth with steps, as depth is, and other heights each frame."""
    row = np.arange(HEIGHT, dtype=np.float32)[:, None] - 400
    out = []
    for i in range(4):
        height = 1.4 + 0.1 * i
        road = np.where(row > 0, height * 1370 / np.maximum(row, 1), 80)
        depth = np.broadcast_to(road, (HEIGHT, WIDTH)).clip(0, 80).astype(np.float32)
        for post in range(8):
            x = 60 + 150 * post + 15 * i
            depth[200 : 500 + 30 * post, x : x + 40] = 6 + 2 * post
        out.append(depth)
    return out


def through(rig: xcalib.Rig, both: bool) -> xcalib.Rig:
    """The rig with a lens on the source, as strong as thermal ones are, or on both."""
    lenses = (
        xcalib.Lens("brown", [-0.1, 0.02, 0, 0]) if both else xcalib.Lens(),
        xcalib.Lens("brown", [-0.3, 0.1, 0.001, -0.001, 0.01]),
    )
    cameras = (
        xcalib.Pinhole(c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.skew, lens)
        for c, lens in zip((rig.reference, rig.source), lenses, strict=True)
    )
    return xcalib.Rig(*cameras, rig.R, rig.t)


def contestants(rig: xcalib.Rig) -> dict[str, Callable[[np.ndarray, int], object]]:
    """Name and call; a call takes the depth and which of the four it is."""
    rng = np.random.default_rng(0)
    source = rng.random((rig.source.height, rig.source.width), dtype=np.float32)
    counts = (255 * source).astype(np.uint8)
    colour = rng.integers(0, 256, (*source.shape, 3), np.uint8)
    wide = (65535 * source).astype(np.uint16)
    mask = np.empty((HEIGHT, WIDTH), np.uint8)

    def ours(
        image: np.ndarray, rig: xcalib.Rig = rig, **options: object
    ) -> Callable[[np.ndarray, int], object]:
        registrar = xcalib.Registrar(rig, **{"num_threads": 1, "occlusion": "ignore", **options})
        out = np.empty((HEIGHT, WIDTH, *image.shape[2:]), image.dtype)
        return lambda depth, _: registrar.register(image, depth, out=out, mask=mask)

    y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
    h = rig.infinite_homography.astype(np.float32)
    k = (rig.source.K @ rig.t).astype(np.float32)
    rays = [h[i, 0] * x + h[i, 1] * y + h[i, 2] for i in range(3)]
    bytes_out = np.empty((HEIGHT, WIDTH), np.uint8)
    out, copied = np.empty((HEIGHT, WIDTH), np.float32), np.empty((HEIGHT, WIDTH), np.float32)

    def numpy_map(depth: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        z = depth * rays[2] + k[2]
        return (depth * rays[0] + k[0]) / z, (depth * rays[1] + k[1]) / z

    ready = [numpy_map(depth) for depth in depths()]
    units = [np.rint(256 * depth).astype(np.uint16) for depth in depths()]
    kitti = ours(source, depth_scale=1 / 256)
    smaller = {
        size: [cv2.resize(d, size, interpolation=cv2.INTER_NEAREST) for d in depths()]
        for size in ((WIDTH // 2, HEIGHT // 2), (WIDTH // 4, HEIGHT // 4), (518, 388))
    }

    def resized(depth: np.ndarray) -> np.ndarray:
        return cv2.resize(depth, (WIDTH, HEIGHT), interpolation=cv2.INTER_LINEAR)

    def of_size(
        image: np.ndarray, size: tuple[int, int], **options: object
    ) -> Callable[[np.ndarray, int], object]:
        call = ours(image, **options)
        return lambda _, i: call(smaller[size][i], i)

    calls: dict[str, Callable[[np.ndarray, int], object]] = {
        "float32": ours(source),
        "float32, occlusion": ours(source, occlusion="mark"),
        "float32, two threads": ours(source, num_threads=2),
        "float32, occlusion, two threads": ours(source, occlusion="mark", num_threads=2),
        "float32, uint16 depth": lambda _, i: kitti(units[i], i),
        "float32, source lens": ours(source, through(rig, False)),
        "float32, both lenses": ours(source, through(rig, True)),
        "float32, source lens, occlusion": ours(source, through(rig, False), occlusion="mark"),
        "float32, both lenses, occlusion": ours(source, through(rig, True), occlusion="mark"),
        "uint8": ours(counts),
        "uint8, occlusion": ours(counts, occlusion="mark"),
        "uint8, colour, occlusion": ours(colour, occlusion="mark"),
        "uint16": ours(wide),
        "uint8, colour": ours(colour),
        "numpy map + cv2.remap": lambda d, _: cv2.remap(
            source, *numpy_map(d), cv2.INTER_LINEAR, dst=out
        ),
        "half-size depth: numpy map + cv2.resize + cv2.remap": lambda _, i: cv2.remap(
            source,
            *numpy_map(resized(smaller[WIDTH // 2, HEIGHT // 2][i])),
            cv2.INTER_LINEAR,
            dst=out,
        ),
        "uint8: cv2.remap, map ready": lambda _, i: cv2.remap(
            counts, *ready[i], cv2.INTER_LINEAR, dst=bytes_out
        ),
        "cv2.remap, map ready": lambda _, i: cv2.remap(
            source, *ready[i], cv2.INTER_LINEAR, dst=out
        ),
        "copy": lambda d, _: np.copyto(copied, d),
    }
    for size in smaller:
        name = f"{size[0]}x{size[1]} depth"
        calls[f"float32, occlusion, {name}"] = of_size(source, size, occlusion="mark")
        calls[f"uint8, occlusion, {name}"] = of_size(counts, size, occlusion="mark")
    try:
        from peers.torch_register import registrar
    except ImportError:
        skipped("PyTorch map + grid_sample", "PyTorch is not installed")
    else:
        peer = registrar(rig, source)
        calls["PyTorch map + grid_sample"] = lambda d, _: peer(d)
    return calls


def main() -> None:
    print(machine())
    cv2.setNumThreads(1)
    reference = xcalib.Pinhole.from_hfov(WIDTH, HEIGHT, 50)
    rig = xcalib.Rig(reference, xcalib.Pinhole.from_hfov(640, 512, 48), t=[-0.13, 0.01, 0.02])
    calls, frames = contestants(rig), depths()
    times: dict[str, list[float]] = {name: [] for name in calls}
    order = np.random.default_rng(1)
    for i in range(ROUNDS + 5):
        for name in order.permutation(list(calls)):
            call = calls[name]
            start = time.perf_counter()
            call(frames[i % 4], i % 4)
            if i >= 5:
                times[name].append(time.perf_counter() - start)
    for name, values in times.items():
        spread(name, 1e3 * np.array(values), "ms")

    def ratio(text: str, above: str, below: str, target: str | None = None) -> None:
        if above in times:
            spread(text, np.array(times[above]) / np.array(times[below]), "", target)

    ratio("numpy map + cv2.remap takes, times ours", "numpy map + cv2.remap", "float32")
    ratio("PyTorch map + grid_sample takes, times ours", "PyTorch map + grid_sample", "float32")
    ratio("ours takes, times cv2.remap with the map ready", "float32", "cv2.remap, map ready")
    ratio("ours takes, times a copy", "float32", "copy")
    ratio("ours with occlusion takes, times a copy", "float32, occlusion", "copy")
    ratio("with a lens on the source, times without", "float32, source lens", "float32", "<= 1.2")
    ratio("with lenses on both, times without", "float32, both lenses", "float32", "<= 1.4")
    ratio(
        "with a lens on the source, times without, with occlusion",
        "float32, source lens, occlusion",
        "float32, occlusion",
        "<= 1.2",
    )
    ratio(
        "with lenses on both, times without, with occlusion",
        "float32, both lenses, occlusion",
        "float32, occlusion",
        "<= 1.4",
    )
    for size in ("640x480", "320x240", "518x388"):
        for kind, target in (("float32", "<= 1.15"), ("uint8", "<= 1.2")):
            full = f"{kind}, occlusion"
            ratio(
                f"{full}, with {size} depth, times full-size", f"{full}, {size} depth", full, target
            )
    ratio(
        "with half-size depth numpy map + cv2.resize + cv2.remap takes, times ours with occlusion",
        "half-size depth: numpy map + cv2.resize + cv2.remap",
        "float32, occlusion, 640x480 depth",
        ">= 3.5",
    )
    ratio(
        "ours with occlusion takes, times cv2.remap with the map ready",
        "float32, occlusion",
        "cv2.remap, map ready",
        "<= 0.95",
    )
    ratio(
        "uint8: ours with occlusion takes, times cv2.remap with the map ready",
        "uint8, occlusion",
        "uint8: cv2.remap, map ready",
        "<= 0.85",
    )
    ratio(
        "colour takes, times gray, uint8, with occlusion",
        "uint8, colour, occlusion",
        "uint8, occlusion",
        "<= 1.6",
    )
    ratio("float32 takes, times uint8", "float32", "uint8")
    ratio("one thread takes, times two", "float32", "float32, two threads")
    ratio(
        "one thread takes, times two, with occlusion",
        "float32, occlusion",
        "float32, occlusion, two threads",
    )


if __name__ == "__main__":
    main()
