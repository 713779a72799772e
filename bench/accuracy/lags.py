"""Whether lags of whole frames are found, and none where there is none.

Rendered drives of 26 frames, each with another rig: standing while traffic passes (static),
straight ahead at a steady speed, the same with a gentle sway (steady) or with vibration (bumpy), at
0.12 m a frame (slow), and with a speed that varies (uneven). The source is 0, 1 and 2 frames late.
The thresholds of `footage/lags.cpp` were set on seeds 0 and 1.
"""

import argparse
import time

import numpy as np
from common import machine
from figures import figure

import xcalib
from xcalib import synthetic
from xcalib.synthetic.rigs import rotation_z, turned_towards

KINDS = ("static", "straight", "steady", "bumpy", "slow", "uneven")
FRAMES, FIRST, AROUND = 26, 5, 3


class Drive(synthetic.Street):
    """A drive of one of `KINDS`."""

    def __init__(self, rig, kind, seed):
        random = np.random.default_rng(seed + 1000)
        speed = float(random.uniform(0.3, 0.9))
        speed = {"static": 0.3, "slow": 0.12}.get(kind, speed)
        super().__init__(rig, num_frames=FRAMES, seed=seed, speed=speed)
        self.kind, self.phase = kind, random.uniform(0, 6.28, 6)
        self.jitter = random.standard_normal((FRAMES, 3))
        if kind == "static":
            self.speed = 0.0  # the traffic goes on

    def pose(self, index):
        way = 3.0 if self.kind == "static" else index * self.speed
        yaw, pitch, roll = 0.0, -0.02, 0.0
        phase = self.phase
        if self.kind in ("steady", "slow"):
            yaw = 0.01 * np.sin(index / 9 + phase[0])
            pitch += 0.003 * np.sin(index / 5 + phase[1])
            roll = 0.003 * np.sin(index / 7 + phase[2])
        elif self.kind == "uneven":
            way += 2.4 * self.speed * np.sin(index / 4 + phase[0])
            yaw = 0.03 * np.sin(index / 6 + phase[1])
            pitch += 0.006 * np.sin(index * 0.9 + phase[2])
            roll = 0.005 * np.sin(index / 3 + phase[3])
        elif self.kind == "bumpy":
            x, y, z = self.jitter[index]
            yaw = 0.01 * np.sin(index / 9 + phase[0]) + 0.001 * x
            pitch, roll = pitch + 0.003 * y, 0.001 * z
        forward = np.array([np.sin(yaw), np.sin(pitch), 1.0])
        R = rotation_z(roll) @ turned_towards(forward).T
        return R, -R @ np.array([1.6, -1.45, way])


def rig_of(seed):
    return synthetic.random_rig(
        seed=seed,
        **{"max_offset": 0.15, "hfov_deg": (40, 65), "fov_ratio": (0.7, 1.2), "max_baseline": 0.2},
        **{"width": 288, "height": 216, "source_width": 288, "source_height": 230},
    )


def frames_of(kind, seed):
    """References, sources and depths of a drive."""
    drive = Drive(rig_of(seed), kind, seed)
    frames = [drive.frame(index) for index in range(FRAMES)]
    return tuple([getattr(f, n) for f in frames] for n in ("reference", "source", "depth"))


def look(footage, late, threads):
    """The lag report of footage whose source is late, and the share of time that it takes."""
    references, sources, depths = footage
    used = list(range(FIRST, FRAMES - AROUND))

    def at(lag, frames):
        partners = [i + lag - late for i in frames]
        return [sources[i] if 0 <= i < FRAMES else None for i in partners]

    options = xcalib.CalibrationOptions(num_threads=threads)
    start = time.process_time()
    images = [references[i] for i in used], at(0, used), [depths[i] for i in used]
    result = xcalib.calibrate(*images, None, options)
    middle = time.process_time()
    few = used[::2][:12]
    report = xcalib.fit_lags(
        *([images[i] for i in few] for images in (references, depths)),
        {lag: at(lag, few) for lag in range(-AROUND, AROUND + 1)},
        *(result.rig, options),
    )
    return result, report, (time.process_time() - middle) / (middle - start)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=10, help="seed")
    parser.add_argument("--drives", type=int, default=2, help="of each kind")
    parser.add_argument("--threads", type=int, default=0)
    arguments = parser.parse_args()
    print(machine())
    for kind in KINDS:
        counts = dict.fromkeys(("right", "missed", "other"), 0)
        alarms, shares = 0, []
        for seed in range(arguments.first, arguments.first + arguments.drives):
            footage = frames_of(kind, seed)
            for late in (0, 1, 2):
                result, report, share = look(footage, late, arguments.threads)
                shares.append(share)
                if late == 0:
                    alarms += bool(report.frames or report.change)
                else:
                    found = report.frames == late
                    counts["right" if found else "other" if report.frames else "missed"] += 1
                tail = f"converged {result.converged}, t_z {result.rig.t[2]:+.2f} m"
                print(f"{kind} {seed}, {late} late: {report.line()}; {tail}", flush=True)
        figure(f"{kind}: lags of 1 and 2 found, of {2 * arguments.drives}", counts["right"])
        figure(f"{kind}: lags missed", counts["missed"])
        figure(f"{kind}: another lag found", counts["other"])
        figure(f"{kind}: false alarms, of {arguments.drives}", alarms)
        figure(f"{kind}: time beside the calibration's, mean", 100 * np.mean(shares), "%")


if __name__ == "__main__":
    main()
