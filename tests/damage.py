"""Damage to solution files and journals, and readers that must refuse them in one sentence or can
use what they hold."""

from __future__ import annotations

import contextlib
import io
import json
import shutil
import sqlite3
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

import dmoc
from dmoc.cli import main
from dmoc.models.registry import find

Members = dict[str, bytes]
Rng = np.random.Generator
WILD = "array: large"  # whole files of motions that take very long to follow
DRAWN = ("array: huge", "array: tiny")
ODD: tuple[Any, ...] = (
    None, True, -1, 0, 3, 2.5, 1e300, float("nan"), float("inf"), 10**400, 2**70, "", "left", "a b",
    "[/x]", "\x1b[31m", "\ud800", "$\\frac{$", "../../x.py:run", [], [0], [[0.0]], {}, {"a": 1},
)  # fmt: skip
ARRAYS: dict[str, Callable[[np.ndarray, Rng], np.ndarray]] = {
    "emptied": lambda a, _: a[:0], "shortened": lambda a, _: a[:-1], "lengthened": lambda a,
    _: np.concatenate([a, a[-1:]]), "transposed": lambda a, _: np.asfortranarray(a.T),
    "flat": lambda a, _: a.reshape(-1), "one more dimension": lambda a, _: a[None],
    "no dimension": lambda a, _: np.float64(a.flat[0] if a.size else 0.0), "NaN": lambda a,
    rng: _poked(a, rng, np.nan), "infinite": lambda a, rng: _poked(a, rng, np.inf),
    "huge": lambda a, rng: _poked(a, rng, 1e300), "large": lambda a, rng: _poked(a, rng, 1e100),
    "tiny": lambda a, rng: _poked(a, rng, 1e-320), "negative": lambda a, rng: _poked(a, rng, -1.0),
    "all huge": lambda a, _: np.full_like(a, 1e300), "all zero": lambda a, _: np.zeros_like(a),
    "reversed": lambda a, _: a[::-1], "random": lambda a, rng: rng.normal(size=a.shape),
    "complex": lambda a, _: a * (1 + 1j), "objects": lambda a, _: a.astype(object),
    "texts": lambda a, _: a.astype(str), "whole numbers": lambda a,
    _: np.clip(a, -9, 9).astype(int), "single precision": lambda a, _: a.astype(np.float32),
    "other bytes": lambda a, _: a.astype(">f8"),
}  # fmt: skip


def _poked(a: np.ndarray, rng: Rng, value: float) -> np.ndarray:
    a = a.copy()
    if a.size:
        a.flat[rng.integers(a.size)] = value
    return a


# Damage to bytes ----------------------------------------------------------------------------------


def flipped(content: bytes, rng: Rng) -> bytes:
    data = bytearray(content)
    for place in rng.integers(len(data), size=rng.integers(1, 9)):
        data[place] ^= 1 << int(rng.integers(8))
    return bytes(data)


def cut(content: bytes, rng: Rng) -> bytes:
    return content[: rng.integers(len(content))]


def blanked(content: bytes, rng: Rng) -> bytes:
    a, b = sorted(rng.integers(len(content), size=2))
    return content[:a] + bytes(b - a) + content[b:]


def doubled(content: bytes, rng: Rng) -> bytes:
    a, b = sorted(rng.integers(len(content), size=2))
    return content[:b] + content[a:]


def noise(content: bytes, rng: Rng) -> bytes:
    return rng.bytes(int(rng.integers(len(content))))


BYTES = (flipped, cut, blanked, doubled, noise)


# Damage to solution files -------------------------------------------------------------------------


def members(content: bytes) -> Members:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def archive(parts: Members | list[tuple[str, bytes]], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", method) as made:
        for name, data in parts.items() if isinstance(parts, dict) else parts:
            made.writestr(name, data)
    return stream.getvalue()


def other_array(content: bytes, rng: Rng, kind: str) -> bytes:
    """An array of another kind; its shape in the text follows in every second case."""
    parts = members(content)
    name = str(rng.choice([n for n in parts if n.endswith(".npy")]))
    array = np.asarray(ARRAYS[kind](np.load(io.BytesIO(parts[name])), rng))
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)
    parts[name] = stream.getvalue()
    header = json.loads(parts["header.json"])
    if rng.integers(2):
        _change(header, name.removesuffix(".npy").split("."), list(array.shape))
    return archive(parts | {"header.json": json.dumps(header).encode()})


def _change(tree: Any, place: list[str], value: Any) -> None:
    *way, last = place
    for step in way:
        tree = tree[int(step)] if isinstance(tree, list) else tree[step]
    tree[int(last) if isinstance(tree, list) else last] = value


