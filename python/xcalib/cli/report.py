"""`xcalib report`: the report of a calibration as text."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from .._core import read_file
from ..frames import InputError
from .options import Input


@click.command("report", short_help="Print the report file of a calibration.")
@click.argument("report_file", metavar="FILE", type=Input())
def command(report_file: Path) -> None:
    """Print the report that `xcalib calibrate --report FILE` wrote."""
    try:
        document = json.loads(read_file(report_file))
    except InputError:
        raise
    except (ValueError, RecursionError):
        raise InputError(f"{report_file}: not a JSON file") from None
    kind = document.get("format") if isinstance(document, dict) else None
    if kind != "xcalib-report" or document.get("version") != 1:
        raise InputError(f"{report_file}: expected format xcalib-report, version 1")
    click.echo("\n".join(lines_of(document)))


def lines_of(document: dict[str, Any], indent: str = "") -> Iterator[str]:
    """A JSON object as text: values by name, lists of objects as tables."""
    for key, value in document.items():
        if isinstance(value, dict):
            yield f"{indent}{key}:"
            yield from lines_of(value, indent + "  ")
        elif isinstance(value, list) and value and all(isinstance(item, dict) for item in value):
            yield f"{indent}{key}:"
            names = list(value[0])
            cells = [names, *([short(item.get(name)) for name in names] for item in value)]
            widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
            for row in cells:
                yield f"{indent}  " + "  ".join(map(str.rjust, row, widths))
        else:
            yield f"{indent}{key}: {short(value)}"


def short(value: Any) -> str:
    """A value in a few characters."""
    if isinstance(value, list):
        return ", ".join(map(short, value))
    return f"{value:.6g}" if isinstance(value, float) else "-" if value is None else str(value)
