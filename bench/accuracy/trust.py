"""How often the verdict and the expected error are right, on rigs whose truth is known.

Random rendered rigs of 320x240 px, ten to twelve frames each, spoiled in one way a kind; and real
pairs, whose thermal image is warped by a known rig. Errors are end-point errors, in px of the
reference at 640 px of width, over the depths of the footage.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from common import data, machine
from figures import figure
from numpy.random import Generator
from rendered import HEIGHT, SOURCE_HEIGHT, SOURCE_WIDTH, WIDTH, rendered

import xcalib
from xcalib import synthetic

LIMITS = {
    "hfov_deg": (35, 65),
    "fov_ratio": (0.75, 1.3),
    "max_offset": 0.12,
    "max_roll_deg": 3.0,
    "max_baseline": 0.35,
}
FRAMES = 12


@dataclass
class Case:
    rig: xcalib.Rig
    references: list[np.ndarray]
    sources: list[np.ndarray]
    depths: list[np.ndarray]
    depth_scale: float = 1.0
    """Of the depths that are given, over the true ones."""

    def each_source(self, change: Callable[[np.ndarray], np.ndarray]) -> None:
        self.sources = [change(source) for source in self.sources]

    def first(self, count: int) -> None:
        for name in ("references", "sources", "depths"):
            setattr(self, name, getattr(self, name)[:count])


def noisy(image: np.ndarray, sigma: float, rng: Generator) -> np.ndarray:
    return np.clip(image + rng.normal(0, sigma, image.shape), 0, 255).astype(np.uint8)


def faint(image: np.ndarray, contrast: float, rng: Generator) -> np.ndarray:
    return noisy((image.astype(np.float32) - 128) * contrast + 128, 1, rng)


def moved(image: np.ndarray, matrix: list[list[float]]) -> np.ndarray:
    size = image.shape[1::-1]
    return cv2.warpAffine(image, np.array(matrix), size, borderMode=cv2.BORDER_REPLICATE)


def clean(case: Case, rng: Generator) -> None:
    case.first(10)


def noise(case: Case, rng: Generator) -> None:
    sigma = rng.uniform(6, 18)
    case.references = [noisy(image, sigma / 2, rng) for image in case.references]
    case.each_source(lambda image: noisy(image, sigma, rng))


def blur(case: Case, rng: Generator) -> None:
    sigma = rng.uniform(0.8, 2.2)
    case.each_source(lambda image: cv2.GaussianBlur(image, (0, 0), sigma))


def low_contrast(case: Case, rng: Generator) -> None:
    contrast = rng.uniform(0.05, 0.2)
    case.each_source(lambda image: faint(image, contrast, rng))


def few_frames(case: Case, rng: Generator) -> None:
    case.first(int(rng.integers(3, 6)))


def few_and_noisy(case: Case, rng: Generator) -> None:
    case.first(6)
    case.each_source(lambda image: noisy(image, 12, rng))


def depth_scale(case: Case, rng: Generator) -> None:
    case.depth_scale = float(rng.choice([0.8, 0.9, 1.1, 1.25]))
    case.depths = [depth * np.float32(case.depth_scale) for depth in case.depths]


def coarse_depth(case: Case, rng: Generator) -> None:
    def coarse(depth: np.ndarray) -> np.ndarray:
        small = cv2.resize(depth, (80, 60), interpolation=cv2.INTER_NEAREST)
        return cv2.resize(small, depth.shape[1::-1], interpolation=cv2.INTER_NEAREST)

    case.depths = [coarse(depth) for depth in case.depths]


def lens(case: Case, rng: Generator) -> None:
    """The source bends, too little to be found by its lens every time: see `LENSES`."""
    case.first(10)


def strong_lens(case: Case, rng: Generator) -> None:
    case.first(10)


def vibration(case: Case, rng: Generator) -> None:
    def shaken(image: np.ndarray) -> np.ndarray:
        x, y = rng.normal(0, 1, 2)
        return moved(image, [[1, 0, x], [0, 1, y]])

    case.each_source(shaken)


def one_depth_for_all(case: Case, rng: Generator) -> None:
    case.depths = [case.depths[0]] * len(case.depths)


def depth_of_the_next_frame(case: Case, rng: Generator) -> None:
    case.depths = [*case.depths[1:], case.depths[0]]


def constant_depth(case: Case, rng: Generator) -> None:
    case.depths = [np.full_like(depth, 10) for depth in case.depths]


def inverse_depth(case: Case, rng: Generator) -> None:
    case.depths = [np.where(d > 0, 30 / np.maximum(d, 0.1), 0) for d in case.depths]


def upside_down_depth(case: Case, rng: Generator) -> None:
    case.depths = [np.ascontiguousarray(depth[::-1]) for depth in case.depths]


def mirrored_depth(case: Case, rng: Generator) -> None:
    case.depths = [np.ascontiguousarray(depth[:, ::-1]) for depth in case.depths]


def shuffled(case: Case, rng: Generator) -> None:
    case.sources = [*case.sources[4:], *case.sources[:4]]


def no_texture(case: Case, rng: Generator) -> None:
    case.each_source(lambda image: noisy(np.full_like(image, 120), 3, rng))


# Of right footage the expected error must hold; wrong footage must not be trusted.
RIGHT = (clean, noise, blur, low_contrast, few_frames, few_and_noisy, depth_scale, coarse_depth)
RIGHT_TOO = (vibration, lens, strong_lens)
WRONG = (
    depth_of_the_next_frame,
    one_depth_for_all,
    constant_depth,
    inverse_depth,
    upside_down_depth,
    mirrored_depth,
    shuffled,
    no_texture,
)


# k1 of the source.
LENSES = {lens: (-0.08, -0.01), strong_lens: (-0.35, -0.08)}


def street(kind: Callable[[Case, Generator], None], seed: int) -> Case:
    sizes = (WIDTH, HEIGHT, SOURCE_WIDTH, SOURCE_HEIGHT)
    k1 = np.random.default_rng([seed, 78]).uniform(*LENSES[kind]) if kind in LENSES else 0.0
    bent = {"source_lens": xcalib.Lens("brown", [k1, 0, 0, 0])} if k1 else {}
    rig = synthetic.random_rig(seed, *sizes, **LIMITS, **bent)
    frames = rendered(rig, FRAMES, seed)
    case = Case(rig, list(frames.references), list(frames.sources), list(frames.depths))
    kind(case, np.random.default_rng([seed, 77]))
    return case


def real(seed: int, plane: bool, count: int) -> Case | None:
    """Aligned pairs of RoadScene, each on a plane of its own; they are aligned to 1-2 px."""
    folder = data("roadscene")
    if folder is None:
        return None
    rng = np.random.default_rng(1000 + seed)
    limits = {**LIMITS, "hfov_deg": (40, 60), "fov_ratio": (0.85, 1.1), "max_offset": 0.05}
    rig = synthetic.random_rig(5000 + seed, WIDTH, HEIGHT, SOURCE_WIDTH, SOURCE_HEIGHT, **limits)
    names = sorted(path.stem for path in (folder / "visible").iterdir())
    case = Case(rig, [], [], [])
    inverse_K = np.linalg.inv(rig.reference.K)
    rays = np.dstack([*np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT)), np.ones((HEIGHT, WIDTH))])
    rays = rays @ inverse_K.T
    for index in rng.choice(len(names), count, replace=False):
        visible, thermal = (
            cropped(cv2.imread(str(next((folder / name).glob(f"{names[index]}.*")))))
            for name in ("visible", "thermal")
        )
        depth = np.exp(rng.uniform(np.log(3), np.log(40)))
        normal = np.array([*rng.uniform((-0.5, -0.5), (0.5, 0.8)), 1.0]) if plane else np.eye(3)[2]
        homography = rig.source.K @ (rig.R + np.outer(rig.t, normal) / depth) @ inverse_K
        along = rays @ normal
        case.references.append(visible)
        case.sources.append(
            cv2.warpPerspective(
                cv2.cvtColor(thermal, cv2.COLOR_BGR2GRAY),
                homography,
                (SOURCE_WIDTH, SOURCE_HEIGHT),
                borderMode=cv2.BORDER_REPLICATE,
            )
        )
        known = along > 0.05
        case.depths.append(np.where(known, depth / np.where(known, along, 1), 0).astype(np.float32))
    return case


def cropped(image: np.ndarray) -> np.ndarray:
    """The middle of an image, at the size of the rendered ones."""
    height, width = image.shape[:2]
    scale = max(WIDTH / width, HEIGHT / height)
    size = int(np.ceil(width * scale)), int(np.ceil(height * scale))
    image = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    x, y = (size[0] - WIDTH) // 2, (size[1] - HEIGHT) // 2
    return image[y : y + HEIGHT, x : x + WIDTH]


SHARES = {"0.68": 0.68, "0.95": 0.95}


def judged(case: Case, options: xcalib.CalibrationOptions) -> dict[str, Any]:
    """What became of a case: a record, as JSON has it."""
    result = xcalib.calibrate(case.references, case.sources, case.depths, options=options)
    verdict = result.report.verdict
    known = np.concatenate([depth[depth > 0] for depth in case.depths])
    errors, inside = [], {share: [] for share in SHARES}
    for depth in np.quantile(known, [0.05, 0.25, 0.5, 0.75, 0.95]):
        error = error_map(result.rig, case, float(depth))
        errors.append(error)
        for name, share in SHARES.items():
            limit = result.report.expected_error_map(depth, *SHAPE[::-1], share)
            seen = np.isfinite(limit) & np.isfinite(error)
            inside[name].append((error <= limit)[seen])
    return {
        "found": verdict.found,
        "trusted": verdict.trusted,
        "line": verdict.line(),
        "error": float(np.nanmedian(errors)),
        "expected": verdict.expected_error.median,
        "inside": {name: float(np.mean(np.concatenate(each))) for name, each in inside.items()},
    }


def row(name: str, records: list[dict[str, Any]]) -> str:
    found, trusted, error, expected = (
        np.array([record[key] for record in records])
        for key in ("found", "trusted", "error", "expected")
    )
    cover = [
        100 * np.mean([r["inside"][share] for r in records if r["found"]])
        if found.any()
        else np.nan
        for share in SHARES
    ]
    near = np.abs(np.log2(expected[found] / error[found])) <= 1
    share = 100 * np.mean(near) if found.any() else np.nan
    right = error < 0.5
    return (
        f"| {name} | {len(error)} | {np.median(error):.2f} | {found.sum()} | {trusted.sum()} |"
        f" {(trusted & (error > 2)).sum()} | {(~trusted & right).sum()} of {right.sum()} |"
        f" {cover[0]:.0f} % | {cover[1]:.0f} % | {share:.0f} % |"
    )


SHAPE = (12, 16)


def error_map(rig: xcalib.Rig, case: Case, depth: float) -> np.ndarray:
    """End-point error at a depth, as it was given [px of the reference at 640 px of width]."""

    def mapped(rig: xcalib.Rig, depth: float) -> np.ndarray:
        height, width = rig.reference.height, rig.reference.width
        flat = np.full((height, width), depth, np.float32)
        rows, columns = (
            ((np.arange(count) + 0.5) * side / count - 0.5).round().astype(int)
            for count, side in zip(SHAPE, (height, width), strict=True)
        )
        return xcalib.Registrar(rig, num_threads=1).map(flat)[np.ix_(rows, columns)]

    off = mapped(rig, depth) - mapped(case.rig, depth / case.depth_scale)
    unit = 640 / rig.reference.width * rig.reference.fx / rig.source.fx
    return np.linalg.norm(off, axis=-1) * unit


KINDS = {kind.__name__.replace("_", " "): kind for kind in (*RIGHT, *RIGHT_TOO, *WRONG)}
# (on planes that are not fronto-parallel, frames)
REAL = {"real, on planes": (True, 12), "real, flat": (False, 12), "real, six frames": (True, 6)}


def made(name: str, seed: int) -> Case | None:
    return street(KINDS[name], seed) if name in KINDS else real(seed, *REAL[name])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=10, help="of each kind")
    parser.add_argument("--first", type=int, default=200, help="first seed; 100 were for tuning")
    parser.add_argument("--kind", help="only those whose name has this in it")
    parser.add_argument(
        "--kept", type=Path, help="file of what is done already, a JSON line a case; added to"
    )
    args = parser.parse_args()
    print(machine())
    options = xcalib.CalibrationOptions(num_threads=1)
    seeds = range(args.first, args.first + args.cases)
    names = [name for name in (*KINDS, *REAL) if not args.kind or args.kind in name]
    done: dict[tuple[str, int], dict[str, Any]] = {}
    if args.kept and args.kept.exists():
        for line in args.kept.read_text().splitlines():
            record = json.loads(line)
            done[record["kind"], record["seed"]] = record
    for seed in seeds:  # all kinds alike, if it is stopped
        for name in names:
            case = None if (name, seed) in done else made(name, seed)
            if case is None:
                continue
            record = {"kind": name, "seed": seed, **judged(case, options)}
            done[name, seed] = record
            if args.kept:
                with args.kept.open("a") as kept:
                    kept.write(json.dumps(record) + "\n")
    print(
        "| kind | cases | error, median [px] | found | trusted | trusted over 2 px | refused under"
        " 0.5 px | within 68 % | within 95 % | expected within twice |"
    )
    for name in names:
        records = [done[name, seed] for seed in seeds if (name, seed) in done]
        if records:
            print(row(name, records))
    records = [record for (name, seed), record in done.items() if seed in seeds and name in names]
    figure("cases", len(records))
    figure("trusted, over 2 px", sum(r["trusted"] and r["error"] > 2 for r in records))
    figure("refused, under 0.5 px", sum(not r["trusted"] and r["error"] < 0.5 for r in records))


if __name__ == "__main__":
    main()