def places(tree: Any, way: tuple[str, ...] = ()) -> Iterator[tuple[str, ...]]:
    items = (
        tree.items()
        if isinstance(tree, dict)
        else enumerate(tree)
        if isinstance(tree, list)
        else ()
    )
    for name, value in items:
        yield (*way, str(name))
        yield from places(value, (*way, str(name)))


def other_text(text: str, rng: Rng) -> str:
    """A value of a JSON text replaced, removed, or one added."""
    tree = json.loads(text)
    way = list(list(places(tree))[rng.integers(len(list(places(tree))))])
    _change(tree, way, ODD[rng.integers(len(ODD))])
    how = rng.integers(8)
    if how == 0 and isinstance(tree, dict):
        tree["solution" if "solution" in tree else "verdict"] = ODD[rng.integers(len(ODD))]
    elif how == 1:
        tree[f"unknown {rng.integers(9)}"] = 1
    return json.dumps(tree)


def other_header(content: bytes, rng: Rng) -> bytes:
    parts = members(content)
    return archive(parts | {"header.json": other_text(parts["header.json"].decode(), rng).encode()})


def strange_text(content: bytes, rng: Rng) -> bytes:
    text = members(content)["header.json"]
    strange = [
        b"", b"{", b"[" * 100_000, b'{"a":' * 50_000, b"\xff\xfe", b"null", b"[]", b"1" * 5000,
        b'{"format": 3}', b'{"format": "x"}', b" " * (5 * 2**20) + text,
        text.replace(b'"status"', b'"status": "solved", "status"', 1), text + text,
    ]  # fmt: skip
    return archive(members(content) | {"header.json": strange[rng.integers(len(strange))]})


def strange_archive(content: bytes, rng: Rng) -> bytes:
    parts = members(content)
    name = str(rng.choice(list(parts)))
    few = {n: d for n, d in parts.items() if n != name}
    bomb = (
        b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (%d,), }" % 2**40
    )
    made = [
        lambda: archive(few), lambda: archive([*parts.items(), (name, parts[name])]),
        lambda: archive(parts | {"more.npy": parts[name]}),
        lambda: archive(parts, zipfile.ZIP_BZIP2), lambda: archive(parts, zipfile.ZIP_LZMA),
        lambda: archive(parts, zipfile.ZIP_STORED), lambda: archive(parts | {name: bytes(2**25)}),
        lambda: archive(parts | {name: bomb.ljust(127) + b"\n"}),
        lambda: archive({f"{i}": b"" for i in range(20_000)}), lambda: declared(content, rng),
        lambda: content + rng.bytes(100), lambda: rng.bytes(100) + content, lambda: archive({}),
    ]  # fmt: skip
    with mock.patch("warnings.warn"):  # of a name that is there twice
        return made[rng.integers(len(made))]()


def declared(content: bytes, rng: Rng) -> bytes:
    """Sizes, methods or flags in the directory that are not those of the members."""
    data, at = bytearray(content), content.find(b"PK\x01\x02")
    for _ in range(rng.integers(1, 30)):
        following = content.find(b"PK\x01\x02", at + 4)
        at = following if following > 0 else at
    first, last = [(8, 10), (10, 12), (20, 24), (24, 28), (28, 30), (42, 46)][rng.integers(6)]
    data[at + first : at + last] = rng.bytes(last - first)
    return bytes(data)


SOLUTIONS: dict[str, Callable[[bytes, Rng], bytes]] = {
    "no damage": lambda content, _: content,
    **{f.__name__: f for f in BYTES},
    **{f"array: {kind}": lambda c, rng, kind=kind: other_array(c, rng, kind) for kind in ARRAYS},  # type: ignore[misc]
    **{f.__name__.replace("_", " "): f for f in (other_header, strange_text, strange_archive)},
}


# Damage to journals -------------------------------------------------------------------------------


def statement(text: str) -> Callable[[Path, Rng], None]:
    def run(path: Path, rng: Rng) -> None:
        with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as database:
            database.executescript(text)

    return run


def other_row(path: Path, rng: Rng) -> None:
    """One value of one row: another type, another text, another solution."""
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as database:
        rows = list(
            database.execute("SELECT rowid, sequence, summary, solution FROM nodes ORDER BY rowid")
        )
        row, sequence, summary, solution = rows[rng.integers(len(rows))]
        column = str(rng.choice(["sequence", "summary", "solution"]))
        values: list[Any] = [
            None, 1, 2.5, "", "x", b"", b"\x00", b"\xff\xfe", "[" * 50_000, solution, sequence,
        ]  # fmt: skip
        if column == "summary":
            values += [other_text(summary, rng) for _ in range(20)]
        if column == "solution" and solution:
            values += [damage(solution, rng) for damage in SOLUTIONS.values()]
        value = values[rng.integers(len(values))]
        # A row that SQLite itself refuses.
        with contextlib.suppress(sqlite3.Error, UnicodeEncodeError):
            database.execute(f"UPDATE nodes SET {column} = ? WHERE rowid = ?", (value, row))


