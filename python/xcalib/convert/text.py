"""Documents of YAML, JSON and Python's literals."""

from __future__ import annotations

import ast
import json
from pathlib import Path
from typing import Any

import yaml

from .._core import InputError, read_file, read_text
from ..yaml_file import check_depth


def yaml_of(path: Path) -> Any:
    """The first document of a YAML file: `ros2 topic echo` ends each message with ---."""
    text = read_text(path)
    try:
        check_depth(text, path)
        return next(iter(yaml.safe_load_all(text)), None)
    except InputError:
        raise
    except (yaml.YAMLError, ValueError) as error:
        raise InputError(f"{path}: not YAML: {' '.join(str(error).split())}") from None


def json_of(path: Path) -> Any:
    """The value in a JSON file."""
    try:
        return json.loads(read_file(path))
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not JSON: {error}") from None


def literal_of(path: Path) -> Any:
    """The value of a file that is a Python literal; nothing is run."""
    try:
        return ast.literal_eval(read_file(path).decode())
    except InputError:
        raise
    except (ValueError, SyntaxError, RecursionError, MemoryError) as error:
        raise InputError(f"{path}: not a Python literal: {error}") from None
