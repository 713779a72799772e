"""What a depth network expects and returns, which its graph does not contain.

Every shipped recipe names the page its facts come from. What could not be confirmed there is said
in docs/inputs_networks.md.
"""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..frames import InputError
from ..yaml_file import load_yaml

IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)


@dataclass(frozen=True)
class Recipe:
    """How to feed a depth network and how to read its output.

    Raises `InputError` for values outside the ranges named here.
    """

    kind: str
    """What the output is.

    - ``metric``: depth, ``D = scale r``; ``scale`` is 1 unless given.
    - ``inverse``: metric inverse depth, ``D = 1 / (scale r + shift)``; 1 and 0 unless given.
    - ``relative``: inverse depth up to scale and shift; without ``scale`` a normalization that has
      no metric scale, see `network.normalization`.
    - ``disparity``: ``D = 1 / (scale r + shift)``; ``scale`` = 1 / (focal length [px] baseline
      [m]) must be given.
    """
    output: str | int = 0
    """The output to read, by name or index."""
    resize: str = "shorter"
    """``shorter`` or ``longer``: that side becomes ``size``, the aspect is kept; ``stretch``: to
    ``size``; ``letterbox``: into ``size``, the rest filled with mean colour. Where the graph has a
    fixed size it is taken instead of ``size``, stretched to unless ``letterbox``."""
    size: int | tuple[int, int] = 518
    """Side, or height and width [px], >= 1."""
    multiple: int = 14
    """Both sides are rounded to a multiple of this [px], >= 1."""
    interpolation: str = "cubic"
    """``linear``, ``cubic`` or ``area``."""
    colour: str = "rgb"
    """Order of the channels, ``rgb`` or ``bgr``; a graph of one channel gets gray."""
    value_range: float = 1.0
    """Largest value of an image before mean and std, > 0. Graphs of uint8 get [0, 255] as it is."""
    mean: tuple[float, float, float] = (0.0, 0.0, 0.0)
    std: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Per channel, in units of ``value_range``, std > 0."""
    scale: float | None = None
    """See ``kind``, > 0."""
    shift: float | None = None
    """See ``kind``."""
    canonical_focal: float | None = None
    """The depths are those of a camera of this focal length, at the size the network sees [px],
    > 0: they are multiplied by the true one over this one, and the true one must be given."""
    focal_output: str | None = None
    """Output with the focal length that the network itself estimates [px at the size it sees], or
    with a camera matrix. If the true one is given, depths are multiplied by true over estimated."""
    min_depth: float = 0.0
    """Nearer than this is unknown [m], >= 0."""
    max_depth: float | None = None
    """Farther than this is taken for this [m], > ``min_depth``."""

    def __post_init__(self) -> None:
        sides = self.size if isinstance(self.size, tuple) else (self.size,)
        self._check("kind", self.kind in KINDS, f"one of {', '.join(KINDS)}")
        self._check("resize", self.resize in RESIZES, f"one of {', '.join(RESIZES)}")
        self._check("size", min(sides) >= 1, "at least 1 px")
        two = isinstance(self.size, tuple) and self.resize in ("shorter", "longer")
        self._check("size", not two, f"one number for resize {self.resize}")
        self._check("multiple", self.multiple >= 1, "at least 1 px")
        self._check(
            "interpolation",
            self.interpolation in INTERPOLATIONS,
            f"one of {', '.join(INTERPOLATIONS)}",
        )
        self._check("colour", self.colour in ("rgb", "bgr"), "rgb or bgr")
        self._check("mean", all(map(math.isfinite, self.mean)), "finite numbers")
        self._check("std", all(0 < s < math.inf for s in self.std), "numbers above 0")
        for name in ("value_range", "scale", "canonical_focal", "max_depth"):
            value = getattr(self, name)
            self._check(name, value is None or 0 < value < math.inf, "a number above 0")
        self._check("shift", self.shift is None or math.isfinite(self.shift), "a finite number")
        low, high = self.min_depth, math.inf if self.max_depth is None else self.max_depth
        self._check("min_depth", 0 <= low < high, "at least 0 m and below max_depth")
        self._check(
            "scale",
            self.kind != "disparity" or self.scale is not None,
            "a number: a disparity needs 1 / (focal length [px] * baseline [m])",
        )
        self._check(
            "shift", self.kind != "metric" or not self.shift, "none: metric depth has a scale only"
        )
        self._check(
            "shift",
            self.kind != "relative" or self.shift is None or self.scale is not None,
            "none without a scale",
        )

    def _check(self, name: str, good: bool, expected: str) -> None:
        if not good:
            raise InputError(f"recipe {name} is {getattr(self, name)!r}, expected {expected}")


KINDS = ("metric", "inverse", "relative", "disparity")
RESIZES = ("shorter", "longer", "stretch", "letterbox")
INTERPOLATIONS = ("linear", "cubic", "area")


@dataclass(frozen=True)
class Shipped:
    """A recipe with where its facts come from."""

    recipe: Recipe
    files: str
    """Regular expression on a file's name in lower case, letters and digits only."""
    licence: str
    source: str
    """Page of the project, or of the code the recipe was read from."""


