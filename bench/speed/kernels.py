"""Each C++ kernel alone, beside a copy of as many bytes and the machine's multiply-adds.

`measured` runs the program of bench/cpp; `table` and `draw` (a roofline) present what it found.
Arithmetic is counted by hand, below, as the equations ask for it and not as a compiler does it, so
a kernel that avoids some of it looks better. Bytes are what a kernel must read and write at least,
as bench/cpp/kernels.cpp counts them. One thread.
"""

import io
import json
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pages
from common import ROOT, machine
from figures import details, skipped

PROGRAM = ROOT / "build" / "bench" / "cpp" / "bench" / "cpp" / "xcalib_bench"

# Additions, multiplications, divisions and roots of one pixel, each counted as one; comparisons,
# conversions, loads and table look-ups as none.
MAP = 6 + 6 + 3  # h x~ in three rows, affine in x; times depth plus k; a reciprocal, two products
BILINEAR = 9  # a channel: three interpolations of a difference, a product and a sum
PLACE = 2  # the fractions of u and v
GRADIENT = 8  # two central differences, their squares, sum and root
CHAIN = {11: 50, 16: 77}  # ProjectionDerivative::chain, line by line


def normal_equations(count: int, edges: float) -> float:
    """Every pixel is warped, with its derivatives; those with an edge enter the Gram matrix."""
    each = MAP + PLACE + BILINEAR + 3 + CHAIN[count] + GRADIENT + 4
    # Clamp, v, polarity, unit vector; 14 for each dv/dp; |a||v|; and the lower triangle of the
    # products of count + 2 columns, in x and y.
    on_edge = 11 + 14 * count + 9 + 4 * (count + 2) * (count + 3) / 2
    return each + edges * on_edge


def flops_per_pixel(kernel: str, edges: float) -> float | None:
    """None where nothing was counted."""
    family, _, kind = kernel.partition("/")
    if family == "register":
        channels = 3 if "x3/" in kernel else 1
        seen = MAP + PLACE + channels * BILINEAR
        # The test projects once more, finds the point's cell twice and the depth to compare.
        return seen + (MAP + 2 * 2 + 3 if kernel.endswith("/mark") else 0)
    if family == "warp":
        return MAP + PLACE + BILINEAR
    if kernel == "nec/value":
        # Clamp, v, the squares of both, their product, the root of the squares', and four sums.
        return MAP + PLACE + BILINEAR + GRADIENT + 2 + 2 + 3 + 3 + 3 + 2 + 4
    if kernel.startswith("nec/normal_equations/"):
        return normal_equations(int(kind.split("/")[1]), edges)
    if family == "edge_map":
        # Blur by 7 taps each way, the mean gradient, the field, its doubled angle, the reduction.
        return 2 * 13 + GRADIENT + GRADIENT + 5 + 11 + 2
    if family == "patch_flow":
        # Both ways; ten a pixel and shift: 49 x 49 shifts at a quarter of the size, 25 at either
        # finer one.
        return 2 * 10 * (49**2 / 16 + 25 / 4 + 25)
    return None  # the search: transforms of many sizes


# -- Measuring -----------------------------------------------------------------------------------


def measured() -> dict[str, Any]:
    """`software`, what the program was built with, and `kernels`: see `samples`."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "kernels.json"
        subprocess.run(
            [
                *(str(PROGRAM), f"--benchmark_out={out}", "--benchmark_out_format=json"),
                *("--benchmark_repetitions=7", "--benchmark_min_time=0.15"),
                "--benchmark_enable_random_interleaving=true",
                "--benchmark_display_aggregates_only=true",
            ],
            check=True,
        )
        written = json.loads(out.read_text())
    wanted = ("highway_target", "compiler", "Ceres", "Eigen", "OpenCV")
    return {
        "software": {key: written["context"][key] for key in wanted},
        "kernels": samples(written["benchmarks"]),
    }


def samples(entries: list[dict[str, Any]]) -> dict[str, dict[str, Any]]:
    """Of each kernel: processor time of a call by repetition [ms], pixels and bytes of a call.

    Where it applies, also the share of pixels with an edge, and flops a second by repetition. In
    the order of kernels.cpp; `entries` are Google Benchmark's, whose repetitions ran in turns.
    """
    found: dict[str, dict[str, Any]] = {}
    for entry in sorted(entries, key=lambda entry: entry["family_index"]):
        if entry["run_type"] != "iteration":
            continue
        constant = {k: entry[k] for k in ("pixels", "bytes", "edge_share") if k in entry}
        kernel = found.setdefault(entry["run_name"], {**constant, "ms": []})
        kernel["ms"].append(entry["cpu_time"])
        if "flops" in entry:
            kernel.setdefault("flops", []).append(entry["flops"])
    return found


# -- Reading -------------------------------------------------------------------------------------


def rate(kernel: dict[str, Any], of: str) -> float:
    """Bytes or pixels a second, median."""
    return float(np.median(1e3 * kernel[of] / np.array(kernel["ms"])))


def copies(kernels: dict[str, Any]) -> dict[int, float]:
    """Bytes a second, by the bytes of a copy."""
    return {
        int(kernel["bytes"]): rate(kernel, "bytes")
        for name, kernel in kernels.items()
        if name.startswith("copy/")
    }


def roofs(kernels: dict[str, Any]) -> tuple[float, float, float]:
    """Flops a second; bytes a second of a copy as large as the kernels', and of one of 256 MB."""
    speeds = copies(kernels)
    largest = max(speeds)
    return (
        float(np.median(kernels["multiply_add"]["flops"])),
        float(np.median([speed for size, speed in speeds.items() if size != largest])),
        speeds[largest],
    )


