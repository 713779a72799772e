"""How arguments are refused."""

from __future__ import annotations

from typing import Any


def require(condition: Any, name: str, value: Any, expected: str) -> None:
    """Raise ValueError with name, value and what was expected, unless the condition holds."""
    if not condition:
        raise ValueError(f"{name} is {value}, expected {expected}")