def bytewise(damage: Callable[[bytes, Rng], bytes]) -> Callable[[Path, Rng], None]:
    def run(path: Path, rng: Rng) -> None:
        path.write_bytes(damage(path.read_bytes(), rng) or b"\0")

    return run


JOURNALS: dict[str, Callable[[Path, Rng], None]] = {
    "journal: no damage": lambda _, __: None,
    **{f"journal: {f.__name__}": bytewise(f) for f in BYTES},
    "journal: other row": other_row,
    "journal: another table": statement("CREATE TABLE more (a)"),
    "journal: a trigger": statement(
        "CREATE TRIGGER t AFTER INSERT ON nodes BEGIN DELETE FROM nodes; END"
    ),
    "journal: a view": statement(
        "ALTER TABLE nodes RENAME TO rest; CREATE VIEW nodes AS SELECT * FROM rest"
    ),
    "journal: other columns": statement("ALTER TABLE nodes ADD COLUMN more"),
    "journal: no rows about it": statement("DELETE FROM about"),
    "journal: other rows about it": statement("UPDATE about SET value = x'ff'"),
    "journal: no table": statement("DROP TABLE nodes"),
}


# Readers ------------------------------------------------------------------------------------------


def command(*arguments: str) -> int:
    """Run the command line here; a sentence, and never a traceback, is what it may say."""
    output = io.StringIO()
    with (
        mock.patch.object(sys, "argv", ["dmoc", *arguments]),
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(output),
    ):
        try:
            main()
        except SystemExit as end:
            code = end.code
    if "Traceback" in output.getvalue() or code not in (0, 1, 2):
        raise AssertionError(f"exit status {code}: {output.getvalue()}")
    return code if isinstance(code, int) else 0


def sentence(error: dmoc.DmocError) -> str:
    if "\n" in str(error):
        raise AssertionError(f"more than a line: {error}")
    return "refused"


def read_solution(path: Path, problem: dmoc.Problem, draw: bool) -> str:
    """Load, verify, draw, and start from it; the word says how it ended."""
    try:
        solution = dmoc.Solution.load(path)
    except dmoc.DmocError as error:
        if (command("verify", str(path)), command("plot", str(path))) != (2, 2):
            raise AssertionError("refused in Python and not on the command line") from None
        return sentence(error)
    command("verify", str(path))
    if draw:
        command("plot", str(path), "--out", str(path.with_suffix(".png")))
    with contextlib.suppress(dmoc.DmocError):
        dmoc.solve(problem, "ipm", guess=solution, iterations=3, verify=False)
    return "loaded"


def read_journal(path: Path, problem: dmoc.Problem) -> str:
    """Resume; a journal that is refused is left as it is."""
    before = path.read_bytes()
    try:
        dmoc.search(problem, 1, journal=path, resume=True, max_nodes=2, node_seconds=5.0)
    except dmoc.DmocError as error:
        if path.read_bytes() != before:
            raise AssertionError("a refused journal was changed") from None
        return sentence(error)
    return "loaded"


def example(folder: Path) -> tuple[dmoc.Problem, bytes, Path]:
    """A small problem, its solution file, and the journal of a search."""
    reference = find("cart_pendulum")
    problem = dmoc.Problem(reference.kernels(), **{**reference.defaults, "steps": 10})
    solution = dmoc.solve(problem, "ipm", reference="cart_pendulum")
    mesh = dmoc.results.solution.Mesh((10, 10), solution.cost, 20, np.inf, None)
    journal = folder / "journal.sqlite"
    dmoc.search(problem.but(sequence=()), 1, journal=journal, max_nodes=2)
    return problem, replace(solution, meshes=(mesh,), error_estimate=1e-3).to_bytes(), journal


def damaged(number: int, seed: int) -> Iterator[tuple[str, str]]:
    """Yield the kind of damage of each file and how its reading ended."""
    kinds = [k for k in (*SOLUTIONS, *JOURNALS) if k != WILD]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        problem, content, journal = example(folder)
        for i in range(number):
            kind, rng = kinds[i % len(kinds)], np.random.default_rng([seed, i])
            if kind in SOLUTIONS:
                path = folder / "damaged.npz"
                path.write_bytes(SOLUTIONS[kind](content, rng))
                yield kind, read_solution(path, problem, kind in DRAWN)
            else:
                path = folder / "damaged.sqlite"
                shutil.copy(journal, path)
                JOURNALS[kind](path, rng)
                yield kind, read_journal(path, problem.but(sequence=()))
