"""The benchmarks, one after the other: printed, and kept in bench/results.

run.py                     those that docs/performance.md publishes, in some 15 minutes on two cores
run.py --all               the others too, in more than an hour
run.py NAME ...            these
run.py NAME -- OPTION ...  one of them with options of its own (NAME -- --help); nothing is kept
run.py --list              their names, and what each measures
run.py --docs              then writes the tables of docs/performance.md and its picture
run.py --docs-only         writes them from what is kept

The newest run of each benchmark is kept, with its commit, its date and the machine; a run that
fails, or that skips everything, replaces nothing.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import pages
from common import ROOT, cpu, git, summary
from figures import KEPT_IN
from speed import kernels

BENCH = ROOT / "bench"
KEPT = BENCH / "results" / "latest.json"
DOCS = ROOT / "docs" / "performance.md"
ROOFLINE = ROOT / "docs" / "images" / "roofline.svg"
PACKAGES = ("numpy", "opencv-python-headless", "onnxruntime", "scipy", "torch", "matplotlib")


def scripts(folder: str, *names: str) -> dict[str, Path]:
    return {name: BENCH / folder / f"{name}.py" for name in names}


# What each measures is the first line of its docstring. bench/experiments has a list of its own.
PUBLISHED = (  # each has its table in docs/performance.md
    scripts("speed", "kernels", "register_frame", "calibration_time")
    | scripts("accuracy", "night_rig", "flir_rig", "depth_measured")
)
OTHERS = scripts("speed", "stream") | scripts("scale", "efficiency", "overhead", "simulate")
OTHERS |= scripts(
    "accuracy",
    *("synthetic_rigs", "depth_sources", "depth_completion", "depth_conditioning", "patch_flow"),
    *("flow_term", "frame_choice", "clock_offset", "lags", "lenses", "rolling_shutter", "trust"),
)
ALL = PUBLISHED | OTHERS


def commit() -> str:
    """Short hash; -dirty where something that is measured differs from it."""
    measured = ["cpp", "python", "bench", ":!bench/results", "CMakeLists.txt"]
    changed = git("status", "--porcelain", "--", *measured)
    return (git("rev-parse", "--short", "HEAD") or "unknown") + ("-dirty" if changed else "")


def software() -> dict[str, str]:
    found = {"system": platform.platform(), "python": platform.python_version()}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    return found


# -- Running -------------------------------------------------------------------------------------


def run(name: str, options: list[str]) -> tuple[dict[str, Any], bool]:
    """What is kept of it, and whether it came to its end."""
    print(f"== {name}: {summary(ALL[name])}", flush=True)
    record: dict[str, Any] = {
        "commit": commit(),
        "date": time.strftime("%Y-%m-%d %H:%M", time.gmtime()) + " UTC",
        "cpu": cpu(),
        "load_average": list(os.getloadavg()),
        "software": software(),
    }
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        kept = Path(folder) / "figures"
        kept.touch()
        done = subprocess.run(
            [sys.executable, str(ALL[name]), *options],
            env=os.environ | {KEPT_IN: str(kept), "PYTHONPATH": str(BENCH)},
        )
        lines = [json.loads(line) for line in kept.read_text().splitlines()]
    record["seconds"] = round(time.perf_counter() - start, 1)
    record["figures"] = [line for line in lines if "details" not in line]
    for line in lines:
        if "details" in line:
            record["details"] = line["details"]
    return record, done.returncode == 0


def measured(record: dict[str, Any]) -> bool:
    """Not where all was skipped, for want of data or of a build: what was kept before stays."""
    return "details" in record or any("value" in figure for figure in record["figures"])


# -- Writing -------------------------------------------------------------------------------------


def number(value: float) -> str:
    return f"{value:.4g}" if abs(value) < 1e4 else f"{value:.0f}"


def table(figures: list[dict[str, Any]]) -> str:
    rows = []
    for f in figures:
        if "skipped" in f:
            rows.append([f["name"], f"skipped: {f['skipped']}", "", ""])
            continue
        spread = f"{number(f['low'])} - {number(f['high'])}" if "low" in f else ""
        target = f"{f['target']}: {'met' if f['met'] else '**not met**'}" if "target" in f else ""
        rows.append([f["name"], f"{number(f['value'])} {f['unit']}".strip(), spread, target])
    return pages.table(["figure", "median", "10-90 %", "target"], rows)


def section(name: str, record: dict[str, Any]) -> str:
    """When and where it ran, and its table."""
    load = ", ".join(f"{value:.1f}" for value in record["load_average"])
    whence = (
        f"Commit {record['commit']}, {record['date']}, {record['cpu']}, load average at the start"
        f" {load}."
    )
    own = kernels.table(record["details"]) if name == "kernels" else table(record["figures"])
    return f"\n{whence}\n\n{own}\n"


def software_text(records: dict[str, Any]) -> str:
    """What the benchmarks ran with, a line for those that ran with the same."""
    alike: dict[str, list[str]] = {}
    for name, record in records.items():
        found = record["software"] | record.get("details", {}).get("software", {})
        alike.setdefault(", ".join(f"{k} {v}" for k, v in found.items()), []).append(name)
    return "\n".join(f"- {', '.join(names)}: {text}." for text, names in alike.items()) + "\n"


def markdown(records: dict[str, Any]) -> str:
    parts = [f"# The newest run of each benchmark\n\n{software_text(records)}"]
    for name, script in ALL.items():
        if name in records:
            parts.append(f"\n## {name}\n\n{summary(script)}\n{section(name, records[name])}")
    return "".join(parts).rstrip("\n") + "\n"


def write_docs(records: dict[str, Any]) -> None:
    """Between the markers of docs/performance.md; what was never run stays as it is."""
    published = {name: records[name] for name in PUBLISHED if name in records}
    for name, record in published.items():
        pages.replace_marked(DOCS, name, section(name, record))
    pages.replace_marked(DOCS, "software", f"\n{software_text(published)}\n")
    if "kernels" in records:
        kernels.draw(records["kernels"]["details"], records["kernels"]["cpu"], ROOFLINE)


def listing() -> str:
    lines = []
    for title, some in (("published:", PUBLISHED), ("others:", OTHERS)):
        lines += [title, *(f"  {name:<18}  {summary(script)}" for name, script in some.items())]
    return "\n".join([*lines, "experiments of docs/results.md: python bench/experiments --help"])


def main() -> int:
    given = sys.argv[1:]
    split = given.index("--") if "--" in given else len(given)
    given, options = given[:split], given[split + 1 :]
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--docs", action="store_true")
    parser.add_argument("--docs-only", action="store_true")
    args = parser.parse_args(given)
    if unknown := set(args.names) - set(ALL):
        parser.error(f"no benchmark {', '.join(sorted(unknown))}, expected some of\n{listing()}")
    if options and len(args.names) != 1:
        parser.error(f"{len(args.names)} names before --, expected the one that takes the options")
    if args.list:
        print(listing())
        return 0
    if options:
        return 0 if run(args.names[0], options)[1] else 1
    records = json.loads(KEPT.read_text()) if KEPT.is_file() else {}
    if args.docs_only:
        write_docs(records)
        return 0
    failed, kept = [], []
    for name in args.names or (ALL if args.all else PUBLISHED):
        record, whole = run(name, [])
        if not whole:
            failed.append(name)
        if not whole or not measured(record):
            continue
        records[name] = record
        kept.append(name)
        pages.write_whole(KEPT, json.dumps(records, indent=1) + "\n")  # so far
        pages.write_whole(KEPT.with_suffix(".md"), markdown(records))
    print(f"kept in {KEPT.relative_to(ROOT)} and .md: {', '.join(kept) or 'nothing new'}")
    if args.docs:
        write_docs(records)
    if failed:
        print(f"error: {', '.join(failed)} failed", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
