"""What the metrics say of aligned pairs that are shifted apart.

As printed: for delta = 0..20 the visible image shows u - 2 delta, the thermal one u + 2 delta, so
that they are 4 delta px apart, over windows of one size.
"""

import cv2
import numpy as np
from common import data, gray
from results import Results

from xcalib import metrics

STEPS = 21
MARGIN = 40


def mutual_information(a: np.ndarray, b: np.ndarray) -> float:
    """Of 32 x 32 gray levels [nat]."""
    joint = np.histogram2d(a.ravel(), b.ravel(), bins=32, range=[[0, 1], [0, 1]])[0]
    joint /= joint.sum()
    apart = joint.sum(axis=1, keepdims=True) * joint.sum(axis=0, keepdims=True)
    some = joint > 0
    return float(np.sum(joint[some] * np.log(joint[some] / apart[some])))


# RMSE and PSNR of images in [0, 1]. For RMSE less is better: its reciprocal is judged.
METRICS = {
    "NEC": metrics.nec,
    "NEC, floor as printed": lambda a, b: metrics.nec(a, b, floor="printed"),
    "GC": metrics.gc,
    "SSIM": metrics.ssim,
    "NCC": metrics.ncc,
    "MI": mutual_information,
    "RMSE": metrics.rmse,
    "PSNR": metrics.psnr,
}


def windows(visible: np.ndarray, thermal: np.ndarray, delta: int):
    """Both images' windows at a step, W - 80 wide."""
    width = visible.shape[1] - 2 * MARGIN
    here, there = MARGIN - 2 * delta, MARGIN + 2 * delta
    return visible[:, here : here + width], thermal[:, there : there + width]


def pairs(results: Results):
    """The visible and the thermal image of each pair, in [0, 1]."""
    folder = data("roadscene")
    if folder is None:
        return
    names = sorted(p.name for p in (folder / "visible").iterdir())
    for name in names[:: results.of(1, 110)]:
        visible = gray(cv2.imread(str(folder / "visible" / name)))
        thermal = gray(cv2.imread(str(folder / "thermal" / name), cv2.IMREAD_UNCHANGED))
        shrink = results.of(1, 0.5)
        if shrink != 1:
            visible, thermal = (
                cv2.resize(one, None, fx=shrink, fy=shrink) for one in (visible, thermal)
            )
        yield visible, thermal


def run(results: Results, part: str | None) -> None:
    values = [
        [
            [score(*(np.ascontiguousarray(w) for w in windows(*pair, delta)))
             for score in METRICS.values()]
            for delta in range(STEPS)
        ]
        for pair in pairs(results)
    ]  # fmt: skip
    if not values:
        return
    each = np.array(values)  # pair, delta, metric
    mean = each.mean(axis=0)
    shift = 4 * np.arange(STEPS)  # [px] between the images
    rows = []
    for m, name in enumerate(METRICS):
        single = each[:, :, m]
        good = mean[:, m] / abs(mean[0, m])  # of NCC the mean at 0 is negative
        if name == "RMSE":
            good, single = 1 / good, -single
        # Half of the way from the top to the mean beyond 40 px.
        bottom = good[shift > 40].mean()
        below = good < (good[0] + bottom) / 2
        first = int(np.argmax(below)) if below.any() else STEPS - 1
        width = np.interp(
            (good[0] + bottom) / 2,
            good[[first, max(first - 1, 0)]],
            shift[[first, max(first - 1, 0)]],
        )
        steps = np.diff(good)
        rows.append(
            [
                name,
                f"{mean[0, m]:.3f}",
                "yes" if (steps < 0).all() else f"no ({np.mean(steps < 0):.0%} of the steps fall)",
                f"{good[0] - np.interp(10, shift, good):.1%}",
                f"{good[0] - good[-1]:.1%}",
                f"{2 * width:.0f} px" if good[0] > bottom else "no peak",
                f"{np.mean(single.argmax(axis=1) == 0):.0%}",
            ]
        )
    results.table(
        "metrics",
        ["metric", "at 0", "falls with every step", "loss at 10 px", "at 80 px", "width of peak",
         "pairs with the best value at 0"],
        rows,
        f"{len(values)} pairs of RoadScene, {STEPS} steps of 4 px between the images. Losses are of"
        " the mean curve over the size of its value at 0 (RMSE: of its reciprocal); the width is of"
        " the mean curve, both sides, half way down to its mean beyond 40 px.",
    )  # fmt: skip

    def draw(figure) -> None:
        axes = figure.subplots()
        for m, name in enumerate(METRICS):
            axes.plot(shift, mean[:, m] / mean[0, m], label=name)
        axes.set(xlabel="shift between the images [px]", ylabel="mean, over its value at 0")
        axes.grid(alpha=0.3)
        axes.legend(bbox_to_anchor=(1.0, 1.0))

    results.plot("metrics", draw, keep=False)
