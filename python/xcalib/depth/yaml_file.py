"""Small YAML files with known keys."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import yaml

from ..frames import InputError


def load_yaml(path: Path, required: set[str], optional: set[str]) -> dict[str, Any]:
    """The mapping in a YAML file, with all of the required keys and none unknown."""
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8", errors="replace"))
    except yaml.YAMLError as error:
        raise InputError(f"{path}: not YAML: {error}") from None
    if not isinstance(document, dict):
        raise InputError(f"{path}: expected a mapping with {', '.join(sorted(required))}")
    for key in sorted(required - document.keys()):
        raise InputError(f"{path}: {key} is missing")
    for key in document.keys() - required - optional:
        raise InputError(
            f"{path}: {key} is unknown, expected {', '.join(sorted(required | optional))}"
        )
    return document
