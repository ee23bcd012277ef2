"""Classes of fields: as frozen dataclasses, made in less time."""

from __future__ import annotations

import copy
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, fields, replace
from typing import Any

import pytest

from dmoc.base.records import record, value_class


@value_class(frozen=True)
class Own:
    name: str
    sizes: tuple[int, ...] = ()
    beside: Any = field(default=None, compare=False, repr=False)


@dataclass(frozen=True)
class Standard:
    name: str
    sizes: tuple[int, ...] = ()
    beside: Any = field(default=None, compare=False, repr=False)


@value_class(frozen=True)
class Single:
    name: str


VALUES = [("a", (1, 2), None), ("a", (1, 2), 3), ("b", (1, 2), None), ("a", (), [])]


def test_values_are_compared_and_shown_as_those_of_a_frozen_dataclass() -> None:
    own, standard = [Own(*v) for v in VALUES], [Standard(*v) for v in VALUES]
    for i, a in enumerate(own):
        assert repr(a) == repr(standard[i]).replace("Standard", "Own")
        for j, b in enumerate(own):
            assert (a == b) == (standard[i] == standard[j])
            assert a != b or hash(a) == hash(b)
    assert len(set(own)) == len(set(standard)) == 3
    assert own[0] != standard[0] and Single("a") != ("a",)


@record(frozen=True, eq=False)
class Base:
    name: str
    sizes: list[int] = field(default_factory=list)
    known: dict[str, int] = field(default_factory=dict, init=False)
    count: int = 3


@record(frozen=True, eq=False)
class Derived(Base):
    more: str = "m"

    def __post_init__(self) -> None:
        self.known["length"] = len(self.name)


class Plain(Base):
    """Has the fields of its base."""


@pytest.mark.parametrize("first", [Base, Derived, Plain])
def test_records_are_made_as_dataclasses_are(first: type[Base]) -> None:
    for made in (first, Plain, Base, Derived):
        one, other = made("a"), made("b", sizes=[1], count=4)
        assert (one.name, one.sizes, one.count) == ("a", [], 3)
        assert (other.name, other.sizes, other.count) == ("b", [1], 4)
        assert one.sizes is not made("a").sizes and one.known is not other.known
    assert Derived("abc", [], 1, "n").more == "n" and Derived("abc").known == {"length": 3}
    assert [f.name for f in fields(Derived)] == ["name", "sizes", "known", "count", "more"]
    assert replace(Base("a", [5]), count=7).sizes == [5]
    with pytest.raises(
        TypeError, match=r"Base.__init__\(\) missing 1 required positional argument"
    ):
        Base()  # type: ignore[call-arg]


def test_a_class_with_an_initialisation_of_its_own_keeps_it() -> None:
    @record(frozen=True, eq=False)
    class Named:
        name: str

    class Loud(Named):
        def __init__(self, name: str) -> None:
            super().__init__(name.upper())

    assert [Loud("a").name, Loud("b").name, Named("c").name] == ["A", "B", "c"]


def test_nothing_changes_a_value() -> None:
    value = Own("a", (1,))
    for name in ("name", "sizes", "other"):
        with pytest.raises(FrozenInstanceError, match=f"cannot assign to field '{name}'"):
            setattr(value, name, "b")
    with pytest.raises(FrozenInstanceError, match="cannot delete field 'name'"):
        del value.name
    assert value == Own("a", (1,))
    assert replace(value, name="b") == Own("b", (1,))
    for again in (copy.copy(value), copy.deepcopy(value), pickle.loads(pickle.dumps(value))):
        assert again == value


def test_a_thread_may_begin_with_an_init_that_another_one_has_replaced() -> None:
    @record(frozen=True, eq=False)
    class Shared:
        name: str

    begun, late = Shared.__init__, Shared.__new__(Shared)
    assert Shared("a").name == "a" and Shared.__init__ is not begun
    begun(late, "b")
    assert late.name == "b"
