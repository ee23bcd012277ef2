"""What the command line says of the parameters of a command, beside their names and types."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Words:
    """Names of an option, if not those of its parameter, or none of an argument; what help says of
    it, and what the shell proposes."""

    names: tuple[str, ...]
    help: str
    metavar: str | None = None
    completed: Callable[..., Any] | None = None
    argument: bool = False

    def options(self, parameter: str) -> tuple[str, ...]:
        """Spellings of the option of a parameter."""
        return self.names or (f"--{parameter.replace('_', '-')}",)


def option(
    *names: str, help: str, metavar: str | None = None, completed: Callable[..., Any] | None = None
) -> Any:
    return Words(names, help, metavar, completed)


def argument(
    help: str, metavar: str | None = None, completed: Callable[..., Any] | None = None
) -> Any:
    return Words((), help, metavar, completed, True)
