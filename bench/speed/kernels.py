"""The kernels' figures beside what the machine can do, and the picture of it.

    roofline.py [results.json [picture.svg]]

Arithmetic is counted by hand, below, as the equations ask for it, not as a compiler does it: so a
kernel that finds a way around some of it comes out better. Bytes are what a kernel must read and
write at least, as bench/cpp/kernels.cpp counts them. One thread.
"""

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

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


def samples(kernels: dict[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """The repetitions of each benchmark, which ran in turns; in the order of kernels.cpp."""
    found: dict[str, list[dict[str, Any]]] = {}
    for entry in sorted(kernels["benchmarks"], key=lambda entry: entry["family_index"]):
        if entry["run_type"] == "iteration":
            found.setdefault(entry["run_name"], []).append(entry)
    return found


def median(entries: list[dict[str, Any]], key: str) -> float:
    return float(np.median([entry[key] for entry in entries]))


def copies(found: dict[str, list[dict[str, Any]]]) -> dict[int, float]:
    """Bytes a second, by the bytes of a copy."""
    return {
        int(name.split("/")[1]): median(entries, "bytes_per_second")
        for name, entries in found.items()
        if name.startswith("copy/")
    }


def roofs(found: dict[str, list[dict[str, Any]]]) -> tuple[float, float, float]:
    """Flops a second; bytes a second of a copy as large as the kernels', and of one of 256 MB."""
    speeds = copies(found)
    largest = max(speeds)
    return (
        median(found["multiply_add"], "flops"),
        float(np.median([speed for size, speed in speeds.items() if size != largest])),
        speeds[largest],
    )


def points(found: dict[str, list[dict[str, Any]]]) -> dict[str, tuple[float, float]]:
    """Flops a byte and flops a second of the kernels that were counted."""
    out = {}
    for name, entries in found.items():
        if "pixels" not in entries[0]:
            continue
        flops = flops_per_pixel(name, entries[0].get("edge_share", 0.0))
        if flops is None:
            continue
        pixels, size = entries[0]["pixels"], entries[0]["bytes"]
        rate = median(entries, "items_per_second")
        out[name] = (flops * pixels / size, flops * rate)
    return out


@dataclass(frozen=True)
class Row:
    """A kernel: times of a call [ms], then what it makes of its bytes and arithmetic."""

    name: str
    times: tuple[float, float, float]  # 10, 50, 90 %
    speed: float  # [bytes / s]
    share: float  # of the speed of a copy as large
    flops: float | None  # [1 / s]


def rows(found: dict[str, list[dict[str, Any]]]) -> list[Row]:
    speeds, flops, out = copies(found), points(found), []
    for name, entries in found.items():
        if "pixels" not in entries[0]:
            continue
        low, middle, high = np.percentile([e["cpu_time"] for e in entries], [10, 50, 90])
        speed, size = median(entries, "bytes_per_second"), int(entries[0]["bytes"])
        beside = speeds[min(speeds, key=lambda s, size=size: abs(s - size))]
        rate = flops[name][1] if name in flops else None
        out.append(Row(name, (float(low), float(middle), float(high)), speed, speed / beside, rate))
    return out


def figures_of(kernels: dict[str, Any]) -> list[dict[str, Any]]:
    """The machine's and the kernels', as figures.py has them."""
    found = samples(kernels)
    peak, near, far = roofs(found)
    out: list[dict[str, Any]] = [
        {"name": "multiply-adds, one thread", "value": peak / 1e9, "unit": "GFLOP/s"},
        {"name": "copy, as large as the kernels' data", "value": near / 1e9, "unit": "GB/s"},
        {"name": "copy, 256 MB", "value": far / 1e9, "unit": "GB/s"},
    ]
    for row in rows(found):
        low, middle, high = row.times
        out.append({"name": row.name, "value": middle, "unit": "ms", "low": low, "high": high})
        share = {"name": f"{row.name}, of a copy's speed", "value": 100 * row.share, "unit": "%"}
        out.append(share)
    return out


def table(kernels: dict[str, Any]) -> str:
    """The same with a kernel a line, for the page."""
    found = samples(kernels)
    peak, near, far = roofs(found)
    lines = [
        f"Multiply-adds: {peak / 1e9:.0f} GFLOP/s. A copy: {near / 1e9:.1f} GB/s (as many bytes as "
        f"the kernels', median), {far / 1e9:.1f} GB/s (256 MB).",
        "",
        "| kernel | ms | 10-90 % | GB/s | of a copy as large | GFLOP/s |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows(found):
        low, middle, high = row.times
        flops = "" if row.flops is None else f"{row.flops / 1e9:.1f}"
        lines.append(
            f"| {row.name} | {middle:.3g} | {low:.3g} - {high:.3g} | {row.speed / 1e9:.2f} | "
            f"{row.share:.1%} | {flops} |"
        )
    return "\n".join(lines) + "\n"


def draw(kernels: dict[str, Any], machine: dict[str, Any], path: Path) -> None:
    """Attainable and attained, log by log."""
    import matplotlib as mpl

    mpl.use("svg")
    mpl.rcParams |= {"svg.hashsalt": "xcalib", "svg.fonttype": "none", "font.size": 9}
    from matplotlib import pyplot as plt

    found = samples(kernels)
    peak, near, far = roofs(found)
    at = points(found)
    figure, axes = plt.subplots(figsize=(8, 5))
    intensity = np.geomspace(0.5, 1000, 200)
    for speed, label, style in ((near, "copy of as many bytes", "-"), (far, "copy, 256 MB", "--")):
        roof = np.minimum(peak, intensity * speed) / 1e9
        axes.plot(intensity, roof, style, color="0.3", label=f"{label}: {speed / 1e9:.1f} GB/s")
    families = {name.split("/")[0]: None for name in at}
    markers = dict(zip(families, "osv^D", strict=False))
    for name, (x, y) in at.items():
        family = name.split("/")[0]
        colour = f"C{list(families).index(family)}"
        axes.plot(x, y / 1e9, markers[family], color=colour, label=families[family] or "_")
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
    axes.set_title(f"{machine['cpu']}, {machine['highway_target']}: {peak / 1e9:.0f} GFLOP/s")
    axes.grid(True, which="major", alpha=0.3)
    axes.legend(loc="lower right")
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(path.name + ".part")
    figure.savefig(beside, format="svg", metadata={"Date": None})
    beside.replace(path)
    plt.close(figure)


def main() -> None:
    results = Path(sys.argv[1]) if len(sys.argv) > 1 else newest()
    picture = Path(sys.argv[2] if len(sys.argv) > 2 else "docs/images/roofline.svg")
    found = json.loads(results.read_text())
    draw(found["kernels"], found["machine"], picture)
    print(f"{picture} from {results}")


def newest() -> Path:
    kept = (Path(__file__).parent / "results").glob("*.json")
    return max(kept, key=lambda path: path.stat().st_mtime)


if __name__ == "__main__":
    main()
