"""Names of quantities as mathematics, with their units, and numbers as texts."""

from __future__ import annotations

import re
from typing import NamedTuple

# Greek letters as TeX and pages write them.
GREEK = dict(
    zip(
        "alpha beta gamma delta epsilon zeta eta theta kappa lambda mu nu xi rho sigma tau phi chi "
        "psi omega".split(),
        "αβγδεζηθκλμνξρστφχψω",
        strict=True,
    )
)


class Label(NamedTuple):
    """A name as mathematics: as TeX, and what of it stands on the line and below it."""

    tex: str
    head: str
    tail: str = ""


def label_of(name: str) -> Label:
    """Greek names become letters, a number at the end and what follows an underscore subscripts."""
    head, _, tail = name.partition("_")
    parts = [part for part in tail.split("_") if part]
    numbered = re.fullmatch(r"([A-Za-z]+)([0-9]+)", head)
    if numbered:
        head, parts = numbered[1], [numbered[2], *parts]
    tex = _tex(head) + (f"_{{{','.join(map(_tex, parts))}}}" if parts else "")
    return Label(tex, GREEK.get(head, head), ",".join(GREEK.get(part, part) for part in parts))


def _tex(word: str) -> str:
    return f"\\{word}" if word in GREEK else (word if len(word) == 1 else f"\\mathrm{{{word}}}")


def with_index(letter: str, index: Label) -> Label:
    """A letter with a name below the line."""
    tail = ",".join(filter(None, index[1:]))
    return Label(f"{letter}_{{{index.tex}}}", letter, tail)


def rate_of(label: Label) -> Label:
    """A rate: a letter with a dot; in a page a word with a prime."""
    mark = "\N{COMBINING DOT ABOVE}" if len(label.head) == 1 else "\N{PRIME}"
    return Label(rf"\dot{{{label.tex}}}", label.head + mark, label.tail)


def plain(text: str) -> str:
    """A text of a model or a file as Matplotlib shows it unchanged: a dollar begins no
    mathematics."""
    return text.replace("$", r"\$")


def math(text: str) -> str:
    """A text as Matplotlib shows it, with its last word as mathematics if that is a name."""
    *words, name = text.split(" ")
    if not name.isidentifier() or not text.isascii() or "$" in text:
        return plain(text)
    return " ".join([*words, f"${label_of(name).tex}$"])


def with_unit(text: str, unit: str) -> str:
    """The label of an axis."""
    return f"{text} [{plain(unit)}]" if unit else text


def letters(text: str) -> int:
    """About how many letters a text with mathematics has."""
    bare = re.sub(r"\\mathrm|\\dot|[$_{} ]", "", text)
    return len(re.sub(r"\\[a-z]+", "a", bare))


def short(value: float) -> str:
    """Four digits of a number, for texts."""
    return f"{value:.4g}".replace("-", "\N{MINUS SIGN}")
