"""`xcalib report`: the report of a calibration, as text or as a page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click

from ..frames import InputError, check_file_writable
from ..report.run import load_document, of_report
from .arguments import config_option, dry_run_option, print_plan
from .options import Input, Output

PICTURE = "expected_error_map"
"""Of a report: numbers that only a page can show."""


@click.command("report", short_help="The report of a calibration, as text or as a page.")
@click.argument("run", metavar="RUN", type=Input())
@click.option(
    "-o",
    "--output",
    metavar="FILE.html",
    type=Output(check_file_writable),
    help="Write a page to look at: pictures, charts, the rig.  [default: print the report]",
)
@config_option
@dry_run_option
def command(run: Path, output: Path | None, dry_run: bool) -> None:
    """Print the report that `xcalib calibrate --report FILE` wrote, or make a page of it.

    RUN is that file, or the folder of `xcalib demo`. The page shows the frames themselves: they
    are read again from where they were.
    """
    if output is None and dry_run:
        click.echo(f"would be printed: {load_document(run)[0]}")
        return
    if output is None:
        click.echo("\n".join(lines_of(load_document(run)[1])))
        return
    if output.suffix.lower() != ".html":
        raise InputError(f"{output}: expected a name that ends in .html")
    if dry_run:
        with of_report(run.absolute()) as found:
            print_plan(found.frames, [output], found.chosen)
        return
    from ..report.page import write_page  # it loads much

    file = output.absolute()
    with of_report(run.absolute()) as found:
        write_page(found, file, f"Calibration of {found.document['rig']}")
    click.echo(f"page: {output}")


def lines_of(document: dict[str, Any], indent: str = "") -> Iterator[str]:
    """A JSON object as text: values by name, lists of objects as tables."""
    for key, value in document.items():
        if key == PICTURE:
            continue
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
