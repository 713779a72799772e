"""Residual flow between a reference and a warped source of another modality.

A provider is called with the reference image, the source image warped to its pixels, and the mask
of where that is valid. It returns ``(flow, confidence)``: what reference pixel ``p`` shows is found
at ``p + flow[p]`` in the warped source; ``flow`` is ``(H, W, 2)`` float32 [px], x then y,
``confidence`` ``(H, W)`` float32 in [0, 1], 0 where the flow is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from ._core import FlowOptions, patch_flow
from .frames import Image, InputError, gray, size_of
from .onnx import Network
from .yaml_file import load_yaml

__all__ = ["Flow", "FlowOptions", "FlowProvider", "NetworkFlow", "PatchFlow", "patch_flow"]

Flow = NDArray[np.float32]


class FlowProvider(Protocol):
    """Flow from the reference to the warped source, and its confidence; shapes as above.

    ``reference`` and ``warped`` are ``(H, W)`` or ``(H, W, 3)`` of one size, uint8, uint16 or
    float32 in [0, 1]; ``valid`` is ``(H, W)``, nonzero where the warped source is valid.
    """

    def __call__(
        self, reference: Image, warped: Image, valid: NDArray[Any] | None
    ) -> tuple[Flow, Flow]: ...


@dataclass(frozen=True)
class PatchFlow:
    """The built-in flow: patches of edge maps, coarse to fine, without weights."""

    options: FlowOptions = field(default_factory=FlowOptions)
    num_threads: int = 0
    """0 uses every core."""

    def __call__(
        self, reference: Image, warped: Image, valid: NDArray[Any] | None
    ) -> tuple[Flow, Flow]:
        return patch_flow(reference, warped, valid, self.options, self.num_threads)


# -- Networks ------------------------------------------------------------------------------------

MULTIPLE = 8
"""Images are padded to multiples of this for networks of free size [px]."""


@dataclass(frozen=True)
class Preparation:
    """How a network wants its images; the keys of the YAML file beside it, all optional."""

    range: tuple[float, float] = (0.0, 255.0)
    """Values that black and white become, before mean and deviation."""
    mean: tuple[float, ...] = (0.0,)
    """Taken off each channel: one number, or one a channel (red, green, blue)."""
    std: tuple[float, ...] = (1.0,)
    """Each channel is divided by this: one number, or one a channel."""
    flow_from: int = 1
    """The input, 1 or 2, whose pixels the flow is given for; it leads to the other one."""

    @staticmethod
    def read(path: Path) -> Preparation:
        """Read the file; without one the defaults hold, which are RAFT's before its own scaling."""
        if not path.is_file():
            return Preparation()
        document = load_yaml(path, optional=[item.name for item in fields(Preparation)])
        values: dict[str, Any] = {}
        for key, value in document.items():
            if key == "flow_from":
                if value not in (1, 2) or isinstance(value, bool):
                    raise InputError(f"{path}: {key} is {value!r}, expected 1 or 2")
                values[key] = value
                continue
            numbers = value if isinstance(value, list) else [value]
            counts = (2,) if key == "range" else (1, 3)
            if len(numbers) not in counts or not all(_is_finite(number) for number in numbers):
                expected = "two numbers" if key == "range" else "one number or three"
                raise InputError(f"{path}: {key} is {value!r}, expected {expected}")
            values[key] = tuple(float(number) for number in numbers)
        if 0.0 in values.get("std", ()):
            raise InputError(f"{path}: std is {document['std']!r}, expected none that is 0")
        return Preparation(**values)


def _is_finite(value: object) -> bool:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    return is_number and math.isfinite(value)  # type: ignore[arg-type]


