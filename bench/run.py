"""The published benchmarks, one after the other: printed, and kept in bench/results.

run.py            those that say how fast, and how good, in some 15 minutes on two cores
run.py --all      the long ones too
run.py NAME ...   these
run.py --docs     writes the tables of docs/performance.md and its picture from what was found
run.py --docs-only [results.json]    writes them from results kept before
"""

import argparse
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import roofline
from common import ROOT, cpu_model
from figures import KEPT_IN

BENCH = ROOT / "bench"
RESULTS = BENCH / "results"
DOCS = ROOT / "docs" / "performance.md"
ROOFLINE = ROOT / "docs" / "images" / "roofline.svg"
KERNELS = ROOT / "build" / "bench" / "cpp" / "bench" / "cpp" / "xcalib_bench"

SHORT = ("kernels", "register_frame", "calibration_time", "night_rig", "flir_rig", "depth_measured")
LONG = (
    "synthetic_rigs",
    "depth_completion",
    "depth_conditioning",
    "depth_sources",
    "patch_flow",
    "flow_term",
    "frame_choice",
    "clock_offset",
)
FIGURES_OF = re.compile(r"(<!-- figures: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)
PACKAGES = ("numpy", "opencv-python-headless", "onnxruntime", "scipy", "torch", "matplotlib")


def git(*arguments: str) -> str:
    command = ["git", "-C", str(ROOT), *arguments]
    return subprocess.run(command, capture_output=True, text=True).stdout.strip()


def commit() -> str:
    """Short hash; -dirty where something that is measured differs from it."""
    measured = ["cpp", "python", "bench/*.py", "bench/*/*.py", "bench/cpp", "CMakeLists.txt"]
    changed = git("status", "--porcelain", "--", *measured)
    return (git("rev-parse", "--short", "HEAD") or "unknown") + ("-dirty" if changed else "")


def machine() -> dict[str, Any]:
    found: dict[str, Any] = {
        "cpu": cpu_model(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "load_average": list(os.getloadavg()),
    }
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


# -- Running -------------------------------------------------------------------------------------


def run_script(name: str, arguments: list[str]) -> tuple[list[dict[str, Any]], bool]:
    """Its figures, and whether it came to its end."""
    with tempfile.TemporaryDirectory() as folder:
        kept = Path(folder) / "figures"
        kept.touch()
        done = subprocess.run(
            [sys.executable, str(BENCH / f"{name}.py"), *arguments],
            env=os.environ | {KEPT_IN: str(kept)},
        )
        return [json.loads(line) for line in kept.read_text().splitlines()], done.returncode == 0


def run_kernels(found: dict[str, Any]) -> tuple[list[dict[str, Any]], bool]:
    """The C++ ones, whose own JSON is kept whole; what they know of the machine goes with it."""
    if not KERNELS.is_file():
        reason = "not built (make bench builds it)"
        print(f"skipped: kernels: {reason}")
        return [{"name": "kernels", "skipped": reason}], True
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "kernels.json"
        done = subprocess.run(
            [
                *(str(KERNELS), f"--benchmark_out={out}", "--benchmark_out_format=json"),
                *("--benchmark_repetitions=7", "--benchmark_min_time=0.15"),
                "--benchmark_enable_random_interleaving=true",
                "--benchmark_display_aggregates_only=true",
            ]
        )
        if done.returncode != 0:
            return [], False
        found["kernels"] = json.loads(out.read_text())
    context = found["kernels"]["context"]
    for private in ("executable", "host_name"):
        del context[private]
    wanted = ("highway_target", "compiler", "Ceres", "Eigen", "OpenCV")
    found["machine"] |= {key: context[key] for key in wanted}
    return roofline.figures_of(found["kernels"]), True


# -- Writing -------------------------------------------------------------------------------------


def write_whole(path: Path, text: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(path.name + ".part")
    beside.write_text(text)
    beside.replace(path)


def number(value: float) -> str:
    return f"{value:.4g}" if abs(value) < 1e4 else f"{value:.0f}"


def table(figures: list[dict[str, Any]]) -> str:
    lines = ["| figure | median | 10-90 % | target |", "|---|---|---|---|"]
    for f in figures:
        if "skipped" in f:
            lines.append(f"| {f['name']} | skipped: {f['skipped']} | | |")
            continue
        spread = f"{number(f['low'])} - {number(f['high'])}" if "low" in f else ""
        target = f"{f['target']}: {'met' if f['met'] else '**not met**'}" if "target" in f else ""
        value = f"{number(f['value'])} {f['unit']}".strip()
        lines.append(f"| {f['name']} | {value} | {spread} | {target} |")
    return "\n".join(lines) + "\n"


def machine_text(found: dict[str, Any]) -> str:
    load = ", ".join(f"{value:.1f}" for value in found["machine"]["load_average"])
    rest = [
        f"{key} {value}"
        for key, value in found["machine"].items()
        if key not in ("cpu", "cores", "load_average")
    ]
    return (
        f"Commit {found['commit']}, {found['date']}. {found['machine']['cpu']}, "
        f"{found['machine']['cores']} cores, load average at the start {load}. {', '.join(rest)}.\n"
    )


def markdown(found: dict[str, Any]) -> str:
    parts = [f"# Benchmarks of {found['commit']}\n\n{machine_text(found)}"]
    parts += [f"\n## {name}\n\n{table(figures)}" for name, figures in found["figures"].items()]
    return "".join(parts)


def write_docs(found: dict[str, Any]) -> None:
    """Between the markers of docs/performance.md; what was not run stays as it is."""

    def fill(match: re.Match[str]) -> str:
        name = match[2]
        if name == "machine":
            body = "\n" + machine_text(found) + "\n"
        elif name == "kernels" and "kernels" in found:
            body = "\n" + roofline.table(found["kernels"]) + "\n"
        elif name in found["figures"]:
            body = "\n" + table(found["figures"][name]) + "\n"
        else:
            return match[0]
        return match[1] + body + match[3]

    write_whole(DOCS, FIGURES_OF.sub(fill, DOCS.read_text()))
    if "kernels" in found:
        roofline.draw(found["kernels"], found["machine"], ROOFLINE)


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--docs", action="store_true")
    parser.add_argument("--docs-only", nargs="?", const="", metavar="RESULTS")
    parser.add_argument("--rounds", type=int, default=2, help="of calibration_time")
    args = parser.parse_args()
    if unknown := set(args.names) - {*SHORT, *LONG}:
        parser.error(f"no benchmark {sorted(unknown)}, expected some of {[*SHORT, *LONG]}")
    if args.docs_only is not None:
        kept = Path(args.docs_only or RESULTS / f"{commit()}.json")
        if not kept.is_file():
            parser.error(f"no results in {kept}")
        write_docs(json.loads(kept.read_text()))
        return 0
    found: dict[str, Any] = {
        "commit": commit(),
        "date": time.strftime("%Y-%m-%d %H:%M", time.gmtime()) + " UTC",
        "machine": machine(),
        "figures": {},
        "seconds": {},
    }
    kept = RESULTS / f"{found['commit']}.json"
    if args.names and kept.is_file() and not found["commit"].endswith("-dirty"):
        before = json.loads(kept.read_text())
        found = before | found | {key: before[key] for key in ("figures", "seconds")}
        found["machine"] = before["machine"] | found["machine"]
    failed = []
    for name in args.names or (SHORT + LONG if args.all else SHORT):
        print(f"== {name}", flush=True)
        start = time.perf_counter()
        options = ["--rounds", str(args.rounds)] if name == "calibration_time" else []
        figures, whole = run_kernels(found) if name == "kernels" else run_script(name, options)
        if not whole:
            failed.append(name)
        found["figures"][name] = figures
        found["seconds"][name] = round(time.perf_counter() - start, 1)
        write_whole(kept, json.dumps(found, indent=1) + "\n")  # so far
    print(machine_text(found))
    write_whole(kept.with_suffix(".md"), markdown(found))
    print(f"kept in {kept.relative_to(ROOT)} and .md")
    if args.docs:
        write_docs(found)
    if failed:
        print(f"error: {', '.join(failed)} failed", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
