"""Depth from a monocular network in an ONNX file."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from .._core import RelativeDepth
from ..cache import ResultCache, file_hash
from ..frames import Image, InputError, Size, same_aspect, size_of
from ..onnx import ImageInput, open_network
from .provider import Depth, DepthProvider, reciprocal
from .recipes import Recipe, find_recipe

Array = NDArray[np.float32]

MEAN_COLOUR = (0.485, 0.456, 0.406)
"""Fills what a letterboxed image leaves free: the mean of ImageNet, 0 after normalization."""
FAR, NEAR = 80.0, 2.0
"""Where `normalization` puts the far and the near end of relative depth [m], for want of better."""
FARTHEST = 1e4
"""What relative depth says lies beyond infinity is as far as this [m]."""
STEP = 0.1
"""Depths that differ by more than this share belong to two surfaces: nothing lies between them."""

_INTERPOLATION = {
    "linear": cv2.INTER_LINEAR,
    "cubic": cv2.INTER_CUBIC,
    "area": cv2.INTER_AREA,
}


@dataclass(frozen=True)
class NetworkOptions:
    """How to run a depth network: the options of the command line."""

    recipe: str | None = None
    """Name of the recipe, where no file beside the model names one."""
    focal: float | None = None
    """Focal length of the reference camera at its images' size [px], > 0, if known."""
    scale: float | None = None
    shift: float | None = None
    """In place of the recipe's, see `Recipe.kind`."""
    providers: str | Sequence[str] = "cpu"
    """See `xcalib.onnx.Network`."""
    num_threads: int = 0
    """0 means all cores."""
    cache: Path | None = None
    """Cache folder; None is the user's."""


@dataclass(frozen=True)
class _Raw:
    """The network's output for one image, without the border of a letterbox."""

    values: Array
    focal: float
    """Estimated focal length [px at the size the network saw], NaN where it estimates none."""
    width: float
    """Width the image had there [px]."""


