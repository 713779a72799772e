"""`--config FILE`: the arguments of a command in a YAML file, by the names of the options."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .._core import InputError
from ..yaml_file import load_yaml

CONFIG = "--config"


def expanded(command: click.Command, args: list[str]) -> list[str]:
    """The arguments with those of the file that ``--config`` names, which give way to them."""
    file, rest = _taken_out(args)
    if file is None:
        return rest
    context = click.Context(command)
    options = {key_of(param): param for param in command.params if key_of(param) != "config"}
    given = load_yaml(Path(file), optional=list(options))
    # What stands in the command line is only told apart from its values by its parser.
    typed, _, _ = command.make_parser(context).parse_args(list(rest))
    typed_words = [
        str(typed[param.name])
        for param in command.params
        if isinstance(param, click.Argument) and _is_typed(typed.get(param.name or ""))
    ]
    words: list[str] = []
    flags: list[str] = []
    for key, param in options.items():
        if isinstance(param, click.Argument):
            if key in given:
                words.append(text_of(file, key, given[key]))
            elif typed_words:
                words.append(typed_words.pop(0))
        elif key in given and not _is_typed(typed.get(param.name or "")):
            flags += flags_of(file, param, key, given[key])
    if typed_words:
        raise InputError(
            f"{typed_words[0]}: one argument too many, beside those of --config {file}"
        )
    return [*flags, *_without_words(command, context, rest), *words]


def key_of(param: click.Parameter) -> str:
    """What a parameter is called in the file."""
    if isinstance(param, click.Argument):
        return param.make_metavar(click.Context(click.Command(""))).lower()
    longest: str = max(param.opts, key=len)
    return longest.lstrip("-")


def _taken_out(args: list[str]) -> tuple[str | None, list[str]]:
    rest = list(args)
    for index, arg in enumerate(rest):
        if arg.startswith(CONFIG + "="):
            del rest[index]
            return arg.removeprefix(CONFIG + "="), rest
        if arg == CONFIG and index + 1 < len(rest):
            del rest[index : index + 2]
            return args[index + 1], rest
    return None, rest


def _without_words(command: click.Command, context: click.Context, args: list[str]) -> list[str]:
    """The options of the command line with their values, without its other words."""
    takes_value = {
        name
        for param in command.params
        if isinstance(param, click.Option)
        for name in param.opts
        if not param.is_flag
    }
    kept, index = [], 0
    while index < len(args):
        if args[index].startswith("-") and len(args[index]) > 1:
            count = 2 if args[index] in takes_value else 1
            kept += args[index : index + count]
            index += count
        else:
            index += 1
    return kept


def _is_typed(value: Any) -> bool:
    return not (value is None or value is False or value == () or "UNSET" in repr(value).upper())


def flags_of(file: str, param: click.Parameter, key: str, value: Any) -> list[str]:
    """An option of a file as it would be typed."""
    if isinstance(param, click.Option) and param.is_flag:
        if not isinstance(value, bool):
            raise InputError(f"{file}: {key} is {value!r}, expected true or false")
        return [f"--{key}"] if value else []
    return [f"--{key}={text_of(file, key, value)}"]


def text_of(file: str, key: str, value: Any) -> str:
    """A value of a file as it would be typed."""
    if isinstance(value, list) and all(isinstance(item, (int, float, str)) for item in value):
        return ",".join(map(str, value))
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise InputError(f"{file}: {key} is {value!r}, expected a text or a number")
    return str(value)
