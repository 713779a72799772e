"""Calls of the C++ module with wrong arguments, explained in one line.

pybind11 answers them with the signatures it knows and all that it was given, arrays included. Each
function, constructor and settable field of the module is wrapped once, when it is imported: the
wrapper does nothing until a call fails, and then says which argument it was, and what was expected.
"""

from __future__ import annotations

import difflib
import functools
import inspect
import os
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

Function = Callable[..., Any]

ANSWER = "incompatible "
"""What pybind11's own messages have: `incompatible function arguments`."""


def explain_in(module: ModuleType) -> None:
    """Wrap what the module binds."""
    for name, value in list(vars(module).items()):
        if inspect.isclass(value):
            # The core looks up in Python what a stream overrides, and would find the wrapper.
            if not issubclass(value, (module.Stream, Exception)):
                _explain_class(value)
        elif inspect.isbuiltin(value):
            setattr(module, name, _explained(value, name))


def _explain_class(owner: type) -> None:
    for name, value in list(vars(owner).items()):
        path = owner.__name__ if name == "__init__" else f"{owner.__name__}.{name}"
        if isinstance(value, property):
            if value.fset is not None:
                setter = _explained(value.fset, path, is_setter=True)
                setattr(owner, name, property(value.fget, setter, doc=value.__doc__))
        elif isinstance(value, staticmethod):
            setattr(owner, name, staticmethod(_explained(value.__func__, path)))
        elif type(value).__name__ == "instancemethod" and (
            name == "__init__" or not name.startswith("_")
        ):
            setattr(owner, name, _explained(value, path))


def _explained(function: Function, name: str, is_setter: bool = False) -> Function:
    bound = getattr(function, "__func__", function)  # of pybind11's instancemethod

    @functools.wraps(bound)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            return bound(*args, **kwargs)
        except TypeError as error:
            if ANSWER not in str(error):
                raise
        if is_setter:
            raise TypeError(_wrong_value(name, bound.__doc__ or "", args[1]))
        raise TypeError(_wrong_call(name, bound.__doc__ or "", args, kwargs))

    return call


# -- What a signature says -------------------------------------------------------------------------


@dataclass(frozen=True)
class Parameter:
    """One of a function's, as pybind11's docstring has it."""

    name: str
    annotation: str
    has_default: bool


def parameters_of(doc: str) -> list[Parameter]:
    """Of the first line of a docstring, ``name(a: int, b: float = 1.0) -> None``."""
    signature = doc.partition("\n")[0]
    inside = signature[signature.index("(") + 1 : signature.rindex(")", 0, signature.rindex("->"))]
    found = []
    for part in split(inside, ","):
        name, _, rest = part.partition(":")
        annotation, equals, _ = rest.partition(" = ")
        found.append(Parameter(name.strip(), annotation.strip(), bool(equals)))
    return [parameter for parameter in found if parameter.name not in ("", "/", "*")]


def split(text: str, by: str) -> list[str]:
    """The parts of a text outside of brackets and quotes."""
    parts, depth, quoted = [""], 0, ""
    for character in text:
        if quoted:
            quoted = "" if character == quoted else quoted
        elif character in "'\"":
            quoted = character
        else:
            depth += (character in "([<{") - (character in ")]>}")
        if character == by and not depth and not quoted:
            parts.append("")
        else:
            parts[-1] += character
    return [part.strip() for part in parts]


# -- What fits it ----------------------------------------------------------------------------------

WORDS = {
    "None": "None",
    "bool": "True or False",
    "str": "a text",
    "int": "a whole number",
    "float": "a number",
    "path": "a path",
    "list": "a list",
    "function": "a function",
}


def kinds_of(annotation: str) -> list[str]:
    """What may be given: keys of `WORDS`, and names of classes."""
    kinds = []
    for part in split(annotation, "|"):
        name = part.partition("[")[0].rpartition(".")[2]
        if "PathLike" in part:
            kinds.append("path")
        elif name in ("SupportsInt", "SupportsIndex", "int"):
            if "float" not in kinds:
                kinds.append("int")
        elif name in ("SupportsFloat", "float"):
            kinds.append("float")
        elif name in ("Sequence", "list", "Annotated"):
            kinds.append("list")
        elif name == "Callable":
            kinds.append("function")
        elif "path" not in kinds or name not in ("str", "bytes"):
            kinds.append(name)
    return kinds