class NetworkDepth(DepthProvider):
    """Monocular depth of reference images.

    Results are kept in the user's cache, by the hash of model, recipe and image.

    Parameters
    ----------
    model
        The .onnx file.
    options
        How to run it.

    Raises
    ------
    InputError
        A graph, a recipe or an option that does not fit.
    """

    def __init__(self, model: str | Path, options: NetworkOptions | None = None) -> None:
        options = options or NetworkOptions()
        self.path = Path(model)
        if not self.path.is_file():
            raise InputError(f"depth {model}: no such file")
        self.name, recipe = find_recipe(self.path, options.recipe)
        if options.scale is not None:
            recipe = dataclasses.replace(recipe, scale=options.scale)
        if options.shift is not None:
            recipe = dataclasses.replace(recipe, shift=options.shift)
        self.recipe = recipe
        self.relative_depth: RelativeDepth | None = None
        """Scale and shift of relative depth, of a rig; None guesses them for every frame."""
        self.focal = options.focal
        if self.focal is not None and not 0 < self.focal < math.inf:
            raise InputError(f"depth focal length is {self.focal:g}, expected above 0 px")
        if recipe.canonical_focal is not None and self.focal is None:
            raise InputError(
                f"{model}: depth of recipe {self.name} scales with the focal length of the"
                " reference camera, expected --depth-focal PX (translations scale with it,"
                " registered images do not depend on it)"
            )
        self.network = open_network(self.path, options.providers, options.num_threads)
        self.input = ImageInput.of(self.network)
        output = self.network.output(recipe.output)
        self._outputs = [output.name]
        if recipe.focal_output is not None:
            self._outputs.append(self.network.output(recipe.focal_output).name)
        self._cache = ResultCache("depth", options.cache)
        self._model_hash = _model_hash(self.path)

    def __call__(self, index: int, reference: Image) -> Depth:
        return self.batch([reference])[0]

    def batch(self, references: Sequence[Image]) -> list[Depth]:
        """Depth of several images ``(h, w)`` [m], 0 unknown; run at once if the graph lets it."""
        return [
            self._depth(raw, size_of(reference))
            for raw, reference in zip(self._raws(references), references, strict=True)
        ]

    def raw(self, index: int, reference: Image) -> Array:
        """The network's own output ``(h, w)`` float32 on its own grid, in its own unit.

        The grid covers the whole reference image; its aspect need not be that of the image. See
        `to_aspect`.
        """
        return self._raws([reference])[0].values

    # -- Relative depth --------------------------------------------------------------------------

    @property
    def relative(self) -> NetworkDepth | None:
        """Itself, where the output is inverse depth up to a scale and a shift not given."""
        is_relative = self.recipe.kind == "relative" and self.recipe.scale is None
        return self if is_relative else None

    def pooled(self, references: Iterable[Image]) -> RelativeDepth:
        """One `normalization` for all these images: where a calibration starts."""
        maps = [np.empty(0, np.float32)]  # there may be no image that can be read
        for reference in references:
            values = self._raws([reference])[0].values
            maps.append(values[np.isfinite(values)])
        return normalization(np.concatenate(maps))

    def files_of(self, index: int) -> list[Path]:
        """The model, and the recipe beside it."""
        beside = self.path.with_suffix(".yaml")
        return [self.path, beside] if beside.is_file() else [self.path]

    # -- Running ---------------------------------------------------------------------------------

    def _raws(self, references: Sequence[Image]) -> list[_Raw]:
        keys = [self._key(reference) for reference in references]
        found = [self._load(key) for key in keys]
        missing = [index for index, raw in enumerate(found) if raw is None]
        computed = self._run([references[index] for index in missing])
        for index, raw in zip(missing, computed, strict=True):
            camera = np.array([raw.focal, raw.width])
            self._cache.store(keys[index], {"values": raw.values, "camera": camera})
            found[index] = raw
        return [raw for raw in found if raw is not None]

    def _run(self, references: Sequence[Image]) -> list[_Raw]:
        """Run images in groups of one size, as large as the graph takes."""
        raws: list[_Raw] = []
        while len(raws) < len(references):
            first = references[len(raws)]
            group = [first]
            for other in references[len(raws) + 1 :]:
                full = self.input.batch is not None and len(group) == self.input.batch
                if full or other.shape[:2] != first.shape[:2]:
                    break
                group.append(other)
            raws += self._run_group(group)
        return raws

    def _run_group(self, references: Sequence[Image]) -> list[_Raw]:
        canvas, inner = self._sizes(size_of(references[0]))
        images = [self._prepare(reference, canvas, inner) for reference in references]
        # A fixed batch is filled up; the copies' results are dropped.
        images += [images[-1]] * ((self.input.batch or 0) - len(images))
        results = self.network.run(self.input.pack(images), self._outputs)
        raws = []
        for index in range(len(references)):
            maps = results[0]
            if maps.ndim < 3 or len(maps) != len(images):
                raise InputError(
                    f"{self.path}: output {self._outputs[0]} has shape {maps.shape},"
                    f" expected one map for each of {len(images)} images"
                )
            values = np.squeeze(maps[index])
            if values.ndim != 2 or min(values.shape) < 2:
                raise InputError(
                    f"{self.path}: output {self._outputs[0]} has shape {maps.shape},"
                    " expected one channel (batch, height, width)"
                )
            focal = math.nan
            if len(results) == 2:
                focal = float(results[1].reshape(len(images), -1)[index, 0])
            values = np.ascontiguousarray(_inside(values, canvas, inner))
            raws.append(_Raw(values, focal, float(inner[0])))
        return raws

    def _sizes(self, image: Size) -> tuple[Size, Size]:
        """Width and height of what is fed, and of the image in it."""
        recipe = self.recipe
        height, width = (
            recipe.size if isinstance(recipe.size, tuple) else (recipe.size, recipe.size)
        )
        if recipe.resize in ("shorter", "longer"):
            shorter = recipe.resize == "shorter"
            scale = (max if shorter else min)(width / image[0], height / image[1])
            width, height = (
                _rounded(scale * side, recipe.multiple, bound, shorter)
                for side, bound in zip(image, (width, height), strict=True)
            )
        canvas = self.input.width or width, self.input.height or height
        if recipe.resize != "letterbox":
            return canvas, canvas
        scale = min(canvas[0] / image[0], canvas[1] / image[1])
        return canvas, (max(1, int(scale * image[0])), max(1, int(scale * image[1])))

    def _prepare(self, image: Image, canvas: Size, inner: Size) -> Array:
        """The image as the graph wants it: ``(height, width, channels)``."""
        recipe = self.recipe
        if image.dtype != np.float32:
            image = image.astype(np.float32) / np.float32(np.iinfo(image.dtype).max)
        if self.input.channels == 1:
            values = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
        elif image.ndim == 2:
            values = cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
        else:
            values = image[..., ::-1] if recipe.colour == "rgb" else image
        values = cv2.resize(
            np.ascontiguousarray(values), inner, interpolation=_INTERPOLATION[recipe.interpolation]
        ).reshape(inner[1], inner[0], self.input.channels)
        if inner != canvas:
            left, top = _margins(canvas, inner)
            full = np.empty((canvas[1], canvas[0], self.input.channels), np.float32)
            full[:] = self._per_channel(MEAN_COLOUR[:: 1 if recipe.colour == "rgb" else -1])
            full[top : top + inner[1], left : left + inner[0]] = values
            values = full
        if self.input.dtype is np.uint8:
            return np.asarray(values * np.float32(255), np.float32)
        mean, std = self._per_channel(recipe.mean), self._per_channel(recipe.std)
        return np.asarray((values * np.float32(recipe.value_range) - mean) / std, np.float32)

    def _per_channel(self, values: tuple[float, ...]) -> Array:
        """Three values, or their mean for a graph of one channel."""
        each = np.asarray(values, np.float32)
        return each if self.input.channels == 3 else each.mean(keepdims=True)

    # -- Reading the output ----------------------------------------------------------------------

    def _depth(self, raw: _Raw, size: Size) -> Depth:
        recipe = self.recipe
        depth = to_depth(raw.values, recipe, self.relative_depth)
        seen = math.nan if recipe.focal_output is None else raw.focal
        seen = recipe.canonical_focal or seen
        if self.focal is not None and not math.isnan(seen):
            depth = depth * np.float32(self.focal * raw.width / size[0] / seen)
        return to_aspect(limited(depth, recipe), size)

    # -- Cache -----------------------------------------------------------------------------------

    def _key(self, image: Image) -> str:
        """Hash of everything that the network's own output depends on."""
        fields = dataclasses.asdict(self.recipe)
        for read_later in ("kind", "scale", "shift", "canonical_focal", "min_depth", "max_depth"):
            del fields[read_later]
        what = [1, self._model_hash, fields, image.shape, str(image.dtype)]
        key = hashlib.sha256(json.dumps(what, sort_keys=True).encode())
        key.update(np.ascontiguousarray(image).data)
        return key.hexdigest()

    def _load(self, key: str) -> _Raw | None:
        entry = self._cache.load(key)
        if entry is None or entry.keys() != {"values", "camera"}:
            return None
        values, camera = entry["values"], entry["camera"]
        if values.ndim != 2 or values.dtype != np.float32 or not values.size:
            return None
        if camera.shape != (2,) or camera.dtype != np.float64:
            return None
        focal, width = camera.tolist()
        return _Raw(values, focal, width)