@dataclass(frozen=True)
class Row:
    """A kernel: times of a call [ms], then how well it uses memory and arithmetic."""

    name: str
    times: tuple[float, float, float]  # 10, 50, 90 %
    speed: float  # [bytes / s]
    share: float  # of the speed of a copy as large
    flops: float | None  # [1 / s]; None where the arithmetic was not counted
    intensity: float | None  # [flop / byte]


def rows(kernels: dict[str, Any]) -> list[Row]:
    speeds, out = copies(kernels), []
    for name, kernel in kernels.items():
        if "pixels" not in kernel:
            continue
        low, middle, high = (float(v) for v in np.percentile(kernel["ms"], [10, 50, 90]))
        speed = rate(kernel, "bytes")
        nearest = min(speeds, key=lambda size, kernel=kernel: abs(size - kernel["bytes"]))
        each = flops_per_pixel(name, kernel.get("edge_share", 0.0))
        flops = None if each is None else each * rate(kernel, "pixels")
        intensity = None if each is None else each * kernel["pixels"] / kernel["bytes"]
        times = low, middle, high
        out.append(Row(name, times, speed, speed / speeds[nearest], flops, intensity))
    return out


def table(found: dict[str, Any]) -> str:
    peak, near, far = roofs(found["kernels"])
    heading = (
        f"Multiply-adds: {peak / 1e9:.0f} GFLOP/s. A copy: {near / 1e9:.1f} GB/s (as many bytes as "
        f"the kernels', median), {far / 1e9:.1f} GB/s (256 MB)."
    )
    columns = ["kernel", "ms", "10-90 %", "GB/s", "of a copy as large", "GFLOP/s"]
    cells = []
    for row in rows(found["kernels"]):
        low, middle, high = row.times
        flops = "" if row.flops is None else f"{row.flops / 1e9:.1f}"
        times = f"{middle:.3g}", f"{low:.3g} - {high:.3g}"
        cells.append([row.name, *times, f"{row.speed / 1e9:.2f}", f"{row.share:.1%}", flops])
    return f"{heading}\n\n{pages.table(columns, cells)}"


def draw(found: dict[str, Any], cpu: str, path: Path) -> None:
    """What is attainable and what is attained, both axes logarithmic."""
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams |= {"svg.hashsalt": "xcalib", "svg.fonttype": "none", "font.size": 9}
    from matplotlib import pyplot as plt

    peak, near, far = roofs(found["kernels"])
    at = {r.name: (r.intensity, r.flops) for r in rows(found["kernels"]) if r.flops is not None}
    figure, axes = plt.subplots(figsize=(8, 5))
    intensity = np.geomspace(0.5, 1000, 200)
    for speed, label, style in ((near, "copy of as many bytes", "-"), (far, "copy, 256 MB", "--")):
        roof = np.minimum(peak, intensity * speed) / 1e9
        axes.plot(intensity, roof, style, color="0.3", label=f"{label}: {speed / 1e9:.1f} GB/s")
    families = list(dict.fromkeys(name.split("/")[0] for name in at))
    for name, (x, y) in at.items():
        family = families.index(name.split("/")[0])
        axes.plot(x, y / 1e9, "osv^D"[family % 5], color=f"C{family}")
    for name, (x, y) in at.items():
        if name.startswith("register/") and "/f32/" not in name:
            continue  # they lie among one another; the table has them all
        label = f"{name} " if name.startswith("register/") else f" {name}"
        side = "right" if name.startswith("register/") else "left"
        height = "top" if name == "nec/normal_equations/11" else "bottom"
        axes.annotate(label, (x, y / 1e9), ha=side, va=height, fontsize=7)
    axes.set(xscale="log", yscale="log", xlim=(0.5, 1000))
    axes.set_xlabel("arithmetic intensity [flop / byte]")
    axes.set_ylabel("GFLOP/s, one thread")
    target = found["software"]["highway_target"]
    axes.set_title(f"{cpu}, {target}: {peak / 1e9:.0f} GFLOP/s")
    axes.grid(True, which="major", alpha=0.3)
    axes.legend(loc="lower right")
    figure.tight_layout()
    data = io.BytesIO()
    figure.savefig(data, format="svg", metadata={"Date": None})
    plt.close(figure)
    pages.write_whole(path, data.getvalue())


def main() -> None:
    print(machine())
    if not PROGRAM.is_file():
        skipped("kernels", "not built (make bench-cpp builds them)")
        return
    found = measured()
    print(table(found))
    details(found)


if __name__ == "__main__":
    main()