class NetworkFlow:
    """Flow by a network of two images, such as RAFT or CrossRAFT, in an ONNX file.

    The graph takes two float32 images ``(1, 1 or 3, H, W)``, colour as red, green, blue, of fixed
    or free size, and gives the flow from one to the other, ``(..., 2, H, W)`` [px]. Of several
    outputs of that size, a network's iterations, the last is taken. A side that the graph fixes is
    resized to; a free one is padded to a multiple of 8 px with its last row or column. Confidence
    is the agreement with the flow the other way, a second call.

    Parameters
    ----------
    model
        The ``.onnx`` file. A YAML file beside it, ``NAME.yaml`` for ``NAME.onnx``, may hold the
        fields of `Preparation`.
    tolerance
        Disagreement of the two directions at which confidence is 0 [px], > 0.
    num_threads
        0 uses every core.
    providers
        Short names of execution providers, the preferred first: ``"cuda,cpu"``.

    Raises
    ------
    InputError
        A file is not what it should be, or a provider is not there.
    """

    def __init__(
        self,
        model: str | Path,
        tolerance: float = 2.0,
        num_threads: int = 0,
        providers: str | Sequence[str] = "cpu",
    ) -> None:
        if not 0 < tolerance < np.inf:
            raise InputError(f"flow tolerance is {tolerance:g}, expected above 0 px")
        self.path = Path(model)
        self.tolerance = tolerance
        self.preparation = Preparation.read(self.path.with_suffix(".yaml"))
        self._network = Network(self.path, providers, num_threads)
        inputs = self._network.inputs
        if len(inputs) != 2:
            names = ", ".join(item.name for item in inputs)
            raise InputError(f"{self.path}: inputs are {names}; expected two images")
        self._inputs: list[tuple[str, int]] = []
        for item in inputs:
            batch, channels = (*item.shape, None, None)[:2]
            if (
                item.type != "tensor(float)"
                or len(item.shape) != 4
                or batch not in (1, None)
                or channels not in (1, 3)
            ):
                raise InputError(
                    f"{self.path}: input {item.name} is {item.type} {list(item.shape)},"
                    " expected tensor(float) [1, 1 or 3, H, W]"
                )
            self._inputs.append((item.name, channels))
        if inputs[0].shape[2:] != inputs[1].shape[2:]:
            raise InputError(
                f"{self.path}: inputs are {inputs[0].shape} and {inputs[1].shape},"
                " expected one size"
            )
        channels = min(channels for _, channels in self._inputs)
        if max(len(self.preparation.mean), len(self.preparation.std)) > channels:
            raise InputError(
                f"{self.path.with_suffix('.yaml')}: mean and std are for 3 channels,"
                f" the network has {channels}"
            )
        self._fixed = inputs[0].shape[3], inputs[0].shape[2]  # width and height, None where free

    def __call__(
        self, reference: Image, warped: Image, valid: NDArray[Any] | None
    ) -> tuple[Flow, Flow]:
        size = size_of(reference)
        for name, other in (("warped image", warped), ("mask", valid)):
            if other is not None and size_of(other) != size:
                raise InputError(
                    f"{name} is {other.shape[1]}x{other.shape[0]},"
                    f" expected the reference's {size[0]}x{size[1]}"
                )
        there, back = self._run(reference, warped), self._run(warped, reference)
        x, y = np.meshgrid(*(np.arange(side, dtype=np.float32) for side in size))
        at_x, at_y = x + there[..., 0], y + there[..., 1]
        inside = (at_x >= 0) & (at_y >= 0) & (at_x <= size[0] - 1) & (at_y <= size[1] - 1)
        # NaN is not inside; the places are cleaned because resampling takes numbers only.
        at_x, at_y = np.where(inside, at_x, 0), np.where(inside, at_y, 0)
        if valid is not None:
            known = (valid != 0).astype(np.float32)
            inside &= cv2.remap(known, at_x, at_y, cv2.INTER_LINEAR) > 0.999
        returned = cv2.remap(back, at_x, at_y, cv2.INTER_LINEAR)
        agreement = 1 - np.linalg.norm(there + returned, axis=-1) / self.tolerance
        confidence = np.where(inside, np.nan_to_num(agreement).clip(0, 1), 0)
        return np.nan_to_num(there, posinf=0, neginf=0), confidence.astype(np.float32)

    def _run(self, start: Image, end: Image) -> Flow:
        """Flow from one image to another, ``(H, W, 2)`` [px]."""
        images = (start, end) if self.preparation.flow_from == 1 else (end, start)
        width, height = size_of(start)
        inner = self._fixed[0] or width, self._fixed[1] or height
        feed = {
            name: self._tensor(image, channels, inner)
            for (name, channels), image in zip(self._inputs, images, strict=True)
        }
        padded = next(iter(feed.values())).shape[-2:]
        outputs = self._network.run(feed, [output.name for output in self._network.outputs])
        flows = [out for out in outputs if out.ndim >= 4 and out.shape[-3:] == (2, *padded)]
        if not flows:
            shapes = ", ".join(str(out.shape) for out in outputs)
            raise InputError(f"{self.path}: outputs are {shapes}, expected (1, 2, *{padded})")
        last = flows[-1].reshape(-1, 2, *padded)[-1, :, : inner[1], : inner[0]]
        if not np.isfinite(last).all(axis=0).any():
            raise InputError(
                f"{self.path}: its flow is not a number anywhere; expected other values of its"
                " images (`range`, `mean`, `std` in the .yaml file beside it), or an export in"
                " float32"
            )
        flow: Flow = np.ascontiguousarray(last.transpose(1, 2, 0), dtype=np.float32)
        if inner != (width, height):
            scale = np.array([width / inner[0], height / inner[1]], np.float32)
            flow = scale * cv2.resize(flow, (width, height), interpolation=cv2.INTER_LINEAR)
        return flow

    def _tensor(self, image: Image, channels: int, inner: tuple[int, int]) -> Flow:
        """The image as the graph takes it, ``(1, channels, H, W)``."""
        if channels == 1 or image.ndim == 2:
            planes = gray(image)[None]
        else:
            planes = np.stack([gray(image[..., k]) for k in (2, 1, 0)])  # red, green, blue
        smaller = inner[0] < planes.shape[2]
        how = cv2.INTER_AREA if smaller else cv2.INTER_LINEAR
        free = [
            0 if fixed else -side % MULTIPLE for fixed, side in zip(self._fixed, inner, strict=True)
        ]
        ready = [
            cv2.copyMakeBorder(
                cv2.resize(np.ascontiguousarray(plane), inner, interpolation=how),
                *(0, free[1], 0, free[0]),
                cv2.BORDER_REPLICATE,
            )
            for plane in planes
        ]
        low, high = self.preparation.range
        values = low + (high - low) * np.stack(ready)
        values = np.broadcast_to(values, (channels, *values.shape[1:]))
        mean, std = (
            np.reshape(numbers, (-1, 1, 1))
            for numbers in (self.preparation.mean, self.preparation.std)
        )
        return np.ascontiguousarray(((values - mean) / std)[None], dtype=np.float32)
