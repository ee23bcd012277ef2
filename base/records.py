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
        over it at run time.  One is made in a quarter of the time of a frozen dataclass, and an
        import makes more than a hundred of them; its instances are made in a third."""
        assert frozen and not eq
        return dataclass(eq=False, repr=False)
