"""The built-in patch flow: its error where that is known, its time, and a real rig.

Rendered streets: the source warped by the true rig turned so that it is 0-12 px off. Aligned real
pairs (good to 1-2 px): shifted by known amounts. The night rig: fitted, then flow beside the patch
residual.
"""

import argparse
import time

import cv2
import numpy as np
from common import data, gray, machine
from figures import figure, spread
from night import SIZE, NightRig

import xcalib
from xcalib import metrics, synthetic
from xcalib.flow import patch_flow

CONFIDENT = 0.5


def turned(rig: xcalib.Rig, pan_px: float, tilt_px: float, roll_deg: float) -> xcalib.Rig:
    """The rig with its source camera turned: about that many reference pixels off."""
    focal = rig.reference.fx
    vector = np.array([tilt_px / focal, pan_px / focal, np.radians(roll_deg)])
    return xcalib.Rig(rig.reference, rig.source, cv2.Rodrigues(vector)[0] @ rig.R, rig.t)


def true_flow(found: xcalib.Rig, truth: xcalib.Rig, depth: np.ndarray) -> np.ndarray:
    """Flow from each reference pixel to where a warp by `found` shows what it sees.

    At p + f the warped image shows the source at map_found(p + f), and what p sees lies there at
    map_true(p): solved by fixed point, in reference pixels.
    """
    at = xcalib.Registrar(found).map(depth)
    wanted = xcalib.Registrar(truth).map(depth)
    height, width = depth.shape
    scale = found.source.fx / found.reference.fx
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    flow = np.zeros((height, width, 2), np.float32)
    for _ in range(30):
        u, v = (np.nan_to_num(p + flow[..., k]) for k, p in enumerate((x, y)))
        here = cv2.remap(at, u, v, cv2.INTER_LINEAR)
        flow += ((wanted - here) / scale).astype(np.float32)
    # At a depth edge it does not settle; beyond the border and without depth there is none.
    inside = (u >= 0) & (v >= 0) & (u <= width - 1) & (v <= height - 1)
    flow[~(inside & (np.abs(wanted - here).max(axis=-1) < 0.1))] = np.nan
    return flow


class Tally:
    """End-point errors of confident pixels over many pairs."""

    def __init__(self) -> None:
        self.errors: list[np.ndarray] = []
        self.confident = self.pixels = 0

    def add(self, flow, confidence, truth, valid) -> None:
        known = valid & np.isfinite(truth[..., 0])
        confident = known & (confidence >= CONFIDENT)
        self.errors.append(np.linalg.norm(flow - truth, axis=-1)[confident])
        self.confident += int(confident.sum())
        self.pixels += int(known.sum())

    def report(self, label: str) -> None:
        e = np.concatenate(self.errors)
        figure(f"{label}: confident pixels", 100 * self.confident / self.pixels, "%")
        if e.size:
            figure(f"{label}: median error", np.median(e), "px")
            figure(f"{label}: under 1 px", 100 * np.mean(e < 1), "%")
            figure(f"{label}: over 3 px", 100 * np.mean(e > 3), "%")


def rendered(seeds: int) -> None:
    for night in (False, True):
        for offset in (0, 1, 2, 4, 8, 12):
            tally = Tally()
            for seed in range(seeds):
                rig = synthetic.demo_rig().resized(640, 480, 640, 512)
                rng = np.random.default_rng([seed, offset])
                angle = rng.uniform(0, 2 * np.pi)
                wrong = turned(
                    rig, offset * np.cos(angle), offset * np.sin(angle), 0.1 * min(offset, 4)
                )
                street = synthetic.Street(rig, 2, seed=seed, night=night, sky_depth=300)
                frame = street.frame(1)
                warped, mask = xcalib.Registrar(wrong).register(frame.source, frame.depth)
                flow, confidence = patch_flow(frame.reference, warped, mask == 0)
                truth = true_flow(wrong, rig, frame.depth)
                tally.add(flow, confidence, truth, (mask == 0) & ~street.occluded(1))
            tally.report(f"rendered {'night' if night else 'day'}, about {offset} px off")


