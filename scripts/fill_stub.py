"""Copy the docstrings of the built module into its stub, whose signatures are written by hand.

Usage: python scripts/fill_stub.py python/xcalib/_core.pyi, with the package installed.
"""

import ast
import inspect
import sys
import textwrap
from pathlib import Path
from typing import Any

import xcalib._core

WIDTH = 100


def docstring(bound: Any) -> str:
    """What the binding says of itself, without the signatures that pybind11 puts before it."""
    text = inspect.cleandoc(getattr(bound, "__doc__", None) or "")
    head, _, rest = text.partition("\n")
    return rest.strip() if "->" in head else text


def quoted(text: str, indent: str) -> list[str]:
    """A docstring as source lines, its paragraphs filled anew if one is too long."""
    if max(map(len, text.splitlines())) + len(indent) + 6 > WIDTH:
        fill = textwrap.TextWrapper(WIDTH - len(indent) - 6).fill
        text = "\n\n".join(fill(" ".join(part.split())) for part in text.split("\n\n"))
    close = '\n"""' if "\n" in text else '"""'
    return [(indent + line).rstrip() for line in f'"""{text}{close}'.splitlines()]


def filled(source: str) -> str:
    """The stub with every docstring as the module has it."""
    lines = source.splitlines()
    edits: list[tuple[int, int, list[str]]] = []  # replace lines[first:last]

    def visit(body: list[ast.stmt], owner: Any, indent: str) -> None:
        for node, after in zip(body, [*body[1:], None], strict=True):
            if isinstance(node, ast.ClassDef):
                bound = getattr(owner, node.name)
                put_inside(node, docstring(bound), indent)
                visit(node.body, bound, indent + "    ")
            elif isinstance(node, ast.FunctionDef):
                put_inside(node, docstring(getattr(owner, node.name)), indent)
            elif isinstance(node, ast.AnnAssign):
                assert isinstance(node.target, ast.Name)
                end = node.end_lineno or 0
                old = (after.end_lineno or end) if is_text(after) else end
                edits.append((end, old, quoted(docstring(getattr(owner, node.target.id)), indent)))

    def put_inside(node: ast.ClassDef | ast.FunctionDef, text: str, indent: str) -> None:
        first, inner = node.body[0], indent + "    "
        new = quoted(text, inner) if text else []
        if is_text(first):
            edits.append((first.lineno - 1, first.end_lineno or 0, new or [inner + "..."]))
        elif isinstance(first, ast.Expr) and isinstance(node, ast.FunctionDef) and new:
            line = lines[first.lineno - 1]
            head = [line.removesuffix(" ...")] if line.strip() != "..." else []
            edits.append((first.lineno - 1, first.lineno, head + new))
        elif new and isinstance(node, ast.ClassDef):
            edits.append((node.lineno, node.lineno, new))

    visit(ast.parse(source).body, xcalib._core, "")
    for start, end, new in sorted(edits, reverse=True):
        lines[start:end] = new
    return "\n".join(lines) + "\n"


def is_text(node: ast.stmt | None) -> bool:
    """Whether the statement is a string alone: a docstring."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


if __name__ == "__main__":
    stub = Path(sys.argv[1])
    stub.write_text(filled(stub.read_text(encoding="utf-8")), encoding="utf-8")
