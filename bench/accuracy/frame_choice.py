"""Which frames to calibrate on: the informed choice beside the random one, on the night rig.

Of the 32 frames to fit on, 8 and then 16 are chosen with ten seeds and calibrated on; each rig is
judged on the 8 held-out frames (sorted, every fifth from the fifth). The footage of a seed is
`--footage` frames drawn from the 32 (both ways choose from the same), so that the informed choice
too has something to draw.
"""

import argparse
import random
from functools import cache

import numpy as np
from common import data, machine
from figures import figure

import xcalib
from xcalib._core import choose_frames as draw_frames
from xcalib.choose import choose_informed
from xcalib.depth import FolderDepth
from xcalib.evaluate import evaluate
from xcalib.footage import ImageFiles
from xcalib.frames import list_files


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--chosen", type=int, nargs="+", default=[8, 16])
    parser.add_argument("--footage", type=int, default=32, help="frames to choose from, of the 32")
    args = parser.parse_args()
    print(machine())
    folder = data("lynred_night")
    if folder is None:
        return
    visible = list_files(folder / "visible")
    references, sources = ImageFiles(visible), ImageFiles(list_files(folder / "thermal"))
    depth = FolderDepth(folder / "depth_filled", visible)
    held = list(range(4, len(visible), 5))
    fit = [i for i in range(len(visible)) if i not in held]

    @cache
    def read(i: int):
        return references[i], sources[i], depth(i, references[i])

    @cache
    def judged(frames: tuple[int, ...]) -> tuple[float, float, bool]:
        result = xcalib.calibrate(*zip(*map(read, frames), strict=True))
        scores = evaluate(result.rig, *zip(*map(read, held), strict=True)).registered
        return scores["patch_median"], scores["patch_under_2px"], result.converged

    for chosen in args.chosen:
        found: dict[str, list[tuple[int, ...]]] = {"spread": [], "informed": []}
        for seed in range(args.seeds):
            footage = sorted(random.Random(seed).sample(fit, args.footage))
            spread = draw_frames(len(footage), chosen, seed)
            choice = choose_informed(len(footage), chosen, seed, lambda i, f=footage: read(f[i]))
            for name, indices in (("spread", spread), ("informed", choice.indices)):
                found[name].append(tuple(footage[i] for i in indices))
        for name, sets in found.items():
            results = np.array([judged(frames) for frames in sets], float)
            median, share, trusted = results.T
            label = f"{chosen} frames, {name}"
            figure(f"{label}: patch residual, mean of the draws", median.mean(), "px")
            figure(f"{label}: its standard deviation", median.std(), "px")
            figure(f"{label}: worst", median.max(), "px")
            figure(f"{label}: under 2 px, mean of the draws", 100 * share.mean(), "%")
            figure(f"{label}: its standard deviation, in %", 100 * share.std(), "%")
            figure(f"{label}: worst, in %", 100 * share.min(), "%")
            figure(f"{label}: trusted, of {len(sets)}", trusted.sum())
            figure(f"{label}: distinct draws", len(set(sets)))


if __name__ == "__main__":
    main()
