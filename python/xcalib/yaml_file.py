"""Small YAML files with known keys."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import yaml

from ._core import InputError, read_text

DEEPEST = 16
"""Lists and mappings within each other."""


def check_depth(text: str, path: Path) -> None:
    """Refuse what is nested so deep that building it would exhaust the stack, and aliases."""
    depth = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST:
            raise InputError(f"{path}: nested more than {DEEPEST} deep")
        if isinstance(event, yaml.AliasEvent):
            raise InputError(f"{path}: an alias (*), expected values only")


def load_yaml(
    path: Path, required: Collection[str] = (), optional: Collection[str] = ()
) -> dict[str, Any]:
    """The mapping in a YAML file, with all of the required keys and none unknown."""
    names = ", ".join([*required, *optional])
    text = read_text(path)
    try:
        check_depth(text, path)
        document = yaml.safe_load(text)
    except InputError:
        raise
    except (yaml.YAMLError, ValueError) as error:
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
