"""`python -m xcalib`: the command, also where another's is first on the path."""

from .cli import main

main()
