"""The ``xcalib`` command: one module a command, imported when it is asked for.

Results go to stdout, progress and errors to stderr. Exit codes: 0 done and trusted, 1 failed,
2 wrong usage or input, 3 done, but the result is not to be trusted.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import click

from .errors import WRONG_INPUT, ErrorsInOneLine, open_standard_streams, stop
from .options import ARGUMENTS

COMMANDS = (
    "batch",
    "calibrate",
    "convert",
    "demo",
    "evaluate",
    "inspect",
    "models",
    "register",
    "report",
    "transfer",
    "view",
)


class Commands(ErrorsInOneLine):
    """The commands by the names of their modules."""

    def make_context(
        self,
        info_name: str | None,
        args: list[str],
        parent: click.Context | None = None,
        **extra: Any,
    ) -> click.Context:
        """With the arguments, for those who want to repeat the command."""
        given = list(args)
        try:
            context = super().make_context(info_name, args, parent, **extra)
        except click.NoSuchOption as error:
            stop(WRONG_INPUT, error.format_message())
        context.meta[ARGUMENTS] = given
        return context

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            return None
        command: click.Command = import_module(f"{__name__}.{name}").command
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The command that the arguments name, with those of its `--config` among them."""
        if args and args[0] not in COMMANDS and not args[0].startswith("-"):
            *most, last = COMMANDS
            raise click.UsageError(
                f"No such command '{args[0]}', expected {', '.join(most)} or {last}"
            )
        name, command, rest = super().resolve_command(ctx, args)
        if command is not None and any(arg.startswith("--config") for arg in rest):
            rest = import_module(f"{__name__}.config").expanded(command, rest)
        return name, command, rest


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="xcalib-rgbt", prog_name="xcalib")
def cli() -> None:
    """Calibrate a fixed pair of cameras, visible and thermal, and register their frames.

    REFERENCE and SOURCE are folders or patterns of images (8 or 16 bit, any size), videos, or
    bags with a topic (drive.mcap#/camera/image_raw); #left, #right, #top or #bottom behind one
    takes half of each frame.

    Exit codes: 0 done and trusted, 1 failed, 2 wrong usage or input, 3 done, but the result is
    not to be trusted.
    """


def main() -> None:
    """Entry point of the ``xcalib`` command."""
    open_standard_streams()
    cli(prog_name="xcalib")
