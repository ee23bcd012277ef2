"""The command line, one module for each group of commands.

Exit status: 0 solved and verified, 1 not solved, 2 wrong use or bad input.
"""

from __future__ import annotations

from dmoc.cli.app import main

__all__ = ["main"]
