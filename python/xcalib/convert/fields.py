"""Values of a foreign file: every complaint names the file, the field, its value and what was
expected.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from .._core import InputError, Lens, Pinhole

Matrix = NDArray[np.float64]

MAX_SIDE = 2**16
"""Of an image [px]."""


class Fields:
    """A mapping in a file. What a format has beside the fields that are asked for is ignored."""

    def __init__(self, where: str, node: object, name: str = "") -> None:
        self.where = where
        self.name = name
        if not isinstance(node, dict):
            raise InputError(f"{where}: {name or 'the file'} is {short(node)}, expected fields")
        self.node: dict[Any, Any] = node

    def __contains__(self, key: object) -> bool:
        return self.node.get(key) is not None

    def get(self, key: Any) -> Any:
        """A value that must be there."""
        if key not in self:
            raise InputError(f"{self.where}: {self.path(key)} is missing")
        return self.node[key]

    def path(self, key: object) -> str:
        """A field as it is called in messages."""
        return f"{self.name}.{key}" if self.name else str(key)

    def fail(self, key: object, expected: str) -> NoReturn:
        """Refuse a value."""
        value = short(self.node.get(key))
        raise InputError(f"{self.where}: {self.path(key)} = {value}, expected {expected}")

    def fields(self, key: Any) -> Fields:
        """A mapping within this one."""
        return Fields(self.where, self.get(key), self.path(key))

    def text(self, key: Any) -> str:
        """A word."""
        if not isinstance(value := self.get(key), str):
            self.fail(key, "text")
        return value

    def number(self, key: Any) -> float:
        """A finite number."""
        if (value := number(self.get(key))) is None:
            self.fail(key, "a finite number")
        return value

    def size(self, key: Any) -> int:
        """A number of pixels."""
        value = self.number(key)
        if not (value.is_integer() and 1 <= value <= MAX_SIDE):
            self.fail(key, f"a whole number of px from 1 to {MAX_SIDE}")
        return int(value)

    def numbers(self, key: Any, counts: Collection[int] = ()) -> list[float]:
        """A list of finite numbers, as many as one of the counts; of any number without."""
        values = self.get(key)
        if isinstance(values, np.ndarray):
            values = values.ravel().tolist()
        found = [number(value) for value in values] if isinstance(values, list | tuple) else [None]
        if None in found:
            self.fail(key, "a list of finite numbers")
        if counts and len(found) not in counts:
            raise InputError(
                f"{self.where}: {self.path(key)} has {len(found)} numbers, expected"
                f" {' or '.join(map(str, counts))}"
            )
        return [value for value in found if value is not None]

    def fields_of_list(self, key: Any, names: Collection[str]) -> Fields:
        """A list of values that have names in other formats."""
        values = self.numbers(key, (len(names),))
        return Fields(self.where, dict(zip(names, values, strict=True)), self.path(key))

    def matrix(self, key: Any, rows: int, columns: int) -> Matrix:
        """A matrix as a list of rows, or all its numbers row by row."""
        values = self.get(key)
        try:
            array = np.array(values, np.float64)
        except (ValueError, TypeError):
            array = np.zeros(0)
        if array.size != rows * columns or not np.isfinite(array).all():
            self.fail(key, f"{rows}x{columns} finite numbers")
        return array.reshape(rows, columns)

    def lens(self, key: Any, model: str, coefficients: list[float]) -> Lens:
        """A lens of such coefficients."""
        try:
            return Lens(model, coefficients)
        except ValueError as error:
            raise InputError(f"{self.where}: {self.path(key)}: {error}") from None

    def camera(self, width: int, height: int, values: list[float], lens: Lens) -> Pinhole:
        """A camera of fx, fy, cx, cy."""
        try:
            fx, fy, cx, cy = values
            return Pinhole(width, height, fx, fy, cx, cy, lens=lens)
        except ValueError as error:
            raise InputError(f"{self.where}: {self.name or 'camera'}: {error}") from None


def number(value: object) -> float | None:
    """A value as a finite number, None where it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        return None
    found = float(value)
    return found if math.isfinite(found) else None


def short(value: object) -> str:
    """A value in a message."""
    text = " ".join(repr(value).split())
    return text if len(text) <= 60 else f"{text[:57]}..."


def brown(values: list[float]) -> Lens:
    """OpenCV's lens of 4, 5, 8 or more coefficients, without those zeros that say nothing."""
    if not any(values):
        return Lens()
    rest = [any(values[count:]) for count in (4, 5, 8)]
    count = next((n for n, more in zip((4, 5, 8), rest, strict=True) if not more), len(values))
    return Lens("brown", values[:count])
