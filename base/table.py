"""Tables as data: what the command line, ``print`` and notebooks show of a result is made in one
place and written as text or as HTML here."""

from __future__ import annotations

import io
import os
import shutil
import sys
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from html import escape
from typing import TYPE_CHECKING, TypeAlias

from dmoc.base.records import value_class

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table as RichTable
    from rich.text import Text

# A piece of text and what it means.
Span: TypeAlias = "tuple[str, str]"
Cell: TypeAlias = "str | tuple[Span, ...]"

# What the meanings look like on a terminal, and in a page on a light or a dark ground.
TONES = {
    "": ("", ""),
    "best": ("bold green", "color:#2f9e44;font-weight:bold"),
    "good": ("green", "color:#2f9e44"),
    "fair": ("cyan", "color:#1098ad"),
    "merged": ("blue", "color:#4c8dff"),
    "doubtful": ("yellow", "color:#c77700"),
    "bad": ("red", "color:#e03131"),
    "broken": ("magenta", "color:#be4bdb"),
    "dim": ("dim", "opacity:.6"),
}
NARROWEST, WIDEST = 60, 140  # columns of a printed table
LONGEST_LINE = 10_000  # of a table in a file
CELL = "text-align:left;padding:.15em .9em .15em 0;vertical-align:top"


@value_class(frozen=True)
class Table:
    """Rows of cells, the names of the columns where they have any, a title that pages show, and
    lines that follow."""

    rows: tuple[tuple[Cell, ...], ...]
    head: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    title: str = ""


class Shown(ABC):
    """What shows itself: ``print`` writes its table as text, notebooks as HTML."""

    @abstractmethod
    def summary(self) -> Table:
        """The table that stands for this."""

    def __str__(self) -> str:
        return text_of(self.summary())

    def _repr_html_(self) -> str:
        return html_of(self.summary())


def toned(text: str, tone: str) -> Cell:
    """A cell of one piece."""
    return ((text, tone),)


def passed(good: bool) -> Span:
    """Whether a check was passed."""
    return ("passed", "good") if good else ("failed", "bad")


def rich_table(table: Table) -> RichTable:
    """The table for a console."""
    from rich.table import Table as RichTable

    shown = RichTable(box=None, header_style="bold", show_header=bool(table.head))
    for k, name in enumerate(table.head):  # nothing is cut, and words are folded last
        words = all(" " not in plain(row[k]).strip() for row in table.rows)
        shown.add_column(name, overflow="fold", no_wrap=words)
    for row in table.rows:
        shown.add_row(*map(_text, row))
    return shown


def _text(cell: Cell) -> Text:
    from rich.text import Text

    return Text.assemble(*((text, TONES[tone][0]) for text, tone in _spans(cell)))


def plain(cell: Cell) -> str:
    """A cell without its meanings."""
    return "".join(text for text, _ in _spans(cell))


def _spans(cell: Cell) -> Iterable[Span]:
    return ((cell, ""),) if isinstance(cell, str) else cell


def print_table(table: Table, console: Console) -> None:
    """Write a table and its notes to a console."""
    if console.is_terminal or "COLUMNS" in os.environ or console.file is not sys.stdout:
        console.print(rich_table(table))
    else:  # lines of a file have no end
        console.print(_unbroken(rich_table(table)), soft_wrap=True)
    for note in table.notes:
        console.print(note, soft_wrap=console.file is sys.stdout and not console.is_terminal)


def _unbroken(table: RichTable) -> str:
    """A table with each row in one line, without blanks at the ends of lines."""
    from rich.console import Console

    stream = io.StringIO()
    Console(file=stream, width=LONGEST_LINE, markup=False, emoji=False, highlight=False).print(
        table
    )
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines())


def text_of(table: Table) -> str:
    """The table as plain text as wide as the terminal."""
    from rich.console import Console

    width = min(max(shutil.get_terminal_size((100, 24)).columns, NARROWEST), WIDEST)
    stream = io.StringIO()
    console = Console(
        file=stream, width=width, markup=False, emoji=False, highlight=False, color_system=None
    )
    print_table(table, console)
    return "\n".join(line.rstrip() for line in stream.getvalue().splitlines())


def html_of(table: Table) -> str:
    """The table as a piece of HTML in the colours of its surroundings."""
    head = "".join(f'<th style="{CELL}">{escape(name)}</th>' for name in table.head)
    rows = "".join(f"<tr>{''.join(_cells(row, table))}</tr>" for row in table.rows)
    title = f"<div><strong>{escape(table.title)}</strong></div>" if table.title else ""
    notes = "".join(f"<div>{escape(note)}</div>" for note in table.notes)
    return (
        f'<div class="dmoc">{title}<table style="border-collapse:collapse">'
        f"{f'<thead><tr>{head}</tr></thead>' if head else ''}<tbody>{rows}</tbody></table>"
        f"{notes}</div>"
    )


def _cells(row: tuple[Cell, ...], table: Table) -> Iterator[str]:
    for k, cell in enumerate(row):
        parts = "".join(
            f'<span style="{TONES[tone][1]}">{escape(text)}</span>' if tone else escape(text)
            for text, tone in _spans(cell)
        )
        strength = "opacity:.75;" if not k and not table.head else ""
        yield f'<td style="{strength}{CELL}">{parts}</td>'
