"""Long straight-line functions in chunks: a compiler's time for one grows faster than its length.

Values that a later chunk reads, and the results of functions that are called, stand in an array W,
which the whole function has on its stack; its chunks compute the same, in the same order.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

from dmoc.codegen.printer import Listing

# Operations of a chunk, and those of a function from which on it has chunks.
CHUNK, LONG = 400, 1000
ARRAY = "W"

_WORD = re.compile(r"\b[A-Za-z_]\w*")
_OPERATION = re.compile(r"[-+*/?]")
_RESULTS = re.compile(r"\ndouble (\w+)\[(\d+)\];")  # of a call


@dataclass(frozen=True)
class _Row:
    """A statement, which may have a name, or the places of a result, and its text."""

    name: str
    places: tuple[str, ...]
    text: str

    @cached_property
    def words(self) -> list[str]:
        return _WORD.findall(self.text)

    @cached_property
    def made(self) -> str:
        """What others read: a value, or the array of a call's results."""
        results = None if self.name else _RESULTS.search(self.text)
        return results[1] if results else self.name

    @cached_property
    def operations(self) -> int:
        return 1 + len(_OPERATION.findall(self.text))


def words_of(code: Listing) -> set[str]:
    """The names in a listing, of places and in what is computed."""
    texts = [text for _, text in (*code.statements, *code.results)]
    return set(_WORD.findall(" ".join([*texts, *(p for own, _ in code.results for p in own)])))


def operations(code: Listing) -> int:
    """About how many operations a listing has."""
    return sum(row.operations for row in _rows(code))


def cut(code: Listing, most: int) -> tuple[list[Listing], int]:
    """A listing in chunks of so many operations, which follow each other, and the size of the array
    W that they share."""
    rows = _rows(code)
    chunks = [[row for row, _ in own] for _, own in groupby(_numbered(rows, most), lambda r: r[1])]
    made = {row.made: i for i, own in enumerate(chunks) for row in own if row.made}
    last = {w: i for i, own in enumerate(chunks) for row in own for w in row.words if w in made}
    places, size = _array(chunks, {name: i for name, i in last.items() if i > made[name]})
    return [_chunk(code, own, i, made, places) for i, own in enumerate(chunks)], size


def _rows(code: Listing) -> list[_Row]:
    """Statements and results, of which each follows what it reads."""
    statements = [_Row(name, (), text) for name, text in code.statements]
    at = {row.made: i for i, row in enumerate(statements)}
    behind: list[list[_Row]] = [[] for _ in range(len(statements) + 1)]
    for places, text in code.results:
        row = _Row("", places, text)
        behind[max((at[w] + 1 for w in row.words if w in at), default=0)].append(row)
    first, *others = behind
    return first + [r for s, own in zip(statements, others, strict=True) for r in (s, *own)]


def _numbered(rows: Sequence[_Row], most: int) -> Iterator[tuple[_Row, int]]:
    """Rows with the numbers of their chunks."""
    number, count = 0, 0
    for row in rows:
        if count and count + row.operations > most:
            number, count = number + 1, 0
        count += row.operations
        yield row, number


def _array(chunks: Sequence[Sequence[_Row]], last: Mapping[str, int]) -> tuple[dict[str, str], int]:
    """Places in the array W of values that other chunks read, the last of them in a chunk of this
    number, and the size of W; results of calls have places of their own."""
    places: dict[str, str] = {}
    size, free = 0, list[int]()
    leaving: list[list[int]] = [[] for _ in chunks]
    for i, chunk in enumerate(chunks):
        for row in chunk:
            if row.name in last:
                if not free:
                    free.append(size)
                    size += 1
                leaving[last[row.name]].append(place := free.pop())
                places[row.name] = f"{ARRAY}[{place}]"
            elif not row.name and (results := _RESULTS.search(row.text)):
                places[row.made] = f"({ARRAY} + {size})"
                size += int(results[2])
        free += leaving[i][::-1]
    return places, size


def _chunk(
    code: Listing, rows: Sequence[_Row], number: int, made: Mapping[str, int],
    places: Mapping[str, str],
) -> Listing:  # fmt: skip
    """The listing of one chunk, which stores what others read."""

    def there(word: re.Match[str]) -> str:
        name = word[0]
        local = made.get(name) == number and not places.get(name, "").startswith("(")
        return name if local else places.get(name, name)

    texts = [_WORD.sub(there, _RESULTS.sub("", row.text)) for row in rows]
    own = list(zip(rows, texts, strict=True))
    stored = [((places[row.name],), row.name) for row in rows if row.name in places]
    used = {word for row in rows for word in row.words}
    return Listing(
        tuple((name, text) for name, text in code.constants if name in used),
        tuple((row.name, text) for row, text in own if not row.places),
        (*((row.places, text) for row, text in own if row.places), *stored),
        code.read,
    )
