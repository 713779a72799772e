"""How a command ends where it cannot go on, and its exit codes."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import sys
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TextIO

import click

if TYPE_CHECKING:
    from .._core import Rig

FAILED, WRONG_INPUT, NOT_TRUSTED = 1, 2, 3


def stop(code: int, message: str) -> NoReturn:
    """End the command with one line on stderr."""
    say("not to be trusted" if code == NOT_TRUSTED else "error", message)
    sys.exit(code)


def require_trusted(rig: Rig, file: Path) -> None:
    """End the command where the rig's calibration was not to be trusted."""
    if rig.verdict and not rig.verdict.trusted:
        stop(NOT_TRUSTED, f"{file}: {rig.verdict.line()}")


def warn(message: str) -> None:
    """One line on stderr; the command goes on."""
    say("warning", message)


def say(label: str, message: str) -> None:
    """One line on stderr, wherever that leads: a full disk behind it changes no exit code."""
    with contextlib.suppress(OSError):
        click.echo(f"{label}: {' '.join(message.split())}", err=True)


class ErrorsInOneLine(click.Group):
    """A group that turns every expected exception into one line and an exit code."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (click.exceptions.Exit, click.exceptions.Abort):
            raise  # these are click's own control flow, and RuntimeErrors
        except click.ClickException as error:
            stop(WRONG_INPUT, in_words(error))
        except KeyboardInterrupt as error:
            stop(FAILED, str(error) or "interrupted")
        except OSError as error:
            if error.filename == STDOUT:
                sys.stdout = open_nowhere()  # at its end Python would try to write there again
            if error.errno == errno.EPIPE:
                sys.exit(FAILED)  # nobody reads our output any more
            named = f"{error.filename}: {error.strerror}" if error.filename else str(error)
            stop(WRONG_INPUT, named)
        except ValueError as error:
            stop(WRONG_INPUT, str(error))
        except (RuntimeError, MemoryError) as error:
            stop(FAILED, str(error) or "out of memory")
        except Exception as error:  # a defect of ours: in one line too, with where to look
            place = traceback.extract_tb(error.__traceback__)[-1]
            stop(
                FAILED,
                f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno});"
                " please report this",
            )


KINDS = {
    "valid integer range": "whole number",
    "valid integer": "whole number",
    "valid float range": "number",
    "valid float": "number",
}
"""What click calls numbers, and what people do."""


def in_words(error: click.ClickException) -> str:
    """What click says, with what was expected where it leaves that out."""
    message = error.format_message()
    for theirs, ours in KINDS.items():
        message = message.replace(f"is not a {theirs}", f"is not a {ours}")
    context = getattr(error, "ctx", None)
    words = isinstance(error, click.MissingParameter) and isinstance(error.param, click.Argument)
    if context is not None and (words or "extra argument" in message):
        names = [p.make_metavar(context) for p in context.command.params if is_word(p)]
        message = f"{message.rstrip('.')}; expected {context.command.name} {' '.join(names)}"
    return message


def is_word(param: click.Parameter) -> bool:
    """Whether it has no name on the command line."""
    return isinstance(param, click.Argument)


STDOUT = "stdout"


class NamedStdout(io.FileIO):
    """Standard output, whose errors say that they are of it."""

    def write(self, data: Any) -> int:
        """Write bytes."""
        try:
            return super().write(data)
        except OSError as error:
            raise OSError(error.errno, error.strerror, STDOUT) from None


def open_nowhere() -> TextIO:
    """A stream for what nobody reads."""
    return open(os.devnull, "w", encoding="utf-8")


def open_standard_streams() -> None:
    """Make sure that there are all three, and that no file can take the place of a closed one."""
    while (file := os.open(os.devnull, os.O_RDWR)) <= 2:
        os.set_inheritable(file, True)
    os.close(file)
    if sys.stdout is None:
        sys.stdout = open_nowhere()
    else:
        named = io.BufferedWriter(NamedStdout(1, "w", closefd=False))
        sys.stdout = io.TextIOWrapper(named, sys.stdout.encoding, sys.stdout.errors)
    if sys.stderr is None:
        sys.stderr = open_nowhere()
    surrogates = [name for name in sys.argv if not name.isascii() and is_undecodable(name)]
    if surrogates:
        stop(
            WRONG_INPUT,
            f"{''.join(c if c.isascii() else '?' for c in surrogates[0])}: the name is not UTF-8 (?"
            " stands for what is not ASCII), expected another name",
        )


def is_undecodable(name: str) -> bool:
    """Whether Python could not decode an argument."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return True
    return False
