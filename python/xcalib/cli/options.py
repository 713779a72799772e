"""Building blocks of command-line options."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

Command = TypeVar("Command", bound=Callable[..., Any])


def options(*decorators: Callable[[Command], Command]) -> Callable[[Command], Command]:
    """Several click decorators as one."""

    def apply(command: Command) -> Command:
        for decorator in reversed(decorators):
            command = decorator(command)
        return command

    return apply


def number(
    flag: str, metavar: str, default: float, text: str, shown: bool | str = True
) -> Callable[[Command], Command]:
    """An option that takes a number, with its unit in the help text."""
    return click.option(
        flag, metavar=metavar, type=float, default=default, show_default=shown, help=text
    )


def file(flag: str, text: str) -> Callable[[Command], Command]:
    """An option that takes a file."""
    return click.option(flag, metavar="FILE", type=click.Path(path_type=Path), help=text)
