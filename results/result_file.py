"""Files of results: how one of any kind is written, and read or refused in a sentence."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import field
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Self

from dmoc.base.arguments import path as path_of
from dmoc.base.arguments import place, shown, text
from dmoc.base.errors import OutputError, SolutionFileError
from dmoc.base.files import write_whole
from dmoc.base.records import record
from dmoc.base.signatures import public
from dmoc.motion.trajectory import Array
from dmoc.results.schema import (
    LARGEST_TEXT,
    Choice,
    Context,
    FieldKind,
    Record,
    Refused,
    dumped,
    plain,
    said,
)

REMEDY = "give one that `dmoc solve --out` has written"


@record(frozen=True, eq=False)
class ResultFile:
    """A kind of file: a result, and the number of the format that it is written in."""

    name: str  # what the text of a file calls the result
    kind: FieldKind  # what it holds of it
    version: str  # what it calls the number of the format
    format: int
    # In sentences: what a damaged file is none of, what makes a result anew, and what writes one.
    noun: str
    again: str
    writer: str
    # Names in the text that files of other results have, and what is said of these.
    foreign: Mapping[str, str] = field(default_factory=dict)
    # Of the result and the length of its text: says that a file does not hold so much.
    excess: Callable[[Any, int], str] | None = None

    @property
    def header(self) -> Record:
        return Record(dict, {self.version: Choice((self.format,)), self.name: self.kind})


def content_of(file: ResultFile, result: Any) -> bytes:
    """Return the content of the file of a result; a text longer than a file holds is refused."""
    from dmoc.results.archive import pack  # here, because most results are never written

    arrays: dict[str, Array] = {}
    header = {file.version: file.format, file.name: result}
    text = dumped(file.header, header, arrays.__setitem__)
    if file.excess is not None and len(text) > LARGEST_TEXT:
        raise OutputError(file.excess(result, len(text)))
    return pack(text, arrays)


def _bytes_of(path: Path) -> bytes:
    """The content of what may be a file of a result."""
    from dmoc.results.archive import LARGEST

    name = place(path)
    try:
        if not path.exists():
            raise SolutionFileError(f"{name} does not exist: {REMEDY}.")
        if not path.is_file():
            raise SolutionFileError(f"{name} is a folder or a device: {REMEDY}.")
        if path.stat().st_size > LARGEST:
            raise SolutionFileError(f"{name} is larger than any solution file: {REMEDY}.")
        return path.read_bytes()
    except OSError as error:
        raise SolutionFileError(
            f"{name} cannot be read ({error.strerror}): give a file that you may read."
        ) from None


def result_in(file: ResultFile, content: bytes, name: str) -> Any:
    """Read a result from the content of a file that errors call ``name``, or refuse it."""
    from dmoc.results.archive import Archive

    try:
        archive = Archive(content)
        header = plain(archive.text())
        _check_format(file, header, name)
        result = file.header.read(header, "", Context(archive.array))[file.name]
        archive.close()
    except Refused as error:
        raise SolutionFileError(
            f"{name} is damaged or no {file.noun} ({error}): write it again with {file.writer}."
        ) from None
    return result


def _check_format(file: ResultFile, header: Any, name: str) -> None:
    """Refuse what is known to be another kind of file, or another format."""
    if not isinstance(header, dict):
        return
    for mark, what in file.foreign.items():
        if mark in header:
            raise SolutionFileError(f"{name} is {what}.")
    version = header.get(file.version)
    if isinstance(version, int) and version != file.format:
        raise SolutionFileError(
            f"{name} has format {said(version)}, expected {file.format}: {file.again}."
        )


@public(SolutionFileError)
class Saved:
    """A result that files hold; FILE of the module ``file_module`` says how."""

    file_module: ClassVar[str]

    @classmethod
    def _file(cls) -> ResultFile:
        file: ResultFile = import_module(cls.file_module).FILE
        return file

    def to_bytes(self) -> bytes:
        """Return the content of an .npz file."""
        return content_of(self._file(), self)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write an .npz file that :meth:`load` reads.

        Raises
        ------
        OutputError
            If the file cannot be written, which leaves an existing one as it was, or does not hold
            so much.
        """
        return write_whole(path, self.to_bytes())

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a file that :meth:`save` has written.

        Raises
        ------
        SolutionFileError
            If the file is missing, cannot be read, is damaged, too large, or something else.
        """
        named = path_of(path, error=SolutionFileError)
        result: Self = result_in(cls._file(), _bytes_of(named), place(named))
        return result

    @classmethod
    def from_bytes(cls, content: bytes, name: str = "the data") -> Self:
        """Read the content of an .npz file; ``name`` is what errors call it."""
        text(name, "name", SolutionFileError)
        if not isinstance(content, bytes):
            raise SolutionFileError(
                f"content = {shown(content)}: expected the bytes of a {cls._file().noun}."
            )
        result: Self = result_in(cls._file(), content, place(name))
        return result
