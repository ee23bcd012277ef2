"""Statements that differ only in the places of what they read and write, as loops over tables.

Kernels that call functions of their own put together what these give, block by block: their
thousands of statements have some tens of forms.
"""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

# Statements of one form from which on they are a loop.
LOOP = 8
COLUMNS = 96  # of a line of a table

_PLACE = re.compile(r"\b([A-Za-z_]\w*)(?:\[(\d+)\])?")

Place = tuple[str, int]  # a name, and a number behind it; 0 where there is none


@dataclass(frozen=True)
class Form:
    """A statement with gaps for the numbers of places, and what stands there."""

    text: str
    places: tuple[Place, ...]


def form(statement: str, array: str, stored: Container[str]) -> Form:
    """The form of a statement; values of these names stand in an array."""
    places: list[Place] = []

    def gap(word: re.Match[str]) -> str:
        name, number = word[1], word[2]
        if name in stored:
            places.append((name, int(number or 0)))
            return f"{array}[%s]"
        if number is None:
            return name
        places.append(("", int(number)))
        return f"{name}[%s]"

    return Form(_PLACE.sub(gap, statement.replace("%", "%%")), tuple(places))


def grouped(
    forms: Sequence[str], needs: Sequence[Sequence[int]]
) -> Iterator[tuple[bool, list[int]]]:
    """Statements by their numbers in groups, each behind those that its statements need; and
    whether all of a group have one form, and need nothing of each other."""
    missing = [len(own) for own in needs]
    readers: list[list[int]] = [[] for _ in forms]
    for i, own in enumerate(needs):
        for j in own:
            readers[j].append(i)
    left, ready = Counter(forms), defaultdict[str, list[int]](list)
    alone = [i for i, count in enumerate(missing) if not count]
    straight: list[int] = []
    rare = {text for text, count in left.items() if count < LOOP}

    def enter(numbers: Iterable[int]) -> list[int]:
        """Note what can be done; return those of rare forms."""
        now = []
        for i in numbers:
            now.append(i) if forms[i] in rare else ready[forms[i]].append(i)
        return now

    waiting = enter(alone)
    while waiting or ready:
        if waiting:
            done = waiting
            straight += done
        else:
            # First a form of which nothing else will come, then that of most statements.
            text = max(ready, key=lambda text: (len(ready[text]) == left[text], len(ready[text])))
            done = ready.pop(text)
            left[text] -= len(done)
            if len(done) < LOOP:
                straight += done
            else:
                if straight:
                    yield False, straight
                    straight = []
                yield True, done
        following = []
        for i in done:
            for j in readers[i]:
                missing[j] -= 1
                if not missing[j]:
                    following.append(j)
        waiting = enter(following)
    if straight:
        yield False, straight


def loop(text: str, rows: Sequence[Sequence[int]]) -> list[str]:
    """The lines of a loop: a statement of a form for each row of numbers."""
    columns = [_Column.of(numbers) for numbers in zip(*rows, strict=True)]
    table = [c.numbers for c in columns if c.numbers]
    at = iter(range(len(table)))
    gaps = [f"at[i][{next(at)}]" if c.numbers else c.text for c in columns]
    count = len(rows)
    body = [f"for (int i = 0; i < {count}; ++i)", f"    {text % tuple(gaps)};"]
    if not table:
        return body
    kind = "unsigned short" if max(map(max, table)) < 1 << 16 else "int"
    start = f"static const {kind} at[{count}][{len(table)}] = {{"
    listed = [f"{{{', '.join(map(str, row))}}}" for row in zip(*table, strict=True)]
    inner = [start, *_wrapped(listed), "};", *body]
    return ["{", *(f"    {line}" for line in inner), "}"]


@dataclass(frozen=True)
class _Column:
    """A column of a table: its numbers, or none where they follow from that of the row."""

    text: str
    numbers: tuple[int, ...] = ()

    @classmethod
    def of(cls, numbers: Sequence[int]) -> _Column:
        first, step = numbers[0], numbers[1] - numbers[0]
        if any(b - a != step for a, b in pairwise(numbers)):
            return cls("", tuple(numbers))
        if not step:
            return cls(str(first))
        sign, times = "-" if step < 0 else "+", "" if abs(step) == 1 else f"{abs(step)}*"
        return cls(f"{first} {sign} {times}i")


def _wrapped(words: Sequence[str]) -> Iterator[str]:
    line = ""
    for word in words:
        if line and len(line) + len(word) > COLUMNS:
            yield line
            line = ""
        line += f" {word}," if line else f"    {word},"
    yield line


def numbers(places: Sequence[Place], starts: Mapping[str, int]) -> list[int]:
    """The numbers of places in their arrays, where some names begin at a place of their own."""
    return [starts.get(name, 0) + number for name, number in places]