_DEPTH_ANYTHING_V2 = "https://github.com/DepthAnything/Depth-Anything-V2"
_DEPTH_ANYTHING = Recipe("relative", mean=IMAGENET_MEAN, std=IMAGENET_STD)

RECIPES: dict[str, Shipped] = {
    # Indoor is trained on Hypersim to 20 m, outdoor on Virtual KITTI 2 to 80 m.
    "depth-anything-v2-metric-indoor": Shipped(
        dataclasses.replace(_DEPTH_ANYTHING, kind="metric", max_depth=20.0),
        "depthanythingv2.*(hypersim|indoor)",
        "code Apache-2.0; weights: Apache-2.0 (large), see the page for the others",
        f"{_DEPTH_ANYTHING_V2}/tree/main/metric_depth",
    ),
    "depth-anything-v2-metric-outdoor": Shipped(
        dataclasses.replace(_DEPTH_ANYTHING, kind="metric", max_depth=80.0),
        "depthanythingv2.*(vkitti|outdoor)",
        "code Apache-2.0; weights: Apache-2.0 (small), see the page for the others",
        f"{_DEPTH_ANYTHING_V2}/tree/main/metric_depth",
    ),
    "depth-anything-v2-relative": Shipped(
        _DEPTH_ANYTHING,
        "depthanythingv2(?!.*(metric|hypersim|vkitti|indoor|outdoor))",
        "code Apache-2.0; weights Apache-2.0 (small), CC-BY-NC-4.0 (base, large)",
        _DEPTH_ANYTHING_V2,
    ),
    # metric = focal output / 300, the focal length at the size the network sees; the longer side
    # is 504 px by default.
    "depth-anything-3-metric": Shipped(
        Recipe(
            "metric",
            resize="longer",
            size=504,
            mean=IMAGENET_MEAN,
            std=IMAGENET_STD,
            canonical_focal=300.0,
        ),
        "(depthanything(v)?3|da3).*metric",
        "Apache-2.0",
        "https://github.com/ByteDance-Seed/Depth-Anything-3",
    ),
    # Trained for 1536 x 1536, whatever the aspect.
    "depth-pro": Shipped(
        Recipe(
            "metric",
            output="predicted_depth",
            resize="stretch",
            size=(1536, 1536),
            multiple=1,
            interpolation="linear",
            mean=(0.5, 0.5, 0.5),
            std=(0.5, 0.5, 0.5),
            focal_output="focallength_px",
            max_depth=1e4,
        ),
        "depthpro",
        "apple-ascl",
        "https://github.com/apple/ml-depth-pro, https://huggingface.co/onnx-community/DepthPro-ONNX",
    ),
    # Outputs as its own export.py names them; out_K is the camera it estimates.
    "unidepth-v2": Shipped(
        Recipe(
            "metric",
            output="depth",
            resize="letterbox",
            size=(462, 616),
            interpolation="linear",
            mean=IMAGENET_MEAN,
            std=IMAGENET_STD,
            focal_output="out_K",
        ),
        "unidepthv?2",
        "CC-BY-NC-4.0",
        "https://github.com/lpiccinelli-eth/UniDepth",
    ),
    # The project's own export normalizes inside the graph.
    "metric3d-v2": Shipped(
        Recipe(
            "metric",
            resize="letterbox",
            size=(616, 1064),
            interpolation="linear",
            value_range=255.0,
            canonical_focal=1000.0,
            max_depth=300.0,
        ),
        "metric3d.*vit",
        "code BSD-2-Clause; weights: see the page",
        "https://github.com/YvanYin/Metric3D/tree/main/onnx",
    ),
    # The project's own ONNX files normalize inside the graph.
    "midas-v21": Shipped(
        Recipe("relative", resize="stretch", size=384, multiple=32),
        "midas(?!.*dpt).*(v?21|small)|modelf6b98070|modelsmall",
        "MIT",
        "https://github.com/isl-org/MiDaS/tree/master/tf",
    ),
    "midas-dpt": Shipped(
        Recipe("relative", size=384, multiple=32, mean=(0.5, 0.5, 0.5), std=(0.5, 0.5, 0.5)),
        "dpt(large|hybrid)|midas.*dpt",
        "MIT",
        "https://github.com/isl-org/MiDaS/blob/master/hubconf.py",
    ),
    # Sizes and normalization of the image processor of Hugging Face transformers, without its
    # padding by reflection.
    "zoedepth": Shipped(
        Recipe(
            "metric",
            size=384,
            multiple=32,
            interpolation="linear",
            mean=(0.5, 0.5, 0.5),
            std=(0.5, 0.5, 0.5),
        ),
        "zoe",
        "MIT",
        "https://github.com/isl-org/ZoeDepth, https://huggingface.co/Intel/zoedepth-nyu-kitti",
    ),
}


