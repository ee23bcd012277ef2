"""What programs have in common, such as the structures of one form, found by the content of what
they follow from."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import is_dataclass
from threading import Lock
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from dmoc.program.elements import Form, Structure, structure_of

if TYPE_CHECKING:
    from dmoc.program.laws.laws import Laws
    from dmoc.program.scaling import Reached

# Structures that are remembered, and bytes of all together: a search goes to and fro between the
# forms of some tens of sequences, and one of 20 000 unknowns takes up to 35 MB.
MOST, MOST_BYTES = 32, 2**27
# Motions of which is remembered what they reach: a few numbers each.
MOST_MOTIONS = 64
# Unknowns of a problem of which things are remembered.
MOST_REMEMBERED = 20_000


T = TypeVar("T")


class Recent(Generic[T]):
    """The objects asked for last, by keys from which each follows."""

    def __init__(self, most: int = MOST) -> None:
        self.most, self._lock = most, Lock()
        self._values: OrderedDict[Hashable, T] = OrderedDict()

    def of(self, key: Hashable | None, make: Callable[[], T]) -> T:
        """The object of a key, made once; made anew where the key is None."""
        if key is None:
            return make()
        with self._lock:
            value = self._values.get(key)
            if value is not None:
                self._values.move_to_end(key)
                return value
        made = make()
        with self._lock:
            value = self._values.setdefault(key, made)
            self._values.move_to_end(key)
            self._forget()
        return value

    def clear(self) -> None:
        with self._lock:
            self._values.clear()

    def _forget(self) -> None:
        """Leave out those that were not asked for the longest, until the others have room."""
        while len(self._values) > self.most:
            self._values.popitem(last=False)


class Structures(Recent[Structure]):
    """The structures that were asked for last; what methods have added to them counts, too."""

    def __init__(self) -> None:
        super().__init__()
        # Bytes, with the number of things that methods had added when they were counted.
        self._counted: dict[Hashable, tuple[int, int]] = {}

    def of_form(self, form: Form) -> Structure:
        """The structure of a form."""
        return self.of(form.digest, lambda: structure_of(form))

    def clear(self) -> None:
        super().clear()
        self._counted.clear()

    def _forget(self) -> None:
        if len(self._values) < 2:  # the last one stays, whatever its size
            return
        for key, structure in self._values.items():
            added = structure.additions
            if self._counted.get(key, (0, -1))[1] != added:
                self._counted[key] = bytes_of(structure, set()), added
        total = sum(size for size, _ in self._counted.values())
        while len(self._values) > 1 and (len(self._values) > self.most or total > MOST_BYTES):
            oldest, _ = self._values.popitem(last=False)
            total -= self._counted.pop(oldest)[0]


class Memory:
    """What a process remembers of programs, by all that it follows from: problems, and the kernels
    of those that come from another process, are made anew for every solve."""

    def __init__(self) -> None:
        self.structures = Structures()
        # By what rows follow from; and others without rows, for the bounds that all of a form put
        # in the same way.
        self.laws: Recent[Laws] = Recent()
        self.bounding: Recent[Laws] = Recent()
        # What motions reach: neighbours of a problem often begin with the same one.
        self.reached: Recent[Reached] = Recent(MOST_MOTIONS)

    def clear(self) -> None:
        for part in (self.structures, self.laws, self.bounding, self.reached):
            part.clear()


MEMORY = Memory()


def bytes_of(value: Any, counted: set[int]) -> int:
    """Bytes of the arrays in a value, each counted once."""
    total, parts = 0, [value]
    while parts:
        part = parts.pop()
        if id(part) in counted:
            continue
        counted.add(id(part))
        if hasattr(part, "nbytes"):
            total += int(part.nbytes)
        elif isinstance(part, (tuple, list)):
            parts.extend(part)
        elif isinstance(part, dict):
            parts.extend(part.values())
        elif is_dataclass(part) and not isinstance(part, type):
            if not hasattr(part, "manifest"):  # kernels, which are the caller's
                parts.extend(getattr(part, name) for name in part.__dataclass_fields__)
        elif hasattr(part, "data"):  # a compiled program
            parts.append(part.data)
    return total
