"""The `xcalib-rgbt` command: `xcalib` by a name that no other package has.

Other distributions install packages and commands named `xcalib`; whichever was installed last, or
stands first on the path, is the one that Python imports.
"""

from __future__ import annotations

import sys
from importlib import import_module, util


def main() -> None:
    """Run the command, or say which other package stands in its place."""
    found = util.find_spec("xcalib")
    places = found.submodule_search_locations if found is not None else None
    if not places or util.find_spec("xcalib._core") is None:
        place = found.origin if found is not None else "nowhere"
        print(
            f"error: the package `xcalib` that Python finds ({place}) is not that of xcalib-rgbt;"
            " install xcalib-rgbt in a virtual environment of its own",
            file=sys.stderr,
        )
        sys.exit(2)
    import_module("xcalib.cli").main()
