"""What a command of the command line gives to a test."""

from __future__ import annotations

from collections.abc import Callable

# Exit status, standard output and standard error of ``dmoc`` with some arguments.
Run = Callable[..., tuple[int, str, str]]
