"""Files are written whole or not at all."""

from __future__ import annotations

import os
import secrets
import stat
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from dmoc.base.errors import OutputError
from dmoc.base.messages import path as path_of
from dmoc.base.messages import place

REMEDY = "choose a writable place with room"


def write_whole(path: str | os.PathLike[str], content: bytes) -> Path:
    """Write a file through a temporary one beside it, which nobody can foresee; a device is written
    to directly.  Return its path.  One that cannot be written is refused, and left as it was."""
    named = path_of(path)
    try:
        target = named.resolve()  # a link stays a link
        if target.exists() and not target.is_file():
            target.write_bytes(content)
        else:
            _replace(target, content)
    except OSError as error:
        raise _refused(named, error) from None
    return named


def _replace(target: Path, content: bytes) -> None:
    partial = target.with_name(f".dmoc-{secrets.token_hex(16)}")
    descriptor = os.open(partial, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o666)
    try:
        with open(descriptor, "wb") as stream:
            if target.exists():
                os.fchmod(descriptor, stat.S_IMODE(target.stat().st_mode))
            stream.write(content)
            stream.flush()
            os.fsync(descriptor)
        partial.replace(target)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def write_folder(folder: Path, contents: Mapping[str, bytes]) -> list[Path]:
    """Write files into a new or empty folder; where one of them cannot be written, none is left."""
    is_new, written = not folder.exists(), list[Path]()
    try:
        check_folder(folder)
        for name, content in sorted(contents.items()):
            written.append(write_whole(folder / name, content))
    except BaseException:
        for file in written:
            file.unlink(missing_ok=True)
        if is_new:
            with suppress(OSError):  # there is none, or somebody else has put something there
                folder.rmdir()
        raise
    return written


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """A folder for the time of some work; where the disk for temporary files is full, or nothing
    can be written there, the work is refused in words."""
    try:
        with tempfile.TemporaryDirectory(prefix="dmoc-") as folder:
            yield Path(folder)
    except OSError as error:
        raise OutputError(
            f"temporary files in {tempfile.gettempdir()} cannot be written ({error.strerror}): set "
            "TMPDIR to a place with room."
        ) from None


def check_file(path: Path) -> None:
    """Fail before a long solve rather than after it."""
    try:
        target = path.resolve()
        with suppress(FileNotFoundError):
            target.stat()  # a name may be longer than the file system takes
    except OSError as error:
        raise _refused(path, error) from None
    if target.is_dir():
        raise OutputError(f"{place(path)} cannot be written (it is a folder): name a file.")
    if not target.exists() or target.is_file():
        _check(target.parent, path)


def check_folder(folder: Path) -> None:
    """Make a folder and see whether files can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _refused(folder, error) from None
    _check(folder, folder)


def _check(folder: Path, named: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise _refused(named, error) from None


def _refused(path: Path, error: OSError) -> OutputError:
    return OutputError(f"{place(path)} cannot be written ({error.strerror}): {REMEDY}.")
