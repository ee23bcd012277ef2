"""Pages in Markdown that run: their Python blocks in their order, compared with the outputs shown.

A block ``python`` whose first line is a comment with the name of a file is that file, the others
run one after the other.  A block ``output`` has what the block before it prints; ``...`` stands for
anything.  Lines of a block ``console`` that begin with ``$ dmoc`` are commands.
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from doctest import ELLIPSIS, OutputChecker
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
TROUBLESHOOTING = ROOT / "cli/troubleshooting.md"
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
FILE = re.compile(r"# (\w+\.py)\n")
# What the pages take from others: page and file.
SHARED = {"block.py": DOCS / "tutorial.md"}


@dataclass(frozen=True)
class Block:
    """A fenced block: language, content, and where the content lies in the page."""

    language: str
    content: str
    begin: int
    end: int

    @property
    def file(self) -> str | None:
        """The file that the block is."""
        named = FILE.match(self.content)
        return named[1] if named and self.language == "python" else None


def blocks_of(text: str) -> list[Block]:
    return [Block(m[1], m[2], m.start(2), m.end(2)) for m in FENCE.finditer(text)]


def write_shared(folder: Path) -> None:
    """Write the files that pages share, beside the examples."""
    (folder / "examples").symlink_to(ROOT / "examples")
    for name, page in SHARED.items():
        (block,) = (b for b in blocks_of(page.read_text()) if b.file == name)
        (folder / name).write_text(block.content)


def run(text: str, folder: Path) -> list[tuple[Block, str]]:
    """Run a page in a folder; the blocks that show outputs, with what was printed."""
    space: dict[str, object] = {"__name__": "page"}
    outputs, printed = [], ""
    with _within(folder):
        for block in blocks_of(text):
            if block.file:
                (folder / block.file).write_text(block.content)
            elif block.language == "python":
                printed = _printed(block.content, space)
            elif block.language == "output":
                outputs.append((block, printed))
    return outputs


@contextlib.contextmanager
def _within(folder: Path) -> Iterator[None]:
    """Work in a folder, whose modules are known to nobody else, with the width of the pages."""
    modules, columns = set(sys.modules), os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = "100"
    sys.path.insert(0, str(folder))
    try:
        with contextlib.chdir(folder):
            yield
    finally:
        del os.environ["COLUMNS"]
        if columns is not None:
            os.environ["COLUMNS"] = columns
        sys.path.remove(str(folder))
        for name in set(sys.modules) - modules:
            if Path(getattr(sys.modules[name], "__file__", None) or "/").parent == folder:
                del sys.modules[name]


def _printed(code: str, space: dict[str, object]) -> str:
    stream = io.StringIO()
    with contextlib.redirect_stdout(stream):
        exec(compile(code, "<page>", "exec"), space)
    lines = (line.rstrip() for line in stream.getvalue().splitlines())
    return "".join(f"{line}\n" for line in lines)


def agrees(expected: str, printed: str) -> bool:
    return OutputChecker().check_output(expected, printed, ELLIPSIS)


def commands_of(text: str) -> list[list[str]]:
    """The arguments of each command ``dmoc`` of a page."""
    lines = "\n".join(b.content for b in blocks_of(text) if b.language == "console")
    joined = lines.replace("\\\n", " ")
    commands = re.findall(r"^\$ dmoc (.*)$", joined, re.MULTILINE)
    return [shlex.split(command, comments=True) for command in commands]


def updated(text: str, folder: Path) -> str:
    """The page with the outputs of its blocks; those that leave something out stay."""
    for block, printed in reversed(run(text, folder)):
        if not agrees(block.content, printed):
            text = text[: block.begin] + printed + text[block.end :]
    return text


if __name__ == "__main__":
    for name in sys.argv[1:]:
        page = Path(name)
        page.write_text(updated(page.read_text(), Path.cwd()))
