"""How a command ends where it cannot go on, and its exit codes."""

from __future__ import annotations

import errno
import sys
from pathlib import Path
from typing import Any, NoReturn

import click

from .._core import Rig

FAILED, WRONG_INPUT, NOT_TRUSTED = 1, 2, 3


def stop(code: int, message: str) -> NoReturn:
    """End the command with one line on stderr."""
    label = "not to be trusted" if code == NOT_TRUSTED else "error"
    click.echo(f"{label}: {' '.join(message.split())}", err=True)
    sys.exit(code)


def require_trusted(rig: Rig, file: Path) -> None:
    """End the command where the rig's calibration was not to be trusted."""
    if rig.verdict and not rig.verdict.trusted:
        stop(NOT_TRUSTED, f"{file}: {rig.verdict.line()}")


def warn(message: str) -> None:
    """One line on stderr; the command goes on."""
    click.echo(f"warning: {' '.join(message.split())}", err=True)


class ErrorsInOneLine(click.Group):
    """A group that turns every expected exception into one line and an exit code."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except (click.exceptions.Exit, click.exceptions.Abort):
            raise  # these are click's own control flow, and RuntimeErrors
        except click.ClickException as error:
            stop(WRONG_INPUT, error.format_message())
        except KeyboardInterrupt as error:
            stop(FAILED, str(error) or "interrupted")
        except OSError as error:
            if error.errno == errno.EPIPE:
                raise  # nobody reads our output any more: click ends quietly
            named = f"{error.filename}: {error.strerror}" if error.filename else str(error)
            stop(WRONG_INPUT, named)
        except ValueError as error:
            stop(WRONG_INPUT, str(error))
        except (RuntimeError, MemoryError) as error:
            stop(FAILED, str(error) or "out of memory")
