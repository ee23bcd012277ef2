"""Long straight-line functions in chunks: a compiler's time for one grows faster than its length.

Values that a later chunk reads, and the results of functions that are called, stand in an array W,
which the whole function has on its stack; its chunks compute the same from the same.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby

from dmoc.codegen.loops import Form, form, grouped, loop, numbers
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
        """What it reads of others."""
        return [word for word in _WORD.findall(self.text) if word != self.made]

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
    texts = [text for _, text in (*code.statements, *code.results)]
    return len(texts) + len(_OPERATION.findall("\n".join(texts)))


def cut(code: Listing, most: int) -> tuple[list[Listing | list[str]], int]:
    """A listing in chunks of so many operations, which follow each other, and the size of the array
    W that they share; loops are the lines that they are."""
    chunks = list(_chunks(_rows(code), most))
    made = {row.made: i for i, (_, own) in enumerate(chunks) for row in own if row.made}
    last = {
        w: i for i, (_, own) in enumerate(chunks) for row in own for w in row.words if w in made
    }
    across = {name: i for name, i in last.items() if i > made[name]}
    starts, size = _array([own for _, own in chunks], across)
    constants = dict(code.constants)
    parts: list[Listing | list[str]] = []
    results = {row.made for _, own in chunks for row in own if not row.name}
    for common, rows in chunks:
        if common is None:
            parts.append(_chunk(code, rows, starts, results))
        else:
            text = _WORD.sub(lambda word: constants.get(word[0], word[0]), common)
            places = [_form(row, starts).places for row in rows]
            parts.append(loop(text, [numbers(own, starts) for own in places]))
    return parts, size


def _chunks(rows: Sequence[_Row], most: int) -> Iterator[tuple[str | None, list[_Row]]]:
    """Rows in chunks, those that are a loop with their form; where functions are called, as others
    have no forms that many share."""
    groups: Iterable[tuple[bool, Sequence[int]]] = [(False, range(len(rows)))]
    made = {row.made: i for i, row in enumerate(rows) if row.made}
    if any(not row.name and _RESULTS.search(row.text) for row in rows):
        needs = [sorted({made[w] for w in row.words if w in made}) for row in rows]
        groups = grouped([_form(row, made).text for row in rows], needs)
    for alike, group in groups:
        own = [rows[i] for i in group]
        if alike:
            yield _form(own[0], made).text, own
            continue
        for _, part in groupby(_numbered(own, most), lambda pair: pair[1]):
            yield None, [row for row, _ in part]


def _form(row: _Row, stored: Container[str]) -> Form:
    places = (row.name,) if row.name else row.places
    return form(" = ".join([*places, row.text]), ARRAY, stored)


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


def _array(chunks: Sequence[Sequence[_Row]], last: Mapping[str, int]) -> tuple[dict[str, int], int]:
    """Where in the array W values stand that other chunks read, the last of them in a chunk of this
    number, and the size of W; results of calls have places of their own."""
    starts: dict[str, int] = {}
    size, free = 0, list[int]()
    leaving: list[list[int]] = [[] for _ in chunks]
    for i, chunk in enumerate(chunks):
        for row in chunk:
            if row.name in last:
                if not free:
                    free.append(size)
                    size += 1
                leaving[last[row.name]].append(place := free.pop())
                starts[row.name] = place
            elif not row.name and (results := _RESULTS.search(row.text)):
                starts[row.made] = size
                size += int(results[2])
        free += leaving[i][::-1]
    return starts, size


def _chunk(
    code: Listing, rows: Sequence[_Row], starts: Mapping[str, int], results: Container[str]
) -> Listing:
    """The listing of one chunk, which stores what others read."""
    named = {row.name for row in rows}

    def there(word: re.Match[str]) -> str:
        name = word[0]
        if name not in starts or name in named:
            return name
        return f"({ARRAY} + {starts[name]})" if name in results else f"{ARRAY}[{starts[name]}]"

    texts = [_WORD.sub(there, _RESULTS.sub("", row.text)) for row in rows]
    own = list(zip(rows, texts, strict=True))
    stored = [((f"{ARRAY}[{starts[row.name]}]",), row.name) for row in rows if row.name in starts]
    used = {word for row in rows for word in row.words}
    return Listing(
        tuple((name, text) for name, text in code.constants if name in used),
        tuple((row.name, text) for row, text in own if not row.places),
        (*((row.places, text) for row, text in own if row.places), *stored),
        code.read,
    )
