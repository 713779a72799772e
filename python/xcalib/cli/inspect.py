"""`xcalib inspect`: what a rig file or a bag contains."""

from __future__ import annotations

from pathlib import Path

import click

from ..footage import camera_infos, is_bag
from ..inspection import facts_text, rig_document
from .arguments import load_rig, rig_argument


@click.command("inspect")
@rig_argument
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
def command(rig_file: Path, as_json: bool) -> None:
    """Print the facts of a rig file, in units one can picture; of a bag, its cameras."""
    if is_bag(rig_file):
        for info in camera_infos(rig_file):
            click.echo(info.line())
        return
    rig = load_rig(rig_file)
    click.echo(rig_document(rig) if as_json else facts_text(rig))
