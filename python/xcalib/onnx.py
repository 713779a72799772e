"""Networks in ONNX files: opened, read for what their graphs say, and run.

Nothing but the graph and its weights is taken from a model's folder: no library of custom
operators is ever registered and no script is ever run. Nothing leaves the machine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .frames import InputError
from .onnx_messages import OPENING, RUNNING, in_words

Array = NDArray[Any]

TYPES: dict[str, type[np.generic]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(uint8)": np.uint8,
}
"""Element types of tensors that can be fed and read."""


@dataclass(frozen=True)
class Tensor:
    """One input or output of a graph."""

    name: str
    shape: tuple[int | None, ...]
    """None where the size is dynamic."""
    type: str
    """As ONNX Runtime names it: ``tensor(float)``."""

    def __str__(self) -> str:
        return f"{self.name} ({', '.join(str(side or '?') for side in self.shape)}) {self.type}"


def available_providers() -> dict[str, str]:
    """Execution providers of this ONNX Runtime by their short names: ``cpu``, ``cuda``, ..."""
    import onnxruntime  # type: ignore[import-untyped]  # takes a while: only when it is needed

    names = onnxruntime.get_available_providers()
    # Azure's provider sends its inputs to a service.
    return {
        name.removesuffix("ExecutionProvider").lower(): name
        for name in names
        if not name.startswith("Azure")
    }


class Network:
    """An ONNX graph, ready to run.

    Parameters
    ----------
    path
        The .onnx file; weights in other files (external data) are found beside it.
    providers
        Short names of execution providers, the preferred first; a string names them with commas
        between, ``"cuda,cpu"``.
    num_threads
        0 means all cores.

    Raises
    ------
    InputError
        No such file, not an ONNX graph, weights missing, custom operators, or a provider that is
        not there.
    """

    def __init__(
        self, path: str | Path, providers: str | Sequence[str] = "cpu", num_threads: int = 0
    ) -> None:
        import onnxruntime

        self.path = Path(path)
        if not self.path.is_file():
            raise InputError(f"{path}: no such file")
        if isinstance(providers, str):
            providers = [name.strip() for name in providers.split(",")]
        known = available_providers()
        for provider in providers:
            if provider.lower() not in known:
                raise InputError(
                    f"provider {provider!r} is not available, expected {', '.join(known)}"
                )
        wanted = [known[provider.lower()] for provider in providers]
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = num_threads
        options.log_severity_level = 4  # what goes wrong is raised: no second text on stderr
        try:
            self._session = onnxruntime.InferenceSession(str(path), options, providers=wanted)
        except Exception as error:  # its exceptions have no common base
            raise InputError(f"{path}: {in_words(str(error), OPENING)}") from None
        # ONNX Runtime falls back to the CPU in silence where a driver is missing.
        lost = set(wanted) - set(self._session.get_providers())
        if lost:
            raise InputError(f"provider {', '.join(lost)} cannot be started: is its driver here?")
        self.inputs = [_tensor(node) for node in self._session.get_inputs()]
        self.outputs = [_tensor(node) for node in self._session.get_outputs()]

    def run(self, feeds: Mapping[str, Array], outputs: Sequence[str]) -> list[NDArray[np.float32]]:
        """Values of the named outputs as float32.

        Raises
        ------
        InputError
            The graph refuses these inputs; sizes it was not made for are the usual cause.
        """
        try:
            values = self._session.run(list(outputs), dict(feeds))
        except Exception as error:
            shapes = ", ".join(f"{name} {value.shape}" for name, value in feeds.items())
            raise InputError(
                f"{self.path}: cannot run on {shapes}: {in_words(str(error), RUNNING)}"
            ) from None
        return [np.asarray(value, np.float32) for value in values]

    def output(self, which: str | int) -> Tensor:
        """The output of this name or index."""
        names = [output.name for output in self.outputs]
        if isinstance(which, int) and 0 <= which < len(names):
            return self.outputs[which]
        if which in names:
            return self.outputs[names.index(str(which))]
        raise InputError(f"{self.path}: no output {which!r}, expected one of {', '.join(names)}")


def open_network(
    path: str | Path, providers: str | Sequence[str] = "cpu", num_threads: int = 0
) -> Network:
    """A `Network` that a process opens once, however many drives use it."""
    if not Path(path).is_file():
        raise InputError(f"{path}: no such file")
    about = Path(path).stat()
    names = providers if isinstance(providers, str) else ",".join(providers)
    mark = about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns
    return _opened(str(path), mark, names, num_threads)


@lru_cache(maxsize=2)
def _opened(path: str, mark: tuple[int, ...], providers: str, num_threads: int) -> Network:
    return Network(path, providers, num_threads)


@dataclass(frozen=True)
class ImageInput:
    """How the only input of a graph takes images."""

    name: str
    dtype: type[np.generic]
    channels: int
    """1 or 3."""
    channels_first: bool
    views: bool
    """Whether the shape is (batch, views, channels, height, width)."""
    batch: int | None
    """Fixed batch size, None where dynamic."""
    height: int | None
    width: int | None
    """Fixed size [px], None where dynamic."""

    @staticmethod
    def of(network: Network) -> ImageInput:
        """Read it from the graph; `InputError` if this is no graph of one image."""
        described = "; ".join(map(str, network.inputs))
        expected = (
            "expected one image input (batch, 3, height, width) or (batch, height, width, 3)"
            " of float32, float16 or uint8"
        )
        if len(network.inputs) != 1:
            raise InputError(
                f"{network.path}: has {len(network.inputs)} inputs: {described}; {expected}"
            )
        tensor = network.inputs[0]
        shape, views = tensor.shape, len(tensor.shape) == 5
        if views:
            if shape[1] not in (1, None):
                raise InputError(f"{network.path}: takes {shape[1]} views: {described}; {expected}")
            shape = (shape[0], *shape[2:])
        if len(shape) != 4 or tensor.type not in TYPES:
            raise InputError(f"{network.path}: input is {described}; {expected}")
        first = shape[1] in (1, 3) or (shape[1] is None and shape[3] not in (1, 3))
        batch, channels, height, width = shape if first else (shape[0], shape[3], *shape[1:3])
        if channels not in (1, 3, None):
            raise InputError(f"{network.path}: input is {described}; {expected}")
        return ImageInput(
            tensor.name, TYPES[tensor.type], channels or 3, first, views, batch, height, width
        )

    def pack(self, images: Sequence[NDArray[np.float32]]) -> dict[str, Array]:
        """Feeds for `Network.run` from images ``(height, width, channels)`` of one size.

        For a graph of uint8 the values are rounded and clipped to [0, 255].
        """
        batch = np.stack(images)
        if self.channels_first:
            batch = batch.transpose(0, 3, 1, 2)
        if self.views:
            batch = batch[:, None]
        if self.dtype is np.uint8:
            batch = np.rint(batch).clip(0, 255)
        return {self.name: np.ascontiguousarray(batch.astype(self.dtype))}


def _tensor(node: Any) -> Tensor:
    shape = tuple(side if isinstance(side, int) and side > 0 else None for side in node.shape)
    return Tensor(node.name, shape, node.type)
