"""The command ``dmoc explain``: entries of the page on troubleshooting, which is in the package."""

from __future__ import annotations

import re
import sys
from typing import Annotated

from dmoc.cli.console import err, out
from dmoc.cli.shared_options import BAD_INPUT
from dmoc.cli.words import argument

PAGE = "troubleshooting.md"
# Items of the list: the title of an entry, and what it is found by.
ITEM = re.compile(r"^- \[([^]]+)\]\(#[^)]+\): (.+(?:\n  .+)*)$", re.MULTILINE)
WORDS = re.compile(r"`([^`]+)`")
# What only the page has: roles, links, and the function that prints how a call is refused.
ON_PAGE = (
    (re.compile(r"\{\w+\}(?=`)"), ""),
    (re.compile(r"\[([^]]+)\]\([^)]+\)"), r"\1"),
    (re.compile(r"^refused\(lambda: (.+)\)$", re.MULTILINE), r"\1"),
)


def explain(
    words: Annotated[
        list[str] | None,
        argument(
            help="Kind of an error, status, or words of a message; without it, what there is.",
        ),
    ] = None,
) -> None:
    """Tell what an error or a status means, and what helps."""
    from rich.markdown import Markdown

    from dmoc.base.arguments import shown

    text = _page()
    asked = " ".join(words or ()).strip()
    chosen = _entries(text, asked) if asked else [text[: text.index("\n\nThe entries below")]]
    if not chosen:
        err.print(
            f"error: no entry has {shown(asked)}: dmoc explain alone lists the words that entries "
            "are found by.",
            style="red",
            soft_wrap=True,
        )
        sys.exit(BAD_INPUT)
    for entry in chosen:
        for pattern, instead in ON_PAGE:
            entry = pattern.sub(instead, entry)
        out.print(Markdown(entry))


def _page() -> str:
    from importlib import resources

    return resources.files("dmoc.cli").joinpath(PAGE).read_text(encoding="utf-8")


def _entries(text: str, asked: str) -> list[str]:
    """The entries with a title, or found by words, that are asked for or part of it."""
    by_title = {e.partition("\n")[0]: f"## {e}" for e in text.split("\n## ")[1:]}
    items = ((title, re.sub(r"\s+", " ", words)) for title, words in ITEM.findall(text))
    named = {title: {title, *WORDS.findall(words)} for title, words in items}
    wanted = asked.lower()
    exact = [t for t, names in named.items() if wanted in {n.lower() for n in names}]
    titles = exact or [t for t, names in named.items() if any(_is_in(n, wanted) for n in names)]
    return [by_title[title] for title in dict.fromkeys(titles)]


def _is_in(words: str, message: str) -> bool:
    """Whether a message has some words, of which "..." are any, or is part of them."""
    pattern = ".*".join(re.escape(part.strip()) for part in words.lower().split("..."))
    return bool(re.search(pattern, message)) or (len(message) > 3 and message in words.lower())
