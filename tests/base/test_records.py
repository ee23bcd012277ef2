"""Classes of fields: as frozen dataclasses, made in less time."""

from __future__ import annotations

import copy
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, replace
from typing import Any

import pytest

from dmoc.base.records import value_class


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
