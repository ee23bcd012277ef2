"""Tables of what is refused: errors and calls, below each arguments and words of the message."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dmoc.base import errors


def refusals(table: str) -> list[tuple[str, str, str]]:
    """Error, call and words of each row; ... in a call stands for its arguments, in the words for
    anything."""
    head, messages = "", list[tuple[str, str, str]]()
    for line in table.strip("\n").replace("\n        ", " ").splitlines():
        if line.startswith(" "):
            arguments, _, words = line.strip().rpartition(" | ")
            error, _, call = head.partition(": ")
            messages.append((error, call.replace("...", arguments), words))
        else:
            head = line
    return messages


def check_refused(error: str, call: str, words: str, names: dict[str, Any]) -> None:
    """A call of some names is refused by an error in one sentence with these words in order."""
    with np.errstate(all="ignore"), pytest.raises(getattr(errors, error)) as refused:
        eval(call, names)
    text, at = str(refused.value), 0
    for part in words.split(" ... "):
        assert part in text[at:], text
        at = text.index(part, at) + len(part)
    assert text.endswith(".") and "\n" not in text and len(text) < 400, text


def refusal_test(table: str) -> Callable[..., None]:
    """A test of each row, with the names of a fixture ``names``; what is refused leaves no file."""

    @pytest.mark.parametrize(("error", "call", "words"), refusals(table))
    def test(
        names: dict[str, Any], monkeypatch: pytest.MonkeyPatch, tmp_path: Path,
        error: str, call: str, words: str,
    ) -> None:  # fmt: skip
        monkeypatch.chdir(tmp_path)
        check_refused(error, call, words, names)
        assert not list(tmp_path.iterdir())

    return test
