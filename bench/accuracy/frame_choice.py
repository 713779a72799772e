"""Which frames to calibrate on: chosen by their content or drawn blindly, on the night rig.

8 and then 16 of the 32 frames to fit on are chosen with ten seeds and calibrated on; each rig is
judged on the 8 held-out frames (sorted, every fifth from the fifth). Both ways choose from the same
frames: all 32, or `--footage` of them drawn by the seed, so that more seeds differ for the informed
choice too, which looks at every frame of so little footage.
"""

import argparse
import random
from functools import cache

import numpy as np
from common import machine
from figures import figure
from night import NightRig

from xcalib import evaluate
from xcalib._core import draw_frames
from xcalib.choose import choose_informed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--chosen", type=int, nargs="+", default=[8, 16])
    parser.add_argument("--footage", type=int, default=32, help="frames to choose from, of the 32")
    args = parser.parse_args()
    print(machine())
    night = NightRig.open()
    if night is None:
        return

    def frame(name: str):
        return night.visible(name), night.thermal(name), night.filled(name)

    @cache
    def judged(names: tuple[str, ...]) -> tuple[float, float, bool]:
        result = night.fit(night.filled, names)
        scores = evaluate(result.rig, *zip(*map(frame, night.held), strict=True)).registered
        return scores["patch_median"], scores["patch_under_2px"], result.converged

    for chosen in args.chosen:
        found: dict[str, list[tuple[str, ...]]] = {"spread": [], "informed": []}
        for seed in range(args.seeds):
            footage = sorted(random.Random(seed).sample(night.fitted, args.footage))
            spread = draw_frames(len(footage), chosen, seed)
            choice = choose_informed(len(footage), chosen, seed, lambda i, f=footage: frame(f[i]))
            for name, indices in (("spread", spread), ("informed", choice.indices)):
                found[name].append(tuple(footage[i] for i in indices))
        for name, sets in found.items():
            results = np.array([judged(names) for names in sets], float)
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