def to_depth(values: Array, recipe: Recipe, relative: RelativeDepth | None = None) -> Depth:
    """Depth ``(h, w)`` [m] that a network's own output means; what is not a number stays so.

    Infinity is farther than any depth. ``relative`` is for kind ``relative`` without a scale; None
    is this map's own `normalization`.
    """
    if recipe.kind == "metric":
        return values * np.float32(1 if recipe.scale is None else recipe.scale)
    if recipe.kind == "relative" and recipe.scale is None:
        relative = relative or normalization(values)
        inverse = np.float32(relative.scale) * values + np.float32(relative.shift)
        return np.asarray(1 / np.maximum(inverse, np.float32(1 / FARTHEST)), np.float32)
    scale = 1 if recipe.scale is None else recipe.scale
    inverse = np.float32(scale) * values + np.float32(recipe.shift or 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(inverse > 0, 1 / inverse, np.where(np.isnan(inverse), np.nan, np.inf))


def normalization(values: Array) -> RelativeDepth:
    """Scale a and shift b that put relative inverse depth r at ``1 / (a r + b)`` metres.

    The 2nd percentile becomes `FAR`, the 98th `NEAR`: a guess without metric scale.
    """
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, (2, 98)) if known.size else (0.0, 0.0)
    scale = (1 / NEAR - 1 / FAR) / max(float(high - low), 1e-6)
    return RelativeDepth(scale, 1 / FAR - scale * float(low))


