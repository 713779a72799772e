"""The site of these pages: `make docs`."""

import re
from importlib.metadata import version as version_of

project = "XCalib"
author = "XCalib contributors"
release = version = version_of("xcalib-rgbt")
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"XCalib {version}"
html_show_sphinx = False
html_copy_source = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
# What is mathematics in these pages stands in backticks, and has no lexer.
highlight_language = "none"


def plain(app, what, name, obj, options, lines):
    """Docstrings here are plain text: a line of one is a line, and nothing in it is markup."""
    text = "\n".join(lines).strip().splitlines()
    lines[:] = [f"| {line.strip()}" if line.strip() else "" for line in escape(text)] + [""]


def escape(text):
    """Without what reStructuredText would read as markup, but for what stands in backticks."""
    found = []
    for line in text:
        parts = re.split(r"(``?[^`]+``?)", line)
        found.append(
            "".join(
                f"``{part.strip('`')}``"
                if part.startswith("`")
                else re.sub(r"([*_|\\])", r"\\\1", part)
                for part in parts
            )
        )
    return found


def without_addresses(app, what, name, obj, options, signature, returns):
    """Defaults that are objects, without where they lie in memory."""
    if signature is None:
        return None
    return re.sub(r"<[\w.]+ object at 0x\w+>", "...", signature), returns


def setup(app):
    """Called by Sphinx."""
    app.connect("autodoc-process-docstring", plain)
    app.connect("autodoc-process-signature", without_addresses)
