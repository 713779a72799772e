"""What `xcalib batch` is to do: a YAML file of drives, by the names of the commands' options."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from .._core import InputError
from ..cli import calibrate as calibrate_command
from ..cli import register as register_command
from ..cli.arguments import inputs_of
from ..cli.config import flags_of, key_of, text_of
from ..inputs import Inputs
from ..yaml_file import load_yaml

OWN = ("name", "rig", "calibrate", "register")
"""Keys of a job besides the options that say what its frames are."""
NOT_OF_A_JOB = {"config", "dry-run", "output", "overwrite", "quiet", "report", "rig", "scheduler"}
NOT_OF_A_JOB |= {"threads", "workers"}
"""Options that the batch decides, or that have a key of their own."""


def _options(command: click.Command) -> dict[str, click.Parameter]:
    return {key_of(p): p for p in command.params if key_of(p) not in NOT_OF_A_JOB}


_CALIBRATE, _REGISTER = _options(calibrate_command.command), _options(register_command.command)
FRAMES = tuple(key for key in _CALIBRATE if key in _REGISTER)
"""Keys that say what the frames are: both commands take them."""
CALIBRATE = tuple(key for key in _CALIBRATE if key not in FRAMES)
REGISTER = (*(key for key in _REGISTER if key not in FRAMES), "output")


@dataclass(frozen=True)
class Job:
    """A drive."""

    name: str
    rig: Path | None
    """That it was last known to have."""
    calibrate: tuple[str, ...] | None
    """Arguments of `xcalib calibrate` but for what it writes; None: the rig is taken as it is."""
    register: dict[str, Any] | None
    """Parameters of `xcalib register` by their names; None: it is only calibrated."""
    output: str
    """What registering writes, in the job's folder."""
    frames: dict[str, Any]
    """Those of the parameters that say what the frames are."""

    def inputs(self) -> Inputs:
        """The frames, named but not opened."""
        return inputs_of(self.frames, 0)


def load_jobs(file: Path) -> list[Job]:
    """The jobs of a file, or `InputError` with the first mistake in it."""
    document = load_yaml(file, ["jobs"], ["defaults"])
    defaults = _mapping(document.get("defaults") or {}, f"{file}: defaults", [*FRAMES, *OWN[1:]])
    jobs = document["jobs"]
    if not isinstance(jobs, list) or not jobs:
        raise InputError(f"{file}: jobs is {jobs!r}, expected a list of drives")
    loaded: list[Job] = []
    for index, given in enumerate(jobs):
        where = f"{file}: job {index + 1}"
        if isinstance(given, dict) and isinstance(given.get("name"), str):
            where += f" ({given['name']})"
        job = _job(_mapping(given, where, [*FRAMES, *OWN]), defaults, where)
        if job.name in {other.name for other in loaded}:
            raise InputError(f"{where}: the name is there already, expected one of its own")
        loaded.append(job)
    return loaded


def _job(given: Mapping[str, Any], defaults: Mapping[str, Any], where: str) -> Job:
    every = {**defaults, **given}
    name = every.get("name")
    if not isinstance(name, str) or not re.fullmatch(r"[\w][\w.+-]*", name):
        raise InputError(
            f"{where}: name is {name!r}, expected a text of letters, digits, - _ + and ."
            " (a folder is called so)"
        )
    for key in ("reference", "source", "depth"):
        if key not in every:
            raise InputError(f"{where}: {key} is missing")
    parts = {}
    for key, known in (("calibrate", CALIBRATE), ("register", REGISTER)):
        default, own = defaults.get(key, True), every.get(key, True)
        parts[key] = _options_of(own, default, f"{where}: {key}", known)
    rig = every.get("rig")
    if rig is not None and not isinstance(rig, str):
        raise InputError(f"{where}: rig is {rig!r}, expected a file")
    if parts["calibrate"] is None and rig is None:
        raise InputError(f"{where}: calibrate is false, expected a rig then")
    frames = {key: every[key] for key in FRAMES if key in every}
    register, output = parts["register"], "registered"
    if register is not None:
        output = register.pop("output", output)
        if not isinstance(output, str) or Path(output).name != output:
            raise InputError(
                f"{where}: register: output is {output!r}, expected a name without a folder"
            )
    calibrate = None
    if parts["calibrate"] is not None:
        flags, words = _words(_CALIBRATE, {**frames, **parts["calibrate"]}, where)
        calibrate = (*flags, "--", *words)
        _parsed(calibrate_command.command, ["-o", "rig.yaml", *calibrate], where)
    flags, words = _words(_REGISTER, {**frames, **(register or {})}, where)
    given_words = ["-o", "out", *flags, "--", "rig.yaml", *words]
    params = _parsed(register_command.command, given_words, where)
    keys = {param.name: key_of(param) for param in register_command.command.params}
    return Job(
        name,
        None if rig is None else Path(rig),
        calibrate,
        params if register is not None else None,
        output,
        {name: value for name, value in params.items() if keys.get(name) in FRAMES},
    )


def _mapping(given: Any, where: str, known: Iterable[str]) -> dict[str, Any]:
    if not isinstance(given, dict):
        raise InputError(f"{where}: is {given!r}, expected keys and values")
    for key in given:
        if key not in known:
            raise InputError(f"{where}: unknown key {key!r}, expected {', '.join(known)}")
    return given


def _options_of(own: Any, default: Any, where: str, known: Iterable[str]) -> dict[str, Any] | None:
    """The options of a part of a job over those of all jobs; None where it is not wanted."""
    if own is False:
        return None
    options: dict[str, Any] = {}
    for given in (default, own):
        if not isinstance(given, bool):
            options |= _mapping(given, where, known)
    return options


def _words(
    options: Mapping[str, click.Parameter], given: Mapping[str, Any], where: str
) -> tuple[list[str], list[str]]:
    """The options and the arguments of a command, as they would be typed."""
    words: list[str] = []
    flags: list[str] = []
    for key, param in options.items():
        if key not in given:
            continue
        if isinstance(param, click.Argument):
            words.append(text_of(where, key, given[key]))
        else:
            flags += flags_of(where, param, key, given[key])
    return flags, words


def _parsed(command: click.Command, words: list[str], where: str) -> dict[str, Any]:
    try:
        return command.make_context(command.name, list(words)).params
    except click.ClickException as error:
        raise InputError(f"{where}: {error.format_message()}") from None
