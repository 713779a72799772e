"""Building blocks of command-line options."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

ARGUMENTS = "xcalib.arguments"
"""Key of a context's ``meta``: all arguments that the program was given."""

Command = TypeVar("Command", bound=Callable[..., Any])


class Input(click.Path):
    """A file or a folder to read; an empty name would stand for the folder one is in.

    Parameters
    ----------
    urls
        Whether what is behind a URL will do too; it stays text.
    """

    def __init__(self, urls: bool = False) -> None:
        super().__init__(path_type=Path)
        self._urls = urls

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The name as a path."""
        if value == "":
            self.fail("the name is empty, expected a file or a folder", param, ctx)
        if self._urls and "://" in str(value):
            return str(value)
        return super().convert(value, param, ctx)


class Output(click.Path):
    """A file or a folder to write: what cannot be written is refused before any work.

    Parameters
    ----------
    check
        `_core.check_file_writable` or `_core.check_output_writable`. It sees the name as it was
        given: a `Path` has no slash at its end, and is never empty.
    urls
        Whether what is behind a URL will do too; it stays text.
    """

    def __init__(self, check: Callable[[str], None], urls: bool = False) -> None:
        super().__init__(path_type=Path)
        self._check = check
        self._urls = urls

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """The name as a path."""
        if self._urls and "://" in str(value):
            return str(value)
        self._check(str(value))
        return super().convert(value, param, ctx)


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


def output_option(text: str) -> Callable[[Command], Command]:
    """``-o``, of a command that tells by the name what it writes, and checks it then."""
    return click.option("-o", "--output", metavar="OUT", type=Input(), required=True, help=text)


def file(flag: str, text: str) -> Callable[[Command], Command]:
    """An option that takes a file."""
    return click.option(flag, metavar="FILE", type=Input(), help=text)
