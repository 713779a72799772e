"""The paper's experiments on data at hand, and three more: one command each.

    python bench/experiments 3            # one of those below, or all
    python bench/experiments 3 --quick    # seconds, on next to nothing: only to see that it runs

Tables (Markdown, CSV) and plots go to a results folder; a full run also rewrites its tables between
the markers of docs/results.md. Needs the extra `bench`.
"""

import argparse
import importlib
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from common import ROOT, machine, summary
from results import Results

EXPERIMENTS = {
    "1": "metrics_by_shift",
    "2": "consistency",
    "3": "comparison",
    "4": "translation_scales",
    "5": "ablation",
    "6": "depth_errors",
    "7": "basin",
    "8": "few_frames",
    "9": "nominal",
    "rest": "rest",
    "refine": "refinement",
}


def listing() -> str:
    folder = Path(__file__).parent
    return "\n".join(
        f"  {name:<6}  {summary(folder / f'{module}.py')}" for name, module in EXPERIMENTS.items()
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=f"{__doc__}\n{listing()}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("experiment", choices=[*EXPERIMENTS, "all"])
    parser.add_argument(
        "--quick", action="store_true", help="a tiny setting; docs stay as they are"
    )
    parser.add_argument("--results", type=Path, default=ROOT / "build" / "results")
    parser.add_argument("--part", help="of an experiment that has parts; default: all")
    parser.add_argument("--minutes", type=float, help="begin no further rig after so long, in each")
    args = parser.parse_args()
    print(machine())
    for name in EXPERIMENTS if args.experiment == "all" else [args.experiment]:
        start = time.perf_counter()
        deadline = start + 60 * args.minutes if args.minutes else float("inf")
        results = Results(args.results, name, args.quick, deadline)
        importlib.import_module(EXPERIMENTS[name]).run(results, args.part)
        print(f"{time.perf_counter() - start:.0f} s, results in {args.results}")


if __name__ == "__main__":
    main()
