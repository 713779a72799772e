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

EXPERIMENTS = {  # module, and the tables that it writes
    "1": ("metrics_by_shift", ["metrics"]),
    "2": ("consistency", ["consistency"]),
    "3": ("comparison", ["night", "folds", "rendered"]),
    "4": ("translation_scales", ["scales"]),
    "5": ("ablation", ["night", "rendered"]),
    "6": ("depth_errors", ["depth"]),
    "7": ("basin", ["displacement", "limits", "frames"]),
    "8": ("few_frames", ["night", "rendered"]),
    "9": ("nominal", ["nominal"]),
    "rest": ("rest", ["corrections", "neighbours", "where"]),
    "refine": ("refinement", ["night", "known"]),
}


def listing() -> str:
    folder = Path(__file__).parent
    return "\n".join(
        f"  {name:<6}  {summary(folder / f'{module}.py')}"
        for name, (module, _) in EXPERIMENTS.items()
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
        module, tables = EXPERIMENTS[name]
        results = Results(args.results, name, tables, args.quick, deadline)
        importlib.import_module(module).run(results, args.part)
        print(f"{time.perf_counter() - start:.0f} s, results in {args.results}")


if __name__ == "__main__":
    main()
