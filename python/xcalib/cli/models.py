"""`xcalib models`: depth networks and their cached results."""

from __future__ import annotations

import sys

import click
from tqdm import tqdm

from ..cache import ResultCache
from ..depth.recipes import RECIPES
from ..models import fetch, model_folder, read_index, verify


@click.group("models", short_help="Depth networks: recipes, files, cached results.")
def command() -> None:
    """Depth networks: the recipes that are known, their files, and their cached results.

    Files are kept in XCALIB_MODELS or the user's data folder, results in XCALIB_CACHE or the
    user's cache folder.
    """


@command.command("list")
def list_command() -> None:
    """Print the recipes with licences and sources, and the files that were fetched."""
    click.echo("recipes:")
    for name, shipped in RECIPES.items():
        click.echo(f"  {name} ({shipped.recipe.kind})")
        click.echo(f"    licence: {shipped.licence}")
        click.echo(f"    source:  {shipped.source}")
    click.echo("Weights are fetched by their address: xcalib models fetch URL")
    click.echo(f"files in {model_folder()}:")
    for name, entry in read_index(model_folder()).items():
        click.echo(f"  {name}  sha256 {entry['sha256']}  {entry['url']}")


@command.command("fetch")
@click.argument("url")
@click.option("--name", metavar="FILE", help="Name for the file.  [default: the address' own]")
def fetch_command(url: str, name: str | None) -> None:
    """Download URL into the model folder; what broke off is resumed.

    Its hash is recorded when it first comes, and checked ever after.
    """
    with tqdm(unit="B", unit_scale=True, desc=url, disable=None, leave=False) as bar:

        def show(done: int, total: int | None) -> None:
            bar.total = total
            bar.update(done - bar.n)

        path = fetch(url, name=name, show=show)
    click.echo(path)


@command.command("verify")
def verify_command() -> None:
    """Hash the fetched files again and compare; exit code 1 if one has changed or is missing."""
    states = verify()
    for name, state in states.items():
        click.echo(f"{name}: {state}")
    bad = sum(state != "ok" for state in states.values())
    click.echo(f"{len(states)} files, {bad} not as they were fetched")
    if bad:
        sys.exit(1)


@command.command("cache")
@click.option("--clear", is_flag=True, help="Remove the results.")
def cache_command(clear: bool) -> None:
    """Print how much the cached results of depth networks take, and where they are."""
    cache = ResultCache("depth")
    entries, size = cache.size()
    if clear:
        cache.clear()
    done = " removed" if clear else ""
    click.echo(f"{entries} results, {size / 1e6:.1f} MB{done}: {cache.folder}")
