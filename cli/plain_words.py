"""Words of a command line that need no parser: options as help shows them, and arguments.

Typer says what is wrong, proposes words and shows help, and takes longer to load than a solve.  So
it is asked only where this module has no answer.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Any, get_args, get_origin

from dmoc.cli.words import Words

NUMBERS = {int: re.compile(r"\d{1,15}"), float: re.compile(r"\d{1,15}(\.\d*)?(e[+-]?\d{1,2})?")}


@dataclass(frozen=True)
class Parameter:
    """A parameter of a command, with its type or that of the entries of its list."""

    name: str
    type: Any
    many: bool
    words: Words

    @classmethod
    def of(cls, parameter: inspect.Parameter) -> Parameter:
        annotation, words = get_args(parameter.annotation)
        some = [kind for kind in get_args(annotation) if kind is not NoneType]
        kind = some[0] if NoneType in get_args(annotation) else annotation
        many = get_origin(kind) is list
        return cls(parameter.name, get_args(kind)[0] if many else kind, many, words)

    def read(self, texts: Sequence[str]) -> Any:
        """The value that texts stand for, or None."""
        values = [_read(text, self.type) for text in texts]
        if None in values or (len(values) != 1 and not self.many):
            return None
        return values if self.many else values[0]


def values_of(command: Callable[..., None], words: Sequence[str]) -> dict[str, Any] | None:
    """Values of the parameters of a spread command; None where words are anything but its options
    in full and its arguments."""
    stated = inspect.signature(command).parameters
    parameters = [Parameter.of(p) for p in stated.values()]
    texts = _texts(parameters, list(words))
    if texts is None:
        return None
    values = {name: p.default for name, p in stated.items()}
    values |= {p.name: p.read(texts[p.name]) for p in parameters if p.name in texts}
    read = all(values[name] is not None for name in texts)
    return values if read and inspect.Parameter.empty not in values.values() else None


def _texts(parameters: Sequence[Parameter], words: list[str]) -> dict[str, list[str]] | None:
    """Texts for each parameter that words name, of a flag its name; None where they name something
    else, or a value looks like an option."""
    options = {o: p for p in parameters if not p.words.argument for o in p.words.options(p.name)}
    arguments = [p for p in parameters if p.words.argument]
    texts: dict[str, list[str]] = {}
    while words:
        word = words.pop(0)
        name, equals, value = word.partition("=") if word.startswith("--") else (word, "", "")
        parameter = options.get(name)
        if parameter is None and arguments and not word.startswith("-"):
            free = (p for p in arguments if p.many or p.name not in texts)
            parameter, value = next(free, arguments[-1]), word
        elif parameter is None or (equals and parameter.type is bool):
            return None
        elif parameter.type is bool:
            value = name
        elif not equals:
            value = words.pop(0) if words else "--"
            if value.startswith("-") and value != "-":
                return None
        texts.setdefault(parameter.name, []).append(value)
    return texts


def _read(text: str, kind: Any) -> Any:
    """A text as a value of some type, or None."""
    if kind is bool:
        return True
    if kind in NUMBERS:
        return kind(text) if NUMBERS[kind].fullmatch(text) else None
    if kind is Path:
        return Path(text) if text else None
    if issubclass(kind, Enum):
        return next((value for value in kind if value.value == text), None)
    return text
