"""``python -m dmoc``."""

from dmoc.cli import main

main()