def fits(kind: str, value: Any) -> bool:
    """Whether a value is of a kind, as far as its type says."""
    is_number = hasattr(value, "__float__") or hasattr(value, "__index__")
    if kind == "None":
        return value is None
    if kind == "bool":
        return isinstance(value, bool) or type(value).__name__ == "bool_"
    if kind == "int":
        return hasattr(value, "__index__")
    if kind == "float":
        return is_number and not hasattr(value, "__len__")
    if kind == "str":
        return isinstance(value, str)
    if kind == "path":
        return isinstance(value, (str, bytes, os.PathLike))
    if kind == "list":
        return hasattr(value, "__getitem__") and not isinstance(value, (str, bytes, dict))
    if kind == "function":
        return callable(value)
    known = any(kind == each.__name__ for each in type(value).__mro__)
    return known or not kind[:1].isupper()  # as `object`


def expected_of(kinds: list[str]) -> str:
    """What may be given, in words."""
    words = list(dict.fromkeys(WORDS.get(kind, f"an xcalib.{kind}") for kind in kinds))
    return ", ".join(words[:-1]) + " or " + words[-1] if len(words) > 1 else words[0]


def shown(value: Any) -> str:
    """What was given, in a few characters."""
    if value is None or isinstance(value, (bool, int, float)):
        return repr(value)
    if isinstance(value, (str, bytes, os.PathLike)):
        text = repr(value)
        return text if len(text) < 60 else text[:56] + "...'"
    if hasattr(value, "shape") and hasattr(value, "dtype"):
        return f"an array of shape {value.shape} {value.dtype}"
    return f"a {type(value).__name__}"


def hint(kinds: list[str], value: Any) -> str:
    """What would be right for what people give instead."""
    if "Rig" in kinds and fits("path", value):
        return "; xcalib.Rig.load reads one from its file"
    for kind in kinds:
        if kind.endswith("Options") and isinstance(value, dict):
            return f"; xcalib.{kind}(**options) makes one of a dict"
    if "Rig" in kinds and type(value).__name__ == "CalibrationResult":
        return "; it is the .rig of that"
    return ""


def options() -> set[str]:
    """Those of a calibration, which people give to it by themselves."""
    from ._core import CalibrationOptions

    fields = vars(CalibrationOptions).items()
    return {name for name, value in fields if isinstance(value, property)}


# -- The lines -------------------------------------------------------------------------------------


def _wrong_value(name: str, doc: str, value: Any) -> str:
    kinds = kinds_of(parameters_of(doc)[-1].annotation)
    if kinds == ["list"] and fits("list", value):
        return f"{name} is {shown(value)}, expected as many numbers as it has"
    if any(fits(kind, value) for kind in kinds):
        return f"{name} is {shown(value)}, out of the range of its type"
    return f"{name} is {shown(value)}, expected {expected_of(kinds)}{hint(kinds, value)}"


def _wrong_call(name: str, doc: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> str:
    parameters = parameters_of(doc)
    if parameters and parameters[0].name == "self":
        parameters, args = parameters[1:], args[1:]
    names = [parameter.name for parameter in parameters]
    if names == ["**kwargs"]:
        what = f"{name}() takes its options by name, as {name}(max_frames=8)"
        return (
            what.replace("(max_frames=8)", "(option=value)") + f", but was given {shown(args[0])}"
        )
    takes = f"it takes {', '.join(names)}" if names else "it takes no arguments"
    if len(args) > len(names):
        return f"{name}() was given {len(args)} arguments, {takes}"
    given = dict(zip(names, args, strict=False))
    for key in kwargs:
        if key not in names:
            if "options" in names and key in options():
                made = f"xcalib.CalibrationOptions({key}={shown(kwargs[key])})"
                return f"{name}() has no argument {key!r}, options={made} has"
            close = difflib.get_close_matches(key, names, 1)
            meant = f"did you mean {close[0]!r}?" if close else takes
            return f"{name}() has no argument {key!r}, {meant}"
        if key in given:
            return f"{name}() was given {key!r} twice, by its place and by its name"
    given |= kwargs
    for parameter in parameters:
        if parameter.name not in given:
            if not parameter.has_default:
                return f"{name}() lacks its argument {parameter.name!r}, {takes}"
            continue
        value, kinds = given[parameter.name], kinds_of(parameter.annotation)
        if not any(fits(kind, value) for kind in kinds):
            expected = expected_of(kinds) + hint(kinds, value)
            return f"{name}(): {parameter.name} is {shown(value)}, expected {expected}"
    values = ", ".join(f"{key}={shown(value)}" for key, value in given.items())
    return (
        f"{name}(): one of its arguments is out of its range, or its list of other things: {values}"
    )