def shifted_pairs(count: int) -> None:
    folder = data("roadscene")
    if folder is None:
        return
    names = sorted(p.name for p in (folder / "visible").iterdir())[:: max(1, 221 // count)]
    unshifted = {}
    for offset in (0, 4, 12):
        against_truth, against_own = Tally(), Tally()
        for i, name in enumerate(names):
            visible = gray(cv2.imread(str(folder / "visible" / name)))
            thermal = gray(cv2.imread(str(folder / "thermal" / name), cv2.IMREAD_UNCHANGED))
            angle = 2.4 * i  # all directions
            dx, dy = offset * np.cos(angle), offset * np.sin(angle)
            size = thermal.shape[::-1]
            move = np.float32([[1, 0, dx], [0, 1, dy]])
            warped = cv2.warpAffine(thermal, move, size)
            mask = cv2.warpAffine(np.ones_like(thermal), move, size) > 0.999
            flow, confidence = patch_flow(visible, warped, mask)
            shift = np.float32([dx, dy])
            against_truth.add(flow, confidence, np.broadcast_to(shift, flow.shape), mask)
            # A shift does not change the pair's own misalignment.
            own, sure = unshifted.setdefault(name, (flow, confidence))
            against_own.add(flow, confidence, own + shift, mask & (sure >= CONFIDENT))
        label = f"aligned real pairs ({len(names)}), shifted by {offset} px"
        against_truth.report(label)
        if offset:
            against_own.report(f"{label}, against the flow of the pair as it is")


def night_rig() -> None:
    night = NightRig.open()
    if night is None:
        return

    views = list(night.views(night.fit(night.filled).rig, night.filled))
    lengths, patches, shares, both = [], [], [], []
    for view in views:
        flow, confidence = patch_flow(view.reference, view.registered, view.inside)
        confident = (confidence >= CONFIDENT) & (view.inside > 0)
        lengths.append(np.linalg.norm(flow, axis=-1)[confident])
        shares.append(confident.sum() / view.inside.sum())
        residual = metrics.patch_residual(view.reference, view.registered, view.mask)
        patches.append(residual.norms)
        for (x, y), shift in zip(
            residual.centers.round().astype(int), residual.shifts, strict=True
        ):
            if confident[y, x]:
                both.append(np.linalg.norm(flow[y, x] - shift))
    length, patch = np.concatenate(lengths), np.concatenate(patches)
    label = f"night rig, {len(views)} held-out frames"
    figure(f"{label}: flow, median", np.median(length), "px")
    figure(f"{label}: flow under 2 px", 100 * np.mean(length < 2), "%")
    figure(f"{label}: confident pixels", 100 * np.mean(shares), "%")
    figure(f"{label}: patch residual, median, {len(patch)} patches", np.median(patch), "px")
    figure(f"{label}: patch residual under 2 px", 100 * np.mean(patch < 2), "%")
    figure(f"{label}: the two differ by, median of {len(both)}", np.median(both), "px")


def speed() -> None:
    rng = np.random.default_rng(0)
    image = cv2.GaussianBlur(rng.random(SIZE[::-1], dtype=np.float32), (0, 0), 2)
    seconds = []
    for _ in range(15):
        start = time.process_time()
        patch_flow(image, image, num_threads=1)
        seconds.append(time.process_time() - start)
    spread(f"{SIZE[0]}x{SIZE[1]}: processor time", 1e3 * np.array(seconds), "ms")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=6, help="rendered streets for each offset")
    parser.add_argument("--pairs", type=int, default=44, help="aligned real pairs")
    parser.add_argument("--no-night", action="store_true", help="leave out the night rig (20 s)")
    args = parser.parse_args()
    print(machine())
    speed()
    rendered(args.seeds)
    shifted_pairs(args.pairs)
    if not args.no_night:
        night_rig()


if __name__ == "__main__":
    main()
