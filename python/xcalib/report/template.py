"""Pages by templates, in one style."""

from __future__ import annotations

import math
from collections.abc import Mapping
from importlib import resources
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined


def rendered(package: str, name: str, facts: Mapping[str, Any], style: str = "") -> str:
    """A template of a package, which may include those beside this file, with a style of its own
    after that of all pages.
    """

    def load(name: str) -> str | None:
        for where in (package, __package__):
            if resources.files(where).joinpath(name).is_file():
                return text_of(where, name)
        return None

    environment = Environment(
        loader=FunctionLoader(load),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = number
    styles = text_of(__package__, "style.css") + style
    return environment.get_template(name).render(facts, style=styles)


def text_of(package: str, name: str) -> str:
    """A file of a package."""
    return resources.files(package).joinpath(name).read_text("utf-8")


def number(value: Any, digits: int = 3) -> str:
    """A number in a few digits; a dash where there is none."""
    if not isinstance(value, int | float) or not math.isfinite(value):
        return "-"
    return f"{value:.{digits}g}"
