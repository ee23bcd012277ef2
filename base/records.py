"""Classes of fields that nothing changes and nothing compares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

__all__ = ["record"]

T = TypeVar("T")

if TYPE_CHECKING:
    from dataclasses import dataclass as record
else:

    def record(*, frozen: bool, eq: bool) -> Callable[[type[T]], type[T]]:
        """A dataclass without comparison that type checkers take for a frozen one: nothing watches
        over it at run time, so that it is no class of what users get.  The class and its instances
        are made in a quarter of the time that a frozen one takes, and the first solve of a process
        makes about a hundred of these classes."""
        assert frozen and not eq
        return dataclass(eq=False, repr=False)
