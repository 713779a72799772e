"""The stub of the C++ module says what the built module says."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import xcalib
from xcalib import _core

STUB = Path(xcalib.__file__).with_name("_core.pyi")


class Name(NamedTuple):
    kind: str  # class, function, property, settable property
    parameters: tuple[str, ...]  # "name", or "name=" where it has a default
    doc: str  # in one line


def one_line(text: str | None) -> str:
    return " ".join((text or "").split())


# -- What the module says


def split_signature(doc: str) -> tuple[tuple[str, ...], str]:
    """Parameters, and the rest of a docstring that pybind11 began with a signature."""
    signature, _, rest = doc.partition("\n")
    assert "->" in signature, f"overloaded or without a signature: {doc!r}"
    inside = signature[signature.index("(") + 1 : signature.rindex(")", 0, signature.rindex("->"))]
    parts, depth = [""], 0
    for character in inside:
        depth += (character in "([") - (character in ")]")
        if character == "," and not depth:
            parts.append("")
        else:
            parts[-1] += character
    names = (part.partition(":")[0].strip() + ("=" if "=" in part else "") for part in parts)
    return tuple(name for name in names if name not in ("", "self", "/", "*")), one_line(rest)


def is_bound_by_pybind(value: Any) -> bool:
    return type(value).__name__ == "instancemethod"


def bound(owner: Any, prefix: str = "") -> Iterator[tuple[str, Name]]:
    for name, value in vars(owner).items():
        path = prefix + name
        if name.startswith("_") and name != "__init__":
            continue
        if inspect.isclass(value):
            yield path, Name("class", (), one_line(value.__doc__))
            yield from bound(value, path + ".")
        elif isinstance(value, property):
            kind = "settable property" if value.fset else "property"
            yield path, Name(kind, (), one_line(value.__doc__))
        elif name != "__init__" or hasattr(value, "__wrapped__") or is_bound_by_pybind(value):
            doc = getattr(owner, name).__doc__
            yield path, Name("function", *split_signature(doc))


# -- What the stub says


def stubbed(body: list[ast.stmt], prefix: str = "") -> Iterator[tuple[str, Name]]:
    for node, after in zip(body, [*body[1:], None], strict=True):
        if isinstance(node, ast.ClassDef):
            yield prefix + node.name, Name("class", (), one_line(ast.get_docstring(node)))
            yield from stubbed(node.body, f"{prefix}{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            if node.name.startswith("_") and node.name != "__init__":
                continue
            is_property = any(ast.unparse(item) == "property" for item in node.decorator_list)
            kind, names = ("property", ()) if is_property else ("function", parameters(node.args))
            yield prefix + node.name, Name(kind, names, one_line(ast.get_docstring(node)))
        elif isinstance(node, ast.AnnAssign):
            said = after.value.value if is_text(after) else ""
            path = prefix + ast.unparse(node.target)
            yield path, Name("settable property", (), one_line(said))


def is_text(node: Any) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def parameters(arguments: ast.arguments) -> tuple[str, ...]:
    first_default = len(arguments.args) - len(arguments.defaults)
    names = [
        argument.arg + ("=" if index >= first_default else "")
        for index, argument in enumerate(arguments.args)
        if argument.arg != "self"
    ]
    return (*names, f"**{arguments.kwarg.arg}") if arguments.kwarg else tuple(names)


# -- The two agree


def test_the_stub_agrees_with_the_module() -> None:
    in_module = dict(bound(_core))
    in_stub = dict(stubbed(ast.parse(STUB.read_text(encoding="utf-8")).body))
    assert len(in_module) > 50
    assert sorted(in_stub) == sorted(in_module)
    for name, said in in_module.items():
        assert in_stub[name] == said, f"{name}: correct {STUB.name}, or run `make stub`"


def test_every_bound_name_has_a_docstring() -> None:
    # A constructor may leave it to its class to say what it takes.
    silent = [name for name, said in bound(_core) if not said.doc and not name.endswith("__init__")]
    assert silent == []
