"""The command as ``python -m xcalib.cli``."""

from . import main

main()
