"""Folders and files that nobody but the user can change, and files that are written whole or not
at all."""

from __future__ import annotations

import atexit
import os
import secrets
import shutil
import stat
import tempfile
from functools import cache
from pathlib import Path

from dmoc.base.errors import BuildError, warn

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH


def make_folder(folder: Path) -> None:
    """Make a folder and those above it that are missing, for the user alone."""
    missing = [place for place in (folder, *folder.parents) if not os.path.lexists(place)]
    for place in reversed(missing):
        place.mkdir(mode=0o700, exist_ok=True)
    if not folder.is_dir():
        raise NotADirectoryError(20, "it is not a folder")


def safe_folder(folder: Path) -> Path:
    """Return an existing folder, free of links, if what lies in it is the user's; otherwise warn
    once and return a temporary folder."""
    real = folder.resolve()
    why = objection(real)
    return real if why is None else _instead_of(folder, why)


def objection(folder: Path) -> str | None:
    """Say why others could change what lies in a folder, by way of it or of one above it; None
    if they cannot."""
    me = os.geteuid()
    for place in (folder, *folder.parents[:-1]):
        facts = place.stat()
        if facts.st_uid != me and (place == folder or facts.st_uid != 0):
            return f"{place} belongs to another user"
        if facts.st_mode & OTHERS_WRITE and (place == folder or not facts.st_mode & stat.S_ISVTX):
            return f"other users may write to {place}"
    return None


@cache
def _instead_of(folder: Path, why: str) -> Path:
    warn(
        f"the kernel cache {folder} is not used, because {why}, and kernels are built for this "
        "process alone: take away the others' right to write (chmod go-w), or set DMOC_CACHE to a "
        "folder of your own."
    )
    made = Path(tempfile.mkdtemp(prefix="dmoc-")).resolve()
    atexit.register(_remove, made, os.getpid())
    why_not = objection(made)
    if why_not is not None:
        raise BuildError(
            f"kernels cannot be built in {made}, because {why_not}: set TMPDIR or DMOC_CACHE to a "
            "folder of your own."
        )
    return made


def _remove(folder: Path, process: int) -> None:
    if os.getpid() == process:  # a forked process leaves it to its parent
        shutil.rmtree(folder, ignore_errors=True)


def is_private(path: Path) -> bool:
    """Whether a path is a folder or a file itself, no link, that belongs to the user and to whom
    others cannot write."""
    facts = path.lstat()
    plain = stat.S_ISREG(facts.st_mode) or stat.S_ISDIR(facts.st_mode)
    return plain and facts.st_uid == os.geteuid() and not facts.st_mode & OTHERS_WRITE


def remove(path: Path) -> None:
    """Remove what is at a path: a folder with all in it, or a file or link itself."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    elif os.path.lexists(path):
        path.unlink()


def write_whole(path: Path, text: str) -> None:
    """Write a file by way of a new one beside it, whose name nobody can know before."""
    beside = path.with_name(f".{path.name}.{secrets.token_hex(8)}")
    try:
        with open(beside, "x", encoding="utf-8") as file:
            file.write(text)
        beside.replace(path)
    except BaseException:
        beside.unlink(missing_ok=True)
        raise
