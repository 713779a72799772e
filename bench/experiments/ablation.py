"""Each part of the method off in turn. Parts: `night`, `rendered`."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from judge import counted_map, gain, judge, patch_cells, systematic
from night import SIZE, NightRig
from rendered import NEAR, random_rigs
from results import Results

import xcalib
from xcalib import _core

NO_SEARCH = {"search": xcalib.SearchOptions(mode="off"), "flow": "off"}


@dataclass(frozen=True)
class Variant:
    """Fields of `CalibrationOptions`, and parts of the method that are off."""

    options: dict
    off: tuple[str, ...] = ()
    masked: bool = True  # occluded pixels are not judged

    def fit(self, calibrate: Callable, *where) -> xcalib.CalibrationResult:
        """By `NightRig.fit` or `Rendered.calibrate`."""
        parts = _core._Parts(**dict.fromkeys(self.off, False))
        options = xcalib.CalibrationOptions(**self.options)
        return calibrate(*where, options=options, how=partial(_core._calibrate, parts))


VARIANTS = {
    "as it is (flow off after a search)": Variant({}),
    "flow term on": Variant({"flow": "on"}),
    "image term off, flow on": Variant({"flow": "on"}, ("images",)),
    "prior off": Variant({"prior_weight": 0.0}),
    "search off, flow on": Variant({"search": xcalib.SearchOptions(mode="off"), "flow": "on"}),
    "search and flow off": Variant(NO_SEARCH),
    "pyramid off": Variant({}, ("pyramid",)),
    "stages off": Variant({}, ("stages",)),
    "soft floor off": Variant({}, ("floor",)),
    "weights c_i off": Variant({}, ("pair_weights",)),
    "photometric normalisation off": Variant({}, ("normalization",)),
    "pixels at depth edges kept": Variant({}, ("depth_edges",)),
    "occlusion mask off": Variant({}, masked=False),
}


def night_part(results: Results) -> None:
    night = NightRig.open()
    if night is None:
        return
    fit, held = night.fold(4)
    fit, held = results.of((fit, held), (fit[:3], held[:1]))
    rows = []
    for label, variant in results.in_time(list(VARIANTS.items())[: results.of(None, 1)]):
        start = time.perf_counter()
        result = variant.fit(night.fit, night.filled, fit)
        seconds = time.perf_counter() - start
        registrar = night.registrar(result.rig)
        judged = []
        for name in held:
            source = night.source(name)
            at, counts = counted_map(registrar, source, night.filled(name))
            mask = counts if variant.masked else None
            judged.append(judge(night.reference(name), source, at, mask))
        rows.append(
            [
                label,
                f"{gain(judged, 'NEC'):+.1%}",
                f"{gain(judged, 'GC'):+.0%}",
                *patch_cells(judged),
                f"{systematic([j.patches for j in judged], SIZE):.2f}",
                f"{result.rig.t[0]:+.3f}",
                "yes" if result.converged else "no",
                f"{seconds:.0f}",
            ]
        )
        print(rows[-1], flush=True)
    results.table(
        "night",
        ["", "NEC", "GC", "patch [px]", "< 2 px", "systematic [px]", "t_x [m]", "trusted", "s"],
        rows,
        f"The night rig, fitted on {len(fit)} frames, filled stereo depth, judged on {len(held)}"
        " others over each row's own pixels. Times on a shared machine: rough.",
    )


def rendered_part(results: Results) -> None:
    frames = 4
    variants = {k: v for k, v in VARIANTS.items() if v.masked}
    if results.quick:
        variants = dict(list(variants.items())[:1])
    errors = {label: {"any": [], "near": []} for label in variants}
    trusted = {label: {"any": [], "near": []} for label in variants}
    seconds = {label: [] for label in variants}
    count = results.of(15, 1)
    # In turns, so that there are as many of both kinds whenever time is up.
    turns = zip(*(random_rigs(count, frames, results.quick, **k) for k in ({}, NEAR)), strict=True)
    for scenes in results.in_time(turns):
        for name, scene in zip(("any", "near"), scenes, strict=True):
            for label, variant in variants.items():
                start = time.perf_counter()
                try:
                    result = variant.fit(scene.calibrate)
                    error, converged = scene.error(result.rig), result.converged
                except RuntimeError:  # nothing overlaps: as far from a rig as can be
                    error, converged = np.inf, False
                seconds[label].append(time.perf_counter() - start)
                errors[label][name].append(error)
                trusted[label][name].append(converged)
            print(name, *(f"{errors[k][name][-1]:.2f}" for k in variants), flush=True)
    rows = []
    for label in variants:
        near, far = (np.array(errors[label][name]) for name in ("near", "any"))
        every = np.concatenate([near, far])
        wrong = (every > 1) & np.array(trusted[label]["near"] + trusted[label]["any"])
        rows.append(
            [
                label,
                f"{np.sum(far < 1)} of {len(far)}",
                f"{np.sum(near < 1)} of {len(near)}",
                f"{np.median(every[every < 1]):.3f}" if (every < 1).any() else "-",
                f"{np.median(near):.3f}",
                f"{wrong.sum()}",
                f"{np.median(seconds[label]):.1f}",
            ]
        )
    results.table(
        "rendered",
        ["", "found, any rig", "found, near rig", "EPE of those found [px]", "EPE of all near [px]",
         "wrong but trusted", "s"],
        rows,
        f"{len(far) + len(near)} rendered rigs of 320x240, {frames} frames each, exact depth:"
        " half of any kind (`synthetic.random_rig`: ratio of fields of view 0.5-2, axes off by up"
        " to 30 % of the width), half near the start at 45 deg. Found: median end-point error under"
        " 1 px; the figures are medians over rigs. Times on a shared machine: rough.",
    )  # fmt: skip


def run(results: Results, part: str | None) -> None:
    if part in (None, "rendered"):
        rendered_part(results)
    if part in (None, "night"):
        night_part(results)
