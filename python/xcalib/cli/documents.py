"""JSON files of results."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from ..frames import write_bytes


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write JSON whole or not at all; what is not finite becomes null."""
    write_bytes(path, (json.dumps(finite(document), indent=2) + "\n").encode())


def finite(value: Any) -> Any:
    """The value with null in place of NaN and infinities, which JSON does not know."""
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