def find_recipe(model: Path, name: str | None = None) -> tuple[str, Recipe]:
    """The recipe of a model file, and its name.

    ``model.yaml`` beside ``model.onnx`` may name a recipe (``recipe: NAME``) and override its
    fields. Without a name there, ``name`` is taken, or else the recipe whose pattern the file's
    name matches.
    """
    path = model.with_suffix(".yaml")
    fields = read_recipe_fields(path) if path.is_file() else {}
    name = fields.pop("recipe", name)
    if name is None and "kind" not in fields:
        name = _by_file_name(model)
    if name is None:
        return path.name, _recipe(path, fields)
    if name not in RECIPES:
        raise InputError(f"depth recipe {name!r} is not known, expected {', '.join(RECIPES)}")
    base = RECIPES[name].recipe
    if not fields:
        return name, base
    values = {field.name: getattr(base, field.name) for field in dataclasses.fields(base)}
    return f"{name} with {path.name}", _recipe(path, values | fields)


def _recipe(path: Path, fields: Mapping[str, Any]) -> Recipe:
    try:
        return Recipe(**fields)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _by_file_name(model: Path) -> str:
    stem = re.sub(r"[^a-z0-9]", "", model.stem.lower())
    found = [name for name, shipped in RECIPES.items() if re.search(shipped.files, stem)]
    if len(found) != 1:
        what = f"matches {' and '.join(found)}" if found else "matches no depth recipe"
        raise InputError(
            f"{model}: its name {what}; expected --depth-recipe with one of {', '.join(RECIPES)},"
            f" or {model.with_suffix('.yaml').name} beside it"
        )
    return found[0]


# -- The YAML file beside a model ----------------------------------------------------------------


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError
    return float(value)


def _integer(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise TypeError
    return value


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError
    return value


def _triple(value: Any) -> tuple[float, float, float]:
    if not isinstance(value, list):
        raise TypeError
    first, second, third = map(_number, value)
    return first, second, third


def _size(value: Any) -> int | tuple[int, int]:
    if not isinstance(value, list):
        return _integer(value)
    height, width = map(_integer, value)
    return height, width


def _output(value: Any) -> str | int:
    return value if isinstance(value, str) else _integer(value)


_SCHEMA = {
    "recipe": (_text, "the name of a recipe"),
    "kind": (_text, "a word"),
    "output": (_output, "a name or an index"),
    "resize": (_text, "a word"),
    "size": (_size, "pixels, or [height, width]"),
    "multiple": (_integer, "pixels"),
    "interpolation": (_text, "a word"),
    "colour": (_text, "a word"),
    "value_range": (_number, "a number"),
    "mean": (_triple, "three numbers"),
    "std": (_triple, "three numbers"),
    "scale": (_number, "a number"),
    "shift": (_number, "a number"),
    "canonical_focal": (_number, "pixels"),
    "focal_output": (_text, "a name"),
    "min_depth": (_number, "metres"),
    "max_depth": (_number, "metres"),
}


def read_recipe_fields(path: Path) -> dict[str, Any]:
    """The fields in a recipe file, of the types `Recipe` has; ``recipe`` may be among them."""
    fields = {}
    for key, value in load_yaml(path, optional=_SCHEMA).items():
        convert, expected = _SCHEMA[key]
        try:
            fields[key] = convert(value)
        except (TypeError, ValueError):
            raise InputError(f"{path}: {key} is {value!r}, expected {expected}") from None
    return fields
