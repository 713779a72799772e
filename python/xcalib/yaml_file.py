"""Small YAML files with known keys."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import yaml

from .frames import InputError


def load_yaml(
    path: Path, required: Collection[str] = (), optional: Collection[str] = ()
) -> dict[str, Any]:
    """The mapping in a YAML file, with all of the required keys and none unknown."""
    names = ", ".join([*required, *optional])
    try:
        document = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not YAML: {' '.join(str(error).split())}") from None
    if not isinstance(document, dict):
        raise InputError(f"{path}: expected keys and values, one a line: {names}")
    for key in required:
        if key not in document:
            raise InputError(f"{path}: {key} is missing")
    for key in document:
        if key not in (*required, *optional):
            raise InputError(f"{path}: unknown key {key!r}, expected {names}")
    return document