def limited(depth: Depth, recipe: Recipe) -> Depth:
    """Depth with 0 where it is unknown or nearer than allowed, and the largest depth beyond it."""
    far = math.inf if recipe.max_depth is None else recipe.max_depth
    depth = np.minimum(depth, np.float32(far))
    known = np.isfinite(depth) & (depth > 0) & (depth >= recipe.min_depth)
    return np.where(known, depth, 0).astype(np.float32)


def to_aspect(depth: Depth, reference: Size) -> Depth:
    """A depth map that covers the reference image, resampled to square pixels if it has none.

    By inverse depth between pixels of one surface; at steps and beside unknown pixels the nearest
    one counts.
    """
    width, height = size_of(depth)
    if same_aspect((width, height), reference):
        return depth
    size = width, max(1, round(width * reference[1] / reference[0]))
    known = (depth > 0).astype(np.float32)
    inverse = reciprocal(depth)
    nearest = cv2.resize(inverse, size, interpolation=cv2.INTER_NEAREST_EXACT)
    between = cv2.resize(inverse, size, interpolation=cv2.INTER_LINEAR)
    alone = cv2.resize(known, size, interpolation=cv2.INTER_LINEAR) < 1
    inverse = np.where(alone | (np.abs(between - nearest) > STEP * nearest), nearest, between)
    return reciprocal(inverse)


def _rounded(side: float, multiple: int, bound: int, at_least: bool) -> int:
    """The multiple nearest to ``side`` that is at least, or at most, ``bound`` if there is one."""
    near = round(side / multiple) * multiple
    if at_least and near < bound:
        near = math.ceil(side / multiple) * multiple
    if not at_least and near > bound:
        near = math.floor(side / multiple) * multiple
    return max(near, multiple)


def _margins(canvas: Size, inner: Size) -> Size:
    """Left and top border of a letterboxed image [px]."""
    return (canvas[0] - inner[0]) // 2, (canvas[1] - inner[1]) // 2


def _inside(values: Array, canvas: Size, inner: Size) -> Array:
    """The part of an output that the image itself covers; the output may be coarser."""
    (left, top), (width, height) = _margins(canvas, inner), size_of(values)
    x0, x1 = (round(x * width / canvas[0]) for x in (left, left + inner[0]))
    y0, y1 = (round(y * height / canvas[1]) for y in (top, top + inner[1]))
    return values[y0:y1, x0:x1]


def _model_hash(model: Path) -> str:
    """Hash of a model with the weights that lie in other files.

    ONNX names these in entries with the key "location": field 1 of a key-value pair, then field 2.
    """
    data = model.read_bytes()
    key = hashlib.sha256(data)
    entries = re.findall(rb"\x0a\x08location\x12(.)([^\x00-\x1f]{1,127})", data, re.DOTALL)
    names = {text[: length[0]].decode(errors="replace") for length, text in entries}
    for name in sorted(names):
        if (model.parent / name).is_file():
            key.update(file_hash(model.parent / name).encode())
    return key.hexdigest()
